"""A live session that is fed by rows of text: CSV with a header, or a JSON object per line."""

import json
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import chain, groupby
from math import nan
from time import perf_counter, sleep
from types import FrameType
from typing import Any, BinaryIO, TypeAlias, TypeVar

import numpy as np

from inspector.live.samples import SIGNALS, LiveError
from inspector.live.session import LiveSession, Summary
from inspector.logs.clocks import UNITS
from inspector.logs.csv import numbers_in
from inspector.logs.names import (
    TIME_UNITS,
    Naming,
    column_signal,
    factor_of,
    listed,
    other_quantity,
    time_column,
    without_unit,
)
from noisemodel.types import Array

Item = TypeVar("Item")
Rows: TypeAlias = dict[str, Array]
"""What `LiveSession.push` takes: ``time``, shape (samples,), in [s], if rows have one; signals by
name, each of shape (samples, columns)."""
Note: TypeAlias = Callable[[str, str], None]
"""Called with the kind of a row that cannot be read, and a line about it."""

CHUNK_BYTES = 1 << 18
"""Bytes that are read at once, if there are so many."""
MAX_LINE_BYTES = 1 << 24
SMALL_CHUNK_BYTES = 1 << 15
"""Below this, reading waits for more: half of what a pipe holds by default."""
GATHER = 0.02
"""How long rows wait for more, in [s]: less than half of a session's batch."""
EXPECTED = "expected a CSV header and rows, or a JSON object per line"
UNKNOWN = ("", "nan", "null")
"""Cells of what is not known, in lower case."""


def follow(
    stream: BinaryIO,
    names: tuple[str, ...],
    session_of: Callable[[tuple[str, ...]], LiveSession],
    *,
    enough: Callable[[], bool] = lambda: False,
) -> Summary:
    """Show rows as they arrive, until they end, Ctrl-C is pressed, or there are enough."""
    widen(stream)
    with interruptible(chunks(stream, gather=GATHER)) as incoming:
        lines, number, received = next(incoming, (b"", 1, 0.0))
        head, _, rest = lines.partition(b"\n")
        if not head.strip():
            raise LiveError(f"the input is empty; {EXPECTED}")
        reader, is_header = reader_of(head, names)
        start = (rest, number + 1, received) if is_header else (lines, number, received)
        with session_of(reader.names) as session:
            for lines, number, received in chain([start], incoming):
                for rows in reader.read(lines, number, session.note):
                    session.push(**rows, received=received)
                if enough():
                    break
    if not session.summary.samples:
        raise LiveError(f"the input has no samples; {EXPECTED}")
    return session.summary


def widen(stream: BinaryIO) -> None:
    """Set a pipe's buffer to as much as is read at once, so that its writer need not wait."""
    import fcntl

    with suppress(AttributeError, OSError):  # another system; no pipe
        fcntl.fcntl(stream.fileno(), fcntl.F_SETPIPE_SZ, CHUNK_BYTES)


def chunks(stream: BinaryIO, *, gather: float = 0.0) -> Iterator[tuple[bytes, int, float]]:
    """Whole lines of a stream as they come, the number of the first, and when they were received.

    Args:
        gather: How long a small chunk waits for more, in [s]: to read row by row costs most.
    """
    read: Callable[[int], bytes] = getattr(stream, "read1", stream.read)
    rest, number, waited = b"", 1, 0.0
    while chunk := read(CHUNK_BYTES):
        received = perf_counter() - waited
        lines, end, rest = (rest + chunk).rpartition(b"\n")
        if end:
            yield lines + end, number, received
            number += lines.count(b"\n") + 1
        elif len(rest) > MAX_LINE_BYTES:
            raise LiveError(
                f"line {number} is longer than {MAX_LINE_BYTES} bytes: this is no CSV or JSON"
            )
        waited = gather if len(chunk) < SMALL_CHUNK_BYTES else 0.0
        sleep(waited)
    if rest.strip():
        yield rest + b"\n", number, perf_counter()


@contextmanager
def interruptible(items: Iterator[Item]) -> Iterator[Iterator[Item]]:
    """Items until the first Ctrl-C, which does nothing else; a second one raises as usual."""
    pressed = waits = False

    def press(number: int, frame: FrameType | None) -> None:
        nonlocal pressed
        again, pressed = pressed, True
        if again or waits:
            raise KeyboardInterrupt

    def handed_out() -> Iterator[Item]:
        nonlocal waits
        while not pressed:
            waits = True
            try:
                item = next(items)
            except (StopIteration, KeyboardInterrupt):
                return
            finally:
                waits = False
            yield item

    before = signal.signal(signal.SIGINT, press)
    try:
        yield handed_out()
    finally:
        signal.signal(signal.SIGINT, before)


def reader_of(
    head: bytes, names: tuple[str, ...]
) -> "tuple[CsvReader, bool] | tuple[JsonReader, bool]":
    """Choose a format by the first line, and say whether that is a header."""
    if head.lstrip().startswith(b"{"):
        return JsonReader(names), False
    return CsvReader(head, names), True


