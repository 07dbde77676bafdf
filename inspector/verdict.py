"""Verdicts on files: what `classify` prints of an analysis, in batch, and resumed.

A verdict is written as a run of ``noise-verdict/3`` (`as_dict`) and read again (`read_as`): by
`classify --resume`, whose state is a header and a line of JSON for each verdict, by `merge` and by
`history`. A state's line without its end was being written when the process was killed: it is
dropped. Of several verdicts on a run the last one of its present content counts. Internal errors
are not kept: these runs are tried again.
"""

import fcntl
import hashlib
import json
import os
import reprlib
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from enum import StrEnum
from functools import cache, partial
from pathlib import Path
from time import perf_counter
from types import NoneType
from typing import Any, get_args, get_origin, get_type_hints

import noiseclassifier as nc
import noisemodel as nm
from inspector.analysis import Analysis, analyse
from inspector.errors import EXIT, FileError, InspectorError, Status, Unknown, without_path, worst
from inspector.library import Library
from inspector.localisation import Localisation
from inspector.localisation.order import Order
from inspector.logs.read import Reading, Source, open_source
from inspector.text import program_version
from noiseclassifier import Event
from noiseclassifier.jsontext import from_json, text_of
from noisemodel import OutputError
from noisemodel.files import also_reading
from noisemodel.parallel import DIED, Jobs, as_done, in_order

# The errors that are printed in one line; all others are bugs.
EXPECTED = (InspectorError, nc.ModelsError, nm.NoiseModelError)
UNREAD = (Status.BAD_INPUT, Status.INTERNAL_ERROR)
FORMAT = "noise-classify-state/2"
# Most bytes of a file that is resumed: enough for some hundred thousand runs.
MAX_BYTES = 256 * 2**20
DRAWING = 0.4  # about how long a picture takes, in [s]

# Draws a picture of an analysis with its verdict and comparison, which is None without a reference,
# and gives its path.
Drawing = Callable[[Analysis, "Verdict", Any], Path]
# Adds the evidence of a reference and gives the comparison with it, see `References`.
Referring = Callable[[Analysis, "Verdict"], tuple["Verdict", Any]]


class StateError(FileError):
    """A state file that a batch cannot resume."""

    advice = "; name another file, or delete it"


class Ruling(StrEnum):
    """What became of a finding."""

    FOUND = "found"
    EXPIRED = "waiver-expired"
    ALLOWED = "allowed"
    WAIVED = "waived"
    FILTERED = "filtered"
    AS_REFERENCE = "as-reference"


FAILING = (Ruling.FOUND, Ruling.EXPIRED)  # those that fail a run
LOG, END = "log of ", "end of the run"  # what a scenario without logs, and a run that is cut, lack


@dataclass(frozen=True)
class Missing:
    """A finding that is required and was not found, and why it is required."""

    label: str
    start: float | None = None  # earliest onset, in [s]; None if any
    stop: float | None = None  # latest one
    reason: str = ""

    def __str__(self) -> str:
        known = self.start is not None and self.stop is not None
        when = f" from {self.start:.2f} s to {self.stop:.2f} s" if known else ""
        return f"missing: {self.label}{when}{self.reason and f' (required: {self.reason})'}"

    @property
    def scenario(self) -> str:
        """The scenario that has too few logs; empty of another finding."""
        return self.label.removeprefix(LOG) if self.label.startswith(LOG) else ""

    @property
    def kind(self) -> str:
        """For programs that count them."""
        return "log" if self.scenario else self.label.replace(" ", "-")

    @property
    def told(self) -> str:
        """What is said of it beside its scenario."""
        return self.reason if self.scenario and self.reason else str(self)


@dataclass(frozen=True)
class Evidence:
    """What a finding is known by, named as in JSON."""

    kind: str  # "repetitions", "other motions" of this robot, or the "general" model
    over_db: float | None = None  # loudest exceedance over the reference; None by the general model
    peak: float | None = None  # when that is, in [s]
    joint: str | None = None
    signal: str | None = None  # "velocity" or "tracking error"
    band_hz: tuple[float, float] | None = None
    level_db: float | None = None  # [dB re 1 rad/s]
    excused: str = ""  # why the finding does not count; empty if it does

    def __str__(self) -> str:
        if self.over_db is None or self.peak is None or self.band_hz is None:
            return "by the general model"
        low, high = self.band_hz
        where = f"{self.joint}, {self.signal}, {low:.0f} to {high:.0f} Hz"
        return f"{self.over_db:.1f} dB over {self.kind} at {self.peak:.2f} s ({where})"


