"""What could not be shown: counted, and said once per kind."""

from collections import Counter
from collections.abc import Callable


class Troubles:
    """Counts by kind.

    Args:
        tell: Is given a line when the first of a kind turns up.
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        self.tell = tell
        self._counts: Counter[str] = Counter()

    def note(self, kind: str, line: str, count: int = 1) -> None:
        """Count something, and say it if it is the first of its kind.

        Args:
            kind: What the summary calls it.
            line: What happened now, and what is done about it.
            count: How often.
        """
        if count <= 0:
            return
        if kind not in self._counts:
            self.tell(line)
        self._counts[kind] += count

    @property
    def counts(self) -> dict[str, int]:
        """How many there were of each kind."""
        return dict(self._counts)
