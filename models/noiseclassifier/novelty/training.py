"""Training of a baseline, on good runs alone."""

from dataclasses import asdict, dataclass
from math import isfinite

import numpy as np

from noiseclassifier.classifier import Classifier
from noiseclassifier.errors import DatasetError, ProfileError
from noiseclassifier.estimators.baseline import Baseline, distance, k_centers
from noiseclassifier.features import standard
from noiseclassifier.modelfile import versions
from noiseclassifier.novelty.frames import GoodMotion, parts
from noiseclassifier.novelty.limit import Limit, limit
from noiseclassifier.profile import Profile
from noiseclassifier.types import Array

LEAST = 5.0
"""Least good motion, in [s]."""


@dataclass(frozen=True, eq=False)
class Learnt:
    """A model learnt from good runs alone, and facts of its training set.

    Attributes:
        classifier: The model.
        limit: The limit, and what it follows from.
        runs: Training recordings.
        groups: Groups of them that share their motion; 1 means that parts of one run were left
            out in place of runs.
        annotated: Recordings of which only what is annotated `ok` was taken.
    """

    classifier: Classifier
    limit: Limit
    runs: int
    groups: int
    annotated: int

    def __str__(self) -> str:
        lines = [
            f"learnt from {self.limit.hours:.3g} h of good motion in {_many(self.runs, 'run')}"
        ]
        if self.annotated:
            annotated = _many(self.annotated, "run")
            lines.append(f"of {annotated} with annotations, the part annotated `ok` alone")
        if self.groups == 1:
            lines.append(
                "its parts were left out in turn, which does not show how much another run differs"
            )
        return "\n".join([*lines, str(self.limit)])


def learn_baseline(good: GoodMotion, profile: Profile, *, alarms: float = 1.0) -> Learnt:
    """Train a baseline; its limit follows from cross-validation.

    Args:
        good: Good motion, cut by the same profile.
        profile: What to compute: ``MOTION`` or ``NOISE_ALONE`` at some rate.
        alarms: False-alarm budget, per hour of good motion.

    Returns:
        The baseline; equal input gives an equal one.

    Raises:
        ProfileError: If the alarms are not above 0.
        DatasetError: If there is too little good motion.
    """
    check(good, alarms, LEAST)
    found = limit(_unseen(good, profile), good, alarms)
    mean, scale = standard(good.features, profile)
    estimator = Baseline(k_centers((good.features - mean) / scale), np.array([found.distance]))
    groups = len(set(good.groups.tolist()))
    metrics = {"baseline": {**asdict(found), "groups": groups, "runs": len(good.hashes)}}
    classifier = Classifier(
        profile, profile.classes, estimator, mean, scale, dict(good.hashes), metrics, versions()
    )
    return Learnt(classifier, found, len(good.hashes), groups, len(good.annotated))


def check(good: GoodMotion, alarms: float, least: float) -> None:
    """Check a false-alarm budget, per hour, and that there is enough good motion, in [s].

    Raises:
        ProfileError: If the alarms are not above 0.
        DatasetError: If there is too little good motion.
    """
    if not (isfinite(alarms) and alarms > 0):
        raise ProfileError(f"{alarms:g} alarms per hour, expected more than 0: say, 1")
    if good.seconds < least:
        raise DatasetError(
            f"{good.seconds:.3g} s of good motion are too short to learn from, expected {least:g} s"
            " or more: give longer runs, or more of them"
        )


def _unseen(good: GoodMotion, profile: Profile) -> Array:
    """Distance of each frame from the good motion of all other parts, shape (frames,)."""
    apart = np.zeros(len(good))
    for train, test in parts(good):
        mean, scale = standard(good.features[train], profile)
        centres = k_centers((good.features[train] - mean) / scale)
        apart[test] = distance((good.features[test] - mean) / scale, centres)
    return apart


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
