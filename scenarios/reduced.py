"""A robot's Pinocchio model with only those joints that its scenarios move."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
import pinocchio as pin

from noisemodel import Robot
from noisemodel.types import Array
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
    def length_scale(self) -> float:
        """Scale of all lengths of the URDF."""

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
    scale = float(getattr(robot, "length_scale", 1.0))
    held = tuple(sorted(robot.held.items()))
    reduced = _reduced(robot.name, robot.drives.joints, held)
    return reduced if scale == 1 else _resized(robot.name, robot.drives.joints, held, scale)


@lru_cache(maxsize=8)
def _reduced(
    name: str, moved: tuple[str, ...], held: tuple[tuple[str, float], ...], scale: float
) -> Any:
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
    # Pinocchio refuses two frames of one name, as in anymal_c, which needs no reduction.
    unique = len({frame.name for frame in model.frames}) == model.nframes
    reduced = pin.buildReducedModel(model, fixed, posture) if fixed or unique else model
    if tuple(reduced.names)[-len(moved) :] != moved:
        raise UnsupportedModelError(
            f"{name}: the drives are to be in the order of the URDF, {', '.join(reduced.names[1:])}"
        )
    return reduced


@lru_cache(maxsize=8)
def _resized(
    name: str, moved: tuple[str, ...], held: tuple[tuple[str, float], ...], scale: float
) -> Any:
    """The model with all lengths times a scale, its masses as they are."""
    model = _reduced(name, moved, held).copy()
    for joint in range(model.njoints):
        inertia = model.inertias[joint]
        model.inertias[joint] = pin.Inertia(
            inertia.mass, scale * inertia.lever, scale**2 * inertia.inertia
        )
        model.jointPlacements[joint].translation = scale * model.jointPlacements[joint].translation
    for frame in model.frames:
        frame.placement.translation = scale * frame.placement.translation
    return model
