"""What is raised where the engine or the command line refuses something."""


class Error(Exception):
    """The engine or the command line refused something; nothing has changed.

    status the engine's word: ARGUMENT, ALIGNMENT, MEMORY, FORMAT, VERSION, SEMANTICS, POSE, JOINTS or MODEL (dcloth.h).
            Of `convert` and `evaluate`: INPUT for bad input, THRESHOLD for a missed bound, SYSTEM where the command did
            not run to its end
    text    what was found, what is allowed and how to mend it
    """

    def __init__(self, status: str, text: str) -> None:
        super().__init__(status, text)
        self.status = status
        self.text = text

    def __str__(self) -> str:
        return f"{self.status}: {self.text}"
