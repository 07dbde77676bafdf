"""Estimators: support vector machines, boosted trees, and networks; all evaluated in NumPy.

All have the same methods. `of` makes one from the arrays of a model file, which have the sizes that
``SHAPES`` names. `decision` turns standardised features, shape (frames, features), into decision
values, shape (frames, width), of which the others give the class of each frame (`choose`, an index;
beyond the last is unknown), the frames above the alarm threshold (None: all failures), those that
are out of distribution (`novel`, None: not measured), and the `score` of each class, larger meaning
more certain. ``LEARNT`` are trained by `fit`; the others are of model files of earlier versions.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import combinations
from math import isqrt, log1p
from typing import Any, ClassVar, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from noiseclassifier.profile import MOST_LEAVES, EstimatorKind, Kernel, Multiclass, Profile
from noiseclassifier.recording import folds
from noiseclassifier.signals import Array, Index, Mask, Words

# Size of each axis of arrays by name, or what there are as many of.
Shapes: TypeAlias = Mapping[str, tuple[int | str, ...]]

# --- support vector machines


@dataclass(frozen=True, eq=False)
class SupportVectorMachines:
    """Two-class SVMs over the same vectors, combined for more classes.

    A positive decision value means the first of two classes. In one-vs-one the SVMs are the pairs
    (0, 1), (0, 2), …, (1, 2), … of classes; in one-vs-rest each class is against all others.
    """

    SHAPES: ClassVar[Shapes] = {
        "vectors": ("vectors", "features"),
        "coefficients": ("svms", "vectors"),
        "intercept": ("svms",),
    }

    vectors: Array  # support vectors; if linear, of each SVM alone, its weights
    coefficients: Array  # weight y_i alpha_i of each vector
    intercept: Array  # bias b
    kernel: Kernel
    gamma: float  # of the RBF kernel
    multiclass: Multiclass

    @classmethod
    def fit(cls, features: Array, targets: Index, groups: Words, profile: Profile) -> Self:
        """Train SVMs on all frames, whatever their groups."""
        train = _one_vs_one if profile.multiclass == "one-vs-one" else _one_vs_rest
        vectors, coefficients, intercept = train(features, targets, profile)
        if profile.kernel == "linear":
            vectors, coefficients = coefficients @ vectors, np.eye(len(intercept))
        arrays = {"vectors": vectors, "coefficients": coefficients, "intercept": intercept}
        return cls.of(arrays, profile)

    @classmethod
    def of(cls, arrays: Mapping[str, Array], profile: Profile) -> Self:
        """SVMs from the arrays of a model file."""
        own = {name: arrays[name] for name in cls.SHAPES}
        return cls(**own, kernel=profile.kernel, gamma=profile.gamma, multiclass=profile.multiclass)

    @property
    def width(self) -> int:
        """Decision values of one frame."""
        return len(self.intercept)

    @property
    def classes(self) -> int:
        """How many classes there are."""
        one_vs_rest = self.multiclass == "one-vs-rest"
        return self.width if one_vs_rest else (1 + isqrt(1 + 8 * self.width)) // 2

    def decision(self, features: Array) -> Array:
        """Decision values, sum y_i alpha_i K(x_i, x) + b (paper, Sec. III-B)."""
        similarity = features @ self.vectors.T
        if self.kernel == "rbf":  # K(x, y) = exp(-gamma |x - y|^2)
            squares = np.einsum("ij,ij->i", features, features)[:, None] + self._squares
            similarity = np.exp(-self.gamma * (squares - 2.0 * similarity))
        decisions: Array = similarity @ self.coefficients.T + self.intercept
        return decisions

    @cached_property
    def _squares(self) -> Array:
        squares: Array = np.einsum("ij,ij->i", self.vectors, self.vectors)
        return squares

    def choose(self, decisions: Array) -> Index:
        """Class of each frame, as an index, shape (frames,)."""
        return choose(decisions, classes=self.classes, multiclass=self.multiclass)

    def above_threshold(self, decisions: Array) -> None:
        """None: each frame that is predicted as a failure counts."""

    def novel(self, decisions: Array) -> None:
        """None: support vector machines have no measure of novelty."""

    def score(self, decisions: Array) -> Array:
        """Votes of each class, and how clear they are, or decision values in one-vs-rest."""
        if self.multiclass == "one-vs-rest":
            return decisions
        first, second = _sides(self.classes)
        confidence = decisions @ (first - second)
        return _votes(decisions, self.classes) + confidence / (3.0 * (np.abs(confidence) + 1.0))


def choose(decisions: Array, *, classes: int, multiclass: Multiclass) -> Index:
    """Class of each frame: with most votes of the pairs, or with the largest decision value."""
    ballot = _votes(decisions, classes) if multiclass == "one-vs-one" else decisions
    return np.asarray(ballot.argmax(axis=1))


def _votes(decisions: Array, classes: int) -> Array:
    first, second = _sides(classes)
    votes: Array = (decisions > 0.0) @ first + (decisions <= 0.0) @ second
    return votes


@lru_cache
def _sides(classes: int) -> tuple[Array, Array]:
    """First and second class of each pair, one-hot, shape (svms, classes) each."""
    first, second = np.array(list(combinations(range(classes), 2))).T
    unit = np.eye(classes)
    return unit[first], unit[second]


def _one_vs_one(features: Array, targets: Index, profile: Profile) -> tuple[Array, Array, Array]:
    """Vectors, coefficients and intercepts of an SVM for each pair of classes.

    C is times N / (classes N_c) for each class.
    """
    fitted = svc(profile, profile.regularization, dict(enumerate(balance(targets))))
    fitted.fit(features, targets)
    pairs = list(combinations(range(len(fitted.classes_)), 2))
    stops = np.cumsum(fitted.n_support_)
    coefficients = np.zeros((len(pairs), len(fitted.support_)))
    for svm, (first, second) in enumerate(pairs):
        # libsvm keeps, for a vector of class i, one row for each other class j in their order.
        for own, other in ((first, second), (second, first)):
            columns = slice(stops[own] - fitted.n_support_[own], stops[own])
            row = other - (other > own)
            coefficients[svm, columns] = fitted.dual_coef_[row, columns]
    # With two classes, scikit-learn turns the sign so that positive means the second.
    sign = -1.0 if len(pairs) == 1 else 1.0
    return fitted.support_vectors_, sign * coefficients, sign * fitted.intercept_


def _one_vs_rest(features: Array, targets: Index, profile: Profile) -> tuple[Array, Array, Array]:
    """The same of an SVM for each class, with C_cls = C N / (classes N_cls) (paper, Sec. III-B)."""
    weights = balance(targets)
    coefficients, intercept = np.zeros((len(weights), len(targets))), np.zeros(len(weights))
    for svm, weight in enumerate(weights):
        fitted = svc(profile, profile.regularization * float(weight))
        fitted.fit(features, targets == svm)
        coefficients[svm, fitted.support_] = fitted.dual_coef_[0]
        intercept[svm] = fitted.intercept_[0]
    used = np.flatnonzero(coefficients.any(axis=0))
    return features[used], coefficients[:, used], intercept


def balance(targets: Index) -> Array:
    """Balanced weights of the classes, N / (classes N_c), shape (classes,)."""
    counts = np.bincount(targets)
    balance: Array = len(targets) / len(counts) / counts
    return balance


def svc(
    profile: Profile,
    regularization: float,
    weights: dict[int, float] | None = None,
    *,
    precomputed: bool = False,
) -> Any:
    """scikit-learn's support vector machines, not yet trained."""
    from sklearn.svm import SVC

    return SVC(
        C=regularization,
        kernel="precomputed" if precomputed else profile.kernel,
        gamma=profile.gamma,
        class_weight=weights,
        decision_function_shape="ovo",
    )


