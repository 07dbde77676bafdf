"""Steps of one foot: footholds, paths and contacts."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from noiseclassifier.scenarios.clock import TICK
from noiseclassifier.scenarios.contacts import Contact
from noiseclassifier.scenarios.paths import minimum_jerk
from noiseclassifier.scenarios.quadruped.gait import Beat
from noisemodel.types import Array

TOP = 0.4
"""Share of a swing after which the foot is highest."""
ACROSS = 0.8
"""Share of a swing after which the foot is over its next foothold."""
NEAR = 0.8
"""Share of a swing after which a contact is planned."""
LANDING = 0.1
"""Speed at which a foot is to touch the ground, in heights of its swing per time of its descent."""


class Foothold(NamedTuple):
    """Place of a foot, in [m], and the direction of the body, in [rad]."""

    x: float
    y: float
    yaw: float


def progress(share: Array) -> Array:
    """Completed share of the path of a foot after a share of its swing."""
    return minimum_jerk(np.minimum(1, share / ACROSS))


def height(share: Array) -> Array:
    """Height of a foot after a share of its swing, 1 at the top."""
    up = minimum_jerk(np.minimum(1, share / TOP))
    left = np.clip((1 - share) / (1 - TOP), 0, 1)
    # From rest to the ground at the landing speed, without acceleration at either end.
    down = minimum_jerk(left) + LANDING * left * (1 - left) ** 3 * (1 + 3 * left)
    return np.where(share < TOP, up, down)


def footholds(
    beats: Sequence[Beat], hip: Array, *, way: Array, yaw: Array, stop: float
) -> list[Foothold]:
    """Footholds: under the hip in the middle of each stance.

    This is the neutral point of Raibert, Legged Robots That Balance, 1986.

    Args:
        hip: Where the foot stands at first, shape (2,), in [m].
        way: Path of the body at every tick, shape (ticks, 2), in [m].
        yaw: Direction of the body at every tick, shape (ticks,), in [rad].
        stop: When the body is at rest, in [s].
    """
    ends = [*(beat.lift for beat in beats), np.inf][1:]
    middles = [(beat.touch + end) / 2 for beat, end in zip(beats, ends, strict=True)]
    ticks = [0, *(round(min(stop, middle) / TICK) for middle in middles)]
    out = []
    for (x, y), turn in zip(way[ticks].tolist(), yaw[ticks].tolist(), strict=True):
        cosine, sine = np.cos(turn), np.sin(turn)
        hip_x = float(x + cosine * hip[0] - sine * hip[1])
        out.append(Foothold(hip_x, float(y + sine * hip[0] + cosine * hip[1]), turn))
    return out


def path(time: Array, beats: Sequence[Beat], places: Sequence[Foothold], progress: Array) -> Array:
    """Path of a foot from foothold to foothold.

    Args:
        time: Shape (times,), in [s].
        progress: Completed share of its path in its swing, shape (times,).

    Returns:
        Path of the foot over the ground, shape (times, 2), in [m].
    """
    stands = np.array(places)[:, :2]
    begun = np.searchsorted([beat.lift for beat in beats], time, side="right")
    before = stands[np.maximum(begun - 1, 0)]
    return np.asarray(before + progress[:, None] * (stands[begun] - before))


def contacts(foot: int, beats: Sequence[Beat], places: Sequence[Foothold]) -> list[Contact]:
    """Planned contacts of a foot."""

    def during(share: float) -> list[float]:
        return [beat.lift + share * (beat.touch - beat.lift) for beat in beats]

    return [
        Contact(start, lift, stop, (place.x, place.y, 0.0), foot, place.yaw, approach)
        for start, lift, stop, approach, place in zip(
            [-1.0, *during(NEAR)],
            [*during(0.0), np.inf],
            [*during(TOP), np.inf],
            [0.0, *during(TOP)],
            places,
            strict=True,
        )
    ]
