"""Measures of a model on recordings: its findings as they are reported, and its frames.

All figures of the protocol are of one operating point: the findings as they are reported. Nothing
is chosen on the runs that are measured. `matching` defines the terms; `docs/metrics.md` has all
measures, each with its source. A measure of a model is the unweighted mean over robots, so that
neither the robot with most runs nor that with most time decides. Medians of delays are averaged
likewise.

Runs are ranked as task 2 of the DCASE challenge does: by AUC, and by partial AUC up to a false
positive rate of 0.1, standardised as McClish does (Analyzing a portion of the ROC curve, Medical
Decision Making 9, 1989); the harmonic mean of both over all domains is its official score (Dohi et
al., DCASE 2022).

A frame's *confidence* is the probability of the class that the model predicts. The expected
calibration error is the mean distance of confidence and share of right predictions in ten bins of
confidence, weighted by the bin's frames (Naeini et al., 2015). It is defined for probabilities
alone, not for votes and margins.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from noiseclassifier.confusion import Evaluation, ratio
from noiseclassifier.evaluation.intervals import Estimate, Resampling
from noiseclassifier.evaluation.matching import (
    FALSE,
    OK,
    UNCLEAR,
    UNLABELLED,
    Origin,
    Outcome,
    Predictions,
    Unanswered,
    are_probabilities,
)
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
BY_CHANCE = tuple(name for name, (part, _) in SHARES.items() if part in MATCHES)
DELAYS = {"delay": 0.5, "late_delay": 0.9}
"""Quantiles of the delays, by name."""
KEYS: dict[str, Callable[[Origin], str]] = {
    "robot": lambda origin: origin.robot,
    "domain": lambda origin: origin.domain,
    "scenario": lambda origin: origin.scenario,
}
"""What runs can be grouped by."""
WORST = 5
"""How many of the worst are listed."""
MOST = 0.1
"""False positive rate up to which the partial AUC counts."""
BINS = 10
"""Bins of confidence."""


# --- frames of annotated blocks


@dataclass(frozen=True, eq=False)
class FrameScore:
    """How a model does by frames that are cut from annotated blocks.

    Attributes:
        evaluation: All frames together.
        recall: Of each class.
        precision: Of each class.
        balanced_accuracy: Mean recall of the classes that occur.
        failure_recall: Failure frames that are not predicted as `ok`, of the failure frames.
        false_alarm_rate: `ok` frames that are not predicted as `ok`, of the `ok` frames.
        false_negative_errors: Of each class, as the paper counts them, of ALL frames.
        false_positive_errors: Of each class, as the paper counts them, of ALL frames.
        failure_detection_rate: The paper's: 1 less the false positive errors of `ok`.
        subset_accuracy: Frames with the right prediction, of all frames.
    """

    evaluation: Evaluation
    recall: dict[str, Estimate]
    precision: dict[str, Estimate]
    balanced_accuracy: Estimate
    failure_recall: Estimate
    false_alarm_rate: Estimate
    false_negative_errors: dict[str, Estimate]
    false_positive_errors: dict[str, Estimate]
    failure_detection_rate: Estimate
    subset_accuracy: Estimate

    @classmethod
    def of(cls, predictions: Sequence[Predictions], resampling: Resampling) -> "FrameScore":
        """Measures of the frames of recordings, one frame or more."""
        evaluation = Evaluation.of(
            np.concatenate([one.truth for one in predictions]),
            np.concatenate([one.predicted for one in predictions]),
            predictions[0].labels.classes,
        )
        names = evaluation.classes
        counts = np.zeros((len(predictions), len(names), len(names)))
        for number, one in enumerate(predictions):
            if len(one.truth):
                counts[number] = Evaluation.of(one.truth, one.predicted, names).confusion
        truth, predicted = np.indices((len(names), len(names)))
        right, all_frames = truth == predicted, np.ones(truth.shape, dtype=bool)
        ok, predicted_ok = truth == names.index(OK), predicted == names.index(OK)

        def share(part: Mask, whole: Mask) -> Estimate:
            return resampling.share(counts[:, part].sum(axis=1), counts[:, whole].sum(axis=1))

        def each(of: Index, part: Mask, whole: Mask | None = None) -> dict[str, Estimate]:
            return {
                name: share(part & (of == number), of == number if whole is None else whole)
                for number, name in enumerate(names)
            }

        hits, frames = np.diagonal(counts, axis1=1, axis2=2), counts.sum(axis=2)
        there = np.flatnonzero(frames.sum(axis=0))
        # A set without a frame of some class gives no recall of it.
        drawn = ratio(resampling.weights @ hits, resampling.weights @ frames)[:, there]
        return cls(
            evaluation,
            recall=each(truth, right),
            precision=each(predicted, right),
            balanced_accuracy=resampling.bounded(
                evaluation.balanced_accuracy,
                drawn.mean(axis=1),
                [frames[:, number] > 0 for number in there],
            ),
            failure_recall=share(~ok & ~predicted_ok, ~ok),
            false_alarm_rate=share(ok & ~predicted_ok, ok),
            false_negative_errors=each(truth, ~right, all_frames),
            false_positive_errors=each(predicted, ~right, all_frames),
            failure_detection_rate=share(~(predicted_ok & ~right), all_frames),
            subset_accuracy=share(right, all_frames),
        )

    def as_dict(self) -> dict[str, Any]:
        """Give all measures as JSON can hold them."""
        found: dict[str, Any] = {"frames": self.evaluation.frames}
        for name, value in vars(self).items():
            if isinstance(value, Estimate):
                found[name] = value.as_dict()
            elif isinstance(value, dict):
                found[name] = {label: each.as_dict() for label, each in value.items()}
        return found


# --- calibration


@dataclass(frozen=True, eq=False)
class Reliability:
    """Sums over the frames of each recording and bin of confidence.

    Attributes:
        frames: How many, shape (runs, bins).
        confidence: Sum of their confidences, shape (runs, bins).
        right: How many predictions are right, shape (runs, bins).
    """

    frames: Array
    confidence: Array
    right: Array

    @classmethod
    def of(cls, predictions: Sequence[Predictions]) -> "Reliability | None":
        """Sums over all frames with a true class; None if the scores are no probabilities."""
        if not all(are_probabilities(one.labels.scores) for one in predictions):
            return None
        sums = np.zeros((3, len(predictions), BINS))
        for number, one in enumerate(predictions):
            labels = one.labels
            column = {name: place for place, name in enumerate(labels.classes)}
            # A label that is no class, say "unknown", has no probability: it does not count.
            place = np.array([column.get(str(name), -1) for name in labels.debounced], np.intp)
            kept = np.flatnonzero((one.whole_truth != UNCLEAR) & (place >= 0))
            confidence = labels.scores[kept, place[kept]]
            cell = np.minimum((confidence * BINS).astype(np.intp), BINS - 1)
            right = labels.debounced[kept] == one.whole_truth[kept]
            for total, weights in zip(sums[:, number], (None, confidence, right), strict=True):
                total += np.bincount(cell, weights, minlength=BINS)
        return cls(*sums)

    def table(self) -> dict[str, Array]:
        """Table of the bins, over all recordings.

        Returns:
            By name: ``low`` and ``high`` edge, ``frames``, mean ``confidence`` and share
            ``right``, each of shape (bins,), NaN in empty bins.
        """
        edges, count = np.linspace(0.0, 1.0, BINS + 1), self.frames.sum(axis=0)
        return {
            "low": edges[:-1],
            "high": edges[1:],
            "frames": count,
            "confidence": ratio(self.confidence.sum(axis=0), count),
            "right": ratio(self.right.sum(axis=0), count),
        }

    def error(self, resampling: Resampling) -> Estimate:
        """Estimate the expected calibration error."""

        def of_sets(weights: Array) -> Array:
            # sum_b n_b / n |right_b / n_b - confidence_b / n_b|
            apart = np.abs(weights @ (self.right - self.confidence)).sum(axis=1)
            return ratio(apart, (weights @ self.frames).sum(axis=1))

        value = float(of_sets(np.ones((1, len(self.frames))))[0])
        return resampling.plain(value, of_sets(resampling.weights), self.frames.sum(axis=1) > 0)


# --- the protocol


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
            "measures": _plain(self.measures),
            "by_chance": _plain(self.by_chance),
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

    @classmethod
    def of(
        cls,
        predictions: Sequence[Predictions],
        resampling: Resampling,
        unanswered: Sequence[Unanswered] = (),
    ) -> "Protocol":
        """Measures of findings as they are reported, on one run with a verdict or more."""
        outcomes = tuple(map(Outcome.of, predictions))
        counts = {name: np.array([o.counts[name] for o in outcomes]) for name in outcomes[0].counts}
        counts["half_of_both"] = (counts["findings"] + counts["faults"]) / 2.0
        origins = [outcome.run.origin for outcome in outcomes]

        def parts(*keys: str) -> dict[Any, Part]:
            def key(origin: Origin) -> Any:
                names = tuple(KEYS[name](origin) for name in keys)
                return names if len(names) > 1 else names[0]

            mine, others = [key(each) for each in origins], [key(u.origin) for u in unanswered]
            return {
                name: _part(
                    outcomes, counts, np.array([own == name for own in mine]), others.count(name)
                )
                for name in sorted({*mine, *others})
            }

        by = {key: parts(key) for key in KEYS}
        robots = np.array([origin.robot for origin in origins])
        sets = [robots == robot for robot in np.unique(robots)]
        every = np.ones(len(outcomes), dtype=bool)
        alike, pooled = (_estimates(counts, resampling, chosen) for chosen in (sets, [every]))
        delay, owner = _delays(outcomes, every)
        for name, share in DELAYS.items():
            pooled[name] = resampling.quantile(delay, owner, share)
            value = _mean([each.measures[name] for each in by["robot"].values()])
            alike[name] = Estimate(value, np.nan, np.nan, pooled[name].runs, pooled[name].groups)
        of_robots = by["robot"].values()
        domains = sorted({origin.domain for origin in origins})
        return cls(
            outcomes,
            tuple(unanswered),
            alike,
            pooled,
            {name: _mean([each.by_chance[name] for each in of_robots]) for name in BY_CHANCE},
            _totals(counts, every),
            by,
            parts("robot", "domain"),
            parts("robot", "scenario"),
            {
                name: _ranked([o for o in outcomes if o.run.origin.domain == name])
                for name in domains
            },
        )

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
            {"run": one.run.name, "label": e.label, "start": e.start, "stop": e.stop}
            for one in self.outcomes
            for e, own in zip(one.run.findings, one.kind, strict=True)
            if own == kind
        ]

    def as_dict(self) -> dict[str, Any]:
        """All measures for JSON, None where undefined."""

        def pairs(parts: dict[tuple[str, str], Part], second: str) -> list[dict[str, Any]]:
            return [{"robot": a, second: b, **part.as_dict()} for (a, b), part in parts.items()]

        ranking = {"auc": self.auc, "pauc": self.pauc, "official_score": self.official}
        return {
            "robots_alike": {name: each.as_dict() for name, each in self.alike.items()},
            "pooled": {name: each.as_dict() for name, each in self.pooled.items()},
            "by_chance": _plain(self.by_chance),
            "counts": self.counts,
            "not_answered": self.not_answered,
            **_plain(ranking),
            "ranking_by_domain": {name: _plain(vars(each)) for name, each in self.ranked.items()},
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


def auc(good: Array, faulty: Array, *, most: float | None = None) -> float:
    """Area under the ROC curve; NaN unless there are good and faulty runs.

    Args:
        good: Scores of good runs, shape (good,).
        faulty: Scores of faulty runs, shape (faulty,).
        most: False positive rate up to which it counts, standardised as McClish does: 0.5 for
            scores without information, 1 for perfect ones.
    """
    if not (len(good) and len(faulty)):
        return float("nan")
    from sklearn.metrics import roc_auc_score

    truth = np.repeat((0, 1), (len(good), len(faulty)))
    return float(roc_auc_score(truth, np.concatenate((good, faulty)), max_fpr=most))


def harmonic_mean(values: Sequence[float]) -> float:
    """Harmonic mean of the values that are defined; NaN without one."""
    known = np.array([value for value in values if not np.isnan(value)])
    if not len(known):
        return float("nan")
    return float(len(known) / (1.0 / known).sum()) if known.all() else 0.0


def _plain(values: Mapping[str, Any]) -> dict[str, float | None]:
    """Numbers for JSON, None where undefined."""
    return {name: None if np.isnan(value) else value for name, value in values.items()}


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
    for name, share in DELAYS.items():
        known = len(delay) > 0
        value = np.quantile(delay, share, method="inverted_cdf") if known else np.nan
        measures[name] = float(value)
    by_chance = {}
    for name in BY_CHANCE:
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
    number = np.repeat(np.arange(len(outcomes)), [len(each.delay) for each in outcomes])
    delay = np.concatenate([each.delay for each in outcomes])
    kept = ~np.isnan(delay) & own[number]
    return delay[kept], number[kept]


def _ranked(outcomes: Sequence[Outcome]) -> Ranked:
    scored = [each for each in outcomes if not np.isnan(each.score)]
    good = np.array([each.score for each in scored if not each.faults])
    faulty = np.array([each.score for each in scored if each.faults])
    return Ranked(auc(good, faulty), auc(good, faulty, most=MOST), len(good), len(faulty))


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if not np.isnan(value)]
    return float(np.mean(known)) if known else float("nan")
