"""The camera of a robot's view: as near as it sees every point in the motion, the floor below.

What is framed is what is drawn: the viewer's tree of links, with mimicking joints and what is fixed
to the world.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, product
from pathlib import Path

import numpy as np
import rerun as rr
from rerun.urdf import UrdfJoint, UrdfTree

from inspector.recording import axes, robot
from inspector.recording.unstable import Camera
from noisemodel import meshes
from noisemodel.run import Run
from noisemodel.types import Array, MeshError
from noisemodel.urdf import shapes_in

FIELD_OF_VIEW = np.deg2rad(55.0)
"""Of the viewer's camera, from the lower to the upper edge, in [rad]."""
AZIMUTH, ELEVATION = np.deg2rad(-55.0), np.deg2rad(18.0)
"""From where a robot that looks along x is seen: from its front, right and above, in [rad]."""
MARGIN = 0.08
"""Share of the picture that stays free at each edge."""
SMALLEST = 0.05
"""A robot that is smaller, such as one without any shape, is framed as if it were so large, [m]."""
ON_FLOOR = np.array([1.0, 1.0, 0.0])
"""The camera follows a base along the floor, not up and down."""
VIEW = "_view"
"""Frame of transforms that the camera moves with."""
FLOOR, THICKNESS = (58, 62, 70), 0.006
"""Colour of the lines of a floor, and half of their width by their distance."""
MOST_LINES = 200
"""Lines of a floor in one direction."""
DIRECTIONS = np.array([each for each in product((-1.0, 0.0, 1.0), repeat=3) if any(each)])
"""Along each of these, a mesh is taken by its outermost point; it reaches beyond by a tenth."""


def fitted(parts: Iterable[Array], *, aspect: float = 1.0, room: float = 1.0) -> Camera:
    """Place a camera as near as it sees all points.

    Args:
        parts: Points, each of shape (points, 3), in [m].
    """
    sighted = sight()
    slopes = (1.0 - 2.0 * MARGIN) * np.tan(FIELD_OF_VIEW / 2) * np.array([aspect, 1.0])
    # The edges of the picture are planes through the eye: a point is between the left and the right
    # one if |right - right of eye| <= slope (ahead - ahead of eye). The point that is farthest
    # beyond a plane is the same wherever the eye is, and it alone decides.
    right, up, ahead = sighted
    planes = [
        across + sign * slope * ahead
        for across, slope in zip((right, up), slopes, strict=True)
        for sign in (1, -1)
    ]
    measured = np.stack([*planes, ahead, *np.eye(3)])
    reaches = [part @ measured.T for part in parts]
    least = np.min([reach.min(axis=0) for reach in reaches], axis=0)
    most = np.max([reach.max(axis=0) for reach in reaches], axis=0)
    floor = float(least[-1])
    extent = (most - least)[-3:]
    slack = np.abs(measured) @ np.maximum(SMALLEST - extent, (room - 1.0) * extent) / 2
    least, most = least - slack, most + slack
    nearest = min((least[0] - most[1]) / (2 * slopes[0]), (least[2] - most[3]) / (2 * slopes[1]))
    across, height = (least[0] + most[1]) / 2, (least[2] + most[3]) / 2
    middle = (least[4] + most[4]) / 2
    size = float((most - least)[-3:].max())
    return Camera(
        eye=np.array([across, height, nearest]) @ sighted,
        target=np.array([across, height, middle]) @ sighted,
        floor=floor,
        spacing=float(10.0 ** np.floor(np.log10(size))) / 2,
    )


def sight() -> Array:
    """Directions to the right, upwards and ahead in the picture, one a row, shape (3, 3)."""
    level = np.array([np.cos(AZIMUTH), np.sin(AZIMUTH), np.tan(ELEVATION)])
    ahead = -level / np.linalg.norm(level)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return np.stack((right, np.cross(right, ahead), ahead))


def log_cameras(
    recording: rr.RecordingStream,
    robots: Sequence[tuple[UrdfTree, Run]],
    urdf: Path,
    *,
    aspect: float = 1.0,
) -> list[Camera]:
    """Place the cameras for runs of a robot, and log how they move with a base, over its floor."""
    drawn = outermost(urdf)
    parts: list[Iterator[Array]] = []
    for tree, run in robots:
        shown = robot.shown(run)
        parts.append(reached(tree, drawn, robot.angles(tree, run, shown), _base(run)))
    seen = fitted(chain(*parts), aspect=aspect)
    cameras = []
    for tree, run in robots:
        pose = _base(run)
        moves = pose is not None and len(pose) > 0
        cameras.append(standing(seen, tree, moves=moves))
        if pose is not None and moves:
            follow(recording, tree, run.time[robot.shown(run)], pose)
            log_floor(recording, tree, cameras[-1], pose)
    return cameras