class CsvReader:
    """Reads rows under a header such as ``time,elbow.velocity,elbow.position``.

    Args:
        names: Names of the joints in the order that is wanted; by default the columns' order.
    """

    def __init__(self, head: bytes, names: tuple[str, ...]) -> None:
        text = head.decode("utf-8-sig", errors="replace").strip().lstrip("# ")
        self._delimiter = next((mark for mark in ",;\t" if mark in text), ",")
        self._header = [cell.strip() for cell in text.split(self._delimiter)]
        found: dict[str, dict[str, int]] = {}
        naming = Naming.of(self._header)
        for place, column in enumerate(self._header):
            meaning = column_signal(column, naming)
            if meaning is None or meaning[0] not in SIGNALS:
                continue
            if unit := other_quantity(column, meaning):
                raise LiveError(
                    f"column {column!r} is named like {meaning[0]} and has a unit of {unit};"
                    " rename it"
                )
            if factor_of(column) == 1.0:
                joint = meaning[1]
                known = joint if isinstance(joint, str) else _numbered(joint - naming.first, names)
                found.setdefault(meaning[0], {})[known] = place
        if "velocity" not in found:
            raise LiveError(
                "the header names no velocity; expected columns such as elbow.velocity,"
                f" they are {listed(self._header)}"
            )
        self.names = names or tuple(found["velocity"])
        for signal_, places in found.items():
            if lacking := [name for name in self.names if name not in places]:
                raise LiveError(f"the header has no {signal_} of joint {lacking[0]!r}")
        self._places = {
            signal_: _run([places[name] for name in self.names])
            for signal_, places in found.items()
        }
        time = time_column(self._header)
        self._time = self._header.index(time) if time else None
        self._second = float(UNITS[TIME_UNITS.get(without_unit(time)[1], "seconds")])

    def read(self, lines: bytes, first: int, note: Note) -> Iterator[Rows]:
        """Read whole lines; those that cannot be read are noted."""
        columns = range(len(self._header))
        plain = numbers_in(lines, len(columns), self._delimiter, columns)
        table = self._read_lines(lines, first, note) if plain is None else plain[0]
        if len(table):
            rows = {name: table[:, places] for name, places in self._places.items()}
            if self._time is not None:
                rows["time"] = table[:, self._time] * self._second
            yield rows

    def _read_lines(self, lines: bytes, first: int, note: Note) -> Array:
        """Read rows one by one, of which some have cells that are empty, padded or no numbers."""
        rows = []
        for number, line in enumerate(lines.splitlines(), start=first):
            if not line.strip():
                continue
            try:
                rows.append(self._row(line.decode(errors="replace").split(self._delimiter)))
            except ValueError as error:
                note("malformed rows", f"line {number}: {str(error)[:200]}; such rows are left out")
                if self._time is None:  # without timestamps, the row alone keeps the time
                    rows.append([nan] * len(self._header))
        return np.array(rows).reshape(-1, len(self._header))

    def _row(self, cells: list[str]) -> list[float]:
        if len(cells) != len(self._header):
            raise ValueError(f"{len(cells)} cells where the header names {len(self._header)}")
        return [nan if cell.strip().lower() in UNKNOWN else float(cell) for cell in cells]


def _numbered(number: int, names: tuple[str, ...]) -> str:
    """The name of a joint that a column has by its number."""
    return names[number] if number < len(names) else f"joint{number + 1}"


def _run(places: list[int]) -> list[int] | slice:
    """Columns beside each other need not be copied together."""
    first, stop = places[0], places[0] + len(places)
    return slice(first, stop) if places == list(range(first, stop)) else places


class JsonReader:
    """Reads objects such as ``{"time": 0.1, "velocity": [0.2, 0.3]}``, named as in a run file."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names

    def read(self, lines: bytes, first: int, note: Note) -> Iterator[Rows]:
        """Read whole lines; those that cannot be read are noted."""
        samples = []
        for number, line in enumerate(lines.splitlines(), start=first):
            if not line.strip():
                continue
            try:
                samples.append(_sample(line))
            except ValueError as error:
                note("malformed rows", f"line {number}: {error}; such rows are left out")
        for keys, group in groupby(samples, key=_shape):
            alike = list(group)
            rows = {name: np.array([each[name] for each in alike]) for name, _ in keys}
            if "time" in rows:
                rows["time"] = rows["time"][:, 0]
            yield rows


def _shape(sample: dict[str, list[float]]) -> tuple[tuple[str, int], ...]:
    return tuple((name, len(values)) for name, values in sample.items())


def _sample(line: bytes) -> dict[str, list[float]]:
    """Read one object, its values as lists of numbers."""
    try:
        found = json.loads(line, parse_int=float)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    if not isinstance(found, dict) or "velocity" not in found:
        raise ValueError("no JSON object with a velocity")
    if isinstance(found.get("time", 0.0), list) and len(found["time"]) != 1:
        raise ValueError("time is no single number")
    return {name: _numbers(name, found[name]) for name in ("time", *SIGNALS) if name in found}


def _numbers(name: str, value: Any) -> list[float]:
    values = value if isinstance(value, list) else [value]
    if not values:
        raise ValueError(f"{name} is empty")
    try:
        return [nan if each is None else float(each) for each in values]
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} holds no numbers") from error
