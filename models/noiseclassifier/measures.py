"""Measures of a model: its frames, its findings as they are reported, and intervals of both.

`docs/metrics.md` defines the measures, with their sources; `matching` defines the terms.

A measure of a model is the unweighted mean over robots, so that neither the robot with most runs
nor that with most time decides. Runs are ranked as task 2 of the DCASE challenge does: by AUC, and
by partial AUC (McClish, Medical Decision Making 9, 1989), as harmonic means over all domains.

Recordings of a group (`recording.group_of`) resemble each other, so that groups are drawn: of 2000
sets of as many, the bounds hold the middle 95 %. With few errors the sets hardly differ, and bounds
that follow from counting take over where they are wider: n recordings without an error are
consistent with a share of 0.025^(1/n) (Clopper and Pearson, 1934), and numbers of events have those
of Garwood (1936), or of Fay and Feuer for means of rates (Statistics in Medicine 16, 1997). With
fewer than five groups, shares have no interval.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from functools import cached_property
from math import isnan, nan
from statistics import harmonic_mean
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from noiseclassifier.errors import DatasetError
from noiseclassifier.matching import FALSE, OK, Outcome, Predictions, Unanswered, origin_of
from noiseclassifier.signals import Array, Index, Mask, Words

RESAMPLES = 2000
SEED = 0
TAIL = 0.025  # probability beyond each bound
LEAST_GROUPS = 5

# Rates: what is counted, and the time of it in [h].
RATES = {
    "false_alarms_per_hour": ("false_alarms", "ok_hours"),
    "alarms_in_unlabelled_per_hour": ("alarms_in_unlabelled", "unlabelled_hours"),
}
# Shares: of what is counted, and of what.
SHARES = {
    "ok_flagged": ("ok_hours_flagged", "ok_hours"),
    "recall_injected": ("found", "faults"),
    "recall_felt": ("found_felt", "felt"),
    "class_precision": ("matched_by_class", "findings"),
    "class_recall": ("matched_by_class", "faults"),
    "class_f1": ("matched_by_class", "half_of_both"),
    "onset_within": ("onset_close", "found"),
}
# Shares of findings that are shifted at random.
BY_CHANCE = {
    name: (f"{part}_by_chance", "found_by_chance" if whole == "found" else whole)
    for name, (part, whole) in SHARES.items()
    if name != "ok_flagged"
}
DELAYS = {"delay": 0.5, "late_delay": 0.9}  # quantiles of the delays, by name
KEYS = ("robot", "domain", "scenario")  # what runs can be grouped by
MOST = 0.1  # false positive rate up to which the partial AUC counts
# Measures of frames as the paper has them: of ALL frames.
PAPER = (
    "false_negative_errors",
    "false_positive_errors",
    "failure_detection_rate",
    "subset_accuracy",
)


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
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list):
        return [plain(each) for each in value]
    return None if isinstance(value, float) and isnan(value) else value


# --- frames


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Confusion matrix of frames, and measures of it: shares from 0 to 1, NaN where undefined."""

    classes: tuple[str, ...]
    confusion: NDArray[Any]  #: frames by true (row) and predicted class (column)

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
    def frames(self) -> int:
        """How many frames were compared."""
        return int(self.confusion.sum())

    @cached_property
    def measures(self) -> dict[str, Any]:
        """Measures by name: of each class, shape (classes,), and then of all."""
        cells, ok = self.confusion, np.array([name == OK for name in self.classes])
        right, own, predicted = cells.diagonal(), cells.sum(axis=1), cells.sum(axis=0)
        flagged = cells[:, ~ok].sum(axis=1)  # frames of a class that were not predicted as `ok`
        recall = ratio(right, own)
        return {
            "recall": recall,
            "precision": ratio(right, predicted),
            "false_negative_errors": ratio(own - right, self.frames),
            "false_positive_errors": ratio(predicted - right, self.frames),
            "balanced_accuracy": np.nanmean(recall),  # of the classes that occur
            "failure_recall": ratio(flagged[~ok].sum(), own[~ok].sum()),
            "false_alarm_rate": ratio(flagged[ok].sum(), own[ok].sum()),
            # 1 less the false positive errors of `ok`:
            "failure_detection_rate": ratio(self.frames - (own - flagged)[~ok].sum(), self.frames),
            "subset_accuracy": ratio(right.sum(), self.frames),
        }

    def as_dict(self) -> dict[str, Any]:
        """All measures for JSON, None where undefined."""
        found = {name: plain(value) for name, value in self.measures.items()}
        return {
            "frames": self.frames,
            "classes": list(self.classes),
            "confusion": self.confusion.tolist(),
            **{
                name: dict(zip(self.classes, value, strict=True))
                if isinstance(value, list)
                else value
                for name, value in found.items()
            },
        }

    def __str__(self) -> str:
        ok = self.confusion[[name == OK for name in self.classes]].sum() / self.frames
        width = max(26, *(len(name) + 2 for name in self.classes))

        def line(title: str, cells: Sequence[object]) -> str:
            return title.ljust(width) + "".join(str(cell).rjust(19) for cell in cells)

        def shares(name: str) -> str:
            values = np.atleast_1d(self.measures[name]).tolist()
            title = name.replace("_", " ").capitalize()
            return line(title, ["-" if isnan(value) else f"{value:.1%}" for value in values])

        rows = zip(self.classes, self.confusion.tolist(), strict=True)
        return "\n".join(
            [
                line(f"{self.frames} frames", self.classes),
                "",
                "As the paper measures",
                *map(shares, PAPER),
                "",
                "Of the frames in question",
                *(shares(name) for name in self.measures if name not in PAPER),
                "",
                "Frames of (row) predicted (column)",
                *(line(name, row) for name, row in rows),
                "",
                "The paper divides by all frames: predicting ok for all of them would detect",
                f"{ok:.1%} of failures by its measure, and none by failure recall.",
            ]
        )


