"""Decisions of the estimators of many points of a grid, trained on shared kernel matrices.

Points that differ in C and gamma alone share the distances between frames, and those that differ in
C alone the kernel matrix, so that a point costs little more than libsvm's own work.
"""

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from itertools import groupby
from typing import NamedTuple

import numpy as np

from noiseclassifier.estimators import ESTIMATORS, svm
from noiseclassifier.estimators.decision import TINY
from noiseclassifier.profile import Profile
from noiseclassifier.tuning.logloss import class_margins
from noiseclassifier.types import Array, Index, Words

LARGEST = 5000
"""Training frames up to which a kernel matrix is kept, 200 MB then; above, libsvm has a cache."""


class Decisions(NamedTuple):
    """Decisions of one point on frames."""

    chosen: Index
    """Class of each, as an index, shape (frames,); of one that is unknown, beyond the classes."""
    margins: Array
    """Margins of the classes, see `logloss`, or logarithms of their probabilities, shape (frames,
    classes)."""


def decide(
    known: Array, targets: Index, groups: Words, fresh: Array, profiles: Sequence[Profile]
) -> Iterator[Decisions]:
    """Train the estimator of each point, and decide on test frames.

    Args:
        known: Training features, shape (frames, features).
        targets: Class of each, as an index from 0 without a gap, shape (frames,).
        groups: Runs of a group share their motion, shape (frames,).
        fresh: Test features, shape (frames, features).
        profiles: Points that share their features; it pays if those of one gamma follow each other.

    Yields:
        The decisions of each point.
    """
    if profiles[0].estimator != "svm" or len(known) > LARGEST:
        for profile in profiles:
            estimator = ESTIMATORS[profile.estimator].fit(known, targets, groups, profile)
            decisions = estimator.decision(fresh)
            chosen = estimator.choose(decisions)
            if profile.estimator == "svm":
                yield Decisions(chosen, _margins(decisions, targets, profile))
            else:
                yield Decisions(chosen, np.log(estimator.score(decisions) + TINY))
        return
    near, far = known @ known.T, fresh @ known.T
    rbf = profiles[0].kernel == "rbf"
    if rbf:  # K(x, y) = exp(-gamma |x - y|^2)
        squares = near.diagonal()
        far = np.einsum("ij,ij->i", fresh, fresh)[:, None] + squares - 2.0 * far
        near = squares[:, None] + squares - 2.0 * near
    for gamma, points in groupby(profiles, key=lambda profile: profile.gamma):
        train, test = (np.exp(-gamma * near), np.exp(-gamma * far)) if rbf else (near, far)
        for profile in points:
            with _unchecked():
                decisions = _decisions(train, test, targets, profile)
            margins = _margins(decisions, targets, profile)
            count = margins.shape[1]
            chosen = svm.choose(decisions, classes=count, multiclass=profile.multiclass)
            yield Decisions(chosen, margins)


def _decisions(train: Array, test: Array, targets: Index, profile: Profile) -> Array:
    """Decision values of SVMs trained on a kernel matrix, shape (frames, decisions)."""
    weights = svm.balance(targets)
    if profile.multiclass == "one-vs-one":
        weighted = dict(enumerate(weights.tolist()))
        fitted = svm.svc(profile, profile.regularization, weighted, precomputed=True)
        decisions: Array = fitted.fit(train, targets).decision_function(test)
        # With two classes, scikit-learn turns the sign so that positive means the second.
        return decisions if decisions.ndim == 2 else -decisions[:, None]
    each = [
        svm.svc(profile, profile.regularization * weight, precomputed=True).fit(
            train, targets == number
        )
        for number, weight in enumerate(weights.tolist())
    ]
    return np.stack([fitted.decision_function(test) for fitted in each], axis=1)


def _unchecked() -> AbstractContextManager[None]:
    """A context without the input checks of scikit-learn, which take a sixth of the time here."""
    from sklearn import config_context

    unchecked: AbstractContextManager[None] = config_context(
        assume_finite=True, skip_parameter_validation=True
    )
    return unchecked


def _margins(decisions: Array, targets: Index, profile: Profile) -> Array:
    return class_margins(decisions, classes=int(targets.max()) + 1, multiclass=profile.multiclass)
