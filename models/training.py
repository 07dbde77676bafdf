"""Train machines with scikit-learn: support vector machines (libsvm) here."""

from importlib import metadata
from itertools import combinations
from typing import Any

import numpy as np

from models.machine import Machine
from models.networktraining import fit_networks
from models.profile import Profile
from models.svm import Machines
from models.treetraining import fit_trees
from models.types import Array, Index, Words


def learn(features: Array, targets: Index, groups: Words, profile: Profile) -> Machine:
    """Learn what a profile asks for.

    Args:
        features: Feature vectors, shape (frames, features).
        targets: Class of each, as an index from 0 without a gap, shape (frames,).
        groups: What each shares its motion with, shape (frames,).
        profile: What decides, its parameters, and how machines make a choice.

    Returns:
        The machines.
    """
    if profile.machine == "networks":
        return fit_networks(features, targets, groups, profile)
    if profile.machine == "trees":
        return fit_trees(features, targets, groups, profile)
    return fit(features, targets, profile).condensed()


def fit(features: Array, targets: Index, profile: Profile) -> Machines:
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


def versions() -> dict[str, str]:
    """Name the software that a model is trained with."""
    import sklearn

    try:
        own = metadata.version("noise-inspector")
    except metadata.PackageNotFoundError:
        own = "not installed"
    return {"noise-inspector": own, "numpy": np.__version__, "scikit-learn": sklearn.__version__}


def _one_vs_one(features: Array, targets: Index, profile: Profile) -> Machines:
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
    return Machines(
        svc.support_vectors_,
        sign * coefficients,
        sign * svc.intercept_,
        profile.kernel,
        profile.gamma,
        profile.multiclass,
    )


def _one_vs_rest(features: Array, targets: Index, profile: Profile) -> Machines:
    """Train a machine for each class, with C_cls = C N / (classes N_cls) (paper, Sec. III-B)."""
    weights = balance(targets)
    coefficients, intercept = np.zeros((len(weights), len(targets))), np.zeros(len(weights))
    for machine, weight in enumerate(weights):
        svc = _svc(profile, profile.regularization * float(weight))
        svc.fit(features, targets == machine)
        coefficients[machine, svc.support_] = svc.dual_coef_[0]
        intercept[machine] = svc.intercept_[0]
    used = np.flatnonzero(coefficients.any(axis=0))
    return Machines(
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
