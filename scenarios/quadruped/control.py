"""The controller of a trot: plan, attitude and foot forces to joint references, once per tick."""

from typing import Any

import numpy as np
import pinocchio as pin

from noisemodel.types import Array
from scenarios.clock import TICK
from scenarios.loop import Reference
from scenarios.quadruped.feeling import Feeling
from scenarios.quadruped.feet import Feet
from scenarios.quadruped.robots import Quadruped
from scenarios.quadruped.standing import Standing
from scenarios.quadruped.trotting import Plan
from scenarios.wholebody import WholeBody

HIGHEST_ACCELERATION = 1500.0
"""The feed-forward does not answer jumps of the reference, in [rad/s²] and [m/s²]."""


class TrotControl:
    """Follows a plan; the base leans against its tilt, and the feet keep the balance.

    Args:
        robot: The robot.
        model: The ``pinocchio.Model`` that the controller has.
        standing: How it stands at first.
        plan: What it is to do.
        sensors: Where each sensor's values are.
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
        self._feeling = Feeling(robot, sensors)
        self._feet = Feet(robot, standing, plan, gain)
        self._plan, self._rates = plan, _rates(plan)
        self._lean = robot.attitude_gain
        self._configurations = [standing.configuration] * 3  # of the last three ticks
        self._velocity, self._planned = np.zeros(model.nv), np.zeros(model.nv - 6)

    def tick(self, number: int, sensors: Array) -> Reference:
        """Advance by one tick.

        Args:
            number: Which tick it is.
            sensors: What the sensors say, as `scenarios.sensing.sensors_of` has it.

        Returns:
            What the joints are to do, one tick late: a velocity takes two neighbours.
        """
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
        """Tell whether the robot is too low or too much tilted."""
        return self._feeling.fallen(sensors, self._plan.size)

    def _configuration(self, number: int, sensors: Array) -> Array:
        """Go where the plan and the feedback want the robot to be."""
        plan, feeling = self._plan, self._feeling
        centre, yaw = plan.centre[number].copy(), float(plan.yaw[number])
        velocity = self._rates[number, _CENTRE]
        feeling.hear(sensors, place=centre[:2], velocity=velocity, yaw=yaw)
        centre[:2] += feeling.home
        lean = -self._lean
        base = pin.rpy.rpyToMatrix(lean * feeling.roll, lean * feeling.pitch, yaw + feeling.turn)
        return self._body.follow(self._feet.places(number, feeling), (), centre, base)

    def _torque(self, number: int, configuration: Array, velocity: Array) -> Array:
        """What the model needs to move like that while the feet bear their planned loads."""
        highest = HIGHEST_ACCELERATION
        acceleration = (velocity - self._velocity) / TICK
        acceleration = np.minimum(np.maximum(acceleration, -highest), highest)
        torque = pin.rnea(self._model, self._data, configuration, velocity, acceleration)
        load = self._plan.weight * self._plan.load[number]
        return np.asarray((torque - load @ self._body.heights)[6:])


_CENTRE = slice(-6, -4)
"""Where the horizontal velocity of the centre of mass is among the planned rates."""


def _rates(plan: Plan) -> Array:
    """Planned rates of the whole body's equations: feet, centre of mass, turn of the base.

    Returns:
        Shape (ticks, equations), in [m/s] and [rad/s].
    """
    feet = plan.feet.reshape(len(plan.yaw), -1)
    level = np.zeros((len(plan.yaw), 2))
    return np.asarray(
        np.gradient(np.column_stack((feet, plan.centre, level, plan.yaw)), TICK, axis=0)
    )
