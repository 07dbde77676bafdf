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
from inspector.reference.levels import HOP, Levels
from inspector.reference.store import Reference, levels_of, of_runs
from inspector.reference.verdicts import References
from inspector.verdict import EXPECTED, Evidence, Verdict, classify_files
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


BROKEN = (Outcome.MISSING, Outcome.RENAMED, Outcome.FROZEN, Outcome.CUT)
"""What fails whatever the levels are."""


@dataclass(frozen=True)
class Finding:
    """A finding that only one side has, or that is louder.

    Attributes:
        kind: "new", "louder" or "resolved".
        over: Its loudest exceedance over the other side, in [dB]; None by the general model.
        level: Level of that cell, in [dB re 1 rad/s].
    """

    kind: str
    run: Path
    event: Event
    over: float | None
    level: float | None
    evidence: Evidence


@dataclass(frozen=True)
class Change:
    """How much louder a joint is in an octave after the change.

    Attributes:
        signal: "velocity" or "tracking error".
        band: The octave, in [Hz].
        change: Median over the runs of its loudest exceedance over all runs before, in [dB].
        low: The same of the quietest run.
        high: The same of the loudest run.
    """

    joint: str
    signal: str
    band: tuple[float, float]
    change: float
    low: float
    high: float

    def __str__(self) -> str:
        low, high = self.band
        where = f"{self.joint}, {self.signal}, {low:.0f} to {high:.0f} Hz"
        return f"{where} {self.change:+.1f} dB ({self.low:+.1f} to {self.high:+.1f})"


@dataclass(frozen=True, eq=False)
class Row:
    """A scenario before and after.

    Attributes:
        reason: Of the outcome, in a line.
        margin: From how many decibels over the runs before on it is louder.
        score: Median over the runs after of their largest score, in [dB]; None without.
        changes: By joint, signal and octave, the largest first.
        findings: New ones first.
        remarks: What is not compared, and why.
        worst: The run after whose score is the largest, as it compares; None without.
    """

    name: str
    outcome: Outcome
    reason: str
    before: tuple[Path, ...] = ()
    after: tuple[Path, ...] = ()
    margin: float = 0.0
    score: float | None = None
    changes: tuple[Change, ...] = ()
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()
    worst: Comparison | None = field(default=None, repr=False)

    @property
    def new(self) -> tuple[Finding, ...]:
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
    """What fails.

    Attributes:
        new: Whether new or louder findings do.
        worse: Whether a scenario that is worse does.
        broken: Whether scenarios that are missing, renamed, frozen or cut do.
        failed: Whether files that cannot be read do; they always do if there are no others.
    """

    new: bool = False
    worse: bool = True
    broken: bool = True
    failed: bool = True


@dataclass(frozen=True, eq=False)
class Difference:
    """What became of all scenarios.

    Attributes:
        rows: The scenarios, the worst first.
        margin: Least margin, in [dB].
        picture: Of the worst scenario, if one is drawn.
        picture_url: Where that will be published.
    """

    rows: tuple[Row, ...]
    failed: tuple[Failed, ...] = ()
    gate: Gate = field(default_factory=Gate)
    margin: float = 0.0
    picture: Path | None = None
    picture_url: str = ""

    @property
    def outcome(self) -> Outcome:
        """The worst of all scenarios."""
        order = list(Outcome)
        return min(
            (row.outcome for row in self.rows), key=order.index, default=Outcome.INCONCLUSIVE
        )

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
    found = [sources([path])[0] for path in (before, after)]
    alone = all(not path.is_dir() for path in (before, after))
    sides = [
        _measured(side, path, failed) for side, path in zip(found, (before, after), strict=True)
    ]
    if alone:  # two files that are named themselves are a pair
        sides[1] = [replace(each, name=sides[0][0].name) for each in sides[1] if sides[0]]
    references = [
        Reference(path, of_runs(side)) for path, side in zip((before, after), sides, strict=True)
    ]
    verdicts: list[dict[Path, Verdict]] = []
    for place, own in enumerate(found):
        other = references[1 - place]
        measured = {Path(each.run): each for each in sides[place]}
        runs = [each for each in own if each.shown in measured]
        of = {each.shown: other.path for each in runs}
        beside = References({other.path: other}, of, measured)
        classified = classify_files(runs, library, unknown=unknown, reference=beside, jobs=jobs)
        verdicts.append({each.path: each for each in classified})
        failed += [
            Failed(each.path, each.message, each.status, each.trace)
            for each in verdicts[place].values()
            if each.status in (Status.BAD_INPUT, Status.INTERNAL_ERROR)
        ]
    broken = {each.path for each in failed}
    sides = [[each for each in side if Path(each.run) not in broken] for side in sides]
    rows = _rows(references[0], sides, verdicts, margin)
    if (
        sides[0]
        and sides[1]
        and all(row.outcome in (Outcome.MISSING, Outcome.ADDED) for row in rows)
    ):
        examples = [", ".join(sorted({each.name for each in side})[:3]) for side in sides]
        raise InspectorError(
            f"{before} and {after} have no run in common, neither by name nor by motion"
            f" ({examples[0]} and {examples[1]})"
        )
    order = list(Outcome)
    rows.sort(key=lambda row: (order.index(row.outcome), not row.new, row.name))
    return Difference(tuple(rows), tuple(failed), margin=margin)


