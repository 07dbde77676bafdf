"""What becomes of a verdict beside a reference: findings by moment, rulings, and missing runs."""

import hashlib
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
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
from inspector.reference.store import NAME, Reference, find, line_of, scenario_of
from inspector.verdict import END, LOG, Beside, Evidence, Missing, Ruled, Ruling, Verdict
from noiseclassifier import UNKNOWN, Event, Labels

LOUDER = "louder"
"""Class of a finding that only the reference shows."""
STOPPED, MOVES, STILL_FOR = 0.1, 0.3, 0.5
"""A run is frozen where it moves at less than a tenth of its references' speed, for half a second,
while these make three tenths of their usual speed."""


@dataclass(frozen=True)
class References:
    """The reference of each run, to be applied where a run is classified.

    Attributes:
        loaded: References by their path.
        of: Path of the reference of each run that has one.
        measured: Levels of the runs that are measured already.
    """

    loaded: Mapping[Path, Reference] = field(default_factory=dict)
    of: Mapping[Path, Path] = field(default_factory=dict)
    measured: Mapping[Path, Levels] = field(default_factory=dict)

    @classmethod
    def found(
        cls, runs: Iterable[Path], given: Path | None = None, reading: Reading | None = None
    ) -> "References":
        """Load the given reference, or the nearest store of each run."""
        of = {run: given or find(run) for run in runs}
        known = {run: path for run, path in of.items() if path is not None}
        return cls(
            {path: Reference.load(path, reading) for path in dict.fromkeys(known.values())}, known
        )

    def __call__(self, analysis: Analysis, verdict: Verdict) -> tuple[Verdict, Comparison | None]:
        """Add the evidence of the reference to the verdict on a run, and compare them."""
        path = self.of.get(verdict.path)
        if path is None or analysis.audit is None:
            return verdict, None
        reference = self.loaded[path]
        run = self.measured.get(verdict.path)
        if run is None:
            name = scenario_of(analysis.run, verdict.path)
            if reference.named(name) is None:
                name = scenario_of(analysis.run, verdict.path, _root(verdict.path, path))
            run = levels(analysis.run, name=name, file=str(verdict.path))
        comparison = compare(run, reference.scenarios)
        return beside(verdict, comparison, reference, analysis.labels), comparison

    def __str__(self) -> str:
        """What a batch that resumes must find unchanged: the levels of each reference."""
        every = [
            each
            for one in self.loaded.values()
            for scenario in one.scenarios
            for each in scenario.repetitions
        ]
        text = " ".join(f"{each.name} {each.sha256}" for each in every)
        return hashlib.sha256(text.encode()).hexdigest()

    def remarks(self, today: date) -> list[str]:
        """List waivers that have expired, a sentence each."""
        return [
            f"{path / NAME}: a waiver of {scenario.name} expired on {each.until} ({each.reason});"
            " its findings count again"
            for path, reference in self.loaded.items()
            for scenario in reference.scenarios
            for each in scenario.waived
            if each.until is not None and today > each.until
        ]

    def judge(self, verdict: Verdict, gate: "Gate | None", today: date) -> Verdict:
        """Decide what becomes of the findings of a run; see `judge`."""
        path = self.of.get(verdict.path)
        return judge(verdict, None if path is None else self.loaded[path], gate=gate, today=today)

    def absent(self, verdicts: Sequence[Verdict], folders: Iterable[Path]) -> list[Verdict]:
        """Verdicts on stores whose required scenarios have too few logs."""
        found = []
        given = [folder.resolve() for folder in folders]
        for path, reference in self.loaded.items():
            top = path.resolve().parent
            asked = [each for each in given if reference.stored]
            own = [each for each in verdicts if self.of.get(each.path) == path]
            names = Counter(
                name
                for each in own
                for name in (each.beside.scenarios if each.beside else (each.scenario,))
            )
            missing = tuple(
                Missing(
                    f"{LOG}{each.name}",
                    reason=f"{names[each.name]} of {each.at_least} logs"
                    if names[each.name]
                    else f"no log; it had {len(each.repetitions)}",
                    line=line_of(each.name, path),
                )
                for each in reference.scenarios
                if each.required
                and names[each.name] < each.at_least
                and any(_asked(each, folder, top) for folder in asked)
            )
            if missing:
                store = path / NAME
                found.append(
                    Verdict(store, Status.FINDINGS, missing=missing, expectations=str(store))
                )
        return found


def _root(run: Path, store: Path) -> Path | None:
    """The folder below which scenarios are named, such as runs/ beside reference/."""
    full, top = run.resolve(), store.resolve().parent
    if not full.is_relative_to(top):
        return None
    parts = run.parts
    depth = len(full.relative_to(top).parts)
    return Path(*parts[: len(parts) - depth + 1]) if depth > 1 else run.parent


def _asked(scenario: Scenario, folder: Path, top: Path) -> bool:
    """Whether a folder should hold runs of a scenario: all of it, unless it is a part of it."""
    if not folder.is_relative_to(top) or len(folder.relative_to(top).parts) < 2:
        return True
    inside = folder.relative_to(top).parts[1:]
    return all(
        Path(each.run).parts[-len(inside) - 1 : -1] == inside for each in scenario.repetitions
    )


