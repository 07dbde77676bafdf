"""Parquet logs with a row per sample, and columns of numbers or of lists of numbers."""

from collections.abc import Collection, Iterator, Sequence
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pyarrow.compute as pc
import pyarrow.parquet
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs.clocks import stamps_of
from inspector.logs.log import SAMPLES, Field, Log, LogReader, Stamps
from inspector.logs.mapping import ReadOptions
from inspector.logs.names import array_signal, column_signal, listed, time_column
from inspector.logs.parquetpages import unpacked_size
from noisemodel.runfile import ArchiveError, check_regular, check_unpacked

DAMAGE = (pyarrow.ArrowException, OSError, ValueError, KeyError, RuntimeError)
"""Errors that pyarrow raises for damaged files."""

EPISODE = "episode_index"
"""The column with the number of the episode, if there is one."""


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of a Parquet file.

    Args:
        path: The file.
        options: How to read it.

    Raises:
        LogError: If it cannot be read.
    """
    schema = schema_of(path)
    return LogReader(
        "Parquet",
        episodes_of(path) if EPISODE in schema.names else ("",),
        lambda episode, progress: _read(path, options, episode),
        lambda: listing(path),
    )


def schema_of(path: Path) -> Any:
    """Names and types of the columns.

    Raises:
        LogError: If the file is damaged; the schema is at its end.
    """
    try:
        check_regular(path)
        return pyarrow.parquet.read_schema(path)
    except ArchiveError as error:
        raise LogError(path, str(error)) from error
    except DAMAGE as error:
        raise LogError(path, f"damaged or cut off ({_one_line(error)})") from error


def table_of(paths: Sequence[Path], columns: Sequence[str], episode: str) -> Any:
    """Table of some columns, of one episode if there are several.

    Raises:
        LogError: If a file is damaged.
    """
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
        raise LogError(paths[0], f"damaged or cut off ({_one_line(error)})") from error
    return pyarrow.concat_tables(tables)


def _check_size(path: Path, columns: Collection[str]) -> None:
    """Refuse columns that unpack to more than is read: a run of one value takes a few bytes."""
    unpacked = unpacked_size(path, columns)
    try:
        check_unpacked(unpacked, path.stat().st_size)
    except ArchiveError as error:
        raise LogError(path, str(error)) from error


def episodes_of(path: Path) -> tuple[str, ...]:
    """Episodes in a file.

    Raises:
        LogError: If the file is damaged, or they are not numbered.
    """
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
    """Column as an array, shape (samples, columns); None if it holds no numbers.

    Raises:
        LogError: If its lists are of different lengths.
    """
    kind, lists = column.type, False
    while pyarrow.types.is_list(kind) or pyarrow.types.is_fixed_size_list(kind):
        kind, lists = kind.value_type, True
    if pyarrow.types.is_timestamp(kind) and not lists:
        return np.asarray(column.to_numpy())[:, None]
    if not (pyarrow.types.is_floating(kind) or pyarrow.types.is_integer(kind)):
        return None
    samples = len(column)
    flat = column.combine_chunks()
    while pyarrow.types.is_list(flat.type) or pyarrow.types.is_fixed_size_list(flat.type):
        flat = flat.flatten()
    numbers = flat.to_numpy(zero_copy_only=False)
    if pyarrow.types.is_list(column.type) and len(pc.list_value_length(column).unique()) > 1:
        raise LogError(path, f"column {name!r} has lists of different lengths")
    if samples == 0 or len(numbers) % samples:
        raise LogError(path, f"column {name!r} has {len(numbers)} numbers in {samples} rows")
    return np.asarray(numbers).reshape(samples, -1)


def listing(path: Path) -> tuple[str, ...]:
    """Columns of a file with their types, a line each."""
    schema = schema_of(path)
    rows = pyarrow.parquet.read_metadata(path).num_rows
    return (f"{rows} rows", *(f"{each.name}  {each.type}" for each in schema))


def _read(path: Path, options: ReadOptions, episode: str) -> Log:
    names = schema_of(path).names
    mapped = {name for entry in options.entries for name in (entry.source, entry.part()[0])}
    time = options.time if options.time in names else time_column(names)
    wanted = [
        name
        for name in names
        if name in mapped
        or (name not in (time, EPISODE) and (column_signal(name) or array_signal(name)))
    ]
    table = table_of([path], [*wanted, *([time] if time and time not in wanted else [])], episode)
    if time:
        column = values_of(path, time, table.column(time))
        if column is None or column.shape[1] != 1:
            raise LogError(path, f"column {time!r} holds no stamps but {table.column(time).type}")
        stamps = stamps_of(path, time, column[:, 0], options.rate)
    else:
        stamps = Stamps(Decimal(0), np.arange(len(table), dtype=np.float64), unit=SAMPLES)

    def fields() -> Iterator[Field]:
        for name in wanted:
            values = values_of(path, name, table.column(name))
            if values is not None and values.dtype.kind in "iuf":
                floats = values if values.dtype.kind == "f" else values.astype(np.float64)
                yield Field(name, floats, stamps, source=path.name)

    found = tuple(fields())
    read = {field.name for field in found} | {time, EPISODE}
    not_read = tuple(name for name in names if name not in read)
    return Log(path, found, episode, not_read=not_read, time=time)


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())
