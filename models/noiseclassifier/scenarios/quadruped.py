"""A quadruped: estimate, foot placement, controller and scene."""

from dataclasses import replace
from math import asin, atan2, cos, sin
from typing import Any

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.faults import Faults, Imperfections
from noiseclassifier.scenarios.loop import Reference, Scene
from noiseclassifier.scenarios.motions import TICK, Trot
from noiseclassifier.scenarios.quadruped_plan import Plan, Standing, stand, trot, turned
from noiseclassifier.scenarios.robots import Quadruped
from noiseclassifier.scenarios.world import (
    GRAVITY,
    WholeBody,
    box_changes,
    real_world,
    reduced_model,
    sensors_of,
)
from noisemodel.types import Array

POSITION_GAIN = 1.0  # rate of the correction per distance from the planned path, in [1/s]
VELOCITY_FILTER = 0.05  # time constant of the low-pass on the measured velocity, in [s]
LOWEST, STEEPEST = 0.5, 0.7
"""Share of its height below which, and tilt above which, in [rad], the robot has fallen."""


class StateEstimate:
    """State estimate, updated once per tick.

    Attributes:
        roll: Low-passed, less the planned one, in [rad].
        pitch: Low-passed, less the planned one, in [rad].
        slip: Low-passed velocity of the centre of mass less the planned one, shape (2,), in [m/s].
        position_correction: Correction of the path towards the plan, shape (2,), in [m].
        yaw_correction: Correction of the direction towards the plan, in [rad].
        force: Low-passed contact forces, shape (feet,), in [N].
    """

    def __init__(self, robot: Quadruped, sensors: dict[str, slice]) -> None:
        self._where = sensors
        self._tilt_share = _share(robot.attitude_filter)
        self._force_share = _share(robot.force_filter)
        self._slip_share = _share(VELOCITY_FILTER)
        self.roll = self.pitch = self.yaw_correction = 0.0
        self.slip, self.position_correction = np.zeros(2), np.zeros(2)
        self.force = np.zeros(len(robot.feet))

    def update(
        self, sensors: Array, *, place: Array, velocity: Array, yaw: float, tilt: Array
    ) -> None:
        """Update the estimate with the sensors of one tick."""
        rolled, pitched = tilt.tolist()
        w, x, y, z = sensors[self._where["base.turn"]].tolist()
        roll = atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        pitch = asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
        off = yaw - atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        self.roll += self._tilt_share * (roll - rolled - self.roll)
        self.pitch += self._tilt_share * (pitch - pitched - self.pitch)
        self.yaw_correction += TICK * POSITION_GAIN * atan2(sin(off), cos(off))
        self.position_correction += (
            TICK * POSITION_GAIN * (place - sensors[self._where["centre.place"]][:2])
        )
        slip = sensors[self._where["centre.velocity"]][:2] - velocity
        self.slip += self._slip_share * (slip - self.slip)
        self.force += self._force_share * (sensors[: len(self.force)] - self.force)

    def fallen(self, sensors: Array, height: float) -> bool:
        """Whether the robot is too low for its height, or too much tilted."""
        _, x, y, _ = sensors[self._where["base.turn"]].tolist()
        low = float(sensors[self._where["centre.place"]][2]) < LOWEST * height
        return low or 1 - 2 * (x * x + y * y) < cos(STEEPEST)


def _share(time_constant: float) -> float:
    """Gain of a first-order low-pass per tick."""
    return TICK / (time_constant + TICK)


BALANCE = 0.7  # gain of the foot placement on the offset of the capture point
FURTHEST = 0.3
"""Largest distance of feet from their planned place, as a share of the robot's height."""
FIXED = 0.8  # share of its path after which the place of a foot is fixed
DESCENDING = 0.5  # share of its path after which a foot may touch down early
CONTACT = 0.15  # force above which a foot is in contact, as a share of the weight
LEVELLING = 50.0  # rate at which a foot in the air compensates the tilt of the body, in [1/s]
LEAK = 4.0  # rate at which the compliance of a foot decays, in [1/s]
SMOOTHING = 0.008  # time constant of the low-pass on the vertical speed of feet, in [s]
HIGHEST = 0.16  # largest vertical correction of feet, as a share of the robot's height


