"""CSV logs with a row per sample, as robots, tools and spreadsheets write them."""

import csv
import re
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import TextIO

import numpy as np

from inspector.errors import LogError
from inspector.logs.arrays import CELLS, gathered
from inspector.logs.log import Field, Log, LogReader, Progress, Stamps
from inspector.logs.options import ReadOptions
from inspector.logs.signals import (
    JOINT_SIGNALS,
    TIME_UNITS,
    TIMES,
    Naming,
    array_signal,
    column_signal,
    factor_of,
    listed,
    says_twice,
    time_column,
    without_unit,
)
from inspector.logs.signals import (
    UNITS as SIGNAL_UNITS,
)
from inspector.logs.timestamps import UNITS, unit_of
from inspector.text import counted
from noisemodel.bounds import beyond, limit
from noisemodel.types import Array

DELIMITERS = (";", "\t", ",", " ")
"""Marks between cells."""

COMMENTS = ("#", "%", "//")
"""Beginnings of lines that are comments, or of a header that NumPy or rostopic wrote."""

MISSING = frozenset(("", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--"))
"""Cells without a number, in any case."""

HEAD = 200
"""Lines among which the first row of numbers is looked for."""

SPARSE = 0.5
"""Share of rows without a number from which a column has another clock."""

SECONDS = re.compile(r"(?P<record>.*?)secs?(?:onds)?", re.IGNORECASE)
NANOSECONDS = ("nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds")
"""Endings of the two columns of a stamp in whole seconds, and nanoseconds since."""

NAME = "field.name"
"""Beginning of rostopic's columns with the joints' names, which end with a number."""


@dataclass(frozen=True)
class Layout:
    """How a file is laid out.

    Attributes:
        delimiter: Mark between cells.
        header: Names of the columns.
        row: Line number of the header; 0 if the options name the columns.
        skip: Lines up to the header, and it itself.
        remarks: What was found, a sentence each.
    """

    delimiter: str
    header: tuple[str, ...]
    row: int
    skip: int
    remarks: tuple[str, ...] = ()


LONGEST_LINE = 4 * 2**20
"""Characters of a line: far more than those of so many columns as are read."""

DIGITS = 30
"""Stamps have at most so many digits before or after the point."""


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of a CSV log, with a row per sample and, unless the options name them, a header.

    The delimiter is a comma, semicolon, tab or blanks; the decimal separator a point, or a comma
    where that is not the delimiter.

    Args:
        path: The file.
        options: How to read it; the rate determines the unit of the stamps, or takes their place.
    """
    return LogReader(
        "CSV",
        ("",),
        lambda _, progress: read(path, options, progress),
        lambda: _listing(path, options),
    )


def read(path: Path, options: ReadOptions, progress: Progress) -> Log:
    """Log with the columns whose signal is known.

    Raises:
        LogError: If the file cannot be read or has no header, a row has more or fewer cells than
            the header, a cell of a column that is read holds text, or no stamps are found.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            return _read(path, stream, options, progress)
    except OSError as error:
        raise LogError(path, f"cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise LogError(path, "not a CSV log: not text in UTF-8") from error


def _listing(path: Path, options: ReadOptions) -> tuple[str, ...]:
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as stream:
        layout = _layout(path, stream, options)
        stream.seek(0)
        rows = sum(1 for _ in islice(_lines(path, stream), layout.skip, None))
    time = options.time or time_column(layout.header)
    naming = Naming.of(layout.header)
    return (
        f"{rows} rows",
        *(
            f"{name}  {'stamps' if name == time else _meaning(name, naming)}"
            for name in layout.header
            if name
        ),
    )


def _lines(path: Path, stream: TextIO) -> Iterator[str]:
    """Lines of a log, which end."""
    while line := stream.readline(LONGEST_LINE):
        if len(line) == LONGEST_LINE:
            raise LogError(path, f"not a CSV log: a line of more than {LONGEST_LINE} characters")
        yield line


def _meaning(name: str, naming: Naming) -> str:
    if known := column_signal(name, naming):
        joint = f"joint {known[1]}" if isinstance(known[1], int) else known[1]
        return f"{known[0]} of {joint}"
    signal = array_signal(name)
    return f"{signal} of the only joint" if signal in JOINT_SIGNALS else "not known"


def _read(path: Path, stream: TextIO, options: ReadOptions, progress: Progress) -> Log:
    layout = _layout(path, stream, options)
    header = layout.header
    _check_header(path, layout)
    time = _time_column(path, header, options)
    rest = _nanoseconds(header, time)
    mapped = {entry.source for entry in options.entries}
    named = {place: name for place, name in enumerate(header) if name.startswith(NAME)}
    wanted = [
        place
        for place, name in enumerate(header)
        if place not in (time, rest)
        and (
            name in mapped
            or column_signal(name)
            or array_signal(name) in JOINT_SIGNALS
            or CELLS.fullmatch(name)
        )
    ]
    known = {time, rest, *wanted, *named}
    not_read = tuple(name for place, name in enumerate(header) if name and place not in known)
    if not wanted:
        raise LogError(
            path,
            "no position or velocity of a joint; name columns JOINT.velocity or JOINT.position, or"
            " map them with --map velocity.JOINT=COLUMN or --map velocity=ARRAY, or name all in"
            f" their order, such as --columns {_all_positions(len(header), time)}; columns"
            f" are {listed([name for name in header if name])}",
        )
    rows, stamps, numbers, joints = array("q"), list[str](), array("d"), set[tuple[str, ...]]()
    pick = itemgetter(*wanted, wanted[0])
    for row, cells in progress(_rows(path, stream, layout), 0):
        picked = pick(cells)[:-1]
        try:
            found = list(map(float, picked))
        except ValueError:
            found = _numbers(path, row, layout, [header[place] for place in wanted], picked)
        numbers.extend(found)
        rows.append(row)
        if time is not None:
            part = "" if rest is None else f".{cells[rest].strip():0>9}"
            stamps.append(cells[time].strip() + part)
        if named:
            joints.add(tuple(cells[place] for place in named))
    if len(rows) < 2:
        raise LogError(path, f"{counted(len(rows), 'sample')}; a run needs at least 2")
    table = np.frombuffer(numbers).reshape(len(rows), len(wanted))
    if time is None:
        assert options.rate is not None  # else there is an error above
        taken = Stamps(
            Decimal(0),
            np.arange(len(rows)) / options.rate,
            rows,
            remark=f"no stamps: {len(rows)} samples at {options.rate:g} Hz, as --rate says",
        )
    else:
        taken = _stamps(path, header[time], stamps, rows, options.rate)
    _check_sparse(path, [header[place] for place in wanted], table, rows)
    if len(joints) > 1:
        raise LogError(path, f"the joints' names change ({header[min(named)]}); split the log")
    names = dict(zip(named.values(), next(iter(joints), ()), strict=True))
    columns = {header[place]: table[:, at : at + 1] for at, place in enumerate(wanted)}
    fields, converted = _fields(path, columns, taken, names, options)
    log = Log(
        path,
        fields,
        not_read=not_read,
        remarks=(*layout.remarks, *converted),
        time="" if time is None else header[time],
    )
    return gathered(log, options)


def _fields(
    path: Path,
    columns: dict[str, Array],
    stamps: Stamps,
    joints: dict[str, str],
    options: ReadOptions,
) -> tuple[tuple[Field, ...], tuple[str, ...]]:
    """Fields of the columns, in SI units where a name has a unit, and remarks on units."""
    fields: list[Field] = []
    converted: dict[str, list[str]] = {}
    for name, values in columns.items():
        if (factor := factor_of(name)) != 1.0 and not options.units:
            values = values * factor
            converted.setdefault(without_unit(name)[1], []).append(name)
        known = column_signal(name)
        joint = joints.get(f"{NAME}{known[1]}") if known else None
        fields.append(
            Field(
                name,
                values,
                stamps,
                joints=(joint,) if joint else (),
                signal=known[0] if known and joint else "",
                source=path.name,
                rank=int(says_twice(name)),
            )
        )
    remarks = (
        f"{listed(names)}: converted from {unit}, as the header says"
        for unit, names in converted.items()
    )
    return tuple(fields), tuple(remarks)


def _layout(path: Path, stream: TextIO, options: ReadOptions) -> Layout:
    """Delimiter and header of a file, found by its first row of numbers."""
    lines = list(islice(_lines(path, stream), HEAD))
    stream.seek(0)
    try:
        return _layout_of(path, lines, options)
    except csv.Error as error:
        raise LogError(path, f"not a CSV log ({error})") from error


def _layout_of(path: Path, lines: Sequence[str], options: ReadOptions) -> Layout:
    if not any(line.strip() for line in lines):
        raise LogError(path, "the log is empty; expected a header, then a row per sample")
    delimiter, first = _first_data(lines)
    before = [
        (number, _split(line, delimiter))
        for number, line in enumerate(lines[:first], start=1)
        if line.strip()
    ]
    if options.columns:
        skip = before[-1][0] if before and first is not None else 0
        columns = tuple(name.strip() for name in options.columns)
        return Layout(delimiter, columns, 0, skip, _skipped(before, ()))
    if first is None:  # no numbers: the first line is the header, and rows tell what is wrong
        rows = csv.reader(lines, delimiter=delimiter, skipinitialspace=True)
        return Layout(delimiter, _clean(next(filter(None, rows))), 1, rows.line_num)
    width = len(_split(lines[first], delimiter))
    fitting = [each for each in before if abs(len(each[1]) - width) <= 1]
    plain = [each for each in fitting if not each[1][0].startswith(COMMENTS)]
    candidates = plain or fitting or [each for each in before if _names_motion(each[1])]
    if not candidates:
        cells = [_split(line, delimiter) for line in lines[first : first + 2]]
        raise _no_header(path, cells, before)
    row = candidates[-1][0]
    rows = csv.reader(lines[row - 1 :], delimiter=delimiter, skipinitialspace=True)
    header: list[str] = next(rows)  # with an open quotation mark, it takes more lines
    names, used = _clean(header), [row]
    if len(candidates) > 1 and _are_units(names):
        used.append(candidates[-2][0])
        units = [name.strip("[]() ") for name in names]
        names = tuple(
            f"{name} [{unit}]" if unit else name
            for name, unit in zip(_clean(candidates[-2][1]), units, strict=False)
        )
    return Layout(delimiter, names, row, first, _skipped(before, used))


def _first_data(lines: Sequence[str]) -> tuple[str, int | None]:
    """Delimiter, and index of the first line of numbers; None if there is none."""
    for place, line in enumerate(lines):
        shares = {mark: _share_of_numbers(_split(line, mark)) for mark in DELIMITERS}
        best = max(shares, key=lambda mark: shares[mark])  # the first of equals
        if shares[best] >= 0.5:
            return best, place
    head = next(line for line in lines if line.strip())
    return next((mark for mark in DELIMITERS if mark in head), " "), None


def _share_of_numbers(cells: Sequence[str]) -> float:
    """Share of cells that hold a number or nothing; 0 unless it may be a row of numbers."""
    if len(cells) < 2 or not (_is_number(cells[0]) or _is_date(cells[0])):
        return 0.0
    return sum(_is_number(cell) or cell.strip().lower() in MISSING for cell in cells) / len(cells)


def _split(line: str, delimiter: str) -> list[str]:
    return next(csv.reader([line.strip()], delimiter=delimiter, skipinitialspace=True), [])


def _clean(cells: Sequence[str]) -> tuple[str, ...]:
    """Names of a header; NumPy writes "# time", rostopic "%time"."""
    first = cells[0].strip().lstrip("#% ")
    marked_alone = cells[0].strip() and not first  # as in "# time q"
    return (*(() if marked_alone else (first,)), *(name.strip() for name in cells[1:]))


def _is_comment(cells: Sequence[str]) -> bool:
    return cells[0].lstrip().startswith(COMMENTS)


def _names_motion(cells: Sequence[str]) -> bool:
    names = _clean(cells)
    return bool(time_column(names)) or any(map(column_signal, names))


def _are_units(names: Sequence[str]) -> bool:
    units = [name.strip("[]() ").lower() for name in names]
    return any(units) and all(
        not each or each in SIGNAL_UNITS or each in TIME_UNITS for each in units
    )


def _skipped(before: Sequence[tuple[int, list[str]]], used: Sequence[int]) -> tuple[str, ...]:
    lines = [number for number, _ in before if number not in used]
    if not lines:
        return ()
    return (f"{len(lines)} line{'' if len(lines) == 1 else 's'} before the rows not read",)


def _no_header(
    path: Path, rows: Sequence[list[str]], before: Sequence[tuple[int, list[str]]]
) -> LogError:
    width = len(rows[0]) - (not rows[0][-1].strip())
    first = [float(row[0].replace(",", ".")) for row in rows if row and _is_number(row[0])]
    stamped = len(first) < 2 or first[1] > first[0]
    how = " (without stamps: no time, and --rate 1000)" if stamped else " --rate 1000"
    return LogError(
        path,
        f"there is no header; the first row has {width} numbers. Name the columns in their order,"
        f" such as --columns {_suggested(width, stamped=stamped)}{how}",
        before[-1][0] + 1 if before else 1,
    )


def _suggested(width: int, *, stamped: bool = True) -> str:
    """Names of so many columns: stamps, if there are any, positions, and as many velocities."""
    left = width - stamped
    quantities = ("q", "dq") if left % 2 == 0 else ("q",)
    joints = range(1, left // len(quantities) + 1)
    names = (f"{each}{number}" for each in quantities for number in joints)
    return ",".join((*(("time",) if stamped else ()), *names))


def _all_positions(width: int, time: int | None) -> str:
    """Names of the columns of a log that has positions beside its stamps."""
    joints = iter(range(1, width + 1))
    return ",".join("time" if place == time else f"q{next(joints)}" for place in range(width))


def _check_header(path: Path, layout: Layout) -> None:
    header, row = layout.header, layout.row or None
    if len(header) > limit("columns"):
        raise LogError(path, f"{len(header)} columns, {beyond('columns')}", row=row)
    seen = set[str]()
    for name in header:
        if not name.isprintable():
            raise LogError(
                path,
                f"the name {name[:40]!r} cannot be printed; is a quotation mark not closed?",
                row=row,
            )
        if name and name in seen:
            raise LogError(path, f"two columns are named {name!r}", row=row)
        seen.add(name)


def _time_column(path: Path, header: Sequence[str], options: ReadOptions) -> int | None:
    """Place of the column with the stamps; None if the rate takes their place."""
    if options.time and options.time in header:
        return header.index(options.time)
    mapped = {entry.source for entry in options.entries}
    if found := time_column([name for name in header if name not in mapped]):
        return header.index(found)
    if options.rate is not None and not options.time:
        return None
    raise LogError(
        path,
        f"no time column is named; expected one of {', '.join(TIMES)}, or --map time=COLUMN;"
        f" a log without stamps needs its rate, such as --rate 1000; columns are {listed(header)}",
    )


def _nanoseconds(header: Sequence[str], time: int | None) -> int | None:
    """Place of the nanoseconds beside stamps in whole seconds, as ROS has them; None without."""
    if time is None or not (seconds := SECONDS.fullmatch(header[time])):
        return None
    whole = {name.lower(): place for place, name in enumerate(header)}
    names = (f"{seconds['record']}{word}".lower() for word in NANOSECONDS)
    return next((whole[name] for name in names if name in whole), None)


def _stamps(
    path: Path, name: str, cells: Sequence[str], rows: Sequence[int], rate: float | None
) -> Stamps:
    exact = _decimals(path, name, cells, rows)  # absolute stamps exceed the precision of a float
    since = np.array([float(stamp - exact[0]) for stamp in exact])
    unit = unit_of(path, np.diff(since), rate, name=name, first=float(exact[0]))
    return Stamps(
        start=exact[0] * Decimal(UNITS[unit]),
        time=since if unit == "seconds" else since * float(UNITS[unit]),
        rows=rows,
        unit=unit,
    )


def _decimals(
    path: Path, name: str, cells: Sequence[str], rows: Sequence[int]
) -> Sequence[Decimal]:
    """Stamps, of dates in [s] since 1970."""
    if _is_date(cells[0]):
        try:
            dates = np.array([cell.strip().rstrip("Z") for cell in cells], dtype="datetime64[ns]")
        except ValueError as error:
            raise LogError(path, f"column {name!r} holds dates and others ({error})") from error
        return [Decimal(int(each)).scaleb(-9) for each in dates.astype(np.int64)]
    found = []
    for row, cell in zip(rows, cells, strict=True):
        try:
            stamp = Decimal(cell.strip().replace(",", "."))
        except InvalidOperation:
            empty = not cell.strip()
            what = "is empty" if empty else f"holds {cell[:40]!r}, which is not a number"
            raise LogError(path, f"column {name!r} {what}", row) from None
        if not stamp.is_finite():
            raise LogError(path, f"column {name!r} holds {cell.strip()[:40]}", row)
        if stamp and not -DIGITS < stamp.adjusted() < DIGITS:
            raise LogError(path, f"the stamp {cell.strip()[:40]!r} is no time", row)
        found.append(stamp)
    return found


def _rows(path: Path, stream: TextIO, layout: Layout) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of each row, without comments, blank lines and trailing separators."""
    lines = csv.reader(
        islice(_lines(path, stream), layout.skip, None),
        delimiter=layout.delimiter,
        skipinitialspace=True,
    )
    width = len(layout.header)
    try:
        for cells in lines:
            if len(cells) != width:
                if cells in ([], [""]) or _is_comment(cells):
                    continue
                cells = _fitted(cells, layout.header)
                if len(cells) != width:
                    names = "the header names" if layout.row else "--columns names"
                    raise LogError(
                        path,
                        f"{len(cells)} cells where {names} {width} columns",
                        layout.skip + lines.line_num,
                    )
            elif cells[0][:1] in ("#", "%", "/") and _is_comment(cells):
                continue
            yield layout.skip + lines.line_num, cells
    except csv.Error as error:
        row = layout.skip + lines.line_num
        raise LogError(path, f"not a CSV log ({error})", row) from error


def _fitted(cells: list[str], header: Sequence[str]) -> list[str]:
    """Cells without those after a trailing separator, or with the one that the header has."""
    width = len(header)
    if len(cells) == width - 1 and not header[-1]:
        return [*cells, ""]
    return cells[:width] if not any(cell.strip() for cell in cells[width:]) else cells


def _numbers(
    path: Path, row: int, layout: Layout, names: Sequence[str], cells: Sequence[str]
) -> list[float]:
    """Numbers of cells of which some are empty, have a decimal comma, or are no numbers."""
    found = []
    for name, cell in zip(names, cells, strict=True):
        if cell.strip().lower() in MISSING:
            found.append(np.nan)
        elif _is_number(cell):
            found.append(float(cell.replace(",", ".")))
        else:
            raise LogError(path, f"column {name!r} holds {cell[:40]!r}, which is not a number", row)
    return found


def _check_sparse(path: Path, names: Sequence[str], table: Array, rows: Sequence[int]) -> None:
    """Refuse columns that have numbers in some rows only, since they have another clock."""
    lacking = np.isnan(table)
    counts = lacking.sum(axis=0)
    sparse = (counts >= SPARSE * len(table)) & (counts < len(table))
    if sparse.any():
        place = int(np.argmax(sparse))
        raise LogError(
            path,
            f"column {names[place]!r} is empty; {counts[place]} of {len(table)} rows have no"
            " number there, and columns with another clock must be in a separate log (--desired)",
            rows[int(np.argmax(lacking[:, place]))],
        )


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return cell.strip().lower() not in MISSING


def _is_date(cell: str) -> bool:
    try:
        return "-" in cell[1:] and not np.isnat(np.datetime64(cell.strip().rstrip("Z"), "ns"))
    except ValueError:
        return False
