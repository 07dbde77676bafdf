"""Motion of joints and base, from the messages of each type of ROS.

Messages are deserialised by the definitions that are known here, never by the one in a bag: that is
code for a decoder, and may state anything.
"""

import struct
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Self, TypeAlias

import numpy as np
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from inspector.errors import LogError
from inspector.logs.log import Field, Stamps

DAMAGE = (
    *(ArithmeticError, AssertionError, AttributeError, LookupError, MemoryError, RecursionError),
    *(struct.error, SyntaxError, TypeError, ValueError, SerdeError),
)
"""Errors that rosbags lets through on messages that are damaged."""

JOINT_STATE = "sensor_msgs/msg/JointState"
STATE = "control_msgs/msg/JointTrajectoryControllerState"
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
DESCRIPTION = "robot_description"  # the last part of the name of the topic with a robot's URDF

COMMANDED = ("command", "desired", "target", "reference", "setpoint")
"""A JointState topic with one of these in its name holds desired motion."""
ARRAYS = ("position", "velocity", "effort")
POINT = {"positions": "position", "velocities": "velocity", "effort": "effort"}
STAGES = {"reference": True, "desired": True, "feedback": False, "actual": False}
"""Names of the stages of a controller's state, and whether each is desired motion."""
CONTROLLED = {
    f"{stage}/{name}": (f"{signal}_desired" if desired else signal, 0 if desired else 1)
    for stage, desired in STAGES.items()
    for name, signal in POINT.items()
    if not (desired and signal == "effort")
}

FRAMES = [
    f"{world}/{base}"
    for world in ("odom", "world", "map", "earth")
    for base in ("base_link", "base_footprint", "base", "pelvis", "torso", "trunk", "root")
]
"""Frames that do not move with the robot, the smoothest first, and frames of a robot's base."""
BASE_WIDTHS = {"pose": 7, "twist": 6, **dict.fromkeys(FRAMES, 7)}
RECORDER = "the messages have no stamps, those of the recorder are used"


@dataclass(frozen=True)
class Topic:
    """A topic of a bag; its type is written as in ROS 2: ``sensor_msgs/msg/JointState``."""

    name: str
    type: str
    definition: str = ""  # text of the type's definition, if the bag has it
    count: int = -1  # messages, -1 if unknown


# Messages of bytes


def _state(joints: tuple[str, ...], others: tuple[str, ...] = (), last: str = "") -> str:
    """Definition of a controller's state with these stages."""
    point = "trajectory_msgs/JointTrajectoryPoint"
    multi = "trajectory_msgs/MultiDOFJointTrajectoryPoint"
    lines = ["std_msgs/Header header", "string[] joint_names"]
    lines += [f"{point} {name}" for name in joints]
    if others:
        lines += ["string[] multi_dof_joint_names"]
        lines += [f"{multi} multi_dof_{name}" for name in others]
    return "\n".join([*lines, last])


OLD = ("desired", "actual", "error")
NEW = ("reference", "feedback", "error", "output")
STATES = (
    _state(NEW, NEW, "float64 speed_scaling_factor"),
    _state((*NEW, *OLD[:2]), (*NEW, *OLD[:2])),
    _state(OLD, OLD),
    _state(OLD),
    _state(NEW),
    _state((*NEW, *OLD[:2])),
    _state(NEW, (), "float64 speed_scaling_factor"),
)
"""Versions of a controller's state; bags from before 2023 do not contain the definition."""


def _fields_in(definition: str) -> list[str]:
    """Names of the fields of a definition, without the fields of the types in it."""
    lines = (
        line.partition("#")[0].split() for line in definition.partition("\n===")[0].splitlines()
    )
    return [words[1] for words in lines if len(words) == 2]


def decoder(path: Path, topic: Topic, *, ros1: bool) -> Callable[[bytes], Any]:
    """What deserialises the messages of a topic, by the version of their type that fits."""
    stores: list[Any] = []

    def decode(data: bytes) -> Any:
        problem: Exception | None = None
        stores[:] = stores or _stores(path, topic, ros1=ros1)
        for store in stores:
            parse = store.deserialize_ros1 if ros1 else store.deserialize_cdr
            try:
                message = parse(data, topic.type)
            except DAMAGE as error:
                problem = error
                continue
            stores[:] = [store]
            return message
        what = " ".join(str(problem).split()) or type(problem).__name__
        raise LogError(path, f"{topic.name}: a message is not a {topic.type} ({what})")

    return decode


