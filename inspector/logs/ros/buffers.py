"""Numbers of many messages, buffered in arrays for each set of joints."""

from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from inspector.logs.log import Field, Stamps

RECORDER = "the messages have no stamps, those of the recorder are used"

Parts = Mapping[str, Sequence[float] | bytes | memoryview]
"""Numbers of a message by the name of the array, or the bytes of its float64 numbers."""


@dataclass
class Group:
    """Messages about one set of joints.

    Attributes:
        joints: The joints, in the order of the first message.
        logged: Stamps in the messages' headers, in [ns].
        received: When the recorder received them, in [ns].
        arrays: Numbers by the name of the array, row after row.
    """

    joints: tuple[str, ...]
    logged: "array[int]" = field(default_factory=lambda: array("q"))
    received: "array[int]" = field(default_factory=lambda: array("q"))
    arrays: dict[str, "array[float]"] = field(default_factory=dict)


class JointBuffer:
    """Numbers of the messages of one topic.

    Publishers that share a topic, such as an arm's and a gripper's, have a group each. Numbers
    are stored as float64.
    """

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.groups: dict[tuple[frozenset[str], tuple[str, ...]], Group] = {}

    def add(self, joints: tuple[str, ...], logged: int, received: int, parts: Parts) -> None:
        """Append a message; arrays whose length is not that of the joints are ignored."""
        present = tuple(
            name for name, numbers in parts.items() if _count(numbers) == len(joints) > 0
        )
        group = self.groups.get((frozenset(joints), present))
        if group is None:
            group = self.groups[frozenset(joints), present] = Group(joints)
            group.arrays = {name: array("d") for name in present}
        group.logged.append(logged)
        group.received.append(received)
        for name in present:
            numbers = parts[name]
            if joints != group.joints:
                numbers = _reordered(numbers, joints, group.joints)
            if isinstance(numbers, bytes | memoryview):
                group.arrays[name].frombytes(numbers)
            else:
                group.arrays[name].extend(numbers)

    def fields(self, signals: Mapping[str, tuple[str, int]]) -> Iterator[Field]:
        """Fields of the arrays.

        Args:
            signals: Signal and rank by the name of an array.
        """
        for group in self.groups.values():
            if not group.arrays:
                continue
            stamps = stamps_of(group.logged, group.received)
            for name, numbers in group.arrays.items():
                signal, rank = signals[name]
                values = np.frombuffer(numbers).reshape(len(group.logged), -1)
                yield Field(
                    f"{self.topic}/{name}",
                    values,
                    stamps,
                    joints=group.joints,
                    signal=signal,
                    source=self.topic,
                    rank=rank,
                )


def stamps_of(logged: "array[int]", received: "array[int]") -> Stamps:
    """Stamps of the messages, or if they have none, of the recorder."""
    if any(logged):
        return Stamps.of_nanoseconds(np.frombuffer(logged, dtype=np.int64))
    return Stamps.of_nanoseconds(np.frombuffer(received, dtype=np.int64), remark=RECORDER)


def _count(numbers: Sequence[float] | bytes | memoryview) -> int:
    serialised = isinstance(numbers, bytes | memoryview)
    return len(numbers) // 8 if serialised else len(numbers)


def _reordered(
    numbers: Sequence[float] | bytes | memoryview, joints: Sequence[str], order: Sequence[str]
) -> bytes:
    values = (
        np.frombuffer(numbers)
        if isinstance(numbers, bytes | memoryview)
        else np.asarray(numbers, dtype=np.float64)
    )
    return values[[joints.index(joint) for joint in order]].tobytes()
