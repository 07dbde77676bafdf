"""Decisions by probabilities: the class of a frame, the alarm threshold, and novelty."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from math import log1p

import numpy as np

from noiseclassifier.estimators.calibration import calibrated
from noiseclassifier.types import Array, Index, Mask

NOVELTY_LIMIT = 2.0
"""A frame is out of distribution if its novelty score exceeds this."""
LIKELY = 0.2
"""Least probability of any failure of a frame that is predicted as one: misses cost more."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Probable(ABC):
    """An estimator that decides by probabilities.

    Its decision values are the logarithm of the probability of each class, and then the novelty
    score: how far the farthest feature lies above nearly all training frames, in standard
    deviations. Out of distribution, a low probability of failure means nothing.

    Attributes:
        calibration: Scale of the logits, then an offset for each class, shape (1 + classes,).
        frequency: Share of each class in the training frames, shape (classes,).
        alarm: Alarm threshold: a probability of any failure.
    """

    calibration: Array
    frequency: Array
    alarm: float

    @property
    def width(self) -> int:
        """Decision values of one frame."""
        return len(self.calibration)

    @property
    @abstractmethod
    def maximum(self) -> Array:
        """Highest value of each feature in nearly all training frames, shape (features,)."""

    @abstractmethod
    def logits(self, features: Array) -> Array:
        """Logits of the classes, not calibrated, shape (frames, classes)."""

    def decision(self, features: Array) -> Array:
        """Probability of each class, and novelty of the frame.

        Args:
            features: Feature vectors, shape (frames, features).

        Returns:
            Logarithms of calibrated probabilities, then the novelty score, shape
            (frames, classes + 1).
        """
        decisions = np.empty((len(features), self.width))
        decisions[:, :-1] = calibrated(self.logits(features), self.calibration)
        np.fmax.reduce(features - self.maximum, 1, out=decisions[:, -1])
        return decisions

    @cached_property
    def _expected(self) -> Array:
        """Logarithms of the failures' frequencies, shape (classes - 1,)."""
        expected: Array = np.log(self.frequency[1:])
        return expected

    def choose(self, decisions: Array) -> Index:
        """Choose a failure if failures are probable enough, or else `ok`.

        Of the failures it is the one whose probability exceeds its frequency most: a rare class is
        not masked by a frequent one (balanced accuracy weighs them alike).

        Args:
            decisions: On frames, shape (frames, classes + 1).

        Returns:
            Index of a class for each frame, shape (frames,); one more than the last for a frame
            that is out of distribution and below the alarm threshold.
        """
        logarithms = decisions[:, :-1]
        chosen: Index = 1 + (logarithms[:, 1:] - self._expected).argmax(axis=1)
        chosen[logarithms[:, 0] > log1p(-LIKELY)] = 0
        chosen[self.novel(decisions) & ~self.above_threshold(decisions)] = logarithms.shape[1]
        return chosen

    def above_threshold(self, decisions: Array) -> Mask:
        """Which frames are above the alarm threshold, whatever their novelty, (frames,)."""
        above: Mask = decisions[:, 0] <= log1p(-self.alarm)
        return above

    def novel(self, decisions: Array) -> Mask:
        """Which frames are out of distribution, shape (frames,)."""
        novel: Mask = decisions[:, -1] > NOVELTY_LIMIT
        return novel

    def score(self, decisions: Array) -> Array:
        """Probability of each class, shape (frames, classes)."""
        probabilities: Array = np.exp(decisions[:, :-1])
        return probabilities