# --- estimators with calibrated probabilities

NOVELTY_LIMIT = 2.0  # a frame is out of distribution if its novelty score exceeds this
TINY = 1e-12  # added to a probability before its logarithm
# Least probability of any failure of a frame that is predicted as one: misses cost more.
LIKELY = 0.2


@dataclass(frozen=True, eq=False, kw_only=True)
class Probable(ABC):
    """An estimator that decides by probabilities.

    Its decision values are the logarithm of the probability of each class, and then the novelty
    score: how far the farthest feature lies above nearly all training frames, in standard
    deviations. Out of distribution, a low probability of failure means nothing.
    """

    SHAPES: ClassVar[Shapes]

    calibration: Array  # scale of the logits, then an offset for each class
    frequency: Array  # share of each class in the training frames
    known: Array  # highest value of each feature in nearly all training frames, in the last row
    alarm: float  # alarm threshold: a probability of any failure

    @classmethod
    def of(cls, arrays: Mapping[str, Array], profile: Profile) -> Self:
        """Make an estimator from the arrays of a model file."""
        return cls(**{name: arrays[name] for name in cls.SHAPES}, alarm=profile.alarm)

    @property
    def width(self) -> int:
        """Decision values of one frame."""
        return len(self.calibration)

    @abstractmethod
    def logits(self, features: Array) -> Array:
        """Logits of the classes, not calibrated, shape (frames, classes)."""

    def decision(self, features: Array) -> Array:
        """Probability of each class, and novelty of the frame."""
        decisions = np.empty((len(features), self.width))
        decisions[:, :-1] = calibrated(self.logits(features), self.calibration)
        highest = self.known if self.known.ndim == 1 else self.known[-1]
        np.fmax.reduce(features - highest, 1, out=decisions[:, -1])
        return decisions

    def choose(self, decisions: Array) -> Index:
        """Choose a failure if failures are probable enough, or else `ok`.

        Of the failures it is the one whose probability exceeds its frequency most: a rare class is
        not masked by a frequent one (balanced accuracy weighs them alike).
        """
        logarithms = decisions[:, :-1]
        chosen: Index = 1 + (logarithms[:, 1:] - np.log(self.frequency[1:])).argmax(axis=1)
        chosen[logarithms[:, 0] > log1p(-LIKELY)] = 0
        chosen[self.novel(decisions) & ~self.above_threshold(decisions)] = logarithms.shape[1]
        return chosen

    def above_threshold(self, decisions: Array) -> Mask:
        """Which frames are above the alarm threshold, whatever their novelty, (frames,)."""
        return np.asarray(decisions[:, 0] <= log1p(-self.alarm))

    def novel(self, decisions: Array) -> Mask:
        """Which frames are out of distribution, shape (frames,)."""
        return np.asarray(decisions[:, -1] > NOVELTY_LIMIT)

    def score(self, decisions: Array) -> Array:
        """Probability of each class, shape (frames, classes)."""
        return np.asarray(np.exp(decisions[:, :-1]))


