"""The pipe of `inspector live`: rows of text in, a line for each finding out, and the exit status.

Rows are CSV with a header, or a JSON object per line.
"""

import csv
import json
import re
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import date
from itertools import chain, groupby
from math import nan
from pathlib import Path
from time import sleep
from types import FrameType
from typing import Any, BinaryIO, TypeAlias, TypeVar

import numpy as np

from inspector.errors import EXIT, Status
from inspector.live.session import SIGNALS, LiveError, LiveSession, Summary
from inspector.logs.clocks import UNITS
from inspector.logs.csv import MISSING, numbers_in
from inspector.logs.names import (
    TIME_UNITS,
    Naming,
    column_signal,
    factor_of,
    listed,
    time_column,
    without_unit,
)
from inspector.logs.names import UNITS as SIZES
from inspector.reference.judging import GAP
from inspector.reference.levels import Levels
from inspector.reference.store import Reference
from inspector.reference.verdicts import beside, judge
from inspector.text import program_version
from inspector.verdict import Finding, Verdict, counts
from noiseclassifier import Event, Labels
from noiseclassifier.labels import interval
from noisemodel.types import Array

Item = TypeVar("Item")
# What `LiveSession.push` takes: ``time``, shape (samples,), in [s], if rows have one; signals by
# name, each of shape (samples, columns).
Rows: TypeAlias = dict[str, Array]
# Called with the kind of a row that cannot be read, and a line about it.
Note: TypeAlias = Callable[[str, str], None]
CHUNK_BYTES = 1 << 18  # bytes that are read at once, if there are so many
MAX_LINE_BYTES = 1 << 24
# Below this, reading waits for more: half of what a pipe holds by default.
SMALL_CHUNK_BYTES = 1 << 15
# Signals that end a stream and leave its file whole: Ctrl-C, `kill`, and a terminal that closes,
# which Windows has not.
ENDING = [signal.SIGINT, signal.SIGTERM, *filter(None, [getattr(signal, "SIGHUP", None)])]
GATHER = 0.02  # how long rows wait for more, in [s]: less than half of a session's batch
EXPECTED = "expected a CSV header and rows, or a JSON object per line"


def follow(
    stream: BinaryIO,
    names: tuple[str, ...],
    session_of: Callable[[tuple[str, ...]], LiveSession],
    *,
    enough: Callable[[], bool] = lambda: False,
) -> Summary:
    """Show rows as they arrive, until they end, a signal comes, or there are enough."""
    with interruptible(chunks(stream, gather=GATHER)) as incoming:
        head, rest, number = _begun(incoming)
        reader, is_header = reader_of(head, names)
        start = (rest, number + 1) if is_header else (head + b"\n" + rest, number)
        with session_of(reader.names) as session:
            for lines, number in chain([start], incoming):
                for rows in reader.read(lines, number, session.note):
                    session.push(**rows)
                if enough():
                    break
    if not session.summary.samples:
        raise LiveError(f"the input has no samples; {EXPECTED}")
    return session.summary


def _begun(incoming: Iterator[tuple[bytes, int]]) -> tuple[bytes, bytes, int]:
    """First line that is neither blank nor a comment, what came after it, and its number."""
    for lines, number in incoming:
        first = 0
        while found := re.compile(rb"\S").search(lines, first):
            start = lines.rfind(b"\n", 0, found.start()) + 1
            stop = lines.index(b"\n", start)
            number, head = number + lines.count(b"\n", first, start), lines[start:stop]
            if not head.lstrip().startswith(b"#") or any(map(column_signal, _header(head)[0])):
                return head, lines[stop + 1 :], number
            first, number = stop + 1, number + 1
    raise LiveError(f"the input is empty; {EXPECTED}")


def _header(head: bytes) -> tuple[list[str], str]:
    """Names of columns, and the mark between them; NumPy writes "# time"."""
    text = head.decode("utf-8-sig", errors="replace").strip().lstrip("# ")
    delimiter = next((mark for mark in ",;\t" if mark in text), ",")
    return _cells(text, delimiter), delimiter


def _cells(line: str, delimiter: str) -> list[str]:
    cells = [line[:80]]
    with suppress(csv.Error):  # a cell of more than 128 KiB
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    return [cell.strip() for cell in cells]


