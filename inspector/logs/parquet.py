"""Parquet with a row per sample: columns of numbers, or of lists of them."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pyarrow.compute as pc
import pyarrow.parquet
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs.columns import array_signal, named
from inspector.logs.log import Field, Log
from inspector.logs.opened import Opened
from inspector.logs.reading import Reading
from inspector.logs.stamping import stamps_of, time_name, without_stamps

DAMAGE = (pyarrow.ArrowException, OSError, ValueError, KeyError)
"""What pyarrow raises on files that are broken."""

EPISODE = "episode_index"
"""The column that tells episodes apart, if there is one."""


def open_log(path: Path, reading: Reading) -> Opened:
    """Offer a Parquet file.

    Args:
        path: The file.
        reading: What a person said of it.

    Raises:
        LogError: If it cannot be read.
    """
    schema = schema_of(path)
    return Opened(
        "Parquet",
        episodes_of(path) if EPISODE in schema.names else ("",),
        lambda episode, watch: _read(path, reading, episode),
        lambda: listing(path),
    )


def schema_of(path: Path) -> Any:
    """Read the columns' names and types.

    Raises:
        LogError: If the file is damaged: its columns stand at its end, without which it is none.
    """
    try:
        return pyarrow.parquet.read_schema(path)
    except DAMAGE as error:
        raise LogError(path, f"damaged or cut off ({_one_line(error)})") from error


def table_of(paths: Sequence[Path], columns: Sequence[str], episode: str) -> Any:
    """Read some columns, of one episode where there are several.

    Raises:
        LogError: If a file is damaged.
    """
    filters = [(EPISODE, "==", int(episode))] if episode else None
    try:
        tables = [
            pyarrow.parquet.read_table(path, columns=list(columns), filters=filters)
            for path in paths
        ]
    except DAMAGE as error:
        raise LogError(paths[0], f"damaged or cut off ({_one_line(error)})") from error
    return pyarrow.concat_tables(tables)


def episodes_of(path: Path) -> tuple[str, ...]:
    """List the episodes in a file."""
    column = table_of([path], [EPISODE], "").column(0).to_numpy()
    return tuple(str(each) for each in np.unique(column))


def values_of(path: Path, name: str, column: Any) -> NDArray[Any] | None:
    """Turn a column into an array, shape (samples, columns); None if it holds no numbers.

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
    """List the columns of a file with their types."""
    schema = schema_of(path)
    rows = pyarrow.parquet.read_metadata(path).num_rows
    return (f"{rows} rows", *(f"{each.name}  {each.type}" for each in schema))


def _read(path: Path, reading: Reading, episode: str) -> Log:
    names = schema_of(path).names
    said = {name for entry in reading.entries for name in (entry.source, entry.part()[0])}
    time = time_name(names, reading)
    wanted = [
        name
        for name in names
        if name in said or (name not in (time, EPISODE) and (named(name) or array_signal(name)))
    ]
    table = table_of([path], [*wanted, *([time] if time and time not in wanted else [])], episode)
    if time:
        column = values_of(path, time, table.column(time))
        if column is None or column.shape[1] != 1:
            raise LogError(path, f"column {time!r} holds no stamps but {table.column(time).type}")
        stamps = stamps_of(path, time, column[:, 0], reading.rate)
    else:
        stamps = without_stamps(path, len(table), reading, names)

    def fields() -> Iterator[Field]:
        for name in wanted:
            values = values_of(path, name, table.column(name))
            if values is not None and values.dtype.kind in "iuf":
                floats = values if values.dtype.kind == "f" else values.astype(np.float64)
                yield Field(name, floats, stamps, source=path.name)

    found = tuple(fields())
    read = {field.name for field in found} | {time, EPISODE}
    return Log(path, found, episode, left=tuple(name for name in names if name not in read))


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())