def _stores(path: Path, topic: Topic, *, ros1: bool) -> list[Any]:
    """What may deserialise messages: several where versions of their type are known."""
    definitions = [""]
    if topic.type in TRANSFORMS:
        definitions = ["geometry_msgs/TransformStamped[] transforms"]
    elif topic.type == STATE:
        names = _fields_in(topic.definition)
        definitions = [each for each in STATES if not names or _fields_in(each) == names]
        if not definitions:
            raise LogError(
                path,
                f"{topic.name}: the definition of {topic.type} is none that is known (its fields"
                f" are {', '.join(names)[:200]})",
            )
    return [_store(topic.type, definition, ros1) for definition in definitions]


@cache  # a store takes 20 ms to make
def _store(kind: str, definition: str, ros1: bool) -> Any:
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    if definition and kind not in store.types:
        store.register(get_types_from_msg(definition, kind))
    return store


def _nanoseconds(time: Any) -> int:
    """Time or duration of ROS, in [ns]."""
    return int(time.sec) * 10**9 + int(time.nanosec)


LITTLE = b"\x00\x01"  # CDR, little-endian; other encodings are deserialised by rosbags
STAMP, COUNT = struct.Struct("<iI"), struct.Struct("<I")
BODY = 12  # offset of the bytes after the stamp


@dataclass(frozen=True)
class Layout:
    """Byte offsets of the numbers of a JointState, by which they are copied without parsing.

    CDR aligns a number to a multiple of its size, counted from the end of the four bytes of the
    encapsulation header. Messages of one publisher have one layout: the bytes between their
    numbers are equal.
    """

    names: tuple[str, ...]
    size: int  # of the message, in bytes
    arrays: tuple[tuple[int, int], ...]  # start and stop of positions, velocities and efforts
    between: tuple[tuple[int, int, bytes], ...]  # start, stop, and bytes that messages share

    @classmethod
    def of(cls, data: bytes) -> Self | None:
        """Layout of a message; None if it is not a JointState in little-endian CDR."""
        if data[:2] != LITTLE:
            return None
        try:
            _, place = _text(data, BODY)
            count, place = _count(data, place)
            names = []
            for _ in range(count):
                name, place = _text(data, place)
                names.append(name)
            arrays, between, start = [], [], BODY
            for _ in range(3):
                count, place = _count(data, place)
                place = _aligned(place, 8) if count else place
                between.append((start, place, data[start:place]))
                start = place + 8 * count
                arrays.append((place, start))
                place = start
        except (struct.error, UnicodeDecodeError):
            return None
        if start > len(data):
            return None
        return cls(tuple(names), len(data), tuple(arrays), tuple(between))

    def fits(self, data: bytes) -> bool:
        """Whether a message has this layout."""
        return (
            len(data) == self.size
            and data[:2] == LITTLE
            and all(data[start:stop] == same for start, stop, same in self.between)
        )


def stamp(data: bytes) -> int:
    """Stamp of a message that has a layout, in [ns]."""
    seconds, fraction = STAMP.unpack_from(data, 4)
    return int(seconds) * 10**9 + int(fraction)


def _count(data: bytes, place: int) -> tuple[int, int]:
    """A number of items, and the place after it."""
    place = _aligned(place, 4)
    return int(COUNT.unpack_from(data, place)[0]), place + 4


def _text(data: bytes, place: int) -> tuple[str, int]:
    length, place = _count(data, place)
    if place + length > len(data):
        raise struct.error("text runs beyond the message")
    return data[place : place + length].rstrip(b"\x00").decode(), place + length


def _aligned(place: int, size: int) -> int:
    return place + -(place - 4) % size


# Rows of messages

Row: TypeAlias = tuple[tuple[str, ...], int, Mapping[str, Any]]
"""What a message tells at one time: joints, stamp in [ns], and numbers by the array's name."""


def _of_state(message: Any) -> Iterator[Row]:
    """Row of a ``sensor_msgs/JointState``."""
    parts = {name: getattr(message, name) for name in ARRAYS}
    yield tuple(message.name), _nanoseconds(message.header.stamp), parts


