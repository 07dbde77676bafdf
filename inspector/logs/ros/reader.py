"""A bag becomes a log: the topics that hold a robot's motion."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from inspector.errors import LogError
from inspector.logs.columns import listed
from inspector.logs.log import Log
from inspector.logs.opened import Opened, Watch
from inspector.logs.reading import Reading
from inspector.logs.ros import intact, salvage
from inspector.logs.ros.bag import Bag, Topic
from inspector.logs.ros.messages import DESCRIPTION, GATHERERS, Descriptions, Gatherer, gatherer_of


def open_log(path: Path, reading: Reading) -> Opened:
    """Offer a bag.

    Args:
        path: The folder of a ROS 2 bag, one of its files, or a ROS 1 bag.
        reading: What a person said of it; topics are chosen by it.
    """
    return Opened(
        "ROS bag", ("",), lambda _, watch: _read(path, reading, watch), lambda: _listing(path)
    )


def _bag(path: Path) -> Bag:
    try:
        return intact.open_bag(path)
    except intact.DamagedError as error:
        return salvage.open_bag(path, str(error))


def _read(path: Path, reading: Reading, watch: Watch) -> Log:
    try:
        with closing(_bag(path)) as bag:
            return _gathered(path, bag, reading, watch)
    except intact.DamagedError as error:  # it was whole to the eye
        return _gathered(path, salvage.open_bag(path, str(error)), reading, watch)


def _gathered(path: Path, bag: Bag, reading: Reading, watch: Watch) -> Log:
    chosen = dict(_chosen(path, bag, reading))
    total = sum(max(bag.topics[name].count, 0) for name in chosen)
    for name, received, data in watch(bag.messages(chosen), total):
        chosen[name].add(received, data)
    fields = [field for gatherer in chosen.values() for field in gatherer.fields()]
    if not any(field.signal.startswith(("position", "velocity")) for field in fields):
        raise LogError(path, f"no message holds joints; {_contents(bag)}")
    urdfs = [each.urdf for each in chosen.values() if isinstance(each, Descriptions) and each.urdf]
    left = (
        f"{topic.name} ({topic.type if topic.count else 'no messages'})"
        for topic in bag.topics.values()
        if topic.name not in chosen or topic.count == 0
    )
    return Log(
        path,
        tuple(field for field in fields if field.signal),
        left=tuple(left),
        remarks=tuple(bag.lost),
        urdf=urdfs[-1] if urdfs else "",
        meta={"topics": sorted({field.source for field in fields})},
    )


def _chosen(path: Path, bag: Bag, reading: Reading) -> Iterator[tuple[str, Gatherer]]:
    for name in reading.topics:
        if name not in bag.topics:
            raise LogError(path, f"there is no topic {name!r}; {_contents(bag)}")
        if bag.topics[name].type not in GATHERERS:
            raise LogError(
                path,
                f"{name} is a {bag.topics[name].type}; types that are read are"
                f" {', '.join(GATHERERS)}",
            )
    found = False
    for topic in bag.topics.values():
        described = topic.name.endswith(DESCRIPTION)
        if not reading.topics or topic.name in reading.topics or described:
            gatherer = gatherer_of(path, topic, ros1=bag.ros1)
            if gatherer and topic.count:
                found = True
                yield topic.name, gatherer
    if not found:
        raise LogError(path, f"no topic holds joints; {_contents(bag)}")


def _contents(bag: Bag) -> str:
    topics = [f"{topic.name} ({topic.type})" for topic in bag.topics.values()]
    return f"the bag has {listed(topics) or 'no topics'}"


def _listing(path: Path) -> tuple[str, ...]:
    """List topics with type, count and rate, and whether they are read."""
    with closing(_bag(path)) as bag:
        return _rows(bag)


def _rows(bag: Bag) -> tuple[str, ...]:
    rows = []
    for topic in sorted(bag.topics.values(), key=lambda each: each.name):
        count = f"{topic.count} messages" if topic.count >= 0 else "not counted"
        rate = f"{topic.count / bag.seconds:.6g} Hz" if topic.count > 1 and bag.seconds else ""
        read = "read" if _is_read(topic) else "not read"
        rows.append("  ".join(filter(None, (topic.name, topic.type, count, rate, read))))
    return (*rows, *bag.lost)


def _is_read(topic: Topic) -> bool:
    return topic.type in GATHERERS or topic.name.endswith(DESCRIPTION)
