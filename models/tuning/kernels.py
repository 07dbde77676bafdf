"""What the machines of many points of a grid say, trained on kernel matrices that they share.

Points that differ in C and gamma alone share the distances between frames, and those that differ in
C alone the kernel matrix, so that a point costs little more than libsvm's own work.
"""

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from itertools import groupby
from typing import NamedTuple

import numpy as np

from models.estimators import svm
from models.estimators.calibration import TINY
from models.estimators.estimator import ESTIMATORS
from models.profile import Profile
from models.tuning.logloss import grades
from models.types import Array, Index, Words

LARGEST = 5000
"""Frames to learn from up to which a kernel matrix is kept, 200 MB then; above, libsvm keeps what
it needs of its own."""


class Answer(NamedTuple):
    """What the machines of a point say of frames."""

    chosen: Index
    """Class of each, as an index, shape (frames,); of one that is unknown, beyond the classes."""
    graded: Array
    """Grades of the classes, see `logloss`, or logarithms of their probabilities, shape (frames,
    classes)."""


def answers(
    known: Array, targets: Index, groups: Words, fresh: Array, profiles: Sequence[Profile]
) -> Iterator[Answer]:
    """Train the machines of each point, and ask them.

    Args:
        known: Feature vectors to learn from, shape (frames, features).
        targets: Class of each, as an index from 0 without a gap, shape (frames,).
        groups: What each shares its motion with, shape (frames,).
        fresh: Feature vectors to ask about, shape (frames, features).
        profiles: Points that share their features; it pays if those of one gamma follow each other.

    Yields:
        The answer of each point.
    """
    if profiles[0].estimator != "svm" or len(known) > LARGEST:
        for profile in profiles:
            estimator = ESTIMATORS[profile.estimator].fit(known, targets, groups, profile)
            decisions = estimator.decision(fresh)
            chosen = estimator.choose(decisions)
            if profile.estimator == "svm":
                yield Answer(chosen, _graded(decisions, targets, profile))
            else:
                yield Answer(chosen, np.log(estimator.score(decisions) + TINY))
        return
    near, far = known @ known.T, fresh @ known.T
    rbf = profiles[0].kernel == "rbf"
    if rbf:  # K(x, y) = exp(-gamma |x - y|^2)
        squares = near.diagonal()
        far = np.einsum("ij,ij->i", fresh, fresh)[:, None] + squares - 2.0 * far
        near = squares[:, None] + squares - 2.0 * near
    for gamma, points in groupby(profiles, key=lambda profile: profile.gamma):
        learnt, asked = (np.exp(-gamma * near), np.exp(-gamma * far)) if rbf else (near, far)
        for profile in points:
            with _unchecked():
                decisions = _decisions(learnt, asked, targets, profile)
            graded = _graded(decisions, targets, profile)
            count = graded.shape[1]
            chosen = svm.choose(decisions, classes=count, multiclass=profile.multiclass)
            yield Answer(chosen, graded)


def _decisions(learnt: Array, asked: Array, targets: Index, profile: Profile) -> Array:
    """Do on kernel matrices what `training` does on features, shape (frames, machines)."""
    weights = svm.balance(targets)
    if profile.multiclass == "one-vs-one":
        weighted = dict(enumerate(weights.tolist()))
        fitted = svm.svc(profile, profile.regularization, weighted, precomputed=True)
        decisions: Array = fitted.fit(learnt, targets).decision_function(asked)
        # With two classes, scikit-learn turns the sign so that positive means the second.
        return decisions if decisions.ndim == 2 else -decisions[:, None]
    each = [
        svm.svc(profile, profile.regularization * weight, precomputed=True).fit(
            learnt, targets == machine
        )
        for machine, weight in enumerate(weights.tolist())
    ]
    return np.stack([fitted.decision_function(asked) for fitted in each], axis=1)


def _unchecked() -> AbstractContextManager[None]:
    """Spare scikit-learn its checks of what it gets, which take a sixth of the time here."""
    from sklearn import config_context

    spared: AbstractContextManager[None] = config_context(
        assume_finite=True, skip_parameter_validation=True
    )
    return spared


def _graded(decisions: Array, targets: Index, profile: Profile) -> Array:
    return grades(decisions, classes=int(targets.max()) + 1, multiclass=profile.multiclass)
