"""What becomes of a verdict beside a reference: findings by moment, rulings, and missing runs."""

import hashlib
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from functools import cache, partial
from math import floor, isfinite
from pathlib import Path

import numpy as np

from inspector.analysis import NOTHING, Analysis
from inspector.errors import Status
from inspector.library import Library
from inspector.logs.read import Reading
from inspector.reference.judging import (
    GAP,
    LONGER,
    SHARE_LONGER,
    Comparison,
    Exceedance,
    Kind,
    Scenario,
    compare,
    robot_fits,
)
from inspector.reference.levels import HOP, Levels, levels
from inspector.reference.store import NAME, Reference, find, scenario_of
from inspector.verdict import (
    END,
    FAILING,
    GENERAL,
    LOG,
    UNREAD,
    Beside,
    Finding,
    Missing,
    Ruling,
    Verdict,
)
from noiseclassifier import UNKNOWN, Labels

LOGS = r"\d+ of (\d+) logs"  # what a scenario with too few of them has
LOUDER = "louder"  # class of a finding that only the reference shows
# A run is frozen where it moves at less than a tenth of its references' speed, for half a second,
# while these make three tenths of their usual speed.
STOPPED, MOVES, STILL_FOR = 0.1, 0.3, 0.5
# Share of a run that may be left to a general model that cannot tell, if the run is to be ok.
LEFT = 0.05


@dataclass(frozen=True)
class References:
    """The reference of each run, to be applied where a run is classified."""

    of: Mapping[Path, Reference] = field(default_factory=dict)  # of runs that have one

    @classmethod
    def found(
        cls, runs: Iterable[Path], given: Path | None = None, reading: Reading | None = None
    ) -> "References":
        """Load the given reference, or the nearest store of each run."""
        load = cache(partial(Reference.load, reading=reading))
        return cls({run: load(path) for run in runs if (path := given or find(run)) is not None})

    def __call__(self, analysis: Analysis, verdict: Verdict) -> tuple[Verdict, Comparison | None]:
        """Add the evidence of the reference to the verdict on a run, and compare them."""
        reference = self.of.get(verdict.path)
        if reference is None:
            return verdict, None
        name = scenario_of(analysis.run, verdict.path)
        if reference.named(name) is None:
            name = scenario_of(analysis.run, verdict.path, _root(verdict.path, reference.path))
        run = levels(analysis.run, name=name, file=str(verdict.path))
        comparison = compare(run, reference.scenarios)
        return beside(verdict, comparison, reference, analysis.labels), comparison

    def __str__(self) -> str:
        """What a batch that resumes must find unchanged: the levels of each reference."""
        text = " ".join(
            f"{each.name} {each.sha256}"
            for reference in dict.fromkeys(self.of.values())
            for scenario in reference.scenarios
            for each in scenario.repetitions
        )
        return hashlib.sha256(text.encode(errors="replace")).hexdigest()

    def judge(self, verdict: Verdict, gate: "Gate | None", today: date) -> Verdict:
        """Decide what becomes of the findings of a run; see `judge`."""
        return judge(verdict, self.of.get(verdict.path), gate=gate, today=today)

    def absent(self, verdicts: Sequence[Verdict], folders: Iterable[Path]) -> list[Verdict]:
        """Verdicts on stores whose required scenarios have too few logs."""
        found, given = [], [folder.resolve() for folder in folders]
        for reference in dict.fromkeys(self.of.values()):
            top, store = reference.path.resolve().parent, reference.path / NAME
            known: Counter[str] = Counter()
            for each in verdicts:
                if self.of.get(each.path) is reference:
                    known.update(each.beside.scenarios if each.beside else (each.scenario,))
            missing = []
            for one in reference.scenarios if reference.stored else ():
                number = known[one.name]
                lacks = one.required and number < one.at_least
                if lacks and any(_asked(one, folder, top) for folder in given):
                    reason = f"no log; it had {len(one.repetitions)}"
                    reason = f"{number} of {one.at_least} logs" if number else reason
                    missing.append(Missing(f"{LOG}{one.name}", reason=reason))
            if missing:
                status, lost = Status.FINDINGS, tuple(missing)
                found.append(Verdict(store, status, missing=lost, expectations=str(store)))
        return found


