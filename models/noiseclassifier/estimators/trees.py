"""Boosted trees, evaluated in NumPy, with calibrated probabilities of the classes.

In each round of boosting, a small tree for each class adds to the logit of that class; the sums
are then calibrated. A feature below all of the training set leads to the same leaves as its
minimum: a motion quieter than any other is no failure. A feature that is missing (NaN in training)
leads to the side of a split that training chose for it; `at` decides all such splits once, for
signals that lack the same features.

All splits of all trees are evaluated together, in place of a walk down each: a split that a frame
passes on the right rules out the leaves on its left, and of those that are left in the end, the
first one is where the walk would have led (C. Lucchese et al., *QuickScorer: A Fast Algorithm to
Rank Documents with Additive Ensembles of Regression Trees*, 2015).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from noiseclassifier.estimators.decision import Probable, calibrate, identity, of_seen_classes
from noiseclassifier.profile import MOST_LEAVES, Profile
from noiseclassifier.recording import folds
from noiseclassifier.signals import Array, Index, Mask, Words

BATCH = 32
"""Frames that are evaluated together: fewer take longer, more take memory and no less time."""
MANY = 10_000
"""Training frames from which several processes train the trees."""
PARTS = 3
"""Parts of the groups; each is left out of the training of some trees, for the calibration."""
UNSEEN = -30.0
"""Prior of a class without training frames."""
NAMING = 3
"""Rounds of boosting of the trees that tell failures from `ok`, for each of those that name one:
these have a small part of the frames."""
TAIL = 1e-3
"""Share of the training frames above the upper bound of a feature."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Trees(Probable):
    """Trees whose leaves are summed up, their calibration, and bounds of the features.

    Trees are in the order of rounds, one for each class in each; their leaves from left to right.
    A tree with fewer splits than others has some that rule nothing out. A frame is on the right of
    a split if its feature exceeds the threshold.
    """

    DIMENSIONS: ClassVar[Mapping[str, int]] = {
        "feature": 2,
        "threshold": 2,
        "left": 3,
        "missing": 2,
        "leaf": 2,
        "prior": 1,
        "calibration": 1,
        "frequency": 1,
        "known": 1,
    }

    feature: Array  # index of the feature of a split, shape (trees, splits)
    threshold: Array  # shape (trees, splits)
    left: Array  # first leaf on the left, and first one that is not, shape (2, trees, splits)
    missing: Array  # 1 where a frame without the feature is on the right, shape (trees, splits)
    leaf: Array  # what a leaf adds to its tree's class, shape (trees, leaves)
    prior: Array  # what classes start from, shape (classes,)

    @classmethod
    def fit(
        cls,
        features: Array,
        targets: Index,
        groups: Words,
        profile: Profile,
        rising: Index | None = None,
    ) -> "Trees":
        """Train trees on all frames, and calibrate them by trees that left a part out."""
        from joblib import Parallel, delayed

        parts = _parts(targets, groups)
        everything = np.arange(len(targets))
        parallel = Parallel(n_jobs=-1 if len(targets) > MANY else 1)
        fitted: list[Trees] = parallel(
            delayed(cls.uncalibrated)(features, targets, train, profile, rising)
            for train in (everything, *(train for train, _ in parts))
        )
        trees, *others = fitted
        seen = [of_seen_classes(targets, train, test) for train, test in parts]
        if not sum(map(len, seen)):
            return trees
        logits = [one.logits(features[own]) for one, own in zip(others, seen, strict=True)]
        truth = targets[np.concatenate(seen)]
        return replace(trees, calibration=calibrate(np.concatenate(logits), truth))

    @classmethod
    def uncalibrated(
        cls,
        features: Array,
        targets: Index,
        train: Index,
        profile: Profile,
        rising: Index | None = None,
    ) -> "Trees":
        """Train trees on some of the frames, without calibration."""
        classes = int(targets.max()) + 1
        splits, leaf, prior = cls._learnt(features, targets, train, profile, rising)
        feature, threshold, missing, *left = splits.reshape(5, -1, profile.leaves - 1)
        return cls(
            feature=feature,
            threshold=threshold,
            left=np.array(left),
            missing=missing,
            leaf=leaf.reshape(-1, profile.leaves),
            prior=prior,
            known=np.nanquantile(_known(features[train]), 1.0 - TAIL, axis=0),
            calibration=identity(classes),
            frequency=np.bincount(targets[train], minlength=classes) / len(train),
            alarm=profile.alarm,
        )

    @staticmethod
    def _learnt(
        features: Array, targets: Index, train: Index, profile: Profile, _: Index | None
    ) -> tuple[Array, Array, Array]:
        """Splits, leaves and prior, as `_boosted` gives them."""
        return _boosted(features, targets, train, int(targets.max()) + 1, profile, profile.rounds)

    def at(self, there: Index) -> "Trees":
        """Trees of frames that lack some of the features."""
        number = self.feature.astype(np.intp)
        place = np.searchsorted(there, number).clip(max=len(there) - 1)
        known = there[place] == number
        # Each feature exceeds the least number, and none the greatest.
        decided = np.finfo(np.float64).max * np.where(self.missing > 0, -1.0, 1.0)
        return replace(
            self,
            feature=np.where(known, place, 0.0),
            threshold=np.where(known, self.threshold, decided),
            known=self.known[there],
        )

    @staticmethod
    def shapes(
        arrays: Mapping[str, Array], profile: Profile, *, features: int, classes: int
    ) -> dict[str, tuple[int, ...]]:
        """Expected shape of each array."""
        trees, leaves = profile.rounds * classes, profile.leaves
        return {
            "feature": (trees, leaves - 1),
            "threshold": (trees, leaves - 1),
            "left": (2, trees, leaves - 1),
            "missing": (trees, leaves - 1),
            "leaf": (trees, leaves),
            "prior": (classes,),
            "calibration": (1 + classes,),
            "frequency": (classes,),
            "known": (features,),
        }

    def logits(self, features: Array) -> Array:
        """Sums of the leaves that frames lead to, and the prior, shape (frames, classes)."""
        found = np.empty((len(features), len(self.prior)))
        for first in range(0, len(features), BATCH):
            few = slice(first, first + BATCH)
            found[few] = self._sums(features[few])
        return found

    def _sums(self, features: Array) -> Array:
        number, threshold, missing, left, leaf, first = self._side_by_side
        values = features.take(number, axis=1)
        right = values > threshold
        if np.isnan(features).any():
            right |= np.isnan(values) & missing
        ruled_out = np.bitwise_or.reduce(right * left, 1)
        place = first + _FIRST.take(np.invert(ruled_out, out=ruled_out))
        sums: Array = np.add.reduceat(leaf.take(place), self._by_class[1], 1)
        sums += self.prior
        return sums

    @cached_property
    def _by_class(self) -> tuple[Index, Index]:
        """Trees that have leaves, and one of each class, class by class; where each class begins.

        The shapes are (trees,) and (classes,).
        """
        classes = len(self.prior)
        kept: Mask = np.any(self.leaf != 0.0, axis=1)
        kept[:classes] = True
        number = np.flatnonzero(kept)
        order: Index = number[np.argsort(number % classes, kind="stable")]
        return order, np.searchsorted(order % classes, np.arange(classes))

    @cached_property
    def _side_by_side(self) -> tuple[Index, Array, Mask, NDArray[np.uint16], Array, Index]:
        """All first splits of the trees that count side by side, and then all second ones."""
        own, _ = self._by_class
        start, stop = self.left[:, own].astype(np.int64)
        bits = ((1 << stop) - (1 << start)).astype(np.uint16)
        trees, leaves = self.leaf[own].shape
        return (
            np.ascontiguousarray(self.feature[own].T.astype(np.intp)),
            np.ascontiguousarray(self.threshold[own].T),
            np.ascontiguousarray(self.missing[own].T > 0),
            np.ascontiguousarray(bits.T),
            self.leaf[own].ravel(),
            leaves * np.arange(trees),
        )


