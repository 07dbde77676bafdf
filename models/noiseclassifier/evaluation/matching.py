"""True class of each frame of whole recordings, and which frames overlap which failure.

A frame *is* a failure if it holds an annotated block of it whole, or is filled by it by half or
more (by several: that which fills most); it is `ok` if it lies wholly in `ok` blocks. Any other
frame is unclear, and counts for nothing. Times that differ by a sample or less are the same:
annotations are written with few digits.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np

from noiseclassifier.evaluation.predictions import Predictions
from noiseclassifier.labels import Labels
from noiseclassifier.recording import Block
from noiseclassifier.types import Array, Index, Mask, Words

OK = "ok"
UNCLEAR = ""


@dataclass(frozen=True, eq=False)
class Frames:
    """Frames of whole recordings, in order.

    Attributes:
        run: Number of the recording, shape (frames,).
        start: When it starts, shape (frames,), in [s].
        stop: When it stops, shape (frames,), in [s].
        predicted: Its predicted class, debounced, shape (frames,).
        suspect: Whether it is not `ok` by itself, shape (frames,).
        novel: Whether it is out of distribution, shape (frames,).
        flagged: Whether it belongs to a finding, shape (frames,).
        scores: Of each class, shape (frames, classes).
        truth: Its true class, `UNCLEAR` where that is not annotated, shape (frames,).
        in_ok: Whether it lies wholly in `ok` blocks, shape (frames,).
        failing: Whether it overlaps a failure, shape (frames,).
    """

    run: Index
    start: Array
    stop: Array
    predicted: Words
    suspect: Mask
    novel: Mask
    flagged: Mask
    scores: Array
    truth: Words
    in_ok: Mask
    failing: Mask

    def __len__(self) -> int:
        return len(self.run)


@dataclass(frozen=True, eq=False)
class Failures:
    """Annotated blocks of failures, in order.

    Attributes:
        run: Number of the recording, shape (failures,).
        start: When it starts, shape (failures,), in [s].
        stop: When it stops, shape (failures,), in [s].
        label: Its class, shape (failures,).
        first: The first frame that overlaps it, shape (failures,).
        end: The frame after the last one that does, ``first`` if none does, shape (failures,).
    """

    run: Index
    start: Array
    stop: Array
    label: Words
    first: Index
    end: Index

    def __len__(self) -> int:
        return len(self.run)


@dataclass(frozen=True, eq=False)
class Matched:
    """Recordings, one after another, with frames matched to annotations.

    Attributes:
        names: Of the recordings, shape (runs,).
        classes: Of the model.
        confirms: Whether a finding takes more than one frame of evidence.
        frames: Their frames.
        failures: Their failures.
        ok_annotated: `ok` time of each recording, shape (runs,), in [s].
        ok_covered: That part of it that frames within `ok` blocks cover, shape (runs,), in [s]. In
            `ok` blocks shorter than a frame, no false alarm is possible.
        slack: Times that differ by less are the same, in [s].
    """

    names: tuple[str, ...]
    classes: tuple[str, ...]
    confirms: bool
    frames: Frames
    failures: Failures
    ok_annotated: Array
    ok_covered: Array
    slack: float

    @classmethod
    def of(cls, predictions: Sequence[Predictions]) -> Self:
        """Match predictions with annotations.

        Args:
            predictions: Recordings, one or more.
        """
        slack = 1.5 * max(one.step for one in predictions)
        frames, failures, annotated, covered = [], [], [], []
        count = 0
        for number, one in enumerate(predictions):
            found, bad, ok = _match(one, number, count, slack)
            frames.append(found)
            failures.append(bad)
            annotated.append(sum(block.stop - block.start for block in ok))
            covered.append(_covered(found))
            count += len(found)
        return cls(
            tuple(one.name for one in predictions),
            predictions[0].labels.classes,
            predictions[0].labels.above_threshold is not None,
            Frames(*_joined(frames)),
            Failures(*_joined(failures)),
            np.array(annotated, dtype=np.float64),
            np.array(covered),
            slack,
        )

    def by_run(self, run: Index) -> Array:
        """Count by recording, shape (runs,)."""
        return np.bincount(run, minlength=len(self.names)).astype(np.float64)


def with_frames(one: Predictions) -> Predictions:
    """Predictions on the frames of the whole recording whose true class is known, not on blocks."""
    truth = Matched.of([one]).frames.truth
    known = truth != UNCLEAR
    return replace(one, truth=truth[known], predicted=one.labels.label[known])


def _match(
    one: Predictions, number: int, before: int, slack: float
) -> tuple[Frames, Failures, list[Block]]:
    """Match the frames of one recording.

    Args:
        one: The recording.
        number: Its number.
        before: Frames of the recordings before it.
        slack: Times that differ by less are the same, in [s].

    Returns:
        Its frames, its failures, and its `ok` blocks, merged.
    """
    start, stop = one.labels.start, one.labels.stop
    ok = _merged([block for block in one.blocks if block.label == OK])
    bad = [block for block in one.blocks if block.label != OK]
    in_ok = _overlap(start, stop, ok).sum(axis=1) > stop - start - slack
    shared = _overlap(start, stop, bad)
    overlaps = shared > slack
    first = overlaps.argmax(axis=0) if len(start) else np.zeros(len(bad), dtype=np.intp)
    own = np.full(len(start), number)
    frames = Frames(
        own,
        start,
        stop,
        one.labels.debounced,
        one.labels.label != OK,
        _novel(one.labels),
        one.labels.flagged,
        one.labels.scores,
        np.where(in_ok, OK, _failure_of(shared, start, stop, bad, slack)),
        in_ok,
        np.any(overlaps, axis=1),
    )
    failures = Failures(
        np.full(len(bad), number),
        np.array([block.start for block in bad], dtype=np.float64),
        np.array([block.stop for block in bad], dtype=np.float64),
        np.array([block.label for block in bad], dtype=str),
        before + first,
        before + first + overlaps.sum(axis=0),
    )
    return frames, failures, ok


def _novel(labels: Labels) -> Mask:
    return np.zeros(len(labels), dtype=bool) if labels.novel is None else labels.novel


def _overlap(start: Array, stop: Array, blocks: Sequence[Block]) -> Array:
    """Time that frames share with blocks, shape (frames, blocks), in [s]."""
    begins = np.array([block.start for block in blocks], dtype=np.float64)
    ends = np.array([block.stop for block in blocks], dtype=np.float64)
    shared = np.minimum(stop[:, None], ends) - np.maximum(start[:, None], begins)
    return np.asarray(np.maximum(shared, 0.0), dtype=np.float64)


def _failure_of(
    shared: Array, start: Array, stop: Array, bad: Sequence[Block], slack: float
) -> Words:
    """True failure class of each frame, `UNCLEAR` where it is none, shape (frames,)."""
    if not bad:
        return np.full(len(start), UNCLEAR)
    whole = np.array([block.stop - block.start for block in bad])
    enough = shared > np.minimum(whole, (stop - start)[:, None] / 2.0) - slack
    filled = np.where(enough & (shared > 0.0), shared, 0.0)
    names = np.array([block.label for block in bad])
    return np.where(filled.any(axis=1), names[filled.argmax(axis=1)], UNCLEAR)


def _merged(blocks: Sequence[Block]) -> list[Block]:
    """Merge blocks that overlap or touch, so that no time counts twice."""
    merged: list[Block] = []
    for block in blocks:
        if merged and block.start <= merged[-1].stop:
            merged[-1] = merged[-1]._replace(stop=max(merged[-1].stop, block.stop))
        else:
            merged.append(block)
    return merged


def _covered(frames: Frames) -> float:
    """Time that frames within `ok` blocks cover, in [s]."""
    start, stop = frames.start[frames.in_ok], frames.stop[frames.in_ok]
    return float((stop - np.maximum(start, np.append(-np.inf, stop[:-1]))).sum())


def _joined(parts: Sequence[Frames] | Sequence[Failures]) -> list[np.ndarray]:
    names = [field.name for field in fields(parts[0])]
    return [np.concatenate([getattr(part, name) for part in parts]) for name in names]
