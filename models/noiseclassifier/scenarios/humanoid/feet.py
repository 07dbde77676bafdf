"""Feet of a walk: their paths, their contacts, and the ground."""

from collections.abc import Sequence

import numpy as np

from noiseclassifier.scenarios.contacts import Contact
from noiseclassifier.scenarios.faults import Integers
from noiseclassifier.scenarios.humanoid.footsteps import Step
from noiseclassifier.scenarios.humanoid.robots import Humanoid
from noiseclassifier.scenarios.paths import minimum_jerk
from noiseclassifier.scenarios.shapes import Box
from noisemodel.types import Array

TOP = 0.45
"""Time at which a swinging foot is highest, as a share of its swing."""
EARLY = 0.13
"""How early a foot may touch down, as a share of its swing: its height is a few millimetres."""
BRIM = 0.01
"""Distance from the last toe on a platform to its edge, in [m]."""
NO_FOOT = -1
"""The foot in the air while both are on the ground."""


def paths(robot: Humanoid, steps: Sequence[Step], time: Array) -> tuple[Array, Array, Integers]:
    """Sampled paths of the soles.

    Args:
        time: Of each tick, shape (ticks,), in [s].

    Returns:
        Places, shape (ticks, feet, 3), in [m]; directions, shape (ticks, feet), in [rad]; the foot
        in the air, or -1, shape (ticks,).
    """
    places, yaws = np.zeros((len(time), 2, 3)), np.zeros((len(time), 2))
    places[:, :, 1] = robot.apart, -robot.apart
    swinging = np.full(len(time), NO_FOOT)
    for step in steps:
        first, end = np.searchsorted(time, (step.start, step.stop))
        if first == len(time):
            break
        share = (time[first:end] - step.start) / (step.stop - step.start)
        before, after = places[first, step.foot].copy(), np.array(step.place)
        turned = yaws[first, step.foot]
        # The horizontal movement starts later and ends earlier than the vertical one: the foot
        # lands vertically, and its heel is past an edge before it descends.
        arrival = 0.9 if after[2] >= before[2] else 0.8
        ahead = minimum_jerk(np.clip((share - 0.05) / (arrival - 0.05), 0, 1))
        path = before + ahead[:, None] * (after - before)
        top = max(before[2], after[2]) + step.height
        rise, fall = minimum_jerk(share / TOP), minimum_jerk((share - TOP) / (1 - TOP))
        path[:, 2] = np.where(
            share < TOP, before[2] + rise * (top - before[2]), top + fall * (after[2] - top)
        )
        places[first:end, step.foot], places[end:, step.foot] = path, after
        yaws[first:end, step.foot] = turned + ahead * (step.yaw - turned)
        yaws[end:, step.foot] = step.yaw
        swinging[first:end] = step.foot
    return places, yaws, swinging


def contacts(robot: Humanoid, steps: Sequence[Step], duration: float) -> tuple[Contact, ...]:
    """Planned contacts of the feet.

    Args:
        duration: How long the plan lasts, in [s].
    """
    stands = []
    for foot in (0, 1):
        side = robot.apart if foot == 0 else -robot.apart
        start, approach, place, yaw = 0.0, 0.0, (0.0, side, 0.0), 0.0
        for step in (step for step in steps if step.foot == foot):
            top = step.start + TOP * (step.stop - step.start)
            stands.append(Contact(start, step.start, top, place, foot, yaw, approach))
            start, approach = step.stop - EARLY * (step.stop - step.start), top
            place, yaw = step.place, step.yaw
        stands.append(Contact(start, np.inf, np.inf, place, foot, yaw, approach))
    planned = (contact for contact in stands if contact.start < duration)
    return tuple(sorted(planned, key=lambda contact: contact.start))


def ground(robot: Humanoid, steps: Sequence[Step]) -> tuple[Box, ...]:
    """Floor under the last step, and platform under the first ones if they are higher."""
    floor = min([0.0, *(step.place[2] for step in steps)])
    below = Box((0.0, 0.0, floor - 0.5), (10.0, 10.0, 0.5))
    if not floor:
        return (below,)
    first = next(index for index, step in enumerate(steps) if step.place[2] == floor)
    edge = steps[first - 1].place[0] + robot.effectors[0].patch[0] + BRIM
    return (Box((edge - 1.0, 0.0, floor / 2), (1.0, 1.0, -floor / 2)), below)
