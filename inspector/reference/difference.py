"""Runs before and after a change of code: each scenario by itself, with the same numbers.

The runs after are classified beside those before, and the other way round. So the verdict on a
scenario depends neither on the order of scenarios nor on their number.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from inspector.analysis import Analysis
from inspector.errors import EXIT, InspectorError, Status, Unknown
from inspector.errors import worst as worst_code
from inspector.library import Library
from inspector.logs.read import Source, sources
from inspector.reference.judging import Comparison, Kind, compare, same_motion
from inspector.reference.levels import HOP, SIGNALS, Levels, levels
from inspector.reference.store import Reference, of_runs, scenario_of
from inspector.reference.verdicts import beside
from inspector.verdict import END, Finding, Verdict, classify_file, died, work_of
from noiseclassifier import Event, Labels
from noiseclassifier.matching import match
from noisemodel.parallel import Jobs, in_order

RARE = 3.0  # by how many decibels over its margin a single run of several makes its scenario worse
NEW, LOUDER, RESOLVED = "new", "louder", "resolved"


class Outcome(StrEnum):
    """What became of a scenario, the worst first."""

    MISSING = "missing"
    RENAMED = "renamed"
    FROZEN = "frozen"
    CUT = "cut"
    WORSE = "worse"
    INCONCLUSIVE = "inconclusive"
    ADDED = "added"
    SAME = "same"
    BETTER = "better"


ORDER = list(Outcome)
# What fails whatever the levels are.
BROKEN = (Outcome.MISSING, Outcome.RENAMED, Outcome.FROZEN, Outcome.CUT)


@dataclass(frozen=True)
class ChangedFinding:
    """A finding that only one side has ("new" or "resolved"), or that is "louder"."""

    kind: str
    run: Path
    event: Finding


@dataclass(frozen=True)
class Change:
    """How much louder a joint is in an octave after the change.

    It is the loudest exceedance of a run over all runs before: median, least and most of the runs.
    """

    joint: str
    signal: str  # of SIGNALS
    band: tuple[float, float]  # [Hz]
    change: float  # [dB]
    low: float  # [dB]
    high: float  # [dB]

    def __str__(self) -> str:
        low, high = self.band
        where = f"{self.joint}, {self.signal}, {low:.0f} to {high:.0f} Hz"
        return f"{where} {self.change:+.1f} dB ({self.low:+.1f} to {self.high:+.1f})"


@dataclass(frozen=True, eq=False)
class Row:
    """A scenario before and after."""

    name: str
    outcome: Outcome
    reason: str  # of the outcome, in a line
    before: tuple[Path, ...] = ()
    after: tuple[Path, ...] = ()
    margin: float = 0.0  # from which it is louder than the runs before, in [dB]
    score: float | None = None  # median over the runs after of their largest score, in [dB]
    changes: tuple[Change, ...] = ()  # the largest first
    findings: tuple[ChangedFinding, ...] = ()  # new ones first
    remarks: tuple[str, ...] = ()  # what is not compared, and why
    worst: Comparison | None = field(default=None, repr=False)  # of the run with the largest score

    @property
    def new(self) -> tuple[ChangedFinding, ...]:
        """Findings that are new or louder."""
        return tuple(each for each in self.findings if each.kind != RESOLVED)


@dataclass(frozen=True)
class Gate:
    """What fails beside broken scenarios: new or louder findings, worse ones, files not read."""

    new: bool = False
    worse: bool = True
    failed: bool = True  # they always do if there are no others


@dataclass(frozen=True, eq=False)
class Difference:
    """What became of all scenarios, the worst first."""

    rows: tuple[Row, ...]
    failed: tuple[Verdict, ...] = ()  # on files that cannot be compared, or that show a bug
    gate: Gate = field(default_factory=Gate)
    margin: float = 0.0  # the least one, in [dB]
    picture: Path | None = None  # of the worst scenario
    picture_url: str = ""  # where that will be published

    @property
    def outcome(self) -> Outcome:
        """The worst of all scenarios."""
        found = (row.outcome for row in self.rows)
        return min(found, key=ORDER.index, default=Outcome.INCONCLUSIVE)

    @property
    def alone(self) -> tuple[Row, ...]:
        """Scenarios that one side lacks."""
        outcomes = (Outcome.MISSING, Outcome.ADDED)
        return tuple(row for row in self.rows if row.outcome in outcomes)

    def status(self, row: Row) -> Status:
        """Whether a scenario fails."""
        worse = row.outcome is Outcome.WORSE and self.gate.worse
        if row.outcome in BROKEN or worse or (row.new and self.gate.new):
            return Status.FINDINGS
        return Status.CANNOT_TELL if row.outcome is Outcome.INCONCLUSIVE else Status.OK

    @property
    def exit_status(self) -> int:
        """The worst of all scenarios and files; "cannot tell" if none has another status."""
        codes = [EXIT[self.status(row)] for row in self.rows]
        told = [code for code in codes if code != EXIT[Status.CANNOT_TELL]] or codes
        bad = [
            EXIT[each.status]
            for each in self.failed
            if self.gate.failed or each.status is Status.INTERNAL_ERROR or not self.rows
        ]
        return worst_code([*told, *bad])


class _Run(NamedTuple):
    """A run with the verdict by the general model."""

    verdict: Verdict
    levels: Levels
    labels: Labels | None


class _Side:
    """The runs of one side that can be compared, and the verdicts on them beside the other."""

    def __init__(self, path: Path, runs: Sequence[_Run]) -> None:
        self.runs, self.levels = runs, [each.levels for each in runs]
        self.reference = Reference(path, of_runs(self.levels))
        self.names = sorted({each.name for each in self.levels})
        self.verdicts: dict[Path, Verdict] = {}

    def named(self, name: str) -> list[Levels]:
        return [each for each in self.levels if each.name == name]

    def compare(self, other: Reference) -> None:
        """Add the verdicts beside the other side."""
        for verdict, run, labels in self.runs:
            found = beside(verdict, compare(run, other.scenarios), other, labels)
            self.verdicts[verdict.path] = found


def difference(
    before: Path,
    after: Path,
    library: Library,
    *,
    margin: float = 0.0,
    unknown: Unknown = Unknown.FINDING,
    jobs: Jobs = 1,
) -> Difference:
    """Compare the runs of a folder with the runs of another.

    Args:
        margin: Least margin from which a run is louder, in [dB].
        jobs: How many runs to work on at once.
    """
    sides, failed, name = [], [], ""
    for path in (before, after):
        root, of = path if path.is_dir() else None, sources([path])[0]
        one = partial(_classified, library=library, root=root, unknown=unknown, name=name)
        end = partial(died, unknown=unknown)
        found = list(in_order(one, of, jobs=jobs, died=end, work=work_of(of)))
        failed += [each for each in found if isinstance(each, Verdict)]
        sides.append(_Side(path, [each for each in found if isinstance(each, _Run)]))
        if not before.is_dir() and not after.is_dir():  # two files that are named are a pair
            name = "".join(sides[0].names)
    first, second = sides
    first.compare(second.reference)
    second.compare(first.reference)
    rows = _rows(first, second, margin)
    rows.sort(key=lambda row: (ORDER.index(row.outcome), not row.new, row.name))
    result = Difference(tuple(rows), tuple(failed), margin=margin)
    if first.levels and second.levels and len(result.alone) == len(rows):
        here, there = (", ".join(side.names[:3]) for side in sides)
        raise InspectorError(
            f"{before} and {after} have no run in common, neither by name nor by motion"
            f" ({here} and {there})"
        )
    return result


def _classified(
    source: Source, library: Library, root: Path | None, unknown: Unknown, name: str
) -> _Run | Verdict:
    """Classify a run and measure its levels; the verdict alone if it cannot be read."""
    known: list[Any] = []

    def measure(analysis: Analysis, verdict: Verdict) -> tuple[Verdict, None]:
        scenario = name or scenario_of(analysis.run, source.shown, root)
        known[:] = levels(analysis.run, name=scenario, file=str(source.shown)), analysis.labels
        return verdict, None

    verdict = classify_file(source, library, unknown=unknown, reference=measure)
    return _Run(verdict, *known) if known else verdict


def _paths(runs: Sequence[Levels]) -> tuple[Path, ...]:
    return tuple(Path(each.run) for each in runs)


def _rows(before: _Side, after: _Side, margin: float) -> list[Row]:
    """A row for each scenario of either side."""
    rows = []
    come = [name for name in after.names if name not in before.names]
    for name in before.names:
        runs, to, given = before.named(name), name, None
        if name not in after.names:
            last = runs[-1]
            to = next((n for n in come if same_motion(after.named(n)[-1], last)), "")
            if not to:
                reason = f"{len(runs)} before, none after"
                rows.append(Row(name, Outcome.MISSING, reason, _paths(runs)))
                continue
            come.remove(to)
            given = Outcome.RENAMED, f"is called {to} after"
        rows.append(_row(name, runs, after.named(to), before, after, margin, given))
    for name in come:
        runs = after.named(name)
        findings = tuple(_findings(runs, after.verdicts, (), NEW))
        rows.append(Row(name, Outcome.ADDED, "only after", (), _paths(runs), findings=findings))
    return rows


def _row(
    name: str,
    earlier: Sequence[Levels],
    later: Sequence[Levels],
    before: _Side,
    after: _Side,
    least: float,
    given: tuple[Outcome, str] | None,
) -> Row:
    """Compare a scenario; what became of it may be given."""
    scenarios, others = before.reference.scenarios, of_runs(later)
    own = tuple(each for each in scenarios if each.name == name) or scenarios
    found = [compare(replace(each, name=name), own) for each in later]
    back = [compare(replace(each, name=name), others).worst for each in earlier]
    margin = max([least, *(each.margins[Kind.REPETITIONS].db for each in found if each.scenarios)])
    scores = [each.worst for each in found if each.scenarios and np.isfinite(each.worst)]
    changes = _changes(found)
    events = [event for each in earlier for event in before.verdicts[Path(each.run)].events]
    outcome, reason = given or _outcome(found, back, scores, margin, changes, after.verdicts)
    findings = [
        *_findings(later, after.verdicts, events, NEW),
        *_findings(earlier, before.verdicts, (), RESOLVED),
    ]
    return Row(
        name,
        outcome,
        reason,
        _paths(earlier),
        _paths(later),
        margin,
        median(scores) if scores else None,
        changes,
        tuple(findings),
        tuple(dict.fromkeys(remark for each in found for remark in each.remarks)),
        max(found, key=lambda each: np.nan_to_num(each.worst, nan=-np.inf), default=None),
    )


def _outcome(
    found: Sequence[Comparison],
    back: Sequence[float],
    scores: Sequence[float],
    margin: float,
    changes: Sequence[Change],
    verdicts: Mapping[Path, Verdict],
) -> tuple[Outcome, str]:
    """What became of a scenario, and why."""
    for each in found:
        known = verdicts[Path(each.run.run)].beside
        for what, why in known.failures if known else ():
            if what == END or what.startswith("motion from"):
                kind = Outcome.CUT if what == END else Outcome.FROZEN
                return kind, f"{Path(each.run.run).name} lacks the {what}: {why}"
    if not scores:
        return Outcome.INCONCLUSIVE, "the runs after make another motion"
    told = f"{median(scores):+.1f} dB over the runs before, margin {margin:.1f} dB"
    if median(scores) > margin or (changes and changes[0].low > margin):
        return Outcome.WORSE, told
    if max(scores) > margin + RARE:
        return Outcome.WORSE, f"{max(scores):+.1f} dB in one of {len(scores)} runs, {told}"
    returned = [score for score in back if np.isfinite(score)]
    if returned and median(returned) > margin:
        return Outcome.BETTER, f"{-median(returned):+.1f} dB, the runs before were louder"
    return Outcome.SAME, told


def _changes(found: Sequence[Comparison]) -> tuple[Change, ...]:
    """Loudest exceedance of each cell over the runs after."""
    known = [each for each in found if each.scenarios]
    if not known:
        return ()
    octaves = [o for o in known[0].octaves if all(o in each.octaves for each in known)]
    tops = []
    for each in known:
        over = np.nan_to_num(each.over, nan=-np.inf)
        # One frame alone is no evidence.
        top = np.minimum(over[:-1], over[1:]).max(axis=0, initial=-np.inf)
        tops.append(top[:, :, [each.octaves.index(o) for o in octaves]])
    changes = []
    for joint in [j for j in known[0].joints if all(j in each.joints for each in known)]:
        rows = [top[each.joints.index(joint)] for each, top in zip(known, tops, strict=True)]
        for place, cells in enumerate(np.stack(rows, axis=-1).reshape(-1, len(rows)).tolist()):
            if np.isfinite(cells).all():
                signal, octave = divmod(place, len(octaves))
                of = (joint, SIGNALS[signal], octaves[octave])
                changes.append(Change(*of, median(cells), min(cells), max(cells)))
    return tuple(sorted(changes, key=lambda each: -each.change))


def _findings(
    runs: Sequence[Levels],
    verdicts: Mapping[Path, Verdict],
    earlier: Sequence[Event],
    kind: str,
) -> list[ChangedFinding]:
    """Findings of runs that the other side does not have as loud."""
    found = []
    for path in _paths(runs):
        verdict = verdicts[path]
        for event in verdict.events if verdict.beside else ():
            if event.evidence.excused:
                continue
            alike = [other for other in earlier if other.label == event.label]
            there = bool(match([event], alike, collar=4 * HOP))
            found.append(ChangedFinding(LOUDER if there else kind, path, event))
    return found
