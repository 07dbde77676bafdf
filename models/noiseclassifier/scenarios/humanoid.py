"""A humanoid: footsteps, walking, standing and gestures; stabilizer, controller and scene."""

from cmath import rect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import atan2
from typing import Any

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.faults import Faults, Imperfections, Integers
from noiseclassifier.scenarios.loop import Reference, Scene
from noiseclassifier.scenarios.motions import (
    TICK,
    Box,
    Contact,
    Gesture,
    Plan,
    Rng,
    Sole,
    Stand,
    Stroll,
    Units,
    Walk,
    minimum_jerk,
    times,
)
from noiseclassifier.scenarios.robots import LEGS, Gains, Humanoid
from noiseclassifier.scenarios.world import (
    GRAVITY,
    WholeBody,
    box_changes,
    centre_of_mass,
    real_world,
    reduced_model,
    sensors_of,
)
from noisemodel.types import Array


@dataclass(frozen=True, eq=False, kw_only=True)
class WalkPlan(Plan):
    """Plan of the motion of a humanoid."""

    yaws: Array  # directions of the soles, shape (ticks, feet), in [rad]
    swinging: Integers  # the foot in the air, or -1, shape (ticks,)
    zmp: Array  # zero-moment point, x and y, shape (ticks, 2), in [m]
    centre: Array  # centre of mass, shape (ticks, 3), in [m]
    upper: Array  # positions of the upper body's joints, shape (ticks, joints), in [rad]
    rate: float  # natural frequency of the inverted pendulum, in [rad/s]

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


def footsteps(robot: Humanoid, motion: Walk, rng: Rng, duration: float) -> tuple[Step, ...]:
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


def stopping(robot: Humanoid, motion: Stroll, rng: Rng, duration: float) -> tuple[Step, ...]:
    """Footsteps of a walk with stops."""
    pauses = rng.uniform(*motion.pause, motion.stops)
    pauses = pauses[np.cumsum(pauses) < duration / 2]
    steps = list(footsteps(robot, motion.walk, rng, duration - float(pauses.sum())))
    stops = rng.choice(len(steps), min(len(pauses), len(steps) - 1), replace=False)
    for stop, pause in zip(stops.tolist(), pauses.tolist(), strict=False):
        for number, step in enumerate(steps[stop + 1 :], start=stop + 1):
            later = {name: getattr(step, name) + pause for name in ("shift", "start", "stop")}
            steps[number] = replace(step, **later)
    return tuple(steps)


def _advance(robot: Humanoid, motion: Walk, rng: Rng) -> tuple[float, float, float]:
    """Advance of the body per step: along, across, and in direction."""
    (along, across), turn = robot.stride, robot.turn
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
# How early a foot may touch down, as a share of its swing: its height is a few millimetres.
EARLY = 0.13
BRIM = 0.01  # distance from the last toe on a platform to its edge, in [m]
TALL = 0.855  # height of the centre of mass of TALOS, for which periods are given, in [m]
NO_FOOT = -1  # the foot in the air while both are on the ground


def paths(robot: Humanoid, steps: Sequence[Step], time: Array) -> tuple[Array, Array, Integers]:
    """Places and directions of the soles, shape (ticks, feet, …), and the foot in the air or -1."""
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
) -> WalkPlan:
    """Plan of a walk over footsteps."""
    time = times(round(duration / TICK), TICK)
    places, yaws, swinging = paths(robot, steps, time)
    rate = float(np.sqrt(GRAVITY / robot.centre))
    zmp = _smooth(_zero_moment_point(robot, steps, time), SMOOTH)
    height = robot.centre + _smooth(_lower_foot(steps, time), DESCENT)
    size = robot.size
    return WalkPlan(
        places=places,
        yaws=yaws,
        swinging=swinging,
        zmp=zmp,
        centre=np.column_stack((centre_of_mass(zmp, rate), height)),
        upper=np.tile(robot.rest[LEGS:], (len(time), 1)) if upper is None else upper,
        rate=rate,
        contacts=contacts_of(robot, steps, duration),
        effectors=robot.effectors,
        torques=robot.drives.torque,
        ground=ground_of(robot, steps),
        units=Units(length=size, force=size**3, torque=size**4),  # equal shape and density
    )


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


