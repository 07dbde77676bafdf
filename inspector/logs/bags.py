"""Log of a ROS bag: its records one by one, to where the file ends or is damaged.

Neither an index nor a ``metadata.yaml`` is read: a bag that was cut off has lost them, and they may
state anything.
MCAP: https://mcap.dev/spec
A record of ROS 1 is a header of ``name=value`` fields and data, each with its length before it;
chunks hold records in turn, perhaps compressed. http://wiki.ros.org/Bags/Format/2.0
Messages are deserialised by the definitions that are known here, never by the one in a bag: that is
code for a decoder.
"""

import bz2
import sqlite3
import struct
from array import array
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from decimal import Decimal
from functools import cache
from io import BytesIO
from math import nan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO, TypeAlias, TypeVar

import lz4.frame
import numpy as np
from mcap.records import Channel, Chunk, McapRecord, Schema
from mcap.records import Message as McapMessage
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from zstandard import ZstdDecompressor

from inspector.errors import LogError
from inspector.logs.mapping import Field, Log, LogReader, ReadOptions, Stamps, errors_of
from inspector.logs.names import listed
from inspector.text import counted, natural
from noisemodel.runfile import PIECE, ArchiveError, check_unpacked, one_line

T = TypeVar("T")

SQL_ERRORS = (sqlite3.Error, UnicodeError)  # its words may quote bytes that are no text
JOINT_STATE = "sensor_msgs/msg/JointState"
STATE = "control_msgs/msg/JointTrajectoryControllerState"
ODOMETRY = "nav_msgs/msg/Odometry"

# A JointState topic with one of these in its name holds desired motion.
COMMANDED = ("command", "desired", "target", "reference", "setpoint")
ARRAYS = ("position", "velocity", "effort")
POINT = {"positions": "position", "velocities": "velocity", "effort": "effort"}
# By the type of messages, signal and rank of each of its arrays.
MOTION: Mapping[str, Mapping[str, tuple[str, int]]] = {
    JOINT_STATE: {name: (name, 0) for name in ARRAYS},
    STATE: {
        f"{stage}/{name}": (f"{signal}{'_desired' * desired}", 1 - desired)
        for stage, desired in (("reference", 1), ("desired", 1), ("feedback", 0), ("actual", 0))
        for name, signal in POINT.items()
        if not (desired and signal == "effort")
    },
    ODOMETRY: {"pose": ("base_pose", 0), "twist": ("base_velocity", 0)},
}
RECORDER = "the messages have no stamps, those of the recorder are used"


# Messages of bytes


def _state(stages: tuple[str, ...], *, multi: bool = False, scaled: bool = False) -> str:
    """Definition of a controller's state with these stages; ``multi`` of joints of any kind."""
    point = "JointTrajectoryPoint"
    lines = ["std_msgs/Header header", "string[] joint_names"]
    lines += [f"trajectory_msgs/{point} {name}" for name in stages]
    if multi:
        lines.append("string[] multi_dof_joint_names")
        lines += [f"trajectory_msgs/MultiDOF{point} multi_dof_{name}" for name in stages]
    return "\n".join([*lines, "float64 speed_scaling_factor" * scaled])


OLD = ("desired", "actual", "error")
NEW = ("reference", "feedback", "error", "output")
BOTH = (*NEW, "desired", "actual")
# Versions of a controller's state: which one a bag has, its messages tell by their length.
STATES = (
    _state(NEW, multi=True, scaled=True),
    _state(BOTH, multi=True),
    _state(OLD, multi=True),
    _state(OLD),
    _state(NEW),
    _state(BOTH),
    _state(NEW, scaled=True),
)


@cache  # a store takes 20 ms to make
def _store(state: str, ros1: bool) -> Any:
    """Types of messages, a controller's state by one of its definitions."""
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    if state:
        store.register(get_types_from_msg(state, STATE))
    return store


