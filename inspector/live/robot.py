"""The robot in a live recording: one message for all of its joints."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import rerun as rr
from rerun.urdf import UrdfJoint

from inspector.recording import framing, series
from inspector.recording import robot as scene
from inspector.recording.camera import Camera, fitted
from noisemodel.types import Array

SLIDING = "prismatic"
ROOM = 1.3
"""What the camera sees, by the size of the robot as it stands at first."""


class LiveRobot:
    """A robot in a live recording.

    Args:
        recording: Where to.
        robot: A robot's name, or the path of a URDF or an MJCF.
        joint_names: The joints that have positions.
        floating: Whether the base moves.
        at_once: Poses that a message has.

    Attributes:
        children: Links that move, in the order of `transforms`; the base, if it moves, is last.

    Raises:
        RobotError: If there is no such robot, or it cannot be read.
        MeshError: If one of its meshes cannot be read.
        UnknownJointError: If the robot lacks a joint.
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
            scene.log_shapes(recording, tree, coloured=False)
        self._tree = tree
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
        base = [(scene.WORLD, str(tree.root_link().name))] if floating else []
        links = [*((joint.parent_link, joint.child_link) for joint in joints), *base]
        self.children = [child for _, child in links]
        self._carriers = [parent for parent, _ in links]
        self._at_once = at_once
        self._waiting: list[tuple[float, Array, Array]] = []
        self._names = [joint.name for joint in joints]
        self._recording = recording
        self._followed: tuple[Camera, Array] | None = None

    def camera(self, position: Array, base_pose: Array | None) -> Camera:
        """Place the camera by the first pose, with room to move: what will come is not known.

        Args:
            position: Of the named joints, shape (joints,), in [rad] or [m].
            base_pose: x, y, z and quaternion x, y, z, w of a floating base, shape (7,).
        """
        angle = self._factor * np.nan_to_num(position)[self._columns] + self._offset
        angles = dict(zip(self._names, angle[:, None], strict=True))
        pose = None if base_pose is None else _known(base_pose)[None]
        reached = framing.reached(self._tree, self._outermost, angles, pose)
        seen = framing.standing(fitted(reached, room=ROOM), self._tree, pose)
        if base_pose is not None:
            self._followed = seen, _known(base_pose)
            framing.begin_to_follow(self._recording, seen)
        return seen

    def show(self, time: float, position: Array, base_pose: Array | None) -> None:
        """Move the robot, once there are as many poses as a message has.

        Args:
            time: In [s].
            position: Of the named joints, shape (joints,), in [rad] or [m].
            base_pose: x, y, z and quaternion x, y, z, w of a floating base, shape (7,).
        """
        places, turns = self.transforms(position)
        if base_pose is not None:
            places, turns = np.vstack((places, base_pose[:3])), np.vstack((turns, base_pose[3:]))
        if not len(places):
            return
        self._waiting.append((time, places, turns))
        if len(self._waiting) >= self._at_once:
            self.flush()

    def flush(self) -> None:
        """Draw the poses that wait."""
        if not self._waiting:
            return
        times, places, turns = (list(each) for each in zip(*self._waiting, strict=True))
        self._waiting = []
        count = len(times)
        if self._followed is not None:  # the base is the last of the links
            seen, first = self._followed
            base = np.array([[*at[-1], *turn[-1]] for at, turn in zip(places, turns, strict=True)])
            framing.follow(self._recording, seen, np.array(times), base, first)
        self._recording.send_columns(
            "/robot/motion",
            indexes=[series.at(np.repeat(times, len(self.children)))],
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


def _known(pose: Array) -> Array:
    """A pose, or that of a base in the origin where it is not known."""
    return pose if np.isfinite(pose).all() else np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


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
