"""Collision geometry of a MuJoCo model: effectors of the robot, boxes that appear and vanish."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.clock import TICK
from noiseclassifier.scenarios.errors import UnsupportedModelError
from noiseclassifier.scenarios.physics import Physics
from noiseclassifier.scenarios.shapes import Ball, Box, Effector, Rod, Sole
from noisemodel.types import Array

SPHERE = mujoco.mjtGeom.mjGEOM_SPHERE
ROBOT, WORLD = 1, 2
"""Contact groups: the robot collides with the world, never with itself."""


def add_effector(
    spec: Any, bodies: Sequence[Any], model: Any, effector: Effector, physics: Physics
) -> None:
    """Add the geom of an effector, and a site that encloses all of its contacts."""
    if not model.existFrame(effector.frame):
        known = ", ".join(frame.name for frame in model.frames)
        raise UnsupportedModelError(
            f"the robot has no frame {effector.frame!r} for an effector; it has {known}"
        )
    frame = model.frames[model.getFrameId(effector.frame)]
    body = bodies[frame.parentJoint]
    geom, size, middle, around = _solid(effector)
    pose = frame.placement
    shape = {"quat": quaternion(pose.rotation), **_surface(ROBOT, WORLD, physics)}
    if isinstance(effector, Ball):
        shape["condim"] = 4  # a foot of rubber does not spin on the spot
    body.add_geom(name=effector.frame, type=geom, size=size, pos=pose.act(middle), **shape)
    body.add_site(
        name=effector.frame,
        type=mujoco.mjtGeom.mjGEOM_BOX if isinstance(effector, Sole) else SPHERE,
        pos=pose.act(np.array(effector.point)),
        quat=shape["quat"],
        size=around,
    )


def add_boxes(spec: Any, boxes: Sequence[Box], physics: Physics) -> None:
    """Add the boxes of the world, all of them present."""
    for number, box in enumerate(boxes):
        spec.worldbody.add_geom(
            name=_box(number),
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=box.centre,
            size=box.half,
            quat=[np.cos(box.yaw / 2), 0, 0, np.sin(box.yaw / 2)],
            **_surface(WORLD, ROBOT, physics),
        )


def set_collision(model: Any, geom: int, *, present: bool) -> None:
    """Enable or disable the collisions of a geom."""
    model.geom_contype[geom], model.geom_conaffinity[geom] = (WORLD, ROBOT) if present else (0, 0)


def box_changes(model: Any, boxes: Sequence[Box]) -> dict[int, list[tuple[int, bool]]]:
    """Disable the boxes that are not present at first; the changes of all boxes."""
    changes: dict[int, list[tuple[int, bool]]] = {}
    for number, box in enumerate(boxes):
        geom = model.geom(_box(number)).id
        if box.since > 0:
            set_collision(model, geom, present=False)
            changes.setdefault(round(box.since / TICK), []).append((geom, True))
        if box.until < np.inf:
            changes.setdefault(round(box.until / TICK), []).append((geom, False))
    return changes


def quaternion(rotation: Array) -> list[float]:
    """Quaternion of a rotation matrix in MuJoCo's order: w, x, y, z."""
    q = pin.Quaternion(rotation)
    return [q.w, q.x, q.y, q.z]


def _box(number: int) -> str:
    return f"box{number}"


def _surface(own: int, other: int, physics: Physics) -> dict[str, Any]:
    return {
        "contype": own,
        "conaffinity": other,
        "friction": [physics.grip, 0.01, 0.001],
        "solref": [physics.contact, 1.0],
    }


def _solid(effector: Effector) -> tuple[Any, list[float], Array, list[float]]:
    """Geometry of an effector: type, size and centre of its geom, and the size of its site."""
    if isinstance(effector, Rod):  # MuJoCo leaves the round ends out of a capsule's length
        half = effector.length / 2
        size = [effector.radius, half - effector.radius, 0.0]
        capsule = mujoco.mjtGeom.mjGEOM_CAPSULE
        return capsule, size, np.array([0, 0, half]), [2.5 * effector.radius] * 3
    if isinstance(effector, Ball):
        ball = [effector.radius, 0.0, 0.0]
        return SPHERE, ball, np.zeros(3), [1.5 * effector.radius] * 3
    half = effector.thickness / 2
    size = [*effector.patch, half]
    around = [*(1.2 * extent for extent in effector.patch), effector.thickness]
    return mujoco.mjtGeom.mjGEOM_BOX, size, np.add(effector.point, (0, 0, half)), around
