"""A wide CSV log, checked cell by cell."""

import csv
from array import array
from collections.abc import Iterator, Sequence
from decimal import Decimal
from operator import itemgetter
from pathlib import Path
from typing import TextIO

import numpy as np

from inspector.errors import LogError
from inspector.logs.columns import TIMES, listed, named
from inspector.logs.log import Field, Log, Stamps
from inspector.logs.opened import Opened, Watch
from inspector.logs.reading import Reading
from inspector.logs.stamping import UNITS, unit_of


def open_log(path: Path, reading: Reading) -> Opened:
    """Offer a CSV log: a header, then a row per sample.

    Cells are separated by commas, semicolons, tabs or spaces, numbers have a decimal point.

    Args:
        path: The file.
        reading: What a person said of it; the rate tells the unit of the stamps.
    """
    return Opened("CSV", ("",), lambda _, watch: read(path, reading, watch), lambda: _listing(path))


def read(path: Path, reading: Reading, watch: Watch) -> Log:
    """Read the columns that are known to hold something.

    Raises:
        LogError: If the file cannot be read, a row has more or fewer cells than the header, a
            cell that is needed holds no number, or no stamps are found.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            return _read(path, stream, reading, watch)
    except OSError as error:
        raise LogError(path, f"cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise LogError(path, "not a CSV log: it is no text in UTF-8") from error


def _listing(path: Path) -> tuple[str, ...]:
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as stream:
        header = next(_cells(path, stream), (1, [""]))[1]
        rows = sum(1 for _ in stream)
    names = [name.strip().lstrip("# ") for name in header]
    return (f"{rows} rows", *(f"{name}  {_meant(name)}" for name in names))


def _meant(name: str) -> str:
    known = named(name)
    return "not known" if known is None else f"{known[0]} of {known[1]}"


def _read(path: Path, stream: TextIO, reading: Reading, watch: Watch) -> Log:
    lines = _cells(path, stream)
    first = next(lines, None)
    if first is None:
        raise LogError(path, "the log is empty; expected a header, then a row per sample")
    header = tuple(name.strip().lstrip("# ") for name in first[1])  # "# time" is NumPy's habit
    _check_header(path, header)
    time = _time_column(path, header, reading)
    said = {entry.source for entry in reading.entries}
    wanted = [time] + [
        place
        for place, name in enumerate(header)
        if place != time and (name in said or named(name) is not None)
    ]
    left = tuple(name for place, name in enumerate(header) if name and place not in wanted)
    pick, names = itemgetter(*wanted, time), [header[place] for place in wanted]
    rows, stamps, numbers = array("q"), list[str](), array("d")
    for row, cells in watch(lines, 0):
        if len(cells) != len(header):
            raise LogError(
                path, f"{len(cells)} cells where the header names {len(header)} columns", row
            )
        picked = pick(cells)
        try:
            numbers.extend(map(float, picked[:-1]))
        except ValueError:
            raise _bad_cell(path, row, names, picked[:-1]) from None
        rows.append(row)
        stamps.append(picked[-1])
    if len(rows) < 2:
        raise LogError(path, f"{len(rows)} samples; a run needs at least 2")
    table = np.frombuffer(numbers).reshape(len(rows), len(wanted))
    if not np.isfinite(table[:, 0]).all():
        sample = int(np.argmin(np.isfinite(table[:, 0])))
        raise LogError(path, f"column {names[0]!r} holds {table[sample, 0]}", rows[sample])
    taken = _stamps(path, stamps, rows, reading.rate)
    fields = (
        Field(name, table[:, place : place + 1], taken, source=path.name)
        for place, name in enumerate(names)
        if place
    )
    return Log(path, tuple(fields), left=left)


def _check_header(path: Path, header: Sequence[str]) -> None:
    for place, name in enumerate(header):
        if not name.isprintable():
            raise LogError(
                path, f"the name {name[:40]!r} cannot be printed; is a quote open?", row=1
            )
        if name and name in header[:place]:
            raise LogError(path, f"two columns are named {name!r}", row=1)


def _time_column(path: Path, header: Sequence[str], reading: Reading) -> int:
    if reading.time in header:
        return header.index(reading.time)
    said = {entry.source for entry in reading.entries}
    known = {name.lower(): name for name in reversed(header) if name not in said}
    candidates = [known[name] for name in TIMES if name in known]
    if not candidates:
        raise LogError(
            path,
            f"no time column is named; expected one of {', '.join(TIMES)}, or --map time=COLUMN;"
            f" columns are {listed(header)}",
        )
    return header.index(candidates[0])


def _stamps(path: Path, cells: Sequence[str], rows: Sequence[int], rate: float | None) -> Stamps:
    exact = [Decimal(cell) for cell in cells]  # absolute stamps need more digits than a float
    since = np.array([float(stamp - exact[0]) for stamp in exact])
    unit = unit_of(path, np.diff(since), rate)
    return Stamps(
        start=exact[0] * Decimal(UNITS[unit]),
        time=since if unit == "seconds" else since * float(UNITS[unit]),
        rows=rows,
        unit=unit,
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
