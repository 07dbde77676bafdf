"""The robot in a recording: its links as the noise model has them, their motion, and its camera.

The camera is as near as it sees every point in the motion, and the floor below.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, product
from typing import Any

import numpy as np
import rerun as rr

from inspector.colors import Color
from inspector.errors import InspectorError
from inspector.recording import views
from inspector.recording.views import Camera
from noisemodel import GeometryError, urdf
from noisemodel.meshes import FACET, HEADER
from noisemodel.robot import Robot
from noisemodel.run import Run
from noisemodel.surface import link_names, triangles
from noisemodel.types import Array, UnknownJointError
from noisemodel.urdf import Mimic

FRAMES_PER_SECOND, MAX_FRAMES = 50.0, 2000  # of the motion that is drawn, at most; none in a gap
# Frames of transforms beside those of links that move.
WORLD, FIXED, VIEW = "_world", "_fixed", "_view"
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Drawn:
    """A robot whose links were logged; `poses` moves them."""

    robot: Robot
    origin: str  # entity path that all of it lies under
    # Outermost points of what each joint moves, in its axes, in [m]; 0 is fixed to the world.
    outermost: Mapping[int, Array]
    links: Sequence[str]  # what each joint moves, in the same order
    moves: bool  # whether its base does, which the camera follows on the floor
    mimics: Mapping[str, Mimic]

    def frame(self, link: str) -> str:
        """Name of a frame of transforms."""
        return f"{self.origin}/{link}"

    def path(self, link: str) -> str:
        """Entity of a link's mesh."""
        return self.origin + rr.new_entity_path([link])

    def poses(self, count: int, columns: Mapping[str, Array], base: Array | None) -> Array:
        """Place and quaternion of each link, and of the camera's frame if the base moves.

        Args:
            count: Number of samples.
            columns: Positions by joint, each of shape (samples,); others are at 0.
            base: Pose of the base, shape (samples, 7); None where it is not known.

        Returns:
            Poses in the world, shape (samples, frames, 7).
        """
        from scipy.spatial.transform import Rotation

        placed = {0: (Rotation.identity(), np.zeros(3))}
        for index, joint in enumerate(self.robot.joints, start=1):
            rest = self.robot.model.jointPlacements[index]
            turned, place = placed[joint.parent]
            place = place + turned.apply(rest.translation)
            turned = turned * Rotation.from_matrix(rest.rotation)
            axis = (np.eye(3) if joint.turn is None else joint.turn)[joint.axis]
            moved = columns.get(joint.name)
            if (mimic := self.mimics.get(joint.name)) and mimic.joint in columns:
                moved = columns[mimic.joint] * mimic.multiplier + mimic.offset
            if index == 1 and self.moves and base is not None:
                turned, place = Rotation.from_quat(base[:, 3:]), base[:, :3]
            elif moved is not None and joint.kind == "prismatic":
                place = place + turned.apply(moved[:, None] * axis)
            elif moved is not None:
                turned = turned * Rotation.from_rotvec(moved[:, None] * axis)
            placed[index] = turned, place
        found = np.empty((count, len(self.outermost) + self.moves, 7))
        for column, index in enumerate(self.outermost):
            turned, place = placed[index]
            found[:, column, :3], found[:, column, 3:] = place, turned.as_quat()
        if self.moves:
            found[:, -1, :3] = 0.0 if base is None else base[:, :3] * ON_FLOOR
            found[:, -1, 3:] = UPRIGHT
        return found

    def columns(self, poses: Array) -> Any:
        """Rerun's columns of poses, a row for each frame of transforms at each time."""
        frames = [*map(self.frame, self.links), *([self.frame(VIEW)] * self.moves)]
        rows = poses.reshape(-1, 7)
        return rr.Transform3D.columns(
            translation=rows[:, :3],
            quaternion=rows[:, 3:],
            parent_frame=[self.frame(WORLD)] * len(rows),
            child_frame=frames * (len(rows) // len(frames)),
        )


def log_robot(
    recording: rr.RecordingStream,
    name: str,
    joint_names: Sequence[str],
    *,
    side: str = "",
    moves: bool = False,
    color: Color | None = None,
) -> Drawn:
    """Log the links of a robot; `side` tells one of two apart, colours may follow."""
    robot = Robot.load(name, floating_base=moves or None)
    known = [joint.name for joint in robot.joints if joint.nv == 1]
    if lacking := [joint for joint in joint_names if joint not in known]:
        raise UnknownJointError(lacking[0], robot.name, known)
    mimics = robot.mjcf.mimics if robot.mjcf else urdf.mimics(robot.path, urdf.checked(robot.path))
    try:
        surfaces = triangles(robot, "auto", world=True)
    except GeometryError as error:
        raise InspectorError(f"{error}; `--robot none` shows the run without the robot") from error
    carried = [1 if robot.floating_base else 0]  # where the base floats, not the rest of the world
    for index, joint in enumerate(robot.joints, start=1):
        if joint.parent in carried and joint.kind != "floating":
            carried.append(index)
    meshes = {index: surfaces[index] for index in carried if len(surfaces[index])}
    outermost = {}
    for index, mesh in meshes.items():
        corners = mesh.reshape(-1, 3)
        outermost[index] = corners[np.unique((corners @ DIRECTIONS.T).argmax(axis=0))]
    outermost = outermost or dict.fromkeys(carried, np.zeros((1, 3)))
    names = (FIXED, *link_names(robot))
    links = [names[joint] for joint in outermost]
    drawn = Drawn(robot, f"robot_{side}" if side else "robot", outermost, links, moves, mimics)
    recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for link, mesh in zip(drawn.links, meshes.values(), strict=False):
        shape = rr.Asset3D(contents=_stl(mesh), media_type=rr.MediaType.STL, albedo_factor=color)
        recording.log(drawn.path(link), shape, rr.CoordinateFrame(drawn.frame(link)), static=True)
    return drawn


def _stl(triangles: Array) -> bytes:
    """Triangles, shape (triangles, 3 corners, 3), as a binary STL file."""
    facets = np.zeros(len(triangles), FACET)
    facets["corners"] = triangles
    edges = np.diff(triangles, axis=1)
    across = np.cross(edges[:, 0], edges[:, 1])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    facets["normal"] = across / np.where(length > 0.0, length, 1.0)
    return bytes(HEADER - 4) + len(facets).to_bytes(4, "little") + facets.tobytes()


def log_robots(
    recording: rr.RecordingStream, runs: Mapping[str, Run], *, aspect: float
) -> list[tuple[Drawn, Camera]]:
    """Log the robot of each side's run, its motion and the floor; colours have to follow.

    All are of one robot, and seen from where the camera sees both.
    """
    found, seen = list[tuple[Drawn, Array | None]](), list[Iterator[Array]]()
    for side, run in runs.items():
        assert run.robot is not None
        assert run.position is not None
        step = max(1, round(run.rate / FRAMES_PER_SECOND), -(-len(run.time) // MAX_FRAMES))
        frames = np.arange(0, len(run.time), step)
        frames = frames[run.mask[frames]]
        names = (*run.joint_names, *run.desired_joint_names)
        moves = run.base_pose is not None
        drawn = log_robot(recording, run.robot, names, side=side, moves=moves)
        columns = dict(zip(run.joint_names, run.position[frames].T, strict=True))
        base = None if run.base_pose is None else run.base_pose[frames].astype(np.float64)
        poses = drawn.poses(len(frames), columns, base)
        index = [views.at(run.time[frames].repeat(poses.shape[1]))]
        recording.send_columns(f"/{drawn.origin}/motion", index, drawn.columns(poses))
        if not len(frames):  # all of it is a gap: the robot at rest
            base, poses = None, drawn.poses(1, {}, None)
        found.append((drawn, base))
        seen.append(reached(drawn, poses))
    camera = fitted(chain(*seen), aspect=aspect)
    for drawn, base in found:
        if base is not None:
            log_floor(recording, drawn, camera, base)
    return [(drawn, standing(camera, drawn)) for drawn, _ in found]


# Of the viewer's camera, from the lower to the upper edge, in [rad].
FIELD_OF_VIEW = np.deg2rad(55.0)
# From where a robot that looks along x is seen: from its front, right and above, in [rad].
AZIMUTH, ELEVATION = np.deg2rad(-55.0), np.deg2rad(18.0)
MARGIN = 0.08  # share of the picture that stays free at each edge
# A robot that is smaller, such as one without any shape, is framed as if it were so large, [m].
SMALLEST = 0.05
ON_FLOOR = np.array([1.0, 1.0, 0.0])  # the camera follows a base along the floor, not up and down
# Colour of the lines of a floor, and half of their width by their distance.
FLOOR, THICKNESS = (58, 62, 70), 0.006
MOST_LINES = 200  # lines of a floor in one direction
# Along each of these, a mesh is taken by its outermost point; it reaches beyond by a tenth.
DIRECTIONS = np.array([each for each in product((-1.0, 0.0, 1.0), repeat=3) if any(each)])


def fitted(parts: Iterable[Array], *, aspect: float = 1.0, room: float = 1.0) -> Camera:
    """Place a camera as near as it sees all points, parts of shape (points, 3), in [m]."""
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
    eye, target = (np.array([across, height, depth]) @ sighted for depth in (nearest, middle))
    return Camera(eye, target, floor, spacing=float(10.0 ** np.floor(np.log10(size))) / 2)


def sight() -> Array:
    """Directions to the right, upwards and ahead in the picture, one a row, shape (3, 3)."""
    level = np.array([np.cos(AZIMUTH), np.sin(AZIMUTH), np.tan(ELEVATION)])
    ahead = -level / np.linalg.norm(level)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return np.stack((right, np.cross(right, ahead), ahead))


def standing(camera: Camera, drawn: Drawn) -> Camera:
    """A camera in the frame of transforms that it stands in."""
    own = drawn.frame(VIEW if drawn.moves else WORLD)
    return replace(camera, frame=own, moves=drawn.moves)


def log_floor(recording: rr.RecordingStream, drawn: Drawn, camera: Camera, pose: Array) -> None:
    """Log a floor below all poses of a base, which stays where it is while the camera moves."""
    reach = 4.0 * float(np.linalg.norm(camera.eye - camera.target))
    low, high = pose[:, :2].min(axis=0) - reach, pose[:, :2].max(axis=0) + reach
    spacing = camera.spacing
    while (high - low).max() > MOST_LINES * spacing:
        spacing *= 2.0
    low, high = np.floor(low / spacing) * spacing, np.ceil(high / spacing) * spacing
    ends = zip(low.tolist(), high.tolist(), strict=True)
    across, along = (np.arange(first, last + spacing / 2, spacing) for first, last in ends)
    lines = [[(x, low[1], camera.floor), (x, high[1], camera.floor)] for x in across.tolist()]
    lines += [[(low[0], y, camera.floor), (high[0], y, camera.floor)] for y in along.tolist()]
    path = f"/{drawn.origin}/floor"
    recording.log(path, rr.CoordinateFrame(drawn.frame(WORLD)), static=True)
    strips = rr.LineStrips3D(lines, colors=[FLOOR] * len(lines), radii=spacing * THICKNESS)
    recording.log(path, strips, static=True)


def reached(drawn: Drawn, poses: Array) -> Iterator[Array]:
    """Points of each link in all frames, from the place on the floor below the base, in [m]."""
    from scipy.spatial.transform import Rotation

    below = poses[:, -1, :3] if drawn.moves else np.zeros(3)
    for place, own in enumerate(drawn.outermost.values()):
        turned = Rotation.from_quat(poses[:, place, 3:]).as_matrix()
        # One product for all frames: many of three by three would take much longer.
        points = (turned.reshape(-1, 3) @ own.T).reshape(-1, 3, len(own))
        shifted = (poses[:, place, :3] - below)[..., None]
        yield (points + shifted).swapaxes(1, 2).reshape(-1, 3)
