"""Small neural networks, evaluated in NumPy, that say how probable each class is.

Several networks with one hidden layer look at the same features; their probabilities are averaged
and then calibrated. A decision is the logarithm of a class's probability, for all classes, and
then how foreign the frame is: how far its farthest feature lies above nearly all that the networks
have learnt from, in deviations. Far above, probabilities mean nothing. What lies below is taken for
the least that is known: a motion quieter than any other is no failure, and a simulator without
sensor noise is not foreign for that.
"""

from dataclasses import dataclass
from functools import cached_property
from math import log1p
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from models.types import Array, Index, Mask

Single: TypeAlias = NDArray[np.float32]

TINY = 1e-12
"""The least probability that is told from none."""
FOREIGN = 2.0
"""A frame is unknown if a feature lies farther than this above what was learnt from."""
LIKELY = 0.2
"""Probability of any failure from which a frame is called one: to miss it is the worse mistake."""


@dataclass(frozen=True, eq=False)
class Networks:
    """Networks whose answers are averaged, their calibration, and what they know.

    Attributes:
        hidden: Weights to the hidden layers, shape (networks, features, units).
        hidden_bias: Shape (networks, units).
        output: Weights to the classes, shape (networks, units, classes).
        output_bias: Shape (networks, classes).
        calibration: Scale of the averaged log-probabilities, then an offset for each class, shape
            (1 + classes,).
        frequency: Share of each class in the frames that were learnt from, shape (classes,).
        known: Lowest and highest value of each feature that is known, shape (2, features).
        alarm: Probability of any failure from which a frame is sure enough to raise an alarm.
    """

    hidden: Array
    hidden_bias: Array
    output: Array
    output_bias: Array
    calibration: Array
    frequency: Array
    known: Array
    alarm: float

    @property
    def width(self) -> int:
        """Decisions on one frame."""
        return len(self.calibration)

    def decision(self, features: Array) -> Array:
        """Say how probable each class is, and how foreign the frame.

        Args:
            features: Feature vectors, shape (frames, features).

        Returns:
            Logarithms of calibrated probabilities, then how foreign it is, shape
            (frames, classes + 1).
        """
        heard = np.maximum(features, self.known[0])
        decisions = np.empty((len(features), self.width))
        decisions[:, :-1] = calibrated(self.average(heard), self.calibration)
        np.maximum.reduce(features - self.known[1], 1, out=decisions[:, -1])
        return decisions

    def average(self, features: Array) -> Array:
        """Average the networks' probabilities; their logarithms, shape (frames, classes)."""
        weights, bias, output = self._single
        hidden = features.astype(np.float32) @ weights
        hidden += bias
        np.maximum(hidden, 0.0, out=hidden)
        answers = (hidden @ output).reshape(len(features), *self.output_bias.shape)
        each = np.exp(_log_softmax(answers + self.output_bias))
        average: Array = np.log(np.add.reduce(each, 1) / each.shape[1] + TINY)
        return average

    @cached_property
    def _single(self) -> tuple[Single, Single, Single]:
        """Weights and biases of all networks side by side, in single precision: less to fetch."""
        networks, features, units = self.hidden.shape
        side_by_side = self.hidden.swapaxes(0, 1).reshape(features, networks * units)
        classes = self.output.shape[-1]
        block = np.zeros((networks, units, networks, classes))
        block[range(networks), :, range(networks)] = self.output  # none hears another's units
        each = side_by_side, self.hidden_bias, block
        shapes = (features, -1), (-1,), (networks * units, -1)
        weights, bias, output = (
            np.ascontiguousarray(one.reshape(shape), dtype=np.float32)
            for one, shape in zip(each, shapes, strict=True)
        )
        return weights, bias, output

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
            decisions: What `decision` gave.

        Returns:
            Index of a class for each frame, shape (frames,); one more than the last for a frame
            that is unknown.
        """
        answers, foreign = decisions[:, :-1], decisions[:, -1]
        chosen: Index = 1 + (answers[:, 1:] - self._expected).argmax(axis=1)
        chosen[answers[:, 0] > log1p(-LIKELY)] = 0
        chosen[foreign > FOREIGN] = answers.shape[1]
        return chosen

    def sure(self, decisions: Array) -> Mask:
        """Say which frames may raise an alarm, shape (frames,)."""
        alarming: Mask = decisions[:, 0] <= log1p(-self.alarm)
        alarming &= decisions[:, -1] <= FOREIGN
        return alarming

    def score(self, decisions: Array) -> Array:
        """Grade all classes by their probabilities, shape (frames, classes)."""
        probabilities: Array = np.exp(decisions[:, :-1])
        return probabilities

    def arrays(self) -> dict[str, Array]:
        """Give what a model file keeps."""
        return {
            "hidden": self.hidden,
            "hidden_bias": self.hidden_bias,
            "output": self.output,
            "output_bias": self.output_bias,
            "calibration": self.calibration,
            "frequency": self.frequency,
            "known": self.known,
        }


def calibrated(answers: Array, calibration: Array) -> Array:
    """Make probabilities come true: scale their logarithms, and shift each class.

    Vector scaling with one scale for all classes, C. Guo et al., *On Calibration of Modern Neural
    Networks*, 2017, Sec. 4.2.

    Args:
        answers: Logarithms of probabilities, shape (frames, classes).
        calibration: Scale and offsets, shape (1 + classes,).

    Returns:
        Logarithms of calibrated probabilities, shape (frames, classes).
    """
    return _log_softmax(calibration[0] * answers + calibration[1:])


def _log_softmax(values: Array) -> Array:
    softmax: Array = values - np.logaddexp.reduce(values, -1, keepdims=True)
    return softmax
