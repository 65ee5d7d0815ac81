"""What is refused, where, what is allowed and how to mend it."""


class TruthError(ValueError):
    """A file that cannot become training data."""


def refuse(path, found, allowed, mend="", frame=None):
    where = f"{path}" if frame is None else f"{path}: frame {frame}"
    raise TruthError(f"{where}: found {found}, allowed {allowed}" + (f"; {mend}" if mend else ""))
