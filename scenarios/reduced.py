"""A robot's Pinocchio model with only those joints that its scenarios move."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Protocol

import pinocchio as pin

from noisemodel import Robot
from scenarios.drivetrain import Drivetrain
from scenarios.errors import UnsupportedModelError


class Reducible(Protocol):
    """The joints of a robot; robots of every family have them."""

    @property
    def name(self) -> str:
        """Name of the URDF, as `noisemodel.ROBOTS` lists it."""

    @property
    def drives(self) -> Drivetrain:
        """The joints that move."""

    @property
    def held(self) -> Mapping[str, float]:
        """Positions of the locked joints that are not at 0, in [rad] or [m]."""


def reduced_model(robot: Reducible) -> Any:
    """Pinocchio model of a robot, with all other joints locked.

    Args:
        robot: The robot.

    Returns:
        A ``pinocchio.Model``; every call returns the same one.

    Raises:
        UnsupportedModelError: If the URDF lacks a joint.
    """
    return _reduced(robot.name, robot.drives.joints, tuple(sorted(robot.held.items())))


@lru_cache(maxsize=8)
def _reduced(name: str, moved: tuple[str, ...], held: tuple[tuple[str, float], ...]) -> Any:
    model = Robot.load(name).model
    lacking = {*moved, *dict(held)} - set(model.names)
    if lacking:
        raise UnsupportedModelError(
            f"{name} has no joint {', '.join(sorted(lacking))}; it has {', '.join(model.names[1:])}"
        )
    posture = pin.neutral(model)
    for joint, position in held:
        posture[model.joints[model.getJointId(joint)].idx_q] = position
    fixed = [
        model.getJointId(joint)
        for joint in model.names[1:]
        if joint not in moved and model.joints[model.getJointId(joint)].nv == 1
    ]
    reduced = pin.buildReducedModel(model, fixed, posture)
    if tuple(reduced.names)[-len(moved) :] != moved:
        raise UnsupportedModelError(
            f"{name}: the drives are to be in the order of the URDF, {', '.join(reduced.names[1:])}"
        )
    return reduced