def still_absent(absent: Sequence[Verdict], runs: Sequence[Verdict]) -> list[Verdict]:
    """What required scenarios lack, by the verdicts of several jobs, in all of their runs."""
    known = Counter(name for each in runs if each.beside for name in each.beside.scenarios)
    missing: dict[Path, dict[str, Missing]] = {each.path: {} for each in absent}
    for verdict in absent:
        for each in verdict.missing:
            number, least = known[each.scenario], re.search(LOGS, each.reason)
            if number < (int(least[1]) if least else 1):
                reason = f"{number} of {least[1]} logs" if least and number else each.reason
                missing[verdict.path][each.label] = replace(each, reason=reason)
    first = {each.path: each for each in reversed(absent)}
    return [replace(first[p], missing=tuple(m.values())) for p, m in missing.items() if m]


def _root(run: Path, store: Path) -> Path | None:
    """The folder below which scenarios are named, such as runs/ beside reference/."""
    full, top = run.resolve(), store.resolve().parent
    if not full.is_relative_to(top):
        return None
    below = max(1, len(full.relative_to(top).parts) - 1)
    return Path(*run.parts[: len(run.parts) - below])


def _asked(scenario: Scenario, folder: Path, top: Path) -> bool:
    """Whether a folder should hold runs of a scenario: all of it, unless it is a part of it."""
    inside = folder.relative_to(top).parts[1:] if folder.is_relative_to(top) else ()
    part = slice(-len(inside) - 1, -1)
    return all(Path(each.run).parts[part] == inside for each in scenario.repetitions)


@dataclass(frozen=True)
class Gate:
    """Findings that fail a run."""

    classes: tuple[str, ...] = ()  # all unless given
    min_score: float | None = None  # some models have negative ones
    min_duration: float = 0.0  # [s]

    def reason(self, event: Finding) -> str:
        """Say why a finding does not fail a run; empty if it does."""
        if self.classes and event.label not in self.classes:
            return f"not of {', '.join(self.classes)} (--fail-on-class)"
        over = event.evidence.over_db is not None  # known by its level, whatever the model's score
        if not over and self.min_score is not None and event.score < self.min_score:
            score = floor(event.score * 1e4) / 1e4  # one that is less than 1 is not told as 1
            return f"score {score:g} below {self.min_score:g} (--min-score)"
        duration = event.stop - event.start
        if duration < self.min_duration:
            return f"{duration:.2f} s, shorter than {self.min_duration:g} s (--min-duration)"
        return ""


def classes_found(library: Library) -> tuple[str, ...]:
    """List the classes that findings by some models, or beside a reference, can have."""
    known = dict.fromkeys(name for model in library.values() for name in model.classes)
    return (*(name for name in known if name != "ok"), UNKNOWN, LOUDER)


def beside(
    verdict: Verdict, comparison: Comparison, reference: Reference, labels: Labels | None = None
) -> Verdict:
    """Add what a comparison shows to the verdict on a run.

    A moment that is louder than its reference is a finding, with the class that the general model
    gives it, or ``louder``. What the general model finds where the run is as loud as its reference
    is excused. Where no reference covers the run, the general model decides.
    """
    events = _events(verdict.events, labels, comparison)
    margins = comparison.margins
    least = margins[Kind.REPETITIONS].db if Kind.REPETITIONS in margins else float("inf")
    quieter = comparison.quieter if comparison.quieter > least else 0.0
    peaks = zip(comparison.joints, comparison.peaks.tolist(), strict=True)
    words, by = [str(comparison)], comparison.run.guided_by
    if quieter:
        words.append(f"{quieter:.1f} dB quieter than each repetition")
    if by.startswith("measured"):
        words.append(f"aligned by {by}: the log has no desired motion")
    known = Beside(
        path=str(reference.path),
        scenarios=comparison.scenarios,
        repetitions=comparison.repetitions,
        shares={str(kind): round(comparison.share(kind), 4) for kind in Kind},
        margins_db={str(kind): round(each.db, 2) for kind, each in margins.items()},
        over_db=round(comparison.worst, 3) if np.isfinite(comparison.worst) else None,
        joints_db={joint: round(peak, 2) for joint, peak in peaks if np.isfinite(peak)},
        quieter_db=round(quieter, 2),
        failures=tuple(_failures(comparison, reference)),
        words="; ".join(filter(None, [*words, *comparison.remarks])),
    )
    covered = known.shares[Kind.GENERAL] <= LEFT
    own = comparison.scenarios[0] if len(comparison.scenarios) == 1 else comparison.run.name
    status = verdict.status
    if any(not each.evidence.excused for each in events):
        status = Status.FINDINGS
    elif status is Status.FINDINGS or (status is Status.CANNOT_TELL and covered):
        status = Status.OK
    return replace(
        verdict,
        status=status,
        events=events,
        beside=known,
        scenario=verdict.scenario or own,
    )


