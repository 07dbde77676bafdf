"""Labels as files contain them, before they are checked against a run."""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Protocol

from inspector.errors import InspectorError


class Span(Protocol):
    """A labelled stretch of time: an annotated block, or a finding."""

    @property
    def start(self) -> float:
        """Start, in [s]."""

    @property
    def stop(self) -> float:
        """Stop, in [s]."""

    @property
    def label(self) -> str:
        """Name of the label."""


@dataclass(frozen=True)
class Entry:
    """One label of a file.

    Attributes:
        start: Start, in [s].
        stop: Stop, in [s]; None for the end of the run.
        label: Name of the label.
        where: Its place in the file, such as "line 3".
    """

    start: float
    stop: float | None
    label: str
    where: str


def number(text: str, where: str) -> float:
    """Time parsed from text, in [s].

    Args:
        text: A number with a decimal point.
        where: Its place in the file.

    Raises:
        EntryError: If it is not a finite number.
    """
    try:
        value = float(text)
    except ValueError:
        raise EntryError(f"{text!r} is not a time in seconds", where) from None
    if not isfinite(value):
        raise EntryError(f"{text!r} is not a time in seconds", where)
    return value


class LabelFileError(InspectorError):
    """A file of labels that cannot be read or written.

    Args:
        path: The file.
        problem: What is wrong with it, in one line.
        where: The place in the file, such as "line 3", if there is one.
    """

    def __init__(self, path: Path, problem: str, where: str = "") -> None:
        self.path, self.problem, self.where = path, problem, where
        super().__init__(f"{path}{where and f', {where}'}: {problem}")


class EntryError(ValueError):
    """Invalid text of labels, which is raised again as ``LabelFileError``.

    Args:
        problem: What is wrong, in one line.
        where: The place in the text.
    """

    def __init__(self, problem: str, where: str = "") -> None:
        self.problem, self.where = problem, where
        super().__init__(problem)