def calibrated(logits: Array, calibration: Array) -> Array:
    """Logarithms of calibrated probabilities: logits scaled, and shifted for each class.

    Vector scaling with one scale for all classes, C. Guo et al., *On Calibration of Modern Neural
    Networks*, 2017, Sec. 4.2.
    """
    scaled = calibration[0] * logits + calibration[1:]
    found: Array = scaled - np.logaddexp.reduce(scaled, -1, keepdims=True)
    return found


def calibrate(logits: Array, targets: Index, weight: Array) -> Array:
    """Calibration of the least log-loss; a class without frames is not shifted."""
    from scipy.optimize import minimize

    there, truth = np.unique(targets, return_inverse=True)
    classes, rows = logits.shape[1], np.arange(len(targets))
    logits, share = logits.take(there, axis=1), weight / weight.sum()

    def loss(calibration: Array) -> tuple[float, Array]:
        found = calibrated(logits, calibration)
        excess = np.exp(found)
        excess[rows, truth] -= 1.0
        excess *= share[:, None]
        slope = np.append((excess * logits).sum(), excess.sum(axis=0))
        return float(-found[rows, truth] @ share), slope

    calibration = _identity(classes)
    best = minimize(loss, _identity(len(there)), jac=True, method="L-BFGS-B").x
    calibration[[0, *(1 + there)]] = best
    return calibration


def _identity(classes: int) -> Array:
    """The calibration that changes nothing, shape (1 + classes,)."""
    return np.append(1.0, np.zeros(classes))


@dataclass(frozen=True, eq=False, kw_only=True)
class Networks(Probable):
    """Networks with one hidden layer, of model files of earlier versions.

    Known are the lowest and the highest value of each feature. Features below nearly all of the
    training set are raised to the lowest: a motion that is quieter than any other is no failure.
    """

    SHAPES: ClassVar[Shapes] = {
        "hidden": ("networks", "features", "units"),
        "hidden_bias": ("networks", "units"),
        "output": ("networks", "units", "classes"),
        "output_bias": ("networks", "classes"),
        "calibration": ("1 + classes",),
        "frequency": ("classes",),
        "known": (2, "features"),
    }

    hidden: Array  # weights to the hidden layers
    hidden_bias: Array
    output: Array  # weights to the classes
    output_bias: Array

    def logits(self, features: Array) -> Array:
        """Logarithms of the mean probabilities of all networks, shape (frames, classes)."""
        # A product for each frame: the rounding of one for all depends on how many they are.
        inputs = np.maximum(features, self.known[0])[:, None, None]
        hidden = np.maximum(inputs @ self.hidden + self.hidden_bias[:, None], 0.0)
        logits = (hidden @ self.output + self.output_bias[:, None])[:, :, 0]
        each = np.exp(logits - np.logaddexp.reduce(logits, -1, keepdims=True))
        return np.asarray(np.log(each.mean(axis=1) + TINY))


