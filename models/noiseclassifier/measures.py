"""Measures of a model: its frames, its findings as they are reported, and intervals of both.

**Frames.** `Evaluation` has the paper's measures, and recall and precision. A frame's *confidence*
is the probability of the class that the model predicts. The expected calibration error is the mean
distance of confidence and share of right predictions in ten bins of confidence, weighted by the
bin's frames (Naeini et al., 2015). It is defined for probabilities alone, not for votes and
margins.

**Findings.** All figures of the protocol are of one operating point: the findings as they are
reported. Nothing is chosen on the runs that are measured. `matching` defines the terms;
`docs/metrics.md` has all measures, each with its source. A measure of a model is the unweighted
mean over robots, so that neither the robot with most runs nor that with most time decides. Medians
of delays are averaged likewise. Runs are ranked as task 2 of the DCASE challenge does: by AUC, and
by partial AUC up to a false positive rate of 0.1, standardised as McClish does (Analyzing a portion
of the ROC curve, Medical Decision Making 9, 1989); the harmonic mean of both over all domains is
its official score (Dohi et al., DCASE 2022).

**Intervals.** Frames of a recording and recordings of a group (`recording.group_of`) resemble each
other, so that only groups are drawn: of 2000 sets of as many groups, drawn with replacement, the
bounds hold the middle 95 % (percentile bootstrap). With few errors the sets hardly differ, and
bounds that follow from counting take over:

- *shares*: n recordings without an error are consistent with a share of 0.025^(1/n), so that no
  interval ends closer to 1, nor closer to 0 than 1 - 0.025^(1/n) (Clopper and Pearson, 1934);
- *events in a time*: the exact bounds of Garwood (1936), if they are wider; for 0 events the upper
  one is 3.7 over the time, and 3.0 with 95 % on this one side (the "rule of three").

The mean of rates has the bounds of Fay and Feuer (Confidence intervals for directly standardized
rates, Statistics in Medicine 16, 1997), if they are wider. With fewer than five groups, shares have
no interval.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from math import isnan, nan
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from noiseclassifier.errors import DatasetError
from noiseclassifier.matching import (
    FALSE,
    OK,
    UNCLEAR,
    UNLABELLED,
    Outcome,
    Predictions,
    Unanswered,
    are_probabilities,
    origin_of,
)
from noiseclassifier.signals import Array, Index, Mask, Words

RESAMPLES = 2000
SEED = 0
TAIL = 0.025
"""Probability beyond each bound."""
LEAST_GROUPS = 5

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
KEYS = ("robot", "domain", "scenario")
"""What runs can be grouped by."""
WORST = 5
"""How many of the worst are listed."""
MOST = 0.1
"""False positive rate up to which the partial AUC counts."""
BINS = 10
"""Bins of confidence."""
BY_CLASS = ("recall", "precision", "false_negative_errors", "false_positive_errors")
"""Measures of frames that each class has."""
OF_ALL = (
    "balanced_accuracy",
    "failure_recall",
    "false_alarm_rate",
    "failure_detection_rate",
    "subset_accuracy",
)
"""Measures of frames of all classes."""


def ratio(part: Array | float, whole: Array | float) -> Array:
    """Quotient, NaN where the denominator is 0."""
    part, whole = np.broadcast_arrays(np.asarray(part, float), np.asarray(whole, float))
    share: Array = np.divide(part, whole, out=np.full(whole.shape, nan), where=whole > 0)
    return share[()]


def plain(value: Any) -> Any:
    """Numbers for JSON, None where undefined; of what has several values, each of them."""
    if is_dataclass(value):
        value = vars(value)
    if isinstance(value, Mapping):
        return {name: plain(each) for name, each in value.items()}
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list):
        return [plain(each) for each in value]
    return None if isinstance(value, float) and isnan(value) else value


# --- frames


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Confusion matrix of frames, or several, and measures of it: shares from 0 to 1.

    Attributes:
        classes: Names of the classes.
        confusion: Frames by true (row) and predicted class (column), shape (..., classes, classes).
    """

    classes: tuple[str, ...]
    confusion: NDArray[Any]

    @classmethod
    def of(cls, truth: Words, predicted: Words, classes: Sequence[str]) -> Self:
        """Confusion matrix of predictions.

        Args:
            truth: True class of each frame, shape (frames,).
            predicted: Predicted class of each frame, shape (frames,).
            classes: Names of the classes, in their order; others that occur come after them.

        Raises:
            DatasetError: If there are no frames, or the lengths differ.
        """
        if len(truth) != len(predicted) or not len(truth):
            raise DatasetError(
                f"{len(truth)} labels and {len(predicted)} predictions, expected as many,"
                " one or more"
            )
        there = {str(each) for each in (*truth, *predicted)}
        names = (*classes, *sorted(there - set(classes)))
        from sklearn.metrics import confusion_matrix

        return cls(names, confusion_matrix(truth, predicted, labels=list(names)))

    @property
    def frames(self) -> Any:
        """How many frames were compared, shape (...)."""
        return self.confusion.sum(axis=(-2, -1))

    @property
    def recall(self) -> Array:
        """Frames of a class that were predicted as it, of its frames, shape (..., classes)."""
        return ratio(self._right, self.confusion.sum(axis=-1))

    @property
    def precision(self) -> Array:
        """Frames of a class, of those that were predicted as it, shape (..., classes)."""
        return ratio(self._right, self.confusion.sum(axis=-2))

    @property
    def false_negative_errors(self) -> Array:
        """Frames of a class predicted as another, of ALL frames, shape (..., classes)."""
        return ratio(self.confusion.sum(axis=-1) - self._right, self.frames[..., None])

    @property
    def false_positive_errors(self) -> Array:
        """Frames of others predicted as the class, of ALL frames, shape (..., classes)."""
        return ratio(self.confusion.sum(axis=-2) - self._right, self.frames[..., None])

    @property
    def failure_detection_rate(self) -> Array:
        """The paper's: 1 less the false positive errors of `ok`."""
        missed = self.confusion[..., ~self._ok, :][..., self._ok].sum(axis=(-2, -1))
        return ratio(self.frames - missed, self.frames)

    @property
    def subset_accuracy(self) -> Array:
        """Frames with the right prediction, of all frames."""
        return ratio(self._right.sum(axis=-1), self.frames)

    @property
    def balanced_accuracy(self) -> Array:
        """Mean recall of the classes that occur."""
        return np.asarray(np.nanmean(self.recall, axis=-1))[()]

    @property
    def failure_recall(self) -> Array:
        """Failure frames that were not predicted as `ok`, of the failure frames."""
        return self._flagged(~self._ok)

    @property
    def false_alarm_rate(self) -> Array:
        """`ok` frames that were not predicted as `ok`, of the `ok` frames."""
        return self._flagged(self._ok)

    def as_dict(self) -> dict[str, Any]:
        """All measures for JSON, None where undefined."""
        by_class = {
            name: dict(zip(self.classes, plain(getattr(self, name)), strict=True))
            for name in BY_CLASS
        }
        return {
            "frames": int(self.frames),
            "classes": list(self.classes),
            "confusion": self.confusion.tolist(),
            **by_class,
            **{name: plain(float(getattr(self, name))) for name in OF_ALL},
        }

    def __str__(self) -> str:
        ok = self.confusion[self._ok].sum() / self.frames
        width = max(26, *(len(name) + 2 for name in self.classes))

        def line(title: str, cells: Sequence[object]) -> str:
            return title.ljust(width) + "".join(str(cell).rjust(19) for cell in cells)

        def shares(name: str) -> str:
            values = np.atleast_1d(getattr(self, name)).tolist()
            title = name.replace("_", " ").capitalize()
            return line(title, ["-" if isnan(value) else f"{value:.1%}" for value in values])

        rows = zip(self.classes, self.confusion.tolist(), strict=True)
        return "\n".join(
            [
                line(f"{self.frames} frames", self.classes),
                "",
                "As the paper measures",
                *map(shares, (*BY_CLASS[2:], *OF_ALL[3:])),
                "",
                "Of the frames in question",
                *map(shares, (*BY_CLASS[:2], *OF_ALL[:3])),
                "",
                "Frames of (row) predicted (column)",
                *(line(name, row) for name, row in rows),
                "",
                f"The paper divides by all frames: predicting ok for all of them would detect"
                f" {ok:.1%} of failures by its measure, and none by failure recall.",
            ]
        )

    def _flagged(self, classes: Mask) -> Array:
        """Frames of some classes that were not predicted as `ok`, of the frames of these."""
        own = self.confusion[..., classes, :]
        return ratio(own[..., ~self._ok].sum(axis=(-2, -1)), own.sum(axis=(-2, -1)))

    @property
    def _right(self) -> NDArray[Any]:
        return np.diagonal(self.confusion, axis1=-2, axis2=-1)

    @property
    def _ok(self) -> Mask:
        return np.array([name == OK for name in self.classes])


