"""Plans of humanoids: footsteps, walking, standing, gestures."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from noiseclassifier.scenarios.faults import Integers
from noiseclassifier.scenarios.motions import (
    TICK,
    Box,
    Contact,
    Effector,
    Gesture,
    Stand,
    Stroll,
    Units,
    Walk,
    minimum_jerk,
    times,
)
from noiseclassifier.scenarios.robots import LEGS, Humanoid
from noiseclassifier.scenarios.world import GRAVITY, centre_of_mass
from noisemodel.types import Array


@dataclass(frozen=True, eq=False)
class Plan:
    """Plan of the motion of a humanoid, at every tick."""

    places: Array  # of the soles, shape (ticks, feet, 3), in [m]
    yaws: Array  # directions of the soles, shape (ticks, feet), in [rad]
    swinging: Integers  # the foot in the air, or -1, shape (ticks,)
    zmp: Array  # zero-moment point, x and y, shape (ticks, 2), in [m]
    centre: Array  # centre of mass, shape (ticks, 3), in [m]
    upper: Array  # positions of the upper body's joints, shape (ticks, joints), in [rad]
    rate: float  # natural frequency of the inverted pendulum, in [rad/s]
    contacts: tuple[Contact, ...]
    effectors: tuple[Effector, ...]
    ground: tuple[Box, ...]
    size: float

    @property
    def time(self) -> Array:
        """Time of each tick, shape (ticks,), in [s]."""
        return times(len(self.zmp), TICK)

    @property
    def units(self) -> Units:
        """Units of 1 for a robot of size 1, for equal shape and density."""
        return Units(length=self.size, force=self.size**3, torque=self.size**4)

    @property
    def duration(self) -> float:
        """Duration, in [s]."""
        return len(self.zmp) * TICK

    @property
    def heading(self) -> Array:
        """Direction of the base, shape (ticks,), in [rad]."""
        return np.asarray(self.yaws.mean(axis=1))

    @property
    def left(self) -> Array:
        """Planned share of the weight on the left foot, shape (ticks,)."""
        left, right = self.places[:, 0, :2], self.places[:, 1, :2]
        apart = left - right
        share = ((self.zmp - right) * apart).sum(axis=1) / np.square(apart).sum(axis=1)
        share = np.clip(share, 0.0, 1.0)
        return np.asarray(np.where(self.swinging < 0, share, self.swinging == 1))

    def after(self, ticks: int) -> "Plan":
        """The plan after some ticks of rest."""

        def later(signal: Array) -> Array:
            return np.concatenate((np.repeat(signal[:1], ticks, axis=0), signal))

        return replace(
            self,
            places=later(self.places),
            yaws=later(self.yaws),
            swinging=np.pad(self.swinging, (ticks, 0), "edge"),
            zmp=later(self.zmp),
            centre=later(self.centre),
            upper=later(self.upper),
            contacts=tuple(contact.later(ticks * TICK) for contact in self.contacts),
        )


REST = (0.6, 1.0)  # time of standing before the walk, in [s]
CLOSE = 0.6  # time in which the weight moves from the last foot to the middle of both, in [s]
STAND = 0.3  # least time of standing at the end, in [s]


@dataclass(frozen=True)
class Step:
    """One step of one foot."""

    foot: int
    place: tuple[float, float, float]  # x, y, z of its sole afterwards, in [m]
    yaw: float  # its direction afterwards, in [rad]
    shift: float  # when the weight starts to shift to the other foot, in [s]
    start: float  # when it is to leave the ground, in [s]
    stop: float  # when it is to touch the ground, in [s]
    height: float  # height of its swing, in [m]


def footsteps(
    robot: Humanoid, motion: Walk, rng: np.random.Generator, duration: float
) -> tuple[Step, ...]:
    """Footsteps of a walk."""
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
    """Footsteps of a walk with stops."""
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


TOP = 0.45  # time at which a swinging foot is highest, as a share of its swing
EARLY = 0.13
"""How early a foot may touch down, as a share of its swing: its height is a few millimetres."""
BRIM = 0.01  # distance from the last toe on a platform to its edge, in [m]
TALL = 0.855  # height of the centre of mass of TALOS, for which periods are given, in [m]
NO_FOOT = -1  # the foot in the air while both are on the ground


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


def contacts_of(robot: Humanoid, steps: Sequence[Step], duration: float) -> tuple[Contact, ...]:
    """Planned contacts of the feet."""
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


def ground_of(robot: Humanoid, steps: Sequence[Step]) -> tuple[Box, ...]:
    """Floor under the last step, and platform under the first ones if they are higher."""
    floor = min([0.0, *(step.place[2] for step in steps)])
    below = Box((0.0, 0.0, floor - 0.5), (10.0, 10.0, 0.5))
    if not floor:
        return (below,)
    first = next(index for index, step in enumerate(steps) if step.place[2] == floor)
    edge = steps[first - 1].place[0] + robot.effectors[0].patch[0] + BRIM
    return (Box((edge - 1.0, 0.0, floor / 2), (1.0, 1.0, -floor / 2)), below)


SMOOTH = 0.06  # time over which the movement of the zero-moment point is smoothed, in [s]
DESCENT = 0.3  # time over which the movement of the centre of mass in height is smoothed, in [s]
BESIDE = 0.005  # inward offset of the zero-moment point from the centre of a sole, in [m]


def walk(
    robot: Humanoid, steps: Sequence[Step], duration: float, *, upper: Array | None = None
) -> Plan:
    """Plan of a walk over footsteps."""
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
        contacts=contacts_of(robot, steps, duration),
        effectors=robot.effectors,
        ground=ground_of(robot, steps),
        size=robot.size,
    )


def resting(robot: Humanoid, ticks: int) -> Array:
    """Positions of an upper body at rest, shape (ticks, joints), in [rad]."""
    return np.tile(robot.rest[LEGS:], (ticks, 1))


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


FADE = 1.0  # time in which sines fade in, in [s]
DWELL = 0.3  # longest time of rest between two reaches, as a share of a reach


def gesture(robot: Humanoid, motion: Gesture, rng: np.random.Generator, duration: float) -> Array:
    """Positions of the upper body's joints."""
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


STILL = 0.5  # time of standing still at both ends, in [s]
SWAY_FADE = 1.0  # time in which sway and squat fade in and out, in [s]


def stand(robot: Humanoid, motion: Stand, rng: np.random.Generator, duration: float) -> Plan:
    """Plan of standing."""
    plan = walk(robot, (), duration, upper=gesture(robot, motion.upper, rng, duration))
    time = times(len(plan.zmp), TICK)
    slow = np.sqrt(robot.centre / TALL)  # period of a pendulum
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
    inside = np.minimum(time - STILL, time[-1] - STILL - time)
    return minimum_jerk(np.clip(inside / SWAY_FADE, 0, 1))