# --- boosted trees
#
# In each round of boosting, a small tree for each class adds to the logit of that class; the sums
# are then calibrated. A feature below all of the training set leads to the same leaves as its
# minimum: a motion quieter than any other is no failure. A feature that is missing (NaN in
# training) leads to the side of a split that training chose for it; `at` decides all such splits
# once, for signals that lack the same features.
#
# All splits of all trees are evaluated together, in place of a walk down each: a split that a frame
# passes on the right rules out the leaves on its left, and of those that are left in the end, the
# first one is where the walk would have led (C. Lucchese et al., *QuickScorer: A Fast Algorithm to
# Rank Documents with Additive Ensembles of Regression Trees*, 2015).

# Frames that are evaluated together: fewer take longer, more take memory and no less time.
BATCH = 32
MANY = 10_000  # training frames from which several processes train the trees
# Parts of the groups; each is left out of the training of some trees, for the calibration.
PARTS = 3
UNSEEN = -30.0  # prior of a class without training frames
# Rounds of boosting of the trees that tell failures from `ok`, for each of those that name one:
# these have a small part of the frames.
NAMING = 3
# Factor of the leaves of each tree, and penalty on their squares.
LEARNING_RATE, PENALTY = 0.15, 1.0
TAIL = 1e-3  # share of the training frames above the upper bound of a feature


@dataclass(frozen=True, eq=False, kw_only=True)
class Trees(Probable):
    """Trees whose leaves are summed up, their calibration, and bounds of the features.

    Trees are in the order of rounds, one for each class in each; their leaves from left to right.
    A tree with fewer splits than others has some that rule nothing out. A frame is on the right of
    a split if its feature exceeds the threshold.
    """

    SHAPES: ClassVar[Shapes] = {
        "feature": ("trees", "splits"),
        "threshold": ("trees", "splits"),
        "left": (2, "trees", "splits"),
        "missing": ("trees", "splits"),
        "leaf": ("trees", "leaves"),
        "prior": ("classes",),
        "calibration": ("1 + classes",),
        "frequency": ("classes",),
        "known": ("features",),
    }

    feature: Array  # index of the feature of a split
    threshold: Array
    left: Array  # first leaf on the left, and first one that is not
    missing: Array  # 1 where a frame without the feature is on the right
    leaf: Array  # what a leaf adds to its tree's class
    prior: Array  # what classes start from

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

    def logits(self, features: Array) -> Array:
        """Sums of the leaves that frames lead to, and the prior, shape (frames, classes)."""
        number, threshold, missing, left, leaf, leaves, begins = self._side_by_side
        found = np.empty((len(features), len(self.prior)))
        for first in range(0, len(features), BATCH):
            few = slice(first, first + BATCH)
            values = features[few].take(number, axis=1)
            right = values > threshold
            if np.isnan(features[few]).any():
                right |= np.isnan(values) & missing
            ruled_out = np.bitwise_or.reduce(right * left, 1)
            place = leaves + _FIRST.take(np.invert(ruled_out, out=ruled_out))
            found[few] = np.add.reduceat(leaf.take(place), begins, 1)
            found[few] += self.prior
        return found

    @cached_property
    def _side_by_side(self) -> tuple[Index, Array, Mask, NDArray[np.uint16], Array, Index, Index]:
        """All first splits of the trees that count side by side, and then all second ones.

        These are the trees that have leaves, and one of each class, class by class; the last array
        has where each class begins, shape (classes,).
        """
        classes = len(self.prior)
        kept: Mask = np.any(self.leaf != 0.0, axis=1)
        kept[:classes] = True
        number = np.flatnonzero(kept)
        own = number[np.argsort(number % classes, kind="stable")]
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
            np.searchsorted(own % classes, np.arange(classes)),
        )


