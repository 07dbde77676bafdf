"""The robot in a live recording, with the level of each link's vibration."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.urdf import UrdfJoint

import noisemodel as nm
from inspector.levels import LINKS
from inspector.recording import axes, framing
from inspector.recording import robot as scene
from inspector.recording.camera import Camera, fitted
from noisemodel.extended import FAST, by_moments, second_moments, vibrating
from noisemodel.noise import REFERENCE_POWER, decibel
from noisemodel.robot import Limits, joint_limits
from noisemodel.types import Array

STEP = 0.2
"""Time over which a level is taken, in [s]."""


class Step(NamedTuple):
    """Levels of all links."""

    time: float
    """Start of the step, in [s]."""
    level: Array
    """Shape (links,), in [dB re 1 pW]; silence is at -inf."""


class LinkLevels:
    """Levels above 10 Hz of a robot's links, every 0.2 s, half a period of 10 Hz late.

    Args:
        rate: Samples per second, in [Hz].

    Attributes:
        links: Names of the links.
    """

    def __init__(
        self, robot: str, joint_names: Sequence[str], rate: float, *, floating: bool
    ) -> None:
        self._robot = nm.Robot.load(robot, floating_base=True if floating else None)
        self._surface = nm.Surface.of(self._robot, "auto")
        self.links = self._surface.names
        by_name = {joint.name: joint for joint in self._robot.joints if joint.nv == 1}
        self._joints = [by_name[name] for name in joint_names]
        self._columns = [joint.first_v for joint in self._joints]
        self._size, self._half = max(1, round(STEP * rate)), max(1, round(rate / FAST / 2))
        self._rate = rate
        self.skip()

    def skip(self) -> None:
        """Begin anew after a gap."""
        self._velocity = np.empty((0, self._robot.nv))
        self._time, self._position = np.empty(0), np.empty((0, len(self._joints)))
        self._before = 0  # samples before the step that comes next

    def push(self, time: Array, signals: Mapping[str, Array]) -> list[Step]:
        """Take samples that follow each other.

        Args:
            time: Shape (samples,), in [s].
            signals: Velocities and positions, shape (samples, joints), and a base's velocity, shape
                (samples, 6), if there is one. A sample that is not finite begins anew.
        """
        velocity = np.zeros((len(time), self._robot.nv))
        velocity[:, self._columns] = signals["velocity"]
        if self._robot.floating_base and "base_velocity" in signals:
            velocity[:, :6] = signals["base_velocity"]
        position = signals["position"]
        known = np.isfinite(velocity).all(axis=1) & np.isfinite(position).all(axis=1)
        if not known.all():
            last = int(np.flatnonzero(~known)[-1]) + 1
            self.skip()
            time, velocity, position = time[last:], velocity[last:], position[last:]
        self._time = np.concatenate((self._time, time))
        self._velocity = np.concatenate((self._velocity, velocity))
        self._position = np.concatenate((self._position, position))
        steps = []
        while len(self._time) >= self._before + self._size + self._half:
            steps.append(self._step())
        return steps

    def _step(self) -> Step:
        first, stop = self._before, self._before + self._size
        window = self._velocity[: stop + self._half]
        fast = vibrating(window, np.ones(len(window), dtype=bool), self._rate)[first:stop]
        moments = second_moments(fast, np.ones(self._size, dtype=bool), size=self._size)
        pose = self._pose(self._position[(first + stop) // 2])
        (power,) = by_moments(self._robot, self._surface, pose, [("normal", moments)])
        found = Step(float(self._time[first]), decibel(power[0] / REFERENCE_POWER))
        used = max(stop - self._half, 0)
        self._before = stop - used
        self._time, self._velocity = self._time[used:], self._velocity[used:]
        self._position = self._position[used:]
        return found

    def _pose(self, position: Array) -> Array:
        pose = self._robot.neutral[None].copy()
        for joint, angle in zip(self._joints, position.tolist(), strict=True):
            if joint.kind == "continuous":
                pose[0, joint.first_q : joint.first_q + 2] = np.cos(angle), np.sin(angle)
            else:
                pose[0, joint.first_q] = angle
        return pose


SLIDING = "prismatic"
SHADES = 16
KEY = axes.Panel("key", 360.0)
"""The scale beside the robot."""
ROOM = 1.3
"""What the camera sees of a robot that moves its base, by its size as it stands at first."""
POSES = 200
"""Random poses within the limits of the joints, of which the camera sees all."""
AROUND = np.array([[-20.0, -20.0], [20.0, 20.0]])
"""How far the floor reaches from the first pose, in [m]."""
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])


class LiveRobot:
    """A robot in a live recording.

    Attributes:
        children: Links that move, in the order of `transforms`; the base, if it moves, and the
            frame of the camera are last.
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        robot: str,
        joint_names: Sequence[str],
        *,
        floating: bool,
        at_once: int = 1,
    ) -> None:
        with TemporaryDirectory() as folder:
            tree = scene.load(robot, Path(folder), joint_names)
            self._outermost = framing.outermost(scene.drawn_file(robot, Path(folder)))
            scene.log_shapes(recording, tree, coloured=True)
            self._kinds = scene.shapes(tree)
        self._tree = tree
        self._shades: dict[str, bytes] = {}
        self._painted: dict[str, list[tuple[float, NDArray[np.uint8]]]] = {}
        self._paths = {
            link: [path for each in members for path in tree.get_visual_geometry_paths(each)]
            for link, members in scene.moving_links(tree).items()
        }
        movable = {joint.name: joint for joint in tree.joints() if joint.joint_type != "fixed"}
        leaders = {
            name: joint.mimic.joint if joint.mimic else name for name, joint in movable.items()
        }
        joints = [joint for name, joint in movable.items() if leaders[name] in joint_names]
        self._columns = [joint_names.index(leaders[joint.name]) for joint in joints]
        self._factor = np.array(
            [joint.mimic.multiplier if joint.mimic else 1.0 for joint in joints]
        )
        self._offset = np.array([joint.mimic.offset if joint.mimic else 0.0 for joint in joints])
        slides = np.array([joint.joint_type == SLIDING for joint in joints], dtype=bool)[:, None]
        axis = np.array([joint.axis for joint in joints]).reshape(-1, 3)
        self._place = np.array([joint.origin_xyz for joint in joints]).reshape(-1, 3)
        self._turn = np.array([_quaternion(joint) for joint in joints]).reshape(-1, 4)
        self._slide = np.where(slides, _rotated(self._turn, axis), 0.0)
        self._spin = np.where(slides, 0.0, _times(self._turn, np.pad(axis, ((0, 0), (0, 1)))))
        self._half = np.where(slides, 0.0, 0.5)
        moved = (str(tree.root_link().name), framing.VIEW) if floating else ()
        base = [(scene.WORLD, child) for child in moved]
        links = [*((joint.parent_link, joint.child_link) for joint in joints), *base]
        self.children = [child for _, child in links]
        self._carriers = [parent for parent, _ in links]
        self._at_once = at_once
        self._waiting: list[tuple[float, Array, Array]] = []
        self._names = [joint.name for joint in joints]
        self._recording = recording
        axes.log_scale(recording, KEY, LINKS, "dB re\n1 pW")
        limits = joint_limits(robot)
        ranges = [_range(limits.get(name, Limits())) for name in joint_names]
        self._low, self._high = np.array(ranges).T

    def camera(self, position: Array, base_pose: Array | None) -> Camera:
        """Place the camera, before it is known what will come.

        A robot on a base is seen wherever its joints can take it; one that moves its base as it
        stands at first, with room to move.

        Args:
            position: Of the named joints, shape (joints,), in [rad] or [m].
            base_pose: x, y, z and quaternion x, y, z, w of a floating base, shape (7,).
        """
        first = np.nan_to_num(position)[None]
        pose = None if base_pose is None else _known(base_pose)[None]
        seen = fitted(self._reached(first, pose), room=ROOM if pose is not None else 1.0)
        if pose is not None:
            seen = framing.standing(seen, self._tree, moves=True)
            framing.log_floor(self._recording, self._tree, seen, pose[:, :2] + AROUND)
            return seen
        random = np.random.default_rng(0)
        everywhere = random.uniform(self._low, self._high, (POSES, len(position)))
        floor = seen.floor
        seen = fitted(self._reached(np.concatenate((first, everywhere)), None))
        return framing.standing(replace(seen, floor=floor), self._tree, moves=False)

    def _reached(self, position: Array, pose: Array | None) -> Iterator[Array]:
        angle = self._factor * position[:, self._columns] + self._offset
        angles = dict(zip(self._names, angle.T, strict=True))
        return framing.reached(self._tree, self._outermost, angles, pose)

    def colour(self, time: float, links: Sequence[str], level: Array) -> None:
        """Colour the links, those whose colour changes.

        Args:
            time: From when on, in [s].
            level: Shape (links,), in [dB re 1 pW].
        """
        levels = dict(zip(links, level.tolist(), strict=True))
        each = np.array([levels.get(link, -np.inf) for link in self._paths])
        for link, own in zip(self._paths, LINKS.colours(each, shades=SHADES), strict=True):
            if self._shades.get(link) != own.tobytes():
                self._shades[link] = own.tobytes()
                self._painted.setdefault(link, []).append((time, own))
        if self._at_once == 1:
            self._paint()

    def _paint(self) -> None:
        """Draw the colours that wait."""
        for link, changes in self._painted.items():
            index = [axes.at(np.array([time for time, _ in changes]))]
            shades = np.stack([own for _, own in changes])
            for path in self._paths[link]:
                kind = self._kinds[path]
                columns = getattr(rr, kind).columns(**{scene.COLOURED[kind]: shades})
                self._recording.send_columns(path, indexes=index, columns=columns)
        self._painted = {}

    def show(self, time: float, position: Array, base_pose: Array | None) -> None:
        """Move the robot, once there are as many poses as a message has.

        Args:
            time: In [s].
            position: Of the named joints, shape (joints,), in [rad] or [m].
            base_pose: x, y, z and quaternion x, y, z, w of a floating base, shape (7,).
        """
        places, turns = self.transforms(position)
        if base_pose is not None:
            below = base_pose[:3] * framing.ON_FLOOR
            places = np.vstack((places, base_pose[:3], below))
            turns = np.vstack((turns, base_pose[3:], UPRIGHT))
        if not len(places):
            return
        self._waiting.append((time, places, turns))
        if len(self._waiting) >= self._at_once:
            self.flush()

    def flush(self) -> None:
        """Draw the poses and colours that wait."""
        self._paint()
        if not self._waiting:
            return
        times, places, turns = (list(each) for each in zip(*self._waiting, strict=True))
        self._waiting = []
        count = len(times)
        self._recording.send_columns(
            "/robot/motion",
            indexes=[axes.at(np.repeat(times, len(self.children)))],
            columns=rr.Transform3D.columns(
                translation=np.concatenate(places),
                quaternion=np.concatenate(turns),
                parent_frame=count * self._carriers,
                child_frame=count * self.children,
            ),
        )

    def transforms(self, position: Array) -> tuple[Array, Array]:
        """The pose of each joint's link relative to the link that carries it.

        Args:
            position: Of the named joints, shape (joints,), in [rad] or [m].

        Returns:
            Translations, shape (moving, 3), and quaternions x, y, z, w, shape (moving, 4), of all
            joints that move: the named ones, and those that mimic one of them.
        """
        angle = (self._factor * position[self._columns] + self._offset)[:, None]
        half = self._half * angle
        # turn (axis sin half, cos half), with what does not change multiplied once
        turned = np.sin(half) * self._spin + np.cos(half) * self._turn
        return self._place + angle * self._slide, turned


