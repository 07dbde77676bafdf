"""Warnings of what cannot be shown: counted, and emitted once per kind."""

from collections import Counter
from collections.abc import Callable


class Warnings:
    """Warnings by kind.

    Args:
        emit: Called with a line at the first of each kind.
    """

    def __init__(self, emit: Callable[[str], None]) -> None:
        self.emit = emit
        self._counts: Counter[str] = Counter()

    def note(self, kind: str, line: str, count: int = 1) -> None:
        """Count a warning, and emit it if it is the first of its kind.

        Args:
            kind: What the summary calls it.
            line: What happened now, and what is done about it.
            count: How often.
        """
        if count <= 0:
            return
        if kind not in self._counts:
            self.emit(line)
        self._counts[kind] += count

    @property
    def counts(self) -> dict[str, int]:
        """How many there were of each kind."""
        return dict(self._counts)
