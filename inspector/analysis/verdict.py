"""Verdicts on files: what `classify` prints of an analysis, without its arrays."""

import re
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import noiseclassifier as nc
import noisemodel as nm
from inspector.analysis.analyse import Analysis, analyse, analyse_noise
from inspector.analysis.status import EXIT, Status, Unknown, worst
from inspector.errors import InspectorError, without_path
from inspector.library import Library
from inspector.logs.opening import Reading, Source, open_source
from noiseclassifier import Event
from noisemodel.parallel import DIED, Jobs, in_order

if TYPE_CHECKING:
    from inspector.localisation.localise import Localisation
    from inspector.localisation.order import Order

EXPECTED = (InspectorError, nc.ModelsError, nm.NoiseModelError)
"""The errors that are printed in one line; all others are bugs."""


class Ruling(StrEnum):
    """What became of a finding."""

    FOUND = "found"
    FORBIDDEN = "forbidden"
    EXPIRED = "waiver-expired"
    OVER_BUDGET = "over-budget"
    REQUIRED = "required"
    ALLOWED = "allowed"
    WAIVED = "waived"
    IN_BUDGET = "in-budget"
    FILTERED = "filtered"

    @property
    def fails(self) -> bool:
        """Whether it fails its run."""
        return self in (Ruling.FOUND, Ruling.FORBIDDEN, Ruling.EXPIRED, Ruling.OVER_BUDGET)


@dataclass(frozen=True)
class Ruled:
    """What became of a finding, and why.

    Attributes:
        ruling: What became of it.
        reason: Why, in a few words; may be empty.
    """

    ruling: Ruling = Ruling.FOUND
    reason: str = ""

    def __str__(self) -> str:
        if self.ruling is Ruling.FOUND:
            return self.reason
        words = self.ruling.value.replace("-", " ")
        return f"{words}: {self.reason}" if self.reason else words


@dataclass(frozen=True)
class Missing:
    """A finding that is required and was not found.

    Attributes:
        label: Its class; several are joined by " or ".
        start: The earliest onset, in [s]; None if any.
        stop: The latest onset, in [s]; None if any.
        reason: Why it is required; may be empty.
    """

    label: str
    start: float | None = None
    stop: float | None = None
    reason: str = ""

    def __str__(self) -> str:
        when = "" if self.start is None else f" from {self.start:.2f} s to {self.stop:.2f} s"
        return f"missing: {self.label}{when}{self.reason and f' (required: {self.reason})'}"


@dataclass(frozen=True)
class Verdict:
    """What was found in one file.

    Attributes:
        path: The file.
        status: The outcome.
        model: Name of the model that labelled, empty if none could.
        events: Findings, in order.
        message: A line that says more, may be empty.
        localisations: The localisation of each finding, if it was requested.
        unknown: What became of `unknown` frames.
        model_sha256: SHA-256 of the model's file, empty without.
        orders: Of the findings whose vibration goes with the speed of a joint.
        assumed: What was assumed when its log was read, in a line; empty of a run file.
        scenario: The scenario that the run names, empty without.
        duration: Duration of the run, in [s]; 0 if it cannot be read.
        seconds: How long it took to classify it, in [s].
        rulings: What became of findings, of those that are not simply found.
        missing: Required findings that were not found.
        expectations: The file of expectations that was applied, empty without.
        ignored: Whether it is left out of the exit status: bad input that is ignored.
        picture: A picture of the run, if one was drawn.
        picture_url: Where that will be published, empty if that is not known.
        lost: Outputs of the run that could not be written, a sentence each.
        trace: The traceback of an internal error.
        begin: Time of the run's first sample, in [s].
    """

    path: Path
    status: Status
    model: str = ""
    events: tuple[Event, ...] = ()
    message: str = ""
    localisations: Mapping[Event, "Localisation"] = field(default_factory=dict)
    unknown: Unknown = Unknown.FINDING
    model_sha256: str = ""
    orders: Mapping[Event, "Order"] = field(default_factory=dict)
    assumed: str = ""
    scenario: str = ""
    duration: float = 0.0
    seconds: float = 0.0
    rulings: Mapping[Event, Ruled] = field(default_factory=dict)
    missing: tuple[Missing, ...] = ()
    expectations: str = ""
    ignored: bool = False
    picture: Path | None = None
    picture_url: str = ""
    lost: tuple[str, ...] = ()
    trace: str = ""
    begin: float = 0.0

    @property
    def of_run(self) -> bool:
        """Whether it is on a run; if not, on a file of expectations that requires missing logs."""
        return str(self.path) != self.expectations

    def ruled(self, event: Event) -> Ruled:
        """Give what became of a finding."""
        return self.rulings.get(event, Ruled())

    @property
    def failing(self) -> tuple[Event, ...]:
        """Findings that fail the run."""
        return tuple(event for event in self.events if self.ruled(event).ruling.fails)

    @property
    def excused(self) -> tuple[Event, ...]:
        """Findings that do not: expected, waived, in a budget, or filtered."""
        return tuple(event for event in self.events if not self.ruled(event).ruling.fails)

    @property
    def severity(self) -> tuple[int, int, float]:
        """Sorts runs, the worst first: by status, number of findings that fail it, best score."""
        score = max((event.score for event in self.failing), default=0.0)
        return list(EXIT).index(self.status), -len(self.failing) - len(self.missing), -score

    @classmethod
    def of(cls, path: Path, analysis: Analysis, *, localise: bool = False) -> "Verdict":
        """Take from an analysis what is printed.

        Args:
            path: The file that it is of.
            analysis: The analysis.
            localise: Whether to localise each finding.
        """
        known = analysis.localisations if localise and analysis.findings else {}
        return cls(
            path,
            analysis.status,
            analysis.model,
            analysis.findings,
            analysis.message,
            {event: known[event] for event in analysis.findings if event in known},
            analysis.unknown,
            analysis.model_sha256,
            analysis.orders,
            analysis.assumed,
            str(analysis.run.meta.get("scenario", "")),
            analysis.run.duration,
            begin=float(analysis.run.time[0]),
        )


