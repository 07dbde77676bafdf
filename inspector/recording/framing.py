"""The robot in view at all times: its outermost points, and what the camera follows.

What is framed is what is drawn: the viewer's tree of links, with mimicking joints and what is fixed
to the world.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, product
from pathlib import Path

import numpy as np
import rerun as rr
from rerun.urdf import UrdfJoint, UrdfTree

from inspector.recording import robot, series
from inspector.recording.camera import Camera, fitted
from noisemodel import linkshapes, meshfile
from noisemodel.errors import MeshError
from noisemodel.run import Run
from noisemodel.types import Array

ON_FLOOR = np.array([1.0, 1.0, 0.0])
"""The camera follows a base along the floor, not up and down."""
DIRECTIONS = np.array([each for each in product((-1.0, 0.0, 1.0), repeat=3) if any(each)])
"""Along each of these, a mesh is taken by its outermost point; it reaches beyond by a tenth."""


def log(
    recording: rr.RecordingStream,
    robots: Sequence[tuple[UrdfTree, Run]],
    urdf: Path,
    *,
    aspect: float = 1.0,
) -> list[Camera]:
    """Place the cameras for runs of a robot, and log the paths that they follow if a base moves.

    Args:
        recording: Where to.
        robots: The robot in each run, and the run, which has positions.
        urdf: The file that the trees were read from.
        aspect: Least width of a view by its height.

    Returns:
        A camera for each, all as far away.
    """
    drawn = outermost(urdf)
    parts: list[Iterator[Array]] = []
    for tree, run in robots:
        shown = robot.shown(run)
        parts.append(reached(tree, drawn, robot.angles(tree, run, shown), _base(run)))
    seen = fitted(chain(*parts), aspect=aspect)
    cameras = []
    for tree, run in robots:
        pose = _base(run)
        cameras.append(standing(seen, tree, pose))
        if pose is not None and len(pose):
            begin_to_follow(recording, cameras[-1])
            follow(recording, cameras[-1], run.time[robot.shown(run)], pose, pose[0])
    return cameras


def _base(run: Run) -> Array | None:
    pose = run.base_pose
    return None if pose is None else pose[robot.shown(run)].astype(np.float64)


def reached(
    tree: UrdfTree, drawn: Mapping[str, Array], angles: Mapping[str, Array], pose: Array | None
) -> Iterator[Array]:
    """The points of a robot in a motion, from the place on the floor below its base.

    Args:
        tree: The robot.
        drawn: Points of its links, see `outermost`.
        angles: Of joints that move, each of shape (frames,), in [rad] or [m].
        pose: x, y, z and quaternion x, y, z, w of a base that moves, shape (frames, 7).

    Returns:
        For each link, shape (points, 3), in [m].
    """
    if pose is None or not len(pose):
        return points(tree, drawn, angles)
    height = pose[:, :3] * (1.0 - ON_FLOOR)
    return points(tree, drawn, angles, _turns(pose[:, 3:]), height)


def standing(camera: Camera, tree: UrdfTree, pose: Array | None) -> Camera:
    """A camera that was placed for a base above the origin, where a motion starts.

    Args:
        camera: The camera.
        tree: The robot.
        pose: Of a base that moves, shape (frames, 7).
    """
    seen = replace(camera, frame=robot.root(tree, floating=pose is not None))
    if pose is None or not len(pose):
        return seen
    first = pose[0, :3] * ON_FLOOR
    path = f"{robot.origin(tree)}/centre"
    return replace(seen, eye=seen.eye + first, target=seen.target + first, follows=path)


def begin_to_follow(recording: rr.RecordingStream, camera: Camera) -> None:
    """Log in which frame lies what a camera follows, and that it is not to be seen."""
    recording.log(camera.follows, rr.CoordinateFrame(camera.frame), static=True)
    unseen = rr.Points3D.from_fields(radii=1e-4, colors=(0, 0, 0, 0))
    recording.log(camera.follows, unseen, static=True)


def follow(
    recording: rr.RecordingStream, camera: Camera, time: Array, pose: Array, first: Array
) -> None:
    """Log the point that a camera follows, which nobody sees.

    Args:
        recording: Where to.
        camera: As it stands at first.
        time: Shape (steps,), in [s].
        pose: Of the base, shape (steps, 3 or more), in [m].
        first: That for which the camera was placed, shape (3 or more,), in [m].
    """
    place = camera.target + (pose[:, :3] - first[:3]) * ON_FLOOR
    columns = rr.Points3D.columns(positions=place)
    recording.send_columns(camera.follows, indexes=[series.at(time)], columns=columns)


def outermost(urdf: Path) -> dict[str, Array]:
    """The outermost points of the links that are drawn.

    Args:
        urdf: What is drawn, with the absolute addresses of its meshes.

    Returns:
        By link, in its axes, shape (points, 3), in [m]. Of a mesh that only the viewer can read,
        its origin.
    """
    found: dict[str, list[Array]] = {}
    for shape in linkshapes.read(urdf, "visual"):
        body = shape.body
        if isinstance(body, str):
            try:
                body = meshfile.read(Path(body.removeprefix("file://")))
            except MeshError:
                body = np.zeros((1, 3))
        corners = body.reshape(-1, 3)
        chosen = corners[np.unique((corners @ DIRECTIONS.T).argmax(axis=0))]
        found.setdefault(shape.link, []).append(chosen @ shape.matrix.T + shape.translation)
    return {link: np.concatenate(parts) for link, parts in found.items()}


def points(
    tree: UrdfTree,
    drawn: Mapping[str, Array],
    angles: Mapping[str, Array],
    turn: Array | None = None,
    shift: Array | None = None,
) -> Iterator[Array]:
    """Where the points of each link are in all frames.

    Args:
        tree: The robot.
        drawn: Points of its links, see `outermost`; without any, the links' origins are taken.
        angles: Of joints that move, each of shape (frames,), in [rad] or [m].
        turn: Rotation of the root, shape (frames, 3, 3); none unless given.
        shift: Its place, shape (frames, 3), in [m]; the origin unless given.

    Yields:
        Shape (points, 3), in [m], for each link.
    """
    at_root = np.eye(3) if turn is None else turn, np.zeros(3) if shift is None else shift
    poses = {tree.root_link().name: at_root}
    for joint in robot.outwards(tree):
        turned, shifted = poses[joint.parent_link]
        own_turn, own_shift = _pose(joint, angles.get(joint.name, np.zeros(())))
        place = (turned @ own_shift[..., None])[..., 0] + shifted
        poses[joint.child_link] = turned @ own_turn, place
    drawn = drawn or dict.fromkeys(poses, np.zeros((1, 3)))
    for link, own in drawn.items():
        turned, shifted = poses[link]
        yield (own @ np.swapaxes(turned, -1, -2) + shifted[..., None, :]).reshape(-1, 3)


def _pose(joint: UrdfJoint, angle: Array) -> tuple[Array, Array]:
    """Pose of a joint's child in the axes of its parent, for each angle in [rad] or [m]."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(joint.origin_rpy), np.sin(joint.origin_rpy)
    origin = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    place, axis = np.array(joint.origin_xyz), np.array(joint.axis)
    if joint.joint_type == "fixed":
        return origin, place
    axis = axis / np.linalg.norm(axis)
    if joint.joint_type == "prismatic":
        return origin, place + angle[..., None] * (origin @ axis)
    across = _across(axis)
    sine, versine = np.sin(angle)[..., None, None], 1.0 - np.cos(angle)[..., None, None]
    return origin @ (np.eye(3) + sine * across + versine * across @ across), place  # Rodrigues


def _turns(quaternion: Array) -> Array:
    """Rotation matrices of quaternions x, y, z, w, shape (frames, 3, 3)."""
    unit = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    across = _across(unit[:, :3])
    return np.asarray(np.eye(3) + 2.0 * (unit[:, 3, None, None] * across + across @ across))


def _across(vector: Array) -> Array:
    """The matrix that crosses this vector with another, shape (..., 3, 3)."""
    x, y, z = np.moveaxis(vector, -1, 0)
    nothing = np.zeros_like(x)
    rows = ((nothing, -z, y), (z, nothing, -x), (-y, x, nothing))
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
