"""What is made of probabilities: what a frame is called, and whether it raises an alarm."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from math import log1p

import numpy as np

from models.estimators.calibration import calibrated
from models.types import Array, Index, Mask

FOREIGN = 2.0
"""A frame is unknown if a feature lies farther than this above what was learnt from."""
LIKELY = 0.2
"""Probability of any failure from which a frame is called one: to miss it is the worse mistake."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Probable(ABC):
    """What decides by probabilities.

    A decision is the logarithm of a class's probability, for all classes, and then how foreign the
    frame is: how far its farthest feature lies above nearly all that was learnt from, in
    deviations. Far above, probabilities mean nothing.

    Attributes:
        calibration: Scale of answers, then an offset for each class, shape (1 + classes,).
        frequency: Share of each class in the frames that were learnt from, shape (classes,).
        alarm: Probability of any failure from which a frame is sure enough to raise an alarm.
    """

    calibration: Array
    frequency: Array
    alarm: float

    @property
    def width(self) -> int:
        """Decisions on one frame."""
        return len(self.calibration)

    @property
    @abstractmethod
    def highest(self) -> Array:
        """Highest value of each feature that is known, shape (features,)."""

    @abstractmethod
    def answers(self, features: Array) -> Array:
        """Say how likely classes are; logarithms, not calibrated, shape (frames, classes)."""

    def decision(self, features: Array) -> Array:
        """Say how probable each class is, and how foreign the frame.

        Args:
            features: Feature vectors, shape (frames, features).

        Returns:
            Logarithms of calibrated probabilities, then how foreign it is, shape
            (frames, classes + 1).
        """
        decisions = np.empty((len(features), self.width))
        decisions[:, :-1] = calibrated(self.answers(features), self.calibration)
        np.maximum.reduce(features - self.highest, 1, out=decisions[:, -1])
        return decisions

    @cached_property
    def _expected(self) -> Array:
        """Logarithms of the failures' frequencies, shape (classes - 1,)."""
        expected: Array = np.log(self.frequency[1:])
        return expected

    def choose(self, decisions: Array) -> Index:
        """Choose a failure if failures are probable enough, or else `ok`.

        Of the failures it is the one whose probability exceeds its frequency most: a rare one is
        not to drown in a frequent one (balanced accuracy counts them alike).

        Args:
            decisions: On frames, shape (frames, classes + 1).

        Returns:
            Index of a class for each frame, shape (frames,); one more than the last for a frame
            that is unknown.
        """
        answers, foreign = decisions[:, :-1], decisions[:, -1]
        chosen: Index = 1 + (answers[:, 1:] - self._expected).argmax(axis=1)
        chosen[answers[:, 0] > log1p(-LIKELY)] = 0
        chosen[foreign > FOREIGN] = answers.shape[1]
        return chosen

    def above_threshold(self, decisions: Array) -> Mask:
        """Say which frames may raise an alarm, shape (frames,)."""
        alarming: Mask = decisions[:, 0] <= log1p(-self.alarm)
        alarming &= decisions[:, -1] <= FOREIGN
        return alarming

    def score(self, decisions: Array) -> Array:
        """Grade all classes by their probabilities, shape (frames, classes)."""
        probabilities: Array = np.exp(decisions[:, :-1])
        return probabilities
