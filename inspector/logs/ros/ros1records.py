"""Topics and messages of a ROS 1 bag without its index, read record by record.

A record is a header of ``name=value`` fields and data, each with its length before it. Chunks hold
records in turn, perhaps compressed. http://wiki.ros.org/Bags/Format/2.0
"""

import struct
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from inspector.logs.ros import chunks
from inspector.logs.ros.bag import Message, Topic
from noisemodel.archive import ArchiveError

MESSAGE, CHUNK, CONNECTION = b"\x02", b"\x05", b"\x07"


def topics(path: Path) -> Iterator[Topic]:
    """Topics of intact records."""
    chunks.begin(path)
    with path.open("rb") as stream:
        for header, data in _records(stream, []):
            if header.get("op") == CONNECTION and "topic" in header:
                with suppress(struct.error, KeyError):  # a record that is damaged itself
                    fields = _fields(data)
                    package, _, name = fields["type"].decode(errors="replace").partition("/")
                    definition = fields["message_definition"].decode(errors="replace")
                    yield Topic(_topic(header), f"{package}/msg/{name}", definition)


def messages(path: Path, lost: list[str]) -> Iterator[Message]:
    """Messages of intact records.

    Args:
        path: The file.
        lost: What was lost is appended to it, a sentence each.
    """
    names: dict[bytes, str] = {}
    chunks.begin(path)
    with path.open("rb") as stream:
        for header, data in _records(stream, lost):
            number, time = header.get("conn", b""), header.get("time", b"")
            if header.get("op") == CONNECTION and "topic" in header:
                names[number] = _topic(header)
            elif header.get("op") == MESSAGE and number in names and len(time) == 8:
                seconds, nanoseconds = struct.unpack("<II", time)
                yield names[number], seconds * 10**9 + nanoseconds, data


def _topic(header: dict[str, bytes]) -> str:
    name = header["topic"].decode(errors="replace")
    return "/" * name.startswith("/") + "/".join(part for part in name.split("/") if part)


def _records(stream: BinaryIO, lost: list[str]) -> Iterator[tuple[dict[str, bytes], bytes]]:
    """Records, including those in chunks, to where the file ends or is damaged."""
    size = stream.seek(0, 2)
    stream.seek(0)
    stream.readline()
    while (place := stream.tell()) < size:
        try:
            header = _fields(_sized(stream))
            data = _sized(stream)
            kind = header["op"]
            records = list(_records_of(_unpacked(header, data))) if kind == CHUNK else []
        except ArchiveError:
            raise
        except Exception as error:  # each compressor has errors of its own
            what = " ".join(str(error).split()) or type(error).__name__
            lost.append(f"from byte {place} on the file is damaged or cut off ({what})")
            return
        yield from records if kind == CHUNK else [(header, data)]


def _records_of(chunk: bytes) -> Iterator[tuple[dict[str, bytes], bytes]]:
    stream = BytesIO(chunk)
    while stream.tell() < len(chunk):
        yield _fields(_sized(stream)), _sized(stream)


def _unpacked(header: dict[str, bytes], data: bytes) -> bytes:
    return chunks.unpack(header["compression"].decode(), data)


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
