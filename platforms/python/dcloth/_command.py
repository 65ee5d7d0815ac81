"""The `dcloth` console script: the executable of this package takes its place."""
import os
import subprocess
import sys

from ._tool import command_path


def main() -> None:
    command = str(command_path())
    if os.name == "nt":
        sys.exit(subprocess.run([command, *sys.argv[1:]]).returncode)
    os.execv(command, ["dcloth", *sys.argv[1:]])
