"""Labels: what a classifier hears in each frame of a signal, and the events that they make."""

from dataclasses import dataclass

import numpy as np

from models.types import Array, Index, Mask, Words

UNKNOWN = "unknown"
"""What a frame is called that is like nothing the classifier has learnt from."""
ANOMALY = "anomaly"
"""What a baseline, which has learnt from good runs alone, calls a frame that is unlike them."""

CONFIRM = 2
"""Frames of a stretch that have to be sure of a failure for it to be a finding."""


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
        label: Its class, or `unknown`, as the frame alone tells, shape (frames,).
        scores: How certain each class is, shape (frames, classes); comparable within one model.
        classes: Names of the classes, `ok` first.
        above_threshold: Whether a frame is above the alarm threshold, shape (frames,); None
            if each frame that is called a failure is.
    """

    start: Array
    stop: Array
    label: Words
    scores: Array
    classes: tuple[str, ...]
    above_threshold: Mask | None = None

    @property
    def debounced(self) -> Words:
        """What each frame is called in the light of its neighbours, shape (frames,).

        Failure frames one after the other make a stretch. One of which less than two frames are
        sure is `ok`: good motion startles a frame now and then, and what goes wrong is in several.
        Only where the signal begins or ends, or a gap does, it may be in a single one.
        """
        if self.above_threshold is None:
            return self.label
        failing = ~np.isin(self.label, ("ok", UNKNOWN))
        apart = self.start[1:] > self.stop[:-1]
        kept = confirmed(failing, self.above_threshold, apart)
        return np.where(failing & ~kept, "ok", self.label)

    @property
    def raw(self) -> Words:
        """What each frame is called by itself, a failure only where it is sure, shape (frames,).

        That is all that can be said while the frames after it are still to come.
        """
        if self.above_threshold is None:
            return self.label
        keep = self.above_threshold | np.isin(self.label, ("ok", UNKNOWN))
        return np.where(keep, self.label, "ok")

    def score(self, frame: int) -> float:
        """Give the score of what a frame is called; 0 if it is unknown."""
        label = str(self.label[frame])
        known = label in self.classes
        return float(self.scores[frame, self.classes.index(label)]) if known else 0.0

    def events(self) -> tuple[Event, ...]:
        """Merge settled frames of one failure class that overlap or follow each other.

        Returns:
            Findings only, no `ok`, in order of time. Frames overlap, and so may events of
            different classes; events of one class never do.
        """
        found: list[Event] = []
        debounced = self.debounced
        for label in (name for name in self.classes if name != "ok"):
            own = np.flatnonzero(debounced == label)
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


def confirmed(failing: Mask, above_threshold: Mask, apart: Mask, *, least: int = CONFIRM) -> Mask:
    """Keep the failure frames of those stretches of which enough frames are sure.

    A frame without a neighbour on one side counts twice: what goes wrong there, the neighbour
    would hold as well.

    Args:
        failing: Whether a frame seems to be a failure, shape (frames,).
        above_threshold: Whether it is above the alarm threshold, shape (frames,).
        apart: Whether a frame and the next neither overlap nor touch, shape (frames - 1,).
        least: How many sure frames are enough.

    Returns:
        The failure frames that are kept, shape (frames,).
    """
    first = np.append(True, apart)[: len(failing)]
    last = np.append(apart, True)[: len(failing)]
    stretch = np.cumsum(failing & (first | ~np.append(False, failing)[: len(failing)]))
    count = np.where(first | last, 2, 1)[failing & above_threshold]
    enough = (
        np.bincount(stretch[failing & above_threshold], count, minlength=len(failing) + 1) >= least
    )
    kept: Mask = failing & enough[stretch]
    return kept
