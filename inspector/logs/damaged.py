"""Bags of any storage read record by record, as damaged ones are, and no more than they may hold.

An MCAP file that was cut off has lost the index at its end; rosbags refuses one with other messages
than ROS has, as Foxglove writes it. https://mcap.dev/spec
A record of ROS 1 is a header of ``name=value`` fields and data, each with its length before it;
chunks hold records in turn, perhaps compressed. http://wiki.ros.org/Bags/Format/2.0
"""

import bz2
import sqlite3
import struct
from collections import deque
from collections.abc import Callable, Collection, Iterator
from contextlib import closing, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, Self, TypeAlias

from mcap.records import Channel, Chunk, McapRecord, Schema
from mcap.records import Message as McapMessage
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk

from inspector.errors import LogError
from inspector.logs.messages import Topic
from noisemodel.runfile import PIECE, ArchiveError, check_unpacked, one_line

STORAGES = {b"\x89MCAP0\r\n": "MCAP", b"SQLite format 3\x00": "SQLite", b"#ROSBAG V2.0": "ROS 1"}
"""Storages of bags by the first bytes of their files."""
MCAP_MAGIC = b"\x89MCAP0\r\n"
"""The bytes with which an MCAP file begins and ends."""
MESSAGE, CHUNK, CONNECTION = b"\x02", b"\x05", b"\x07"
"""Kinds of records of ROS 1."""

Message: TypeAlias = tuple[str, int, bytes]
"""Topic, time of reception in [ns], and the serialised message."""


@dataclass(frozen=True)
class Bag:
    """A bag that is open for reading, independent of its storage.

    Attributes:
        ros1: Whether messages are serialised in the format of ROS 1.
        topics: Its topics by name.
        messages: Iterates over the messages of some topics.
        close: Closes the file.
        seconds: Time from first to last message, in [s]; 0 if unknown.
        lost: What could not be read, a sentence each; complete after all messages are read.
    """

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
    return next((name for magic, name in STORAGES.items() if head.startswith(magic)), "")


# Chunks, unpacked piece by piece

_size: ContextVar[int] = ContextVar("size", default=0)
_unpacked: ContextVar[int] = ContextVar("unpacked", default=0)


def begin(path: Path) -> None:
    """Begin to read a bag, a file or a folder: what has been unpacked is counted from here."""
    files = [each for each in path.iterdir() if each.is_file()] if path.is_dir() else [path]
    _size.set(sum(each.stat().st_size for each in files))
    _unpacked.set(0)


def unpack(method: str, data: bytes) -> bytes:
    """Unpack a chunk."""
    if method not in METHODS:
        return data
    with Unpacking(method, BytesIO(data)) as stream:
        return b"".join(iter(lambda: stream.read(PIECE), b""))


class Unpacking:
    """A stream that is unpacked, by one of ``METHODS``, while it is read."""

    def __init__(self, method: str, stream: BinaryIO) -> None:
        self._stream = METHODS[method](stream)

    def read(self, size: int) -> bytes:
        """Read up to so many bytes, within the limit of `unpack`."""
        piece: bytes = self._stream.read(min(size, PIECE))
        _unpacked.set(_unpacked.get() + len(piece))
        check_unpacked(_unpacked.get(), _size.get())
        return piece

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()


def _lz4(stream: BinaryIO) -> Any:
    import lz4.frame

    return lz4.frame.open(stream)


def _zstd(stream: BinaryIO) -> Any:
    import zstandard

    return zstandard.ZstdDecompressor().stream_reader(stream, read_across_frames=True)


METHODS: dict[str, Callable[[BinaryIO], Any]] = {"bz2": bz2.open, "lz4": _lz4, "zstd": _zstd}
"""What opens a compressed stream, by the name that bags have for it."""


# Bags without their index


def open_bag(path: Path, problem: str) -> Bag:
    """Bag with the intact records of one that rosbags cannot open, or not read to its end."""
    files = sorted(each for each in path.iterdir() if storage_of(each)) if path.is_dir() else [path]
    storages = {storage_of(file) for file in files}
    if len(storages) != 1 or storages == {""}:
        raise LogError(path, f"not a bag that can be read: {problem}")
    storage = storages.pop()
    topics, messages = READERS[storage]
    whole = storage == "MCAP" and all(is_whole_mcap(file) for file in files)
    lost = [] if whole else [f"the bag is damaged or cut off ({problem})"]
    found = {topic.name: topic for file in files for topic in topics(file)}
    if not found:
        raise LogError(path, f"no topic of the bag can be read: {problem}")

    def chosen(names: Collection[str]) -> Iterator[Message]:
        count = 0
        for file in files:
            for message in messages(file, lost):
                if message[0] in names:
                    yield message
                    count += 1
        if not whole:
            lost.append(f"{count} messages were recovered")

    return Bag(storage == "ROS 1", found, chosen, lost=lost)


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


def is_whole_mcap(path: Path) -> bool:
    """Whether an MCAP file was written to its end."""
    with path.open("rb") as stream:
        stream.seek(max(0, path.stat().st_size - len(MCAP_MAGIC)))
        return stream.read() == MCAP_MAGIC