def chunks(stream: BinaryIO, *, gather: float = 0.0) -> Iterator[tuple[bytes, int]]:
    """Whole lines of a stream as they come, and the number of the first.

    A small chunk waits for more, in [s]: to read row by row costs most.
    """
    read: Callable[[int], bytes] = getattr(stream, "read1", stream.read)
    rest, number = b"", 1
    while chunk := read(CHUNK_BYTES):
        lines, end, rest = (rest + chunk).rpartition(b"\n")
        if end:
            yield lines + end, number
            number += lines.count(b"\n") + 1
        elif len(rest) > MAX_LINE_BYTES:
            long = f"line {number} is longer than {MAX_LINE_BYTES} bytes"
            raise LiveError(f"{long}: this is no CSV or JSON")
        sleep(gather if len(chunk) < SMALL_CHUNK_BYTES else 0.0)
    if rest.strip():
        yield rest + b"\n", number


@contextmanager
def interruptible(items: Iterator[Item]) -> Iterator[Iterator[Item]]:
    """Items until the first Ctrl-C or `kill`, which does nothing else; a second one raises."""
    pressed = waits = False

    def press(number: int, frame: FrameType | None) -> None:
        nonlocal pressed
        again, pressed = pressed, True
        if again or waits:
            raise KeyboardInterrupt

    def handed_out() -> Iterator[Item]:
        nonlocal waits
        while not pressed:
            try:
                waits = True
                item = next(items)
            except (StopIteration, KeyboardInterrupt):
                return
            finally:
                waits = False
            yield item

    before = {each: signal.getsignal(each) for each in ENDING}
    for each, handler in before.items():
        if each == signal.SIGINT or handler != signal.SIG_IGN:  # `nohup` has others ignored
            signal.signal(each, press)
    try:
        yield handed_out()
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


def reader_of(head: bytes, names: tuple[str, ...]) -> "tuple[CsvReader | JsonReader, bool]":
    """Choose a format by the first line, and say whether that is a header."""
    if head.lstrip().startswith(b"{"):
        return JsonReader(names), False
    return CsvReader(head, names), True


class CsvReader:
    """Reads rows under a header such as ``time,elbow.velocity``; names tell the order of joints."""

    def __init__(self, head: bytes, names: tuple[str, ...]) -> None:
        self._header, self._delimiter = _header(head)
        self._width, self._given, self._begun = len(self._header), names, False
        self.names = self._find(self._header, names)

    def _find(self, header: list[str], names: tuple[str, ...]) -> tuple[str, ...]:
        """Find the columns of signals and time, and name the joints."""
        found: dict[str, dict[str, int]] = {}
        naming = Naming.of(header)
        for place, column in enumerate(header):
            meaning = column_signal(column, naming)
            if meaning is None or meaning[0] not in SIGNALS:
                continue
            kind, joint = meaning
            if not isinstance(joint, str):
                number = joint - min(naming.first, 1)
                if names and number >= len(names):
                    problem = f"column {column!r} is joint {number + 1}"
                    raise LiveError(f"{problem}, and --names has {len(names)}")
                joint = names[number] if names else f"joint_{joint}"
            if joint in found.setdefault(kind, {}):
                raise LiveError(f"the header names the {kind} of {joint!r} twice")
            found[kind][joint] = place
        if "velocity" not in found:
            expected = "expected columns such as elbow.velocity"
            problem = f"the header names no velocity; {expected}"
            raise LiveError(f"{problem}, they are {listed(header)}")
        names = names or tuple(found["velocity"])
        for kind, by_joint in found.items():
            if lacking := [name for name in names if name not in by_joint]:
                raise LiveError(f"the header has no {kind} of joint {lacking[0]!r}")
        time = time_column(header)
        places = {kind: [by_joint[name] for name in names] for kind, by_joint in found.items()}
        places |= {"time": [header.index(time)]} if time else {}
        # Only these are read: others may hold text.
        self._wanted = wanted = sorted(set().union(*places.values()))
        self._timed, unit = bool(time), TIME_UNITS.get(without_unit(time)[1], "seconds")
        # With the sizes of their units, where one is not 1. Columns side by side are not copied.
        self._columns: dict[str, tuple[list[int] | slice, Array | None]] = {}
        for kind, of_joints in places.items():
            factors = np.array([factor_of(header[place]) for place in of_joints])
            factors = np.array([float(UNITS[unit])]) if kind == "time" else factors
            taken = np.searchsorted(wanted, of_joints).tolist()
            beside = taken == list(range(taken[0], taken[0] + len(taken)))
            chosen = slice(taken[0], taken[-1] + 1) if beside else taken
            self._columns[kind] = chosen, None if (factors == 1.0).all() else factors
        return names

    def read(self, lines: bytes, first: int, note: Note) -> Iterator[Rows]:
        """Read whole lines; those that cannot be read are noted."""
        if not self._begun:
            lines, first = self._begin(lines, first)
        plain = numbers_in(lines, self._width, self._delimiter, self._wanted)
        table = self._read_lines(lines, first, note) if plain is None else plain[0]
        if len(table):
            rows = {}
            for name, (places, factors) in self._columns.items():
                rows[name] = table[:, places] if factors is None else table[:, places] * factors
            if self._timed:
                rows["time"] = rows["time"][:, 0]
            yield rows

    def _begin(self, lines: bytes, first: int) -> tuple[bytes, int]:
        """Take units from the first row, if it has some; rows may end with a mark more."""
        head, _, rest = lines.partition(b"\n")
        cells = _cells(head.decode(errors="replace"), self._delimiter)
        self._begun = any(cells)
        self._width += len(cells) == self._width + 1 and not cells[-1]
        units = [cell.strip("[]() ") for cell in cells]
        if not self._begun or not all(not u or u.lower() in {*SIZES, *TIME_UNITS} for u in units):
            return lines, first
        above = zip(self._header, units, strict=False)
        self._find([f"{name} [{unit}]" if unit else name for name, unit in above], self._given)
        return rest, first + 1

    def _read_lines(self, lines: bytes, first: int, note: Note) -> Array:
        """Read rows one by one, of which some have cells that are empty, padded or no numbers."""

        def parse(line: bytes) -> list[float]:
            cells = _cells(line.decode(errors="replace"), self._delimiter)
            if len(cells) != self._width:
                raise ValueError(f"{len(cells)} cells where the header names {self._width}")
            wanted = (cells[place] for place in self._wanted)
            return [nan if cell.lower() in MISSING else float(cell) for cell in wanted]

        # Without timestamps, the row alone keeps the time.
        instead = [] if self._timed else [[nan] * len(self._wanted)]
        return np.array(_parsed(lines, first, parse, note, instead)).reshape(-1, len(self._wanted))


