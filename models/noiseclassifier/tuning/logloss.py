"""Balanced log-loss of decision values.

It is finer than counts of frames: two points of a grid hardly ever have the same. It is computed
from decision values, with one number fitted for all frames, so that it does not depend on the width
of the margins.
"""

import numpy as np

from noiseclassifier.profile import Multiclass
from noiseclassifier.types import Array, Index

WIDEST = 6.0
"""The slope is fitted within 2^-6 to 2^6 per unit of the margin."""
CLOSE = 1e-5
"""Tolerance of the exponent; the loss, which is flat there, has an error of 1e-9 then."""


def class_margins(decisions: Array, *, classes: int, multiclass: Multiclass) -> Array:
    """Least decision value in favour of each class.

    Args:
        decisions: Decision values of all SVMs, shape (frames, decisions).
        classes: How many classes there are.
        multiclass: How the SVMs are combined.

    Returns:
        Margins, shape (frames, classes). One-vs-rest: the decision values. One-vs-one: the least of
        the pairs of a class, above 0 if it wins all of them.
    """
    if multiclass == "one-vs-rest":
        return decisions
    pairs = np.full((len(decisions), classes, classes), np.inf)
    first, second = np.triu_indices(classes, 1)  # the order of the pairs in `svm`
    pairs[:, first, second], pairs[:, second, first] = decisions, -decisions
    worst: Array = pairs.min(axis=2)
    return worst


def balanced_log_loss(margins: Array, truth: Index) -> float:
    """Mean log-loss of the classes, at the slope of the least loss.

    With margins s, p_k = exp(a s_k) / sum_j exp(a s_j) is the probability of class k, and the loss
    is the mean over classes of the mean over the class's frames of -log p_truth. The slope a > 0
    has the least loss (Platt's scaling without a bias, one for all classes); it changes no
    decision.

    Args:
        margins: Margins of the classes, shape (frames, classes).
        truth: Class of each frame, as an index, shape (frames,).

    Returns:
        The loss in nats: 0 if all is certain and right, log(classes) if all margins are equal.
    """
    from scipy.optimize import brentq

    counts = np.bincount(truth)
    weight = 1.0 / (counts[truth] * np.count_nonzero(counts))
    own = margins[np.arange(len(truth)), truth]

    def rise(power: float) -> float:
        return float(weight @ (_softmax(margins, 2.0**power)[1] - own))

    # The loss is convex in a: where its derivative changes sign it is least.
    if rise(-WIDEST) >= 0.0:
        power = -WIDEST
    elif rise(WIDEST) <= 0.0:
        power = WIDEST
    else:
        power = brentq(rise, -WIDEST, WIDEST, xtol=CLOSE)
    slope = 2.0**power
    return float(weight @ (_softmax(margins, slope)[0] - slope * own))


def _softmax(margins: Array, slope: float) -> tuple[Array, Array]:
    """Log sum exp(a s), and the mean of s by its weights, each of shape (frames,)."""
    highest = margins.max(axis=1)
    share = np.exp(slope * (margins - highest[:, None]))
    total = share.sum(axis=1)
    return slope * highest + np.log(total), (share * margins).sum(axis=1) / total
