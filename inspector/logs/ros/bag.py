"""Topics and serialised messages of a bag, independent of its storage."""

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

MAGIC = {b"\x89MCAP0\r\n": "MCAP", b"SQLite format 3\x00": "SQLite", b"#ROSBAG V2.0": "ROS 1"}
"""The first bytes of the files that bags are stored in."""

Message: TypeAlias = tuple[str, int, bytes]
"""Topic, time of reception in [ns], and the serialised message."""


@dataclass(frozen=True)
class Topic:
    """A topic of a bag.

    Attributes:
        name: Its name.
        type: Type of its messages, as ROS 2 writes it: ``sensor_msgs/msg/JointState``.
        definition: Text of the type's definition, empty if the bag has none.
        count: Number of messages, -1 if unknown.
    """

    name: str
    type: str
    definition: str = ""
    count: int = -1


@dataclass
class Bag:
    """A bag that is open for reading.

    Attributes:
        kind: Name of its kind.
        ros1: Whether messages are serialised in the format of ROS 1.
        topics: Its topics by name.
        messages: Iterates over the messages of some topics.
        close: Closes the file.
        seconds: Time from first to last message, in [s]; 0 if unknown.
        lost: What could not be read, a sentence each; complete after all messages are read.
    """

    kind: str
    ros1: bool
    topics: dict[str, Topic]
    messages: Callable[[Collection[str]], Iterator[Message]]
    close: Callable[[], None] = lambda: None
    seconds: float = 0.0
    lost: list[str] = field(default_factory=list)


def storage_of(path: Path) -> str:
    """Storage of a file, by its first bytes; empty if it is not a bag."""
    try:
        with path.open("rb") as stream:
            head = stream.read(16)
    except OSError:
        return ""
    return next((name for magic, name in MAGIC.items() if head.startswith(magic)), "")
