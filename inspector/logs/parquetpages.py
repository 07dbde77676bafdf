"""Bytes that columns of a Parquet file unpack to, by the headers of their pages.

The reader of pyarrow makes room for a page by its header, whatever the end of the file states; and
its table of columns ends the process on some damage. Both are structs of Thrift's compact protocol:
https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md and
https://github.com/apache/parquet-format/blob/master/src/main/thrift/parquet.thrift
"""

from collections.abc import Collection, Iterator
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

TRUE, FALSE, BYTE, DOUBLE, BINARY, LIST, SET, STRUCT = 1, 2, 3, 7, 8, 9, 10, 12
NUMBERS = (4, 5, 6)
"""Types of Thrift's compact protocol; the last are integers of 16, 32 and 64 bits."""

DEPTH = 12
"""Structs and lists within each other; those of the end of a file are eight."""

MAGIC = b"PAR1"
LARGEST_END = 32 * 2**20
"""Most bytes of the end of a file, which has some hundred for each column of a row group."""

# Fields of structs, by the names of parquet.thrift
ROW_GROUPS, COLUMNS, META_DATA = 4, 1, 3
PATH, VALUES, ALL_UNPACKED, ALL_PACKED, DATA_PAGE, DICTIONARY_PAGE = 3, 5, 6, 7, 9, 11
UNPACKED, PACKED = 2, 3


def unpacked_size(path: Path, columns: Collection[str]) -> int:
    """Bytes that columns unpack to, by what states more: their pages, or the end of the file.

    Args:
        path: The file.
        columns: Their names; those of nested columns too.

    Raises:
        ValueError: If the file is damaged.
    """
    stated = held = 0
    with path.open("rb") as stream, mmap(stream.fileno(), 0, access=ACCESS_READ) as data:
        length = int.from_bytes(data[-8:-4], "little")
        if data[-4:] != MAGIC or length > min(LARGEST_END, len(data) - 8):
            raise ValueError("its end is no table of columns")
        try:
            for group in _struct(data, len(data) - 8 - length)[0][ROW_GROUPS]:
                for about in (chunk[META_DATA] for chunk in group[COLUMNS]):
                    name = b".".join(about[PATH]).decode(errors="replace")
                    if any(f"{name}.".startswith(f"{each}.") for each in columns):
                        stated += max(about[ALL_UNPACKED], 8 * about[VALUES])
                        held += sum(_pages(data, about))
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError("its end is no table of columns") from error
    return max(stated, held)


def _pages(data: mmap, about: dict[int, Any]) -> Iterator[int]:
    """Bytes that each page of a column of a row group unpacks to."""
    place: int = about[DATA_PAGE]
    if 0 < about.get(DICTIONARY_PAGE, 0) < place:
        place = about[DICTIONARY_PAGE]
    stop = min(place + about[ALL_PACKED], len(data))
    while 0 <= place < stop:
        header, place = _struct(data, place)
        if min(header.get(UNPACKED, -1), header.get(PACKED, -1)) < 0:
            raise ValueError("a page has no size")
        yield header[UNPACKED]
        place += header[PACKED]


def _struct(data: mmap, place: int, depth: int = DEPTH) -> tuple[dict[int, Any], int]:
    """Fields of a struct by their numbers, and where it ends."""
    found: dict[int, Any] = {}
    name = 0
    try:
        while head := data[place]:
            place += 1
            if head >> 4:
                name += head >> 4
            else:
                name, place = _integer(data, place)
            kind = head & 15
            found[name], place = (
                (kind == TRUE, place) if kind in (TRUE, FALSE) else _value(data, place, kind, depth)
            )
    except IndexError as error:
        raise ValueError("a header is cut off") from error
    return found, place + 1


def _value(data: mmap, place: int, kind: int, depth: int) -> tuple[Any, int]:
    if not depth:
        raise ValueError("a header is nested too deeply")
    if kind in NUMBERS:
        return _integer(data, place)
    if kind in (TRUE, FALSE, BYTE):  # of lists; those of structs are in their heads
        return data[place], place + 1
    if kind == DOUBLE:
        return None, place + 8
    if kind == BINARY:
        size, place = _varint(data, place)
        return data[place : place + size], place + size
    if kind == STRUCT:
        return _struct(data, place, depth - 1)
    if kind not in (LIST, SET):
        raise ValueError(f"a header has a field of kind {kind}")
    count, kind = data[place] >> 4, data[place] & 15
    place += 1
    if count == 15:
        count, place = _varint(data, place)
    if count > len(data):
        raise ValueError("a header has a list of more than there is")
    items = []
    for _ in range(count):
        item, place = _value(data, place, kind, depth - 1)
        items.append(item)
    return items, place


def _integer(data: mmap, place: int) -> tuple[int, int]:
    number, place = _varint(data, place)
    return (number >> 1) ^ -(number & 1), place


def _varint(data: mmap, place: int) -> tuple[int, int]:
    number = 0
    for shift in range(0, 70, 7):
        number |= (data[place] & 127) << shift
        place += 1
        if data[place - 1] < 128:
            return number, place
    raise ValueError("a header has a number of more than 64 bits")
