"""The class over time while labels come in: where it changes, and until when it lasts."""

from typing import NamedTuple

from noiseclassifier import Labels


class Change(NamedTuple):
    """A class that begins, or lasts."""

    time: float
    """When, in [s]."""
    state: str
    """The class; empty where nothing is known."""


class Lane:
    """Gives each frame the time around its centre, as the recording of a whole run does.

    Args:
        hop: Time from one frame to the next, in [s].
        length: Duration of a frame, in [s].
    """

    def __init__(self, hop: float, length: float) -> None:
        self._hop, self._length = hop, length
        self._state, self._end = "", 0.0

    def take(self, labels: Labels) -> list[Change]:
        """Where the class changes, and the end of the last frame.

        Args:
            labels: The next ones, in order of time.
        """
        changes = []
        for index, label in enumerate(labels.label.tolist()):
            begin = float(labels.start[index] + labels.stop[index]) / 2 - self._hop / 2
            if begin > self._end + self._hop / 2:
                changes += self.end()
            if label != self._state:
                changes.append(Change(begin, label))
            self._state, self._end = label, begin + self._hop
        return [*changes, Change(self._end, self._state)] if len(labels) else changes

    def expire(self, now: float) -> list[Change]:
        """End the lane if its next frame is overdue.

        Args:
            now: Time of the latest sample, in [s].
        """
        return self.end() if now > self._end + self._length + self._hop else []

    def end(self) -> list[Change]:
        """End what the lane shows."""
        changes = [Change(self._end, "")] if self._state else []
        self._state = ""
        return changes
