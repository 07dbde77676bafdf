"""Log of a bag: the topics that hold a robot's motion."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import cast

from inspector.errors import LogError
from inspector.logs.log import Log, LogReader, Progress
from inspector.logs.options import ReadOptions
from inspector.logs.ros import damaged, intact
from inspector.logs.ros.bag import Bag, Topic
from inspector.logs.ros.messages import (
    DESCRIPTION,
    TOPIC_READERS,
    Descriptions,
    TopicReader,
    topic_reader,
)
from inspector.logs.signals import listed
from inspector.text import counted
from noisemodel.archive import ArchiveError

LATEST = 2**62
"""Stamps lie before, in [ns]; differences of later ones are no 64-bit integers."""

Bytes = bytes | bytearray | memoryview


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of a bag.

    Args:
        path: The folder of a ROS 2 bag, one of its files, or a ROS 1 bag.
        options: How to read it, including which topics.
    """
    return LogReader(
        "ROS bag", ("",), lambda _, progress: _read(path, options, progress), lambda: _listing(path)
    )


def _bag(path: Path) -> Bag:
    try:
        return intact.open_bag(path)
    except intact.DamagedError as error:
        return damaged.open_bag(path, str(error))


def _read(path: Path, options: ReadOptions, progress: Progress) -> Log:
    try:
        try:
            with closing(_bag(path)) as bag:
                return _log_of(path, bag, options, progress)
        except intact.DamagedError as error:  # rosbags could open it
            return _log_of(path, damaged.open_bag(path, str(error)), options, progress)
    except ArchiveError as error:
        raise LogError(path, str(error)) from error


def _log_of(path: Path, bag: Bag, options: ReadOptions, progress: Progress) -> Log:
    chosen = dict(_chosen(path, bag, options))
    odd = 0
    total = sum(max(bag.topics[name].count, 0) for name in chosen)
    for name, received, data in progress(bag.messages(chosen), total):
        if isinstance(received, int) and abs(received) < LATEST and isinstance(data, Bytes):
            chosen[name].add(received, cast("bytes", data))
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
            return _rows(bag)
    except ArchiveError as error:
        raise LogError(path, str(error)) from error


def _rows(bag: Bag) -> tuple[str, ...]:
    rows = []
    for topic in sorted(bag.topics.values(), key=lambda each: each.name):
        count = counted(topic.count, "message") if topic.count >= 0 else "not counted"
        rate = f"{topic.count / bag.seconds:.6g} Hz" if topic.count > 1 and bag.seconds else ""
        read = "read" if _is_read(topic) else "not read"
        rows.append("  ".join(filter(None, (topic.name, topic.type, count, rate, read))))
    return (*rows, *bag.lost)


def _is_read(topic: Topic) -> bool:
    return topic.type in TOPIC_READERS or topic.name.endswith(DESCRIPTION)
