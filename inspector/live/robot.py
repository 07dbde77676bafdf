"""The robot in a live recording, with the level of each link's vibration."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

import noisemodel as nm
from inspector.levels import LINKS
from inspector.recording import axes
from inspector.recording import camera as cameras
from inspector.recording import robot as scene
from inspector.recording.camera import fitted
from inspector.recording.unstable import Camera
from noisemodel.noise import FAST, REFERENCE_POWER, by_moments, decibel, second_moments, vibrating
from noisemodel.robot import Limits, joint_limits
from noisemodel.types import Array

STEP = 0.2
"""Time over which a level is taken, in [s]."""


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
        self._names, self._rate = tuple(joint_names), rate
        self._size, self._half = max(1, round(STEP * rate)), max(1, round(rate / FAST / 2))
        self.skip()

    def skip(self) -> None:
        """Begin anew after a gap."""
        self._held: dict[str, Array] = {}
        self._before = 0  # samples before the step that comes next

    def push(self, time: Array, signals: Mapping[str, Array]) -> list[tuple[float, Array]]:
        """Take samples that follow each other.

        Args:
            time: Shape (samples,), in [s].
            signals: Velocities and positions, shape (samples, joints), and a base's velocity, shape
                (samples, 6), if there is one. A sample that is not finite begins anew.

        Returns:
            Start of each step that is complete now, in [s], and the levels of all links, shape
            (links,), in [dB re 1 pW]; silence is at -inf.
        """
        floats = self._robot.floating_base and "base_velocity" in signals
        names = ["velocity", "position", *(["base_velocity"] if floats else [])]
        known = np.all([np.isfinite(signals[name]).all(axis=1) for name in names], axis=0)
        first = 0
        if not known.all():
            self.skip()
            first = int(np.flatnonzero(~known)[-1]) + 1
        new = {"time": time[first:], **{name: signals[name][first:] for name in names}}
        if self._held:
            new = {name: np.concatenate((self._held[name], new[name])) for name in new}
        self._held = new
        steps = []
        while len(self._held["time"]) >= self._before + self._size + self._half:
            steps.append(self._step())
        return steps

    def _step(self) -> tuple[float, Array]:
        first, stop = self._before, self._before + self._size
        window: dict[str, Any] = {
            name: values[: stop + self._half] for name, values in self._held.items()
        }
        start = float(window["time"][first])
        window["time"] = np.arange(len(window["time"])) / self._rate
        run = nm.Run(joint_names=self._names, **window)
        position, velocity = self._robot.configuration(run)
        fast = vibrating(velocity, run.mask, self._rate)[first:stop]
        moments = second_moments(fast, run.mask[first:stop], size=self._size)
        pose = position[(first + stop) // 2][None]
        (power,) = by_moments(self._robot, self._surface, pose, [("normal", moments)])
        used = max(stop - self._half, 0)
        self._before = stop - used
        self._held = {name: values[used:] for name, values in self._held.items()}
        return start, decibel(power[0] / REFERENCE_POWER)


SHADES = 16
KEY = axes.Panel("key", 360.0)
"""The scale beside the robot."""
ROOM = 1.3
"""What the camera sees of a robot that moves its base, by its size as it stands at first."""
MOST_POSES = 400
"""Poses in a message to a file without a viewer, at most: 20 s."""
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
        from scipy.spatial.transform import Rotation

        self._rotation = Rotation
        with TemporaryDirectory() as folder:
            tree = scene.load(robot, Path(folder), joint_names)
            self._outermost = cameras.outermost(scene.drawn_file(robot, Path(folder)))
            scene.log_shapes(recording, tree)
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
        mimics = [joint.mimic for joint in joints]
        self._columns = [joint_names.index(leaders[joint.name]) for joint in joints]
        self._factor = np.array([mimic.multiplier if mimic else 1.0 for mimic in mimics])
        self._offset = np.array([mimic.offset if mimic else 0.0 for mimic in mimics])
        slides = np.array([joint.joint_type == "prismatic" for joint in joints])[:, None]
        axis = np.array([joint.axis for joint in joints])
        self._slide, self._spin = np.where(slides, axis, 0.0), np.where(slides, 0.0, axis)
        self._place = np.array([joint.origin_xyz for joint in joints])
        self._turn = Rotation.from_euler("xyz", [joint.origin_rpy for joint in joints])
        base = [str(tree.root_link().name), cameras.VIEW] if floating else []
        self.children = [joint.child_link for joint in joints] + base
        self._carriers = [joint.parent_link for joint in joints] + len(base) * [scene.WORLD]
        self._at_once, self._shown = at_once, 0
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
            seen = cameras.standing(seen, self._tree, moves=True)
            cameras.log_floor(self._recording, self._tree, seen, pose[:, :2] + AROUND)
            return seen
        random = np.random.default_rng(0)
        everywhere = random.uniform(self._low, self._high, (POSES, len(position)))
        floor = seen.floor
        seen = fitted(self._reached(np.concatenate((first, everywhere)), None))
        return cameras.standing(replace(seen, floor=floor), self._tree, moves=False)

    def _reached(self, position: Array, pose: Array | None) -> Iterator[Array]:
        angle = self._factor * position[:, self._columns] + self._offset
        angles = dict(zip(self._names, angle.T, strict=True))
        return cameras.reached(self._tree, self._outermost, angles, pose)

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
        """Move the robot, once there are as many poses as a message has; not where one is unknown.

        Args:
            time: In [s].
            position: Of the named joints, shape (joints,), in [rad] or [m].
            base_pose: x, y, z and quaternion x, y, z, w of a floating base, shape (7,).
        """
        if not all(np.isfinite(each).all() for each in (position, base_pose) if each is not None):
            return
        places, turns = self.transforms(position)
        if base_pose is not None:
            below = base_pose[:3] * cameras.ON_FLOOR
            places = np.vstack((places, base_pose[:3], below))
            turns = np.vstack((turns, base_pose[3:], UPRIGHT))
        self._waiting.append((time, places, turns))
        if len(self._waiting) >= self._at_once:
            self._shown += len(self._waiting)
            if self._at_once > 1:  # fewer messages in long files, as of the lines
                self._at_once = min(max(self._shown // 20, self._at_once), MOST_POSES)
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
        turned = self._turn * self._rotation.from_rotvec(angle * self._spin)
        return self._place + self._turn.apply(angle * self._slide), turned.as_quat()


def _range(limits: Limits) -> tuple[float, float]:
    """Where a joint may be, in [rad] or [m]: a turn at most; one that slides without end rests."""
    if limits.turns:
        return max(limits.lower, -np.pi), min(limits.upper, np.pi)
    return (limits.lower, limits.upper) if limits.upper - limits.lower < np.inf else (0.0, 0.0)


def _known(pose: Array) -> Array:
    """A pose; of a base in the origin where it is not known."""
    return pose if np.isfinite(pose).all() else np.concatenate((np.zeros(3), UPRIGHT))