class Detector(Trees):
    """Trees that tell failures from `ok`, and others that name a failure.

    The first class has the trees that tell it from all failures; those of the other classes are
    trained on failures alone, in a third of the rounds of boosting. In the trees of the first
    class, no feature that rises with the level of a fault makes a failure less likely; differences
    of signals, which may fall with it, are free.
    """

    @classmethod
    def fit(
        cls,
        features: Array,
        targets: Index,
        groups: Words,
        profile: Profile,
        rising: Index | None = None,
        weight: Array | None = None,
    ) -> Self:
        """Train trees on weighted frames, and calibrate them by trees that left a part out."""
        from joblib import Parallel, delayed

        parts = _parts(targets, groups)
        everything = np.arange(len(targets))
        parallel = Parallel(n_jobs=-1 if len(targets) > MANY else 1)
        fitted: list[Self] = parallel(
            delayed(cls.uncalibrated)(features, targets, train, profile, rising, weight)
            for train in (everything, *(train for train, _ in parts))
        )
        trees, *others = fitted
        # Only frames whose class is in the training set can calibrate.
        seen = [test[np.isin(targets[test], targets[train])] for train, test in parts]
        if not sum(map(len, seen)):
            return trees
        logits = [one.logits(features[own]) for one, own in zip(others, seen, strict=True)]
        own = np.concatenate(seen)
        counts = np.ones(len(own)) if weight is None else weight[own]
        calibration = calibrate(np.concatenate(logits), targets[own], counts)
        return replace(trees, calibration=calibration)

    @classmethod
    def uncalibrated(
        cls,
        features: Array,
        targets: Index,
        train: Index,
        profile: Profile,
        rising: Index | None = None,
        weight: Array | None = None,
    ) -> Self:
        """Train trees on some of the frames, without calibration."""
        classes = int(targets.max()) + 1
        failing = train[targets[train] > 0]
        named = max(1, profile.rounds // NAMING)
        splits, leaf, prior = _boosted(features, targets, failing, classes, profile, named)
        detected = (targets > 0).astype(np.intp)
        split, fall, odds = _boosted(
            features, detected, train, 2, profile, profile.rounds, rising, weight
        )
        splits[:, :, 0], leaf[:, 0], prior[0] = split[:, :, 1], -fall[:, 1], odds[0] - odds[1]
        feature, threshold, missing, *left = splits.reshape(5, -1, profile.leaves - 1)
        return cls(
            feature=feature,
            threshold=threshold,
            left=np.array(left),
            missing=missing,
            leaf=leaf.reshape(-1, profile.leaves),
            prior=prior,
            known=np.nanquantile(_known(features[train]), 1.0 - TAIL, axis=0),
            calibration=_identity(classes),
            frequency=np.bincount(targets[train], minlength=classes) / len(train),
            alarm=profile.alarm,
        )

    def logits(self, features: Array) -> Array:
        """Logits of the classes, shape (frames, classes).

        With the log odds d of `ok` and the logits n of failures, they are d and
        n - log(sum exp n): then the softmax of all has the odds d of `ok`.
        """
        found = super().logits(features)
        found[:, 1:] -= np.logaddexp.reduce(found[:, 1:], 1, keepdims=True)
        return found


_NUMBERS = np.arange(1 << MOST_LEAVES)
# Lowest set bit of each number of 16 bits, shape (65536,); 0 if none is set.
_FIRST = np.maximum(np.frexp(_NUMBERS & -_NUMBERS)[1] - 1, 0).astype(np.uint8)


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
    weight: Array | None = None,
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
        learning_rate=LEARNING_RATE,
        max_leaf_nodes=profile.leaves,
        l2_regularization=PENALTY,
        early_stopping=False,  # it would hold back frames that overlap others
        monotonic_cst=rising,
        random_state=0,
    )
    with threadpool_limits(1):  # a thread that waits for a core keeps all others waiting
        own = None if weight is None else weight[train]
        boosting.fit(_known(features[train]), targets[train], sample_weight=own)
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


Estimator: TypeAlias = SupportVectorMachines | Networks | Trees

# Class of each estimator, by the name that profiles have for it.
ESTIMATORS: Mapping[EstimatorKind, type[Estimator]] = {
    "svm": SupportVectorMachines,
    "networks": Networks,
    "trees": Trees,
    "detector": Detector,
}
# Those that can be trained.
LEARNT: Mapping[EstimatorKind, type[SupportVectorMachines | Detector]] = {
    "svm": SupportVectorMachines,
    "detector": Detector,
}
