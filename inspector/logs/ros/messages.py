"""Fields with the motion of joints and base, from the messages of each type."""

from array import array
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from inspector.logs.log import Field, Stamps
from inspector.logs.ros.bag import Topic
from inspector.logs.ros.buffers import JointBuffer, stamps_of
from inspector.logs.ros.decoding import STATE, Decoder, nanoseconds, stamp_of
from inspector.logs.ros.jointstate import Layout, stamp

COMMANDED = ("command", "desired", "target", "reference", "setpoint")
"""A JointState topic with one of these in its name holds desired motion."""

ARRAYS = {"position": "position", "velocity": "velocity", "effort": "effort"}
POINT = {"positions": "position", "velocities": "velocity", "effort": "effort"}


FIXED_FRAMES = ("odom", "world", "map", "earth")
"""Frames that do not move with the robot, the smoothest first."""

BASE_FRAMES = ("base_link", "base_footprint", "base", "pelvis", "torso", "trunk", "root")
"""Frames of a robot's base."""


class TopicReader(Protocol):
    """Collects the messages of a topic, and makes fields of them."""

    def add(self, received: int, data: bytes) -> None:
        """Add a message that was received at a time in [ns]."""

    def fields(self) -> Iterator[Field]:
        """Fields of the messages."""


class JointStates:
    """``sensor_msgs/JointState``: measured motion, or desired by the topic's name."""

    def __init__(self, path: Path, topic: Topic, *, ros1: bool) -> None:
        self.decode = Decoder(path, topic, ros1=ros1)
        self.buffer = JointBuffer(topic.name)
        self.layout: Layout | None = None
        self.ros1 = ros1
        commanded = any(word in topic.name.lower() for word in COMMANDED)
        self.signals = {name: (signal, 0) for name, signal in ARRAYS.items()}
        if commanded:
            self.signals = {
                "position": ("position_desired", 1),
                "velocity": ("velocity_desired", 1),
                "effort": ("", 1),
            }

    def add(self, received: int, data: bytes) -> None:
        """Add a message."""
        if self.layout is None or not self.layout.fits(data):
            self.layout = None if self.ros1 else Layout.of(data)
        if self.layout is not None:
            parts = (data[start:stop] for start, stop in self.layout.arrays)
            column_signal = dict(zip(ARRAYS, parts, strict=True))
            self.buffer.add(self.layout.names, stamp(data), received, column_signal)
            return
        message = self.decode(data)
        column_signal = {name: getattr(message, name) for name in ARRAYS}
        self.buffer.add(tuple(message.name), stamp_of(message), received, column_signal)

    def fields(self) -> Iterator[Field]:
        """Positions, velocities and efforts."""
        return self.buffer.fields(self.signals)


class ControllerStates:
    """``control_msgs/JointTrajectoryControllerState``: measured and desired, with one stamp."""

    STAGES: Mapping[str, bool] = {
        "reference": True,
        "desired": True,
        "feedback": False,
        "actual": False,
    }
    """Names of the stages, and whether each is desired motion."""

    def __init__(self, path: Path, topic: Topic, *, ros1: bool) -> None:
        self.decode = Decoder(path, topic, ros1=ros1)
        self.buffer = JointBuffer(topic.name)
        self.signals = {
            f"{stage}/{name}": (f"{signal}_desired" if desired else signal, 0 if desired else 1)
            for stage, desired in self.STAGES.items()
            for name, signal in POINT.items()
            if not (desired and signal == "effort")
        }

    def add(self, received: int, data: bytes) -> None:
        """Add a message; of the two names of a stage the one that is not empty is used."""
        message = self.decode(data)
        parts = {}
        for stages in (("reference", "desired"), ("feedback", "actual")):
            present = [name for name in stages if _has_values(getattr(message, name, None))]
            for stage in present[:1]:
                point = getattr(message, stage)
                for name in POINT:
                    if f"{stage}/{name}" in self.signals:
                        parts[f"{stage}/{name}"] = getattr(point, name, ())
        joints = tuple(message.joint_names)
        self.buffer.add(joints, stamp_of(message), received, parts)

    def fields(self) -> Iterator[Field]:
        """Measured and desired positions and velocities, and measured efforts."""
        return self.buffer.fields(self.signals)


class Trajectories:
    """``trajectory_msgs/JointTrajectory``: planned desired motion."""

    def __init__(self, path: Path, topic: Topic, *, ros1: bool) -> None:
        self.decode = Decoder(path, topic, ros1=ros1)
        self.topic = topic.name
        self.joints: dict[frozenset[str], list[tuple[int, tuple[str, ...], Any]]] = {}

    def add(self, received: int, data: bytes) -> None:
        """Add a trajectory."""
        message = self.decode(data)
        joints = tuple(message.joint_names)
        if joints and message.points:
            start = stamp_of(message) or received
            plans = self.joints.setdefault(frozenset(joints), [])
            plans.append((start, joints, message.points))

    def fields(self) -> Iterator[Field]:
        """Fields of the points; a new trajectory replaces the rest of the previous one."""
        for plans in self.joints.values():
            joints, rows = plans[0][1], []
            starts = [start for start, _, _ in plans[1:]]
            for (start, names, points), stop in zip(plans, [*starts, 2**63], strict=True):
                order = [names.index(joint) for joint in joints]
                for point in points:
                    at = start + nanoseconds(point.time_from_start)
                    if at < stop:
                        rows.append((at, order, point))
            stamps = Stamps.of_nanoseconds(np.array([at for at, _, _ in rows]), held=True)
            for name, signal in (("positions", "position"), ("velocities", "velocity")):
                if all(len(getattr(point, name)) == len(joints) for _, _, point in rows):
                    values = np.array([getattr(point, name)[order] for _, order, point in rows])
                    yield Field(
                        f"{self.topic}/{name}",
                        values,
                        stamps,
                        joints=joints,
                        signal=f"{signal}_desired",
                        source=self.topic,
                        rank=2,
                    )


