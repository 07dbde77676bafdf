"""Bags that rosbags cannot open, as it is with damaged ones, read record by record."""

import sqlite3
from collections import deque
from collections.abc import Collection, Iterator
from contextlib import closing
from pathlib import Path

from inspector.errors import LogError
from inspector.logs.ros import mcaprecords, ros1records
from inspector.logs.ros.bag import Bag, Message, Topic, storage_of


def open_bag(path: Path, problem: str) -> Bag:
    """Bag with the intact records of a damaged one.

    Args:
        path: A file of a bag, or the folder of a ROS 2 bag.
        problem: Why it cannot be read by its index.

    Raises:
        LogError: If no topic can be read.
    """
    files = sorted(each for each in path.iterdir() if storage_of(each)) if path.is_dir() else [path]
    storages = {storage_of(file) for file in files}
    if len(storages) != 1 or storages == {""}:
        raise LogError(path, f"not a bag that can be read: {problem}")
    storage = storages.pop()
    whole = storage == "MCAP" and all(mcaprecords.is_whole(file) for file in files)
    kind = storage if whole else f"damaged bag ({storage})"
    bag = Bag(kind, storage == "ROS 1", {}, lambda names: iter(()))
    if not whole:
        bag.lost.append(f"the bag is damaged or cut off ({problem})")
    for file in files:
        bag.topics |= {topic.name: topic for topic in _topics(file, storage, bag)}
    bag.messages = lambda names: _messages(files, storage, bag, names, whole=whole)
    if not bag.topics:
        raise LogError(path, f"no topic of the bag can be read: {problem}")
    return bag


def _topics(file: Path, storage: str, bag: Bag) -> Iterator[Topic]:
    if storage == "SQLite":
        yield from _sqlite_topics(file)
    else:
        records = mcaprecords if storage == "MCAP" else ros1records
        yield from records.topics(file)


def _messages(
    files: Collection[Path], storage: str, bag: Bag, names: Collection[str], *, whole: bool
) -> Iterator[Message]:
    count = 0
    for file in files:
        if storage == "SQLite":
            found = _sqlite_messages(file, bag.lost)
        else:
            records = mcaprecords if storage == "MCAP" else ros1records
            found = records.messages(file, bag.lost)
        for message in found:
            if message[0] in names:
                yield message
                count += 1
    if not whole:
        bag.lost.append(f"{count} messages were recovered")


def _sqlite_topics(file: Path) -> Iterator[Topic]:
    with closing(_database(file)) as database:
        try:
            tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master")}
            definitions = {}
            if "message_definitions" in tables:
                rows = "SELECT topic_type, encoded_message_definition FROM message_definitions"
                definitions = dict(database.execute(rows))
            for name, kind in database.execute("SELECT name, type FROM topics"):
                if isinstance(name, str) and isinstance(kind, str):
                    definition = definitions.get(kind)
                    yield Topic(name, kind, definition if isinstance(definition, str) else "")
        except sqlite3.DatabaseError as error:
            problem = " ".join(str(error).split())[:100]
            raise LogError(file, f"no topic of the bag can be read: {problem}") from error


def _sqlite_messages(file: Path, lost: list[str]) -> Iterator[Message]:
    """Messages in the order of their rows, to where a page is missing.

    The last page may be cut off, and SQLite reads zeros for the rest of it: messages are held
    back until a page of data follows them.
    """
    with closing(_database(file)) as database:
        held: deque[Message] = deque()
        try:
            (page,) = database.execute("PRAGMA page_size").fetchone()
            names = dict(database.execute("SELECT id, name FROM topics"))
            size = 0
            rows = "SELECT topic_id, timestamp, data FROM messages"
            for topic, received, data in database.execute(rows):
                if not (isinstance(received, int) and isinstance(data, bytes)):
                    continue  # a row that is damaged itself
                held.append((names.get(topic, ""), received, data))
                size += len(data)
                while size - len(held[0][2]) > page:
                    size -= len(held[0][2])
                    yield held.popleft()
        except sqlite3.DatabaseError as error:
            lost.append(f"{file.name} ends here, {len(held)} messages may be cut ({error})")
            held.clear()
        yield from held


def _database(file: Path) -> sqlite3.Connection:
    """Database that may be shorter than its header states."""
    database = sqlite3.connect(f"{file.resolve().as_uri()}?immutable=1", uri=True)
    database.execute("PRAGMA writable_schema = ON")  # otherwise SQLite refuses to open it
    return database