def gesture(robot: Humanoid, motion: Gesture, rng: Rng, duration: float) -> Array:
    """Positions of the upper body's joints, shape (ticks, joints), in [rad]."""
    time = times(round(duration / TICK), TICK)
    reach = np.array(robot.reach)
    size = float(rng.uniform(*motion.size)) * reach
    moved = np.zeros((len(time), len(reach)))
    if motion.way == "sines":
        rates = 2 * np.pi / rng.uniform(*motion.period, len(reach))
        phases = rng.uniform(0, 2 * np.pi, len(reach))
        fade = minimum_jerk(np.clip(time / FADE, 0, 1))
        moved = size * fade[:, None] * np.sin(np.outer(time, rates) + phases)
    here, now = np.zeros(len(size)), 0.0
    while motion.way == "reaches" and now < time[-1]:  # all joints at once, with rests between
        taken = float(rng.uniform(*motion.period))
        there = size * rng.uniform(-1, 1, len(size))
        moved += minimum_jerk(np.clip((time - now) / taken, 0, 1))[:, None] * (there - here)
        here, now = there, now + taken * (1 + float(rng.uniform(0, DWELL)))
    return np.asarray(moved + robot.rest[LEGS:])


STILL = 0.5  # time of standing still at both ends, in [s]
SWAY_FADE = 1.0  # time in which sway and squat fade in and out, in [s]


def stand(robot: Humanoid, motion: Stand, rng: Rng, duration: float) -> WalkPlan:
    """Plan of standing."""
    plan = walk(robot, (), duration, upper=gesture(robot, motion.upper, rng, duration))
    time = plan.time
    slow = np.sqrt(robot.centre / TALL)  # period of a pendulum
    rates = 2 * np.pi / (slow * rng.uniform(*motion.period, 3))
    phases = rng.uniform(0, 2 * np.pi, 3)
    sway, squat = float(rng.uniform(*motion.sway)), float(rng.uniform(*motion.squat))
    ahead = sway * float(rng.uniform(0, 1)) * robot.effectors[0].patch[0]
    inside = np.minimum(time - STILL, time[-1] - STILL - time)
    fade = minimum_jerk(np.clip(inside / SWAY_FADE, 0, 1))[:, None]
    size = np.array((ahead, sway * robot.apart, squat * robot.centre / 2))
    moved = fade * size * np.sin(np.outer(time, rates) + phases)
    moved[:, 2] -= fade[:, 0] * size[2]
    zmp = plan.zmp + moved[:, :2]
    height = plan.centre[:, 2] + moved[:, 2]
    centre = np.column_stack((centre_of_mass(zmp, plan.rate), height))
    return replace(plan, zmp=zmp, centre=centre)


INSIDE = 0.77  # largest offset of the zero-moment point in a sole, as a share of its half extent
STEEPEST = 0.25  # largest tilt of a sole, in [rad]
FURTHEST = 0.04  # largest deviation of a foot from its plan in height, in [m]
DRIFT = 0.05  # largest integral of the capture point's error, in [m s]
TOUCH = 30.0  # force above which a sole is in contact, in [N]
FLAT = 5.0  # rate at which a sole in the air returns to its plan, in [1/s]


