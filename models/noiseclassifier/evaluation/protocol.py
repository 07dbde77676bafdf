"""The protocol: what a model is worth at the operating point that ships, robots weighed alike.

All figures are of one operating point: the findings as they are reported. Nothing is chosen on the
runs that are measured. `outcomes` defines the terms; `docs/evaluation.md` has all of them, each
with its source. A measure of a model is the unweighted mean over robots, so that neither the robot
with most runs nor that with most time decides. Medians of delays are averaged likewise.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from noiseclassifier.evaluation.eventmeasures import LATE, quantile_of
from noiseclassifier.evaluation.intervals import Estimate, Resampling, ratio
from noiseclassifier.evaluation.outcomes import FALSE, UNLABELLED, Outcome
from noiseclassifier.evaluation.predictions import Origin, Predictions, Unanswered
from noiseclassifier.evaluation.ranking import auc, harmonic_mean, partial_auc
from noiseclassifier.types import Array, Index, Mask

RATES = {
    "false_alarms_per_hour": ("false_alarms", "ok_hours"),
    "unknown_false_alarms_per_hour": ("unknown_false_alarms", "ok_hours"),
    "alarms_in_unlabelled_per_hour": ("alarms_in_unlabelled", "unlabelled_hours"),
}
"""Rates: what is counted, and the time of it in [h]."""
SHARES = {
    "ok_flagged": ("ok_hours_flagged", "ok_hours"),
    "recall_injected": ("found", "faults"),
    "recall_felt": ("found_felt", "felt"),
    "class_precision": ("matched_by_class", "findings"),
    "class_recall": ("matched_by_class", "faults"),
    "class_f1": ("matched_by_class", "half_of_both"),
    "any_precision": ("matched", "findings"),
    "any_recall": ("matched", "faults"),
    "any_f1": ("matched", "half_of_both"),
    "onset_within": ("onset_close", "found"),
}
"""Shares: of what is counted, and of what."""
MATCHES = frozenset(("found", "found_felt", "onset_close", "matched_by_class", "matched"))
"""Counts that there are by chance, too."""
KEYS: dict[str, Callable[[Origin], str]] = {
    "robot": lambda origin: origin.robot,
    "domain": lambda origin: origin.domain,
    "scenario": lambda origin: origin.scenario,
}
"""What runs can be grouped by."""
WORST = 5
"""How many of the worst are listed."""


@dataclass(frozen=True, eq=False)
class Part:
    """Counts and measures of some of the runs.

    Attributes:
        counts: Numbers and times in [h], by name.
        measures: Shares, rates per hour, and delays in [s], by name; NaN where undefined.
        by_chance: Shares of findings that are shifted at random, by name.
        unanswered: Runs without a verdict.
    """

    counts: dict[str, float]
    measures: dict[str, float]
    by_chance: dict[str, float]
    unanswered: int

    def as_dict(self) -> dict[str, Any]:
        """All of it for JSON, None where undefined."""
        return {
            "unanswered": self.unanswered,
            "counts": self.counts,
            "measures": plain(self.measures),
            "by_chance": plain(self.by_chance),
        }


@dataclass(frozen=True)
class Ranked:
    """AUC and pAUC of the runs of a domain."""

    auc: float
    pauc: float
    good: int
    faulty: int


@dataclass(frozen=True, eq=False)
class Protocol:
    """Measures of a model at the operating point that ships.

    Attributes:
        outcomes: Of each run.
        unanswered: Runs without a verdict.
        alike: Unweighted means over robots.
        pooled: Measures of all runs together.
        by_chance: Unweighted means over robots, of findings that are shifted at random.
        counts: Of all runs together.
        by: Parts of the runs, by robot, domain and scenario.
        cells: Parts of the runs of each robot and domain.
        cases: Parts of the runs of each robot and scenario.
        ranked: Ranking of the runs of each domain.
    """

    outcomes: tuple[Outcome, ...]
    unanswered: tuple[Unanswered, ...]
    alike: dict[str, Estimate]
    pooled: dict[str, Estimate]
    by_chance: dict[str, float]
    counts: dict[str, float]
    by: dict[str, dict[str, Part]]
    cells: dict[tuple[str, str], Part]
    cases: dict[tuple[str, str], Part]
    ranked: dict[str, Ranked]

    @property
    def auc(self) -> float:
        """Harmonic mean of the AUC of all domains."""
        return harmonic_mean([each.auc for each in self.ranked.values()])

    @property
    def pauc(self) -> float:
        """Harmonic mean of the pAUC of all domains."""
        return harmonic_mean([each.pauc for each in self.ranked.values()])

    @property
    def official(self) -> float:
        """Harmonic mean of AUC and pAUC of all domains, the official score of DCASE task 2."""
        ranked = self.ranked.values()
        return harmonic_mean([value for each in ranked for value in (each.auc, each.pauc)])

    @property
    def not_answered(self) -> float:
        """Share of the runs without a verdict."""
        return len(self.unanswered) / (len(self.outcomes) + len(self.unanswered))

    def worst(self, parts: dict[tuple[str, str], Part], measure: str) -> list[tuple[str, str]]:
        """Name the parts of the lowest share, or of the highest rate; of equals, the largest."""

        def order(key: tuple[str, str]) -> tuple[float, float]:
            value, size = parts[key].measures[measure], parts[key].counts
            return (-value if measure in RATES else value, -max(size["faults"], size["ok_hours"]))

        perfect = 0.0 if measure in RATES else 1.0
        values = {key: part.measures[measure] for key, part in parts.items()}
        keys = [key for key, value in values.items() if not np.isnan(value) and value != perfect]
        return sorted(keys, key=order)[:WORST]

    def missed(self) -> list[dict[str, Any]]:
        """List the faults that are not found."""
        return [
            {"run": outcome.run.name, **fault._asdict()}
            for outcome in self.outcomes
            for fault, found in zip(outcome.faults, outcome.found, strict=True)
            if not found
        ]

    def alarms(self, kind: str) -> list[dict[str, Any]]:
        """List findings of a kind: ``false`` or ``unlabelled``."""
        return [
            {
                "run": outcome.run.name,
                "label": event.label,
                "start": event.start,
                "stop": event.stop,
            }
            for outcome in self.outcomes
            for event, own in zip(outcome.run.findings, outcome.kind, strict=True)
            if own == kind
        ]

    def as_dict(self) -> dict[str, Any]:
        """All measures for JSON, None where undefined."""

        def pairs(parts: dict[tuple[str, str], Part], second: str) -> list[dict[str, Any]]:
            return [{"robot": a, second: b, **part.as_dict()} for (a, b), part in parts.items()]

        return {
            "robots_alike": {name: each.as_dict() for name, each in self.alike.items()},
            "pooled": {name: each.as_dict() for name, each in self.pooled.items()},
            "by_chance": plain(self.by_chance),
            "counts": self.counts,
            "not_answered": self.not_answered,
            "auc": none(self.auc),
            "pauc": none(self.pauc),
            "official_score": none(self.official),
            "ranking_by_domain": {name: plain(vars(each)) for name, each in self.ranked.items()},
            **{
                f"by_{key}": {name: part.as_dict() for name, part in parts.items()}
                for key, parts in self.by.items()
            },
            "by_robot_and_domain": pairs(self.cells, "domain"),
            "by_robot_and_scenario": pairs(self.cases, "scenario"),
            "missed": self.missed(),
            "false_alarms": self.alarms(FALSE),
            "alarms_in_unlabelled": self.alarms(UNLABELLED),
            "unanswered": [each.as_dict() for each in self.unanswered],
        }


def measure(
    predictions: Sequence[Predictions],
    resampling: Resampling,
    unanswered: Sequence[Unanswered] = (),
) -> Protocol:
    """Measures of findings as they are reported.

    Args:
        predictions: Of the runs that have a verdict, one or more.
        resampling: Sets of them.
        unanswered: Runs without one.
    """
    outcomes = tuple(map(Outcome.of, predictions))
    counts = {
        name: np.array([outcome.counts[name] for outcome in outcomes])
        for name in outcomes[0].counts
    }
    counts["half_of_both"] = (counts["findings"] + counts["faults"]) / 2.0
    origins = [outcome.run.origin for outcome in outcomes]

    def part(own: Mask, others: Sequence[Unanswered]) -> Part:
        return _part(outcomes, counts, own, len(others))

    def parts(*keys: str) -> dict[tuple[str, ...], Part]:
        def key(origin: Origin) -> tuple[str, ...]:
            return tuple(KEYS[name](origin) for name in keys)

        mine, others = [key(each) for each in origins], [key(each.origin) for each in unanswered]
        return {
            name: part(
                np.array([each == name for each in mine]),
                [each for each, own in zip(unanswered, others, strict=True) if own == name],
            )
            for name in sorted({*mine, *others})
        }

    by = {key: {name[0]: each for name, each in parts(key).items()} for key in KEYS}
    robots = np.array([origin.robot for origin in origins])
    sets = [robots == robot for robot in np.unique(robots)]
    every = np.ones(len(outcomes), dtype=bool)
    alike, pooled = (_estimates(counts, resampling, chosen) for chosen in (sets, [every]))
    delay, owner = _delays(outcomes, every)
    of_robots = by["robot"].values()
    for name, share in (("delay", 0.5), ("late_delay", LATE)):
        pooled[name] = quantile_of(delay, owner, share, resampling)
        value = _mean([each.measures[name] for each in of_robots])
        alike[name] = Estimate(value, np.nan, np.nan, pooled[name].runs, pooled[name].groups)
    domains = np.array([origin.domain for origin in origins])
    chance = {name: _mean([each.by_chance[name] for each in of_robots]) for name in _chance()}
    return Protocol(
        outcomes,
        tuple(unanswered),
        alike,
        pooled,
        chance,
        _totals(counts, every),
        by,
        parts("robot", "domain"),  # type: ignore[arg-type]
        parts("robot", "scenario"),  # type: ignore[arg-type]
        {
            str(domain): _ranked([each for each, own in zip(outcomes, mine, strict=True) if own])
            for domain, mine in ((domain, domains == domain) for domain in np.unique(domains))
        },
    )


def plain(values: dict[str, Any]) -> dict[str, float | None]:
    """Numbers for JSON, None where undefined."""
    return {name: none(value) for name, value in values.items()}


def none(value: float) -> float | None:
    """A number for JSON, None where undefined."""
    return None if np.isnan(value) else value


def _chance() -> list[str]:
    return [name for name, (part, _) in SHARES.items() if part in MATCHES]


def _totals(counts: dict[str, Array], own: Mask) -> dict[str, float]:
    return {name: float(each[own].sum()) for name, each in counts.items() if name != "half_of_both"}


def _part(
    outcomes: Sequence[Outcome], counts: dict[str, Array], own: Mask, unanswered: int
) -> Part:
    total = {name: each[own].sum() for name, each in counts.items()}
    measures = {
        name: float(ratio(total[part], total[whole]))
        for name, (part, whole) in {**RATES, **SHARES}.items()
    }
    delay, _ = _delays(outcomes, own)
    for name, share in (("delay", 0.5), ("late_delay", LATE)):
        measures[name] = (
            float(np.quantile(delay, share, method="inverted_cdf")) if len(delay) else np.nan
        )
    by_chance = {}
    for name in _chance():
        part, whole = SHARES[name]
        whole = f"{whole}_by_chance" if whole in MATCHES else whole
        by_chance[name] = float(ratio(total[f"{part}_by_chance"], total[whole]))
    return Part(_totals(counts, own), measures, by_chance, unanswered)


def _estimates(
    counts: dict[str, Array], resampling: Resampling, sets: Sequence[Mask]
) -> dict[str, Estimate]:
    """Means of the measures of sets of runs, weighed alike."""
    found = {
        name: resampling.mean_rate(counts[part], counts[whole], sets)
        for name, (part, whole) in RATES.items()
    }
    for name, (part, whole) in SHARES.items():
        found[name] = resampling.mean_share(counts[part], counts[whole], sets)
    return found


def _delays(outcomes: Sequence[Outcome], own: Mask) -> tuple[Array, Index]:
    """Delays of the faults that are found, and the number of the run of each."""
    number = np.concatenate(
        [np.full(len(each.delay), place) for place, each in enumerate(outcomes)]
    ).astype(np.intp)
    delay = np.concatenate([each.delay for each in outcomes])
    kept = ~np.isnan(delay) & own[number]
    return delay[kept], number[kept]


def _ranked(outcomes: Sequence[Outcome]) -> Ranked:
    scored = [each for each in outcomes if not np.isnan(each.score)]
    good = np.array([each.score for each in scored if not each.faults])
    faulty = np.array([each.score for each in scored if each.faults])
    return Ranked(auc(good, faulty), partial_auc(good, faulty), len(good), len(faulty))


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if not np.isnan(value)]
    return float(np.mean(known)) if known else float("nan")
