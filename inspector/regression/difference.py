"""Whether each scenario became better or worse, from all of its repetitions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import chain
from math import comb, prod
from pathlib import Path

import numpy as np

from inspector.analysis.status import EXIT, Status
from inspector.analysis.status import worst as worst_code
from inspector.compare.changes import NEW
from inspector.regression.findings import (
    LOUDER,
    ChangedFinding,
    aligned,
    changed_findings,
    lag,
    new_findings,
)
from inspector.regression.levels import Levels, edges
from inspector.regression.measure import Measured, Unreadable
from inspector.regression.pairing import Pairing, Scenario
from inspector.regression.statistic import (
    ALPHA,
    CONFIDENCE,
    PValues,
    Sample,
    Shift,
    attainable,
    p_values,
    shift,
)
from inspector.text import counted
from noisemodel.noise import REFERENCE_POWER, decibel
from noisemodel.types import Array

RANGE_DB = 40.0
"""What is quieter than the loudest joint, octave or link by more than this hardly counts."""
MARGIN_DB = 6.0
"""A change within this is the same: less than twice the amplitude, in [dB]."""
ALL = "all scenarios"
UNTIMED = (
    "Findings of different motions are matched by their class, at any time; `inspector view`"
    " matches those at the same time."
)


class Verdict(StrEnum):
    """What became of a scenario, the worst first."""

    WORSE = "worse"
    INCONCLUSIVE = "inconclusive"
    SAME = "same"
    BETTER = "better"


OVER_ALL, IN_DETAIL = range(2)
"""Families of quantities: over all joints, few; by joint or link, many."""


@dataclass(frozen=True)
class Kind:
    """A kind of quantity.

    Attributes:
        name: What has it.
        unit: Of its changes.
        least: A change below this is none.
        steady: What is added to standard errors: a change that says little of so few runs.
        family: The quantities that it is tested with.
    """

    name: str
    unit: str = "dB"
    least: float = 1.0
    steady: float = 1.0
    family: int = IN_DETAIL


CELL, JOINT, LINK, PEAK = map(Kind, ("joint and band", "joint", "link", "peak"))
BAND, BAND_PEAK, ERROR, ERROR_PEAK = (
    Kind(name, steady=3.0, family=OVER_ALL)
    for name in ("band", "peak of band", "tracking error", "peak of tracking error")
)
FINDINGS = Kind("findings", "per run", least=0.5, steady=0.5, family=OVER_ALL)
FEWEST_SIDE = 1000
"""More repetitions than one of the reference takes to be compared."""
FINDINGS_MARGIN = 1.0
"""A change of their number within this is the same, per run."""
LEAST = {
    kind.name: kind.least
    for kind in (CELL, JOINT, LINK, PEAK, BAND, BAND_PEAK, ERROR, ERROR_PEAK, FINDINGS)
}


@dataclass(frozen=True)
class Change:
    """By how much a quantity changed.

    Attributes:
        kind: "joint and band", "joint", "link", "peak" (loudest 0.2 s of a joint), "band" (all
            joints), "peak of band" (loudest 0.2 s of any joint), the same two of the tracking
            error, or "findings" (per run, by class).
        joint: The joint, empty for none.
        link: The link, empty for none.
        band: Limits of the octave, in [Hz]; None for all.
        label: Class of findings, empty for none.
        unit: "dB" or "per run".
        change: Estimate; positive is louder, or more.
        low: Lower end of the interval, NaN without.
        high: Upper end of the interval, NaN without.
        p_louder: Probability that any quantity rises so clearly though nothing changed.
        p_quieter: The same of a fall.
    """

    kind: str
    joint: str
    link: str
    band: tuple[float, float] | None
    label: str
    unit: str
    change: float
    low: float
    high: float
    p_louder: float
    p_quieter: float

    @property
    def name(self) -> str:
        """What changed, in words."""
        where = self.joint or self.link or self.label
        octave = "" if self.band is None else "{:.0f} to {:.0f} Hz".format(*self.band)
        named = ", ".join(part for part in (where, octave) if part)
        return {
            PEAK.name: f"peak of {named}",
            BAND_PEAK.name: f"peak of {named}",
            ERROR.name: f"tracking error, {named}",
            ERROR_PEAK.name: f"peak of tracking error, {named}",
            FINDINGS.name: f"findings {named}",
        }.get(self.kind, named)


@dataclass(frozen=True, eq=False)
class Compared:
    """What became of a scenario.

    Attributes:
        name: Its name; "all scenarios" for what they have in common.
        verdict: The verdict.
        reason: Why, in a line.
        reference: Runs before the change.
        candidate: Runs after it.
        paired: Whether they are pairs of one seed.
        confidence: Of the intervals; 0 without.
        testable: Whether so many repetitions can show a change at all.
        changes: Of all quantities, the clearest first.
        findings: Findings that are new, louder or resolved.
        remarks: What is not compared and why, a sentence each.
    """

    name: str
    verdict: Verdict
    reason: str
    reference: tuple[Measured, ...]
    candidate: tuple[Measured, ...]
    paired: bool
    confidence: float
    testable: bool
    changes: tuple[Change, ...]
    findings: tuple[ChangedFinding, ...] = ()
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Gate:
    """What fails.

    Attributes:
        new: Whether new or louder findings do, those of runs without a reference too.
        worse: Whether a verdict "worse" does.
        unreadable: Whether files that cannot be read do; they always do if there are no others.
        missing: Whether runs that the candidate lacks do.
    """

    new: bool = False
    worse: bool = True
    unreadable: bool = True
    missing: bool = False


@dataclass(frozen=True)
class Unpaired:
    """A run of a scenario that only one side has.

    Attributes:
        path: Its file.
        side: "reference" or "candidate".
        findings: Those of a run of the candidate, all of them new.
    """

    path: Path
    side: str
    findings: tuple[ChangedFinding, ...] = ()


@dataclass(frozen=True, eq=False)
class Difference:
    """What became of all scenarios.

    Attributes:
        pairing: How runs were paired.
        scenarios: The scenarios, the worst first.
        together: What changed over all scenarios of one robot together; None for a single one.
        unreadable: Files that are no run, and scenarios that cannot be compared.
        margin: A change within this is the same, in [dB].
        gate: What fails.
        picture: A picture of the worst pair, if one was drawn.
        picture_url: Where that will be published; empty if that is not known.
    """

    pairing: Pairing
    scenarios: tuple[Compared, ...]
    together: Compared | None
    unreadable: tuple[Unreadable, ...] = ()
    margin: float = MARGIN_DB
    gate: Gate = Gate()
    picture: Path | None = None
    picture_url: str = ""

    @property
    def rows(self) -> tuple[Compared, ...]:
        """The scenarios, and all of them together."""
        return (*self.scenarios, *([self.together] if self.together else []))

    @property
    def verdict(self) -> Verdict:
        """Of all: worse if one is; better if one is and none worse; the same if all are."""
        verdicts = {row.verdict for row in self.rows}
        for verdict in (Verdict.WORSE, Verdict.BETTER):
            if verdict in verdicts:
                return verdict
        own = {row.verdict for row in self.scenarios}
        return Verdict.SAME if own == {Verdict.SAME} else Verdict.INCONCLUSIVE

    @property
    def new(self) -> tuple[ChangedFinding, ...]:
        """Findings of scenarios that are new or louder."""
        found = chain.from_iterable(row.findings for row in self.scenarios)
        return tuple(each for each in found if each.kind in (NEW, LOUDER))

    @property
    def unpaired(self) -> tuple[Unpaired, ...]:
        """Runs that only one side has, those of the reference first."""
        return (
            *(Unpaired(run.path, "reference") for run in self.pairing.missing),
            *(Unpaired(run.path, "candidate", new_findings(run)) for run in self.pairing.added),
        )

    def status_unpaired(self, run: Unpaired) -> Status:
        """What a run that only one side has is for a test."""
        missing = self.gate.missing and run.side == "reference"
        fails = missing or (self.gate.new and run.findings)
        return Status.FINDINGS if fails else Status.OK

    @property
    def testable(self) -> bool:
        """Whether the repetitions are enough to call anything worse."""
        together = self.together is not None and self.together.testable
        return together or any(row.testable for row in self.scenarios)

    def status(self, row: Compared) -> Status:
        """What a scenario, or all of them together, is for a test."""
        news = any(each.kind in (NEW, LOUDER) for each in row.findings)
        worse = row.verdict is Verdict.WORSE
        if (self.gate.new and news) or (self.gate.worse and worse):
            return Status.FINDINGS
        if self.gate.worse and not row.testable and row.verdict is not Verdict.SAME:
            return Status.CANNOT_TELL
        return Status.OK

    def ignored(self, file: Unreadable) -> bool:
        """Whether a file that cannot be read is left out of the exit status."""
        harmless = file.status is Status.BAD_INPUT and not self.gate.unreadable
        return harmless and bool(self.scenarios)

    @property
    def exit_status(self) -> int:
        """Exit status of `diff`: the worst of 70, 3, 1, 4 and 0.

        Scenarios with too few repetitions are 4 only if all scenarios are such.
        """
        codes = [EXIT[each.status] for each in self.unreadable if not self.ignored(each)]
        own = [*map(self.status, self.rows), *map(self.status_unpaired, self.unpaired)]
        if Status.FINDINGS in own:
            codes.append(EXIT[Status.FINDINGS])
        if self.gate.worse and not self.testable and self.verdict is not Verdict.SAME:
            codes.append(EXIT[Status.CANNOT_TELL])
        return worst_code(codes)


@dataclass(frozen=True)
class _Quantity:
    """What a change is of; the fields are those of ``Change``."""

    kind: Kind
    joint: str = ""
    link: str = ""
    band: tuple[float, float] | None = None
    label: str = ""


@dataclass(frozen=True, eq=False)
class _Prepared:
    """A scenario before the test."""

    scenario: Scenario
    quantities: tuple[_Quantity, ...]
    sample: Sample
    remarks: tuple[str, ...] = ()


def difference(
    pairing: Pairing, *, margin: float = MARGIN_DB, unreadable: Sequence[Unreadable] = ()
) -> Difference:
    """Compare all scenarios at once, with one probability of a false alarm for all.

    Args:
        pairing: The runs.
        margin: A change within this is the same, in [dB].
        unreadable: Files that could not be read, to be listed.

    Returns:
        The verdicts.
    """
    prepared: list[_Prepared] = []
    failed = list(unreadable)
    for scenario in pairing.scenarios:
        if problem := _incomparable(scenario):
            failed.append(problem)
        else:
            prepared.append(_prepared(scenario))
    if not prepared:
        return Difference(pairing, (), None, tuple(failed), margin)
    prepared, common = _with_shared(prepared)
    found, over_all = p_values([each.sample for each in prepared])
    compared = [_compared(each, p, margin=margin) for each, p in zip(prepared, found, strict=True)]
    together = None
    if common:
        together = _together(prepared, common, over_all)
    ranks = list(Verdict)
    compared.sort(key=lambda row: (ranks.index(row.verdict), -_news(row), row.name))
    return Difference(pairing, tuple(compared), together, tuple(failed), margin)


def worst(found: Difference) -> Compared:
    """The scenario to look at first."""

    def clearest(row: Compared) -> float:
        return min((change.p_louder for change in row.changes), default=1.0)

    ranks = list(Verdict)
    return min(
        found.scenarios,
        key=lambda row: (ranks.index(row.verdict), clearest(row), -_news(row)),
    )


def worst_runs(row: Compared) -> tuple[Measured, Measured]:
    """A run of the reference and one of the candidate that show what changed.

    Of the candidate, that with most new findings, or where the clearest change is largest; of the
    reference, its twin of one seed, or else that whose motion is most alike.
    """
    top = next(iter(row.changes), None)
    counts = [
        sum(each.path == run.path and each.kind in (NEW, LOUDER) for each in row.findings)
        for run in row.candidate
    ]
    loudness = [_loudness(run, top) for run in row.candidate]
    place = max(range(len(counts)), key=lambda index: (counts[index], loudness[index]))
    after = row.candidate[place]
    if row.paired:
        return row.reference[place], after
    likeness = [aligned(before, after).correlation for before in row.reference]
    return row.reference[int(np.argmax(likeness))], after


def _loudness(run: Measured, change: Change | None) -> float:
    """Mean power of the joint or octave that a change is of."""
    power = run.levels.power
    if change is not None and change.joint in run.levels.joints:
        power = power[:, [run.levels.joints.index(change.joint)]]
    if change is not None and change.band is not None:
        power = power[..., [edges(centre) == change.band for centre in run.levels.bands]]
    return float(power.sum())


def _news(row: Compared) -> int:
    return sum(each.kind in (NEW, LOUDER) for each in row.findings)


def _incomparable(scenario: Scenario) -> Unreadable | None:
    """Why two sides cannot be compared; None if they can."""
    first = scenario.reference[0]
    for run in (*scenario.reference, *scenario.candidate):
        if run.robot and first.robot and Path(run.robot).name != Path(first.robot).name:
            problem = f"is of {run.robot}, {first.path} is of {first.robot}"
        elif not set(run.levels.joints) & set(first.levels.joints):
            problem = f"has none of the joints of {first.path}"
        elif not len(run.levels.time):
            problem = "has no stretch of 0.2 s without a gap"
        elif not run.levels.bands:
            problem = f"has {run.rate:g} Hz; levels from 11 Hz on require 46 Hz"
        else:
            continue
        return Unreadable(run.path, f"{problem}: scenario {scenario.name} is not compared")
    return None


def _prepared(scenario: Scenario) -> _Prepared:
    """Take the quantities of a scenario from its runs."""
    runs = (*scenario.reference, *scenario.candidate)
    remarks = list(_remarks(scenario))
    spans = _shared_spans(scenario)
    joints = [j for j in runs[0].levels.joints if all(j in run.levels.joints for run in runs)]
    bands = [b for b in runs[0].levels.bands if all(b in run.levels.bands for run in runs)]
    power = [_of(run.levels, span, joints, bands) for run, span in zip(runs, spans, strict=True)]
    mean = np.array([each.mean(axis=0) for each in power])  # runs, joints, bands
    peak = np.array([each.sum(axis=2).max(axis=0) for each in power])  # runs, joints
    loudest = np.array([each.max(axis=(0, 1)) for each in power])  # runs, bands
    octaves = list(map(edges, bands))
    quantities = [_Quantity(CELL, joint=j, band=b) for j in joints for b in octaves]
    columns = [_levels(mean.reshape(len(runs), -1))]
    quantities += [_Quantity(JOINT, joint=j) for j in joints]
    quantities += [_Quantity(BAND, band=b) for b in octaves]
    quantities += [_Quantity(PEAK, joint=j) for j in joints]
    columns += [_levels(mean.sum(axis=2)), _levels(mean.sum(axis=1)), _levels(peak)]
    quantities += [_Quantity(BAND_PEAK, band=b) for b in octaves]
    columns.append(_levels(loudest))
    errors = [run.errors for run in runs]
    if all(each is not None for each in errors):
        known = [each for each in errors if each is not None]
        power = [_of(own, span, joints, bands) for own, span in zip(known, spans, strict=True)]
        quantities += [_Quantity(kind, band=b) for kind in (ERROR, ERROR_PEAK) for b in octaves]
        columns.append(_levels(np.array([each.mean(axis=0).sum(axis=0) for each in power])))
        columns.append(_levels(np.array([each.max(axis=(0, 1)) for each in power])))
    links = [run.links for run in runs]
    if all(each is not None for each in links):
        known = [each for each in links if each is not None]
        names = [n for n in known[0].joints if all(n in each.joints for each in known)]
        vibration = np.array(
            [
                _of(own, s, names, [0.0])[..., 0].mean(axis=0)
                for own, s in zip(known, spans, strict=True)
            ]
        )
        quantities += [_Quantity(LINK, link=name) for name in names]
        columns.append(_levels(vibration / REFERENCE_POWER))
    if _findings_comparable(runs):
        labels = sorted({f.event.label for run in runs for f in run.findings})
        counts = [[sum(f.event.label == n for f in r.findings) for n in labels] for r in runs]
        quantities += [_Quantity(FINDINGS, label=label) for label in labels]
        columns.append(np.array(counts, dtype=np.float64).reshape(len(runs), len(labels)))
    values = np.hstack(columns)
    split = len(scenario.reference)
    scale = np.array([quantity.kind.steady for quantity in quantities])
    family = tuple(quantity.kind.family for quantity in quantities)
    sample = Sample(values[:split], values[split:], scale, family, paired=scenario.paired)
    return _Prepared(scenario, tuple(quantities), sample, tuple(remarks))


def _of(own: Levels, span: tuple[float, float], names: list[str], bands: list[float]) -> Array:
    """Powers within a span, of some joints and bands."""
    inside = (own.time >= span[0]) & (own.time <= span[1])
    inside = inside if inside.any() else np.ones(len(own.time), dtype=bool)
    power = own.power[inside]
    power = power[:, [own.joints.index(name) for name in names]]
    return power[..., [own.bands.index(band) for band in bands]]


def _levels(power: Array) -> Array:
    """Levels of powers of runs, shape (runs, quantities), in [dB].

    What is far below the loudest is raised towards a floor, the same for all runs, on which the
    sides have no influence.
    """
    floor = float(np.median(power.max(axis=1))) * 10 ** (-RANGE_DB / 10)
    return decibel(power + max(floor, float(np.finfo(np.float64).tiny)))


def _shared_spans(scenario: Scenario) -> list[tuple[float, float]]:
    """The stretch of each run that all repetitions cover; whole runs where motions differ."""
    runs = (*scenario.reference, *scenario.candidate)
    begins = [float(run.clock[0]) for run in runs]
    whole = [(-np.inf, np.inf)] * len(runs)
    if scenario.paired:
        spans = [
            _overlap([before, after])
            for before, after in zip(scenario.reference, scenario.candidate, strict=True)
        ]
        if any(span is None for span in spans):
            return whole
        both = [*(s[0] for s in spans if s), *(s[1] for s in spans if s)]
    else:
        found = _overlap(runs)
        if found is None:
            return whole
        both = found
    return [(b + start, b + stop) for b, (start, stop) in zip(begins, both, strict=True)]


def _overlap(runs: Sequence[Measured]) -> list[tuple[float, float]] | None:
    """Start and stop of what all cover, in [s] from the start of each; None if motions differ."""
    lags = [0.0]
    for run in runs[1:]:
        if (later := lag(runs[0], run)) is None:
            return None
        lags.append(later)
    start = max(lags)
    stop = min(later + run.duration for later, run in zip(lags, runs, strict=True))
    shortest = min(run.duration for run in runs)
    if stop - start < shortest / 2:
        return None
    return [(start - later, stop - later) for later in lags]


def _findings_comparable(runs: Sequence[Measured]) -> bool:
    return all(run.model for run in runs) and len({run.signals for run in runs}) == 1


def _remarks(scenario: Scenario) -> "Sequence[str]":
    runs = (*scenario.reference, *scenario.candidate)
    found = []
    rates = sorted({float(f"{run.rate:.4g}") for run in runs})
    if len(rates) > 1:
        found.append(
            f"Rates differ ({rates[0]:g} to {rates[-1]:g} Hz): octaves of all are compared."
        )
    unlabelled = [run for run in runs if not run.model]
    if unlabelled:
        found.append(
            f"Findings are not compared: {unlabelled[0].path} has no labels"
            f" ({unlabelled[0].message})."
        )
    elif not _findings_comparable(runs):
        every = frozenset[str]().union(*(run.signals for run in runs))
        lacking = next(run for run in runs if run.signals != every)
        names = ", ".join(sorted(every - lacking.signals)).replace("_", " ")
        found.append(f"Findings are not compared: {lacking.path} has no {names}, others have.")
    errors = [run.errors is not None for run in runs]
    if any(errors) and not all(errors):
        lacking = runs[errors.index(False)]
        found.append(f"Tracking errors are not compared: {lacking.path} has no desired velocities.")
    counts = [run.links is not None for run in runs]
    if any(counts) and not all(counts):
        lacking = runs[counts.index(False)]
        found.append(f"Links are not compared: {lacking.path} shows none.")
    return found


def _with_shared(prepared: list[_Prepared]) -> tuple[list[_Prepared], tuple[_Quantity, ...]]:
    """Mark what the scenarios have in common, if they are several of one robot."""
    robots = {run.robot for each in prepared for run in each.scenario.reference}
    common: tuple[_Quantity, ...] = ()
    if len(prepared) > 1 and len(robots) == 1:
        others = [set(each.quantities) for each in prepared[1:]]
        common = tuple(q for q in prepared[0].quantities if all(q in other for other in others))
    marked = []
    for each in prepared:
        places = {quantity: place for place, quantity in enumerate(each.quantities)}
        shared = tuple(places[quantity] for quantity in common)
        marked.append(replace(each, sample=replace(each.sample, shared=shared)))
    return marked, common


def _compared(each: _Prepared, p: PValues, *, margin: float) -> Compared:
    scenario, moved = each.scenario, shift(each.sample)
    runs = (*scenario.reference, *scenario.candidate)
    changes = _changes(each.quantities, moved, p)
    findings: tuple[ChangedFinding, ...] = ()
    remarks = each.remarks
    if _findings_comparable(runs):
        findings, untimed = changed_findings(scenario.reference, scenario.candidate)
        remarks += (UNTIMED,) * untimed
    news = sum(finding.kind in (NEW, LOUDER) for finding in findings)
    verdict, reason = _significant(changes)
    if verdict is Verdict.INCONCLUSIVE:
        verdict, reason = _equal(each, changes, moved.confidence, news=news, margin=margin)
    return Compared(
        name=scenario.name,
        verdict=verdict,
        reason=reason,
        reference=scenario.reference,
        candidate=scenario.candidate,
        paired=scenario.paired,
        confidence=moved.confidence,
        testable=attainable(each.sample),
        changes=changes,
        findings=findings,
        remarks=remarks,
    )


def _together(prepared: Sequence[_Prepared], common: Sequence[_Quantity], p: PValues) -> Compared:
    """What the scenarios of one robot have in common: the mean of their changes."""
    means = np.mean(
        [shift(each.sample).change[list(each.sample.shared)] for each in prepared], axis=0
    )
    nothing = np.full_like(means, np.nan)
    changes = _changes(common, Shift(means, nothing, nothing, 0.0), p)
    verdict, reason = _significant(changes)
    return Compared(
        name=ALL,
        verdict=verdict,
        reason=reason,
        reference=tuple(run for each in prepared for run in each.scenario.reference),
        candidate=tuple(run for each in prepared for run in each.scenario.candidate),
        paired=all(each.scenario.paired for each in prepared),
        confidence=0.0,
        testable=prod(each.sample.exchanges for each in prepared) * ALPHA >= 1,
        changes=changes,
    )


def _significant(changes: Sequence[Change]) -> tuple[Verdict, str]:
    """Worse or better, and what shows it; otherwise inconclusive."""
    for verdict, sign in ((Verdict.WORSE, 1), (Verdict.BETTER, -1)):
        found = [
            each
            for each in changes
            if _p(each, sign) <= ALPHA and sign * each.change >= LEAST[each.kind]
        ]
        if found:
            first = min(found, key=lambda each: (_p(each, sign), -sign * each.change))
            return verdict, f"{first.name} {first.change:+.1f} {first.unit}"
    return Verdict.INCONCLUSIVE, "no change is significant"


def _p(change: Change, sign: int) -> float:
    return change.p_louder if sign > 0 else change.p_quieter


def _equal(
    each: _Prepared, changes: Sequence[Change], confidence: float, *, news: int, margin: float
) -> tuple[Verdict, str]:
    """The same or inconclusive, and why."""
    sample = each.sample
    before, after = len(sample.reference), len(sample.candidate)
    twins = sample.paired or before == after == 1
    if not news and twins:
        apart = np.abs(sample.candidate - sample.reference)
        if bool(np.all(apart < [quantity.kind.least for quantity in each.quantities])):
            return Verdict.SAME, "each run is within 1 dB of its twin"

    def excess(change: Change) -> float:
        limit = FINDINGS_MARGIN if change.kind == FINDINGS.name else margin
        return max(change.high, -change.low) / limit

    reasons = [counted(news, "new or louder finding")] if news else []
    if confidence >= CONFIDENCE:
        widest = max(changes, key=excess)
        if not news and excess(widest) < 1:
            return Verdict.SAME, f"no change by {margin:g} dB or more"
        end = max((widest.high, widest.low), key=abs)
        reasons.append(f"{widest.name} {end:+.1f} {widest.unit} cannot be excluded")
    if not attainable(sample):
        needed = next(n for n in range(1, FEWEST_SIDE) if comb(before + n, n) * ALPHA >= 1)
        other = f", or {needed} with {before} of the reference" if needed != before else ""
        reasons.append(
            f"{before} and {after} runs are too few for the verdict worse: it takes 5 runs of the"
            f" candidate with 5 of the reference{other}"
        )
    return Verdict.INCONCLUSIVE, "; ".join(reasons) or "no change is significant"


def _changes(quantities: Sequence[_Quantity], moved: Shift, p: PValues) -> tuple[Change, ...]:
    found = [
        Change(
            kind=quantity.kind.name,
            joint=quantity.joint,
            link=quantity.link,
            band=quantity.band,
            label=quantity.label,
            unit=quantity.kind.unit,
            change=float(moved.change[place]),
            low=float(moved.low[place]),
            high=float(moved.high[place]),
            p_louder=float(p.louder[place]),
            p_quieter=float(p.quieter[place]),
        )
        for place, quantity in enumerate(quantities)
    ]

    def clearness(change: Change) -> tuple[float, float]:
        return min(change.p_louder, change.p_quieter), -abs(change.change) / LEAST[change.kind]

    return tuple(sorted(found, key=clearness))
