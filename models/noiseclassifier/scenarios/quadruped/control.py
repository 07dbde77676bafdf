"""Controller of a trot: from plan, attitude and foot forces to joint references."""

from typing import Any

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.clock import TICK
from noiseclassifier.scenarios.loop import Reference
from noiseclassifier.scenarios.quadruped.estimation import StateEstimate
from noiseclassifier.scenarios.quadruped.feet import Feet
from noiseclassifier.scenarios.quadruped.robots import Quadruped
from noiseclassifier.scenarios.quadruped.standing import Standing
from noiseclassifier.scenarios.quadruped.trotting import Plan, turned
from noiseclassifier.scenarios.wholebody import WholeBody
from noisemodel.types import Array

HIGHEST_ACCELERATION = 1500.0
"""Limit of the feed-forward acceleration at jumps of the reference, in [rad/s²] and [m/s²]."""


class TrotControl:
    """Controller with attitude feedback of the base and foot placement.

    Args:
        gain: Scale of the feedback of forces at each tick, shape (ticks,).
    """

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
    """Planned rates of the whole body's equations: feet, centre of mass, turn of the base.

    Returns:
        Shape (ticks, equations), in [m/s] and [rad/s].
    """
    feet = plan.feet.reshape(len(plan.yaw), -1)
    rates = np.gradient(np.column_stack((feet, plan.centre, plan.tilt, plan.yaw)), TICK, axis=0)
    rates[:, -3:-1] = turned(plan.yaw, rates[:, -3:-1])  # of small tilts
    return np.asarray(rates)