def _measured(runs: Sequence[Source], root: Path, failed: list[Failed]) -> list[Levels]:
    """Levels of the runs that can be read; the others fail."""
    found = []
    for each in runs:
        try:
            found.append(levels_of(each, root if root.is_dir() else None))
        except EXPECTED as error:
            failed.append(Failed(each.shown, without_path(error, each.path)))
        except Exception as error:  # a bug that one run shows must not hide changes of others
            problem = f"{type(error).__name__}: {error}"
            failed.append(
                Failed(each.shown, problem, Status.INTERNAL_ERROR, traceback.format_exc())
            )
    return found


def _rows(
    reference: Reference,
    sides: Sequence[Sequence[Levels]],
    verdicts: Sequence[Mapping[Path, Verdict]],
    margin: float,
) -> list[Row]:
    """A row for each scenario of either side."""
    names = [sorted({each.name for each in side}) for side in sides]
    runs = [
        {name: [each for each in side if each.name == name] for name in names[place]}
        for place, side in enumerate(sides)
    ]
    rows = []
    come = [name for name in names[1] if name not in names[0]]
    for name in names[0]:
        before = runs[0][name]
        if name in runs[1]:
            after, verdict = runs[1][name], None
        else:
            renamed = next((n for n in come if same_motion(runs[1][n][-1], before[-1])), "")
            if not renamed:
                reason = f"{len(before)} before, none after"
                paths = tuple(Path(each.run) for each in before)
                rows.append(Row(name, Outcome.MISSING, reason, paths))
                continue
            come.remove(renamed)
            after, verdict = runs[1][renamed], (Outcome.RENAMED, f"is called {renamed} after")
        rows.append(_row(name, before, after, reference, verdicts, margin, verdict))
    for name in come:
        after = runs[1][name]
        findings = tuple(_findings(after, verdicts[1], (), NEW))
        paths = tuple(Path(each.run) for each in after)
        rows.append(Row(name, Outcome.ADDED, "only after", (), paths, findings=findings))
    return rows


def _row(
    name: str,
    before: Sequence[Levels],
    after: Sequence[Levels],
    reference: Reference,
    verdicts: Sequence[Mapping[Path, Verdict]],
    least: float,
    given: tuple[Outcome, str] | None,
) -> Row:
    """Compare a scenario."""
    own = [each for each in reference.scenarios if each.name == name] or list(reference.scenarios)
    found = [compare(replace(each, name=name), own) for each in after]
    back = [compare(replace(each, name=name), of_runs(tuple(after))).worst for each in before]
    margin = max([least, *(each.margins[Kind.REPETITIONS].db for each in found if each.scenarios)])
    scores = [each.worst for each in found if each.scenarios and np.isfinite(each.worst)]
    changes = _changes(found)
    earlier = [event for each in before for event in verdicts[0][Path(each.run)].events]
    findings = [
        *_findings(after, verdicts[1], earlier, NEW),
        *_findings(before, verdicts[0], (), RESOLVED),
    ]
    outcome, reason = given or _outcome(found, back, scores, margin, changes, verdicts[1])
    remarks = dict.fromkeys(remark for each in found for remark in each.remarks)
    return Row(
        name,
        outcome,
        reason,
        tuple(Path(each.run) for each in before),
        tuple(Path(each.run) for each in after),
        margin,
        median(scores) if scores else None,
        changes,
        tuple(findings),
        tuple(remarks),
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
            kind = Outcome.CUT if what.startswith("end") else Outcome.FROZEN
            if kind is Outcome.CUT or what.startswith("motion from"):
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
    joints = [j for j in known[0].joints if all(j in each.joints for each in known)]
    octaves = [o for o in known[0].octaves if all(o in each.octaves for each in known)]
    changes = []
    for joint in joints:
        for signal, word in enumerate(("velocity", "tracking error")):
            for octave in octaves:
                tops = []
                for each in known:
                    cell = each.over[
                        :, each.joints.index(joint), signal, each.octaves.index(octave)
                    ]
                    pairs = np.minimum(cell[:-1], cell[1:])  # one frame alone is no evidence
                    tops.append(float(np.nanmax(pairs)) if np.isfinite(pairs).any() else np.nan)
                if np.isfinite(tops).all():
                    changes.append(Change(joint, word, octave, median(tops), min(tops), max(tops)))
    return tuple(sorted(changes, key=lambda each: -each.change))


def _findings(
    runs: Sequence[Levels],
    verdicts: Mapping[Path, Verdict],
    earlier: Sequence[Event],
    kind: str,
) -> list[Finding]:
    """Findings of runs that the other side does not have as loud."""
    found = []
    for run in runs:
        path = Path(run.run)
        for event in verdicts[path].events:
            known = verdicts[path].evidence.get(event)
            if known is None or known.excused:
                continue
            alike = [other for other in earlier if other.label == event.label]
            there = bool(match([event], alike, collar=4 * HOP))
            named = LOUDER if there else kind
            found.append(Finding(named, path, event, known.db, known.level, known))
    return found