# --- intervals


@dataclass(frozen=True)
class Estimate:
    """A measure, its bounds with 95 %, and the size of its sample; NaN where undefined."""

    value: float
    low: float
    high: float
    runs: int  # recordings in the sample
    groups: int  # groups of them that share their motion


@dataclass(frozen=True, eq=False)
class Resampling:
    """Sets of groups, drawn once for all measures."""

    group: Index  # of each recording, as a number, shape (runs,)
    weights: Array  # how often each set has each recording, shape (resamples, runs)

    @classmethod
    def of(cls, groups: Sequence[str]) -> Self:
        """Draw the sets."""
        names, group = np.unique(np.asarray(groups, dtype=str), return_inverse=True)
        random = np.random.default_rng(SEED)
        drawn = random.multinomial(len(names), np.full(len(names), 1 / len(names)), RESAMPLES)
        return cls(group, drawn[:, group].astype(np.float64))

    def mean_share(self, part: Array, whole: Array, of: Sequence[Mask]) -> Estimate:
        """Estimate the unweighted mean of the shares of several sets of recordings."""
        return self.bounded(*self._mean(part, whole, of))

    def mean_rate(self, events: Array, time: Array, of: Sequence[Mask]) -> Estimate:
        """Estimate the unweighted mean of the rates of several sets of recordings."""
        value, drawn, behind = self._mean(events, time, of)
        if not behind:
            return Estimate(nan, nan, nan, 0, 0)
        weights = np.array([1.0 / (len(behind) * time[own].sum()) for own in behind])
        low, high = fay_feuer(np.array([events[own].sum() for own in behind]), weights)
        found = self.unbounded(value, drawn, np.any(behind, axis=0))
        # fmin and fmax take the other where there is no interval of the sets.
        low, high = float(np.fmin(low, found.low)), float(np.fmax(high, found.high))
        return Estimate(value, low, high, found.runs, found.groups)

    def _mean(
        self, part: Array, whole: Array, of: Sequence[Mask]
    ) -> tuple[float, Array, list[Mask]]:
        """Mean ratio of sets of recordings, of each resample, and the recordings behind each."""
        behind = [own & (whole > 0) for own in of if (whole * own).sum() > 0]
        value = np.mean([part[own].sum() / whole[own].sum() for own in behind]) if behind else nan
        shares = [
            ratio(self.weights @ (part * own), self.weights @ (whole * own)) for own in behind
        ]
        each = np.array(shares)
        known = ~np.isnan(each)
        drawn = ratio(np.where(known, each, 0.0).sum(axis=0), known.sum(axis=0))
        return float(value), drawn, behind

    def bounded(self, value: float, drawn: Array, behind: Sequence[Mask]) -> Estimate:
        """Bounds of a mean of shares, by that of each set and by the runs behind each share."""
        runs = int(np.any(behind, axis=0).sum())
        groups = min((len(np.unique(self.group[mask])) for mask in behind), default=0)
        if groups < LEAST_GROUPS:
            return Estimate(value, nan, nan, runs, groups)
        # The mean of the shares' own bounds lies further out than the bound of their mean.
        room = float(np.mean([TAIL ** (1.0 / mask.sum()) for mask in behind]))
        low, high = _middle(drawn)
        return Estimate(value, min(low, room), max(high, 1.0 - room), runs, groups)

    def unbounded(self, value: float, drawn: Array, behind: Mask) -> Estimate:
        """Bounds of any other measure of some runs, by the sets of groups alone."""
        groups = len(np.unique(self.group[behind]))
        low, high = _middle(drawn) if groups >= LEAST_GROUPS else (nan, nan)
        return Estimate(value, low, high, int(behind.sum()), groups)

    def quantile(self, values: Array, owner: Index, share: float) -> Estimate:
        """Estimate a quantile of values, shape (values,), that belong to recordings."""
        ascending = np.argsort(values, kind="stable")
        values, owner = values[ascending], owner[ascending]
        behind = np.bincount(owner, minlength=self.weights.shape[1]) > 0

        def of_sets(weights: Array) -> Array:
            total = np.cumsum(weights[:, owner], axis=1)
            if not len(values):
                return np.full(len(weights), np.nan)
            place = (total < share * total[:, -1:]).sum(axis=1)
            return np.where(total[:, -1] > 0, values[np.minimum(place, len(values) - 1)], np.nan)

        once = np.ones((1, len(behind)))
        return self.unbounded(float(of_sets(once)[0]), of_sets(self.weights), behind)


