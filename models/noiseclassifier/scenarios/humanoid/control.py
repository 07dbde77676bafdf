"""The walking controller: plan and sensors to joint references, once per millisecond."""

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.clock import TICK
from noiseclassifier.scenarios.humanoid.plan import Plan
from noiseclassifier.scenarios.humanoid.stabilizer import Stabilizer
from noiseclassifier.scenarios.humanoid.walking import GRAVITY
from noiseclassifier.scenarios.loop import Reference
from noiseclassifier.scenarios.wholebody import WholeBody
from noisemodel.types import Array

LOWEST = 0.25
"""Distance below its plan at which a base has fallen, in [m]."""
LEVEL = 0.8
"""Vertical component of the base's own z axis below which it has fallen."""


class WalkControl:
    """Controller with a stabilizer and whole-body inverse kinematics.

    Args:
        weight: Weight of the nominal robot, in [N].
    """

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