class Feet:
    """Places of the feet, corrected by feedback."""

    def __init__(self, robot: Quadruped, standing: Standing, plan: Plan, gain: Array) -> None:
        feet = len(robot.feet)
        self._plan, self._lever = plan, standing.feet
        self._lean = 1 + robot.attitude_gain  # from the commanded tilt to the measured one
        self._gain = robot.force_gain * gain
        self._load = plan.weight * plan.load
        # A body at velocity v stops over a foot that stands v sqrt(h/g) ahead: the capture point.
        self._balance = BALANCE * np.sqrt(plan.size / GRAVITY)
        self._left, self._right = np.zeros((feet, 2)), np.zeros((feet, 2))
        self._rise, self._speed = np.zeros(feet), np.zeros(feet)
        self._early = np.zeros(feet, dtype=bool)

    def places(self, number: int, estimate: StateEstimate) -> Array:
        """Places of the feet."""
        places: Array = self._plan.feet[number].copy()
        places[:, :2] += self._placement(number, estimate)
        places[:, 2] += self._compliance(number, estimate)
        return places

    def _placement(self, number: int, estimate: StateEstimate) -> Array:
        """Horizontal correction of the feet, shape (feet, 2), in [m].

        Feet in the air follow the position correction of the robot, are placed further in the
        direction of its slip, and compensate the tilt of the body.
        """
        plan = self._plan
        swing, progress = plan.swing[number], plan.progress[number]
        begins = swing & ~plan.swing[number - 1]
        self._left[begins] = self._right[begins]
        furthest = FURTHEST * plan.size
        balance = np.minimum(np.maximum(self._balance * estimate.slip, -furthest), furthest)
        lever = plan.feet[number, :, :2] - plan.centre[number, :2]
        turned = estimate.yaw_correction * lever[:, ::-1] * (-1.0, 1.0)  # of a small angle
        upright = self._lean * plan.size * np.array((estimate.pitch, -estimate.roll))
        adjustable = swing & (progress < FIXED)
        target = estimate.position_correction + balance + turned + upright
        self._right[adjustable] = target[adjustable]
        return np.asarray(self._left + progress[:, None] * (self._right - self._left))

    def _compliance(self, number: int, estimate: StateEstimate) -> Array:
        """Vertical correction of the feet, shape (feet,), in [m].

        Feet in the air stay level to the ground. Feet on the ground comply with deviations from the
        planned force, as does a foot from an early touch-down on.
        """
        plan, swing = self._plan, self._plan.swing[number]
        in_contact = (plan.progress[number] > DESCENDING) & (estimate.force > CONTACT * plan.weight)
        self._early = swing & (self._early | in_contact)
        tilt = estimate.pitch * self._lever[:, 0] - estimate.roll * self._lever[:, 1]
        levelling = LEVELLING * (self._lean * tilt - self._rise)
        compliant = self._gain[number] * (estimate.force - self._load[number]) - LEAK * self._rise
        desired = np.where(swing & ~self._early, levelling, compliant)
        self._speed += TICK / (SMOOTHING + TICK) * (desired - self._speed)
        rise = self._rise + TICK * self._speed
        rise += self._early * (plan.feet[number - 1, :, 2] - plan.feet[number, :, 2])
        highest = HIGHEST * plan.size
        self._rise = np.minimum(np.maximum(rise, -highest), highest)
        return self._rise


HIGHEST_ACCELERATION = 1500.0
"""Limit of the feed-forward acceleration at jumps of the reference, in [rad/s²] and [m/s²]."""