def fay_feuer(events: Array, weights: Array) -> tuple[float, float]:
    """Bounds of a weighted sum of the means of Poisson distributions; Garwood's for one of them."""
    from scipy.special import gammaincinv

    total, variance, most = weights @ events, weights**2 @ events, weights.max()
    low = variance / total * gammaincinv(total**2 / variance, TAIL) if total else 0.0
    total, variance = total + most, variance + most**2
    high = variance / total * gammaincinv(total**2 / variance, 1.0 - TAIL)
    return float(low), float(high)


def _middle(drawn: Array) -> tuple[float, float]:
    known = drawn[~np.isnan(drawn)]
    if not len(known):
        return nan, nan
    low, high = np.quantile(known, (TAIL, 1.0 - TAIL)).tolist()
    return low, high


def frame_estimates(
    predictions: Sequence[Predictions], resampling: Resampling
) -> tuple[Evaluation, dict[str, Any]]:
    """Evaluation of all frames, and its measures with intervals, of some also class by class."""
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
    of_runs = Evaluation(names, counts)
    of_sets = Evaluation(names, np.tensordot(resampling.weights, counts, 1))

    def estimated(name: str, *place: int) -> Estimate:
        value, drawn, known = (
            getattr(each, name)[(..., *place)] for each in (evaluation, of_sets, of_runs)
        )
        return resampling.bounded(float(value), drawn, [~np.isnan(known)])

    found: dict[str, Any] = {name: estimated(name) for name in OF_ALL[1:]}
    for name in BY_CLASS:
        found[name] = {label: estimated(name, number) for number, label in enumerate(names)}
    frames = counts.sum(axis=2)
    there = np.flatnonzero(frames.sum(axis=0))
    found["balanced_accuracy"] = resampling.bounded(
        float(evaluation.balanced_accuracy),
        of_sets.recall[:, there].mean(axis=1),  # a set without a frame of some class has none
        [frames[:, number] > 0 for number in there],
    )
    return evaluation, found


