"""Boosted trees, evaluated in NumPy, that say how probable each class is.

In each round of boosting, a small tree for each class adds to how likely that class is; the sums
are then calibrated. What lies below all that is known falls to the same leaves as the least of it:
a motion quieter than any other is no failure.

All splits of all trees are looked at together, in place of a walk down each: a split that a frame
passes on the right rules the leaves on its left out, and of those that are left in the end, the
first one is where the walk would have led (C. Lucchese et al., *QuickScorer: A Fast Algorithm to
Rank Documents with Additive Ensembles of Regression Trees*, 2015).
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.estimators.calibration import calibrate, familiar, plain
from models.estimators.probabilistic import Probable
from models.profile import MOST_LEAVES, Profile
from models.splitting import folds
from models.types import Array, Index, Words

TOGETHER = 32
"""Frames that are looked at together: fewer take longer, more gain nothing but memory."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Trees(Probable):
    """Trees whose answers are summed up, their calibration, and what they know.

    Trees are in the order of rounds, one for each class in each; their leaves from left to right.
    A tree with fewer splits than others has some that rule nothing out.

    Attributes:
        feature: Number of the feature that a split looks at, shape (trees, splits).
        threshold: A frame is on the right of a split if its feature exceeds this, shape
            (trees, splits).
        left: The first leaf on the left of a split, and the first one that is not, shape
            (2, trees, splits).
        leaf: What a leaf adds to its tree's class, shape (trees, leaves).
        prior: What classes start from, shape (classes,).
        known: Highest value of each feature that is known, shape (features,).
    """

    feature: Array
    threshold: Array
    left: Array
    leaf: Array
    prior: Array
    known: Array

    @property
    def highest(self) -> Array:
        """Highest value of each feature that is known, shape (features,)."""
        return self.known

    def answers(self, features: Array) -> Array:
        """Sum up the leaves that frames fall to, and the prior, shape (frames, classes)."""
        found = np.empty((len(features), len(self.prior)))
        for first in range(0, len(features), TOGETHER):
            few = slice(first, first + TOGETHER)
            found[few] = self._sums(features[few])
        return found

    def _sums(self, features: Array) -> Array:
        number, threshold, left, leaf, first = self._side_by_side
        right = features.take(number, axis=1) > threshold
        ruled_out = np.bitwise_or.reduce(right * left, 1)
        place = first + _FIRST.take(np.invert(ruled_out, out=ruled_out))
        added = leaf.take(place).reshape(len(features), -1, len(self.prior))
        sums: Array = np.add.reduce(added, 1)
        sums += self.prior
        return sums

    @cached_property
    def _side_by_side(self) -> tuple[Index, Array, NDArray[np.uint16], Array, Index]:
        """Lay all first splits of trees side by side, and then all second ones.

        Returns:
            Features, thresholds and leaves on the left, as bits, shape (splits, trees); all
            leaves in a row, and where those of each tree begin, shape (trees,).
        """
        start, stop = self.left.astype(np.int64)
        bits = ((1 << stop) - (1 << start)).astype(np.uint16)
        trees, leaves = self.leaf.shape
        return (
            np.ascontiguousarray(self.feature.T.astype(np.intp)),
            np.ascontiguousarray(self.threshold.T),
            np.ascontiguousarray(bits.T),
            self.leaf.ravel(),
            leaves * np.arange(trees),
        )

    def arrays(self) -> dict[str, Array]:
        """Give what a model file keeps."""
        return {
            "feature": self.feature,
            "threshold": self.threshold,
            "left": self.left,
            "leaf": self.leaf,
            "prior": self.prior,
            "calibration": self.calibration,
            "frequency": self.frequency,
            "known": self.known,
        }


def _first_bits() -> NDArray[np.uint8]:
    """Say of each number of 16 bits which is its first one, shape (65536,); of none, the first."""
    numbers = np.arange(1 << MOST_LEAVES)
    first = np.frexp(numbers & -numbers)[1] - 1
    found: NDArray[np.uint8] = np.maximum(first, 0).astype(np.uint8)
    return found


_FIRST = _first_bits()


MANY = 10_000
"""Frames from which trees are learnt by several processes."""
PARTS = 3
"""Parts of the groups; trees that have not learnt from one are asked about it to calibrate all."""
NEVER = -30.0
"""Prior of a class that no frame is of."""
USUAL = 1e-3
"""Share of the training frames that lie above what is known."""