GENERAL = Evidence("general")


@dataclass(frozen=True)
class Finding(Event):
    """An event of a run, where it comes from, what it is known by, and what became of it."""

    localisation: Localisation | None = None
    order: Order | None = None
    evidence: Evidence = GENERAL
    ruling: Ruling = Ruling.FOUND
    reason: str = ""  # of the ruling, in a few words

    @classmethod
    def of(cls, event: Event, **known: Any) -> "Finding":
        """Take an event, and add what is known of it."""
        return cls(**vars(event) | known)

    @property
    def fails(self) -> bool:
        """Whether it fails its run."""
        return self.ruling in FAILING

    @property
    def became(self) -> str:
        """What became of it, and why; empty if it was simply found."""
        words = "" if self.ruling is Ruling.FOUND else self.ruling.value.replace("-", " ")
        return ": ".join(filter(None, [words, self.reason]))

    def as_dict(self) -> dict[str, Any]:
        """The finding as JSON can hold it."""
        known, of = self.localisation, self.order
        written: dict[str, Any] = {
            "label": self.label,
            "start": round(self.start, 6),
            "stop": round(self.stop, 6),
            "score": round(self.score, 6),
            "novel": self.novel,
            "order": of and {"joint": of.joint, "periods_per_turn": round(of.periods_per_turn, 1)},
            "fails": self.fails,
            "ruling": self.ruling.value,
            "reason": self.reason,
            "evidence": asdict(self.evidence),
        }
        if known is not None:
            written["localisation"] = {
                "stage": known.stage or None,
                "following": known.following or None,
                "lag": round(known.lag, 6) if known.stage else None,
                "joints": {name: round(share, 3) for name, share in known.joints},
                "band": known.band and [round(frequency, 3) for frequency in known.band],
            }
        return written

    @staticmethod
    def fields_of(content: Mapping[str, Any]) -> dict[str, Any]:
        """The fields of what `as_dict` wrote, for `read_as`."""
        known = content.get("localisation")
        if known is not None:
            texts = {name: known[name] or "" for name in ("stage", "following")}
            joints = [list(each) for each in known["joints"].items()]
            known = {**known, **texts, "lag": known["lag"] or 0.0, "joints": joints, "onset": None}
        return {**content, "localisation": known}


@dataclass(frozen=True)
class Beside:
    """How a run compares with its reference, named as in JSON; see `inspector.reference`."""

    path: str  # the reference
    scenarios: tuple[str, ...] = ()  # whose motion it makes
    repetitions: int = 0  # that these have
    shares: Mapping[str, float] = field(default_factory=dict)  # of the run, by kind of evidence
    margins_db: Mapping[str, float] = field(default_factory=dict)  # by kind of evidence
    over_db: float | None = None  # largest score of a frame; None without one
    joints_db: Mapping[str, float] = field(default_factory=dict)  # their loudest exceedance
    quieter_db: float = 0.0  # than each repetition; 0 if it is not
    failures: tuple[tuple[str, str], ...] = ()  # what it lacks of its scenario, and why
    words: str = ""  # the evidence, in a line


TEXTS = ("model", "model_sha256", "message", "assumed", "scenario", "expectations")
# What of a verdict JSON holds as it is, and rounded.
NUMBERS = ("begin", "duration", "rate", "seconds")


