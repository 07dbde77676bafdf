"""Messages, deserialised by the definitions in the bag, or by those of ROS if it has none."""

import struct
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from inspector.errors import LogError
from inspector.logs.ros.bag import Topic

DAMAGE = (
    *(ArithmeticError, AssertionError, AttributeError, LookupError, MemoryError, RecursionError),
    *(struct.error, SyntaxError, TypeError, ValueError),
)
"""Errors that rosbags lets through on definitions and messages that are damaged."""

STATE = "control_msgs/msg/JointTrajectoryControllerState"


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
    _state((*NEW, "desired", "actual"), (*NEW, "desired", "actual")),
    _state(OLD, OLD),
    _state(OLD),
)
"""Versions of a controller's state; bags from before 2023 do not contain the definition."""


class Decoder:
    """Deserialises the messages of one topic."""

    def __init__(self, path: Path, topic: Topic, *, ros1: bool) -> None:
        self.path, self.topic, self.ros1 = path, topic, ros1
        self._store: Any = None

    def __call__(self, data: bytes) -> Any:
        """Deserialise a message.

        Raises:
            LogError: If the message is not of the topic's type.
        """
        if self._store is not None:
            return self._parsed(self._store, data)
        problem: Exception | None = None
        for store in self._stores:
            try:
                message = self._parsed(store, data)
            except LogError as error:
                problem = error
                continue
            self._store = store
            return message
        unknown = f"{self.topic.name}: no definition of {self.topic.type}"
        raise problem or LogError(self.path, unknown)

    @cached_property
    def _stores(self) -> list[Any]:
        return list(self._candidates())

    def _candidates(self) -> Iterator[Any]:
        standard = Stores.ROS1_NOETIC if self.ros1 else Stores.ROS2_HUMBLE
        definitions = [self.topic.definition]
        if not self.topic.definition:
            store = get_typestore(standard)
            if self.topic.type in store.types:
                yield store
                return
            definitions = list(STATES) if self.topic.type == STATE else []
        for definition in definitions:
            store = get_typestore(standard if not self.topic.definition else Stores.EMPTY)
            try:
                store.register(get_types_from_msg(definition, self.topic.type))
            except (TypesysError, *DAMAGE) as error:
                raise LogError(
                    self.path,
                    f"{self.topic.name}: the definition of {self.topic.type} cannot be read"
                    f" ({' '.join(str(error).split())})",
                ) from error
            yield store

    def _parsed(self, store: Any, data: bytes) -> Any:
        parse = store.deserialize_ros1 if self.ros1 else store.deserialize_cdr
        try:
            return parse(data, self.topic.type)
        except (SerdeError, *DAMAGE) as error:
            raise LogError(
                self.path,
                f"{self.topic.name}: a message is not a {self.topic.type}"
                f" ({' '.join(str(error).split()) or type(error).__name__})",
            ) from error


def stamp_of(message: Any) -> int:
    """Stamp in a message's header, in [ns]."""
    return nanoseconds(message.header.stamp)


def nanoseconds(time: Any) -> int:
    """Time or duration of ROS, in [ns]."""
    return int(time.sec) * 10**9 + int(time.nanosec)
