"""Byte layout of a serialised JointState, by which its numbers are copied without parsing.

CDR aligns a number to a multiple of its size, counted from the end of the four bytes of the
encapsulation header. Messages of one publisher have one layout: the bytes between their numbers
are equal.
"""

import struct
from dataclasses import dataclass
from typing import Self

LITTLE = b"\x00\x01"
"""CDR, little-endian; other encodings are deserialised by rosbags."""

STAMP = struct.Struct("<iI")
COUNT = struct.Struct("<I")
BODY = 12
"""Offset of the bytes after the stamp."""


@dataclass(frozen=True)
class Layout:
    """Byte offsets of the numbers of a JointState.

    Attributes:
        names: The joints.
        size: Length of the message in bytes.
        arrays: Start and stop of the positions, velocities and efforts.
        between: Bytes that all messages of this layout share, with start and stop.
    """

    names: tuple[str, ...]
    size: int
    arrays: tuple[tuple[int, int], ...]
    between: tuple[tuple[int, int, bytes], ...]

    @classmethod
    def of(cls, data: bytes) -> Self | None:
        """Layout of a message; None if it is not a JointState in little-endian CDR.

        Args:
            data: The message, serialised as ``sensor_msgs/msg/JointState`` in CDR.
        """
        if data[:2] != LITTLE:
            return None
        try:
            _, place = _text(data, BODY)
            place = _aligned(place, 4)
            (count,) = COUNT.unpack_from(data, place)
            place += 4
            names = []
            for _ in range(count):
                name, place = _text(data, _aligned(place, 4))
                names.append(name)
            arrays, between, start = [], [], BODY
            for _ in range(3):
                place = _aligned(place, 4)
                (count,) = COUNT.unpack_from(data, place)
                place = _aligned(place + 4, 8) if count else place + 4
                between.append((start, place, data[start:place]))
                start = place + 8 * count
                arrays.append((place, start))
                place = start
        except (struct.error, UnicodeDecodeError):
            return None
        if start > len(data):
            return None
        return cls(tuple(names), len(data), tuple(arrays), tuple(between))

    def fits(self, data: bytes) -> bool:
        """Whether a message has this layout."""
        return (
            len(data) == self.size
            and data[:2] == LITTLE
            and all(data[start:stop] == same for start, stop, same in self.between)
        )


def stamp(data: bytes) -> int:
    """Stamp of a message that has a layout, in [ns]."""
    seconds, nanoseconds = STAMP.unpack_from(data, 4)
    return int(seconds) * 10**9 + int(nanoseconds)


def _text(data: bytes, place: int) -> tuple[str, int]:
    (length,) = COUNT.unpack_from(data, place)
    stop = place + 4 + length
    if stop > len(data):
        raise struct.error("text runs beyond the message")
    return data[place + 4 : stop].rstrip(b"\x00").decode(), stop


def _aligned(place: int, size: int) -> int:
    return place + -(place - 4) % size