@dataclass(frozen=True)
class Verdict:
    """What was found in one file; texts are empty where nothing is known."""

    path: Path
    status: Status
    model: str = ""  # that labelled
    events: tuple[Finding, ...] = ()  # in order
    message: str = ""
    unknown: Unknown = Unknown.FINDING
    model_sha256: str = ""  # of its file
    beside: Beside | None = None
    assumed: str = ""  # when its log was read, in a line
    scenario: str = ""  # that the run names
    duration: float = 0.0  # [s]; 0 if it cannot be read, as the rate
    rate: float = 0.0  # [Hz]
    joints: int = 0
    seconds: float = 0.0  # that it took to classify it
    missing: tuple[Missing, ...] = ()
    expectations: str = ""  # the store that was applied
    ignored: bool = False  # in the exit status: bad input
    picture: Path | None = None
    lost: tuple[str, ...] = ()  # outputs that could not be written, a sentence each
    trace: str = ""  # of an internal error
    begin: float = 0.0  # time of the first sample, in [s]

    @property
    def of_run(self) -> bool:
        """Whether it is on a run; if not, on a file of expectations that requires missing logs."""
        return str(self.path) != self.expectations

    @property
    def failing(self) -> tuple[Finding, ...]:
        """Findings that fail the run."""
        return tuple(event for event in self.events if event.fails)

    @property
    def excused(self) -> tuple[Finding, ...]:
        """Findings that do not: expected, waived, in a budget, or filtered."""
        return tuple(event for event in self.events if not event.fails)

    @property
    def severity(self) -> tuple[int, int, float]:
        """Sorts runs, the worst first: by status, number of findings that fail it, best score."""
        score = max((event.score for event in self.failing), default=0.0)
        rounded = round(score, 6)  # as it is kept: a resumed verdict ranks as a new one
        return list(EXIT).index(self.status), -len(self.failing) - len(self.missing), -rounded

    @classmethod
    def of(cls, path: Path, analysis: Analysis) -> "Verdict":
        """Take from an analysis of a file what is printed."""
        run, located, orders = analysis.run, analysis.localisations, analysis.orders
        return cls(
            path,
            analysis.status,
            analysis.model,
            tuple(
                Finding.of(event, localisation=located.get(event), order=orders.get(event))
                for event in analysis.findings
            ),
            analysis.message,
            analysis.unknown,
            analysis.model_sha256,
            assumed=analysis.assumed,
            scenario=str(run.meta.get("scenario", "")),
            duration=run.duration,
            rate=run.rate,
            joints=len(run.joint_names),
            begin=float(run.time[0]),
        )

    def as_dict(self) -> dict[str, Any]:
        """The verdict as a run of ``noise-verdict/3``, as JSON can hold it."""
        return {
            "run": str(self.path),
            "status": self.status.value,
            "unknown": self.unknown.value,
            "events": [event.as_dict() for event in self.events],
            "missing": [asdict(missing) for missing in self.missing],
            "reference": None if self.beside is None else asdict(self.beside),
            "joints": self.joints,
            "counted": not self.ignored,
            "picture": None if self.picture is None else str(self.picture),
            **{name: getattr(self, name) for name in TEXTS},
            **{name: round(getattr(self, name), 6) for name in NUMBERS},
        }

    @staticmethod
    def fields_of(content: Mapping[str, Any]) -> dict[str, Any]:
        """The fields of what `as_dict` wrote, for `read_as`."""
        named = {"path": content["run"], "beside": content["reference"]}
        named["ignored"] = not read_as(bool, content["counted"])
        return {"lost": [], "trace": "", **content, **named}


@cache
def _parts_of(kind: Any) -> tuple[Any, tuple[Any, ...], Mapping[str, Any]]:
    """Origin and arguments of a type, and the types of the fields of a dataclass that count."""
    if not is_dataclass(kind):
        return get_origin(kind), get_args(kind), {}
    hints = get_type_hints(kind)
    return None, (), {each.name: hints[each.name] for each in fields(kind) if each.compare}


def read_as(kind: Any, value: Any) -> Any:
    """A value of JSON as a type; of a dataclass, all fields of it must be there.

    Raises:
        TypeError, KeyError, ValueError, AttributeError: If it is of another type.
    """
    if type(value) is kind:
        return value
    if kind is float and type(value) is int and abs(value) < 1e300:
        return float(value)
    of, inner, fields = _parts_of(kind)
    if fields:
        named = getattr(kind, "fields_of", dict)(value)
        return kind(**{name: read_as(each, named[name]) for name, each in fields.items()})
    if NoneType in inner:
        return None if value is None else read_as(inner[0], value)
    if of is tuple and isinstance(value, list):
        kinds = inner[:1] * len(value) if inner[-1] is ... else inner
        return tuple(read_as(*each) for each in zip(kinds, value, strict=True))
    if of is Mapping and isinstance(value, dict):
        return {name: read_as(inner[1], each) for name, each in value.items()}
    if kind in (Path, Status, Unknown, Ruling) and isinstance(value, str):
        os.fsencode(value)  # what is no name of a file fails here
        return kind(value)
    raise TypeError(f"{reprlib.repr(value)} is no {kind.__name__}")