class Odometries:
    """``nav_msgs/Odometry``: pose of the base in the world, velocity in body axes."""

    def __init__(self, path: Path, topic: Topic, *, ros1: bool) -> None:
        self.decode = Decoder(path, topic, ros1=ros1)
        self.topic = topic.name
        self.logged, self.received = array("q"), array("q")
        self.poses, self.twists = array("d"), array("d")

    def add(self, received: int, data: bytes) -> None:
        """Add a message."""
        message = self.decode(data)
        self.logged.append(stamp_of(message))
        self.received.append(received)
        self.poses.extend(_pose(message.pose.pose.position, message.pose.pose.orientation))
        twist = message.twist.twist
        self.twists.extend(getattr(twist.linear, axis) for axis in "xyz")
        self.twists.extend(getattr(twist.angular, axis) for axis in "xyz")

    def fields(self) -> Iterator[Field]:
        """Pose and velocity."""
        stamps = stamps_of(self.logged, self.received)
        for name, numbers, signal, width in (
            ("pose", self.poses, "base_pose", 7),
            ("twist", self.twists, "base_velocity", 6),
        ):
            values = np.frombuffer(numbers).reshape(-1, width)
            yield Field(f"{self.topic}/{name}", values, stamps, signal=signal, source=self.topic)


class Transforms:
    """``tf2_msgs/TFMessage``: the pose of the base."""

    def __init__(self, path: Path, topic: Topic, *, ros1: bool) -> None:
        self.decode = Decoder(path, topic, ros1=ros1)
        self.topic = topic.name
        self.pairs: dict[tuple[str, str], tuple[array[int], array[int], array[float]]] = {}

    def add(self, received: int, data: bytes) -> None:
        """Add a message."""
        for each in self.decode(data).transforms:
            pair = each.header.frame_id.lstrip("/"), each.child_frame_id.lstrip("/")
            if pair[0] in FIXED_FRAMES and pair[1] in BASE_FRAMES:
                logged, at, poses = self.pairs.setdefault(
                    pair, (array("q"), array("q"), array("d"))
                )
                logged.append(stamp_of(each))
                at.append(received)
                poses.extend(_pose(each.transform.translation, each.transform.rotation))

    def fields(self) -> Iterator[Field]:
        """Pose of the base in the smoothest of the fixed frames."""
        for world, base in sorted(
            self.pairs, key=lambda pair: (FIXED_FRAMES.index(pair[0]), BASE_FRAMES.index(pair[1]))
        )[:1]:
            logged, at, poses = self.pairs[world, base]
            yield Field(
                f"{self.topic}/{world}/{base}",
                np.frombuffer(poses).reshape(-1, 7),
                stamps_of(logged, at),
                signal="base_pose",
                source=self.topic,
                rank=1,
            )


class Descriptions:
    """``std_msgs/String``: the robot's URDF."""

    def __init__(self, path: Path, topic: Topic, *, ros1: bool) -> None:
        self.decode = Decoder(path, topic, ros1=ros1)
        self.urdf = ""

    def add(self, received: int, data: bytes) -> None:
        """Add a message; the last one that holds a URDF is used."""
        text = str(self.decode(data).data)
        if "<robot" in text:
            self.urdf = text

    def fields(self) -> Iterator[Field]:
        """No fields: a URDF has no motion."""
        return iter(())


TOPIC_READERS: Mapping[str, Callable[..., TopicReader]] = {
    "sensor_msgs/msg/JointState": JointStates,
    STATE: ControllerStates,
    "trajectory_msgs/msg/JointTrajectory": Trajectories,
    "nav_msgs/msg/Odometry": Odometries,
    "tf2_msgs/msg/TFMessage": Transforms,
    "tf/msg/tfMessage": Transforms,
}
"""Readers by the type of messages."""

DESCRIPTION = "robot_description"
"""The last part of the name of the topic with a robot's URDF."""


def topic_reader(path: Path, topic: Topic, *, ros1: bool) -> TopicReader | None:
    """Reader of a topic; None if its type is not read."""
    if topic.type == "std_msgs/msg/String" and topic.name.endswith(DESCRIPTION):
        return Descriptions(path, topic, ros1=ros1)
    kind = TOPIC_READERS.get(topic.type)
    return kind(path, topic, ros1=ros1) if kind else None


def _has_values(point: Any) -> bool:
    return point is not None and bool(len(point.positions) or len(point.velocities))


def _pose(position: Any, turn: Any) -> tuple[float, ...]:
    return (position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w)
