"""What messages hold of the motion of a robot's base."""

from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from inspector.logs.log import Field
from inspector.logs.ros.bag import Topic
from inspector.logs.ros.grouping import stamps_of
from inspector.logs.ros.types import Decoder, stamp_of

WORLDS = ("odom", "world", "map", "earth")
"""Frames that do not move with the robot, the smoothest first."""

BASES = ("base_link", "base_footprint", "base", "pelvis", "torso", "trunk", "root")
"""Frames of a robot's base, if its URDF does not say which."""


class Odometries:
    """``nav_msgs/Odometry``: pose of the base in the world, velocity in its own axes."""

    def __init__(self, path: Path, topic: Topic, *, ros1: bool) -> None:
        self.decode = Decoder(path, topic, ros1=ros1)
        self.topic = topic.name
        self.logged, self.received = array("q"), array("q")
        self.poses, self.twists = array("d"), array("d")

    def add(self, received: int, data: bytes) -> None:
        """Take a message."""
        message = self.decode(data)
        self.logged.append(stamp_of(message))
        self.received.append(received)
        self.poses.extend(_pose(message.pose.pose.position, message.pose.pose.orientation))
        twist = message.twist.twist
        self.twists.extend(getattr(twist.linear, axis) for axis in "xyz")
        self.twists.extend(getattr(twist.angular, axis) for axis in "xyz")

    def fields(self) -> Iterator[Field]:
        """Give pose and velocity."""
        stamps = stamps_of(self.logged, self.received)
        for name, numbers, signal, width in (
            ("pose", self.poses, "base_pose", 7),
            ("twist", self.twists, "base_velocity", 6),
        ):
            values = np.frombuffer(numbers).reshape(-1, width)
            yield Field(f"{self.topic}/{name}", values, stamps, signal=signal, source=self.topic)


class Transforms:
    """``tf2_msgs/TFMessage``: the pose of the base among the frames that it connects."""

    def __init__(self, path: Path, topic: Topic, *, ros1: bool) -> None:
        self.decode = Decoder(path, topic, ros1=ros1)
        self.topic = topic.name
        self.pairs: dict[tuple[str, str], tuple[array[int], array[int], array[float]]] = {}

    def add(self, received: int, data: bytes) -> None:
        """Take a message."""
        for each in self.decode(data).transforms:
            pair = each.header.frame_id.lstrip("/"), each.child_frame_id.lstrip("/")
            if pair[0] in WORLDS and pair[1] in BASES:
                logged, at, poses = self.pairs.setdefault(
                    pair, (array("q"), array("q"), array("d"))
                )
                logged.append(stamp_of(each))
                at.append(received)
                poses.extend(_pose(each.transform.translation, each.transform.rotation))

    def fields(self) -> Iterator[Field]:
        """Give the pose of the base in the smoothest of the worlds."""
        for world, base in sorted(
            self.pairs, key=lambda pair: (WORLDS.index(pair[0]), BASES.index(pair[1]))
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


def _pose(position: Any, turn: Any) -> tuple[float, ...]:
    return (position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w)
