"""Support vector machines, evaluated in NumPy.

Conventions: a machine decides between two sides, and a positive decision means its first one. In
one-vs-one the machines are the pairs (0, 1), (0, 2), …, (1, 2), … of classes; in one-vs-rest there
is one for each class, against all others.
"""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import combinations
from math import isqrt
from typing import Any, Self

import numpy as np

from models.profile import Kernel, Multiclass, Profile
from models.types import Array, Index


@dataclass(frozen=True, eq=False)
class SupportVectorMachines:
    """All two-class machines of a classifier, over the same vectors.

    Attributes:
        vectors: Support vectors, shape (vectors, features); with the linear kernel they may be
            the machines' weights, shape (machines, features).
        coefficients: Weight y_i alpha_i of each vector, shape (machines, vectors).
        intercept: Bias b, shape (machines,).
        kernel: The kernel function.
        gamma: Parameter of the RBF kernel.
        multiclass: How the machines make a choice.
    """

    vectors: Array
    coefficients: Array
    intercept: Array
    kernel: Kernel
    gamma: float
    multiclass: Multiclass

    @property
    def width(self) -> int:
        """Decisions on one frame."""
        return len(self.intercept)

    @property
    def classes(self) -> int:
        """How many classes the machines tell apart."""
        if self.multiclass == "one-vs-rest":
            return self.width
        return (1 + isqrt(1 + 8 * self.width)) // 2

    def choose(self, decisions: Array) -> Index:
        """Choose a class for each frame, see `choose`."""
        return choose(decisions, classes=self.classes, multiclass=self.multiclass)

    def above_threshold(self, decisions: Array) -> None:
        """Leave it at what each frame is called."""

    def novel(self, decisions: Array) -> None:
        """Leave it out: support vector machines have no measure of novelty."""

    def score(self, decisions: Array) -> Array:
        """Grade all classes for each frame, see `score`."""
        return score(decisions, classes=self.classes, multiclass=self.multiclass)

    def arrays(self) -> dict[str, Array]:
        """Give what a model file keeps."""
        return {
            "vectors": self.vectors,
            "coefficients": self.coefficients,
            "intercept": self.intercept,
        }

    def decision(self, features: Array) -> Array:
        """Evaluate every machine, sum y_i alpha_i K(x_i, x) + b (paper, Sec. III-B).

        Args:
            features: Feature vectors, shape (frames, features).

        Returns:
            Decisions, shape (frames, machines).
        """
        similarity = features @ self.vectors.T
        if self.kernel == "rbf":  # K(x, y) = exp(-gamma |x - y|^2)
            squares = np.einsum("ij,ij->i", features, features)[:, None] + self._squares
            similarity = np.exp(-self.gamma * (squares - 2.0 * similarity))
        decisions: Array = similarity @ self.coefficients.T + self.intercept
        return decisions

    def condensed(self) -> Self:
        """Merge the vectors of linear machines into one weight vector for each machine."""
        if self.kernel != "linear":
            return self
        machines = len(self.intercept)
        return replace(
            self, vectors=self.coefficients @ self.vectors, coefficients=np.eye(machines)
        )

    @cached_property
    def _squares(self) -> Array:
        squares: Array = np.einsum("ij,ij->i", self.vectors, self.vectors)
        return squares


def machine_count(classes: int, multiclass: Multiclass) -> int:
    """Say how many two-class machines tell classes apart."""
    return classes * (classes - 1) // 2 if multiclass == "one-vs-one" else classes


def choose(decisions: Array, *, classes: int, multiclass: Multiclass) -> Index:
    """Choose a class for each frame: by votes of the pairs, or by the largest decision.

    Args:
        decisions: Decisions of all machines, shape (frames, machines).
        classes: How many classes there are.
        multiclass: How machines make a choice.

    Returns:
        Index of a class for each frame, shape (frames,); the first of equals.
    """
    ballot = decisions
    if multiclass == "one-vs-one":
        ballot = _votes(decisions, classes)
    chosen: Index = ballot.argmax(axis=1)
    return chosen


