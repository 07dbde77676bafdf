"""Path of a trot: a sequence of velocity commands."""

from collections.abc import Sequence

import numpy as np

from noiseclassifier.scenarios.clock import TICK
from noiseclassifier.scenarios.paths import minimum_jerk
from noiseclassifier.scenarios.quadruped.robots import Quadruped
from noisemodel.types import Array

CHANGE = 0.6
"""Time in which the velocity goes from one command to the next, in [s]."""
HOLD = (1.5, 3.0)
"""Time from one command to the next, in [s]."""


def steer(
    time: Array,
    way: str,
    robot: Quadruped,
    rng: np.random.Generator,
    *,
    bouts: Sequence[tuple[float, float]],
) -> tuple[Array, Array]:
    """Path and direction of the body by random commands, from rest to rest.

    Args:
        time: Shape (times,), in [s].
        bouts: Start and end of each motion, in [s].

    Returns:
        Path of the body over the ground, shape (times, 2), in [m], and its direction, shape
        (times,), in [rad].
    """
    velocity = np.zeros((len(time), 3))  # ahead, to the left, turning
    for start, stop in bouts:
        now, before = start, np.zeros(3)
        while now < stop - 2 * CHANGE:
            command = _command(way, robot, rng)
            velocity += _onset(time, now) * (command - before)
            now, before = now + float(rng.uniform(*HOLD)), command
        velocity -= _onset(time, stop - CHANGE) * before
    ahead, aside, turning = velocity.T
    yaw = np.cumsum(turning) * TICK
    cosine, sine = np.cos(yaw), np.sin(yaw)
    over = np.stack((cosine * ahead - sine * aside, sine * ahead + cosine * aside), axis=1)
    return np.cumsum(over, axis=0) * TICK, yaw


def _onset(time: Array, start: float) -> Array:
    """Smooth step from 0 to 1, shape (times, 1)."""
    return minimum_jerk(np.clip((time - start) / CHANGE, 0, 1))[:, None]


def _command(way: str, robot: Quadruped, rng: np.random.Generator) -> Array:
    """Velocity ahead, to the left, and of turning, shape (3,)."""
    speed = robot.speed * float(rng.uniform(0.4, 1.0))
    turning = robot.turning * float(rng.uniform(0.3, 1.0)) * float(rng.choice((-1.0, 1.0)))
    if way == "spot":
        return np.array([0.0, 0.0, turning * float(rng.choice((0.0, 1.0)))])
    if way == "curve":
        return np.array([0.8 * speed, 0.0, turning])
    if way == "directions":
        angle = float(rng.uniform(np.pi / 3, 5 * np.pi / 3))
        return 0.7 * speed * np.array([np.cos(angle), np.sin(angle), 0.0])
    return np.array([speed, 0.0, 0.0])