def _base(run: Run) -> Array | None:
    pose = run.base_pose
    return None if pose is None else pose[robot.shown(run)].astype(np.float64)


def reached(
    tree: UrdfTree, drawn: Mapping[str, Array], angles: Mapping[str, Array], pose: Array | None
) -> Iterator[Array]:
    """The points of a robot in a motion, from the place on the floor below its base.

    Args:
        angles: Of joints that move, each of shape (frames,), in [rad] or [m].
        pose: x, y, z and quaternion x, y, z, w of a base that moves, shape (frames, 7).

    Returns:
        For each link, shape (points, 3), in [m].
    """
    if pose is None or not len(pose):
        return points(tree, drawn, angles)
    height = pose[:, :3] * (1.0 - ON_FLOOR)
    return points(tree, drawn, angles, _turns(pose[:, 3:]), height)


def standing(camera: Camera, tree: UrdfTree, *, moves: bool) -> Camera:
    """A camera in the frame of transforms that it stands in."""
    frame = robot.frame(tree, VIEW if moves else tree.root_link().name)
    return replace(camera, frame=frame, moves=moves)


def follow(recording: rr.RecordingStream, tree: UrdfTree, time: Array, pose: Array) -> None:
    """Log the frame that a camera moves with: on the floor below the base, without its turns.

    Args:
        time: Shape (steps,), in [s].
        pose: Of the base, shape (steps, 3 or more), in [m].
    """
    columns = rr.Transform3D.columns(
        translation=pose[:, :3] * ON_FLOOR,
        parent_frame=[robot.frame(tree, robot.WORLD)] * len(pose),
        child_frame=[robot.frame(tree, VIEW)] * len(pose),
    )
    path = f"{robot.origin(tree)}/motion/view"
    recording.send_columns(path, indexes=[axes.at(time)], columns=columns)


def log_floor(recording: rr.RecordingStream, tree: UrdfTree, camera: Camera, pose: Array) -> None:
    """Log the lines of a floor that stays where it is while the camera moves over it.

    Args:
        pose: Where the base will be, shape (steps, 2 or more), in [m].
    """
    reach = 4.0 * float(np.linalg.norm(camera.eye - camera.target))
    low, high = pose[:, :2].min(axis=0) - reach, pose[:, :2].max(axis=0) + reach
    spacing = camera.spacing
    while (high - low).max() > MOST_LINES * spacing:
        spacing *= 2.0
    low, high = np.floor(low / spacing) * spacing, np.ceil(high / spacing) * spacing
    across, along = (
        np.arange(low[i], high[i] + spacing / 2, spacing, dtype=np.float64) for i in (0, 1)
    )
    lines = [[(x, low[1], camera.floor), (x, high[1], camera.floor)] for x in across.tolist()]
    lines += [[(low[0], y, camera.floor), (high[0], y, camera.floor)] for y in along.tolist()]
    path = f"{robot.origin(tree)}/floor"
    recording.log(path, rr.CoordinateFrame(robot.frame(tree, robot.WORLD)), static=True)
    drawn = rr.LineStrips3D(lines, colors=[FLOOR] * len(lines), radii=spacing * THICKNESS)
    recording.log(path, drawn, static=True)


def outermost(urdf: Path) -> dict[str, Array]:
    """The outermost points of the links that are drawn.

    Returns:
        By link, in its axes, shape (points, 3), in [m]. For a mesh that only the viewer can read,
        its origin.
    """
    found: dict[str, list[Array]] = {}
    for shape in shapes_in(urdf, "visual"):
        body = shape.body
        if isinstance(body, str):
            try:
                body = meshes.read(Path(body.removeprefix("file://")))
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
        # One product for all frames: many of three by three would take much longer.
        placed = (turned.reshape(-1, 3) @ own.T).reshape(-1, 3, len(own))
        yield (placed + shifted.reshape(-1, 3, 1)).swapaxes(1, 2).reshape(-1, 3)


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