def fit_trees(features: Array, targets: Index, groups: Words, profile: Profile) -> Trees:
    """Learn trees from all frames, and their calibration from trees that do not know them.

    Args:
        features: Standardised, shape (frames, features).
        targets: Class of each, as an index from 0 without a gap, shape (frames,).
        groups: What shares its motion, shape (frames,).
        profile: Number and size of the trees.

    Returns:
        The trees; equal input gives equal trees. Those of a single group are not calibrated.
    """
    from joblib import Parallel, delayed

    parts = _parts(targets, groups)
    everything = np.arange(len(targets))
    parallel = Parallel(n_jobs=-1 if len(targets) > MANY else 1)
    learnt: list[Trees] = parallel(
        delayed(_fit)(features, targets, known, profile)
        for known in (everything, *(known for known, _ in parts))
    )
    trees, *others = learnt
    asked = [familiar(targets, known, fresh) for known, fresh in parts]
    if not sum(map(len, asked)):
        return trees
    answers = [one.answers(features[those]) for one, those in zip(others, asked, strict=True)]
    truth = targets[np.concatenate(asked)]
    return replace(trees, calibration=calibrate(np.concatenate(answers), truth))


def _parts(targets: Index, groups: Words) -> list[tuple[Index, Index]]:
    """Say which frames trees learn from, and which they are asked about."""
    count = min(PARTS, len(set(groups.tolist())))
    parts = folds(groups.tolist(), count) if count > 1 else []
    return [part for part in parts if len(set(targets[part[0]].tolist())) > 1]


def _fit(features: Array, targets: Index, known: Index, profile: Profile) -> Trees:
    """Learn trees from the frames that are known; their calibration changes nothing."""
    from sklearn.ensemble import HistGradientBoostingClassifier
    from threadpoolctl import threadpool_limits

    boosting = HistGradientBoostingClassifier(
        max_iter=profile.rounds,
        learning_rate=profile.learning_rate,
        max_leaf_nodes=profile.leaves,
        l2_regularization=profile.penalty,
        early_stopping=False,  # it would hold back frames that overlap others
        random_state=0,
    )
    with threadpool_limits(1):  # a thread that waits for a core keeps all others waiting
        boosting.fit(features[known], targets[known])
    classes = int(targets.max()) + 1
    counts = np.bincount(targets[known], minlength=classes)
    there = np.flatnonzero(counts)
    # Private is where its trees are; a test holds ours to them. It has none for a class that it
    # does not see, and of two classes for the second alone.
    learnt = there if len(there) > 2 else there[1:]
    prior = np.where(counts > 0, 0.0, NEVER)
    prior[learnt] = boosting._baseline_prediction.ravel()
    shape = profile.rounds, classes, profile.leaves
    splits, leaf = np.zeros((4, *shape[:2], shape[2] - 1)), np.zeros(shape)
    for number, trees in enumerate(boosting._predictors):
        for kind, tree in zip(learnt, trees, strict=True):
            rows, values = _lay_out(tree.nodes)
            splits[:, number, kind, : len(rows)] = np.transpose(rows)
            leaf[number, kind, : len(values)] = values
    feature, threshold, *left = splits.reshape(4, -1, shape[2] - 1)
    return Trees(
        feature=feature,
        threshold=threshold,
        left=np.array(left),
        leaf=leaf.reshape(-1, shape[2]),
        prior=prior,
        known=np.quantile(features[known], 1.0 - USUAL, axis=0),
        calibration=plain(classes),
        frequency=counts / len(known),
        alarm=profile.alarm,
    )


def _lay_out(nodes: Any) -> tuple[list[list[float]], list[float]]:
    """Read a tree as scikit-learn keeps it.

    Returns:
        Of each split the feature, the threshold, the first leaf on its left, and the first one
        that is not; and the values of the leaves, from left to right.
    """
    splits: list[list[float]] = []
    values: list[float] = []

    def visit(number: int) -> None:
        node = nodes[number]
        if node["is_leaf"]:
            values.append(node["value"])
            return
        split = [node["feature_idx"], node["num_threshold"], len(values)]
        splits.append(split)
        visit(node["left"])
        split.append(len(values))
        visit(node["right"])

    visit(0)
    return splits, values