# --- intervals


@dataclass(frozen=True)
class Estimate:
    """A measure and its bounds with 95 %, NaN where undefined."""

    value: float
    low: float = nan
    high: float = nan


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
        behind = [own for own in (each & (whole > 0) for each in of) if own.any()]
        found = self._mean(part, whole, behind)
        if any(self._groups(own) < LEAST_GROUPS for own in behind) or not behind:
            return Estimate(found.value)
        # The mean of the shares' own bounds lies further out than the bound of their mean.
        room = float(np.mean([TAIL ** (1.0 / own.sum()) for own in behind]))
        return Estimate(found.value, min(found.low, room), max(found.high, 1.0 - room))

    def mean_rate(self, events: Array, time: Array, of: Sequence[Mask]) -> Estimate:
        """Estimate the unweighted mean of the rates of several sets of recordings."""
        behind = [own for own in (each & (time > 0) for each in of) if own.any()]
        found = self._mean(events, time, behind)
        if not behind:
            return found
        weights = np.array([1.0 / (len(behind) * time[own].sum()) for own in behind])
        low, high = fay_feuer(np.array([events[own].sum() for own in behind]), weights)
        if self._groups(np.any(behind, axis=0)) < LEAST_GROUPS:
            return Estimate(found.value, low, high)
        return Estimate(found.value, min(low, found.low), max(high, found.high))

    def _mean(self, part: Array, whole: Array, behind: Sequence[Mask]) -> Estimate:
        """Mean ratio of sets of recordings, and the middle of those of all resamples."""
        if not behind:
            return Estimate(nan)
        value = np.mean([part[own].sum() / whole[own].sum() for own in behind])
        each = np.array(
            [ratio(self.weights @ (part * own), self.weights @ (whole * own)) for own in behind]
        )
        known = ~np.isnan(each)
        drawn = ratio(np.where(known, each, 0.0).sum(axis=0), known.sum(axis=0))
        low, high = np.quantile(drawn[~np.isnan(drawn)], (TAIL, 1.0 - TAIL)).tolist()
        return Estimate(float(value), low, high)

    def _groups(self, runs: Mask) -> int:
        return len(np.unique(self.group[runs]))


def fay_feuer(events: Array, weights: Array) -> tuple[float, float]:
    """Bounds of a weighted sum of the means of Poisson distributions; Garwood's for one of them."""
    from scipy.special import gammaincinv

    total, variance, most = weights @ events, weights**2 @ events, weights.max()
    low = variance / total * gammaincinv(total**2 / variance, TAIL) if total else 0.0
    total, variance = total + most, variance + most**2
    high = variance / total * gammaincinv(total**2 / variance, 1.0 - TAIL)
    return float(low), float(high)


# --- the protocol


