"""Runs before and after a change of code: each scenario by itself, with the same numbers.

The runs of a scenario after are classified beside its runs before, and the other way round. So the
verdict on it depends neither on the order of scenarios nor on their number.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
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
from inspector.reference.judging import Comparison, Kind, Scenario, compare
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
    FROZEN = "frozen"
    CUT = "cut"
    WORSE = "worse"
    INCONCLUSIVE = "inconclusive"
    ADDED = "added"
    SAME = "same"
    BETTER = "better"


ORDER = list(Outcome)
# What fails whatever the levels are, and what one side lacks.
BROKEN = (Outcome.MISSING, Outcome.FROZEN, Outcome.CUT)
ALONE = (Outcome.MISSING, Outcome.ADDED)


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
    worst: Comparison | None = field(default=None, repr=False)  # that has the largest score

    @property
    def new(self) -> tuple[ChangedFinding, ...]:
        """Findings that are new or louder."""
        return tuple(each for each in self.findings if each.kind != RESOLVED)


@dataclass(frozen=True, eq=False)
class Difference:
    """What became of all scenarios, the worst first."""

    rows: tuple[Row, ...]
    failed: tuple[Verdict, ...]  # on files that cannot be compared, or that show a bug
    margin: float  # the least one, in [dB]
    # What fails beside broken scenarios: new or louder findings, worse ones, files not read, which
    # always do if there are no others.
    new_fails: bool = False
    worse_fails: bool = True
    unread_fails: bool = True
    picture: Path | None = None  # of the worst scenario

    @property
    def outcome(self) -> Outcome:
        """The worst of all scenarios."""
        return self.rows[0].outcome if self.rows else Outcome.INCONCLUSIVE

    @property
    def alone(self) -> tuple[Row, ...]:
        """Scenarios that one side lacks."""
        return tuple(row for row in self.rows if row.outcome in ALONE)

    def status(self, row: Row) -> Status:
        """Whether a scenario fails."""
        worse = row.outcome is Outcome.WORSE and self.worse_fails
        if row.outcome in BROKEN or worse or (row.new and self.new_fails):
            return Status.FINDINGS
        return Status.CANNOT_TELL if row.outcome is Outcome.INCONCLUSIVE else Status.OK

    @property
    def exit_status(self) -> int:
        """The worst of all scenarios and files; "cannot tell" if none has another status."""
        codes = [EXIT[self.status(row)] for row in self.rows]
        told = [code for code in codes if code != EXIT[Status.CANNOT_TELL]] or codes
        all_fail = self.unread_fails or not self.rows
        bad = (each.status for each in self.failed)
        lost = [EXIT[each] for each in bad if all_fail or each is Status.INTERNAL_ERROR]
        return worst_code([*told, *lost])


class _Run(NamedTuple):
    """A run with the verdict by the general model."""

    verdict: Verdict
    levels: Levels
    labels: Labels | None

    def compare(self, scenarios: Sequence[Scenario]) -> tuple[Comparison, Verdict]:
        """Compare it with the other side; and the verdict on it beside that."""
        found = compare(self.levels, scenarios)
        other = Reference(self.verdict.path, tuple(scenarios))
        return found, beside(self.verdict, found, other, self.labels)


def difference(
    before: Path,
    after: Path,
    library: Library,
    *,
    margin: float = 0.0,
    unknown: Unknown = Unknown.FINDING,
    jobs: Jobs = 1,
) -> Difference:
    """Compare the runs of a folder with the runs of another; a run is louder from a margin on."""
    sides, failed, name = [], [], ""
    for path in (before, after):
        root, of = path if path.is_dir() else None, sources([path])[0]
        one = partial(_classified, library=library, root=root, unknown=unknown, name=name)
        end = partial(died, unknown=unknown)
        side: dict[str, list[_Run]] = {}
        for run in in_order(one, of, jobs=jobs, died=end, work=work_of(of)):
            if isinstance(run, Verdict):
                failed.append(run)
            else:
                side.setdefault(run.levels.name, []).append(run)
        sides.append(dict(sorted(side.items())))
        if not before.is_dir() and not after.is_dir():  # two files that are named are a pair
            name = "".join(side)
    rows = _rows(sides[0], sides[1], margin)
    rows.sort(key=lambda row: (ORDER.index(row.outcome), not row.new, row.name))
    if all(sides) and all(row.outcome in ALONE for row in rows):
        here, there = (", ".join(list(side)[:3]) for side in sides)
        apart = "have no scenario in common by name"
        raise InspectorError(f"{before} and {after} {apart} ({here} and {there})")
    return Difference(tuple(rows), tuple(failed), margin)


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


def _paths(runs: Sequence[_Run]) -> tuple[Path, ...]:
    return tuple(each.verdict.path for each in runs)


def _rows(
    before: Mapping[str, list[_Run]], after: Mapping[str, list[_Run]], margin: float
) -> list[Row]:
    """A row for each scenario of either side."""
    rows = []
    known = {name: of_runs([each.levels for each in runs]) for name, runs in before.items()}
    for name, runs in before.items():
        if name in after:
            rows.append(_row(name, runs, after[name], known[name], margin))
        else:
            why = f"{len(runs)} before, none after"
            rows.append(Row(name, Outcome.MISSING, why, _paths(runs)))
    every = [scenario for each in known.values() for scenario in each]
    for name in [name for name in after if name not in before]:
        verdicts = [each.compare(every)[1] for each in after[name]]
        new, paths = tuple(_findings(verdicts, (), NEW)), _paths(after[name])
        rows.append(Row(name, Outcome.ADDED, "only after", (), paths, findings=new))
    return rows


def _row(
    name: str,
    earlier: Sequence[_Run],
    later: Sequence[_Run],
    scenarios: Sequence[Scenario],
    least: float,
) -> Row:
    """Compare a scenario."""
    found, verdicts = zip(*(each.compare(scenarios) for each in later), strict=True)
    others = of_runs([each.levels for each in later])
    back, were = zip(*(each.compare(others) for each in earlier), strict=True)
    margin = max([least, *(each.margins[Kind.REPETITIONS].db for each in found if each.scenarios)])
    scores = [each.worst for each in found if each.scenarios and np.isfinite(each.worst)]
    changes = _changes(found)
    outcome, reason = _outcome(verdicts, back, scores, margin, changes)
    events = [event for each in were for event in each.events]
    findings = [*_findings(verdicts, events, NEW, least), *_findings(were, (), RESOLVED, least)]
    shown = [each for each in found if each.over.size]
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
        max(shown, key=lambda each: np.nan_to_num(each.worst, nan=-np.inf), default=None),
    )


def _outcome(
    verdicts: Sequence[Verdict],
    back: Sequence[Comparison],
    scores: Sequence[float],
    margin: float,
    changes: Sequence[Change],
) -> tuple[Outcome, str]:
    """What became of a scenario, and why."""
    for verdict in verdicts:
        for what, why in verdict.beside.failures if verdict.beside else ():
            if what == END or what.startswith("motion from"):
                kind = Outcome.CUT if what == END else Outcome.FROZEN
                return kind, f"{verdict.path.name} lacks the {what}: {why}"
    if not scores:
        same = any(each.scenarios for each in back)
        told = "have no octave of those before" if same else "make another motion"
        return Outcome.INCONCLUSIVE, f"the runs after {told}"
    told = f"{median(scores):+.1f} dB over the runs before, margin {margin:.1f} dB"
    if median(scores) > margin or (changes and changes[0].low > margin):
        return Outcome.WORSE, told
    if max(scores) > margin + RARE:
        return Outcome.WORSE, f"{max(scores):+.1f} dB in one of {len(scores)} runs, {told}"
    returned = [each.worst for each in back if np.isfinite(each.worst)]
    if returned and median(returned) > margin:
        return Outcome.BETTER, f"{-median(returned):+.1f} dB, the runs before were louder"
    return Outcome.SAME, told


def _changes(found: Sequence[Comparison]) -> tuple[Change, ...]:
    """Loudest exceedance of each cell that all runs after of the motion have."""
    known = [each for each in found if each.scenarios]
    tops: dict[tuple[str, str, tuple[float, float]], list[float]] = {}
    for each in known:
        over = np.nan_to_num(each.over, nan=-np.inf)
        # One frame alone is no evidence.
        top = np.minimum(over[:-1], over[1:]).max(axis=0, initial=-np.inf)
        for joint, signal, octave in np.ndindex(top.shape):
            cell = each.joints[joint], SIGNALS[signal], each.octaves[octave]
            tops.setdefault(cell, []).append(float(top[joint, signal, octave]))
    changes = [
        Change(*cell, median(values), min(values), max(values))
        for cell, values in tops.items()
        if len(values) == len(known) and np.isfinite(values).all()
    ]
    return tuple(sorted(changes, key=lambda each: -each.change))


def _findings(
    verdicts: Sequence[Verdict], earlier: Sequence[Event], kind: str, least: float = 0.0
) -> list[ChangedFinding]:
    """Findings of runs that the other side does not have as loud, by a least margin in [dB]."""
    found = []
    for verdict in verdicts:
        for event in verdict.events:
            over = event.evidence.over_db
            if not event.evidence.excused and (over is None or over > least):
                alike = [other for other in earlier if other.label == event.label]
                there = bool(match([event], alike, collar=4 * HOP))
                found.append(ChangedFinding(LOUDER if there else kind, verdict.path, event))
    return found
