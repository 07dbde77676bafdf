"""Parquet logs with a row per sample, and columns of numbers or of lists of numbers.

What columns unpack to is known before by the headers of their pages: pyarrow makes room for a page
by its header, whatever the end of the file states, and its table of columns ends the process on
some damage. Both are structs of Thrift's compact protocol:
https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md and
https://github.com/apache/parquet-format/blob/master/src/main/thrift/parquet.thrift
"""

from collections.abc import Collection, Iterator, Sequence
from decimal import Decimal
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pyarrow.compute as pc
import pyarrow.parquet
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs.clocks import counting, stamps_of
from inspector.logs.log import SAMPLES, Field, Log, LogReader, Stamps
from inspector.logs.mapping import ReadOptions, check_unit
from inspector.logs.names import Naming, array_signal, column_signal, listed, time_column
from noisemodel.files import beyond, limit
from noisemodel.runfile import ArchiveError, check_regular, check_unpacked, one_line

DAMAGE = (pyarrow.ArrowException, OSError, ValueError, KeyError, RuntimeError)
"""Errors that pyarrow raises for damaged files."""

EPISODE = "episode_index"
"""The column with the number of the episode, if there is one."""


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of a Parquet file."""
    schema = schema_of(path)
    return LogReader(
        "Parquet",
        episodes_of(path) if EPISODE in schema.names else ("",),
        lambda episode, progress: _read(path, options, episode),
        lambda: listing(path),
    )


def schema_of(path: Path) -> Any:
    """Names and types of the columns."""
    try:
        check_regular(path)
        return pyarrow.parquet.read_schema(path)
    except ArchiveError as error:
        raise LogError(path, str(error)) from error
    except DAMAGE as error:
        raise LogError(path, f"damaged or cut off ({one_line(error)})") from error


def table_of(paths: Sequence[Path], columns: Sequence[str], episode: str) -> Any:
    """Table of some columns, of one episode if there are several."""
    filters = [(EPISODE, "==", int(episode))] if episode else None
    try:
        for path in paths:
            _check_size(path, {*columns, *([EPISODE] if episode else [])})
        tables = [
            pyarrow.parquet.read_table(path, columns=list(columns), filters=filters)
            for path in paths
        ]
    except LogError:
        raise
    except DAMAGE as error:
        raise LogError(paths[0], f"damaged or cut off ({one_line(error)})") from error
    return pyarrow.concat_tables(tables)


def _check_size(path: Path, columns: Collection[str]) -> None:
    """Refuse columns that unpack to more than is read: a run of one value takes a few bytes."""
    unpacked, width = unpacked_size(path, columns)
    if width > limit("columns"):
        raise LogError(path, f"lists of {width} numbers in a row, {beyond('columns')}")
    try:
        check_unpacked(unpacked, path.stat().st_size)
    except ArchiveError as error:
        raise LogError(path, str(error)) from error


def episodes_of(path: Path) -> tuple[str, ...]:
    """Episodes in a file."""
    schema = schema_of(path)
    if EPISODE not in schema.names:
        raise LogError(path, f"there is no column {EPISODE!r}; it has {listed(schema.names)}")
    kind = schema.field(EPISODE).type
    if not pyarrow.types.is_integer(kind):
        raise LogError(path, f"column {EPISODE!r} holds {kind}, expected whole numbers")
    column = table_of([path], [EPISODE], "").column(0)
    if column.null_count:
        raise LogError(path, f"column {EPISODE!r} has rows without a number")
    return tuple(str(each) for each in np.unique(column.to_numpy()))


def values_of(path: Path, name: str, column: Any) -> NDArray[Any] | None:
    """Column as an array, shape (samples, columns); None if it holds no numbers."""
    kind, lists = column.type, False
    while _is_list(kind):
        kind, lists = kind.value_type, True
    if pyarrow.types.is_timestamp(kind) and not lists:
        return np.asarray(column.to_numpy())[:, None]
    if not (pyarrow.types.is_floating(kind) or pyarrow.types.is_integer(kind)):
        return None
    samples = len(column)
    flat = column.combine_chunks()
    while _is_list(flat.type):
        flat = flat.flatten()
    numbers = flat.to_numpy(zero_copy_only=False)
    if pyarrow.types.is_list(column.type) and len(pc.list_value_length(column).unique()) > 1:
        raise LogError(path, f"column {name!r} has lists of different lengths")
    if samples == 0 or len(numbers) % samples:
        raise LogError(path, f"column {name!r} has {len(numbers)} numbers in {samples} rows")
    return np.asarray(numbers).reshape(samples, -1)


def _is_list(kind: Any) -> bool:
    return bool(pyarrow.types.is_list(kind) or pyarrow.types.is_fixed_size_list(kind))


def listing(path: Path) -> tuple[str, ...]:
    """Columns of a file with their types, a line each."""
    schema = schema_of(path)
    rows = pyarrow.parquet.read_metadata(path).num_rows
    return (f"{rows} rows", *(f"{each.name}  {each.type}" for each in schema))


def _read(path: Path, options: ReadOptions, episode: str) -> Log:
    schema = schema_of(path)
    names = schema.names
    time = options.time if options.time in names else time_column(names)
    options = options.for_columns(path, [name for name in names if name not in (time, EPISODE)])
    mapped = {name for entry in options.entries for name in (entry.source, entry.part()[0])}
    naming = Naming.of(names, options.known_joints)
    wanted = [
        name
        for name in names
        if name in mapped
        or (name not in (time, EPISODE) and (column_signal(name, naming) or array_signal(name)))
    ]
    for name in wanted:
        if name not in mapped:
            check_unit(path, name, column_signal(name, naming))
    whole = [
        each.name
        for each in schema
        if pyarrow.types.is_integer(each.type) and each.name not in (*wanted, EPISODE)
    ]
    others = [time] if time and time not in wanted else [] if time else whole
    table = table_of([path], [*wanted, *others], episode)
    if not time:
        time = counting({name: table.column(name).to_numpy() for name in whole})
    stamps = Stamps(Decimal(0), np.arange(len(table), dtype=np.float64), unit=SAMPLES)
    if time:
        column = values_of(path, time, table.column(time))
        if column is None or column.shape[1] != 1:
            raise LogError(path, f"column {time!r} holds no stamps but {table.column(time).type}")
        stamps = stamps_of(path, time, column[:, 0], options.rate)
    fields = []
    for name in wanted:
        values = values_of(path, name, table.column(name))
        if values is not None and values.dtype.kind in "iuf":
            floats = values if values.dtype.kind == "f" else values.astype(np.float64)
            fields.append(Field(name, floats, stamps, source=path.name))
    read = {field.name for field in fields} | {time, EPISODE}
    not_read = tuple(name for name in names if name not in read)
    return Log(path, tuple(fields), episode, not_read=not_read, time=time)


# What columns unpack to

TRUE, FALSE, BYTE, DOUBLE, BINARY, LIST, SET, STRUCT = 1, 2, 3, 7, 8, 9, 10, 12
NUMBERS = (4, 5, 6)
"""Types of Thrift's compact protocol; the last are integers of 16, 32 and 64 bits."""
DEPTH = 12
"""Structs and lists within each other; the end of a file has eight."""
MAGIC = b"PAR1"
LARGEST_END = 32 * 2**20
"""Most bytes of the end of a file, which has some hundred for each column of a row group."""