@dataclass(frozen=True)
class Gate:
    """Findings that fail a run.

    Attributes:
        classes: Those of these classes, of all unless given.
        min_score: Those of at least this score, if given; some models have negative ones.
        min_duration: Those that last at least so long, in [s].
    """

    classes: tuple[str, ...] = ()
    min_score: float | None = None
    min_duration: float = 0.0

    def reason(self, event: Event) -> str:
        """Say why a finding does not fail a run; empty if it does."""
        if self.classes and event.label not in self.classes:
            return f"not of {', '.join(self.classes)} (--fail-on-class)"
        if self.min_score is not None and event.score < self.min_score:
            return f"score {event.score:.2f} below {self.min_score:g} (--min-score)"
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
    is excused. Where no reference covers the run, the general model decides. Labels of the frames
    name what no finding does.
    """
    events, evidence = _events(verdict.events, labels, comparison)
    localisations = {
        event: found for event, found in verdict.localisations.items() if event in evidence
    }
    shares = {str(kind): round(comparison.share(kind), 4) for kind in Kind}
    known = Beside(
        path=str(reference.path),
        scenarios=comparison.scenarios,
        repetitions=comparison.repetitions,
        shares=shares,
        margins={str(kind): round(each.db, 2) for kind, each in comparison.margins.items()},
        worst=_known(comparison.worst),
        joints={
            joint: round(float(peak), 2)
            for joint, peak in zip(comparison.joints, comparison.peaks, strict=True)
            if np.isfinite(peak)
        },
        quieter=round(comparison.quieter, 2) if comparison.quieter > _least(comparison) else 0.0,
        speed=_known(comparison.slope),
        failures=tuple(_failures(comparison, reference)),
        words=_words(comparison),
        bounds={str(kind): each.bound for kind, each in comparison.margins.items()},
    )
    covered = shares[Kind.GENERAL] < 1.0
    failing = any(not each.excused for each in evidence.values())
    status = verdict.status
    if failing:
        status = Status.FINDINGS
    elif status is Status.FINDINGS or (status is Status.CANNOT_TELL and covered):
        status = Status.OK
    return replace(
        verdict,
        status=status,
        events=events,
        evidence=evidence,
        beside=known,
        localisations=localisations,
        scenario=verdict.scenario or comparison.run.name,
        orders={event: found for event, found in verdict.orders.items() if event in evidence},
    )


def seen(analysis: Analysis, verdict: Verdict) -> Analysis:
    """The analysis with the findings that are left beside a reference, as pictures show it."""
    left = [event for event in verdict.failing if event in verdict.evidence]
    found = tuple(event for event in left if not verdict.evidence[event].excused)
    return replace(analysis, status=verdict.status, findings=found, spans=found)


def _known(value: float) -> float | None:
    return round(value, 3) if np.isfinite(value) else None


def _least(comparison: Comparison) -> float:
    known = comparison.margins.get(Kind.REPETITIONS)
    return known.db if known else float("inf")


def _words(comparison: Comparison) -> str:
    parts = [str(comparison)]
    if comparison.quieter > _least(comparison):
        parts.append(f"{comparison.quieter:.1f} dB quieter than each repetition")
    slope = comparison.slope
    if np.isfinite(slope) and abs(slope - 1) > 0.02:
        parts.append(f"aligned at {slope:.2f} of its speed")
    if comparison.run.guided_by.startswith("measured"):
        parts.append(f"aligned by {comparison.run.guided_by}: the log has no desired motion")
    return "; ".join(filter(None, [*parts, *comparison.remarks]))


def _events(
    findings: Sequence[Event], labels: Labels | None, comparison: Comparison
) -> tuple[tuple[Event, ...], dict[Event, Evidence]]:
    """Findings in order of time, and the evidence of each."""
    left = list(findings)
    found: list[tuple[Event, Evidence]] = []
    for each in comparison.exceedances:
        start, stop, absorbed = each.start, each.stop, []
        for event in sorted(left, key=lambda event: event.start):
            if event.start <= stop + GAP and event.stop >= start:
                absorbed.append(event)
                stop = max(stop, min(event.stop, stop + GAP))
        left = [event for event in left if event not in absorbed]
        # The general model sets onsets by single samples, levels by frames.
        near = [event.start for event in absorbed if abs(event.start - start) <= 4 * HOP]
        label, score, novel = _named(labels, each, absorbed)
        event = Event(label, min(near, default=start), stop, score, novel)
        evidence = Evidence(
            each.kind.value,
            round(each.db, 2),
            round(each.peak, 4),
            each.joint,
            each.signal,
            each.octave,
            round(each.level, 2),
        )
        found.append((event, evidence))
    for event in left:
        covered = comparison.covered(event.start, event.stop)
        excused = f"as loud as {_references(comparison)}" if covered else ""
        found.append((event, Evidence(Kind.GENERAL.value, excused=excused)))
    found.sort(key=lambda pair: (pair[0].start, pair[0].stop))
    return tuple(event for event, _ in found), dict(found)


def _references(comparison: Comparison) -> str:
    if not comparison.scenarios:
        return "other motions of this robot"
    return f"{comparison.repetitions} of {' and '.join(comparison.scenarios)}"


def _named(
    labels: Labels | None, each: Exceedance, absorbed: Sequence[Event]
) -> tuple[str, float, bool]:
    """Class, score and novelty that the general model has for a stretch."""
    named = [event for event in absorbed if event.label != UNKNOWN]
    if named:
        best = max(
            named, key=lambda event: min(event.stop, each.stop) - max(event.start, each.start)
        )
        return best.label, best.score, best.novel
    if labels is None:
        return LOUDER, 0.0, False
    inside = (labels.start < each.stop) & (labels.stop > each.start)
    words = Counter(str(word) for word in labels.label[inside] if word not in ("ok", UNKNOWN))
    scores = labels.scores[inside]
    if words and len(scores):
        (label, _), *_ = words.most_common(1)
        return label, float(scores[:, labels.classes.index(label)].max()), False
    failing = scores[:, 1:].max() if scores.size and scores.shape[1] > 1 else 0.0
    return LOUDER, float(failing), bool(absorbed)


def _failures(comparison: Comparison, reference: Reference) -> Iterable[tuple[str, str]]:
    """What of its scenario a run lacks: its end, or its motion; and why, in a few words."""
    run = comparison.run
    known = [reference.named(name) for name in comparison.scenarios] or [reference.named(run.name)]
    scenarios = [each for each in known if each is not None and robot_fits(run, each)]
    if not scenarios:
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
    verdict: Verdict,
    reference: Reference | None = None,
    *,
    gate: Gate | None = None,
    today: date,
) -> Verdict:
    """Apply what a reference wants and waives, and a gate, to what was found in a run.

    Args:
        reference: Its reference, if there is one.
        gate: The findings that fail a run, all unless given; missing ones always do.
        today: The day on which waivers are still valid or not.
    """
    if verdict.status in (Status.BAD_INPUT, Status.INTERNAL_ERROR):
        return verdict
    rulings = {
        event: Ruled(Ruling.AS_REFERENCE, each.excused)
        for event, each in verdict.evidence.items()
        if each.excused
    }
    missing: list[Missing] = []
    if reference is not None and verdict.beside is not None:
        missing += [Missing(what, reason=why) for what, why in verdict.beside.failures]
        for name in verdict.beside.scenarios:
            scenario = reference.named(name)
            if scenario is not None:
                rulings |= _expected(verdict, scenario, rulings, today)
                missing += _lacking(verdict, scenario)
    for event in verdict.events:
        known = rulings.get(event, Ruled())
        reason = gate.reason(event) if gate and known.ruling.fails else ""
        if reason:
            rulings[event] = Ruled(Ruling.FILTERED, reason)
    judged = replace(
        verdict,
        rulings={event: ruled for event, ruled in rulings.items() if ruled != Ruled()},
        missing=tuple(missing),
        expectations="" if reference is None else str(reference.path),
    )
    if judged.failing or judged.missing:
        message = re.sub(NOTHING, "", verdict.message)
        return replace(judged, status=Status.FINDINGS, message=message)
    if verdict.status is Status.FINDINGS:
        return replace(judged, status=Status.OK)
    return judged


def _expected(
    verdict: Verdict, scenario: Scenario, rulings: Mapping[Event, Ruled], today: date
) -> dict[Event, Ruled]:
    """Rulings by what a scenario wants and waives."""
    found: dict[Event, Ruled] = {}
    begin = verdict.begin - scenario.repetitions[-1].start
    for event in verdict.events:
        if event in rulings:
            continue
        span = event.label, event.start - begin, event.stop - begin
        evidence = verdict.evidence.get(event, Evidence(Kind.GENERAL.value))
        for each in scenario.wanted:
            if each.covers(*span) and (not each.joints or evidence.joint in each.joints):
                if each.loudest is None or evidence.level is None or evidence.level <= each.loudest:
                    found[event] = Ruled(Ruling.ALLOWED, each.reason or "it is wanted")
                else:
                    why = f"wanted, up to {each.loudest:.1f} dB, and has {evidence.level:.1f} dB"
                    found[event] = Ruled(reason=why)
        for each in scenario.waived:
            if each.covers(*span) and each.until is not None:
                valid = today <= each.until
                ruling = Ruling.WAIVED if valid else Ruling.EXPIRED
                found[event] = Ruled(
                    ruling, each.reason if valid else f"{each.until}, {each.reason}"
                )
    return found


def _lacking(verdict: Verdict, scenario: Scenario) -> list[Missing]:
    """Findings that a scenario requires and the run does not have."""
    begin = verdict.begin - scenario.repetitions[-1].start
    return [
        Missing(each.label or "a finding", each.start, each.stop, each.reason)
        for each in scenario.wanted
        if each.required
        and not any(
            each.covers(event.label, event.start - begin, event.stop - begin)
            for event in verdict.events
        )
    ]
