"""A wide CSV log, read whole and checked cell by cell."""

import csv
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from itertools import pairwise
from math import isfinite, log
from operator import itemgetter
from pathlib import Path
from typing import Self, TextIO

import numpy as np

from inspector.columns import Column, Mapped, layout
from inspector.errors import LogError
from noisemodel.types import Array

UNITS = {"seconds": "1", "milliseconds": "1e-3", "microseconds": "1e-6", "nanoseconds": "1e-9"}
"""The units that stamps may have, in [s]."""

SLOWEST, FASTEST_NS = 0.5, 1e4
"""A step of up to the first is taken for seconds, from the second on for nanoseconds."""


@dataclass(frozen=True)
class Log:
    """What a CSV log holds.

    Attributes:
        path: The file.
        header: The names of all columns.
        columns: The columns that hold signals of joints.
        left: Names of the columns that were not read.
        rows: The line of the file in which each sample stands, shape (samples,).
        start: The first stamp, in [s], exact.
        unit: The unit of the stamps, one of ``UNITS``.
        time: Time since the first stamp, shape (samples,), in [s].
        table: The signals, as the log has them, shape (samples, columns).
    """

    path: Path
    header: tuple[str, ...]
    columns: tuple[Column, ...]
    left: tuple[str, ...]
    rows: Sequence[int]
    start: Decimal
    unit: str
    time: Array
    table: Array

    def keeping(self, columns: Sequence[Column]) -> Self:
        """Keep some of the columns, perhaps under another signal's name."""
        places = {column.index: place for place, column in enumerate(self.columns)}
        kept = {column.index for column in columns}
        return replace(
            self,
            columns=tuple(columns),
            left=(*self.left, *(c.name for c in self.columns if c.index not in kept)),
            table=self.table[:, [places[column.index] for column in columns]],
        )


def read(path: Path, *, mapped: Mapped, joints: Sequence[str] | None, rate: float | None) -> Log:
    """Read a CSV log: a header, then a row per sample.

    Cells are separated by commas, semicolons, tabs or spaces, numbers have a decimal point.

    Args:
        path: The file.
        mapped: What a person said of some columns.
        joints: The robot's joints in order, if the robot is known.
        rate: The log's rate in [Hz], if it is known; it tells the unit of the stamps.

    Raises:
        LogError: If the file cannot be read, a row has more or fewer cells than the header, a
            cell that is needed holds no finite number, or time does not run forwards.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            return _read(path, stream, mapped, joints, rate)
    except OSError as error:
        raise LogError(path, f"cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise LogError(path, "not a CSV log: it is no text in UTF-8") from error


def _read(
    path: Path, stream: TextIO, mapped: Mapped, joints: Sequence[str] | None, rate: float | None
) -> Log:
    lines = _cells(path, stream)
    first = next(lines, None)
    if first is None:
        raise LogError(path, "the log is empty; expected a header, then a row per sample")
    header = tuple(name.strip().lstrip("# ") for name in first[1])  # "# time" is NumPy's habit
    for name in header:
        if not name.isprintable():
            raise LogError(
                path, f"the name {name[:40]!r} cannot be printed; is a quote open?", row=1
            )
    found = layout(path, header, mapped=mapped, joints=joints)
    wanted = [found.time, *(column.index for column in found.columns)]
    pick, names = itemgetter(*wanted), [header[index] for index in wanted]
    rows, stamps, numbers = array("q"), list[str](), array("d")
    for row, cells in lines:
        if len(cells) != len(header):
            raise LogError(
                path, f"{len(cells)} cells where the header names {len(header)} columns", row
            )
        try:
            numbers.extend(map(float, pick(cells)))
        except ValueError:
            raise _bad_cell(path, row, names, pick(cells)) from None
        rows.append(row)
        stamps.append(cells[found.time])
    if len(rows) < 2:
        raise LogError(path, f"{len(rows)} samples; a run needs at least 2")
    table = np.frombuffer(numbers).reshape(len(rows), len(wanted))
    if not np.isfinite(table).all():
        sample, place = np.argwhere(~np.isfinite(table))[0]
        raise LogError(path, f"column {names[place]!r} holds {table[sample, place]}", rows[sample])
    exact = [Decimal(stamp) for stamp in stamps]  # absolute stamps need more digits than a float
    for row, (before, after) in zip(rows[1:], pairwise(exact), strict=True):
        if after <= before:
            how = "stands still" if after == before else "runs backwards"
            raise LogError(path, f"time {how}: {after} comes after {before}", row)
    since = np.array([float(stamp - exact[0]) for stamp in exact])
    unit = _unit(path, float(np.median(np.diff(since))), rate)
    return Log(
        path=path,
        header=header,
        columns=found.columns,
        left=found.left,
        rows=rows,
        start=exact[0] * Decimal(UNITS[unit]),
        unit=unit,
        time=since if unit == "seconds" else since * float(UNITS[unit]),
        table=table[:, 1:],
    )


def _cells(path: Path, stream: TextIO) -> Iterator[tuple[int, list[str]]]:
    """Go through line number and cells of all lines that are not blank."""
    head = stream.readline()
    stream.seek(0)
    delimiter = next((mark for mark in ",;\t" if mark in head), " ")
    lines = csv.reader(stream, delimiter=delimiter, skipinitialspace=True)
    try:
        for cells in lines:
            if cells not in ([], [""]):
                yield lines.line_num, cells
    except csv.Error as error:
        raise LogError(path, f"not a CSV log ({error})", lines.line_num) from error


def _bad_cell(path: Path, row: int, names: Sequence[str], cells: Sequence[str]) -> LogError:
    for name, cell in zip(names, cells, strict=True):
        if not cell.strip():
            return LogError(
                path,
                f"column {name!r} is empty; columns of another clock belong into a log of their"
                " own (--desired)",
                row,
            )
        if not _is_number(cell):
            return LogError(path, f"column {name!r} holds {cell!r}, which is no number", row)
    raise AssertionError("every cell is a number")


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _unit(path: Path, step: float, rate: float | None) -> str:
    """Tell the unit of stamps from their median step."""
    if rate is not None and isfinite(rate) and rate > 0:
        return min(UNITS, key=lambda unit: abs(log(step * float(UNITS[unit]) * rate)))
    if step <= SLOWEST:
        return "seconds"
    if step >= FASTEST_NS:
        return "nanoseconds"
    raise LogError(
        path,
        f"the stamps' median step is {step:g}; expected seconds or nanoseconds; with the log's"
        " rate (--rate) other units are recognised",
    )
