"""The noise signals of a run that a sample has."""

from collections.abc import Mapping
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from noiseclassifier.scenarios.limbs import limbs
from noisemodel import GeometryError, Robot, Run, Surface, extended, simplified
from noisemodel import norms as whole_norms
from noisemodel.types import Array

Signals: TypeAlias = Mapping[str, NDArray[np.float32]]
"""Signals by name, each of shape (samples,)."""

WHOLE = ("measured", "desired", "error")
"""The signals that every sample has."""


def signals(run: Run) -> Signals:
    """Noise signals of a simulated run.

    Returns:
        Norms of its velocities; and sound power, kind normal, in [W]: ``power`` of the measured
        motion and ``power_desired`` of the desired one, if the robot has a surface.
    """
    return {**norms(run), **_single(_power(run))}


def norms(run: Run) -> Signals:
    """Norms of the velocities of a run, in [rad/s]."""
    assert run.velocity_desired is not None
    desired, error = run.velocity_desired, run.velocity_desired - run.velocity
    whole = whole_norms(run)
    found = {name: whole[name] for name in WHOLE}
    found |= {name: simplified(stage) for name, stage in run.stages.items()}
    for frame, joints in limbs(str(run.robot)).items():
        mine = [run.joint_names.index(joint) for joint in joints]
        for name, velocity in zip(WHOLE, (run.velocity, desired, error), strict=True):
            found[f"{name}_{frame}"] = simplified(velocity[:, mine])
    return _single(found)


def joints(run: Run) -> Signals:
    """Velocities of a run by joint."""
    assert run.velocity_desired is not None
    desired, measured = (each.T for each in (run.velocity_desired, run.velocity))
    return with_error(desired.astype(np.float32), measured.astype(np.float32))


def with_error(desired: NDArray[np.float32], measured: NDArray[np.float32]) -> Signals:
    """Velocities by joint, with their error.

    Args:
        desired: Velocities, shape (joints, samples), in [rad/s].
        measured: Velocities, shape (joints, samples), in [rad/s].
    """
    return {
        "desired_joints": desired,
        "measured_joints": measured,
        "error_joints": desired - measured,
    }


def _single(found: Mapping[str, Array]) -> Signals:
    return {name: signal.astype(np.float32) for name, signal in found.items()}


def _power(run: Run) -> dict[str, Array]:
    """Total sound power; extended noise is the sum of both (paper, Sec. II-A)."""
    robot, surface = _surface(str(run.robot))
    desired = robot.desired(run)
    if surface is None or desired is None:
        return {}
    motions = {"power": robot.configuration(run), "power_desired": desired}
    return {
        name: extended(robot, surface, *motion, kind="normal").total
        for name, motion in motions.items()
    }


@lru_cache(maxsize=4)
def _surface(name: str) -> tuple[Robot, Surface | None]:
    robot = Robot.load(name)
    try:
        surface = Surface.of(robot, "auto")
    except GeometryError:
        return robot, None
    return robot, surface if surface.area.any() else None
