"""Undamaged bags, read by rosbags."""

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from inspector.logs.ros import chunks
from inspector.logs.ros.bag import Bag, Message, Topic, storage_of
from noisemodel.archive import ArchiveError

METADATA = 4 * 2**20
"""Most bytes of a metadata.yaml: it has some hundred for each topic."""


class DamagedError(Exception):
    """A bag that rosbags cannot read; parts of it may be readable."""


def open_bag(path: Path) -> Bag:
    """Bag that is open for reading.

    Args:
        path: The folder of a ROS 2 bag, one of its files, or a ROS 1 bag.

    Raises:
        DamagedError: If rosbags cannot open it.
        ArchiveError: If it unpacks to more than is read, then or when messages are read.
    """
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

    chunks.bound_rosbags()
    chunks.begin(path)
    about = (path if path.is_dir() else path.parent) / "metadata.yaml"
    if about.is_file() and about.stat().st_size > METADATA:
        raise DamagedError(f"metadata.yaml has more than {METADATA} bytes")
    ros1 = path.is_file() and storage_of(path) == "ROS 1"
    try:
        reader: Any = (Reader1 if ros1 else Reader2)(path)
        reader.open()
    except ArchiveError:
        raise
    except Exception as error:  # rosbags lets struct's, SQLite's and its own errors through
        raise DamagedError(_one_line(error)) from error
    if problem := _problem(reader):
        reader.close()
        raise DamagedError(problem)
    topics: dict[str, Topic] = {}
    for connection in reader.connections:
        before = topics.get(connection.topic)
        count = connection.msgcount + (before.count if before else 0)
        topics[connection.topic] = Topic(
            connection.topic, connection.msgtype, connection.msgdef.data, count
        )
    seconds = reader.duration * 1e-9 if any(topic.count for topic in topics.values()) else 0.0
    kind = "ROS 1 bag" if ros1 else "ROS 2 bag"
    bag = Bag(kind, ros1, topics, lambda names: iter(()), reader.close, seconds)
    bag.messages = lambda names: _messages(path, reader, bag, names)
    return bag


def _problem(reader: Any) -> str:
    """What is wrong with what rosbags has taken unchecked from a bag; empty if nothing is."""
    texts = (text for each in reader.connections for text in (each.topic, each.msgtype))
    if not all(isinstance(text, str) for text in texts):
        return "a topic has no name or no type"
    counts = (reader.duration, *(each.msgcount for each in reader.connections))
    if not all(isinstance(count, int) and abs(count) < 2**64 for count in counts):
        return "the duration or the messages of a topic are no whole number of 64 bits"
    return ""


def _messages(path: Path, reader: Any, bag: Bag, names: Collection[str]) -> Iterator[Message]:
    """Messages to the end, or to where the bag is damaged."""
    wanted = [each for each in reader.connections if each.topic in names]
    expected, count = sum(each.msgcount for each in wanted), 0
    chunks.begin(path)
    try:
        if wanted:
            for connection, received, data in reader.messages(wanted):
                yield connection.topic, received, data
                count += 1
    except ArchiveError:
        raise
    except Exception as error:
        raise DamagedError(
            f"{count} of {expected} messages can be read ({_one_line(error)})"
        ) from error


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()).rstrip(".") or type(error).__name__
