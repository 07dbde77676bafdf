"""The joints' controller: a plan of joint positions to references, once per millisecond."""

from typing import Any

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.arm.control import HIGHEST_ACCELERATION
from noiseclassifier.scenarios.clock import TICK
from noiseclassifier.scenarios.loop import Reference
from noiseclassifier.scenarios.reduced import configuration
from noiseclassifier.scenarios.shapes import Effector
from noisemodel.types import Array

DAMPING = 1e-3
"""Of the inverse Jacobian, in [m²]."""


class JointControl:
    """Follows planned joint positions with the torque of the model as feed-forward.

    Args:
        joints: Planned positions, shape (ticks, joints), in [rad].
        shift: Added to the planned place of the tool's tip, shape (ticks, 3), in [m].
        fastest: Largest acceleration that the feed-forward torque has, in [rad/s²].
    """

    def __init__(
        self,
        model: Any,
        tool: Effector,
        joints: Array,
        shift: Array,
        *,
        fastest: float = HIGHEST_ACCELERATION,
    ) -> None:
        self._model, self._data = model, model.createData()
        self._frame, self._point = model.getFrameId(tool.frame), np.array(tool.point)
        self._planned = np.gradient(joints, TICK, axis=0)
        joints = joints.copy()
        for tick in np.flatnonzero(shift.any(axis=1)):
            joints[tick] += self._inverse(joints[tick]) @ shift[tick]
        self._position = joints
        self._velocity = np.gradient(joints, TICK, axis=0)
        self._acceleration = np.clip(np.gradient(self._velocity, TICK, axis=0), -fastest, fastest)

    def tick(self, number: int, sensors: Array) -> Reference:
        """Advance by one tick; the sensors have no effect."""
        ends = np.minimum((number, number + 1), len(self._position) - 1)
        here = self._position[number]
        return Reference(
            position=self._position[ends],
            velocity=self._velocity[ends],
            planned=self._planned[ends],
            torque=pin.rnea(
                self._model,
                self._data,
                configuration(self._model, here),
                self._velocity[number],
                self._acceleration[number],
            ),
            lift=self._inverse(here)[None, :, 2],
        )

    def fallen(self, sensors: Array) -> bool:
        """False: an arm does not fall."""
        return False

    def _inverse(self, joints: Array) -> Array:
        """Damped inverse Jacobian of the tip's place, shape (joints, 3), in [rad/m]."""
        q = configuration(self._model, joints)
        pin.computeJointJacobians(self._model, self._data, q)
        placement = pin.updateFramePlacement(self._model, self._data, self._frame)
        jacobian = pin.getFrameJacobian(
            self._model, self._data, self._frame, pin.LOCAL_WORLD_ALIGNED
        )
        lever = placement.rotation @ self._point
        place = jacobian[:3] - pin.skew(lever) @ jacobian[3:]
        return np.asarray(place.T @ np.linalg.inv(place @ place.T + DAMPING * np.eye(3)))
