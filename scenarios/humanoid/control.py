"""The walking controller: plan and sensors to joint references, once per millisecond."""

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from noisemodel.types import Array
from scenarios.clock import TICK
from scenarios.humanoid.balance import Balance
from scenarios.humanoid.plan import Plan
from scenarios.humanoid.walking import GRAVITY
from scenarios.loop import Reference
from scenarios.wholebody import WholeBody

LOWEST = 0.25
"""A base that is so far below its plan has fallen, in [m]."""
LEVEL = 0.8
"""A base whose own vertical axis points upwards by less than this has fallen."""


class WalkControl:
    """Follows a plan with a stabilizer and whole-body inverse kinematics.

    Args:
        body: The robot as its controller knows it, standing as the plan begins.
        balance: The stabilizer.
        plan: What the robot is to do.
        weight: Of the robot as it is known, in [N].
        where: Where each sensor's values are.
    """

    def __init__(
        self,
        body: WholeBody,
        balance: Balance,
        plan: Plan,
        *,
        weight: float,
        where: Mapping[str, slice],
    ) -> None:
        self._body, self._balance = body, balance
        self._places, self._yaws = plan.places, plan.yaws.tolist()
        self._centre, self._heading = plan.centre, plan.heading.tolist()
        self._rates, self._bearing, self._weight = _rates(plan), bearing(plan), weight
        self._place, self._turn = where["base.place"], where["base.turn"]
        rest = body.configuration[7:]
        self._before = self._here = rest
        self._velocity = self._planned = np.zeros(len(rest))
        self._lowest = body.configuration[2] - LOWEST - plan.centre[0, 2]
        self._number = 0

    def tick(self, number: int, sensors: Array) -> Reference:
        """Advance by one tick.

        Args:
            number: Which tick it is.
            sensors: What the sensors report.

        Returns:
            What the joints are to do, one tick late: a velocity takes two neighbours.
        """
        heights, tilts = self._balance.step(number, sensors)
        places = self._places[number].copy()
        places[:, 2] += heights
        turns = [
            pin.rpy.rpyToMatrix(roll, pitch, yaw)
            for (roll, pitch), yaw in zip(tilts, self._yaws[number], strict=True)
        ]
        base = pin.rpy.rpyToMatrix(0.0, 0.0, self._heading[number])
        after = self._body.follow(places, turns, self._centre[number], base)[7:]
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
        """Tell whether the base has come down or lies on its side."""
        _, x, y, _ = sensors[self._turn].tolist()
        height = float(sensors[self._place][2] - self._centre[self._number, 2])
        return bool(height < self._lowest or 1 - 2 * (x * x + y * y) < LEVEL)


def _rates(plan: Plan) -> Array:
    """Rates of all equations of `WholeBody` that the plan asks for, shape (ticks, 18)."""
    ticks = len(plan.centre)
    soles = np.zeros((ticks, 2, 6))
    soles[:, :, :3] = np.gradient(plan.places, TICK, axis=0)
    soles[:, :, 5] = np.gradient(plan.yaws, TICK, axis=0)
    turning = np.zeros((ticks, 3))
    turning[:, 2] = np.gradient(plan.heading, TICK)
    moving = np.gradient(plan.centre, TICK, axis=0)
    return np.hstack((soles.reshape(ticks, 12), moving, turning))


def bearing(plan: Plan) -> Array:
    """Find what the ground is to do to the soles, per weight of the robot.

    Args:
        plan: What the robot is to do.

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
