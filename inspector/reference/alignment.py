"""Frames of repetitions that belong to each frame of a run, by dynamic time warping of positions.

The path may begin and end anywhere (open ends), and runs at half to twice the repetition's speed:
its frame advances by 0, 1 or 2 with each frame of the run, never twice by 0 in a row but before the
repetition's start and after its end, where a longer run may stay. So each row of costs follows from
the row before, for all repetitions at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from noisemodel.types import Array

PAD = 20
"""Frames for which a repetition is held before its start and after its end: delays."""
STEP_COST = 1e-3
"""Cost of a frame that is skipped or held, in squared standard deviations of the motion."""
OUTSIDE = 0.36
"""Largest cost of a frame before the start or after the end, in squared standard deviations."""
STEPS = np.array([1, 1, 2, 2, 0])
"""Frames by which a path advances, by the code in `came`: odd codes come from a frame that was
held; the last one waits at an end."""
LARGEST = 4_000_000
"""Cells of a matrix of costs; of longer runs every second frame is aligned, and so on."""
STILL = 0.05
"""Added to the standard deviation of each joint's positions, in [rad]: what is no motion."""
SLOPE = (0.85, 1.18)
"""Speeds of a repetition within which levels are comparable."""
REACH = 10
"""Frames to each side over which that speed is taken."""


@dataclass(frozen=True, eq=False)
class Aligned:
    """Where each frame of a run lies in a repetition.

    Attributes:
        frame: Frame of the repetition, shape (frames,).
        residual: Largest difference of positions in any joint, in standard deviations of the
            motion, shape (frames,); infinite where the speeds differ too much.
        inside: Whether the frame is one of the repetition, not before its start or after its end.
    """

    frame: NDArray[np.int64]
    residual: Array
    inside: NDArray[np.bool_]

    @property
    def slope(self) -> float:
        """Speed of the run divided by the repetition's."""
        moved = np.flatnonzero(self.inside)
        if len(moved) < 2:
            return float("nan")
        first, last = int(moved[0]), int(moved[-1])
        return float(self.frame[last] - self.frame[first]) / (last - first)


def align(run: Array, repetitions: Sequence[Array]) -> list[Aligned]:
    """Find the frames of repetitions that belong to each frame of a run.

    Args:
        run: Slow positions, shape (frames, joints).
        repetitions: The same of each repetition, with the same joints.
    """
    if not len(repetitions):
        return []
    scale = np.stack([each.std(axis=0) for each in repetitions]).max(axis=0) + STILL
    run = run / scale
    held = [np.pad(each / scale, ((PAD, PAD), (0, 0)), mode="edge") for each in repetitions]
    longest = max(map(len, held))
    thin = int(np.ceil(np.sqrt(len(run) * longest / LARGEST)))
    paths = _paths(run[::thin], [each[::thin] for each in held], -(-PAD // thin))
    if thin > 1:
        at = np.arange(len(run)) / thin
        paths = [np.round(np.interp(at, np.arange(len(p)), p * thin)).astype(int) for p in paths]
    found = []
    for path, other, repetition in zip(paths, held, repetitions, strict=True):
        path = np.clip(path, 0, len(other) - 1)
        residual = np.abs(run - other[path]).max(axis=1)
        inside = (path >= PAD) & (path < PAD + len(repetition))
        residual[inside & ~_comparable(path)] = np.inf
        found.append(Aligned(np.clip(path - PAD, 0, len(repetition) - 1), residual, inside))
    return found


def _comparable(path: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether run and repetition are about equally fast around each frame."""
    frames = np.arange(len(path))
    low, high = np.maximum(frames - REACH, 0), np.minimum(frames + REACH, len(path) - 1)
    slope = (path[high] - path[low]) / np.maximum(high - low, 1)
    # One frame more or less is rounding.
    slack = 1.0 / np.maximum(high - low, 1)
    return np.asarray((slope >= SLOPE[0] - slack) & (slope <= SLOPE[1] + slack))


def _paths(run: Array, held: Sequence[Array], pad: int) -> list[NDArray[np.int64]]:
    """Frame of each repetition for each frame of a run; so many are before and after it."""
    count, width, rows = len(held), max(map(len, held)), len(run)
    distance = np.full((rows, count, width), np.inf, dtype=np.float32)
    for place, other in enumerate(held):
        square = (run**2).mean(axis=1)[:, None] + (other**2).mean(axis=1)
        square -= 2 * run @ other.T / run.shape[1]
        for outside in (slice(pad), slice(-pad, None)):
            square[:, outside] = np.minimum(square[:, outside], OUTSIDE)
        distance[:, place, : len(other)] = np.maximum(square, 0.0)
    edges = np.array([[0, len(other) - 1] for other in held]) + width * np.arange(count)[:, None]
    # moved: the path came from another frame; stayed: from the same one, which it may only once.
    moved = distance[0] + STEP_COST * np.abs(np.arange(width) - pad)
    stayed = np.full((count, width), np.inf)
    came = np.zeros((rows, count, width), dtype=np.uint8)
    # Two columns before the first frame, so that the frames before one are parts of these.
    before = np.full((count, width + 2), np.inf)
    was_held = np.zeros((count, width + 2), dtype=np.uint8)
    for row in range(1, rows):
        np.minimum(moved, stayed, out=before[:, 2:])
        np.less(stayed, moved, out=was_held[:, 2:])
        one, two = before[:, 1:-1], before[:, :-2] + STEP_COST
        came[row] = np.where(two < one, 2 + was_held[:, :-2], was_held[:, 1:-1])
        stayed = distance[row] + moved + STEP_COST
        moved = distance[row] + np.minimum(one, two)
        at_edges, steps = moved.ravel(), came[row].ravel()
        longer = stayed.ravel()[edges] < at_edges[edges]
        at_edges[edges[longer]] = stayed.ravel()[edges[longer]]
        steps[edges[longer]] = len(STEPS) - 1
    stay = stayed.min(axis=1) < moved.min(axis=1)
    at = np.where(stay, stayed.argmin(axis=1), moved.argmin(axis=1))
    path = np.zeros((rows, count), dtype=np.int64)
    for row in range(rows - 1, -1, -1):
        path[row] = at
        if row:
            code = came[row, np.arange(count), at]
            step = np.where(stay, 0, STEPS[code])
            stay = np.where(stay, False, code % 2 == 1)
            at = at - step
    return list(path.T)