class Detector(Trees):
    """Trees that tell failures from `ok`, and others that name a failure.

    The first class has the trees that tell it from all failures; those of the other classes are
    trained on failures alone, in a third of the rounds of boosting. In the trees of the first
    class, no feature that rises with the level of a fault makes a failure less likely; differences
    of signals, which may fall with it, are free.
    """

    @staticmethod
    def _learnt(
        features: Array, targets: Index, train: Index, profile: Profile, rising: Index | None
    ) -> tuple[Array, Array, Array]:
        classes = int(targets.max()) + 1
        failing = train[targets[train] > 0]
        named = max(1, profile.rounds // NAMING)
        splits, leaf, prior = _boosted(features, targets, failing, classes, profile, named)
        detected = (targets > 0).astype(np.intp)
        ours = _boosted(features, detected, train, 2, profile, profile.rounds, rising)
        splits[:, :, 0], leaf[:, 0], prior[0] = ours[0][:, :, 1], -ours[1][:, 1], -ours[2][1]
        return splits, leaf, prior

    def logits(self, features: Array) -> Array:
        """Logits of the classes, shape (frames, classes).

        With the log odds d of `ok` and the logits n of failures, they are d and
        n - log(sum exp n): then the softmax of all has the odds d of `ok`.
        """
        found = super().logits(features)
        found[:, 1:] -= np.logaddexp.reduce(found[:, 1:], 1, keepdims=True)
        return found


def _first_bits() -> NDArray[np.uint8]:
    """Lowest set bit of each number of 16 bits, shape (65536,); 0 if none is set."""
    numbers = np.arange(1 << MOST_LEAVES)
    first = np.frexp(numbers & -numbers)[1] - 1
    found: NDArray[np.uint8] = np.maximum(first, 0).astype(np.uint8)
    return found


_FIRST = _first_bits()


def _parts(targets: Index, groups: Words) -> list[tuple[Index, Index]]:
    """Training and test frames of each part, as indices."""
    count = min(PARTS, len(set(groups.tolist())))
    parts = folds(groups.tolist(), count) if count > 1 else []
    return [part for part in parts if len(set(targets[part[0]].tolist())) > 1]


def _boosted(
    features: Array,
    targets: Index,
    train: Index,
    classes: int,
    profile: Profile,
    rounds: int,
    rising: Index | None = None,
) -> tuple[Array, Array, Array]:
    """Boosted trees of some of the frames; none in rounds of the profile beyond these."""
    from sklearn.ensemble import HistGradientBoostingClassifier
    from threadpoolctl import threadpool_limits

    shape = profile.rounds, classes, profile.leaves
    splits, leaf = np.zeros((5, *shape[:2], shape[2] - 1)), np.zeros(shape)
    there = np.unique(targets[train])
    prior = np.full(classes, UNSEEN)
    prior[there] = 0.0
    if len(there) < 2:
        return splits, leaf, prior
    boosting = HistGradientBoostingClassifier(
        max_iter=rounds,
        learning_rate=profile.learning_rate,
        max_leaf_nodes=profile.leaves,
        l2_regularization=profile.penalty,
        early_stopping=False,  # it would hold back frames that overlap others
        monotonic_cst=rising,
        random_state=0,
    )
    with threadpool_limits(1):  # a thread that waits for a core keeps all others waiting
        boosting.fit(_known(features[train]), targets[train])
    # Its trees are private attributes; a test compares ours with them. It has none for a class
    # without frames, and of two classes for the second alone.
    learnt = there if len(there) > 2 else there[1:]
    prior[learnt] = boosting._baseline_prediction.ravel()
    for number, trees in enumerate(boosting._predictors):
        for kind, tree in zip(learnt, trees, strict=True):
            rows, values = _lay_out(tree.nodes)
            splits[:, number, kind, : len(rows)] = np.transpose(rows)
            leaf[number, kind, : len(values)] = values
    return splits, leaf, prior


def _known(features: Array) -> Array:
    """Features, 0 where no frame has one: it tells nothing, and scikit-learn cannot bin it."""
    return np.where(np.isnan(features).all(axis=0), 0.0, features)


def _lay_out(nodes: Any) -> tuple[list[list[float]], list[float]]:
    """Splits and leaves of a tree of scikit-learn."""
    splits: list[list[float]] = []
    values: list[float] = []

    def visit(number: int) -> None:
        node = nodes[number]
        if node["is_leaf"]:
            values.append(node["value"])
            return
        right = float(not node["missing_go_to_left"])
        threshold = np.nan_to_num(node["num_threshold"])  # infinite if only missing ones are apart
        split = [node["feature_idx"], float(threshold), right, len(values)]
        splits.append(split)
        visit(node["left"])
        split.append(len(values))
        visit(node["right"])

    visit(0)
    return splits, values
