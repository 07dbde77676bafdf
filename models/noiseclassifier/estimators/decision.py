"""Decisions by calibrated probabilities: the class of a frame, the alarm threshold, and novelty."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import log1p
from typing import ClassVar, Self

import numpy as np

from noiseclassifier.profile import Profile
from noiseclassifier.signals import Array, Index, Mask

TINY = 1e-12
"""Added to a probability before its logarithm."""


def calibrated(logits: Array, calibration: Array) -> Array:
    """Logarithms of calibrated probabilities: logits scaled, and shifted for each class.

    Vector scaling with one scale for all classes, C. Guo et al., *On Calibration of Modern Neural
    Networks*, 2017, Sec. 4.2.
    """
    scaled = calibration[0] * logits + calibration[1:]
    found: Array = scaled - np.logaddexp.reduce(scaled, -1, keepdims=True)
    return found


def calibrate(logits: Array, targets: Index) -> Array:
    """Calibration of the least log-loss; a class without frames is not shifted."""
    from scipy.optimize import minimize

    there, truth = np.unique(targets, return_inverse=True)
    classes, rows = logits.shape[1], np.arange(len(targets))
    logits = logits.take(there, axis=1)

    def loss(calibration: Array) -> tuple[float, Array]:
        found = calibrated(logits, calibration)
        excess = np.exp(found)
        excess[rows, truth] -= 1.0
        slope = np.append((excess * logits).sum(), excess.sum(axis=0)) / len(targets)
        return float(-found[rows, truth].mean()), slope

    calibration = identity(classes)
    best = minimize(loss, identity(len(there)), jac=True, method="L-BFGS-B").x
    calibration[[0, *(1 + there)]] = best
    return calibration


def of_seen_classes(targets: Index, train: Index, test: Index) -> Index:
    """Indices of the test frames whose class is in the training set."""
    return test[np.isin(targets[test], targets[train])]


def identity(classes: int) -> Array:
    """The calibration that changes nothing, shape (1 + classes,)."""
    return np.append(1.0, np.zeros(classes))


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
    """

    DIMENSIONS: ClassVar[Mapping[str, int]]

    calibration: Array  # scale of the logits, then an offset for each class, (1 + classes,)
    frequency: Array  # share of each class in the training frames, shape (classes,)
    known: Array  # highest value of each feature in nearly all training frames, in the last row
    alarm: float  # alarm threshold: a probability of any failure

    @classmethod
    def of(cls, arrays: Mapping[str, Array], profile: Profile) -> Self:
        """Make an estimator from the arrays of a model file."""
        return cls(**{name: arrays[name] for name in cls.DIMENSIONS}, alarm=profile.alarm)

    def arrays(self) -> dict[str, Array]:
        """Arrays for a model file, by name."""
        return {name: getattr(self, name) for name in self.DIMENSIONS}

    @property
    def width(self) -> int:
        """Decision values of one frame."""
        return len(self.calibration)

    @abstractmethod
    def logits(self, features: Array) -> Array:
        """Logits of the classes, not calibrated, shape (frames, classes)."""

    def decision(self, features: Array) -> Array:
        """Probability of each class, and novelty of the frame."""
        decisions = np.empty((len(features), self.width))
        decisions[:, :-1] = calibrated(self.logits(features), self.calibration)
        highest = self.known if self.known.ndim == 1 else self.known[-1]
        np.fmax.reduce(features - highest, 1, out=decisions[:, -1])
        return decisions

    @cached_property
    def _expected(self) -> Array:
        """Logarithms of the failures' frequencies, shape (classes - 1,)."""
        return np.asarray(np.log(self.frequency[1:]))

    def choose(self, decisions: Array) -> Index:
        """Choose a failure if failures are probable enough, or else `ok`.

        Of the failures it is the one whose probability exceeds its frequency most: a rare class is
        not masked by a frequent one (balanced accuracy weighs them alike).
        """
        logarithms = decisions[:, :-1]
        chosen: Index = 1 + (logarithms[:, 1:] - self._expected).argmax(axis=1)
        chosen[logarithms[:, 0] > log1p(-LIKELY)] = 0
        chosen[self.novel(decisions) & ~self.above_threshold(decisions)] = logarithms.shape[1]
        return chosen

    def above_threshold(self, decisions: Array) -> Mask:
        """Which frames are above the alarm threshold, whatever their novelty, (frames,)."""
        return np.asarray(decisions[:, 0] <= log1p(-self.alarm))

    def novel(self, decisions: Array) -> Mask:
        """Which frames are out of distribution, shape (frames,)."""
        return np.asarray(decisions[:, -1] > NOVELTY_LIMIT)

    def score(self, decisions: Array) -> Array:
        """Probability of each class, shape (frames, classes)."""
        return np.asarray(np.exp(decisions[:, :-1]))
