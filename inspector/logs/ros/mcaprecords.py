"""Topics and messages of an MCAP file without its index, read record by record.

A file that was cut off has lost the index at its end; one with other messages beside those of ROS,
as Foxglove writes it, rosbags refuses. https://mcap.dev/spec
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from mcap.records import Channel, Chunk, McapRecord, Schema
from mcap.records import Message as McapMessage
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk

from inspector.logs.ros import chunks
from inspector.logs.ros.bag import Message, Topic
from noisemodel.archive import ArchiveError

MAGIC = b"\x89MCAP0\r\n"
"""The bytes with which a file begins and ends."""


def is_whole(path: Path) -> bool:
    """Whether a file was written to its end."""
    with path.open("rb") as stream:
        stream.seek(max(0, path.stat().st_size - len(MAGIC)))
        return stream.read() == MAGIC


def topics(path: Path) -> Iterator[Topic]:
    """Topics of intact records."""
    schemas: dict[int, Schema] = {}
    for record in _records(path, []):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            schema = schemas.get(record.schema_id)
            text = schema.data.decode(errors="replace") if schema else ""
            yield Topic(record.topic, schema.name if schema else "", text)


def messages(path: Path, lost: list[str]) -> Iterator[Message]:
    """Messages of intact records.

    Args:
        path: The file.
        lost: What was lost is appended to it, a sentence each.
    """
    channels: dict[int, str] = {}
    for record in _records(path, lost):
        if isinstance(record, Channel):
            channels[record.id] = record.topic
        elif isinstance(record, McapMessage) and record.channel_id in channels:
            yield channels[record.channel_id], record.log_time, record.data


def _records(path: Path, lost: list[str]) -> Iterator[McapRecord]:
    """Records, including those in chunks, to where the file ends or is damaged."""
    chunks.begin(path)
    size, place = path.stat().st_size, 0  # no record is longer than its file
    with path.open("rb") as stream:
        reader = StreamReader(stream, emit_chunks=True, validate_crcs=True, record_size_limit=size)
        try:
            for record in reader.records:
                if isinstance(record, Chunk):
                    yield from _unpacked(record, lost)
                else:
                    yield record
                place = stream.tell()
        except ArchiveError:
            raise
        except CRCValidationError as error:  # all messages have been read by then
            lost.append(f"some of what was read is damaged ({error})")
        except Exception as error:  # the library lets errors of struct and of text through
            what = " ".join(str(error).split()) or type(error).__name__
            lost.append(f"from byte {place} on the file is damaged or cut off ({what})")


def _unpacked(chunk: Chunk, lost: list[str]) -> list[McapRecord]:
    try:
        raw = chunks.unpack(chunk.compression, chunk.data)
        return breakup_chunk(replace(chunk, compression="", data=raw), validate_crc=True)
    except ArchiveError:
        raise
    except Exception:  # each compressor has errors of its own
        lost.append(f"a chunk of {len(chunk.data)} bytes is damaged and left out")
        return []
