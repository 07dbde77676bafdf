"""Plan of standing on both feet: sway and squat."""

from dataclasses import replace

import numpy as np

from noiseclassifier.scenarios.clock import TICK, times
from noiseclassifier.scenarios.humanoid.gesture import gesture
from noiseclassifier.scenarios.humanoid.motions import Stand
from noiseclassifier.scenarios.humanoid.plan import Plan
from noiseclassifier.scenarios.humanoid.robots import TALOS, Humanoid
from noiseclassifier.scenarios.humanoid.walking import centre_of_mass, walk
from noiseclassifier.scenarios.paths import minimum_jerk
from noisemodel.types import Array

REST = 0.5
"""Time of standing still at both ends, in [s]."""
FADE = 1.0
"""Time in which sway and squat fade in and out, in [s]."""


def stand(robot: Humanoid, motion: Stand, rng: np.random.Generator, duration: float) -> Plan:
    """Plan of standing.

    Args:
        duration: Duration of the run, in [s].
    """
    plan = walk(robot, (), duration, upper=gesture(robot, motion.upper, rng, duration))
    time = times(len(plan.zmp), TICK)
    slow = np.sqrt(robot.centre / TALOS.centre)  # period of a pendulum
    rates = 2 * np.pi / (slow * rng.uniform(*motion.period, 3))
    phases = rng.uniform(0, 2 * np.pi, 3)
    sway, squat = float(rng.uniform(*motion.sway)), float(rng.uniform(*motion.squat))
    ahead = sway * float(rng.uniform(0, 1)) * robot.effectors[0].patch[0]
    waves = np.sin(np.outer(time, rates) + phases)
    size = np.array((ahead, sway * robot.apart, squat * robot.centre / 2))
    moved = _fade(time)[:, None] * size * waves
    zmp = plan.zmp + moved[:, :2]
    centre = np.column_stack((centre_of_mass(zmp, plan.rate), plan.centre[:, 2]))
    centre[:, 2] += moved[:, 2] - _fade(time) * size[2]
    return replace(plan, zmp=zmp, centre=centre)


def _fade(time: Array) -> Array:
    """From 0 to 1 and back, shape (ticks,)."""
    inside = np.minimum(time - REST, time[-1] - REST - time)
    return minimum_jerk(np.clip(inside / FADE, 0, 1))