def _range(limits: Limits) -> tuple[float, float]:
    """Where a joint may be, in [rad] or [m]: a turn at most; one that slides without end rests."""
    if limits.turns:
        return max(limits.lower, -np.pi), min(limits.upper, np.pi)
    return (limits.lower, limits.upper) if limits.upper - limits.lower < np.inf else (0.0, 0.0)


def _known(pose: Array) -> Array:
    """A pose, or that of a base in the origin where it is not known."""
    return pose if np.isfinite(pose).all() else np.concatenate((np.zeros(3), UPRIGHT))


def _quaternion(joint: UrdfJoint) -> Array:
    """Turn the roll, pitch and yaw of a joint's origin into a quaternion."""
    turn = np.array([0.0, 0.0, 0.0, 1.0])
    for axis, angle in reversed(list(zip(np.eye(3), joint.origin_rpy, strict=True))):
        spin = np.append(np.sin(angle / 2.0) * axis, np.cos(angle / 2.0))
        turn = _times(turn, spin)
    return turn


def _times(left: Array, right: Array) -> Array:
    """Multiply quaternions x, y, z, w, shape (..., 4)."""
    u, v, a, b = left[..., :3], right[..., :3], left[..., 3:], right[..., 3:]
    scalar = a * b - (u * v).sum(axis=-1, keepdims=True)
    return np.concatenate((a * v + b * u + np.cross(u, v), scalar), axis=-1)


def _rotated(turn: Array, vector: Array) -> Array:
    """Rotate vectors by quaternions."""
    u, w = turn[..., :3], turn[..., 3:]
    rotated: Array = vector + 2.0 * np.cross(u, np.cross(u, vector) + w * vector)
    return rotated