def _row(kind: str, message: Any) -> tuple[tuple[str, ...], Mapping[str, Any]]:
    """What a message tells: joints, none of a base, and numbers by the array's name."""
    if kind == JOINT_STATE:
        return tuple(message.name), {name: getattr(message, name) for name in ARRAYS}
    if kind == ODOMETRY:  # pose of the base in the world, velocity in body axes
        pose, twist = message.pose.pose, message.twist.twist
        place, turn = pose.position, pose.orientation
        numbers = [place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]
        velocity = [getattr(part, axis) for part in (twist.linear, twist.angular) for axis in "xyz"]
        return (), {"pose": numbers, "twist": velocity}
    parts: dict[str, Any] = {}
    for stages in (("reference", "desired"), ("feedback", "actual")):
        for stage in stages:  # of the two names of a stage the one that is not empty
            point = getattr(message, stage, None)
            if point is not None and (len(point.positions) or len(point.velocities)):
                parts |= {f"{stage}/{name}": getattr(point, name, ()) for name in POINT}
                break
    return tuple(message.joint_names), parts


# Topics


@dataclass
class Group:
    """Messages about one set of joints, as rows of float64 numbers, nan where one lacks them."""

    joints: tuple[str, ...]  # in the order of the first message; none of a base
    arrays: dict[str, "array[float]"] = field(default_factory=dict)  # row after row
    logged: "array[int]" = field(default_factory=lambda: array("q"))  # in the headers, in [ns]
    received: "array[int]" = field(default_factory=lambda: array("q"))  # by the recorder


@dataclass(eq=False)
class Topic:
    """A topic of a bag, and the motion of joints or of a base in its messages.

    Publishers that share a topic, such as an arm's and a gripper's, have a group each.
    """

    name: str
    type: str  # written as in ROS 2: ``sensor_msgs/msg/JointState``
    ros1: bool = False  # whether messages are serialised in the format of ROS 1
    count: int = 0  # of its messages
    versions: Sequence[str] = STATES  # definitions of a controller's state that may be its own
    groups: dict[frozenset[str], Group] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.name} ({self.type})"

    def add(self, path: Path, received: int, data: bytes) -> None:
        """Add a message that was received at a time in [ns]."""
        message = self._decoded(path, data)
        joints, found = _row(self.type, message)
        # Arrays with another length than the joints are ignored.
        rows = {
            name: np.asarray(numbers, dtype=np.float64)
            for name, numbers in found.items()
            if self.type == ODOMETRY or len(numbers) == len(joints) > 0
        }
        if not rows:
            return
        group = self.groups.setdefault(frozenset(joints), Group(joints))
        lacking = array("d", [nan]) * len(joints)
        for name in rows:
            group.arrays.setdefault(name, lacking * len(group.received))
        stamp = message.header.stamp
        group.logged.append(int(stamp.sec) * 10**9 + int(stamp.nanosec))
        group.received.append(received)
        for name, numbers in group.arrays.items():
            row = rows.get(name)
            if row is not None and joints != group.joints:
                row = row[[joints.index(joint) for joint in group.joints]]
            numbers.frombytes((lacking if row is None else row).tobytes())

    def _decoded(self, path: Path, data: bytes) -> Any:
        """A message, by the version of its type that fits, which all others then have."""
        problem = ""
        for version in self.versions if self.type == STATE else ("",):
            store = _store(version, self.ros1)
            parse = store.deserialize_ros1 if self.ros1 else store.deserialize_cdr
            try:
                message = parse(data, self.type)
            except Exception as error:  # of a message that is damaged, rosbags lets any through
                problem = one_line(error)
                continue
            self.versions = (version,)
            return message
        raise LogError(path, f"{self.name}: a message is not a {self.type} ({problem})")

    def fields(self) -> Iterator[Field]:
        """Fields of the messages."""
        signals = MOTION[self.type]
        if self.type == JOINT_STATE and any(word in self.name.lower() for word in COMMANDED):
            signals = {name: (f"{name}_desired", 1) for name in ("position", "velocity")}
        for group in self.groups.values():
            received = np.frombuffer(group.received, dtype=np.int64)
            order: Any = slice(None)  # no copy of what is in order
            if (np.diff(received) < 0).any():
                order = np.argsort(received, kind="stable")
            logged = np.frombuffer(group.logged, dtype=np.int64)
            chosen = (logged if logged.any() else received)[order]
            first = int(chosen[0])
            remark, since = "" if logged.any() else RECORDER, np.multiply(chosen - first, 1e-9)
            stamps = Stamps(Decimal(first).scaleb(-9), since, remark=remark)
            for name, numbers in group.arrays.items():
                signal, rank = signals.get(name, ("", 0))
                values = np.frombuffer(numbers).reshape(len(received), -1)[order]
                array_name = f"{self.name}/{name}"
                yield Field(array_name, values, stamps, group.joints, signal, self.name, rank)