class Stabilizer:
    """Heights and tilts of the soles from plan and sensors, once per tick."""

    def __init__(
        self,
        plan: WalkPlan,
        soles: Sequence[Sole],
        gains: Gains,
        *,
        strength: Array,
        weight: float,
        where: Mapping[str, slice],
    ) -> None:
        self._gains, self._strength, self._rate = gains, strength.tolist(), plan.rate
        self._share = TICK / (gains.filter + TICK)
        # Torques of a sole that bears the whole robot at its edge.
        self._most = [
            (weight * across, weight * along) for along, across in (sole.patch for sole in soles)
        ]
        self._reach = [[INSIDE * half for half in sole.patch] for sole in soles]
        velocity = np.gradient(plan.centre, TICK, axis=0)
        self._zmp: list[complex] = _points(plan.zmp)
        self._capture: list[complex] = _points(plan.centre + velocity / plan.rate)
        self._places: list[list[complex]] = _points(plan.places)
        self._yaws, self._heading = plan.yaws.tolist(), plan.heading.tolist()
        self._swinging = plan.swinging.tolist()
        self._bearing = [where[f"{sole.frame}.force"].start + 2 for sole in soles]
        self._turning = [where[f"{sole.frame}.torque"].start for sole in soles]
        self._standing = [where[f"{sole.frame}.place"].start for sole in soles]
        self._centre, self._moving = where["centre.place"].start, where["centre.velocity"].start
        self._turn = where["base.turn"].start
        self._drift = 0j
        self._errors = [[0.0, 0.0, 0.0] for _ in soles]
        self._tilts = [[0.0, 0.0] for _ in soles]
        self._height = 0.0

    def step(self, number: int, sensors: Array) -> tuple[list[float], list[list[float]]]:
        """Advance by one tick."""
        values = sensors.tolist()
        measured = [
            (-values[bearing], _within(-values[turning], x), _within(-values[turning + 1], y))
            for bearing, turning, (x, y) in zip(
                self._bearing, self._turning, self._most, strict=True
            )
        ]
        zmp = self._zmp[number]
        if number:  # there are no sensor values before the first tick
            zmp += self._correction(number, values)
        desired = self._desired(number, zmp, measured[0][0] + measured[1][0])
        gains, strength, swinging = self._gains, self._strength[number], self._swinging[number]
        for foot, (error, tilt) in enumerate(zip(self._errors, self._tilts, strict=True)):
            for axis in (0, 1, 2):
                error[axis] += self._share * (
                    measured[foot][axis] - desired[foot][axis] - error[axis]
                )
            for axis in (0, 1):
                rate = strength * gains.tilt * error[1 + axis] - gains.level * tilt[axis]
                if not desired[foot][0] > 0 and measured[foot][0] < TOUCH:
                    rate = -FLAT * tilt[axis]
                tilt[axis] = _within(tilt[axis] + TICK * rate, STEEPEST)
        # The foot that bears too little goes down, the other one up.
        rate = strength * gains.height * (self._errors[0][0] - self._errors[1][0])
        flying = swinging >= 0 and measured[swinging][0] < TOUCH
        self._height += TICK * (rate - (FLAT if flying else gains.even) * self._height)
        self._height = _within(self._height, 2 * FURTHEST)
        return [self._height / 2, -self._height / 2], self._tilts

    def _correction(self, number: int, values: list[float]) -> complex:
        """Shift of the zero-moment point by the error of the capture point, in [m]."""
        left, places = self._left(number, self._zmp[number]), self._places[number]
        w, x, y, z = values[self._turn : self._turn + 4]
        heading = atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        # Relative to the feet, whose places are fixed.
        feet = [_point(values, start) for start in self._standing]
        real = _point(values, self._centre) + _point(values, self._moving) / self._rate
        real -= left * feet[0] + (1 - left) * feet[1]
        real *= rect(1.0, self._heading[number] - heading)
        error = left * places[0] + (1 - left) * places[1] + real - self._capture[number]
        self._drift += TICK * error
        self._drift *= min(1.0, DRIFT / (abs(self._drift) + 1e-9))
        return self._gains.capture * error + self._gains.integral * self._drift

    def _desired(self, number: int, zmp: complex, borne: float) -> list[tuple[float, float, float]]:
        """Desired load of each sole: force, torques about x and y."""
        left, places = self._left(number, zmp), self._places[number]
        beside = zmp - left * places[0] - (1 - left) * places[1]
        desired = []
        for share, yaw, reach in zip(
            (left, 1 - left), self._yaws[number], self._reach, strict=True
        ):
            point = beside * rect(1.0, -yaw)
            along, across = _within(point.real, reach[0]), _within(point.imag, reach[1])
            load = share * borne
            desired.append((load, load * across, -load * along))
        return desired

    def _left(self, number: int, zmp: complex) -> float:
        """Share of the weight on the left foot for a zero-moment point."""
        if self._swinging[number] >= 0:
            return float(self._swinging[number] == 1)
        left, right = self._places[number]
        apart = left - right
        share = ((zmp - right) * apart.conjugate()).real / abs(apart) ** 2
        return min(max(share, 0.0), 1.0)


