"""Labels: the class that a classifier gives each frame of a signal, and the events they form.

From frames to findings, the same for every estimator that gives probabilities:

1. A frame whose probability of any failure is above the alarm threshold is *evidence*, whatever
   its novelty: a fault does not become `ok` by being louder than all of the training set.
2. A frame that is out of distribution and below the threshold is `unknown`, and evidence too: its
   probabilities are not valid there, so that it cannot be `ok`.
3. Consecutive frames that are not `ok` form a stretch. It is confirmed by two frames of evidence;
   a frame at either end of the signal or beside a gap counts twice, since the neighbour that would
   confirm it is missing. Failure frames of other stretches are `ok`, their `unknown` frames remain
   `unknown` and raise nothing.
4. Frames of confirmed stretches that overlap or touch are one event, of the class of most failure
   frames. `unknown` frames in it mark it as out of distribution.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from noiseclassifier.signals import Array, Index, Mask, Words

UNKNOWN = "unknown"  # label of a frame that is out of distribution and below the alarm threshold
CONFIRM = 2  # frames of evidence in a stretch that make it a finding


@dataclass(frozen=True)
class Event:
    """A finding: neighbouring frames of one failure class, as one."""

    label: str  #: the class
    start: float  #: when its first frame starts, in [s]
    stop: float  #: when its last frame stops, in [s]
    #: The highest probability of any failure in one of its frames, which the alarm threshold is of
    #: too; of a model without one, the highest score of the class.
    score: float
    novel: bool = False  #: whether one of its frames is out of distribution
    #: Of a line that was followed, the joint, as a row of the signals that go joint by joint, and
    #: the frequency, in [Hz].
    line: tuple[int, float] | None = field(default=None, compare=False, kw_only=True)

    @property
    def novelty(self) -> str:
        """End of a text about the event: ", out of distribution", or nothing."""
        return ", out of distribution" if self.novel else ""

    def __str__(self) -> str:
        score = f"(score {self.score:.2f}{self.novelty})"
        return f"{self.label} from {interval(self.start, self.stop)} {score}"


@dataclass(frozen=True, eq=False)
class Labels:
    """Predictions for each frame of a signal, in order of time."""

    start: Array  #: when each frame starts, shape (frames,), in [s]
    stop: Array  #: when it stops
    label: Words  #: its class, or `unknown`, by the frame alone
    scores: Array  #: how certain each class is, shape (frames, classes); comparable in one model
    classes: tuple[str, ...]  #: their names, `ok` first
    above_threshold: Mask | None = None  #: the alarm threshold; None: each frame that is not `ok`
    novel: Mask | None = None  #: out of distribution; None: the estimator has no measure of that
    unknown_is_finding: bool = True  #: whether `unknown` frames are evidence, or raise nothing
    hop: float | None = None  #: from one frame to the next, in [s]; None: the smallest distance

    @property
    def step(self) -> float:
        """Time from one frame to the next, in [s]; a frame's duration if there is no next one."""
        if self.hop is not None:
            return self.hop
        apart = np.diff(self.start)[: max(1, len(self) - 2)]
        return float(apart.min(initial=float(self.stop[0] - self.start[0])))

    @cached_property
    def flagged(self) -> Mask:
        """Whether a frame belongs to a finding, shape (frames,)."""
        unknown = self.label == UNKNOWN
        suspect: Mask = self.label != "ok"
        if not self.unknown_is_finding:
            suspect = suspect & ~unknown
        if self.above_threshold is None:
            return suspect
        begins, weight = sides(suspect, self.apart)
        stretch = np.cumsum(begins)
        evidence = suspect & (self.above_threshold | unknown)
        total = np.bincount(stretch[evidence], weight[evidence], minlength=len(suspect) + 1)
        return np.asarray(suspect & (total[stretch] >= CONFIRM))

    @property
    def apart(self) -> Mask:
        """Whether a frame and the next neither overlap nor touch, shape (frames - 1,)."""
        return np.asarray(self.start[1:] > self.stop[:-1])

    @cached_property
    def stretches(self) -> tuple[Index, ...]:
        """Flagged frames that overlap or touch: each group is one finding."""
        own = np.flatnonzero(self.flagged)
        apart = np.flatnonzero(self.start[own[1:]] > self.stop[own[:-1]]) + 1
        return tuple(group for group in np.split(own, apart) if len(group))

    @cached_property
    def debounced(self) -> Words:
        """Label of each frame after confirmation by its neighbours, shape (frames,)."""
        if self.above_threshold is None:
            return self.label
        labels = np.where(self.label == UNKNOWN, self.label, "ok")
        for frames in self.stretches:
            labels[frames] = self._name(frames)
        return labels

    def _name(self, frames: Index) -> str:
        """The class of most frames; `unknown` only where all are."""
        names, first, count = np.unique(self.label[frames], return_index=True, return_counts=True)
        return str(names[np.lexsort((-first, count, names != UNKNOWN))[-1]])

    @property
    def raw(self) -> Words:
        """Label of each frame by itself, a failure only above the threshold, shape (frames,).

        No other label is possible while the frames after it are still to come.
        """
        if self.above_threshold is None:
            return self.label
        keep = self.above_threshold | np.isin(self.label, ("ok", UNKNOWN))
        return np.where(keep, self.label, "ok")

    def events(self) -> tuple[Event, ...]:
        """Findings in order of time, none overlaps another: one for each stretch of flagged frames.

        A stretch has the class of most of its time: the frames at both ends of an oscillation often
        look like an impact.
        """
        found = []
        for frames in self.stretches:
            label, scores = self._name(frames), self.scores[frames]
            if self.above_threshold is not None:  # of any failure, as the alarm threshold
                score = 1.0 - float(scores[:, 0].min())
            elif label in self.classes:
                score = float(scores[:, self.classes.index(label)].max())
            else:
                score = float(scores[:, 1:].max())
            start, stop = float(self.start[frames[0]]), float(self.stop[frames[-1]])
            novel = self.novel is not None and bool(self.novel[frames].any())
            found.append(Event(label, start, stop, score, novel))
        return tuple(found)

    @staticmethod
    def concatenated(parts: Sequence["Labels"]) -> "Labels":
        """Join labels of one model that follow each other, one or more."""
        each = [part._arrays() for part in parts]
        joined: dict[str, Any] = {
            name: np.concatenate([arrays[name] for arrays in each]) for name in each[0]
        }
        return replace(parts[0], **joined)

    def part(self, frames: slice) -> "Labels":
        """Take the labels of some frames."""
        return replace(self, **{name: array[frames] for name, array in self._arrays().items()})

    def _arrays(self) -> dict[str, Any]:
        """Fields with an entry for each frame."""
        names = ("start", "stop", "label", "scores", "above_threshold", "novel")
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}

    def __len__(self) -> int:
        return len(self.label)

    def __str__(self) -> str:
        found = [str(event) for event in self.events()] or ["no findings"]
        return "\n".join([*found, f"in {len(self)} frames"])


def interval(start: float, stop: float) -> str:
    """Write two times in [s]: to a hundredth, or to a thousandth if they are less apart."""
    digits = 2 if stop - start >= 0.01 else 3
    return f"{start:.{digits}f} s to {stop:.{digits}f} s"


def sides(suspect: Mask, apart: Mask) -> tuple[Mask, Index]:
    """Whether a stretch of suspect frames begins with a frame, and how often the frame counts.

    A frame without a neighbour on one side counts twice: the neighbour would hold the failure too.
    """
    first = np.append(True, apart)[: len(suspect)]
    last = np.append(apart, True)[: len(suspect)]
    begins: Mask = suspect & (first | ~np.append(False, suspect)[: len(suspect)])
    return begins, np.where(first | last, 2, 1)
