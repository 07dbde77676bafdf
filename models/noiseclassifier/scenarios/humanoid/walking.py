"""Plan of a walk: from footsteps to the zero-moment point and the centre of mass."""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import solve_banded

from noiseclassifier.scenarios.clock import TICK, times
from noiseclassifier.scenarios.humanoid.feet import contacts, ground, paths
from noiseclassifier.scenarios.humanoid.footsteps import CLOSE, Step
from noiseclassifier.scenarios.humanoid.plan import Plan
from noiseclassifier.scenarios.humanoid.robots import LEGS, Humanoid
from noisemodel.types import Array

GRAVITY = 9.81
"""In [m/s²]."""
SMOOTH = 0.06
"""Time over which the movement of the zero-moment point is smoothed, in [s]."""
DESCENT = 0.3
"""Time over which the movement of the centre of mass in height is smoothed, in [s]."""
BESIDE = 0.005
"""Inward offset of the zero-moment point from the centre of a sole, in [m]."""


def walk(
    robot: Humanoid, steps: Sequence[Step], duration: float, *, upper: Array | None = None
) -> Plan:
    """Plan of a walk over footsteps.

    Args:
        duration: Duration of the plan, in [s].
        upper: Positions of the upper body's joints, shape (ticks, joints), in [rad]; by default at
            rest.
    """
    time = times(round(duration / TICK), TICK)
    places, yaws, swinging = paths(robot, steps, time)
    rate = float(np.sqrt(GRAVITY / robot.centre))
    zmp = _smooth(_zero_moment_point(robot, steps, time), SMOOTH)
    height = robot.centre + _smooth(_lower_foot(steps, time), DESCENT)
    centre = np.column_stack((centre_of_mass(zmp, rate), height))
    return Plan(
        places,
        yaws,
        swinging,
        zmp,
        centre,
        resting(robot, len(time)) if upper is None else upper,
        rate,
        contacts=contacts(robot, steps, duration),
        effectors=robot.effectors,
        ground=ground(robot, steps),
        size=robot.size,
    )


def resting(robot: Humanoid, ticks: int) -> Array:
    """Positions of an upper body at rest, shape (ticks, joints), in [rad]."""
    return np.tile(robot.rest[LEGS:], (ticks, 1))


def centre_of_mass(zmp: Array, rate: float) -> Array:
    """Motion of the centre of mass for a zero-moment point.

    Args:
        zmp: Zero-moment point at each tick, at rest at both ends, shape (ticks, 2), in [m].
        rate: Natural frequency of the inverted pendulum, in [rad/s].

    Returns:
        The bounded solution of c - c''/rate² = zmp, shape (ticks, 2), in [m].
    """
    # Kajita et al., Biped walking pattern generation, ICRA 2003; here as one banded system.
    stiff = 1 / (rate * TICK) ** 2
    bands = np.zeros((3, len(zmp)))
    bands[0, 2:] = bands[2, :-2] = -stiff
    bands[1] = 1 + 2 * stiff
    bands[1, [0, -1]] = 1
    return np.asarray(solve_banded((1, 1), bands, zmp), dtype=np.float64)


def _zero_moment_point(robot: Humanoid, steps: Sequence[Step], time: Array) -> Array:
    """Zero-moment point: from foot to foot, and to the middle of both at a stop."""
    standing = [(0.0, robot.apart, 0.0), (0.0, -robot.apart, 0.0)]  # x, y, yaw of each foot
    knots, points = [0.0], [(0.0, 0.0)]

    def stop(end: float) -> None:
        knots.extend((end + SMOOTH / 2, end + CLOSE))
        points.append(points[-1])
        points.append(tuple(np.mean([foot[:2] for foot in standing], axis=0).tolist()))

    end = 0.0
    for step in steps:
        if step is not steps[0] and step.shift - end > CLOSE:
            stop(end)
        end = step.stop
        other = 1 - step.foot
        x, y, yaw = standing[other]
        inward = BESIDE if other == 1 else -BESIDE
        point = (x - float(np.sin(yaw)) * inward, y + float(np.cos(yaw)) * inward)
        # Smoothing makes it start earlier and end later; a foot in the air must not bear load.
        knots += [step.shift + SMOOTH / 2, step.start - SMOOTH / 2]
        points += [points[-1], point]
        standing[step.foot] = (*step.place[:2], step.yaw)
    stop(end)
    return np.column_stack(
        [np.interp(time, knots, [point[axis] for point in points]) for axis in (0, 1)]
    )


def _lower_foot(steps: Sequence[Step], time: Array) -> Array:
    """Height of the ground under the lower foot, reached when it touches down, shape (ticks,)."""
    heights, knots, levels = [0.0, 0.0], [0.0], [0.0]
    for step in steps:
        knots += [step.start, step.stop]
        levels.append(min(heights))
        heights[step.foot] = step.place[2]
        levels.append(min(heights))
    return np.interp(time, knots, levels)


def _smooth(signal: Array, span: float) -> Array:
    """Moving average with a Hann window, along axis 0."""
    half = round(span / TICK / 2)
    weight = np.hanning(2 * half + 3)[1:-1]
    weight /= weight.sum()
    padded = np.pad(signal, ((half, half), *[(0, 0)] * (signal.ndim - 1)), "edge")
    columns = padded.reshape(len(padded), -1).T
    smooth = [np.convolve(column, weight, "valid") for column in columns]
    return np.stack(smooth, axis=1).reshape(signal.shape)