@dataclass(frozen=True, eq=False)
class Part:
    """Counts and measures of some of the runs."""

    unanswered: int  # runs without a verdict
    counts: dict[str, float]  # numbers, and times in [h]
    measures: dict[str, float]  # shares, rates per hour, delays in [s]; NaN where undefined
    by_chance: dict[str, float]  # shares of findings that are shifted at random

    @classmethod
    def of(cls, outcomes: Sequence[Outcome], unanswered: int) -> Self:
        """Counts and measures of runs, beside those that have no verdict."""
        total = defaultdict[str, float](float)
        for each in outcomes:
            for name, count in each.counts.items():
                total[name] += count
        measures, by_chance = (
            {name: float(ratio(total[part], total[whole])) for name, (part, whole) in table.items()}
            for table in ({**RATES, **SHARES}, BY_CHANCE)
        )
        delay = np.concatenate([each.delay for each in outcomes]) if outcomes else np.array([])
        delay = delay[~np.isnan(delay)]
        for name, share in DELAYS.items():
            some = len(delay) > 0
            measures[name] = (
                float(np.quantile(delay, share, method="inverted_cdf")) if some else nan
            )
        scored = [each for each in outcomes if not isnan(each.score)]
        good = np.array([each.score for each in scored if not each.faults])
        faulty = np.array([each.score for each in scored if each.faults])
        measures |= {"auc": auc(good, faulty), "pauc": auc(good, faulty, most=MOST)}
        return cls(unanswered, total, measures, by_chance)


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

    @classmethod
    def of(
        cls,
        predictions: Sequence[Predictions],
        resampling: Resampling,
        unanswered: Sequence[Unanswered] = (),
    ) -> Self:
        """Measures of findings as they are reported, on one run with a verdict or more."""
        outcomes = tuple(map(Outcome.of, predictions))
        mine, theirs = ([origin_of(each) for each in runs] for runs in (predictions, unanswered))
        by = {
            key: {
                name: Part.of(
                    [o for o, origin in zip(outcomes, mine, strict=True) if origin[key] == name],
                    sum(origin[key] == name for origin in theirs),
                )
                for name in sorted({origin[key] for origin in (*mine, *theirs)})
            }
            for key in KEYS
        }
        counts = {name: np.array([o.counts[name] for o in outcomes]) for name in outcomes[0].counts}
        robot = np.array([origin["robot"] for origin in mine])
        robots = [robot == name for name in np.unique(robot)]
        alike, pooled = (
            {
                name: estimate(counts[part], counts[whole], sets)
                for table, estimate in (
                    (RATES, resampling.mean_rate),
                    (SHARES, resampling.mean_share),
                )
                for name, (part, whole) in table.items()
            }
            for sets in (robots, [np.ones(len(outcomes), dtype=bool)])
        )
        total, parts = Part.of(outcomes, len(unanswered)), by["robot"].values()
        for name in DELAYS:
            alike[name] = Estimate(_mean([part.measures[name] for part in parts]))
            pooled[name] = Estimate(total.measures[name])
        by_chance = {name: _mean([part.by_chance[name] for part in parts]) for name in BY_CHANCE}
        return cls(outcomes, tuple(unanswered), alike, pooled, by_chance, total.counts, by)

    @property
    def auc(self) -> float:
        """Harmonic mean of the AUC of all domains."""
        return self._over_domains("auc")

    @property
    def pauc(self) -> float:
        """Harmonic mean of the pAUC of all domains."""
        return self._over_domains("pauc")

    def _over_domains(self, name: str) -> float:
        known = [part.measures[name] for part in self.by["domain"].values()]
        known = [value for value in known if not isnan(value)]
        return harmonic_mean(known) if known else nan

    @property
    def not_answered(self) -> float:
        """Share of the runs without a verdict."""
        return len(self.unanswered) / (len(self.outcomes) + len(self.unanswered))

    def missed(self) -> list[dict[str, Any]]:
        """List the faults that are not found."""
        return [
            {"run": outcome.run.name, **fault._asdict()}
            for outcome in self.outcomes
            for fault, found in zip(outcome.faults, outcome.found, strict=True)
            if not found
        ]

    def false_alarms(self) -> list[dict[str, Any]]:
        """List the findings in `ok` time."""
        return [
            {"run": one.run.name, "label": e.label, "start": e.start, "stop": e.stop}
            for one in self.outcomes
            for e, own in zip(one.run.findings, one.kind, strict=True)
            if own == FALSE
        ]

    def as_dict(self) -> dict[str, Any]:
        """All measures for JSON, None where undefined."""
        found: dict[str, Any] = plain(
            {
                "robots_alike": self.alike,
                "pooled": self.pooled,
                "by_chance": self.by_chance,
                "counts": self.counts,
                "not_answered": self.not_answered,
                "auc": self.auc,
                "pauc": self.pauc,
                **{f"by_{key}": parts for key, parts in self.by.items()},
                "missed": self.missed(),
                "false_alarms": self.false_alarms(),
                "unanswered": [
                    {"run": each.name, **origin_of(each), "reason": each.reason}
                    for each in self.unanswered
                ],
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


def _mean(values: Sequence[float]) -> float:
    """Mean of the values that are defined; NaN without one."""
    known = [value for value in values if not isnan(value)]
    return float(np.mean(known)) if known else nan