def mcap_topics(path: Path) -> Iterator[Topic]:
    """Topics of intact records."""
    schemas: dict[int, Schema] = {}
    for record in _mcap_records(path, []):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            schema = schemas.get(record.schema_id)
            text = schema.data.decode(errors="replace") if schema else ""
            yield Topic(record.topic, schema.name if schema else "", text)


def mcap_messages(path: Path, lost: list[str]) -> Iterator[Message]:
    """Messages of intact records; what was lost is appended to ``lost``, a sentence each."""
    channels: dict[int, str] = {}
    for record in _mcap_records(path, lost):
        if isinstance(record, Channel):
            channels[record.id] = record.topic
        elif isinstance(record, McapMessage) and record.channel_id in channels:
            yield channels[record.channel_id], record.log_time, record.data


def _mcap_records(path: Path, lost: list[str]) -> Iterator[McapRecord]:
    """Records, including those in chunks, to where the file ends or is damaged."""
    begin(path)
    size, place = path.stat().st_size, 0  # no record is longer than its file
    with path.open("rb") as stream:
        reader = StreamReader(stream, emit_chunks=True, validate_crcs=True, record_size_limit=size)
        try:
            for record in reader.records:
                if isinstance(record, Chunk):
                    yield from _mcap_unpacked(record, lost)
                else:
                    yield record
                place = stream.tell()
        except ArchiveError:
            raise
        except CRCValidationError as error:  # all messages have been read by then
            lost.append(f"some of what was read is damaged ({error})")
        except Exception as error:  # the library lets errors of struct and of text through
            lost.append(f"from byte {place} on the file is damaged or cut off ({one_line(error)})")


def _mcap_unpacked(chunk: Chunk, lost: list[str]) -> list[McapRecord]:
    try:
        raw = unpack(chunk.compression, chunk.data)
        return breakup_chunk(replace(chunk, compression="", data=raw), validate_crc=True)
    except ArchiveError:
        raise
    except Exception:  # each compressor has errors of its own
        lost.append(f"a chunk of {len(chunk.data)} bytes is damaged and left out")
        return []


def _ros1_topics(path: Path) -> Iterator[Topic]:
    begin(path)
    with path.open("rb") as stream:
        for header, data in _ros1_records(stream, []):
            if header.get("op") == CONNECTION and "topic" in header:
                with suppress(struct.error, KeyError):  # a record that is damaged itself
                    fields = _fields(data)
                    package, _, name = fields["type"].decode(errors="replace").partition("/")
                    definition = fields["message_definition"].decode(errors="replace")
                    yield Topic(_topic(header), f"{package}/msg/{name}", definition)


def _ros1_messages(path: Path, lost: list[str]) -> Iterator[Message]:
    names: dict[bytes, str] = {}
    begin(path)
    with path.open("rb") as stream:
        for header, data in _ros1_records(stream, lost):
            number, time = header.get("conn", b""), header.get("time", b"")
            if header.get("op") == CONNECTION and "topic" in header:
                names[number] = _topic(header)
            elif header.get("op") == MESSAGE and number in names and len(time) == 8:
                seconds, fraction = struct.unpack("<II", time)
                yield names[number], seconds * 10**9 + fraction, data


def _topic(header: dict[str, bytes]) -> str:
    name = header["topic"].decode(errors="replace")
    return "/" * name.startswith("/") + "/".join(part for part in name.split("/") if part)


def _ros1_records(stream: BinaryIO, lost: list[str]) -> Iterator[tuple[dict[str, bytes], bytes]]:
    """Records, including those in chunks, to where the file ends or is damaged."""
    size = stream.seek(0, 2)
    stream.seek(0)
    stream.readline()
    while (place := stream.tell()) < size:
        try:
            header, data = _fields(_sized(stream)), _sized(stream)
            records = [(header, data)]
            if header["op"] == CHUNK:
                chunk = unpack(header["compression"].decode(), data)
                inner, records = BytesIO(chunk), []
                while inner.tell() < len(chunk):
                    records.append((_fields(_sized(inner)), _sized(inner)))
        except ArchiveError:
            raise
        except Exception as error:  # each compressor has errors of its own
            lost.append(f"from byte {place} on the file is damaged or cut off ({one_line(error)})")
            return
        yield from records


def _sized(stream: BinaryIO) -> bytes:
    (length,) = struct.unpack("<I", stream.read(4))
    data = stream.read(length)
    if len(data) < length:
        raise EOFError(f"{len(data)} of {length} bytes are there")
    return data


def _fields(header: bytes) -> dict[str, bytes]:
    fields, place = {}, 0
    while place < len(header):
        (length,) = struct.unpack_from("<I", header, place)
        name, _, value = header[place + 4 : place + 4 + length].partition(b"=")
        fields[name.decode(errors="replace")] = value
        place += 4 + length
    return fields


READERS: dict[
    str,
    tuple[Callable[[Path], Iterator[Topic]], Callable[[Path, list[str]], Iterator[Message]]],
] = {
    "SQLite": (_sqlite_topics, _sqlite_messages),
    "MCAP": (mcap_topics, mcap_messages),
    "ROS 1": (_ros1_topics, _ros1_messages),
}
"""What reads the topics, and the messages, of a file of each storage."""