# Fields of structs, by the names of parquet.thrift
ROW_GROUPS, COLUMNS, ROWS, META_DATA = 4, 1, 3, 3
PATH, VALUES, ALL_UNPACKED, ALL_PACKED, DATA_PAGE, DICTIONARY_PAGE = 3, 5, 6, 7, 9, 11
UNPACKED, PACKED = 2, 3


def unpacked_size(path: Path, columns: Collection[str]) -> tuple[int, int]:
    """Bytes that columns unpack to, by what states more, their pages or the end of the file."""
    stated = held = width = 0
    with path.open("rb") as stream, mmap(stream.fileno(), 0, access=ACCESS_READ) as data:
        length = int.from_bytes(data[-8:-4], "little")
        if data[-4:] != MAGIC or length > min(LARGEST_END, len(data) - 8):
            raise ValueError("its end is no table of columns")
        try:
            for group in _struct(data, len(data) - 8 - length)[0][ROW_GROUPS]:
                numbers = 0
                for about in (chunk[META_DATA] for chunk in group[COLUMNS]):
                    name = b".".join(about[PATH]).decode(errors="replace")
                    if any(f"{name}.".startswith(f"{each}.") for each in columns):
                        numbers += about[VALUES]
                        stated += max(about[ALL_UNPACKED], 8 * about[VALUES])
                        held += sum(_pages(data, about))
                width = max(width, numbers // max(1, group[ROWS]))
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError("its end is no table of columns") from error
    return max(stated, held), width


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
