"""Ranking of whole runs: AUC and partial AUC, as task 2 of the DCASE challenge has them.

A run has one *score*: the largest failure score that two neighbouring frames both reach, since a
finding takes two. The AUC is the probability that a faulty run scores higher than a good one, ties
counting half. The partial AUC is the area under the ROC curve up to a false positive rate of 0.1,
standardised as McClish (Analyzing a portion of the ROC curve, Medical Decision Making 9, 1989)
does: 0.5 for scores without information, 1 for perfect ones. The challenge's program computes it
so (Dohi et al., DCASE 2022 task 2, after Koizumi et al., 2020), and summarises AUC and pAUC of all
domains by their harmonic mean.
"""

from collections.abc import Sequence

import numpy as np

from noiseclassifier.evaluation.tradeoff import failure_score
from noiseclassifier.labels import Labels
from noiseclassifier.types import Array

MOST = 0.1
"""False positive rate up to which the partial AUC counts."""


def run_score(labels: Labels) -> float:
    """Largest failure score that is confirmed by a neighbour; NaN without a frame.

    Args:
        labels: Of the frames of a run. A frame without a neighbour on one side stands alone, as in
            the rule from frames to findings.
    """
    if not len(labels):
        return float("nan")
    scores = failure_score(labels.scores, labels.classes)
    if labels.above_threshold is None:
        return float(scores.max())
    apart = labels.start[1:] > labels.stop[:-1]
    alone = np.append(True, apart) | np.append(apart, True)
    pairs = np.minimum(scores[1:], scores[:-1])[~apart]
    return float(np.concatenate((scores[alone], pairs)).max())


def auc(good: Array, faulty: Array) -> float:
    """Area under the ROC curve; NaN unless there are good and faulty runs.

    Args:
        good: Scores of good runs, shape (good,).
        faulty: Scores of faulty runs, shape (faulty,).
    """
    false, true = _roc(good, faulty)
    return float(np.trapezoid(true, false)) if len(good) and len(faulty) else float("nan")


def partial_auc(good: Array, faulty: Array, *, most: float = MOST) -> float:
    """Area under the ROC curve up to a false positive rate, standardised as McClish does.

    Args:
        good: Scores of good runs, shape (good,).
        faulty: Scores of faulty runs, shape (faulty,).
        most: The false positive rate.
    """
    if not (len(good) and len(faulty)):
        return float("nan")
    false, true = _roc(good, faulty)
    kept = false <= most
    false = np.append(false[kept], most)
    true = np.append(true[kept], np.interp(most, *_roc(good, faulty)))
    least = most**2 / 2.0  # of scores without information: below the diagonal
    return float((1.0 + (np.trapezoid(true, false) - least) / (most - least)) / 2.0)


def harmonic_mean(values: Sequence[float]) -> float:
    """Harmonic mean of the values that are defined; NaN without one."""
    known = np.array([value for value in values if not np.isnan(value)])
    if not len(known):
        return float("nan")
    return float(len(known) / (1.0 / known).sum()) if known.all() else 0.0


def _roc(good: Array, faulty: Array) -> tuple[Array, Array]:
    """False and true positive rates at falling thresholds, from 0 to 1."""
    thresholds = np.unique(np.concatenate((good, faulty)))[::-1]

    def share(scores: Array) -> Array:
        above = len(scores) - np.searchsorted(np.sort(scores), thresholds, side="left")
        return np.append(0.0, above / max(len(scores), 1))

    return share(good), share(faulty)
