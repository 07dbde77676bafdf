"""Labels: what a classifier hears in each frame of a signal, and the events that they make."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from models.types import Array, Words


@dataclass(frozen=True)
class Event:
    """A finding: neighbouring frames of one failure class, as one."""

    label: str
    """The class."""
    start: float
    """When its first frame starts, in [s]."""
    stop: float
    """When its last frame stops, in [s]."""
    score: float
    """The highest score that the class has in one of its frames."""

    def __str__(self) -> str:
        return f"{self.label} from {self.start:.2f} s to {self.stop:.2f} s (score {self.score:.2f})"


@dataclass(frozen=True, eq=False)
class Labels:
    """What a classifier hears in each frame of a signal, in order of time.

    Attributes:
        start: When each frame starts, shape (frames,), in [s].
        stop: When it stops, shape (frames,), in [s].
        label: Its class, shape (frames,).
        scores: How certain each class is, shape (frames, classes); comparable within one model.
        classes: Names of the classes, `ok` first.
    """

    start: Array
    stop: Array
    label: Words
    scores: Array
    classes: tuple[str, ...]

    def events(self) -> tuple[Event, ...]:
        """Merge adjacent frames of one failure class.

        Returns:
            Findings only, no `ok`, in order of time. Frames overlap, and so may events.
        """
        if not len(self.label):
            return ()
        changes = [
            i
            for i in range(1, len(self))
            if self.label[i] != self.label[i - 1] or self.start[i] > self.stop[i - 1]
        ]
        bounds = pairwise([0, *changes, len(self.label)])
        return tuple(
            self._event(first, last) for first, last in bounds if self.label[first] != "ok"
        )

    def _event(self, first: int, last: int) -> Event:
        label = str(self.label[first])
        scores = self.scores[first:last, self.classes.index(label)]
        return Event(
            label, float(self.start[first]), float(self.stop[last - 1]), float(np.max(scores))
        )

    def __len__(self) -> int:
        return len(self.label)

    def __str__(self) -> str:
        heard = [str(event) for event in self.events()] or ["no findings"]
        return "\n".join([*heard, f"in {len(self)} frames"])
