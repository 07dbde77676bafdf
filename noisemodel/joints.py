"""The joints of a robot as a table of constants: all that batch kinematics needs of Pinocchio."""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from noisemodel.errors import RobotError
from noisemodel.types import Array

KINDS = {
    r"R[XYZ]|RevoluteUnaligned": "revolute",
    r"RUB[XYZ]|RevoluteUnboundedUnaligned": "continuous",
    r"P[XYZ]|PrismaticUnaligned": "prismatic",
    "FreeFlyer": "floating",
    "Planar": "planar",
}
"""Pinocchio's joint types by what they do; a URDF has no others."""


@dataclass(frozen=True)
class Joint:
    """How one joint moves its link.

    Attributes:
        name: Its name.
        kind: "revolute", "continuous", "prismatic", "floating" or "planar".
        parent: Index of the joint that carries it; 0 is the universe.
        first_q: Index of its first entry in the configuration.
        first_v: Index of its first entry in the velocity.
        axis: Index of the coordinate axis that it moves about or along, after ``turn``.
        turn: Rotation from the joint's axes to axes of which one is the joint's own, or None
            where that is so already, shape (3, 3).
        shift: Twist of the parent to twist of the resting joint, in those axes, shape (6, 6).
        multiplier: Ratio to the joint that ``first_q`` belongs to (mimic joints).
        offset: Added to the position (mimic joints), in [rad] or [m].
    """

    name: str
    kind: str
    parent: int
    first_q: int
    first_v: int
    axis: int
    turn: Array | None
    shift: Array
    multiplier: float = 1.0
    offset: float = 0.0

    @property
    def nq(self) -> int:
        """Entries in the configuration."""
        return {"floating": 7, "planar": 4, "continuous": 2}.get(self.kind, 1)

    @property
    def nv(self) -> int:
        """Entries in the velocity."""
        return {"floating": 6, "planar": 3}.get(self.kind, 1)

    @property
    def moves(self) -> slice | list[int]:
        """The entries of the twist that its velocity adds to."""
        if self.kind == "planar":
            return [0, 1, 5]
        first = {"floating": 0, "prismatic": self.axis}.get(self.kind, 3 + self.axis)
        return slice(first, first + self.nv)  # adds in place, which a list does not


def table_of(model: Any) -> tuple[Joint, ...]:
    """Read the joints of a Pinocchio model, the universe left out.

    Args:
        model: A ``pinocchio.Model`` without mimic joints of Pinocchio's own kind.

    Returns:
        Joint 1 to the last, in Pinocchio's order.

    Raises:
        RobotError: If a joint is of a type that no URDF has.
    """
    return tuple(_joint(model, index) for index in range(1, model.njoints))


def _joint(model: Any, index: int) -> Joint:
    joint, placement = model.joints[index], model.jointPlacements[index]
    kind = joint.shortname().removeprefix("JointModel")
    matches = [word for pattern, word in KINDS.items() if re.fullmatch(pattern, kind)]
    if not matches:
        raise RobotError(f"joint {model.names[index]!r} is of type {kind}, which is not supported")
    turn = None
    if kind.endswith("Unaligned"):
        subspace = np.ravel(joint.createData().S)  # the joint's twist at unit velocity
        turn = _axes_with_z(subspace[:3] + subspace[3:])
    rotation = placement.rotation.T if turn is None else turn @ placement.rotation.T
    return Joint(
        name=str(model.names[index]),
        kind=matches[0],
        parent=int(model.parents[index]),
        first_q=int(joint.idx_q),
        first_v=int(joint.idx_v),
        axis="XYZ".find(kind[-1]) if kind[-1] in "XYZ" else 2,
        turn=turn,
        shift=_shift(rotation, placement.translation),
    )


def _shift(rotation: Array, translation: Array) -> Array:
    """Twist at the parent's origin to twist at the joint's: v' = R (v + w x t), w' = R w."""
    x, y, z = translation
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.block([[rotation, -rotation @ cross], [np.zeros((3, 3)), rotation]])


def _axes_with_z(axis: Array) -> Array:
    """Rotate to axes whose z is ``axis``."""
    z = axis / np.linalg.norm(axis)
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    return np.stack((x, np.cross(z, x), z))
