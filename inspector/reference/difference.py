"""Runs before and after a change of code: each scenario by itself, with the same numbers.

The runs after are classified beside those before, and the other way round. So the verdict on a
scenario depends neither on the order of scenarios nor on their number.
"""

import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from statistics import median

import numpy as np

from inspector.errors import EXIT, InspectorError, Status, Unknown, without_path
from inspector.errors import worst as worst_code
from inspector.library import Library
from inspector.logs.read import Source, sources
from inspector.reference.judging import Comparison, Kind, compare, same_motion
from inspector.reference.levels import HOP, SIGNALS, Levels
from inspector.reference.store import Reference, levels_of, of_runs
from inspector.reference.verdicts import References
from inspector.verdict import END, EXPECTED, UNREAD, Finding, Verdict, classify_files
from noiseclassifier import Event
from noiseclassifier.matching import match
from noisemodel.parallel import Jobs

RARE = 3.0
"""By how many decibels over its margin a single run of several makes its scenario worse."""
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
BROKEN = (Outcome.MISSING, Outcome.RENAMED, Outcome.FROZEN, Outcome.CUT)
"""What fails whatever the levels are."""


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


@dataclass(frozen=True, eq=False)
class Failed:
    """A file that cannot be compared, or that shows a bug."""

    path: Path
    problem: str
    status: Status = Status.BAD_INPUT
    trace: str = ""


@dataclass(frozen=True)
class Gate:
    """What fails: new or louder findings, scenarios that are worse or broken, files not read."""

    new: bool = False
    worse: bool = True
    broken: bool = True
    failed: bool = True  # they always do if there are no others


@dataclass(frozen=True, eq=False)
class Difference:
    """What became of all scenarios, the worst first."""

    rows: tuple[Row, ...]
    failed: tuple[Failed, ...] = ()
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
        failing = (row.outcome in BROKEN and self.gate.broken) or (
            row.outcome is Outcome.WORSE and self.gate.worse
        )
        if failing or (row.new and self.gate.new):
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


@dataclass(frozen=True, eq=False)
class _Side:
    """The runs of one side that can be compared, and the verdicts on them beside the other."""

    reference: Reference
    levels: Sequence[Levels]
    verdicts: Mapping[Path, Verdict]

    @property
    def names(self) -> list[str]:
        return sorted({each.name for each in self.levels})

    def named(self, name: str) -> list[Levels]:
        return [each for each in self.levels if each.name == name]


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
    failed: list[Failed] = []
    paths = before, after
    found = [sources([path])[0] for path in paths]
    levels = [_measured(own, path, failed) for own, path in zip(found, paths, strict=True)]
    if not before.is_dir() and not after.is_dir():  # two files that are named themselves are a pair
        levels[1] = [replace(each, name=levels[0][0].name) for each in levels[1] if levels[0]]
    references = [Reference(path, of_runs(own)) for path, own in zip(paths, levels, strict=True)]
    verdicts: list[dict[Path, Verdict]] = []
    for own, other, measured in zip(found, reversed(references), levels, strict=True):
        known = {Path(each.run): each for each in measured}
        runs = [each for each in own if each.shown in known]
        beside = References({other.path: other}, {each.shown: other.path for each in runs}, known)
        classified = classify_files(runs, library, unknown=unknown, reference=beside, jobs=jobs)
        verdicts.append({each.path: each for each in classified})
        failed += [
            Failed(each.path, each.message, each.status, each.trace)
            for each in verdicts[-1].values()
            if each.status in UNREAD
        ]
    broken = {each.path for each in failed}
    sides = [
        _Side(reference, [each for each in own if Path(each.run) not in broken], of)
        for reference, own, of in zip(references, levels, verdicts, strict=True)
    ]
    rows = _rows(sides[0], sides[1], margin)
    result = Difference(
        tuple(sorted(rows, key=lambda row: (ORDER.index(row.outcome), not row.new, row.name))),
        tuple(failed),
        margin=margin,
    )
    if sides[0].levels and sides[1].levels and len(result.alone) == len(rows):
        first, second = (", ".join(side.names[:3]) for side in sides)
        raise InspectorError(
            f"{before} and {after} have no run in common, neither by name nor by motion"
            f" ({first} and {second})"
        )
    return result


def _measured(runs: Sequence[Source], root: Path, failed: list[Failed]) -> list[Levels]:
    """Levels of the runs that can be read; the others fail."""
    found = []
    for each in runs:
        try:
            found.append(levels_of(each, root if root.is_dir() else None))
        except EXPECTED as error:
            failed.append(Failed(each.shown, without_path(error, each.path)))
        except Exception as error:  # a bug that one run shows must not hide changes of others
            problem, trace = f"{type(error).__name__}: {error}", traceback.format_exc()
            failed.append(Failed(each.shown, problem, Status.INTERNAL_ERROR, trace))
    return found


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