def _of_controller(message: Any) -> Iterator[Row]:
    """Row of a controller's state; of the two names of a stage the one that is not empty."""
    parts = {}
    for stages in (("reference", "desired"), ("feedback", "actual")):
        for stage in stages:
            point = getattr(message, stage, None)
            if point is not None and (len(point.positions) or len(point.velocities)):
                for name in POINT:
                    if f"{stage}/{name}" in CONTROLLED:
                        parts[f"{stage}/{name}"] = getattr(point, name, ())
                break
    yield tuple(message.joint_names), _nanoseconds(message.header.stamp), parts


def _of_odometry(message: Any) -> Iterator[Row]:
    """Row of a ``nav_msgs/Odometry``: pose of the base in the world, velocity in body axes."""
    pose, twist = message.pose.pose, message.twist.twist
    velocity = [getattr(part, axis) for part in (twist.linear, twist.angular) for axis in "xyz"]
    parts = {"pose": _pose(pose.position, pose.orientation), "twist": velocity}
    yield (), _nanoseconds(message.header.stamp), parts


def _of_transforms(message: Any) -> Iterator[Row]:
    """Rows of transforms from a fixed frame to a base."""
    for each in message.transforms:
        pair = f"{each.header.frame_id.lstrip('/')}/{each.child_frame_id.lstrip('/')}"
        if pair in FRAMES:
            pose = _pose(each.transform.translation, each.transform.rotation)
            yield (), _nanoseconds(each.header.stamp), {pair: pose}


def _pose(position: Any, turn: Any) -> list[float]:
    return [position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w]


MOTION: Mapping[str, tuple[Callable[[Any], Iterator[Row]], Mapping[str, tuple[str, int]]]] = {
    JOINT_STATE: (_of_state, {name: (name, 0) for name in ARRAYS}),
    STATE: (_of_controller, CONTROLLED),
    "nav_msgs/msg/Odometry": (
        _of_odometry,
        {"pose": ("base_pose", 0), "twist": ("base_velocity", 0)},
    ),
    **dict.fromkeys(TRANSFORMS, (_of_transforms, dict.fromkeys(FRAMES, ("base_pose", 1)))),
}
"""By the type of messages, the rows of a message, and signal and rank of each of its arrays."""


# Topics


@dataclass
class Group:
    """Messages about one set of joints, as rows of float64 numbers."""

    joints: tuple[str, ...]  # in the order of the first message; none of a base
    arrays: dict[str, "array[float]"]  # row after row
    logged: "array[int]" = field(default_factory=lambda: array("q"))  # in the headers, in [ns]
    received: "array[int]" = field(default_factory=lambda: array("q"))  # by the recorder


class MotionReader:
    """Collects the messages of a topic with the motion of joints or of a base.

    Publishers that share a topic, such as an arm's and a gripper's, have a group each.
    """

    def __init__(self, path: Path, topic: Topic, *, ros1: bool) -> None:
        self._decode = decoder(path, topic, ros1=ros1)
        self._topic = topic
        self._rows, self._signals = MOTION[topic.type]
        self._has_layout = topic.type == JOINT_STATE and not ros1
        if topic.type == JOINT_STATE and any(word in topic.name.lower() for word in COMMANDED):
            self._signals = {name: (f"{name}_desired", 1) for name in ("position", "velocity")}
        self._layout: Layout | None = None
        self._groups: dict[tuple[frozenset[str], tuple[str, ...]], Group] = {}

    def add(self, received: int, data: bytes) -> None:
        """Add a message that was received at a time in [ns]."""
        if self._has_layout and not (self._layout and self._layout.fits(data)):
            self._layout = Layout.of(data)
        if self._layout:
            numbers = (data[start:stop] for start, stop in self._layout.arrays)
            parts = dict(zip(ARRAYS, numbers, strict=True))
            self._add(self._layout.names, stamp(data), received, parts)
            return
        for joints, logged, found in self._rows(self._decode(data)):
            parts = {n: np.asarray(each, dtype=np.float64).tobytes() for n, each in found.items()}
            self._add(joints, logged, received, parts)

    def _add(
        self, joints: tuple[str, ...], logged: int, received: int, parts: Mapping[str, bytes]
    ) -> None:
        """Append a row; arrays with another length than the joints are ignored."""
        present = tuple(
            name
            for name, numbers in parts.items()
            if len(numbers) // 8 == BASE_WIDTHS.get(name, len(joints)) > 0
        )
        group = self._groups.get((frozenset(joints), present))
        if group is None:
            group = Group(joints, {name: array("d") for name in present})
            self._groups[frozenset(joints), present] = group
        group.logged.append(logged)
        group.received.append(received)
        for name in present:
            numbers = parts[name]
            if joints != group.joints:
                order = [joints.index(joint) for joint in group.joints]
                numbers = np.frombuffer(numbers)[order].tobytes()
            group.arrays[name].frombytes(numbers)

    def fields(self) -> Iterator[Field]:
        """Fields of the messages; of several transforms, the one with the smoothest fixed frame."""
        groups = [group for group in self._groups.values() if group.arrays]
        if self._topic.type in TRANSFORMS:
            groups = sorted(groups, key=lambda group: FRAMES.index(next(iter(group.arrays))))[:1]
        for group in groups:
            chosen = group.logged if any(group.logged) else group.received
            remark = RECORDER if chosen is group.received else ""
            stamps = Stamps.of_nanoseconds(np.frombuffer(chosen, dtype=np.int64), remark=remark)
            for name, numbers in group.arrays.items():
                signal, rank = self._signals.get(name, ("", 0))
                yield Field(
                    f"{self._topic.name}/{name}",
                    np.frombuffer(numbers).reshape(len(stamps.time), -1),
                    stamps,
                    joints=group.joints,
                    signal=signal,
                    source=self._topic.name,
                    rank=rank,
                )


