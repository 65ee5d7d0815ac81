"""How a command of this package ends: 0, or 2 with what was wrong in one line on stderr."""
import os
import sys


def ended(name, work):
    """Runs work() -> the exit status. Files, their contents and options that do not fit are told, not traced."""
    try:
        work()
    except OSError as error:
        told = f"{error.filename}: {error.strerror}" if error.filename and error.strerror else error
        print(f"{name}: error: {told}", file=sys.stderr)
        return 2
    except (ValueError, FloatingPointError) as error:
        print(f"{name}: error: {error}", file=sys.stderr)
        return 2
    return 0


def folder_of(path):
    """Refuses a file to be written where it could not be, before the work rather than after it."""
    folder = os.path.dirname(path) or "."
    if not os.path.isdir(folder):
        raise ValueError(f"{folder}: no such folder for {os.path.basename(path)}; make it first")
