"""Two-class support vector machines, evaluated in NumPy, and their combination for more classes.

Conventions: a positive decision value of an SVM means the first of its two classes. In
one-vs-one the SVMs are the pairs (0, 1), (0, 2), …, (1, 2), … of classes; in one-vs-rest there
is one for each class, against all others.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import combinations
from math import isqrt
from typing import Any, ClassVar, Self

import numpy as np

from noiseclassifier.profile import Kernel, Multiclass, Profile
from noiseclassifier.signals import Array, Index, Words


@dataclass(frozen=True, eq=False)
class SupportVectorMachines:
    """All SVMs of a classifier, over the same vectors."""

    DIMENSIONS: ClassVar[Mapping[str, int]] = {"vectors": 2, "coefficients": 2, "intercept": 1}

    vectors: Array  # shape (vectors, features); if linear, of each SVM alone, its weights
    coefficients: Array  # weight y_i alpha_i of each vector, shape (svms, vectors)
    intercept: Array  # bias b, shape (svms,)
    kernel: Kernel
    gamma: float  # of the RBF kernel
    multiclass: Multiclass

    @classmethod
    def fit(
        cls, features: Array, targets: Index, groups: Words, profile: Profile
    ) -> "SupportVectorMachines":
        """Train SVMs on all frames, whatever their groups; see `fit`."""
        return fit(features, targets, profile).condensed()

    @classmethod
    def of(cls, arrays: Mapping[str, Array], profile: Profile) -> Self:
        """SVMs from the arrays of a model file."""
        return cls(
            **{name: arrays[name] for name in cls.DIMENSIONS},
            kernel=profile.kernel,
            gamma=profile.gamma,
            multiclass=profile.multiclass,
        )

    @staticmethod
    def shapes(
        arrays: Mapping[str, Array], profile: Profile, *, features: int, classes: int
    ) -> dict[str, tuple[int, ...]]:
        """Expected shape of each array; there may be any number of support vectors."""
        pairs = classes * (classes - 1) // 2
        svms = pairs if profile.multiclass == "one-vs-one" else classes
        vectors = len(arrays["vectors"])
        return {
            "vectors": (vectors, features),
            "coefficients": (svms, vectors),
            "intercept": (svms,),
        }

    @property
    def width(self) -> int:
        """Decision values of one frame."""
        return len(self.intercept)

    @property
    def classes(self) -> int:
        """How many classes there are."""
        if self.multiclass == "one-vs-rest":
            return self.width
        return (1 + isqrt(1 + 8 * self.width)) // 2

    def choose(self, decisions: Array) -> Index:
        """Class of each frame, as an index, shape (frames,); see `choose`."""
        return choose(decisions, classes=self.classes, multiclass=self.multiclass)

    def above_threshold(self, decisions: Array) -> None:
        """None: each frame that is predicted as a failure counts."""

    def novel(self, decisions: Array) -> None:
        """Leave it out: support vector machines have no measure of novelty."""

    def score(self, decisions: Array) -> Array:
        """Score of each class, shape (frames, classes); see `score`."""
        return score(decisions, classes=self.classes, multiclass=self.multiclass)

    def arrays(self) -> dict[str, Array]:
        """Arrays for a model file, by name."""
        return {name: getattr(self, name) for name in self.DIMENSIONS}

    def decision(self, features: Array) -> Array:
        """Decision values, sum y_i alpha_i K(x_i, x) + b (paper, Sec. III-B)."""
        similarity = features @ self.vectors.T
        if self.kernel == "rbf":  # K(x, y) = exp(-gamma |x - y|^2)
            squares = np.einsum("ij,ij->i", features, features)[:, None] + self._squares
            similarity = np.exp(-self.gamma * (squares - 2.0 * similarity))
        decisions: Array = similarity @ self.coefficients.T + self.intercept
        return decisions

    def condensed(self) -> Self:
        """The same SVMs, each linear one as a single weight vector."""
        if self.kernel != "linear":
            return self
        svms = len(self.intercept)
        return replace(self, vectors=self.coefficients @ self.vectors, coefficients=np.eye(svms))

    @cached_property
    def _squares(self) -> Array:
        squares: Array = np.einsum("ij,ij->i", self.vectors, self.vectors)
        return squares


def choose(decisions: Array, *, classes: int, multiclass: Multiclass) -> Index:
    """Class of each frame: with most votes of the pairs, or with the largest decision value."""
    ballot = _votes(decisions, classes) if multiclass == "one-vs-one" else decisions
    return np.asarray(ballot.argmax(axis=1))


def score(decisions: Array, *, classes: int, multiclass: Multiclass) -> Array:
    """Score of each class, larger meaning more certain."""
    if multiclass == "one-vs-rest":
        return decisions
    first, second = _sides(classes)
    confidence = decisions @ (first - second)
    return _votes(decisions, classes) + confidence / (3.0 * (np.abs(confidence) + 1.0))


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


def fit(features: Array, targets: Index, profile: Profile) -> SupportVectorMachines:
    """Train support vector machines."""
    one_vs_one = profile.multiclass == "one-vs-one"
    found = (_one_vs_one if one_vs_one else _one_vs_rest)(features, targets, profile)
    return SupportVectorMachines(*found, profile.kernel, profile.gamma, profile.multiclass)


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