class Trajectories:
    """``trajectory_msgs/JointTrajectory``: planned desired motion."""

    def __init__(self, path: Path, topic: Topic, *, ros1: bool) -> None:
        self._decode = decoder(path, topic, ros1=ros1)
        self._topic = topic.name
        self._plans: dict[frozenset[str], list[tuple[int, tuple[str, ...], Any]]] = {}

    def add(self, received: int, data: bytes) -> None:
        """Add a trajectory."""
        message = self._decode(data)
        joints = tuple(message.joint_names)
        if joints and message.points:
            start = _nanoseconds(message.header.stamp) or received
            self._plans.setdefault(frozenset(joints), []).append((start, joints, message.points))

    def fields(self) -> Iterator[Field]:
        """Fields of the points; a new trajectory replaces the rest of the previous one."""
        for plans in self._plans.values():
            joints, rows = plans[0][1], []
            stops = [*(start for start, _, _ in plans[1:]), 2**63]
            for (start, names, points), stop in zip(plans, stops, strict=True):
                order = [names.index(joint) for joint in joints]
                times = [start + _nanoseconds(point.time_from_start) for point in points]
                rows += [(t, order, p) for t, p in zip(times, points, strict=True) if t < stop]
            stamps = Stamps.of_nanoseconds(np.array([at for at, _, _ in rows]), held=True)
            for name, signal in (("positions", "position"), ("velocities", "velocity")):
                if all(len(getattr(point, name)) == len(joints) for _, _, point in rows):
                    yield Field(
                        f"{self._topic}/{name}",
                        np.array([getattr(point, name)[order] for _, order, point in rows]),
                        stamps,
                        joints=joints,
                        signal=f"{signal}_desired",
                        source=self._topic,
                        rank=2,
                    )


class Descriptions:
    """``std_msgs/String``: the robot's URDF, the last that holds one."""

    def __init__(self, path: Path, topic: Topic, *, ros1: bool) -> None:
        self._decode = decoder(path, topic, ros1=ros1)
        self.urdf = ""

    def add(self, received: int, data: bytes) -> None:
        """Add a message."""
        text = str(self._decode(data).data)
        if "<robot" in text:
            self.urdf = text

    def fields(self) -> Sequence[Field]:
        """No fields: a URDF has no motion."""
        return ()


TopicReader: TypeAlias = MotionReader | Trajectories | Descriptions
TOPIC_READERS: Mapping[str, type[MotionReader] | type[Trajectories]] = {
    JOINT_STATE: MotionReader,
    STATE: MotionReader,
    "trajectory_msgs/msg/JointTrajectory": Trajectories,
    **dict.fromkeys(("nav_msgs/msg/Odometry", *TRANSFORMS), MotionReader),
}
"""Readers by the type of messages."""


def topic_reader(path: Path, topic: Topic, *, ros1: bool) -> TopicReader | None:
    """Reader of a topic; None if its type is not read."""
    if topic.type == "std_msgs/msg/String" and topic.name.endswith(DESCRIPTION):
        return Descriptions(path, topic, ros1=ros1)
    kind = TOPIC_READERS.get(topic.type)
    return kind(path, topic, ros1=ros1) if kind else None
