"""CSV logs with a header and a row per sample."""

import csv
from array import array
from collections.abc import Iterator, Sequence
from decimal import Decimal
from operator import itemgetter
from pathlib import Path
from typing import TextIO

import numpy as np

from inspector.errors import LogError
from inspector.logs.arrays import CELLS, gathered
from inspector.logs.log import Field, Log, LogReader, Progress, Stamps
from inspector.logs.options import ReadOptions
from inspector.logs.signals import TIMES, column_signal, listed
from inspector.logs.timestamps import UNITS, unit_of


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of a CSV log, a header and then a row per sample.

    The delimiter is a comma, semicolon, tab or space; the decimal separator is a point.

    Args:
        path: The file.
        options: How to read it; the rate determines the unit of the stamps.
    """
    return LogReader(
        "CSV", ("",), lambda _, progress: read(path, options, progress), lambda: _listing(path)
    )


def read(path: Path, options: ReadOptions, progress: Progress) -> Log:
    """Log with the columns whose signal is known.

    Raises:
        LogError: If the file cannot be read, a row has more or fewer cells than the header, a
            cell of a column that is read holds no number, or no stamps are found.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            return _read(path, stream, options, progress)
    except OSError as error:
        raise LogError(path, f"cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise LogError(path, "not a CSV log: not text in UTF-8") from error


def _listing(path: Path) -> tuple[str, ...]:
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as stream:
        header = next(_cells(path, stream), (1, [""]))[1]
        rows = sum(1 for _ in stream)
    names = [name.strip().lstrip("# ") for name in header]
    return (f"{rows} rows", *(f"{name}  {_meaning(name)}" for name in names))


def _meaning(name: str) -> str:
    known = column_signal(name)
    return "not known" if known is None else f"{known[0]} of {known[1]}"


def _read(path: Path, stream: TextIO, options: ReadOptions, progress: Progress) -> Log:
    lines = _cells(path, stream)
    first = next(lines, None)
    if first is None:
        raise LogError(path, "the log is empty; expected a header, then a row per sample")
    header = tuple(name.strip().lstrip("# ") for name in first[1])  # NumPy writes "# time"
    _check_header(path, header)
    time = _time_column(path, header, options)
    mapped = {entry.source for entry in options.entries}
    wanted = [time] + [
        place
        for place, name in enumerate(header)
        if place != time
        and (name in mapped or column_signal(name) is not None or CELLS.fullmatch(name))
    ]
    not_read = tuple(name for place, name in enumerate(header) if name and place not in wanted)
    pick, names = itemgetter(*wanted, time), [header[place] for place in wanted]
    rows, stamps, numbers = array("q"), list[str](), array("d")
    for row, cells in progress(lines, 0):
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
    taken = _stamps(path, stamps, rows, options.rate)
    fields = (
        Field(name, table[:, place : place + 1], taken, source=path.name)
        for place, name in enumerate(names)
        if place
    )
    return gathered(Log(path, tuple(fields), not_read=not_read), options)


def _check_header(path: Path, header: Sequence[str]) -> None:
    for place, name in enumerate(header):
        if not name.isprintable():
            raise LogError(
                path,
                f"the name {name[:40]!r} cannot be printed; is a quotation mark not closed?",
                row=1,
            )
        if name and name in header[:place]:
            raise LogError(path, f"two columns are named {name!r}", row=1)


def _time_column(path: Path, header: Sequence[str], options: ReadOptions) -> int:
    if options.time in header:
        return header.index(options.time)
    mapped = {entry.source for entry in options.entries}
    known = {name.lower(): name for name in reversed(header) if name not in mapped}
    candidates = [known[name] for name in TIMES if name in known]
    if not candidates:
        raise LogError(
            path,
            f"no time column is named; expected one of {', '.join(TIMES)}, or --map time=COLUMN;"
            f" columns are {listed(header)}",
        )
    return header.index(candidates[0])


def _stamps(path: Path, cells: Sequence[str], rows: Sequence[int], rate: float | None) -> Stamps:
    exact = [Decimal(cell) for cell in cells]  # absolute stamps exceed the precision of a float
    since = np.array([float(stamp - exact[0]) for stamp in exact])
    unit = unit_of(path, np.diff(since), rate)
    return Stamps(
        start=exact[0] * Decimal(UNITS[unit]),
        time=since if unit == "seconds" else since * float(UNITS[unit]),
        rows=rows,
        unit=unit,
    )


def _cells(path: Path, stream: TextIO) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of each line that is not blank."""
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
                f"column {name!r} is empty; columns with another clock must be in a separate"
                " log (--desired)",
                row,
            )
        if not _is_number(cell):
            return LogError(path, f"column {name!r} holds {cell!r}, which is not a number", row)
    raise AssertionError("every cell is a number")


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
