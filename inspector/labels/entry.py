"""One label of a file, before it is known whether it fits a run."""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Protocol

from inspector.errors import InspectorError


class Span(Protocol):
    """A labelled stretch of time: an annotated block, or a finding."""

    @property
    def start(self) -> float:
        """When it starts, in [s]."""

    @property
    def stop(self) -> float:
        """When it stops, in [s]."""

    @property
    def label(self) -> str:
        """What it is called."""


@dataclass(frozen=True)
class Entry:
    """A label as a file has it.

    Attributes:
        start: When it starts, in [s].
        stop: When it stops, in [s]; None if it lasts to the end of the run.
        label: What it is called.
        where: Its place in the file, say "line 3".
    """

    start: float
    stop: float | None
    label: str
    where: str


def number(text: str, where: str) -> float:
    """Read a time.

    Args:
        text: A number with a decimal point.
        where: Its place in the file.

    Raises:
        EntryError: If it is no finite number.
    """
    try:
        value = float(text)
    except ValueError:
        raise EntryError(f"{text!r} is no time in seconds", where) from None
    if not isfinite(value):
        raise EntryError(f"{text!r} is no time in seconds", where)
    return value


class LabelFileError(InspectorError):
    """A file of labels that cannot be read or written.

    Args:
        path: The file.
        problem: What is wrong with it, in one line.
        where: The place in the file, say "line 3", if it is in one place.
    """

    def __init__(self, path: Path, problem: str, where: str = "") -> None:
        self.path, self.problem, self.where = path, problem, where
        super().__init__(f"{path}{where and f', {where}'}: {problem}")


class EntryError(ValueError):
    """A place in a text of labels that makes no sense, to become a ``LabelFileError``.

    Args:
        problem: What is wrong, in one line.
        where: The place in the text.
    """

    def __init__(self, problem: str, where: str = "") -> None:
        self.problem, self.where = problem, where
        super().__init__(problem)