def score(decisions: Array, *, classes: int, multiclass: Multiclass) -> Array:
    """Grade all classes for each frame, larger meaning more certain.

    Args:
        decisions: Decisions of all machines, shape (frames, machines).
        classes: How many classes there are.
        multiclass: How machines make a choice.

    Returns:
        Scores, shape (frames, classes). One-vs-rest: the decisions. One-vs-one: votes, and less
        than half a vote for the sum of decisions, as scikit-learn grades (`decision_function` in
        its shape "ovr"); among classes with the same votes, `choose` takes the first.
    """
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
    """Mark the first and the second class of each pair, shape (machines, classes) each."""
    first, second = np.array(list(combinations(range(classes), 2))).T
    unit = np.eye(classes)
    return unit[first], unit[second]


def fit(features: Array, targets: Index, profile: Profile) -> SupportVectorMachines:
    """Learn support vector machines.

    Args:
        features: Feature vectors, shape (frames, features).
        targets: Class of each, as an index from 0 without a gap, shape (frames,).
        profile: Kernel, parameters, and how machines make a choice.

    Returns:
        The machines, with their support vectors.
    """
    fit_machines = _one_vs_one if profile.multiclass == "one-vs-one" else _one_vs_rest
    return fit_machines(features, targets, profile)


def _one_vs_one(features: Array, targets: Index, profile: Profile) -> SupportVectorMachines:
    """Train a machine for each pair of classes, C times N / (classes N_c) for each class."""
    svc = _svc(profile, profile.regularization, dict(enumerate(balance(targets))))
    svc.fit(features, targets)
    pairs = list(combinations(range(len(svc.classes_)), 2))
    stops = np.cumsum(svc.n_support_)
    coefficients = np.zeros((len(pairs), len(svc.support_)))
    for machine, (first, second) in enumerate(pairs):
        # libsvm keeps, for a vector of class i, one row for each other class j in their order.
        for own, other in ((first, second), (second, first)):
            columns = slice(stops[own] - svc.n_support_[own], stops[own])
            row = other - (other > own)
            coefficients[machine, columns] = svc.dual_coef_[row, columns]
    # With two classes, scikit-learn turns the sign so that positive means the second.
    sign = -1.0 if len(pairs) == 1 else 1.0
    return SupportVectorMachines(
        svc.support_vectors_,
        sign * coefficients,
        sign * svc.intercept_,
        profile.kernel,
        profile.gamma,
        profile.multiclass,
    )


def _one_vs_rest(features: Array, targets: Index, profile: Profile) -> SupportVectorMachines:
    """Train a machine for each class, with C_cls = C N / (classes N_cls) (paper, Sec. III-B)."""
    weights = balance(targets)
    coefficients, intercept = np.zeros((len(weights), len(targets))), np.zeros(len(weights))
    for machine, weight in enumerate(weights):
        svc = _svc(profile, profile.regularization * float(weight))
        svc.fit(features, targets == machine)
        coefficients[machine, svc.support_] = svc.dual_coef_[0]
        intercept[machine] = svc.intercept_[0]
    used = np.flatnonzero(coefficients.any(axis=0))
    return SupportVectorMachines(
        features[used],
        coefficients[:, used],
        intercept,
        profile.kernel,
        profile.gamma,
        profile.multiclass,
    )


def balance(targets: Index) -> Array:
    """Weigh classes against their frequency, N / (classes N_c)."""
    counts = np.bincount(targets)
    balance: Array = len(targets) / len(counts) / counts
    return balance


def _svc(profile: Profile, regularization: float, weights: dict[int, float] | None = None) -> Any:
    from sklearn.svm import SVC

    return SVC(
        C=regularization,
        kernel=profile.kernel,
        gamma=profile.gamma,
        class_weight=weights,
        decision_function_shape="ovo",
    )