def classify_file(
    path: Path | Source,
    library: Library,
    *,
    reading: Reading | None = None,
    unknown: Unknown = Unknown.FINDING,
    draw: Drawing | None = None,
    reference: Referring | None = None,
) -> Verdict:
    """Classify a run file, or any log; errors become part of the verdict."""
    source = path if isinstance(path, Source) else Source(path)
    begun = perf_counter()
    try:
        opened = open_source(source, reading)
        analysis = analyse(opened.run, library, unknown=unknown)
        analysis = replace(analysis, assumed=opened.assumed)
        verdict, comparison = Verdict.of(source.shown, analysis), None
        if reference is not None:
            verdict, comparison = reference(analysis, verdict)
        if draw is not None:
            try:
                verdict = replace(verdict, picture=draw(analysis, verdict, comparison))
            except (OutputError, OSError) as error:
                verdict = replace(verdict, lost=(str(error),))
    except EXPECTED as error:
        message = without_path(error, source.path)
        verdict = Verdict(source.shown, Status.BAD_INPUT, message=message, unknown=unknown)
    except Exception as error:  # a bug that one run shows must not hide the findings of others
        message, trace = f"{type(error).__name__}: {error}", traceback.format_exc()
        bug = Status.INTERNAL_ERROR
        verdict = Verdict(source.shown, bug, message=message, unknown=unknown, trace=trace)
    return replace(verdict, seconds=perf_counter() - begun)


def classify_files(
    paths: Sequence[Path | Source],
    library: Library,
    *,
    reading: Reading | None = None,
    unknown: Unknown = Unknown.FINDING,
    draw: Drawing | None = None,
    reference: Referring | None = None,
    jobs: Jobs = 1,
    resume: Path | None = None,
) -> Iterator[Verdict]:
    """Classify many files; one bad file never stops the rest.

    Args:
        draw: Importable for several jobs, as ``reference`` is.
        jobs: How many to work on at once, or the address of a Dask scheduler. A run with which a
            worker dies is an internal error.
        resume: A file that keeps the verdicts; those on unchanged runs are taken from it.
    """
    one = partial(
        classify_file,
        library=library,
        reading=reading,
        unknown=unknown,
        draw=draw,
        reference=reference,
    )
    runs = [path if isinstance(path, Source) else Source(path) for path in paths]
    end, each = partial(died, unknown=unknown), DRAWING if draw is not None else 0.0
    if resume is None:
        yield from in_order(one, runs, jobs=jobs, died=end, work=work_of(runs, each))
        return
    reading = reading or Reading()
    files = [each for each in (reading.desired, Path(str(reading.options.robot))) if each]
    settings = {
        "version": program_version(),
        "models": {name: model.sha256 for name, model in library.items()},
        "reading of logs": [repr(reading), *(digest(each) for each in files if each.is_file())],
        "--unknown": unknown.value,
        "--report": draw is not None,
        "--reference": str(reference or ""),
    }
    content = cache(digest)
    with kept(resume, settings) as (verdicts, add):
        todo = []
        for run in runs:
            known = verdicts.get((run.shown, content(run.path)))
            if known is None or (known.picture is not None and not known.picture.exists()):
                todo.append(run)
            else:
                yield known
        work, ends = partial(_with_digest, one=one), lambda run: (end(run), "")
        done = as_done(work, todo, jobs=jobs, died=ends, work=work_of(todo, each))
        for _, (verdict, sha256) in done:
            add(verdict, sha256)
            yield verdict


def _with_digest(run: Source, one: Callable[[Source], Verdict]) -> tuple[Verdict, str]:
    sha256 = digest(run.path)  # before it is read: what changes meanwhile is done again
    return one(run), sha256


def died(run: Source, unknown: Unknown) -> Verdict:
    """The verdict on a run with which a worker died."""
    message = f"{DIED}; classify this run alone to see why"
    return Verdict(run.shown, Status.INTERNAL_ERROR, message=message, unknown=unknown)


def work_of(runs: Sequence[Source], each: float = 0.0) -> float:
    """About how long runs take, in [s], with what comes to it for each."""
    # One core does 50 MB/s of samples that are not packed.
    sizes = (run.path.stat().st_size for run in runs if run.path.is_file())
    return sum(sizes) / 50e6 + each * len(runs)


def exit_status(verdicts: Sequence[Verdict]) -> int:
    """Take the worst of several; bad input that is ignored counts if there is nothing else."""
    counted = [verdict for verdict in verdicts if not verdict.ignored] or verdicts
    return worst(EXIT[verdict.status] for verdict in counted)


def counts(verdicts: Sequence[Verdict]) -> dict[str, dict[str, int]]:
    """Count what all outputs state."""
    runs = Counter(verdict.status for verdict in verdicts if verdict.of_run)
    excused = Counter(event.ruling for verdict in verdicts for event in verdict.excused)
    found = {
        "failing": sum(len(verdict.failing) for verdict in verdicts),
        "missing": sum(len(verdict.missing) for verdict in verdicts),
        **{ruling.value: excused[ruling] for ruling in Ruling if ruling not in FAILING},
    }
    return {"runs": {status.value: runs[status] for status in EXIT}, "findings": found}


