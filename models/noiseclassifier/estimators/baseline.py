"""The baseline: the distance of a frame from the nearest of a k-center subset of good frames.

Features below all of the training set are raised to its minimum, and that minimum, silence, is
part of the subset: a motion with less noise than all others is no anomaly.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, NoReturn, Self

import numpy as np

from noiseclassifier.errors import ProfileError
from noiseclassifier.labels import ANOMALY
from noiseclassifier.logbands import GENERAL, SCALAR, LogBands
from noiseclassifier.profile import Profile
from noiseclassifier.types import Array, Index, Words

CLASSES = ("ok", ANOMALY)
"""A baseline learns from good runs alone, so that it names no failure."""

MOTION: LogBands = replace(
    GENERAL, classes=CLASSES, estimator="baseline", relative=False, quick=0.0
)
"""For runs with measured and desired motion. Levels are absolute: it is one robot, whose own level
matters."""
NOISE_ALONE: LogBands = replace(
    SCALAR, classes=CLASSES, estimator="baseline", relative=False, quick=0.0
)
"""For the noise alone."""

CENTRES = 100
"""Size of the k-center subset."""
TINY = 1e-12
"""Smallest distance that counts as more than none."""


@dataclass(frozen=True, eq=False)
class Baseline:
    """A k-center subset of good frames, and the limit of the distance from it.

    Attributes:
        good: Features of the subset, silence first, shape (1 + centres, features).
        limit: The distance beyond which a frame is an anomaly, shape (1,).
    """

    DIMENSIONS: ClassVar[Mapping[str, int]] = {"good": 2, "limit": 1}

    good: Array
    limit: Array

    @classmethod
    def fit(cls, features: Array, targets: Index, groups: Words, profile: Profile) -> NoReturn:
        """Refuse: a baseline has no classes to learn; `noiseclassifier.learn_baseline` trains it.

        Raises:
            ProfileError: Always.
        """
        raise ProfileError("a baseline learns from good runs alone: call models.learn_baseline")

    @classmethod
    def of(cls, arrays: Mapping[str, Array], profile: Profile) -> Self:
        """Make a baseline from the arrays of a model file."""
        return cls(**{name: arrays[name] for name in cls.DIMENSIONS})

    @staticmethod
    def shapes(
        arrays: Mapping[str, Array], profile: Profile, *, features: int, classes: int
    ) -> dict[str, tuple[int, ...]]:
        """Expected shape of each array; there may be any number of centres."""
        return {"good": (max(len(arrays["good"]), 1), features), "limit": (1,)}

    @staticmethod
    def highest(profile: Profile, *, features: int) -> dict[str, int]:
        """No array holds indices."""
        return {}

    @property
    def width(self) -> int:
        """Decision values of one frame."""
        return 1

    def decision(self, features: Array) -> Array:
        """Distance of frames from good motion, in limits.

        Args:
            features: Feature vectors, standardised, shape (frames, features).

        Returns:
            Distances, 1 at the limit, shape (frames, 1).
        """
        limit = np.maximum(self.limit, TINY)
        return distance(features, self.good)[:, None] / limit

    def choose(self, decisions: Array) -> Index:
        """Class of each frame, shape (frames,): `ok` (0), or an anomaly (1) beyond the limit."""
        beyond: Index = (decisions[:, 0] > 1.0).astype(np.intp)
        return beyond

    def above_threshold(self, decisions: Array) -> None:
        """None: the limit is set for single frames."""

    def novel(self, decisions: Array) -> None:
        """Leave it out: an anomaly is what is out of distribution."""

    def score(self, decisions: Array) -> Array:
        """Score of both classes: of `ok` always 1, of an anomaly its distance in limits.

        Args:
            decisions: What `decision` gave.

        Returns:
            Shape (frames, 2); these are no probabilities.
        """
        return np.hstack((np.ones_like(decisions), decisions))

    def arrays(self) -> dict[str, Array]:
        """Arrays for a model file, by name."""
        return {"good": self.good, "limit": self.limit}


def distance(features: Array, good: Array) -> Array:
    """Distance of frames from the nearest of a subset of good ones.

    Args:
        features: Feature vectors, shape (frames, features).
        good: What `k_centers` gave, shape (1 + centres, features).

    Returns:
        Root mean square of the differences, shape (frames,), in deviations.
    """
    raised = np.maximum(features, good[0])
    # |x - g|^2 = |x|^2 + |g|^2 - 2 x g, with a product for each frame: the rounding of one for all
    # depends on how many they are.
    product = np.einsum("ij,ij->i", good, good) - 2.0 * (raised[:, None] @ good.T)[:, 0]
    nearest = product.min(axis=1) + np.einsum("ij,ij->i", raised, raised)
    root: Array = np.sqrt(np.maximum(nearest, 0.0) / features.shape[1])
    return root


def k_centers(features: Array, count: int = CENTRES) -> Array:
    """A k-center subset: each next frame is the farthest from those before.

    The largest distance of a frame from the subset is at most twice the least that as many frames
    can have (T. F. Gonzalez, *Clustering to Minimize the Maximum Intercluster Distance*, 1985).

    Args:
        features: Feature vectors, standardised, shape (frames, features).
        count: Frames of the subset.

    Returns:
        Silence, which is the minimum of each feature, and the subset, the frame nearest to the
        mean first, shape (1 + centres, features).
    """
    chosen = [int(np.square(features).sum(axis=1).argmin())]
    nearest = _squares(features, chosen[-1])
    while len(chosen) < count and nearest.max() > TINY:
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, _squares(features, chosen[-1]))
    return np.vstack((features.min(axis=0), features[chosen]))


def _squares(features: Array, centre: int) -> Array:
    """Squared distance of frames from one of them, shape (frames,)."""
    apart = features - features[centre]
    squares: Array = np.einsum("ij,ij->i", apart, apart)
    return squares