def classify_file(
    path: Path | Source,
    library: Library,
    *,
    reading: Reading | None = None,
    unknown: Unknown = Unknown.FINDING,
    localise: bool = False,
    draw: Callable[[Analysis, Path], Path] | None = None,
) -> Verdict:
    """Classify one file; errors become part of the verdict.

    Args:
        path: A run file, any log that `inspector import` reads, or one of NoisyTest's two-column
            logs (``*.log``).
        library: Models to choose from.
        reading: How logs are read.
        unknown: Whether out-of-distribution frames below the alarm threshold are findings.
        localise: Whether to localise each finding.
        draw: Draws a picture of an analysis of a file and gives its path, if one is wanted.

    Returns:
        The verdict.
    """
    source = path if isinstance(path, Source) else Source(path)
    begun = perf_counter()
    try:
        if source.path.suffix == ".log" and not _has_header(source.path):
            analysis = analyse_noise(*nc.read_log(source.path), library, unknown=unknown)
        else:
            opened = open_source(source, reading)
            analysis = analyse(opened.run, library, unknown=unknown)
            analysis = replace(analysis, assumed=opened.assumed)
        verdict = Verdict.of(source.shown, analysis, localise=localise)
        if draw is not None:
            try:
                verdict = replace(verdict, picture=draw(analysis, source.shown))
            except (nm.OutputError, OSError) as error:
                verdict = replace(verdict, lost=(str(error),))
    except EXPECTED as error:
        message = without_path(error, source.path)
        verdict = Verdict(source.shown, Status.BAD_INPUT, message=message, unknown=unknown)
    except Exception as error:  # a bug that one run shows must not hide the findings of others
        verdict = Verdict(
            source.shown,
            Status.INTERNAL_ERROR,
            message=f"{type(error).__name__}: {error}",
            unknown=unknown,
            trace=traceback.format_exc(),
        )
    return replace(verdict, seconds=perf_counter() - begun)


def classify_files(
    paths: Sequence[Path | Source],
    library: Library,
    *,
    reading: Reading | None = None,
    unknown: Unknown = Unknown.FINDING,
    localise: bool = False,
    draw: Callable[[Analysis, Path], Path] | None = None,
    jobs: Jobs = 1,
) -> Iterator[Verdict]:
    """Classify many files; one bad file never stops the rest.

    Args:
        paths: The files, see `classify_file`.
        library: Models to choose from.
        reading: How logs are read.
        unknown: Whether out-of-distribution frames below the alarm threshold are findings.
        localise: Whether to localise each finding.
        draw: Draws a picture of an analysis, see `classify_file`; importable for several jobs.
        jobs: How many to work on at once, or the address of a Dask scheduler. A run with which a
            worker dies is an internal error.

    Returns:
        A verdict per file, in their order.
    """
    one = partial(
        classify_file,
        library=library,
        reading=reading,
        unknown=unknown,
        localise=localise,
        draw=draw,
    )
    return in_order(one, paths, jobs=jobs, died=partial(died, unknown=unknown), work=work_of(paths))


def died(path: Path | Source, unknown: Unknown) -> Verdict:
    """The verdict on a run with which a worker died."""
    shown = path.shown if isinstance(path, Source) else path
    message = f"{DIED}; classify this run alone to see why"
    return Verdict(shown, Status.INTERNAL_ERROR, message=message, unknown=unknown)


def work_of(paths: Sequence[Path | Source]) -> float:
    """About how long runs take, in [s]: one core does 50 MB/s of samples that are not packed."""
    files = (each.path if isinstance(each, Source) else each for each in paths)
    return sum(file.stat().st_size for file in files if file.is_file()) / 50e6


LONGEST_LINE = 2**16
"""Characters of a line that are looked at."""


def _has_header(path: Path) -> bool:
    """Whether a text begins with a line of names: NoisyTest's logs have two numbers a line."""
    if not path.is_file():  # a device or a pipe may have no end
        return True
    with suppress(OSError), path.open(encoding="utf-8", errors="replace") as stream:
        while line := stream.readline(LONGEST_LINE):
            content = line.partition("#")[0].strip()
            if content:
                return len(re.split(r"[,;\s]+", content)) > 2 or content[0].isalpha()
    return False


def exit_status(verdicts: Sequence[Verdict]) -> int:
    """Take the worst of several; bad input that is ignored counts if there is nothing else."""
    counted = [verdict for verdict in verdicts if not verdict.ignored] or verdicts
    return worst(EXIT[verdict.status] for verdict in counted)


def counts(verdicts: Iterable[Verdict]) -> dict[str, dict[str, int]]:
    """Count what all outputs state.

    Args:
        verdicts: What was found in runs.

    Returns:
        `runs`, by status, and `findings`: those that fail their runs, those that are missing, and
        the others by what became of them. Each has all its keys.
    """
    runs: Counter[str] = Counter()
    found: Counter[str] = Counter()
    for verdict in verdicts:
        runs[verdict.status.value] += verdict.of_run
        found["failing"] += len(verdict.failing)
        found["missing"] += len(verdict.missing)
        found.update(verdict.ruled(event).ruling.value for event in verdict.excused)
    excuses = [each.value for each in Ruling if not each.fails]
    return {
        "runs": {status.value: runs[status.value] for status in EXIT},
        "findings": {name: found[name] for name in ("failing", "missing", *excuses)},
    }
