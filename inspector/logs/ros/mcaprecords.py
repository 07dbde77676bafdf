"""MCAP, record by record: what is left of a file that has lost its end.

A record is a byte that says what it is, its length, and as many bytes. Chunks hold records in
turn, perhaps compressed. https://mcap.dev/spec
"""

import struct
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import BinaryIO
from zlib import crc32

from inspector.logs.ros.bag import Message, Topic

SCHEMA, CHANNEL, MESSAGE, CHUNK = 0x03, 0x04, 0x05, 0x06
MAGIC = 8
"""Bytes before the first record."""


def topics(path: Path) -> Iterator[Topic]:
    """Go through the topics that intact records name."""
    with path.open("rb") as stream:
        schemas: dict[int, tuple[str, str]] = {}
        for kind, record in _records(stream, []):
            with suppress(struct.error):  # a record that is damaged itself
                if kind == SCHEMA:
                    number, name, text = _schema(record)
                    schemas[number] = name, text
                elif kind == CHANNEL:
                    _, schema, topic = _channel(record)
                    yield Topic(topic, *schemas.get(schema, ("", "")))


def messages(path: Path, lost: list[str]) -> Iterator[Message]:
    """Go through the messages of intact records.

    Args:
        path: The file.
        lost: Is told what was lost.
    """
    channels: dict[int, str] = {}
    with path.open("rb") as stream:
        for kind, record in _records(stream, lost):
            if kind == CHANNEL:
                with suppress(struct.error):
                    number, _, topic = _channel(record)
                    channels[number] = topic
            elif kind == MESSAGE and len(record) >= 22:
                channel, _, received, _ = struct.unpack_from("<HIQQ", record)
                if channel in channels:
                    yield channels[channel], received, record[22:]


def _records(stream: BinaryIO, lost: list[str]) -> Iterator[tuple[int, bytes]]:
    """Go through records, those in chunks among them, to where the file ends."""
    size = stream.seek(0, 2)
    place = stream.seek(MAGIC)
    while place + 9 <= size:
        kind, length = struct.unpack("<BQ", stream.read(9))
        if place + 9 + length > size:
            lost.append(f"the file ends within a record, {size - place} bytes are lost")
            return
        if kind == CHUNK:
            chunk = _unpacked(stream.read(length))
            if chunk is None:
                lost.append(f"a chunk of {length} bytes is damaged and left out")
            else:
                yield from _records_of(chunk)
        elif kind in (SCHEMA, CHANNEL, MESSAGE):
            yield kind, stream.read(length)
        place = stream.seek(place + 9 + length)


def _records_of(chunk: bytes) -> Iterator[tuple[int, bytes]]:
    place = 0
    while place + 9 <= len(chunk):
        kind, length = struct.unpack_from("<BQ", chunk, place)
        place += 9
        yield kind, chunk[place : place + length]
        place += length


def _unpacked(record: bytes) -> bytes | None:
    """Decompress a chunk; None if it is damaged."""
    try:
        size, checksum = struct.unpack_from("<QI", record, 16)
        stream = BytesIO(record[28:])
        compression = _text(stream)
        (length,) = struct.unpack("<Q", stream.read(8))
        data = stream.read(length)
        if compression == "lz4":
            from lz4.frame import decompress

            data = decompress(data)
        elif compression == "zstd":
            from backports import zstd  # what rosbags itself decompresses with

            data = zstd.decompress(data)
    except Exception:  # each compressor has errors of its own
        return None
    intact = len(data) == size and (not checksum or crc32(data) == checksum)
    return data if intact else None


def _schema(record: bytes) -> tuple[int, str, str]:
    stream = BytesIO(record)
    (number,) = struct.unpack("<H", stream.read(2))
    name, _, text = _text(stream), _text(stream), _text(stream)
    return number, name, text


def _channel(record: bytes) -> tuple[int, int, str]:
    stream = BytesIO(record)
    number, schema = struct.unpack("<HH", stream.read(4))
    return number, schema, _text(stream)


def _text(stream: BytesIO) -> str:
    (length,) = struct.unpack("<I", stream.read(4))
    return stream.read(length).decode(errors="replace")
