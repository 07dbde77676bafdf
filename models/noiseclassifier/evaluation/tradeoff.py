"""The trade-off: recall against false alarms per hour, over a threshold on the scores.

Conventions: a frame's *failure score* is 1 - P(ok) if the scores are probabilities, or else the
largest score of a failure less that of `ok`. At a threshold, the frames with larger scores count as
failures, and all is counted as in `eventscore`. If a finding takes two frames of evidence, it is
they whose scores are larger, or which are out of distribution; frames beside them that are not `ok`
join them. Thresholds are scores of frames within `ok` blocks, the highest first: in between,
nothing but recall changes. Alarms that merge as the threshold falls become fewer; so that this is
no advantage, the false alarms of a threshold are the most of all thresholds at or above it.

To read the recall at a budget from this curve is to choose the threshold on the very recordings
that are measured: it rates the scores, and does not predict how a model will do on others.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noiseclassifier.evaluation.calibration import are_probabilities
from noiseclassifier.evaluation.eventscore import alarms, hit
from noiseclassifier.evaluation.intervals import Estimate, Resampling, ratio
from noiseclassifier.evaluation.matching import OK, UNCLEAR, Matched
from noiseclassifier.labels import confirmed
from noiseclassifier.types import Array, Index, Mask

POINTS = 200
"""Thresholds at most."""
HOUR = 3600.0


@dataclass(frozen=True, eq=False)
class TradeOff:
    """Counts of each recording at falling thresholds.

    Attributes:
        thresholds: What a failure score has to exceed, falling, shape (points,).
        recalled: Failure frames that do, shape (runs, points).
        frames: Failure frames, shape (runs,).
        found: Failures found, shape (runs, points).
        failures: Failures, shape (runs,).
        false: False alarms, shape (runs, points).
        hours: `ok` motion that frames cover, shape (runs,), in [h].
    """

    thresholds: Array
    recalled: Array
    frames: Array
    found: Array
    failures: Array
    false: Array
    hours: Array

    def curve(self) -> dict[str, Array]:
        """Give the points of the curve, for all recordings together.

        Returns:
            By name, each of shape (points,): ``threshold``, ``failure_recall`` (of frames),
            ``events_found`` and ``false_alarms_per_hour``.
        """
        recall, found, rate = self._shares(np.ones(len(self.hours)))
        return {
            "threshold": self.thresholds,
            "failure_recall": recall,
            "events_found": found,
            "false_alarms_per_hour": rate,
        }

    def at_budgets(
        self, budgets: Sequence[float], resampling: Resampling
    ) -> list[tuple[Estimate, Estimate]]:
        """Read what is found at a number of false alarms per hour, or fewer.

        Args:
            budgets: False alarms per hour.
            resampling: Sets of recordings; each chooses a threshold of its own.

        Returns:
            For each budget, the recall of failure frames, and the share of failures found.
        """
        whole = (self.frames, self.failures)
        *values, rate = self._shares(np.ones((1, len(self.hours))))
        *drawn, rates = self._shares(resampling.weights)
        return [
            tuple(  # type: ignore[misc]
                resampling.bounded(
                    float(_within(value, rate, budget)[0]),
                    _within(each, rates, budget),
                    [behind > 0],
                )
                for value, each, behind in zip(values, drawn, whole, strict=True)
            )
            for budget in budgets
        ]

    def _shares(self, weights: Array) -> tuple[Array, Array, Array]:
        """Compute recall, failures found and false alarms per hour, shape (..., points) each."""
        recall = ratio(weights @ self.recalled, (weights @ self.frames)[..., None])
        found = ratio(weights @ self.found, (weights @ self.failures)[..., None])
        return recall, found, ratio(weights @ self.false, (weights @ self.hours)[..., None])


def trade_off(matched: Matched) -> TradeOff:
    """Count at falling thresholds.

    Args:
        matched: The recordings.
    """
    frames, failures = matched.frames, matched.failures
    risk = failure_score(frames.scores, matched.classes)
    failing = ~np.isin(frames.truth, (OK, UNCLEAR))
    scores = np.unique(risk[frames.in_ok])[::-1]
    ranks = np.unique(np.geomspace(1, max(len(scores), 1), POINTS).round().astype(np.intp)) - 1
    thresholds = scores[ranks[: len(scores)]]
    above = [_flagged(matched, risk > threshold) for threshold in thresholds]
    raised = [alarms(matched, flagged) for flagged in above]
    return TradeOff(
        thresholds,
        _columns(matched, [frames.run[flagged & failing] for flagged in above]),
        matched.by_run(frames.run[failing]),
        _columns(matched, [failures.run[hit(matched, flagged)] for flagged in above]),
        matched.by_run(failures.run),
        _columns(matched, [each.run[each.false] for each in raised]),
        matched.ok_covered / HOUR,
    )


def _flagged(matched: Matched, above: Mask) -> Mask:
    """Frames of findings if those above a threshold are evidence, shape (frames,)."""
    if not matched.confirms:
        return above
    frames = matched.frames
    above = above | frames.novel  # `unknown` where it is not above: evidence all the same
    apart = frames.start[1:] > frames.stop[:-1] + matched.slack
    apart |= frames.run[1:] != frames.run[:-1]
    return confirmed(above | frames.suspect, above, apart)


def failure_score(scores: Array, classes: Sequence[str]) -> Array:
    """Score of any failure.

    Args:
        scores: Of all classes, shape (frames, classes).
        classes: Their names, `ok` among them.

    Returns:
        Shape (frames,).
    """
    ok = list(classes).index(OK)
    if are_probabilities(scores):
        return 1.0 - scores[:, ok]
    margin: Array = np.delete(scores, ok, axis=1).max(axis=1) - scores[:, ok]
    return margin


def _within(shares: Array, rates: Array, budget: float) -> Array:
    """Share of each set at the last threshold within its budget, shape (sets,)."""
    allowed = np.maximum.accumulate(rates, axis=1) <= budget
    last = allowed.sum(axis=1) - 1
    values = np.append(shares, np.full((len(shares), 1), np.nan), axis=1)
    taken: Array = values[np.arange(len(values)), last]  # -1, none, is the NaN at the end
    return taken


def _columns(matched: Matched, runs: Sequence[Index]) -> Array:
    """Count by recording at each threshold, shape (runs, points)."""
    counts = [matched.by_run(run) for run in runs]
    return np.stack(counts, axis=1) if counts else np.zeros((len(matched.names), 0))
