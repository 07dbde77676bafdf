"""Labels: what a classifier hears in each frame of a signal, and the events that they make."""

from dataclasses import dataclass

import numpy as np

from models.types import Array, Index, Words

UNKNOWN = "unknown"
"""What a frame is called that is like nothing the classifier has learnt from."""


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
        label: Its class, or `unknown`, shape (frames,).
        scores: How certain each class is, shape (frames, classes); comparable within one model.
        classes: Names of the classes, `ok` first.
    """

    start: Array
    stop: Array
    label: Words
    scores: Array
    classes: tuple[str, ...]

    def score(self, frame: int) -> float:
        """Give the score of what a frame is called; 0 if it is unknown."""
        label = str(self.label[frame])
        known = label in self.classes
        return float(self.scores[frame, self.classes.index(label)]) if known else 0.0

    def events(self) -> tuple[Event, ...]:
        """Merge frames of one failure class that overlap or follow each other.

        Returns:
            Findings only, no `ok`, in order of time. Frames overlap, and so may events of
            different classes; events of one class never do.
        """
        found: list[Event] = []
        for label in (name for name in self.classes if name != "ok"):
            own = np.flatnonzero(self.label == label)
            apart = np.flatnonzero(self.start[own[1:]] > self.stop[own[:-1]]) + 1
            found += [self._event(group) for group in np.split(own, apart) if len(group)]
        return tuple(sorted(found, key=lambda event: (event.start, event.stop)))

    def _event(self, frames: Index) -> Event:
        label = str(self.label[frames[0]])
        score = float(self.scores[frames, self.classes.index(label)].max())
        return Event(label, float(self.start[frames[0]]), float(self.stop[frames[-1]]), score)

    def __len__(self) -> int:
        return len(self.label)

    def __str__(self) -> str:
        heard = [str(event) for event in self.events()] or ["no findings"]
        return "\n".join([*heard, f"in {len(self)} frames"])
