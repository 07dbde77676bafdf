"""What the messages of each type hold of the motion of a robot's joints."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from inspector.logs.log import Field, Stamps
from inspector.logs.ros.bag import Topic
from inspector.logs.ros.basemotion import Odometries, Transforms
from inspector.logs.ros.grouping import Gathered
from inspector.logs.ros.jointstate import Layout, stamp
from inspector.logs.ros.types import STATE, Decoder, nanoseconds, stamp_of

COMMANDED = ("command", "desired", "target", "reference", "setpoint")
"""A JointState topic with one of these in its name holds desired motion."""

ARRAYS = {"position": "position", "velocity": "velocity", "effort": "effort"}
POINT = {"positions": "position", "velocities": "velocity", "effort": "effort"}


class Gatherer(Protocol):
    """Takes the messages of a topic, then tells what they hold."""

    def add(self, received: int, data: bytes) -> None:
        """Take a message that was received at a time in [ns]."""

    def fields(self) -> Iterator[Field]:
        """Go through what the messages hold."""


class JointStates:
    """``sensor_msgs/JointState``: what was measured, or commanded if the topic's name says so."""

    def __init__(self, path: Path, topic: Topic, *, ros1: bool) -> None:
        self.decode = Decoder(path, topic, ros1=ros1)
        self.gathered = Gathered(topic.name)
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
        """Take a message."""
        if self.layout is None or not self.layout.fits(data):
            self.layout = None if self.ros1 else Layout.of(data)
        if self.layout is not None:
            parts = (data[start:stop] for start, stop in self.layout.arrays)
            named = dict(zip(ARRAYS, parts, strict=True))
            self.gathered.add(self.layout.names, stamp(data), received, named)
            return
        message = self.decode(data)
        named = {name: getattr(message, name) for name in ARRAYS}
        self.gathered.add(tuple(message.name), stamp_of(message), received, named)

    def fields(self) -> Iterator[Field]:
        """Go through positions, velocities and efforts."""
        return self.gathered.fields(self.signals)


class ControllerStates:
    """``control_msgs/JointTrajectoryControllerState``: both sides, with one stamp."""

    STAGES: Mapping[str, bool] = {
        "reference": True,
        "desired": True,
        "feedback": False,
        "actual": False,
    }
    """The names of a stage, and whether it is the desired one."""

    def __init__(self, path: Path, topic: Topic, *, ros1: bool) -> None:
        self.decode = Decoder(path, topic, ros1=ros1)
        self.gathered = Gathered(topic.name)
        self.signals = {
            f"{stage}/{name}": (f"{signal}_desired" if desired else signal, 0 if desired else 1)
            for stage, desired in self.STAGES.items()
            for name, signal in POINT.items()
            if not (desired and signal == "effort")
        }

    def add(self, received: int, data: bytes) -> None:
        """Take a message; of a stage that has two names the one that holds something."""
        message = self.decode(data)
        parts = {}
        for stages in (("reference", "desired"), ("feedback", "actual")):
            there = [name for name in stages if _is_filled(getattr(message, name, None))]
            for stage in there[:1]:
                point = getattr(message, stage)
                for name in POINT:
                    if f"{stage}/{name}" in self.signals:
                        parts[f"{stage}/{name}"] = getattr(point, name, ())
        joints = tuple(message.joint_names)
        self.gathered.add(joints, stamp_of(message), received, parts)

    def fields(self) -> Iterator[Field]:
        """Go through positions, velocities and efforts of both sides."""
        return self.gathered.fields(self.signals)


class Trajectories:
    """``trajectory_msgs/JointTrajectory``: desired motion, planned ahead."""

    def __init__(self, path: Path, topic: Topic, *, ros1: bool) -> None:
        self.decode = Decoder(path, topic, ros1=ros1)
        self.topic = topic.name
        self.joints: dict[frozenset[str], list[tuple[int, tuple[str, ...], Any]]] = {}

    def add(self, received: int, data: bytes) -> None:
        """Take a trajectory."""
        message = self.decode(data)
        joints = tuple(message.joint_names)
        if joints and message.points:
            start = stamp_of(message) or received
            plans = self.joints.setdefault(frozenset(joints), [])
            plans.append((start, joints, message.points))

    def fields(self) -> Iterator[Field]:
        """Go through the points; a new trajectory takes the place of what is left of the last."""
        for plans in self.joints.values():
            joints, rows = plans[0][1], []
            begins = [start for start, _, _ in plans[1:]]
            for (start, names, points), stop in zip(plans, [*begins, 2**63], strict=True):
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


class Descriptions:
    """``std_msgs/String``: the robot's URDF."""

    def __init__(self, path: Path, topic: Topic, *, ros1: bool) -> None:
        self.decode = Decoder(path, topic, ros1=ros1)
        self.urdf = ""

    def add(self, received: int, data: bytes) -> None:
        """Take a message; the last one that holds a URDF is it."""
        text = str(self.decode(data).data)
        if "<robot" in text:
            self.urdf = text

    def fields(self) -> Iterator[Field]:
        """Give nothing: a URDF does not move."""
        return iter(())


GATHERERS: Mapping[str, Callable[..., Gatherer]] = {
    "sensor_msgs/msg/JointState": JointStates,
    STATE: ControllerStates,
    "trajectory_msgs/msg/JointTrajectory": Trajectories,
    "nav_msgs/msg/Odometry": Odometries,
    "tf2_msgs/msg/TFMessage": Transforms,
    "tf/msg/tfMessage": Transforms,
}
"""The types of messages that are read, and what reads them."""

DESCRIPTION = "robot_description"
"""The last part of the name of the topic that a robot's URDF comes on."""


def gatherer_of(path: Path, topic: Topic, *, ros1: bool) -> Gatherer | None:
    """Choose what reads a topic; None if nothing does."""
    if topic.type == "std_msgs/msg/String" and topic.name.endswith(DESCRIPTION):
        return Descriptions(path, topic, ros1=ros1)
    kind = GATHERERS.get(topic.type)
    return kind(path, topic, ros1=ros1) if kind else None


def _is_filled(point: Any) -> bool:
    return point is not None and bool(len(point.positions) or len(point.velocities))
