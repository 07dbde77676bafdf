"""Timing of gaits: groups of feet swing in turn, with all four loaded in between."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from noisemodel.types import Array

LONGEST = 0.15
"""Longest time in which a group takes its share of the weight, in [s]."""


@dataclass(frozen=True)
class Gait:
    """A gait."""

    groups: tuple[int, int, int, int]
    duty: float
    period: float = 1.0
    level: bool = False

    @property
    def count(self) -> int:
        """Number of groups."""
        return max(self.groups) + 1


TROT = Gait((0, 1, 1, 0), 0.62, level=True)
"""Diagonal pairs."""
GAITS: Mapping[str, Gait] = MappingProxyType(
    {
        "trot": TROT,
        "walk": Gait((1, 3, 0, 2), 0.8, period=1.8),
        "pace": Gait((0, 1, 0, 1), 0.62, period=0.9),
        "bound": Gait((0, 0, 1, 1), 0.62, period=0.9),
    }
)
"""By name: "walk" is the lateral sequence, one foot at a time: rear left, front left, rear right,
front right; a "pace" is by sides; a "bound" is front and rear in turn."""


@dataclass(frozen=True)
class Beat:
    """One swing of one group of feet.

    Attributes:
        begin: When the weight starts to shift to the other feet, in [s].
        lift: When the feet leave the ground, in [s].
        touch: When they touch it again, in [s].
    """

    group: int
    begin: float
    lift: float
    touch: float


def beats(
    rng: np.random.Generator,
    *,
    begin: float,
    end: float,
    period: float,
    jitter: float,
    gait: Gait = TROT,
) -> tuple[Beat, ...]:
    """Beats of a gait.

    Args:
        begin: Start, in [s].
        end: When all feet have to be on the ground again, in [s].
        period: Mean time of a cycle, in [s].
    """
    out: list[Beat] = []
    while True:
        cycle = period * (1 + float(rng.uniform(-jitter, jitter)))
        if begin + cycle > end:
            return tuple(out)
        for group in range(gait.count):
            lift = begin + (gait.duty - (1 - 1 / gait.count)) * cycle
            touch = lift + (1 - gait.duty) * cycle
            out.append(Beat(group, begin, lift, touch))
            begin = touch


def loads(time: Array, timing: Sequence[Beat], gait: Gait = TROT) -> Array:
    """Planned share of the weight on each foot, shape (times, feet); rows add up to 1.

    Args:
        time: Shape (times,), in [s].
    """
    knots = [[-1.0] for _ in range(gait.count)]
    bearing = [[1.0] for _ in range(gait.count)]
    ends = [beat.touch + 0.1 for beat in timing]
    ends[:-1] = [min(following.lift, beat.touch + LONGEST) for beat, following in pairwise(timing)]
    for beat, taken in zip(timing, ends, strict=True):
        knots[beat.group].extend((beat.begin, beat.lift, beat.touch, taken))
        bearing[beat.group].extend((1.0, 0.0, 0.0, 1.0))
    groups = np.stack([np.interp(time, *both) for both in zip(knots, bearing, strict=True)], axis=1)
    feet = groups[:, gait.groups]
    return np.asarray(feet / feet.sum(axis=1, keepdims=True))


def swings(time: Array, timing: Sequence[Beat], gait: Gait = TROT) -> Array:
    """Completed share of the swing of each foot, shape (times, feet); 1 on the ground.

    Args:
        time: Shape (times,), in [s].
    """
    groups = np.ones((len(time), gait.count))
    for beat in timing:
        now = (beat.lift <= time) & (time < beat.touch)
        groups[now, beat.group] = (time[now] - beat.lift) / (beat.touch - beat.lift)
    return groups[:, gait.groups]