def _points(signal: Array) -> Any:
    """X and y, the first of the last axis, as lists of complex numbers."""
    return (signal[..., 0] + 1j * signal[..., 1]).tolist()


def _point(values: list[float], start: int) -> complex:
    return complex(values[start], values[start + 1])


def _within(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


LOWEST = 0.25  # distance below its plan at which a base has fallen, in [m]
LEVEL = 0.8  # vertical component of the base's own z axis below which it has fallen


class WalkControl:
    """Controller with a stabilizer and whole-body inverse kinematics."""

    def __init__(
        self,
        body: WholeBody,
        stabilizer: Stabilizer,
        plan: WalkPlan,
        *,
        weight: float,
        where: Mapping[str, slice],
    ) -> None:
        self._body, self._stabilizer = body, stabilizer
        self._places, self._yaws = plan.places, plan.yaws.tolist()
        self._centre, self._heading = plan.centre, plan.heading.tolist()
        self._upper = plan.upper
        self._rates, self._bearing, self._weight = _rates(plan), bearing(plan), weight
        self._place, self._turn = where["base.place"], where["base.turn"]
        rest = body.configuration[7:]
        self._before = self._here = rest
        self._lowest = body.configuration[2] - LOWEST - plan.centre[0, 2]
        self._number = 0

    def tick(self, number: int, sensors: Array) -> Reference:
        """Advance by one tick."""
        heights, tilts = self._stabilizer.step(number, sensors)
        places = self._places[number].copy()
        places[:, 2] += heights
        turns = [
            pin.rpy.rpyToMatrix(roll, pitch, yaw)
            for (roll, pitch), yaw in zip(tilts, self._yaws[number], strict=True)
        ]
        base = pin.rpy.rpyToMatrix(0.0, 0.0, self._heading[number])
        upper = self._upper[number]
        after = self._body.follow(places, turns, self._centre[number], base, upper=upper)[7:]
        reference = Reference(
            position=self._here,
            velocity=(after - self._before) / (2 * TICK),
            planned=self._body.inverse[6:] @ self._rates[number],
            torque=self._body.hold(self._weight * self._bearing[number]),
            lift=self._body.lift,
        )
        self._before, self._here, self._number = self._here, after, number
        return reference

    def fallen(self, sensors: Array) -> bool:
        """Whether the base is too low or too much tilted."""
        _, x, y, _ = sensors[self._turn].tolist()
        height = float(sensors[self._place][2] - self._centre[self._number, 2])
        return bool(height < self._lowest or 1 - 2 * (x * x + y * y) < LEVEL)


def _rates(plan: WalkPlan) -> Array:
    """Planned rates of all equations of `WholeBody`, shape (ticks, equations)."""
    ticks = len(plan.centre)
    soles = np.zeros((ticks, 2, 6))
    soles[:, :, :3] = np.gradient(plan.places, TICK, axis=0)
    soles[:, :, 5] = np.gradient(plan.yaws, TICK, axis=0)
    turning = np.zeros((ticks, 3))
    turning[:, 2] = np.gradient(plan.heading, TICK)
    moving = np.gradient(plan.centre, TICK, axis=0)
    upper = np.gradient(plan.upper, TICK, axis=0)
    return np.hstack((soles.reshape(ticks, 12), moving, turning, upper))


def bearing(plan: WalkPlan) -> Array:
    """Planned force and torque of the ground on each sole, per weight, shape (ticks, 12)."""
    # The ground's force on a pendulum points from the zero-moment point to the centre of mass.
    force = np.ones((len(plan.zmp), 3))
    force[:, :2] = (plan.centre[:, :2] - plan.zmp) * plan.rate**2 / GRAVITY
    share = np.stack((plan.left, 1 - plan.left), axis=1)
    middle = (share[:, :, None] * plan.places[:, :, :2]).sum(axis=1)
    lever = np.zeros((len(force), 3))
    lever[:, :2] = plan.zmp - middle
    each = np.concatenate((force, np.cross(lever, force)), axis=1)
    return np.asarray((share[:, :, None] * each[:, None]).reshape(len(force), 12))


SETTLING = 500  # ticks before the recording during which the robot comes to rest on its feet
LEVER = 0.05  # noise of torque sensors per noise of force sensors, in [m]


def plan(robot: Humanoid, motion: Walk | Stroll | Stand, rng: Rng, duration: float) -> WalkPlan:
    """Plan of the motion of one run."""
    if isinstance(motion, Walk):
        return walk(robot, footsteps(robot, motion, rng, duration), duration)
    if isinstance(motion, Stroll):
        steps = stopping(robot, motion, rng, duration)
        return walk(robot, steps, duration, upper=gesture(robot, motion.upper, rng, duration))
    return stand(robot, motion, rng, duration)


def scene(robot: Humanoid, plan: WalkPlan, faults: Faults, imperfections: Imperfections) -> Scene:
    """Scene of one run."""
    model = reduced_model(robot)
    boxes = faults.boxes_on(plan)
    world = real_world(robot, boxes, imperfections, frame=robot.carrier, point=np.zeros(3))
    where = sensors_of(world)
    strength = np.pad(faults.gain(plan.time), (SETTLING, 0), "edge") * imperfections.force_gain
    shifted = plan.shifted(faults.shift).after(SETTLING)
    body = standing(robot, model, shifted)
    weight = float(pin.computeTotalMass(model)) * GRAVITY
    stabilizer = Stabilizer(
        shifted, robot.effectors, robot.gains, strength=strength, weight=weight, where=where
    )
    control = WalkControl(body, stabilizer, shifted, weight=weight, where=where)
    start = body.configuration[[0, 1, 2, 6, 3, 4, 5, *range(7, model.nq)]]  # MuJoCo has w first
    start[7:] -= faults.offsets(len(robot.drives.joints))
    noise = np.zeros(world.nsensordata)  # the sensors of the base are exact
    for sole in robot.effectors:
        noise[where[f"{sole.frame}.force"]] = imperfections.force_noise
        noise[where[f"{sole.frame}.torque"]] = LEVER * imperfections.force_noise
    return Scene(
        model=world,
        start=start,
        tick=control.tick,
        fallen=control.fallen,
        effectors=len(robot.effectors),
        settling=SETTLING,
        noise=noise,
        changes=box_changes(world, boxes),
    )


def standing(robot: Humanoid, model: Any, plan: WalkPlan) -> WholeBody:
    """The robot, standing as a plan starts."""
    start = pin.neutral(model)
    start[2], start[7:] = robot.centre, robot.rest
    body = WholeBody(model, robot.effectors, start, upper=len(robot.reach))
    level = np.eye(3)
    body.follow(
        plan.places[0], [level, level], plan.centre[0], level, upper=plan.upper[0], steps=20
    )
    return body