# Bags

LATEST = 2**62  # stamps lie before, in [ns]; differences of later ones are no 64-bit integers
Message: TypeAlias = tuple[str, int, bytes]  # topic, time of reception in [ns], serialised
# What opens a compressed stream, by the name that bags have for it.
METHODS: dict[str, Callable[[BinaryIO], Any]] = {
    "bz2": bz2.open,
    "lz4": lz4.frame.open,
    "zstd": lambda packed: ZstdDecompressor().stream_reader(packed, read_across_frames=True),
}
ZSTD = b"\x28\xb5\x2f\xfd"  # the first bytes of a file or a message that was compressed whole


class Bag:
    """What a bag holds, once all of it is read; unpacks its parts, within a limit on all of it."""

    def __init__(self, path: Path) -> None:
        self.topics: dict[str, Topic] = {}
        self.times: list[int] = []  # of the first and the last message, in [ns]
        self.lost: list[str] = []  # a sentence each
        files = [each for each in path.iterdir() if each.is_file()] if path.is_dir() else [path]
        self._packed, self._unpacked = sum(each.stat().st_size for each in files), 0

    def __str__(self) -> str:
        return f"the bag has {listed([*map(str, self.topics.values())]) or 'no topics'}"

    def pieces(self, method: str, stream: BinaryIO) -> Iterator[bytes]:
        """What a stream unpacks to, by one of ``METHODS``; damage raises an error of its own."""
        with METHODS[method](stream) as unpacked:
            while piece := unpacked.read(PIECE):
                self._unpacked += len(piece)
                check_unpacked(self._unpacked, self._packed)
                yield piece

    def chunk(self, method: str, data: bytes) -> bytes:
        """Unpack a chunk."""
        return b"".join(self.pieces(method, BytesIO(data))) if method in METHODS else data

    def message(self, data: bytes) -> bytes:
        """Unpack a message; nothing is left of one that is damaged."""
        try:
            return self.chunk("zstd", data)
        except ArchiveError:
            raise
        except Exception:  # each compressor has errors of its own
            return b""


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of a bag: the folder of a ROS 2 bag, one of its files, or a ROS 1 bag."""
    return LogReader("ROS bag", ("",), lambda _: _read(path, options), lambda: _listing(path))


def _listing(path: Path) -> tuple[str, ...]:
    """Topics with type, count and rate, and whether they are read, a line each."""
    bag, rows = _scanned(path, lambda name: False), []
    seconds = (bag.times[-1] - bag.times[0]) * 1e-9 if bag.times else 0.0
    for name, topic in sorted(bag.topics.items()):
        rate = f"{topic.count / seconds:.6g} Hz" if topic.count > 1 and seconds else ""
        read = "read" if topic.type in MOTION else "not read"
        words = (name, topic.type, counted(topic.count, "message"), rate, read)
        rows.append("  ".join(filter(None, words)))
    return (*rows, *bag.lost)


def _read(path: Path, options: ReadOptions) -> Log:
    chosen = options.topics
    bag = _scanned(path, lambda name: not chosen or name in chosen)
    for name in chosen:
        if name not in bag.topics or bag.topics[name].type not in MOTION:
            problem = f"there is no topic {name!r} of a type that is read ({', '.join(MOTION)})"
            raise LogError(path, f"{problem}; {bag}")
    moving = [n for n, topic in bag.topics.items() if topic.type in MOTION and topic.count]
    read = [name for name in moving if not chosen or name in chosen]
    if not read:
        raise LogError(path, f"no topic holds joints; {bag}")
    fields = [each for name in read for each in bag.topics[name].fields()]
    if not any(each.signal.startswith(("position", "velocity")) for each in fields):
        raise LogError(path, f"no message holds joints; {bag}")
    return Log(
        path,
        tuple(each for each in fields if each.signal),
        not_read=tuple(
            str(topic) if topic.count else f"{name} (no messages)"
            for name, topic in bag.topics.items()
            if name not in read
        ),
        remarks=tuple(bag.lost),
        meta={"topics": sorted({each.source for each in fields})},
        in_radians=True,  # REP 103
    )


def _scanned(path: Path, wanted: Callable[[str], bool]) -> Bag:
    """Contents of a bag, read through; readers have the messages of topics with wanted names."""
    bag, taken, odd = Bag(path), 0, 0
    with errors_of(path):
        for each in _records(path, bag):
            if isinstance(each, Topic):
                bag.topics.setdefault(each.name, each)
                continue
            name, received, data = each
            if (topic := bag.topics.get(name)) is None:
                continue  # the record that says its type is damaged
            topic.count += 1
            if abs(received) < LATEST:
                known = (received, *bag.times)
                bag.times[:] = min(known), max(known)
            if wanted(name) and topic.type in MOTION:
                if data.startswith(ZSTD) and not topic.ros1:
                    data = bag.message(data)
                if data and abs(received) < LATEST:
                    topic.add(path, received, data)
                    taken += 1
                else:
                    odd += 1
    if not bag.topics:
        why = f": {bag.lost[0]}" if bag.lost else ""
        raise LogError(path, f"no topic of the bag can be read{why}")
    bag.lost += [f"{taken} messages were recovered"] if bag.lost and taken else []
    if odd:
        bag.lost.append(f"{odd} messages without data, or with stamps after 2116, are left out")
    return bag


# Record by record


def _records(path: Path, bag: Bag) -> Iterator[Topic | Message]:
    """Topics and messages of a bag's files, in their order; tells the bag what was lost."""
    every = sorted(path.iterdir(), key=lambda file: natural(file.name)) if path.is_dir() else [path]
    with TemporaryDirectory() as folder:
        known = []
        for file in every:
            if (head := _head(file)).startswith(ZSTD):
                packed, file = file, Path(folder) / file.stem
                try:
                    with packed.open("rb") as source, file.open("wb") as target:
                        target.writelines(bag.pieces("zstd", source))
                except ArchiveError:
                    raise
                except Exception as error:  # of the compressor
                    bag.lost.append(f"the bag is damaged or cut off ({one_line(error)})")
                head = _head(file)
            known += [(file, magic) for magic in RECORDS if head.startswith(magic)]
        if len({magic for _, magic in known}) > 1:
            raise LogError(path, "holds files of several kinds of bags; name one of them")
        for file, magic in known:
            yield from RECORDS[magic](file, bag)


