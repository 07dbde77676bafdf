"""A humanoid: stabilizer, controller and scene."""

from cmath import rect
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import atan2
from typing import Any

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.faults import Faults, Imperfections
from noiseclassifier.scenarios.humanoid_plan import Plan, footsteps, gesture, stand, stopping, walk
from noiseclassifier.scenarios.loop import Reference, Scene
from noiseclassifier.scenarios.motions import TICK, Sole, Stand, Stroll, Walk
from noiseclassifier.scenarios.robots import LEGS, Gains, Humanoid
from noiseclassifier.scenarios.world import (
    GRAVITY,
    WholeBody,
    box_changes,
    real_world,
    reduced_model,
    sensors_of,
)
from noisemodel.types import Array

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
        plan: Plan,
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
        plan: Plan,
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
        self._velocity = self._planned = np.zeros(len(rest))
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
        before, here = self._here, after
        velocity = (after - self._before) / (2 * TICK)
        planned = self._body.inverse[6:] @ self._rates[number]
        reference = Reference(
            position=np.array((self._before, self._here)),
            velocity=np.array((self._velocity, velocity)),
            planned=np.array((self._planned, planned)),
            torque=self._body.hold(self._weight * self._bearing[number]),
            lift=self._body.lift,
        )
        self._before, self._here = before, here
        self._velocity, self._planned, self._number = velocity, planned, number
        return reference

    def fallen(self, sensors: Array) -> bool:
        """Whether the base is too low or too much tilted."""
        _, x, y, _ = sensors[self._turn].tolist()
        height = float(sensors[self._place][2] - self._centre[self._number, 2])
        return bool(height < self._lowest or 1 - 2 * (x * x + y * y) < LEVEL)


def _rates(plan: Plan) -> Array:
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


def bearing(plan: Plan) -> Array:
    """Planned ground forces on the soles, per weight of the robot.

    Returns:
        Force, and torque about the sole's middle in [m], of each sole, shape (ticks, 12).
    """
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


def plan(
    robot: Humanoid, motion: Walk | Stroll | Stand, rng: np.random.Generator, duration: float
) -> Plan:
    """Plan of the motion of one run."""
    if isinstance(motion, Walk):
        return walk(robot, footsteps(robot, motion, rng, duration), duration)
    if isinstance(motion, Stroll):
        steps = stopping(robot, motion, rng, duration)
        return walk(robot, steps, duration, upper=gesture(robot, motion.upper, rng, duration))
    return stand(robot, motion, rng, duration)


def scene(robot: Humanoid, plan: Plan, faults: Faults, imperfections: Imperfections) -> Scene:
    """Scene of one run."""
    model = reduced_model(robot)
    boxes = faults.boxes_on(plan)
    world = real_world(robot, boxes, imperfections, frame=robot.carrier, point=np.zeros(3))
    where = sensors_of(world)
    strength = np.pad(faults.gain(plan.time), (SETTLING, 0), "edge") * imperfections.force_gain
    shifted = _shifted(plan, faults).after(SETTLING)
    body = standing(robot, model, shifted)
    weight = float(pin.computeTotalMass(model)) * GRAVITY
    stabilizer = Stabilizer(
        shifted, robot.effectors, robot.gains, strength=strength, weight=weight, where=where
    )
    return Scene(
        model=world,
        start=_mujoco_start(body.configuration, faults.offsets(len(robot.drives.joints))),
        control=WalkControl(body, stabilizer, shifted, weight=weight, where=where),
        effectors=len(robot.effectors),
        settling=SETTLING,
        noise=_noise(robot, world.nsensordata, where, imperfections),
        changes=box_changes(world, boxes),
    )


def standing(robot: Humanoid, model: Any, plan: Plan) -> WholeBody:
    """The robot, standing as a plan starts."""
    start = pin.neutral(model)
    start[2], start[7:] = robot.centre, robot.rest
    body = WholeBody(model, robot.effectors, start, upper=len(robot.drives.joints) - LEGS)
    level = np.eye(3)
    body.follow(
        plan.places[0], [level, level], plan.centre[0], level, upper=plan.upper[0], steps=20
    )
    return body


def _shifted(plan: Plan, faults: Faults) -> Plan:
    if faults.shift is None:
        return plan
    return replace(plan, places=plan.places + faults.shift(plan.time))


def _mujoco_start(configuration: Array, offsets: Array) -> Array:
    """Configuration, as MuJoCo has it, at which the encoders read the given one."""
    place, (x, y, z, w), joints = configuration[:3], configuration[3:7], configuration[7:]
    return np.concatenate((place, (w, x, y, z), joints - offsets))


def _noise(
    robot: Humanoid, sensors: int, where: dict[str, slice], imperfections: Imperfections
) -> Array:
    """Standard deviations of the sensors; those of the base are exact."""
    noise = np.zeros(sensors)
    for sole in robot.effectors:
        noise[where[f"{sole.frame}.force"]] = imperfections.force_noise
        noise[where[f"{sole.frame}.torque"]] = LEVER * imperfections.force_noise
    return noise
