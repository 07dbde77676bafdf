"""A robot's Pinocchio model with only those joints that its scenarios move."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.drivetrain import Drivetrain
from noiseclassifier.scenarios.errors import UnsupportedModelError
from noisemodel import Robot
from noisemodel.types import Array


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
    """Pinocchio model of a robot, with all other joints locked."""
    held = tuple(sorted(robot.held.items()))
    return _reduced(robot.name, robot.drives.joints, held, robot.length_scale)


def configuration(model: Any, joints: Array) -> Array:
    """Pinocchio's configuration of a robot with a fixed base.

    Args:
        joints: Joint positions, shape (joints,), in [rad].
    """
    if model.nq == model.nv:
        return joints
    return np.asarray(pin.integrate(model, pin.neutral(model), joints))


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
    # Pinocchio refuses two frames of one name, as in anymal_c, and a joint and a body of one name.
    try:
        reduced = pin.buildReducedModel(model, fixed, posture)
    except ValueError:
        if fixed:
            raise
        reduced = model
    if tuple(reduced.names)[-len(moved) :] != moved:
        raise UnsupportedModelError(
            f"{name}: the drives are to be in the order of the URDF, {', '.join(reduced.names[1:])}"
        )
    return reduced if scale == 1.0 else _scaled(reduced, scale)


def _scaled(model: Any, scale: float) -> Any:
    """A copy of a model with all lengths scaled, its masses unchanged."""
    scaled = model.copy()
    for index in range(1, model.njoints):
        scaled.jointPlacements[index] = _moved(model.jointPlacements[index], scale)
        given = model.inertias[index]
        scaled.inertias[index] = pin.Inertia(
            given.mass, scale * given.lever, scale**2 * given.inertia
        )
    for index in range(model.nframes):
        scaled.frames[index].placement = _moved(model.frames[index].placement, scale)
    return scaled


def _moved(placement: Any, scale: float) -> Any:
    return pin.SE3(placement.rotation, scale * placement.translation)
