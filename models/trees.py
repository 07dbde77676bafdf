"""Boosted trees, evaluated in NumPy, that say how probable each class is.

In each round of boosting, a small tree for each class adds to how likely that class is; the sums
are then calibrated. What lies below all that is known falls to the same leaves as the least of it:
a motion quieter than any other is no failure.

All splits of all trees are looked at together, in place of a walk down each: a split that a frame
passes on the right rules the leaves on its left out, and of those that are left in the end, the
first one is where the walk would have led (C. Lucchese et al., *QuickScorer: A Fast Algorithm to
Rank Documents with Additive Ensembles of Regression Trees*, 2015).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from models.probable import Probable
from models.profile import MOST_LEAVES
from models.types import Array, Index

TOGETHER = 32
"""Frames that are looked at together: fewer take longer, more gain nothing but memory."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Trees(Probable):
    """Trees whose answers are summed up, their calibration, and what they know.

    Trees are in the order of rounds, one for each class in each; their leaves from left to right.
    A tree with fewer splits than others has some that rule nothing out.

    Attributes:
        feature: Number of the feature that a split looks at, shape (trees, splits).
        threshold: A frame is on the right of a split if its feature exceeds this, shape
            (trees, splits).
        left: The first leaf on the left of a split, and the first one that is not, shape
            (2, trees, splits).
        leaf: What a leaf adds to its tree's class, shape (trees, leaves).
        prior: What classes start from, shape (classes,).
        known: Highest value of each feature that is known, shape (features,).
    """

    feature: Array
    threshold: Array
    left: Array
    leaf: Array
    prior: Array
    known: Array

    @property
    def highest(self) -> Array:
        """Highest value of each feature that is known, shape (features,)."""
        return self.known

    def answers(self, features: Array) -> Array:
        """Sum up the leaves that frames fall to, and the prior, shape (frames, classes)."""
        found = np.empty((len(features), len(self.prior)))
        for first in range(0, len(features), TOGETHER):
            few = slice(first, first + TOGETHER)
            found[few] = self._sums(features[few])
        return found

    def _sums(self, features: Array) -> Array:
        number, threshold, left, leaf, first = self._side_by_side
        right = features.take(number, axis=1) > threshold
        ruled_out = np.bitwise_or.reduce(right * left, 1)
        place = first + _FIRST.take(np.invert(ruled_out, out=ruled_out))
        added = leaf.take(place).reshape(len(features), -1, len(self.prior))
        sums: Array = np.add.reduce(added, 1)
        sums += self.prior
        return sums

    @cached_property
    def _side_by_side(self) -> tuple[Index, Array, NDArray[np.uint16], Array, Index]:
        """Lay all first splits of trees side by side, and then all second ones.

        Returns:
            Features, thresholds and leaves on the left, as bits, shape (splits, trees); all
            leaves in a row, and where those of each tree begin, shape (trees,).
        """
        start, stop = self.left.astype(np.int64)
        bits = ((1 << stop) - (1 << start)).astype(np.uint16)
        trees, leaves = self.leaf.shape
        return (
            np.ascontiguousarray(self.feature.T.astype(np.intp)),
            np.ascontiguousarray(self.threshold.T),
            np.ascontiguousarray(bits.T),
            self.leaf.ravel(),
            leaves * np.arange(trees),
        )

    def arrays(self) -> dict[str, Array]:
        """Give what a model file keeps."""
        return {
            "feature": self.feature,
            "threshold": self.threshold,
            "left": self.left,
            "leaf": self.leaf,
            "prior": self.prior,
            "calibration": self.calibration,
            "frequency": self.frequency,
            "known": self.known,
        }


def _first_bits() -> NDArray[np.uint8]:
    """Say of each number of 16 bits which is its first one, shape (65536,); of none, the first."""
    numbers = np.arange(1 << MOST_LEAVES)
    first = np.frexp(numbers & -numbers)[1] - 1
    found: NDArray[np.uint8] = np.maximum(first, 0).astype(np.uint8)
    return found


_FIRST = _first_bits()
