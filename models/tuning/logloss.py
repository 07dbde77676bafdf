"""Log-loss: how sure a machine is of the right classes, and how little of the wrong ones.

What is measured is finer than counts of frames: no two points of a grid share it by chance. It is
taken from decisions as they are, with one number fitted for all frames, so that it does not depend
on how wide a machine's margin happens to be.
"""

import numpy as np

from models.profile import Multiclass
from models.types import Array, Index

WIDEST = 6.0
"""Slopes are looked for from 2^-6 to 2^6 per unit of the margin."""
CLOSE = 1e-5
"""How closely the exponent is found; the loss, being flat there, is right to 1e-9 then."""


def grades(decisions: Array, *, classes: int, multiclass: Multiclass) -> Array:
    """Grade each class by the machine that speaks most against it.

    Args:
        decisions: Decisions of all machines, shape (frames, machines).
        classes: How many classes there are.
        multiclass: What machines there are.

    Returns:
        Grades in units of the machines' margins, shape (frames, classes). One-vs-rest: the
        decisions. One-vs-one: the worst duel of a class, above 0 if it wins all of them.
    """
    if multiclass == "one-vs-rest":
        return decisions
    duels = np.full((len(decisions), classes, classes), np.inf)
    first, second = np.triu_indices(classes, 1)  # the order of the pairs in `svm`
    duels[:, first, second], duels[:, second, first] = decisions, -decisions
    worst: Array = duels.min(axis=2)
    return worst


def balanced_log_loss(graded: Array, truth: Index) -> float:
    """Take the mean log-loss of the classes, at the slope that makes it least.

    With grades s, p_k = exp(a s_k) / sum_j exp(a s_j) is the probability of class k, and the loss
    is the mean over classes of the mean over the class's frames of -log p_truth. The slope a > 0
    is the one for which the loss is least (Platt's scaling with neither bias nor classes of its
    own): it says what a margin is worth in this set and changes no decision.

    Args:
        graded: Grades of the classes, shape (frames, classes).
        truth: Class of each frame, as an index, shape (frames,).

    Returns:
        The loss in nats: 0 if all is right and sure, log(classes) if grades say nothing.
    """
    from scipy.optimize import brentq

    counts = np.bincount(truth)
    weight = 1.0 / (counts[truth] * np.count_nonzero(counts))
    own = graded[np.arange(len(truth)), truth]

    def rise(power: float) -> float:
        return float(weight @ (_softmax(graded, 2.0**power)[1] - own))

    # The loss is convex in a: where its derivative changes sign it is least.
    if rise(-WIDEST) >= 0.0:
        power = -WIDEST
    elif rise(WIDEST) <= 0.0:
        power = WIDEST
    else:
        power = brentq(rise, -WIDEST, WIDEST, xtol=CLOSE)
    slope = 2.0**power
    return float(weight @ (_softmax(graded, slope)[0] - slope * own))


def _softmax(graded: Array, slope: float) -> tuple[Array, Array]:
    """Take log sum exp(a s), and the mean of s by its weights, each of shape (frames,)."""
    highest = graded.max(axis=1)
    share = np.exp(slope * (graded - highest[:, None]))
    total = share.sum(axis=1)
    return slope * highest + np.log(total), (share * graded).sum(axis=1) / total
