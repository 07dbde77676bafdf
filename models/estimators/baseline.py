"""The baseline: what good motion sounds like, and how far a frame is from it.

A hundred frames of good runs stand for all of them. A frame is as far from good motion as from the
one of these that it resembles most. What lies below all that is known is taken for the least that
is, and that least, silence, is good too: a motion quieter than any other is no failure.
"""

from dataclasses import dataclass, replace

import numpy as np

from models.labels import ANOMALY
from models.logbands import GENERAL, SCALAR, LogBands
from models.types import Array, Index

CLASSES = ("ok", ANOMALY)
"""A baseline knows no failure, so that it cannot name one."""

MOTION: LogBands = replace(
    GENERAL, classes=CLASSES, estimator="baseline", relative=False, quick=0.0
)
"""For runs with measured and desired motion. Levels stay as they are: it is one robot, and how
loud it is matters."""
NOISE_ALONE: LogBands = replace(
    SCALAR, classes=CLASSES, estimator="baseline", relative=False, quick=0.0
)
"""For the noise alone."""

CENTRES = 100
"""Frames that stand for all good ones."""
TINY = 1e-12
"""Distances are told from none above this."""


@dataclass(frozen=True, eq=False)
class Baseline:
    """Frames of good motion, and how far from them is too far.

    Attributes:
        good: Features of frames that stand for all good ones, silence first, shape
            (centres, features).
        limit: The distance from which a frame departs from good motion, shape (1,).
    """

    good: Array
    limit: Array

    @property
    def width(self) -> int:
        """Decisions on one frame."""
        return 1

    def decision(self, features: Array) -> Array:
        """Say how far frames are from good motion, in limits.

        Args:
            features: Feature vectors, standardised, shape (frames, features).

        Returns:
            Distances, 1 at the limit, shape (frames, 1).
        """
        limit = np.maximum(self.limit, TINY)
        return distance(features, self.good)[:, None] / limit

    def choose(self, decisions: Array) -> Index:
        """Call what is beyond the limit a departure (1), and all else `ok` (0)."""
        beyond: Index = (decisions[:, 0] > 1.0).astype(np.intp)
        return beyond

    def above_threshold(self, decisions: Array) -> None:
        """Leave it at what each frame is called: the limit is set for single frames."""

    def novel(self, decisions: Array) -> None:
        """Leave it out: an anomaly is what is out of distribution."""

    def score(self, decisions: Array) -> Array:
        """Grade both classes: `ok` always 1, a departure by its distance in limits.

        Args:
            decisions: What `decision` gave.

        Returns:
            Shape (frames, 2); these are no probabilities.
        """
        return np.hstack((np.ones_like(decisions), decisions))

    def arrays(self) -> dict[str, Array]:
        """Give what a model file keeps."""
        return {"good": self.good, "limit": self.limit}


def distance(features: Array, good: Array) -> Array:
    """Say how far frames are from the good one that each resembles most.

    Args:
        features: Feature vectors, shape (frames, features).
        good: What `cover` gave, shape (centres, features).

    Returns:
        Root mean square of the differences, shape (frames,), in deviations.
    """
    heard = np.maximum(features, good[0])
    # |x - g|^2 = |x|^2 + |g|^2 - 2 x g
    product = np.einsum("ij,ij->i", good, good) - 2.0 * heard @ good.T
    nearest = product.min(axis=1) + np.einsum("ij,ij->i", heard, heard)
    root: Array = np.sqrt(np.maximum(nearest, 0.0) / features.shape[1])
    return root


def cover(features: Array, count: int = CENTRES) -> Array:
    """Choose frames that stand for all: each next one is the farthest from those before.

    With as many, none could leave less than half as much uncovered (T. F. Gonzalez, *Clustering to
    Minimize the Maximum Intercluster Distance*, 1985).

    Args:
        features: Feature vectors, standardised, shape (frames, features).
        count: How many to choose.

    Returns:
        Silence, which is the least of each feature, and the frames chosen, the most usual one
        first, shape (1 + centres, features).
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
