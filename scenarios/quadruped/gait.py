"""Timing of a trot: diagonal pairs of feet swing in turn, with all four loaded in between."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noisemodel.types import Array

PAIRS = (0, 1, 1, 0)
"""Pair of each foot: front left with rear right, front right with rear left."""
DUTY = 0.62
"""Share of a cycle in which a foot is on the ground."""


@dataclass(frozen=True)
class Beat:
    """One swing of one pair of feet.

    Attributes:
        pair: Index of the pair.
        begin: When the weight starts to shift to the other pair, in [s].
        lift: When the feet leave the ground, in [s].
        touch: When they touch it again, in [s].
    """

    pair: int
    begin: float
    lift: float
    touch: float


def beats(
    rng: np.random.Generator, *, begin: float, end: float, period: float, jitter: float
) -> tuple[Beat, ...]:
    """Beats of a trot.

    Args:
        rng: Random number generator.
        begin: Start, in [s].
        end: When all feet have to be on the ground again, in [s].
        period: Mean time of a cycle, in [s].
        jitter: Relative variation of the period of each cycle.

    Returns:
        Two beats per cycle, one per pair.
    """
    out: list[Beat] = []
    while True:
        cycle = period * (1 + float(rng.uniform(-jitter, jitter)))
        if begin + cycle > end:
            return tuple(out)
        for pair in range(2):
            lift = begin + (DUTY - 0.5) * cycle
            touch = lift + (1 - DUTY) * cycle
            out.append(Beat(pair, begin, lift, touch))
            begin = touch


def loads(time: Array, timing: Sequence[Beat]) -> Array:
    """Planned share of the weight on each foot, shape (times, feet); rows add up to 1.

    Args:
        time: Shape (times,), in [s].
        timing: The beats, in order.
    """
    knots: tuple[list[float], list[float]] = ([-1.0], [-1.0])
    bearing: tuple[list[float], list[float]] = ([1.0], [1.0])
    ends = [beat.lift for beat in timing[1:]] + [timing[-1].touch + 0.1]
    for beat, taken in zip(timing, ends, strict=True):
        knots[beat.pair].extend((beat.begin, beat.lift, beat.touch, taken))
        bearing[beat.pair].extend((1.0, 0.0, 0.0, 1.0))
    pairs = np.stack([np.interp(time, *both) for both in zip(knots, bearing, strict=True)], axis=1)
    feet = pairs[:, PAIRS]
    return np.asarray(feet / feet.sum(axis=1, keepdims=True))


def swings(time: Array, timing: Sequence[Beat]) -> Array:
    """Completed share of the swing of each foot, shape (times, feet); 1 on the ground.

    Args:
        time: Shape (times,), in [s].
        timing: The beats, in order.
    """
    pairs = np.ones((len(time), 2))
    for beat in timing:
        now = (beat.lift <= time) & (time < beat.touch)
        pairs[now, beat.pair] = (time[now] - beat.lift) / (beat.touch - beat.lift)
    return pairs[:, PAIRS]