def seen(analysis: Analysis, verdict: Verdict) -> Analysis:
    """The analysis with the findings that are left beside a reference, as pictures show it."""
    found = tuple(event for event in verdict.failing if not event.evidence.excused)
    return replace(analysis, status=verdict.status, findings=found, spans=found)


def _events(
    findings: Sequence[Finding], labels: Labels | None, comparison: Comparison
) -> tuple[Finding, ...]:
    """Findings in order of time, each with its evidence."""
    left, found = list(findings), []
    for each in comparison.exceedances:
        stop, absorbed = each.stop, []
        for event in sorted(left, key=lambda event: event.start):
            if event.start <= stop + GAP and event.stop >= each.start:
                absorbed.append(event)
                stop = max(stop, min(event.stop, stop + GAP))
        left = [event for event in left if event not in absorbed]
        # The general model sets onsets by single samples, levels by frames.
        near = [event.start for event in absorbed if abs(event.start - each.start) <= 4 * HOP]
        start = min(near, default=each.start)
        named = _named(labels, each, absorbed)
        if (named.start, named.stop) != (start, stop):  # it was localised for another stretch
            named = replace(named, start=start, stop=stop, localisation=None, order=None)
        found.append(replace(named, evidence=each.evidence))
    references = "other motions of this robot"
    if comparison.scenarios:
        references = f"{comparison.repetitions} of {' and '.join(comparison.scenarios)}"
    for event in left:
        excused = f"as loud as {references}" if comparison.covered(event) else ""
        found.append(replace(event, evidence=replace(GENERAL, excused=excused)))
    return tuple(sorted(found, key=lambda event: (event.start, event.stop)))


def _named(labels: Labels | None, each: Exceedance, absorbed: Sequence[Finding]) -> Finding:
    """What the general model has for a stretch: its class, score and novelty."""
    if named := [event for event in absorbed if event.label != UNKNOWN]:
        shared = [min(event.stop, each.stop) - max(event.start, each.start) for event in named]
        return named[shared.index(max(shared))]
    if labels is None:
        return Finding(LOUDER, each.start, each.stop, 0.0)
    inside = (labels.start < each.stop) & (labels.stop > each.start)
    words = Counter(str(word) for word in labels.label[inside] if word not in ("ok", UNKNOWN))
    scores = labels.scores[inside]
    if words and len(scores):
        (label, _), *_ = words.most_common(1)
        score = float(scores[:, labels.classes.index(label)].max())
        return Finding(label, each.start, each.stop, score)
    failing = scores[:, 1:].max() if scores.size and scores.shape[1] > 1 else 0.0
    return Finding(LOUDER, each.start, each.stop, float(failing), bool(absorbed))