def calibration(
    predictions: Sequence[Predictions], resampling: Resampling
) -> tuple[dict[str, Array], Estimate] | None:
    """Confidence beside truth in bins, and the expected calibration error.

    None if the scores are no probabilities; NaN in empty bins.
    """
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
    frames, confidence, right = sums

    def of_sets(weights: Array) -> Array:
        # sum_b n_b / n |right_b / n_b - confidence_b / n_b|
        apart = np.abs(weights @ (right - confidence)).sum(axis=1)
        return ratio(apart, (weights @ frames).sum(axis=1))

    value = float(of_sets(np.ones((1, len(frames))))[0])
    error = resampling.unbounded(value, of_sets(resampling.weights), frames.sum(axis=1) > 0)
    edges, count = np.linspace(0.0, 1.0, BINS + 1), frames.sum(axis=0)
    table = {
        "low": edges[:-1],
        "high": edges[1:],
        "frames": count,
        "confidence": ratio(confidence.sum(axis=0), count),
        "right": ratio(right.sum(axis=0), count),
    }
    return table, error


# --- the protocol


@dataclass(frozen=True, eq=False)
class Part:
    """Counts and measures of some of the runs."""

    unanswered: int  # runs without a verdict
    counts: dict[str, float]  # numbers, and times in [h]
    measures: dict[str, float]  # shares, rates per hour, delays in [s]; NaN where undefined
    by_chance: dict[str, float]  # shares of findings that are shifted at random