class TrotControl:
    """Controller with attitude feedback of the base and foot placement."""

    def __init__(
        self,
        robot: Quadruped,
        model: Any,
        standing: Standing,
        plan: Plan,
        *,
        sensors: dict[str, slice],
        gain: Array,
    ) -> None:
        self._model = model.copy()
        self._model.armature = np.array([*[0.0] * 6, *robot.drives.armature])
        self._data = self._model.createData()
        self._body = WholeBody(model, robot.feet, standing.configuration)
        self._estimate = StateEstimate(robot, sensors)
        self._feet = Feet(robot, standing, plan, gain)
        self._plan, self._rates = plan, _rates(plan)
        self._lean = robot.attitude_gain
        self._configurations = [standing.configuration] * 3  # of the last three ticks
        self._velocity, self._planned = np.zeros(model.nv), np.zeros(model.nv - 6)

    def tick(self, number: int, sensors: Array) -> Reference:
        """Advance by one tick."""
        before, here, after = self._configurations = [
            *self._configurations[1:],
            self._configuration(number, sensors),
        ]
        velocity = pin.difference(self._model, before, after) / (2 * TICK)
        planned = (self._body.inverse @ self._rates[number])[6:]
        reference = Reference(
            position=np.stack((before[7:], here[7:])),
            velocity=np.stack((self._velocity[6:], velocity[6:])),
            planned=np.stack((self._planned, planned)),
            torque=self._torque(number, here, velocity),
            lift=self._body.lift,
        )
        self._velocity, self._planned = velocity, planned
        return reference

    def fallen(self, sensors: Array) -> bool:
        """Whether the robot is too low or too much tilted."""
        return self._estimate.fallen(sensors, self._plan.size)

    def _configuration(self, number: int, sensors: Array) -> Array:
        """Configuration by plan and feedback."""
        plan, estimate = self._plan, self._estimate
        centre, yaw = plan.centre[number].copy(), float(plan.yaw[number])
        velocity = self._rates[number, _CENTRE]
        tilt = plan.tilt[number]
        estimate.update(sensors, place=centre[:2], velocity=velocity, yaw=yaw, tilt=tilt)
        centre[:2] += estimate.position_correction
        lean = -self._lean
        base = pin.rpy.rpyToMatrix(
            tilt[0] + lean * estimate.roll,
            tilt[1] + lean * estimate.pitch,
            yaw + estimate.yaw_correction,
        )
        return self._body.follow(self._feet.places(number, estimate), (), centre, base)

    def _torque(self, number: int, configuration: Array, velocity: Array) -> Array:
        """Feed-forward torque for a motion under the planned loads of the feet."""
        highest = HIGHEST_ACCELERATION
        acceleration = (velocity - self._velocity) / TICK
        acceleration = np.minimum(np.maximum(acceleration, -highest), highest)
        torque = pin.rnea(self._model, self._data, configuration, velocity, acceleration)
        load = self._plan.weight * self._plan.load[number]
        push = np.outer(load, self._plan.push[number]).ravel()
        return np.asarray((torque - load @ self._body.heights - push @ self._body.planes)[6:])


_CENTRE = slice(-6, -4)
"""Slice of the horizontal velocity of the centre of mass in the planned rates."""


def _rates(plan: Plan) -> Array:
    """Planned rates of the whole body's equations: feet, centre of mass, turn of the base."""
    feet = plan.feet.reshape(len(plan.yaw), -1)
    rates = np.gradient(np.column_stack((feet, plan.centre, plan.tilt, plan.yaw)), TICK, axis=0)
    rates[:, -3:-1] = turned(plan.yaw, rates[:, -3:-1])  # of small tilts
    return np.asarray(rates)


SETTLING = 400
"""Ticks before the recording during which the robot comes to rest under its unknown load."""
ATTITUDE_NOISE = 1e-4  # standard deviation of the measured attitude per tick, in [rad]
VELOCITY_NOISE = 5e-3  # standard deviation of the measured velocity per tick, in [m/s]


def plan(robot: Quadruped, motion: Trot, rng: np.random.Generator, duration: float) -> Plan:
    """Plan of the motion of one run."""
    return trot(robot, stand(robot), motion, rng, duration)


def scene(robot: Quadruped, plan: Plan, faults: Faults, imperfections: Imperfections) -> Scene:
    """Scene of one run."""
    model, standing = reduced_model(robot), stand(robot)
    boxes = faults.boxes_on(plan)
    world = real_world(robot, boxes, imperfections, frame=model.frames[1].name, point=np.zeros(3))
    sensors = sensors_of(world)
    gain = np.pad(faults.gain(plan.time), (SETTLING, 0), "edge") * imperfections.force_gain
    control = TrotControl(
        robot,
        model,
        standing,
        _shifted(plan, faults).after(SETTLING),
        sensors=sensors,
        gain=gain,
    )
    noise = np.zeros(world.nsensordata)
    noise[: len(robot.feet)] = imperfections.force_noise
    noise[sensors["base.turn"]] = ATTITUDE_NOISE / 2
    noise[sensors["centre.velocity"]] = VELOCITY_NOISE
    return Scene(
        model=world,
        start=_start(robot, model, standing, faults),
        control=control,
        effectors=len(robot.feet),
        settling=SETTLING,
        noise=noise,
        changes=box_changes(world, boxes),
    )


def _shifted(plan: Plan, faults: Faults) -> Plan:
    if faults.shift is None:
        return plan
    return replace(plan, feet=plan.feet + faults.shift(plan.time))


def _start(robot: Quadruped, model: Any, standing: Standing, faults: Faults) -> Array:
    """Configuration at which the encoders read the standing one, lowest foot on the ground."""
    configuration = standing.configuration.copy()
    configuration[7:] -= faults.offsets(len(configuration) - 7)
    data = model.createData()
    pin.framesForwardKinematics(model, data, configuration)
    lowest = min(data.oMf[model.getFrameId(foot.frame)].translation[2] for foot in robot.feet)
    configuration[2] += robot.feet[0].radius - lowest
    configuration[3:7] = configuration[[6, 3, 4, 5]]  # MuJoCo has w first
    return np.asarray(configuration)
