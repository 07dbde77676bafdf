"""Inverse kinematics of a whole robot on a floating base, by square Newton steps.

The equations, in this order, all in the world's axes: for each effector the place of its point,
and, if it is a sole, its turn; then the centre of mass; then the turn of the base. A biped with
six joints per leg and a quadruped with three per leg have as many unknowns as that. Each joint of a
moving upper body adds one unknown and one equation, its position.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.errors import UnsupportedModelError
from noiseclassifier.scenarios.shapes import Effector, Sole
from noisemodel.types import Array


class WholeBody:
    """Inverse kinematics with one Newton step per call.

    Args:
        start: Configuration to start from, shape (nq,).

    Attributes:
        configuration: The present configuration, as Pinocchio has it, shape (nq,).
        inverse: Inverse Jacobian of the last step: velocities, as Pinocchio has them, per rates of
            the equations, shape (nv, nv).
    """

    def __init__(
        self, model: Any, effectors: Sequence[Effector], start: Array, *, upper: int = 0
    ) -> None:
        self._model = model.copy()
        self._frames = [_add_point(self._model, effector) for effector in effectors]
        self._data = self._model.createData()
        widths = [6 if isinstance(effector, Sole) else 3 for effector in effectors]
        ends = np.cumsum(widths).tolist()
        self._rows = [slice(end - width, end) for width, end in zip(widths, ends, strict=True)]
        self._heights = [rows.start + 2 for rows in self._rows]
        equations = ends[-1] + 6 + upper
        if equations != model.nv:
            raise UnsupportedModelError(
                f"{len(widths)} effectors make {equations} equations, the robot has {model.nv}"
                " unknowns; lock all joints that are not in its legs"
            )
        self._centre, self._base = slice(ends[-1], ends[-1] + 3), slice(ends[-1] + 3, ends[-1] + 6)
        self._upper = slice(ends[-1] + 6, equations)
        self._jacobian = np.zeros((equations, equations))
        self._jacobian[self._upper, equations - upper :] = np.eye(upper)
        self._error = np.zeros(equations)
        self.configuration = np.array(start, dtype=np.float64)
        self.inverse = np.zeros((equations, equations))

    def follow(
        self,
        places: Array,
        turns: Sequence[Array],
        centre: Array,
        base: Array,
        *,
        upper: Array | None = None,
        steps: int = 1,
    ) -> Array:
        """Configuration after Newton steps; one is enough for targets that moved by millimetres.

        Args:
            places: Of the effectors' points, shape (effectors, 3), in [m].
            turns: Rotation matrix of each sole, shape (3, 3); those of balls are ignored.
            centre: Of mass, shape (3,), in [m].
            base: Rotation matrix of the base, shape (3, 3).
            upper: Positions of the upper body's joints, shape (upper,), in [rad]; by default they
                stay.

        Returns:
            The new configuration, shape (nq,).
        """
        model, data = self._model, self._data
        jacobian, error = self._jacobian, self._error
        for _ in range(steps):
            pin.computeJointJacobians(model, data, self.configuration)
            for index, (frame, rows) in enumerate(zip(self._frames, self._rows, strict=True)):
                pose = pin.updateFramePlacement(model, data, frame)
                columns = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
                width = rows.stop - rows.start
                jacobian[rows] = columns[:width]
                error[rows.start : rows.start + 3] = places[index] - pose.translation
                if width == 6:
                    error[rows.start + 3 : rows.stop] = _turn(pose.rotation, turns[index])
            jacobian[self._centre] = pin.jacobianCenterOfMass(model, data, False)
            error[self._centre] = centre - data.com[0]
            rotation = data.oMi[1].rotation
            jacobian[self._base, 3:6] = rotation
            error[self._base] = _turn(rotation, base)
            if upper is not None:
                error[self._upper] = upper - self.configuration[model.nq - len(upper) :]
            self.inverse = np.linalg.inv(jacobian)
            self.configuration = pin.integrate(model, self.configuration, self.inverse @ error)
        return self.configuration

    def hold(self, bearing: Array) -> Array:
        """Torques that hold the robot still under ground forces.

        Args:
            bearing: Ground force on each effector's point, in the order of the equations: force, in
                [N], and, for a sole, torque, in [N m].

        Returns:
            Torques of the joints, shape (joints,), in [N m].
        """
        gravity = pin.computeGeneralizedGravity(self._model, self._data, self.configuration)
        legs = self._jacobian[: self._centre.start, 6:]
        return np.asarray(gravity[6:] - bearing @ legs)

    @property
    def lift(self) -> Array:
        """Movement of the joints per height of each effector, shape (effectors, joints)."""
        return self.inverse[6:, self._heights].T

    @property
    def planes(self) -> Array:
        """Rates of the effectors' x and y per velocity, shape (2 effectors, nv)."""
        rows = [row for height in self._heights for row in (height - 2, height - 1)]
        return self._jacobian[rows]

    @property
    def heights(self) -> Array:
        """Rates of the effectors' heights per velocity, shape (effectors, nv)."""
        return self._jacobian[self._heights]


def _add_point(model: Any, effector: Effector) -> int:
    """Add the point of an effector as a frame; its index."""
    if not model.existFrame(effector.frame):
        known = ", ".join(frame.name for frame in model.frames)
        raise UnsupportedModelError(
            f"the robot has no frame {effector.frame!r} to stand on; it has {known}"
        )
    parent = model.getFrameId(effector.frame)
    frame = model.frames[parent]
    pose = frame.placement * pin.SE3(np.eye(3), np.array(effector.point))
    kind = pin.FrameType.OP_FRAME
    return int(
        model.addFrame(pin.Frame(f"{effector.frame}.point", frame.parentJoint, parent, pose, kind))
    )


def _turn(rotation: Array, wanted: Array) -> Array:
    """Rotation vector from one rotation to another, in the world's axes, shape (3,), in [rad]."""
    return np.asarray(rotation @ pin.log3(rotation.T @ wanted))
