"""Movement of a humanoid's upper body: positions of its joints over time."""

import numpy as np

from noiseclassifier.scenarios.clock import TICK, times
from noiseclassifier.scenarios.humanoid.motions import Gesture
from noiseclassifier.scenarios.humanoid.robots import LEGS, Humanoid
from noiseclassifier.scenarios.paths import minimum_jerk
from noisemodel.types import Array

FADE = 1.0
"""Time in which sines fade in, in [s]."""
DWELL = 0.3
"""Longest time of rest between two reaches, as a share of a reach."""


def gesture(robot: Humanoid, motion: Gesture, rng: np.random.Generator, duration: float) -> Array:
    """Positions of the upper body's joints.

    Args:
        duration: Duration of the run, in [s].

    Returns:
        Shape (ticks, joints), in [rad]; at rest at first.
    """
    time = times(round(duration / TICK), TICK)
    reach = np.array(robot.reach)
    size = float(rng.uniform(*motion.size)) * reach
    if motion.way == "sines":
        rates = 2 * np.pi / rng.uniform(*motion.period, len(reach))
        phases = rng.uniform(0, 2 * np.pi, len(reach))
        fade = minimum_jerk(np.clip(time / FADE, 0, 1))
        moved = size * fade[:, None] * np.sin(np.outer(time, rates) + phases)
    elif motion.way == "reaches":
        moved = _reaches(time, size, motion, rng)
    else:
        moved = np.zeros((len(time), len(reach)))
    return np.asarray(moved + robot.rest[LEGS:])


def _reaches(time: Array, size: Array, motion: Gesture, rng: np.random.Generator) -> Array:
    """Minimum-jerk movements of all joints at once, with rests between."""
    moved, here, now = np.zeros((len(time), len(size))), np.zeros(len(size)), 0.0
    while now < time[-1]:
        taken = float(rng.uniform(*motion.period))
        there = size * rng.uniform(-1, 1, len(size))
        share = np.clip((time - now) / taken, 0, 1)
        moved += minimum_jerk(share)[:, None] * (there - here)
        here, now = there, now + taken * (1 + float(rng.uniform(0, DWELL)))
    return moved
