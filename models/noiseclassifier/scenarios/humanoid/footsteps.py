"""Footsteps of a humanoid: foot, place and time; drawn by a seed."""

from dataclasses import dataclass, replace

import numpy as np

from noiseclassifier.scenarios.humanoid.motions import Stroll
from noiseclassifier.scenarios.humanoid.robots import Humanoid
from noiseclassifier.scenarios.motions import Walk

REST = (0.6, 1.0)
"""Time of standing before the walk, in [s]."""
CLOSE = 0.6
"""Time in which the weight moves from the last foot to the middle of both, in [s]."""
STAND = 0.3
"""Least time of standing at the end, in [s]."""


@dataclass(frozen=True)
class Step:
    """One step of one foot.

    Attributes:
        place: x, y, z of its sole afterwards, in [m].
        yaw: Its direction afterwards, in [rad].
        shift: When the weight starts to shift to the other foot, in [s].
        start: When it is to leave the ground, in [s].
        stop: When it is to touch the ground, in [s].
        height: Height of its swing, in [m].
    """

    foot: int
    place: tuple[float, float, float]
    yaw: float
    shift: float
    start: float
    stop: float
    height: float


def footsteps(
    robot: Humanoid, motion: Walk, rng: np.random.Generator, duration: float
) -> tuple[Step, ...]:
    """Footsteps of a walk.

    Args:
        duration: Duration of the run, in [s].
    """
    single, double = (
        robot.pace * float(rng.uniform(*span)) for span in (motion.single, motion.double)
    )
    now = float(rng.uniform(*REST))
    longest = single * (1 + motion.jitter) + double
    count = max(1, int((duration - now - CLOSE - STAND) / longest))
    foot = int(rng.integers(2))
    along, across, turn = _advance(robot, motion, rng)
    last = min(int(rng.integers(2, 4)), count - 3)  # on the platform, if there is one
    drop = motion.drop if last >= 0 else 0.0
    lengths = (1.0, 1.1) if drop else (0.9, 1.1)
    x = y = yaw = 0.0
    steps = []
    for number in range(count):
        share = float(rng.uniform(*lengths))
        share *= 0.0 if number == count - 1 else 0.5 if number == 0 else 1.0
        sideways = 2 * across if (across > 0) == (foot == 0) else 0.0  # feet part, then close up
        x += share * (np.cos(yaw) * along - np.sin(yaw) * sideways)
        y += share * (np.sin(yaw) * along + np.cos(yaw) * sideways)
        yaw += share * turn
        side = robot.apart if foot == 0 else -robot.apart
        place = (float(x - np.sin(yaw) * side), float(y + np.cos(yaw) * side))
        start = now + double
        stop = start + single * (1 + motion.jitter * float(rng.uniform(-1, 1)))
        height = float(rng.uniform(*motion.height))
        ground = -drop if number > last else 0.0
        steps.append(Step(foot, (*place, ground), yaw, now, start, stop, height))
        now, foot = stop, 1 - foot
    return tuple(steps)


def stopping(
    robot: Humanoid, motion: Stroll, rng: np.random.Generator, duration: float
) -> tuple[Step, ...]:
    """Footsteps of a walk with stops.

    Args:
        duration: Duration of the run, in [s].
    """
    pauses = rng.uniform(*motion.pause, motion.stops)
    pauses = pauses[np.cumsum(pauses) < duration / 2]
    steps = list(footsteps(robot, motion.walk, rng, duration - float(pauses.sum())))
    stops = rng.choice(len(steps), min(len(pauses), len(steps) - 1), replace=False)
    for stop, pause in zip(stops.tolist(), pauses.tolist(), strict=False):
        steps[stop + 1 :] = [
            replace(
                step,
                shift=step.shift + pause,
                start=step.start + pause,
                stop=step.stop + pause,
            )
            for step in steps[stop + 1 :]
        ]
    return tuple(steps)


def _advance(robot: Humanoid, motion: Walk, rng: np.random.Generator) -> tuple[float, float, float]:
    """Advance of the body per step: along, across, and in direction."""
    along, across, turn = robot.stride
    size = float(rng.uniform(0.85, 0.95) if motion.drop else rng.uniform(0.45, 0.8))
    sign = float(rng.choice((-1.0, 1.0)))
    if motion.way == "straight":
        return size * along, 0.0, 0.0
    if motion.way == "curve":
        return 0.7 * size * along, 0.0, sign * size * turn
    if motion.way == "directions":
        if rng.uniform() < 0.5:
            return -0.6 * size * along, 0.0, 0.0
        return float(rng.uniform(-0.2, 0.2)) * along, sign * size * across / 2, 0.0
    return 0.0, 0.0, 0.0