def _failures(comparison: Comparison, reference: Reference) -> Iterable[tuple[str, str]]:
    """What of its scenario a run lacks: its end, or its motion; and why, in a few words."""
    run = comparison.run
    own = reference.named(run.apart) or reference.named(run.name)
    known = [reference.named(name) for name in comparison.scenarios] or [own]
    scenarios = [each for each in known if each is not None and robot_fits(run, each)]
    if not scenarios:
        if own is not None:
            yield f"robot of {own.name}", "the run has its name, and other joints or another robot"
        return
    shortest = min(each.duration[0] for each in scenarios)
    names = " and ".join(each.name for each in scenarios)
    if run.duration < shortest - max(LONGER, SHARE_LONGER * shortest):
        yield END, f"{run.duration:.1f} of {shortest:.1f} s"
    still = frozen(run, [each for one in scenarios for each in one.repetitions])
    if still is not None:
        yield f"motion from {still:.2f} s on", f"the accepted runs of {names} move"
    elif not comparison.scenarios and len(run.guide):
        yield f"motion of {names}", "the run has its name and makes another motion"


def frozen(run: Levels, references: Sequence[Levels]) -> float | None:
    """From when on a run stands still while its references move, in [s]; None if it does not."""
    count = min(len(each.pace) for each in (run, *references))
    usual, moving = [], []
    for each in references:
        own = float(np.sqrt(np.mean(np.square(each.pace)))) if len(each.pace) else 0.0
        slow = run.pace[:count] < STOPPED * each.pace[:count]
        moving.append(slow & (each.pace[:count] > MOVES * own) & (own > 1e-3))
        usual.append(own)
    still = np.flatnonzero(np.all(moving, axis=0))
    # A delay or a pause is none: the rest of the run must stand still, too.
    if len(still) * HOP < STILL_FOR:
        return None
    rest = run.pace[still[0] :]
    return float(run.time[still[0]]) if rest.max(initial=0.0) < STOPPED * np.median(usual) else None


def judge(
    verdict: Verdict, reference: Reference | None = None, *, gate: Gate | None = None, today: date
) -> Verdict:
    """Apply what a reference wants and waives on a day, and a gate, to what was found in a run."""
    if verdict.status in UNREAD:
        return verdict
    missing: list[Missing] = []
    scenarios: list[Scenario] = []
    if reference is not None and verdict.beside is not None:
        missing += [Missing(what, reason=why) for what, why in verdict.beside.failures]
        scenarios += filter(None, map(reference.named, verdict.beside.scenarios))
    events = []
    for event in verdict.events:
        ruling, reason = _ruled(event, verdict.begin, scenarios, today)
        if gate is not None and ruling in FAILING and (filtered := gate.reason(event)):
            ruling, reason = Ruling.FILTERED, filtered
        events.append(replace(event, ruling=ruling, reason=reason))
    for scenario in scenarios:
        for each in scenario.wanted:
            if each.required and not any(each.covers(e, verdict.begin) for e in verdict.events):
                when = (round(verdict.begin + at, 6) for at in (each.start, each.stop))
                start, stop = (at if isfinite(at) else None for at in when)
                missing.append(Missing(each.label or "a finding", start, stop, each.reason))
    store = "" if reference is None else str(reference.path)
    judged = replace(verdict, events=tuple(events), missing=tuple(missing), expectations=store)
    if judged.failing or judged.missing:
        message = re.sub(NOTHING, "", verdict.message)
        return replace(judged, status=Status.FINDINGS, message=message)
    if verdict.status is Status.FINDINGS:
        return replace(judged, status=Status.OK)
    return judged


def _ruled(
    event: Finding, begin: float, scenarios: Sequence[Scenario], today: date
) -> tuple[Ruling, str]:
    """What becomes of a finding by what the first scenario that is about it waives or wants."""
    if event.evidence.excused:
        return Ruling.AS_REFERENCE, event.evidence.excused
    joint, level = event.evidence.joint, event.evidence.level_db
    for scenario in scenarios:
        for each in reversed(scenario.waive):
            if each.covers(event, begin) and each.until is not None:
                if today <= each.until:
                    return Ruling.WAIVED, each.reason
                return Ruling.EXPIRED, f"{each.until}, {each.reason}"
        for each in reversed(scenario.wanted):
            if each.covers(event, begin) and (not each.joints or joint in each.joints):
                most = each.loudest_db
                if most is None or level is None or level <= most:
                    return Ruling.ALLOWED, each.reason or "it is wanted"
                return Ruling.FOUND, f"wanted, up to {most:.1f} dB, and has {level:.1f} dB"
    return Ruling.FOUND, ""
