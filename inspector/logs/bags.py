"""Log of a ROS bag: the topics that hold a robot's motion, read by rosbags where it is intact."""

from collections.abc import Collection, Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from inspector.errors import LogError
from inspector.logs.damaged import Bag, Message, Unpacking, begin, open_bag, storage_of, unpack
from inspector.logs.log import Log, LogReader, Progress
from inspector.logs.mapping import ReadOptions
from inspector.logs.messages import (
    DESCRIPTION,
    TOPIC_READERS,
    Descriptions,
    Topic,
    TopicReader,
    topic_reader,
)
from inspector.logs.names import listed
from inspector.text import counted
from noisemodel.runfile import ArchiveError, one_line

LATEST = 2**62
"""Stamps lie before, in [ns]; differences of later ones are no 64-bit integers."""
METADATA = 4 * 2**20
"""Most bytes of a metadata.yaml: it has some hundred for each topic."""

Bytes = bytes | bytearray | memoryview


class DamagedError(Exception):
    """A bag that rosbags cannot read; parts of it may be readable."""


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of a bag: the folder of a ROS 2 bag, one of its files, or a ROS 1 bag."""
    return LogReader(
        "ROS bag", ("",), lambda _, progress: _read(path, options, progress), lambda: _listing(path)
    )


def _bag(path: Path) -> Bag:
    try:
        return _intact(path)
    except DamagedError as error:
        return open_bag(path, str(error))


def _read(path: Path, options: ReadOptions, progress: Progress) -> Log:
    try:
        try:
            with closing(_bag(path)) as bag:
                return _log_of(path, bag, options, progress)
        except DamagedError as error:  # rosbags could open it
            return _log_of(path, open_bag(path, str(error)), options, progress)
    except ArchiveError as error:
        raise LogError(path, str(error)) from error


def _log_of(path: Path, bag: Bag, options: ReadOptions, progress: Progress) -> Log:
    chosen = dict(_chosen(path, bag, options))
    odd = 0
    total = sum(max(bag.topics[name].count, 0) for name in chosen)
    for name, received, data in progress(bag.messages(chosen), total):
        if isinstance(received, int) and abs(received) < LATEST and isinstance(data, Bytes):
            chosen[name].add(received, bytes(data))
        else:
            odd += 1
    if odd:
        bag.lost.append(f"{odd} messages without data, or with stamps after 2116, are left out")
    fields = [field for reader in chosen.values() for field in reader.fields()]
    if not any(field.signal.startswith(("position", "velocity")) for field in fields):
        raise LogError(path, f"no message holds joints; {_contents(bag)}")
    urdfs = [each.urdf for each in chosen.values() if isinstance(each, Descriptions) and each.urdf]
    not_read = (
        f"{topic.name} ({topic.type if topic.count else 'no messages'})"
        for topic in bag.topics.values()
        if topic.name not in chosen or topic.count == 0
    )
    return Log(
        path,
        tuple(field for field in fields if field.signal),
        not_read=tuple(not_read),
        remarks=tuple(bag.lost),
        urdf=urdfs[-1] if urdfs else "",
        meta={"topics": sorted({field.source for field in fields})},
    )


def _chosen(path: Path, bag: Bag, options: ReadOptions) -> Iterator[tuple[str, TopicReader]]:
    for name in options.topics:
        if name not in bag.topics:
            raise LogError(path, f"there is no topic {name!r}; {_contents(bag)}")
        if bag.topics[name].type not in TOPIC_READERS:
            raise LogError(
                path,
                f"{name} is a {bag.topics[name].type}; types that are read are"
                f" {', '.join(TOPIC_READERS)}",
            )
    found = False
    for topic in bag.topics.values():
        described = topic.name.endswith(DESCRIPTION)
        if not options.topics or topic.name in options.topics or described:
            reader = topic_reader(path, topic, ros1=bag.ros1)
            if reader and topic.count:
                found = True
                yield topic.name, reader
    if not found:
        raise LogError(path, f"no topic holds joints; {_contents(bag)}")


def _contents(bag: Bag) -> str:
    topics = [f"{topic.name} ({topic.type})" for topic in bag.topics.values()]
    return f"the bag has {listed(topics) or 'no topics'}"


def _listing(path: Path) -> tuple[str, ...]:
    """Topics with type, count and rate, and whether they are read, a line each."""
    try:
        with closing(_bag(path)) as bag:
            rows = []
            for topic in sorted(bag.topics.values(), key=lambda each: each.name):
                count = counted(topic.count, "message") if topic.count >= 0 else "not counted"
                several = topic.count > 1 and bag.seconds
                rate = f"{topic.count / bag.seconds:.6g} Hz" if several else ""
                known = topic.type in TOPIC_READERS or topic.name.endswith(DESCRIPTION)
                words = (topic.name, topic.type, count, rate, "read" if known else "not read")
                rows.append("  ".join(filter(None, words)))
            return (*rows, *bag.lost)
    except ArchiveError as error:
        raise LogError(path, str(error)) from error


def _intact(path: Path) -> Bag:
    """Bag that is open for reading by rosbags."""
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

    _bound_rosbags()
    begin(path)
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
        raise DamagedError(one_line(error).rstrip(".")) from error
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
    return Bag(ros1, topics, partial(_messages, path, reader), reader.close, seconds)


def _problem(reader: Any) -> str:
    """What is wrong with what rosbags has taken unchecked from a bag; empty if nothing is."""
    texts = (text for each in reader.connections for text in (each.topic, each.msgtype))
    if not all(isinstance(text, str) for text in texts):
        return "a topic has no name or no type"
    counts = (reader.duration, *(each.msgcount for each in reader.connections))
    if not all(isinstance(count, int) and abs(count) < 2**64 for count in counts):
        return "the duration or the messages of a topic are no whole number of 64 bits"
    storages = [*getattr(reader, "storages", ()), getattr(reader, "storage", None)]
    for storage in filter(None, storages):
        places = [each.chunk_start_offset for each in getattr(storage, "chunks", ())]
        if len(set(places)) < len(places):
            return "its index lists a chunk several times"
    for index in getattr(reader, "indexes", {}).values():
        if len({(each.chunk_pos, each.offset) for each in index}) < len(index):
            return "its index lists a message several times"
    return ""


def _messages(path: Path, reader: Any, names: Collection[str]) -> Iterator[Message]:
    """Messages to the end, or to where the bag is damaged."""
    wanted = [each for each in reader.connections if each.topic in names]
    expected, count = sum(each.msgcount for each in wanted), 0
    begin(path)
    try:
        if wanted:
            for connection, received, data in reader.messages(wanted):
                yield connection.topic, received, data
                count += 1
    except ArchiveError:
        raise
    except Exception as error:
        raise DamagedError(
            f"{count} of {expected} messages can be read ({one_line(error).rstrip('.')})"
        ) from error


def _bound_rosbags() -> None:
    """Let rosbags unpack within the limit: its own functions have none."""
    from rosbags.rosbag1 import reader as reader1
    from rosbags.rosbag2 import reader as reader2
    from rosbags.rosbag2 import storage_mcap

    own: Any = (reader1.decompressors, storage_mcap.DECOMPRESSORS)
    for method in ("bz2", "lz4"):
        own[0][method] = lambda data, method=method: unpack(method, data)
    for method in ("lz4", "zstd"):
        own[1][method] = lambda data, _, method=method: unpack(method, data)
    zstd = SimpleNamespace(
        open=lambda stream, _: Unpacking("zstd", stream),
        decompress=lambda data: unpack("zstd", data),
    )
    vars(reader2)["zstd"] = zstd
