"""Expected errors of the inspector: one base error, subclasses that keep their facts."""

from pathlib import Path

from inspector.text import printable


class InspectorError(ValueError):
    """The base of every error that `inspector` expects."""


class OptionError(InspectorError):
    """A value of an option that suits no run: the command was called wrongly."""


class FileError(InspectorError):
    """A file of the inspector's own that is wrong; subclasses say what to do about it.

    Args:
        problem: What is wrong with it, in one line.
    """

    advice = ""

    def __init__(self, path: Path, problem: str) -> None:
        self.path, self.problem = path, problem
        super().__init__(f"{path}: {problem}{self.advice}")


class LogError(InspectorError):
    """A log that cannot be read as the motion of a robot.

    Args:
        problem: What is wrong with it, in one line.
        row: The line of the file where that is (the header is line 1), if it is in one place.
    """

    def __init__(self, path: Path, problem: str, row: int | None = None) -> None:
        self.path, self.problem, self.row = path, problem, row
        super().__init__(f"{path}{'' if row is None else f', row {row}'}: {problem}")


def without_path(error: Exception, path: Path) -> str:
    """Text of an error without the name of the file, for lines that begin with it."""
    text = str(error)
    for name in (str(path), printable(str(path))):
        text = text.removeprefix(f"{name}: ").removeprefix(f"{name}, ")
    return text
