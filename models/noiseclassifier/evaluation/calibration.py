"""The calibration error: how far confidence is from the share of right predictions.

Conventions: a frame's *confidence* is the probability of the class that the model predicts.
Frames are sorted into ten bins of equal width by confidence. The expected calibration error is the
mean distance of confidence and share of right predictions in a bin, weighted by the bin's frames
(Naeini et al., 2015; Guo et al., 2017, with 15 bins). It is defined for probabilities alone, not
for votes and margins.
"""

from dataclasses import dataclass

import numpy as np

from noiseclassifier.evaluation.intervals import Estimate, Resampling, ratio
from noiseclassifier.evaluation.matching import UNCLEAR, Matched
from noiseclassifier.types import Array

BINS = 10


@dataclass(frozen=True, eq=False)
class Reliability:
    """Sums over the frames of each recording and bin.

    Attributes:
        edges: Edges of the bins of confidence, shape (bins + 1,).
        frames: How many, shape (runs, bins).
        confidence: Sum of their confidences, shape (runs, bins).
        right: How many predictions are right, shape (runs, bins).
    """

    edges: Array
    frames: Array
    confidence: Array
    right: Array

    def table(self) -> dict[str, Array]:
        """Table of the bins, over all recordings.

        Returns:
            By name: ``low`` and ``high`` edge, ``frames``, mean ``confidence`` and share
            ``right``, each of shape (bins,), NaN in empty bins.
        """
        count = self.frames.sum(axis=0)
        return {
            "low": self.edges[:-1],
            "high": self.edges[1:],
            "frames": count,
            "confidence": ratio(self.confidence.sum(axis=0), count),
            "right": ratio(self.right.sum(axis=0), count),
        }

    def error(self, resampling: Resampling) -> Estimate:
        """Estimate the expected calibration error.

        Args:
            resampling: Sets of recordings.
        """
        value = self._error(np.ones((1, len(self.frames))))
        drawn = self._error(resampling.weights)
        return resampling.plain(float(value[0]), drawn, self.frames.sum(axis=1) > 0)

    def _error(self, weights: Array) -> Array:
        # sum_b n_b / n |right_b / n_b - confidence_b / n_b|
        apart = np.abs(weights @ (self.right - self.confidence)).sum(axis=1)
        return ratio(apart, (weights @ self.frames).sum(axis=1))


def are_probabilities(scores: Array) -> bool:
    """Whether scores are probabilities: none below 0, with the sum 1.

    Args:
        scores: Of all classes, shape (frames, classes).
    """
    whole = np.allclose(scores.sum(axis=1), 1.0, rtol=0.0, atol=1e-6)
    return bool(whole and (scores >= 0.0).all())


def reliability(matched: Matched) -> Reliability | None:
    """Confidence and share of right predictions, over all frames with a true class.

    Args:
        matched: The recordings.

    Returns:
        Sums by recording and bin; None if the scores are no probabilities.
    """
    frames = matched.frames
    if not are_probabilities(frames.scores):
        return None
    clear = frames.truth != UNCLEAR
    column = {name: number for number, name in enumerate(matched.classes)}
    # A label that is no class, say "unknown", has no probability: it does not count.
    named = np.array([column.get(str(name), -1) for name in frames.predicted], dtype=np.intp)
    kept = clear & (named >= 0)
    confidence = frames.scores[kept, named[kept]]
    edges = np.linspace(0.0, 1.0, BINS + 1)
    place = np.minimum((confidence * BINS).astype(np.intp), BINS - 1)
    cell = frames.run[kept] * BINS + place

    def sums(weights: Array | None) -> Array:
        total = np.bincount(cell, weights, minlength=len(matched.names) * BINS)
        return total.reshape(-1, BINS).astype(np.float64)

    right = (frames.predicted == frames.truth)[kept].astype(np.float64)
    return Reliability(edges, sums(None), sums(confidence), sums(right))