RESULTS = "noise-verdict/3"  # format of what `classify --write json=FILE` writes


def read_results(path: Path) -> list[Verdict]:
    """Read the verdicts of a file that `classify --write json=FILE` wrote."""
    also_reading([path])
    content = None
    try:
        content = from_json(text_of(path))
        form = content.get("format") if isinstance(content, dict) else None
        if form == RESULTS:
            return list(read_as(tuple[Verdict, ...], content["runs"]))
    except OSError as error:
        raise InspectorError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        version = content.get("version") if isinstance(content, dict) else None
        by = f" by version {version}, this is {program_version()}" if version else ""
        raise InspectorError(f"{path}: no results of classify{by} ({error})") from error
    raise InspectorError(f"{path}: of format {form!r}, expected {RESULTS!r}")


@contextmanager
def kept(
    path: Path, settings: Mapping[str, Any]
) -> Iterator[tuple[dict[tuple[Path, str], Verdict], Callable[[Verdict, str], None]]]:
    """Open a state file to resume, or create it.

    It gives the verdicts so far, by run and SHA-256 of its content, and a function that adds one.
    """
    header = {"format": FORMAT, **settings}
    refused = partial(StateError, path)
    with resumed(path, header, refused, what="state of classify") as (rows, append):
        verdicts = {}
        for number, row in enumerate(rows, start=2):
            try:
                content = from_json(row)
                verdict = read_as(Verdict, content)
                verdicts[verdict.path, content["sha256"]] = verdict
            except (ValueError, KeyError, TypeError, AttributeError) as error:
                raise refused(f"is damaged in line {number}") from error

        def add(verdict: Verdict, sha256: str) -> None:
            if verdict.status is not Status.INTERNAL_ERROR:
                append({"sha256": sha256, **verdict.as_dict(), "lost": list(verdict.lost)})

        yield verdicts, add


@contextmanager
def resumed(
    path: Path,
    header: Mapping[str, Any],
    refused: Callable[[str], InspectorError],
    *,
    what: str,
    afresh: bool = False,
) -> Iterator[tuple[list[bytes], Callable[[Mapping[str, Any]], None]]]:
    """Open a file of JSON lines that begins with a header to resume, or create it.

    It gives the lines after the header, and a function that appends one; none of a file that is
    begun afresh.
    """
    if path.exists() and not path.is_file():
        raise refused("is no regular file")

    def append(content: Mapping[str, Any]) -> None:
        try:
            file.write(json.dumps(content).encode() + b"\n")
            file.flush()
            os.fsync(file.fileno())
        except OSError as error:
            raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error

    try:
        file = path.open("a+b")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
    try:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            busy = "is being written by another process; wait for it, or name another file"
            raise InspectorError(f"{path}: {busy}") from error
        if os.fstat(file.fileno()).st_size > MAX_BYTES:
            raise refused(f"is larger than {MAX_BYTES} bytes")
        file.seek(0)
        whole, end, torn = (b"" if afresh else file.read()).rpartition(b"\n")
        first, *rows = whole.split(b"\n") if end else [torn]
        # A line without its end was being written when the process was killed.
        begun = not end and json.dumps(header).encode().startswith(torn)
        if not begun and (problem := _differs(first, header, what)):
            raise refused(problem)
        file.truncate(len(whole) + len(end))
        if not end:
            append(header)
        yield rows, append
    finally:
        with suppress(OSError):  # what it could not write has been said by then
            file.close()


def _differs(line: bytes, header: Mapping[str, Any], what: str) -> str:
    """Why a file with this first line cannot be resumed; empty if it can."""
    try:
        there = from_json(line)
    except ValueError:
        there = None
    kind = f"{header['format']}".rpartition("/")[0]
    if not isinstance(there, dict) or not str(there.get("format")).startswith(f"{kind}/"):
        return f"holds no {what}"
    expected = from_json(json.dumps(header))
    other = next((name for name in expected if there.get(name) != expected[name]), "")
    return f"is of another batch (its {other} differs)" if other else ""


def digest(path: Path) -> str:
    """SHA-256 of a file, or of all names and files in a folder; empty if it cannot be read."""
    try:
        if path.is_file():
            with path.open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()
        inside = sorted(each for each in path.rglob("*") if each.is_file())
        lines = [f"{each.relative_to(path)} {digest(each)}" for each in inside]
        return hashlib.sha256(os.fsencode("\n".join(lines))).hexdigest()
    except OSError:
        return ""
