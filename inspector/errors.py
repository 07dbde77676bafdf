"""How commands end: statuses of runs, exit statuses, and the errors that are expected."""

from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path

from inspector.text import printable


class Status(StrEnum):
    """The outcome for a run."""

    OK = "ok"
    FINDINGS = "findings"
    CANNOT_TELL = "cannot-tell"
    BAD_INPUT = "bad-input"
    INTERNAL_ERROR = "internal-error"


class Unknown(StrEnum):
    """What becomes of frames that are out of distribution and below the alarm threshold."""

    FINDING = "finding"
    IGNORE = "ignore"


# Exit status of each, the worst first.
EXIT = {
    Status.INTERNAL_ERROR: 70,
    Status.BAD_INPUT: 3,
    Status.FINDINGS: 1,
    Status.CANNOT_TELL: 4,
    Status.OK: 0,
}
OUTPUT_LOST = 5  # exit status if an output could not be written
WORST = (70, OUTPUT_LOST, 3, 1, 4, 0)  # exit statuses, the worst first
IGNORED = "unknown frames are ignored"  # what outputs say where they are


def worst(codes: Iterable[int]) -> int:
    """Take the worst of several exit statuses; 0 of none."""
    return min(codes, key=WORST.index, default=0)


class InspectorError(ValueError):
    """The base of every error that `inspector` expects."""


class OptionError(InspectorError):
    """A value of an option that suits no run: the command was called wrongly."""


class FileError(InspectorError):
    """A file of the inspector's own that is wrong; subclasses say what to do about it."""

    advice = ""

    def __init__(self, path: Path, problem: str) -> None:
        self.path, self.problem = path, problem
        super().__init__(f"{path}: {problem}{self.advice}")


class LogError(InspectorError):
    """A log that cannot be read as the motion of a robot, in a line of it (the header is 1)."""

    def __init__(self, path: Path, problem: str, row: int | None = None) -> None:
        self.path, self.problem, self.row = path, problem, row
        super().__init__(f"{path}{'' if row is None else f', row {row}'}: {problem}")


def without_path(error: Exception, path: Path) -> str:
    """Text of an error without the name of the file, for lines that begin with it."""
    text = str(error)
    for name in (str(path), printable(str(path))):
        text = text.removeprefix(f"{name}: ").removeprefix(f"{name}, ")
    return text
