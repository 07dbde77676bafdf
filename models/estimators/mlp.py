"""Small neural networks, evaluated in NumPy, that say how probable each class is.

Several networks with one hidden layer look at the same features; their probabilities are averaged
and then calibrated. What lies below all that is known is taken for the least of it: a motion that
is quieter than any other is no failure, and a simulator without sensor noise is not foreign for it.
"""

import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from models.estimators.calibration import TINY, calibrate, familiar, plain
from models.estimators.probabilistic import Probable
from models.profile import Profile
from models.splitting import folds
from models.types import Array, Index, Words

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


RATE, BATCH = 2e-3, 256
"""Of the gradient descent (Adam)."""
NEVER = -30.0
"""Bias of a class that networks have not seen."""
USUAL = 1e-3
"""Share of the training frames that lie below, and as many above, what is known."""


def fit_networks(features: Array, targets: Index, groups: Words, profile: Profile) -> Networks:
    """Learn networks, each from another start and from other groups, and calibrate them.

    Each network leaves a part of the groups out, and is asked about it: what they answer about
    runs that they were not trained on is what their average is calibrated by.

    Rare classes count more, by the root of how much rarer they are: balanced in full, networks
    would raise alarms for the sake of the rarest class. Calibration takes that back.

    Args:
        features: Standardised, shape (frames, features).
        targets: Class of each, as an index from 0 without a gap, shape (frames,).
        groups: What shares its motion, shape (frames,).
        profile: Size and training of the networks.

    Returns:
        The networks; equal input gives equal networks. Those of a single group are not calibrated.
    """
    classes = int(targets.max()) + 1
    networks, answers, truth = [], [], []
    for seed, (train, test) in enumerate(_parts(targets, groups, profile.networks)):
        network = _fit(seed, features[train], targets[train], profile, classes)
        networks.append(network)
        asked = familiar(targets, train, test)
        answers.append(network.average(features[asked]))
        truth.append(targets[asked])
    heard = np.concatenate(truth)
    calibration = networks[0].calibration
    if len(heard):
        calibration = calibrate(np.concatenate(answers), heard)
    known = np.quantile(features, (USUAL, 1.0 - USUAL), axis=0)
    return Networks(
        hidden=np.concatenate([network.hidden for network in networks]),
        hidden_bias=np.concatenate([network.hidden_bias for network in networks]),
        output=np.concatenate([network.output for network in networks]),
        output_bias=np.concatenate([network.output_bias for network in networks]),
        known=known,
        calibration=calibration,
        frequency=np.bincount(targets, minlength=classes) / len(targets),
        alarm=profile.alarm,
    )


def _parts(targets: Index, groups: Words, networks: int) -> list[tuple[Index, Index]]:
    """Say which frames each network learns from, and which it is asked about."""
    everything = np.arange(len(targets)), np.arange(0)
    count = min(networks, len(set(groups.tolist())))
    parts = folds(groups.tolist(), count) if count > 1 else [everything]
    telling = [part if len(set(targets[part[0]].tolist())) > 1 else everything for part in parts]
    return [telling[number % len(telling)] for number in range(networks)]


def _fit(seed: int, features: Array, targets: Index, profile: Profile, classes: int) -> Networks:
    """Learn one network, whose calibration changes nothing."""
    counts = np.bincount(targets, minlength=classes)
    weights = np.sqrt(counts.max() / np.maximum(counts, 1))[targets]
    there = np.flatnonzero(counts)
    network = _train(seed, features, targets, weights, profile)
    # scikit-learn has no output for a class that it does not see, and of two for the second alone.
    learnt = there if len(there) > 2 else there[1:]
    output = np.zeros((1, profile.units, classes))
    output_bias = np.where(counts > 0, 0.0, NEVER)[None]
    output[0][:, learnt], output_bias[0, learnt] = network.coefs_[1], network.intercepts_[1]
    return Networks(
        hidden=network.coefs_[0][None],
        hidden_bias=network.intercepts_[0][None],
        output=output,
        output_bias=output_bias,
        known=np.stack((features.min(axis=0), features.max(axis=0))),
        calibration=plain(classes),
        frequency=counts / len(targets),
        alarm=profile.alarm,
    )


def _train(seed: int, features: Array, targets: Index, weights: Array, profile: Profile) -> Any:
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPClassifier

    network = MLPClassifier(
        (profile.units,),
        alpha=profile.decay,
        batch_size=min(BATCH, len(features)),
        learning_rate_init=RATE,
        max_iter=profile.epochs,
        n_iter_no_change=profile.epochs + 1,
        random_state=seed,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # so many epochs and no more
        return network.fit(features, targets, weights)