@dataclass(frozen=True)
class Ranked:
    """AUC and pAUC of the runs of a domain."""

    auc: float
    pauc: float
    good: int
    faulty: int


@dataclass(frozen=True, eq=False)
class Protocol:
    """Measures of a model at the operating point that ships."""

    outcomes: tuple[Outcome, ...]
    unanswered: tuple[Unanswered, ...]
    alike: dict[str, Estimate]  # unweighted means over robots
    pooled: dict[str, Estimate]  # of all runs together
    by_chance: dict[str, float]  # means over robots, of findings that are shifted at random
    counts: dict[str, float]  # of all runs together
    by: dict[str, dict[str, Part]]  # by robot, domain and scenario
    cells: dict[tuple[str, ...], Part]  # of each robot and domain
    cases: dict[tuple[str, ...], Part]  # of each robot and scenario
    ranked: dict[str, Ranked]  # by domain

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
        halves = {"half_of_both": (counts["findings"] + counts["faults"]) / 2.0}
        owner = np.repeat(np.arange(len(outcomes)), [len(each.delay) for each in outcomes])
        delay = np.concatenate([each.delay for each in outcomes])
        delay, owner = delay[~np.isnan(delay)], owner[~np.isnan(delay)]
        origins, others = ([origin_of(each) for each in runs] for runs in (predictions, unanswered))

        def parts(*keys: str) -> dict[tuple[str, ...], Part]:
            mine, theirs = (
                [tuple(origin[key] for key in keys) for origin in each]
                for each in (origins, others)
            )
            found = {}
            for name in sorted({*mine, *theirs}):
                own = np.array([each == name for each in mine])
                found[name] = _part(theirs.count(name), counts, halves, own, delay[own[owner]])
            return found

        every = np.ones(len(outcomes), dtype=bool)
        robots = np.array([origin["robot"] for origin in origins])
        alike, pooled = (
            {
                name: (resampling.mean_rate if name in RATES else resampling.mean_share)(
                    counts[part], (counts | halves)[whole], sets
                )
                for name, (part, whole) in {**RATES, **SHARES}.items()
            }
            for sets in ([robots == robot for robot in np.unique(robots)], [every])
        )
        by = {key: {name: part for (name,), part in parts(key).items()} for key in KEYS}
        of_robots = by["robot"].values()
        for name, share in DELAYS.items():
            pooled[name] = resampling.quantile(delay, owner, share)
            value = _mean([each.measures[name] for each in of_robots])
            alike[name] = Estimate(value, nan, nan, pooled[name].runs, pooled[name].groups)
        domains = np.array([origin["domain"] for origin in origins])
        return cls(
            outcomes,
            tuple(unanswered),
            alike,
            pooled,
            {name: _mean([each.by_chance[name] for each in of_robots]) for name in BY_CHANCE},
            {name: float(each.sum()) for name, each in counts.items()},
            by,
            parts("robot", "domain"),
            parts("robot", "scenario"),
            {
                str(name): _ranked([outcomes[run] for run in np.flatnonzero(domains == name)])
                for name in np.unique(domains)
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

    def worst(self, parts: Mapping[tuple[str, ...], Part], measure: str) -> list[tuple[str, ...]]:
        """Name the parts of the lowest share, or of the highest rate; of equals, the largest."""
        sign, perfect = (-1.0, 0.0) if measure in RATES else (1.0, 1.0)

        def order(key: tuple[str, ...]) -> tuple[float, float]:
            counts = parts[key].counts
            return sign * parts[key].measures[measure], -max(counts["faults"], counts["ok_hours"])

        values = {key: part.measures[measure] for key, part in parts.items()}
        keys = [key for key, value in values.items() if not isnan(value) and value != perfect]
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

        def pairs(parts: dict[tuple[str, ...], Part], second: str) -> list[dict[str, Any]]:
            return [{"robot": a, second: b, **vars(part)} for (a, b), part in parts.items()]

        found: dict[str, Any] = plain(
            {
                "robots_alike": self.alike,
                "pooled": self.pooled,
                "by_chance": self.by_chance,
                "counts": self.counts,
                "not_answered": self.not_answered,
                "auc": self.auc,
                "pauc": self.pauc,
                "official_score": self.official,
                "ranking_by_domain": self.ranked,
                **{f"by_{key}": parts for key, parts in self.by.items()},
                "by_robot_and_domain": pairs(self.cells, "domain"),
                "by_robot_and_scenario": pairs(self.cases, "scenario"),
                "missed": self.missed(),
                "false_alarms": self.alarms(FALSE),
                "alarms_in_unlabelled": self.alarms(UNLABELLED),
                "unanswered": [each.as_dict() for each in self.unanswered],
            }
        )
        return found


def auc(good: Array, faulty: Array, *, most: float | None = None) -> float:
    """Area under the ROC curve of scores of good and of faulty runs; NaN unless there are both.

    With a most false positive rate, it is standardised as McClish does: 0.5 without information.
    """
    if not (len(good) and len(faulty)):
        return nan
    from sklearn.metrics import roc_auc_score

    truth = np.repeat((0, 1), (len(good), len(faulty)))
    return float(roc_auc_score(truth, np.concatenate((good, faulty)), max_fpr=most))


def harmonic_mean(values: Sequence[float]) -> float:
    """Harmonic mean of the values that are defined; NaN without one."""
    known = np.array([value for value in values if not isnan(value)])
    if not len(known):
        return nan
    return float(len(known) / (1.0 / known).sum()) if known.all() else 0.0


def _mean(values: Sequence[float]) -> float:
    """Mean of the values that are defined; NaN without one."""
    known = [value for value in values if not isnan(value)]
    return float(np.mean(known)) if known else nan


def _part(
    unanswered: int,
    counts: Mapping[str, Array],
    halves: Mapping[str, Array],
    own: Mask,
    delay: Array,
) -> Part:
    """Counts and measures of some runs, with the delays of the faults that are found in them."""
    total = {name: float(each[own].sum()) for name, each in {**counts, **halves}.items()}
    measures = {
        name: float(ratio(total[part], total[whole]))
        for name, (part, whole) in {**RATES, **SHARES}.items()
    }
    for name, share in DELAYS.items():
        there = len(delay) > 0
        measures[name] = float(np.quantile(delay, share, method="inverted_cdf")) if there else nan
    by_chance = {}
    for name in BY_CHANCE:
        part, whole = SHARES[name]
        whole = f"{whole}_by_chance" if whole in MATCHES else whole
        by_chance[name] = float(ratio(total[f"{part}_by_chance"], total[whole]))
    return Part(unanswered, {name: total[name] for name in counts}, measures, by_chance)


def _ranked(outcomes: Sequence[Outcome]) -> Ranked:
    scored = [each for each in outcomes if not isnan(each.score)]
    good = np.array([each.score for each in scored if not each.faults])
    faulty = np.array([each.score for each in scored if each.faults])
    return Ranked(auc(good, faulty), auc(good, faulty, most=MOST), len(good), len(faulty))
