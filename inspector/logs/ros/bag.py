"""A bag as topics and raw messages, whoever reads them from the file."""

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

MAGIC = {b"\x89MCAP0\r\n": "MCAP", b"SQLite format 3\x00": "SQLite", b"#ROSBAG V2.0": "ROS 1"}
"""The first bytes of the files that bags are stored in."""

Message: TypeAlias = tuple[str, int, bytes]
"""Topic, when it was received in [ns], and the message as serialised."""


@dataclass(frozen=True)
class Topic:
    """A topic of a bag.

    Attributes:
        name: Its name.
        type: Type of its messages, as ROS 2 writes it: ``sensor_msgs/msg/JointState``.
        definition: Text of the type's definition, empty if the bag has none.
        count: How many messages there are, -1 if nobody counted.
    """

    name: str
    type: str
    definition: str = ""
    count: int = -1


@dataclass
class Bag:
    """A bag that is open for reading.

    Attributes:
        kind: What it is, for people.
        ros1: Whether messages are serialised as ROS 1 does it.
        topics: Its topics by name.
        messages: Goes through the messages of some topics.
        close: Lets go of the file.
        seconds: Time from first to last message, in [s]; 0 if nobody knows.
        lost: What could not be read, a sentence each; complete when all messages were read.
    """

    kind: str
    ros1: bool
    topics: dict[str, Topic]
    messages: Callable[[Collection[str]], Iterator[Message]]
    close: Callable[[], None] = lambda: None
    seconds: float = 0.0
    lost: list[str] = field(default_factory=list)


def storage_of(path: Path) -> str:
    """Say how a file stores messages, by its first bytes; empty if it is no bag."""
    try:
        with path.open("rb") as stream:
            head = stream.read(16)
    except OSError:
        return ""
    return next((name for magic, name in MAGIC.items() if head.startswith(magic)), "")