class JsonReader:
    """Reads objects such as ``{"time": 0.1, "velocity": [0.2, 0.3]}``, named as in a run file."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names

    def read(self, lines: bytes, first: int, note: Note) -> Iterator[Rows]:
        """Read whole lines; those that cannot be read are noted."""
        samples = _parsed(lines, first, _sample, note, [])
        for widths, alike in groupby(samples, lambda each: {k: len(v) for k, v in each.items()}):
            together = list(alike)
            rows = {name: np.array([each[name] for each in together]) for name in widths}
            if "time" in rows:
                rows["time"] = rows["time"][:, 0]
            yield rows


def _parsed(
    lines: bytes, first: int, parse: Callable[[bytes], Item], note: Note, instead: list[Item]
) -> list[Item]:
    """Parse lines that are not blank; those that cannot be read are noted, and replaced."""
    found: list[Item] = []
    for number, line in enumerate(lines.splitlines(), start=first):
        try:
            found += [parse(line)] if line.strip() else []
        except (ValueError, RecursionError) as error:
            note("malformed rows", f"line {number}: {str(error)[:200]}; such rows are left out")
            found += instead
    return found


def _sample(line: bytes) -> dict[str, list[float]]:
    """Read one object, its values as lists of numbers."""
    found = json.loads(line, parse_int=float)
    if not isinstance(found, dict) or "velocity" not in found:
        raise ValueError("no JSON object with a velocity")
    numbers = {}
    for name in ("time", *SIGNALS):
        if name in found:
            values = found[name] if isinstance(found[name], list) else [found[name]]
            try:
                numbers[name] = [nan if each is None else float(each) for each in values]
            except (TypeError, ValueError) as error:
                raise ValueError(f"{name} holds no numbers") from error
            if not values or (name == "time" and len(values) > 1):
                raise ValueError(f"{name} has {len(values)} numbers")
    return numbers


FORMAT = "noise-live/1"
NAME = Path("live")  # what stands for the file of the stream


class Gate:
    """Prints findings while they come, beside a reference or by the model alone."""

    def __init__(
        self,
        tell: Callable[[str], None],
        *,
        as_json: bool = False,
        reference: Reference | None = None,
    ) -> None:
        self.failed = False
        self._tell, self._as_json = tell, as_json
        self._reference = reference
        self._found: dict[tuple[str, float], Finding] = {}
        self._told: list[Finding] = []
        self._begin: float | None = None  # of what was compared so far
        self._heard = 0.0
        self._verdict = Verdict(NAME, Status.CANNOT_TELL)  # on the whole stream

    def take(self, event: Event, over: bool) -> None:
        """Print a finding when it is there, and when it is over; beside a reference, keep it."""
        found = self._found[event.label, event.start] = Finding.of(event)
        if self._reference is None:
            self._print(found, over=over)

    def compare(self, latest: Levels, frames: Labels | None) -> Sequence[Finding]:
        """Print findings in the last 6 s beside the reference, each once; all of them so far."""
        if self._begin is None:
            self._begin = self._heard = latest.start
        found = tuple(self._found.values())
        verdict = Verdict(NAME, Status.OK, events=found, begin=self._begin)
        verdict = self._beside(verdict, latest, frames)
        for event in verdict.failing:
            if event.start > latest.time[-1] or event.stop < latest.start:
                continue
            if event.start >= self._heard:
                self._told.append(event)
                self._print(event, over=False)
            self._heard = max(self._heard, event.stop + GAP)
        return tuple(self._told)

    def _print(self, event: Finding, *, over: bool) -> None:
        self.failed = self.failed or event.fails
        if self._as_json:
            line = {"format": FORMAT, "event": "end" if over else "begin", **event.as_dict()}
            del line["order"]
            if not over:
                line["stop"] = None
            if self._reference is None:
                del line["evidence"]
            self._tell(json.dumps(line))
        elif not over:
            became = "" if self._reference is None else f": {event.evidence}"
            became = f" ({event.became})" if event.became else became
            self._tell(f"{event.label} from {event.start:.2f} s{event.novelty}{became}")

    def judge(self, summary: Summary) -> Summary:
        """Judge the whole stream."""
        events = tuple(map(Finding.of, summary.findings))
        verdict = Verdict(NAME, summary.status, summary.model, events, duration=summary.duration)
        if self._reference is not None and summary.levels is not None:
            verdict = replace(verdict, begin=summary.levels.start)
            verdict = self._beside(verdict, summary.levels, summary.frames)
        elif self._begin is not None:  # too long to be compared as a whole
            status = Status.FINDINGS if self._told else Status.OK
            verdict = replace(verdict, status=status, events=tuple(self._told))
        if summary.status is Status.CANNOT_TELL and summary.model and verdict.status is Status.OK:
            verdict = replace(verdict, status=Status.CANNOT_TELL)  # too little of it was seen
        self._verdict = verdict
        return replace(summary, status=verdict.status, findings=verdict.failing)

    def end(self, summary: Summary) -> int:
        """Print what became of the stream."""
        verdict = self._verdict
        if self._as_json:
            line: dict[str, Any] = {
                "format": FORMAT,
                "event": "summary",
                "version": program_version(),
                "status": verdict.status.value,
                "exit_status": EXIT[verdict.status],
                "reason": summary.reason if verdict.status is Status.CANNOT_TELL else "",
                "model": summary.model,
                "samples": summary.samples,
                "duration": round(verdict.duration, 6),
                "frames": dict(summary.labels),
                "counts": counts([verdict])["findings"],
                "missing": [str(each) for each in verdict.missing],
                "warnings": dict(summary.warnings),
                "where": summary.where,
            }
            if self._reference is not None:
                known = verdict.as_dict()
                line |= {"reference": known["reference"], "findings": known["events"]}
            self._tell(json.dumps(line))
            return EXIT[verdict.status]
        self._tell(str(replace(summary, status=verdict.status, findings=verdict.failing)))
        compared = () if self._reference is None else verdict.events
        told = [(each, f": {each.evidence}") for each in compared if not each.evidence.excused]
        told += [(each, f" does not count: {each.became}") for each in verdict.excused]
        for event, why in told:
            self._tell(f"  {event.label} from {interval(event.start, event.stop)}{why}")
        for missing in verdict.missing:
            self._tell(f"  {missing}")
        if verdict.beside is not None:
            self._tell(f"compared with {verdict.beside.path}: {verdict.beside.words}")
        return EXIT[verdict.status]

    def _beside(self, verdict: Verdict, levels: Levels, frames: Labels | None) -> Verdict:
        assert self._reference is not None
        verdict = beside(verdict, self._reference.compare(levels), self._reference, frames)
        return judge(verdict, self._reference, today=date.today())
