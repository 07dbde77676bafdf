"""The tool's controller: plan and contact force to joint references, once per millisecond."""

from typing import Any

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.arm.picking import Plan
from noiseclassifier.scenarios.clock import TICK
from noiseclassifier.scenarios.loop import Reference
from noiseclassifier.scenarios.paths import minimum_jerk
from noiseclassifier.scenarios.reduced import configuration
from noisemodel.types import Array

HIGHEST_ACCELERATION = 30.0
"""Limit of the feed-forward acceleration at jumps of the reference, in [rad/s²]."""
FURTHEST = 0.1
"""Largest offset of the tool by force control, in [m]."""
GUARD = 80.0
"""Contact force beyond which the tool yields while it descends, in [N]."""
TOUCHING = 5.0
"""Contact force that no noise of a sensor reaches, in [N]."""
UNLOADING = 0.4
"""Time in which force control unloads a tool that touched before it started, in [s]."""


class ToolControl:
    """Follows a plan with a tool that points down, and presses with the planned force.

    Args:
        point: The tip in the frame's axes, shape (3,), in [m].
        rest: Joint positions at first, shape (joints,), in [rad].
        gain: Speed of the tool per error of the contact force at each tick, shape (ticks,),
            in [m/(s N)].
        time_constant: Low-pass on the contact force, in [s].
    """

    def __init__(
        self,
        model: Any,
        frame: str,
        point: Array,
        rest: Array,
        plan: Plan,
        *,
        gain: Array,
        time_constant: float,
    ) -> None:
        self._model, self._data = model, model.createData()
        self._frame, self._point = model.getFrameId(frame), point
        pin.framesForwardKinematics(model, self._data, configuration(model, rest))
        self._upright = self._data.oMf[self._frame].rotation.copy()
        self._plan, self._gain = plan, gain
        self._share = TICK / (time_constant + TICK)
        self._force = self._offset = self._left = self._excess = 0.0
        self._pressing = 0  # ticks of force control so far
        self._joints = [rest] * 3  # of the last three ticks
        self._velocity = self._planned = np.zeros(len(rest))
        self._velocities = np.gradient(plan.position, TICK, axis=0)
        self._turning = np.gradient(plan.yaw, TICK)

    def tick(self, number: int, sensors: Array) -> Reference:
        """Advance by one tick.

        Args:
            sensors: Contact force that the sensor reports, shape (1,), in [N].
        """
        tip = self._plan.position[number] + (0.0, 0.0, self._press(number, float(sensors[0])))
        joints, inverse = self._solve(tip, self._plan.yaw[number])
        before, here, after = self._joints = [*self._joints[1:], joints]
        velocity = (after - before) / (2 * TICK)
        acceleration = (after - 2 * here + before) / TICK**2
        planned = inverse @ (*self._velocities[number], 0, 0, self._turning[number])
        reference = Reference(
            position=np.stack((before, here)),
            velocity=np.stack((self._velocity, velocity)),
            planned=np.stack((self._planned, planned)),
            torque=pin.rnea(
                self._model,
                self._data,
                configuration(self._model, here),
                velocity,
                np.clip(acceleration, -HIGHEST_ACCELERATION, HIGHEST_ACCELERATION),
            ),
            lift=inverse[None, :, 2],
        )
        self._velocity, self._planned = velocity, planned
        return reference

    def fallen(self, sensors: Array) -> bool:
        """False: an arm does not fall."""
        return False

    def _press(self, number: int, force: float) -> float:
        """Height offset of the tool: the integral of the error of the contact force, in [m]."""
        self._force += self._share * (force - self._force)
        desired = self._plan.force[number]
        if np.isnan(desired):
            self._pressing = 0
            self._offset = self._left * self._plan.keep[number] or self._guarded(number)
            return self._offset
        if not self._pressing:
            self._excess = self._force if self._force > TOUCHING else 0.0
        if self._excess:  # bumpless transfer: the desired force starts at the measured one
            share = np.array(min(self._pressing * TICK / UNLOADING, 1.0))
            desired += self._excess * (1 - float(minimum_jerk(share)))
        self._pressing += 1
        rise = TICK * float(self._gain[number]) * (self._force - desired)
        self._offset = self._left = min(max(self._offset + rise, -FURTHEST), FURTHEST)
        return self._offset

    def _guarded(self, number: int) -> float:
        """Height offset of a tool that descends: it yields to an unplanned contact, in [m]."""
        rise = TICK * float(self._gain[number]) * (self._force - GUARD)
        return min(max(self._offset + rise, 0.0), FURTHEST)

    def _solve(self, tip: Array, yaw: float) -> tuple[Array, Array]:
        """Joints after a Newton step towards a pose of the tool, and the inverse Jacobian.

        One step per tick is enough: the tool moves by a millimetre in that time.
        """
        joints = self._joints[-1]
        pin.computeJointJacobians(self._model, self._data, configuration(self._model, joints))
        placement = pin.updateFramePlacement(self._model, self._data, self._frame)
        lever = placement.rotation @ self._point
        jacobian = pin.getFrameJacobian(
            self._model, self._data, self._frame, pin.LOCAL_WORLD_ALIGNED
        )
        jacobian[:3] -= pin.skew(lever) @ jacobian[3:]  # of the tip, not of the frame
        turn = placement.rotation.T @ pin.rpy.rpyToMatrix(0.0, 0.0, yaw) @ self._upright
        error = np.concatenate(
            (tip - placement.translation - lever, placement.rotation @ pin.log3(turn))
        )
        damped = jacobian @ jacobian.T + 1e-8 * np.eye(6)
        inverse = jacobian.T @ np.linalg.inv(damped)
        joints = joints + inverse @ error
        return joints, inverse
