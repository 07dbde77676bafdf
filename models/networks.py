"""Small neural networks, evaluated in NumPy, that say how probable each class is.

Several networks with one hidden layer look at the same features; their probabilities are averaged
and then calibrated. What lies below all that is known is taken for the least of it: a motion that
is quieter than any other is no failure, and a simulator without sensor noise is not foreign for it.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from models.calibration import TINY
from models.probable import Probable
from models.types import Array

Single: TypeAlias = NDArray[np.float32]


@dataclass(frozen=True, eq=False, kw_only=True)
class Networks(Probable):
    """Networks whose answers are averaged, their calibration, and what they know.

    Attributes:
        hidden: Weights to the hidden layers, shape (networks, features, units).
        hidden_bias: Shape (networks, units).
        output: Weights to the classes, shape (networks, units, classes).
        output_bias: Shape (networks, classes).
        known: Lowest and highest value of each feature that is known, shape (2, features).
    """

    hidden: Array
    hidden_bias: Array
    output: Array
    output_bias: Array
    known: Array

    @property
    def highest(self) -> Array:
        """Highest value of each feature that is known, shape (features,)."""
        highest: Array = self.known[1]
        return highest

    def answers(self, features: Array) -> Array:
        """Average what is said of features, none below what is known, shape (frames, classes)."""
        return self.average(np.maximum(features, self.known[0]))

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


def _log_softmax(values: Array) -> Array:
    softmax: Array = values - np.logaddexp.reduce(values, -1, keepdims=True)
    return softmax