def _head(path: Path) -> bytes:
    """The first bytes of a file; none if it cannot be read, or is no file."""
    with suppress(OSError):
        if path.is_file():
            with path.open("rb") as stream:
                return stream.read(16)
    return b""


def _intact(stream: BinaryIO, records: Iterator[T], bag: Bag) -> Iterator[T]:
    """Records that are read from a stream, to where it ends or is damaged."""
    place = stream.tell()
    try:
        for record in records:
            yield record
            place = stream.tell()
    except ArchiveError:
        raise
    except CRCValidationError as error:  # all messages have been read by then
        bag.lost.append(f"some of what was read is damaged ({error})")
    except Exception as error:  # of compressors, of struct and of text, too
        where = f"from byte {place} on ({one_line(error)})"
        bag.lost.append(f"the bag is damaged or cut off {where}")


def _mcap(path: Path, bag: Bag) -> Iterator[Topic | Message]:
    schemas, channels = dict[int, str](), dict[int, str]()
    size = path.stat().st_size  # no record is longer than its file
    with path.open("rb") as stream:
        reader = StreamReader(stream, emit_chunks=True, validate_crcs=True, record_size_limit=size)
        for record in _intact(stream, reader.records, bag):
            for each in _unchunked(record, bag):
                if isinstance(each, Schema):
                    schemas[each.id] = each.name
                elif isinstance(each, Channel):
                    channels[each.id] = each.topic
                    yield Topic(each.topic, schemas.get(each.schema_id, ""))
                elif isinstance(each, McapMessage) and each.channel_id in channels:
                    yield channels[each.channel_id], each.log_time, each.data


