"""CSV logs with a row per sample, as robots, tools and spreadsheets write them."""

import csv
import re
from array import array
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from decimal import Decimal, InvalidOperation
from functools import partial
from io import StringIO
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np

from inspector.errors import LogError
from inspector.logs.arrays import episodes_of, log_of, may_hold
from inspector.logs.clocks import stamps_since
from inspector.logs.mapping import Log, LogReader, ReadOptions, Stamps, errors_of, no_motion
from inspector.logs.names import (
    EPISODES,
    JOINT_SIGNALS,
    TIME_UNITS,
    Naming,
    array_signal,
    column_signal,
    time_column,
)
from inspector.logs.names import UNITS as SIGNAL_UNITS
from inspector.text import counted
from noisemodel.files import beyond, limit
from noisemodel.types import Array

DELIMITERS = (";", "\t", ",", " ")  # marks between cells
COMMENTS = ("#", "%", "//")  # of lines, or of a header that NumPy or rostopic wrote
# Cells without a number, in any case.
MISSING = frozenset(("", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--"))
FLAGS = {"true": "1", "false": "0"}
HEAD = 200  # lines among which the first row of numbers is looked for
COLUMNS = "such as --columns time,q1,q2,dq1,dq2 (without stamps: no time, but --rate HZ)"
LONGEST_LINE = 4 * 2**20  # characters of a line: far more than all columns that are read can have
DIGITS = 30  # stamps have at most so many digits before or after the point
PIECE = 2**20  # characters that are read at once

SECONDS = re.compile(r"(?P<record>.*?)secs?(?:onds)?", re.IGNORECASE)
# Endings of the two columns of a stamp in whole seconds, and nanoseconds since.
NANOSECONDS = ("nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds")
YEARS = range(1900, 2100)  # of dates; stamps that are larger are in another unit than seconds
DAY = datetime(1970, 1, 1, tzinfo=UTC)


class Layout(NamedTuple):
    """How a file is laid out."""

    delimiter: str
    header: tuple[str, ...]
    row: int = 0  # line number of the header, unless the options name the columns
    skip: int = 0  # lines up to the header, and it itself
    remarks: tuple[str, ...] = ()


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of a CSV log."""
    with _opened(path) as stream:
        layout = _layout(path, stream, options)
        episodes = _episodes(path, stream, layout)
    read = partial(_read, path, layout, options, episodes)
    return LogReader("CSV", (*episodes,), read, partial(_listing, path, layout, options))


def _episodes(path: Path, stream: TextIO, layout: Layout) -> dict[str, slice]:
    """Episodes that columns number or end; one if they hold other text."""
    places = [at for at, name in enumerate(layout.header) if name.lower() in EPISODES]
    if places:
        with suppress(LogError):
            _, values, _ = _table(path, stream, layout, places, ())
            return episodes_of({layout.header[at]: values[:, n] for n, at in enumerate(places)})
    return {"": slice(None)}


def _listing(path: Path, layout: Layout, options: ReadOptions) -> tuple[str, ...]:
    with _opened(path) as stream:
        rows = sum(1 for _ in islice(_lines(path, stream), layout.skip, None))
    time = options.stamps_in(layout.header)
    naming = Naming.of(layout.header, options.known_joints)

    def held(name: str) -> str:
        if name == time:
            return "stamps"
        if known := column_signal(name, naming):
            joint = f"joint {known[1]}" if isinstance(known[1], int) else known[1]
            return f"{known[0]} of {joint}"
        if naming.alone and (signal := array_signal(name, naming)) in JOINT_SIGNALS:
            return f"{signal} of the only joint"
        return "a column of an array" if may_hold(name, naming) else "not known"

    return (f"{rows} rows", *(f"{name}  {held(name)}" for name in layout.header if name))


@contextmanager
def _opened(path: Path) -> Iterator[TextIO]:
    with errors_of(path, (csv.Error,), "not a CSV log"):
        try:
            with path.open(newline="", encoding="utf-8-sig") as stream:
                yield stream
        except UnicodeDecodeError as error:
            raise LogError(path, "not a CSV log: not text in UTF-8") from error


def _read(
    path: Path, layout: Layout, options: ReadOptions, episodes: Mapping[str, slice], episode: str
) -> Log:
    """Log of an episode, with the columns whose signal is known."""
    header, times = layout.header, _times(layout.header, options)
    names = [name for place, name in enumerate(header) if name and place not in times]
    options = options.for_columns(path, names)
    wanted = _wanted(path, layout, times, options)
    with _opened(path) as stream:
        rows, values, cells = _table(path, stream, layout, wanted, times)
    part = episodes[episode]
    rows, values, cells = rows[part], values[part], cells[part]
    if len(rows) < 2:
        raise LogError(path, f"{counted(len(rows), 'sample')}; a run needs at least 2")
    stamps = Stamps.counted(len(rows))
    if times:  # absolute stamps exceed the precision of a float
        time = header[times[0]]
        exact = _decimals(path, time, cells, rows)
        since = np.array([float(stamp - exact[0]) for stamp in exact])
        unit = "" if _date(cells[0]) is None else "seconds"
        stamps = stamps_since(path, time, exact[0], since, options.rate, unit)
    arrays = {header[place]: values[:, at] for at, place in enumerate(wanted)}
    not_read = [n for n in names if n not in arrays and n.lower() not in EPISODES]
    stamps = replace(stamps, rows=rows)
    log = log_of(path, arrays, options, stamps=stamps, not_read=not_read)
    return replace(log, remarks=layout.remarks)


# Header and columns


def _lines(path: Path, stream: TextIO) -> Iterator[str]:
    """Lines of a log, which end."""
    while line := stream.readline(LONGEST_LINE):
        if len(line) == LONGEST_LINE:
            raise LogError(path, f"not a CSV log: a line of more than {LONGEST_LINE} characters")
        yield line


def _layout(path: Path, stream: TextIO, options: ReadOptions) -> Layout:
    """Delimiter and header of a file, found by its first row of numbers."""
    lines = list(islice(_lines(path, stream), HEAD))
    stream.seek(0)
    if not any(line.strip() for line in lines):
        raise LogError(path, "the log is empty; expected a header, then a row per sample")
    delimiter, first = _first_data(lines)
    if first is None and not options.columns:  # the first line names, rows tell what is wrong
        rows = csv.reader(lines, delimiter=delimiter, skipinitialspace=True)
        return Layout(delimiter, _clean(next(filter(None, rows))), 1, rows.line_num)
    above = {n: line for n, line in enumerate(lines[: first or 0], start=1) if line.strip()}
    before = {number: _split(line, delimiter) for number, line in above.items()}
    header, used = tuple(name.strip() for name in options.columns), list[int]()
    if first is not None and not header:
        width = len(_split(lines[first], delimiter))
        names = {number: _clean(cells) for number, cells in before.items()}
        fitting = [number for number, cells in before.items() if abs(len(cells) - width) <= 1]
        plain = [number for number in fitting if not before[number][0].startswith(COMMENTS)]
        known = [n for n, row in names.items() if time_column(row) or any(map(column_signal, row))]
        candidates = plain or fitting or known
        if not candidates:
            count = width - lines[first].rstrip().endswith(delimiter)
            problem = f"there is no header; the first row has {count} numbers"
            raise LogError(path, f"{problem}. Name the columns in order, {COLUMNS}", first + 1)
        used = candidates[-1:]
        # with an open quotation mark, the header takes more lines
        rows = csv.reader(lines[used[0] - 1 :], delimiter=delimiter, skipinitialspace=True)
        header = _clean(next(rows))
        units = [name.strip("[]() ") for name in header]
        are_units = all(not unit or unit.lower() in {*SIGNAL_UNITS, *TIME_UNITS} for unit in units)
        if len(candidates) > 1 and any(units) and are_units:
            used = candidates[-2:]
            pairs = zip(names[used[0]], units, strict=False)
            header = tuple(f"{name} [{unit}]" if unit else name for name, unit in pairs)
    others = len(before) - len(used)
    remarks = (f"{counted(others, 'line')} before the rows not read",) if others else ()
    return Layout(delimiter, header, used[-1] if used else 0, first or 0, remarks)


def _first_data(lines: Sequence[str]) -> tuple[str, int | None]:
    """Delimiter, and index of the first line of numbers; None if there is none."""

    def share_of_numbers(line: str, mark: str) -> float:
        cells = _split(line, mark)
        numbers = [_number(each) for each in cells]
        if len(cells) < 2 or (numbers[0] in (None, np.nan) and _date(cells[0]) is None):
            return 0.0
        return 1 - numbers.count(None) / len(cells)

    for place, line in enumerate(lines):
        shares = {mark: share_of_numbers(line, mark) for mark in DELIMITERS}
        best = max(shares, key=lambda mark: shares[mark])  # the first of equals
        if shares[best] >= 0.5:
            return best, place
    head = next(line for line in lines if line.strip())
    return next((mark for mark in DELIMITERS if mark in head), " "), None


def _split(line: str, delimiter: str) -> list[str]:
    return next(csv.reader([line.strip()], delimiter=delimiter, skipinitialspace=True), [])


def _clean(cells: Sequence[str]) -> tuple[str, ...]:
    """Names of a header; NumPy writes "# time", rostopic "%time"."""
    first = cells[0].strip().lstrip("#% ")
    marked_alone = cells[0].strip() and not first  # as in "# time q"
    return (*(() if marked_alone else (first,)), *(name.strip() for name in cells[1:]))


def _times(header: Sequence[str], options: ReadOptions) -> tuple[int, ...]:
    """Place of the stamps, and of the nanoseconds beside whole seconds, as ROS has them."""
    if not (name := options.stamps_in(header)):
        return ()
    seconds, places = SECONDS.fullmatch(name), {each.lower(): n for n, each in enumerate(header)}
    words = [f"{seconds['record']}{word}".lower() for word in NANOSECONDS if seconds]
    return header.index(name), *[places[word] for word in words if word in places][:1]


def _wanted(path: Path, layout: Layout, times: Sequence[int], options: ReadOptions) -> list[int]:
    """Places of the columns that are read."""
    header, row = layout.header, layout.row or None
    if len(header) > limit("columns"):
        raise LogError(path, f"{len(header)} columns, {beyond('columns')}", row=row)
    if odd := next((name for name in header if not name.isprintable()), ""):
        problem = f"the name {odd[:40]!r} cannot be printed; is a quotation mark not closed?"
        raise LogError(path, problem, row)
    mapped = options.mapped
    naming = Naming.of(header, options.known_joints)
    others = [place for place in range(len(header)) if place not in times]
    wanted = [n for n in others if header[n] in mapped or may_hold(header[n], naming)]
    for place in (*wanted, *times[:1]):
        if header.count(header[place]) > 1:
            raise LogError(path, f"two columns are named {header[place]!r}", row)
    if not wanted:
        raise no_motion(path, header)
    return wanted


# Rows


def _table(
    path: Path, stream: TextIO, layout: Layout, wanted: Sequence[int], times: Sequence[int]
) -> tuple["array[int]", Array, list[str]]:
    """Line numbers, numbers and stamps of all rows."""
    rows, table, stamps = array("q"), array("d"), list[str]()
    pick = itemgetter(*wanted, wanted[0])
    names = [layout.header[place] for place in wanted]
    for _ in range(layout.skip):
        stream.readline(LONGEST_LINE)
    first, (at, rest) = layout.skip, (*times, None, None)[:2]
    large = False  # once: a small file is read before pyarrow is imported
    while text := _piece(path, stream):
        lines = text.count("\n")
        found, large = None, large or len(text) >= PIECE
        if large and rest is None and not any(f"\n{mark}" in f"\n{text}" for mark in COMMENTS):
            found = numbers_in(text.encode(), len(layout.header), layout.delimiter, wanted, at)
        if found is not None:
            table.frombytes(found[0].tobytes())
            rows.extend(range(first + 1, first + 1 + lines))
            stamps += found[1]
        else:
            for row, cells in _rows(path, text, first, layout):
                picked = pick(cells)[:-1]
                try:
                    table.extend(list(map(float, picked)))
                except ValueError:
                    table.extend(_numbers(path, row, names, picked))
                rows.append(row)
                if at is not None:
                    part = "" if rest is None else f".{cells[rest].strip():0>9}"
                    stamps.append(cells[at].strip() + part)
        first += lines
    return rows, np.frombuffer(table).reshape(len(rows), len(wanted)), stamps


def _piece(path: Path, stream: TextIO) -> str:
    """Whole lines, of which none is quoted over the end of a piece."""
    text = stream.read(PIECE)
    more, odd = list[str](), text.count('"') % 2
    if text and (odd or not text.endswith("\n")):
        for line in islice(_lines(path, stream), HEAD):
            more.append(line)
            odd ^= line.count('"') % 2
            if not odd:
                break
    return text + "".join(more)


def numbers_in(
    lines: bytes, width: int, delimiter: str, wanted: Sequence[int], text: int | None = None
) -> tuple[Array, list[str]] | None:
    """Plain numbers of whole lines, in a tenth of the time that a row at a time takes.

    Cells are converted as one array: beginning a hundred small columns costs as much again. The
    result is the numbers, shape (lines, wanted), and the text of each line; None if a line is too
    short or too long, or a cell is empty, quoted, padded or no number.
    """
    import pyarrow as pa

    if b"\r" in lines:
        lines = lines.replace(b"\r\n", b"\n")
    content = np.frombuffer(lines, dtype=np.uint8)
    ends = content == ord("\n")
    marks = np.flatnonzero(ends | (content == ord(delimiter)))
    rows = np.count_nonzero(ends)
    if len(marks) != rows * width or not ends[marks[width - 1 :: width]].all():
        return None
    edges = np.zeros(len(marks) + 1, dtype=np.int32)  # of cells, once the marks are gone
    edges[1:] = marks - np.arange(len(marks))
    written = lines.translate(None, b"\n" + delimiter.encode())
    cells: Any = pa.StringArray.from_buffers(len(marks), pa.py_buffer(edges), pa.py_buffer(written))
    firsts = np.arange(rows) * width
    some = cells
    if list(wanted) != list(range(width)):
        some = cells.take(pa.array(np.add.outer(firsts, np.asarray(wanted)).ravel()))
    try:
        numbers: Array = some.cast(pa.float64()).to_numpy()
        texts = [] if text is None else cells.take(pa.array(firsts + text)).to_pylist()
    except pa.ArrowInvalid:
        return None
    return numbers.reshape(rows, len(wanted)), texts


def _rows(path: Path, text: str, first: int, layout: Layout) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of each row, without comments, blank lines and trailing separators."""
    rows = csv.reader(StringIO(text, newline=""), delimiter=layout.delimiter, skipinitialspace=True)
    width = len(layout.header)
    try:
        for cells in rows:
            if len(cells) != width:
                if cells in ([], [""]) or cells[0].lstrip().startswith(COMMENTS):
                    continue
                if not any(map(str.strip, cells[width:])):
                    cells = cells[:width]  # the row ends with a separator
                if len(cells) != width:
                    names = "the header names" if layout.row else "--columns names"
                    problem = f"{len(cells)} cells where {names} {width} columns"
                    raise LogError(path, problem, first + rows.line_num)
            elif cells[0][:1] in ("#", "%", "/") and cells[0].startswith(COMMENTS):
                continue
            yield first + rows.line_num, cells
    except csv.Error as error:
        raise LogError(path, f"not a CSV log ({error})", first + rows.line_num) from error


def _numbers(path: Path, row: int, names: Sequence[str], cells: Sequence[str]) -> list[float]:
    """Numbers of cells of which some are empty, have a decimal comma, or are no numbers."""
    found = []
    for name, cell in zip(names, cells, strict=True):
        number = _number(FLAGS.get(cell.lower(), cell) if name.lower() in EPISODES else cell)
        if number is None:
            raise LogError(path, f"column {name!r} holds {cell[:40]!r}, which is not a number", row)
        found.append(number)
    return found


def _number(cell: str) -> float | None:
    """Number in a cell, `np.nan` itself in one without, None in one with other text."""
    with suppress(ValueError):
        return np.nan if cell.strip().lower() in MISSING else float(cell.replace(",", "."))
    return None


# Stamps


def _decimals(path: Path, name: str, cells: Sequence[str], rows: Sequence[int]) -> list[Decimal]:
    """Stamps, of dates in [s] since 1970."""
    dated = _date(cells[0]) is not None
    found = []
    for row, cell in zip(rows, map(str.strip, cells), strict=True):
        try:
            stamp = _date(cell) if dated else Decimal(cell.replace(",", "."))
        except InvalidOperation:
            stamp = None
        if stamp is None or not stamp.is_finite():
            what = f"holds {cell[:40]!r}, which is no time" if cell else "is empty"
            raise LogError(path, f"column {name!r} {what}", row)
        if stamp and not -DIGITS < stamp.adjusted() < DIGITS:
            raise LogError(path, f"the stamp {cell[:40]!r} is no time", row)
        found.append(stamp)
    return found


def _date(cell: str) -> Decimal | None:
    """A date in [s] since 1970, at UTC unless it tells its time zone; None of another cell."""
    if "-" not in cell.strip()[1:]:
        return None
    with suppress(ValueError):
        date = datetime.fromisoformat(cell.strip())
        since = (date if date.tzinfo else date.replace(tzinfo=UTC)) - DAY
        if date.year in YEARS:
            return Decimal(since // timedelta(microseconds=1)).scaleb(-6)
    return None
