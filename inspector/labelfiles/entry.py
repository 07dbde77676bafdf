"""One label of a file, before it is known whether it fits a run."""

from dataclasses import dataclass
from math import isfinite
from typing import Protocol

from inspector.labelfiles.errors import EntryError


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