def _unchunked(record: McapRecord, bag: Bag) -> list[McapRecord]:
    """The records of a chunk, or the record itself."""
    if not isinstance(record, Chunk):
        return [record]
    try:
        raw = bag.chunk(record.compression, record.data)
        return breakup_chunk(replace(record, compression="", data=raw), validate_crc=True)
    except ArchiveError:
        raise
    except Exception:  # each compressor has errors of its own
        bag.lost.append(f"a chunk of {len(record.data)} bytes is damaged and left out")
        return []


def _sqlite(path: Path, bag: Bag) -> Iterator[Topic | Message]:
    """Topics, then messages in the order of their rows, to where a page is missing.

    The last page may be cut off, and SQLite reads zeros for the rest of it: messages are held
    back until a page of data follows them.
    """
    held: deque[Message] = deque()
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?immutable=1", uri=True)) as database:
        try:
            try:
                database.execute("SELECT name FROM sqlite_master").fetchone()
            except SQL_ERRORS as error:
                bag.lost.append(f"the bag is damaged or cut off ({one_line(error)})")
            (page,) = database.execute("PRAGMA page_size").fetchone()
            database.execute("PRAGMA writable_schema = ON")  # else SQLite refuses such a file
            names = {}
            for place, name, kind in database.execute("SELECT id, name, type FROM topics"):
                if isinstance(name, str) and isinstance(kind, str):
                    names[place] = name
                    yield Topic(name, kind)
            size = 0
            messages = "SELECT topic_id, timestamp, data FROM messages"
            for topic, received, data in database.execute(messages):
                if topic in names:
                    when = received if isinstance(received, int) else LATEST
                    held.append((names[topic], when, data if isinstance(data, bytes) else b""))
                    size += len(held[-1][2])
                while held and size - len(held[0][2]) > page:
                    size -= len(held[0][2])
                    yield held.popleft()
        except SQL_ERRORS as error:
            cut = f"{len(held)} messages may be cut ({one_line(error)})"
            bag.lost.append(f"the bag ends here, {cut}")
            held.clear()
    yield from held


def _ros1(path: Path, bag: Bag) -> Iterator[Topic | Message]:
    """Topics and messages, including those in chunks."""
    names: dict[bytes, str] = {}
    with path.open("rb") as stream:
        stream.readline()
        records = _ros1_records(stream, path.stat().st_size, bag)
        for header, data in _intact(stream, records, bag):
            number, time = header.get("conn", b""), header.get("time", b"")
            if header.get("op") == CONNECTION and "topic" in header:
                name = header["topic"].decode(errors="replace")
                name = "/" * name.startswith("/") + "/".join(filter(None, name.split("/")))
                names[number] = name
                with suppress(struct.error, KeyError):  # a record that is damaged itself
                    package, _, kind = _fields(data)["type"].decode(errors="replace").partition("/")
                    yield Topic(name, f"{package}/msg/{kind}", ros1=True)
            elif header.get("op") == MESSAGE and number in names and len(time) == 8:
                seconds, fraction = struct.unpack("<II", time)
                yield names[number], seconds * 10**9 + fraction, data


MESSAGE, BEGIN, CHUNK, CONNECTION = b"\x02", b"\x03", b"\x05", b"\x07"  # kinds of ROS 1's records


def _ros1_records(
    stream: BinaryIO, size: int, bag: Bag | None
) -> Iterator[tuple[dict[str, bytes], bytes]]:
    """Header and data of each record of a bag, or of a chunk of it, which has no bag."""
    while stream.tell() < size:
        header, data = _fields(_sized(stream)), _sized(stream)
        if bag and header["op"] == BEGIN and header["index_pos"] == bytes(8):
            bag.lost.append("the bag is damaged or cut off: it has no index")
        if bag and header["op"] == CHUNK:
            chunk = bag.chunk(header["compression"].decode(), data)
            yield from [*_ros1_records(BytesIO(chunk), len(chunk), None)]  # all, or it is damaged
        else:
            yield header, data


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


# What reads the topics and messages of a file to where it ends or is damaged, by its first bytes.
RECORDS: dict[bytes, Callable[[Path, Bag], Iterator[Topic | Message]]] = {
    b"\x89MCAP0\r\n": _mcap,
    b"SQLite format 3\x00": _sqlite,
    b"#ROSBAG V2.0": _ros1,
}
