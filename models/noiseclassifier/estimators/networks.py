"""Small neural networks, evaluated in NumPy, with calibrated probabilities of the classes.

The probabilities of several networks with one hidden layer are averaged, and then calibrated.
Features below nearly all of the training set are raised to its lower bound: a motion that is
quieter than any other is no failure, and a simulator without sensor noise is not out of
distribution for that.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from noiseclassifier.estimators.decision import TINY, Probable, calibrate, identity, of_seen_classes
from noiseclassifier.profile import Profile
from noiseclassifier.recording import folds
from noiseclassifier.signals import Array, Index, Words

Single: TypeAlias = NDArray[np.float32]

RATE, BATCH = 2e-3, 256
"""Learning rate and batch size of the gradient descent (Adam)."""
UNSEEN = -30.0
"""Bias of a class without training frames."""
TAIL = 1e-3
"""Share of the training frames below the lower bound of a feature, and above the upper one."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Networks(Probable):
    """Networks whose probabilities are averaged, their calibration, and bounds of the features.

    Known are the lowest and the highest value of each feature, shape (2, features).
    """

    DIMENSIONS: ClassVar[Mapping[str, int]] = {
        "hidden": 3,
        "hidden_bias": 2,
        "output": 3,
        "output_bias": 2,
        "calibration": 1,
        "frequency": 1,
        "known": 2,
    }

    hidden: Array  # weights to the hidden layers, shape (networks, features, units)
    hidden_bias: Array  # shape (networks, units)
    output: Array  # weights to the classes, shape (networks, units, classes)
    output_bias: Array  # shape (networks, classes)

    @classmethod
    def fit(cls, features: Array, targets: Index, groups: Words, profile: Profile) -> "Networks":
        """Train networks, each from another start and on other groups, and calibrate them.

        Each network leaves out a part of the groups; its logits there calibrate the average.
        """
        classes = int(targets.max()) + 1
        networks, logits, truth = [], [], []
        for seed, (train, test) in enumerate(_parts(targets, groups, profile.networks)):
            network = _fit(seed, features[train], targets[train], profile, classes)
            networks.append(network)
            seen = of_seen_classes(targets, train, test)
            logits.append(network.average(features[seen]))
            truth.append(targets[seen])
        labels = np.concatenate(truth)
        calibration = networks[0].calibration
        if len(labels):
            calibration = calibrate(np.concatenate(logits), labels)
        return Networks(
            **{
                name: np.concatenate([getattr(network, name) for network in networks])
                for name in ("hidden", "hidden_bias", "output", "output_bias")
            },
            known=np.quantile(features, (TAIL, 1.0 - TAIL), axis=0),
            calibration=calibration,
            frequency=np.bincount(targets, minlength=classes) / len(targets),
            alarm=profile.alarm,
        )

    @staticmethod
    def shapes(
        arrays: Mapping[str, Array], profile: Profile, *, features: int, classes: int
    ) -> dict[str, tuple[int, ...]]:
        """Expected shape of each array."""
        count, units = profile.networks, profile.units
        return {
            "hidden": (count, features, units),
            "hidden_bias": (count, units),
            "output": (count, units, classes),
            "output_bias": (count, classes),
            "calibration": (1 + classes,),
            "frequency": (classes,),
            "known": (2, features),
        }

    def logits(self, features: Array) -> Array:
        """Logits of the classes, features being raised to their bound, shape (frames, classes)."""
        return self.average(np.maximum(features, self.known[0]))

    def average(self, features: Array) -> Array:
        """Logarithms of the mean probabilities of all networks, shape (frames, classes)."""
        weights, bias, output = self._single
        # A product for each frame: the rounding of one for all depends on how many they are.
        hidden = features.astype(np.float32)[:, None] @ weights
        hidden += bias
        np.maximum(hidden, 0.0, out=hidden)
        logits = (hidden @ output).reshape(len(features), *self.output_bias.shape)
        logits = logits + self.output_bias  # in double precision from here on
        each = np.exp(logits - np.logaddexp.reduce(logits, -1, keepdims=True))
        average: Array = np.log(np.add.reduce(each, 1) / each.shape[1] + TINY)
        return average

    @cached_property
    def _single(self) -> tuple[Single, Single, Single]:
        """Weights and biases of all networks in one layer, in single precision: less to fetch."""
        networks, features, units = self.hidden.shape
        side_by_side = self.hidden.swapaxes(0, 1).reshape(features, networks * units)
        classes = self.output.shape[-1]
        block = np.zeros((networks, units, networks, classes))
        block[range(networks), :, range(networks)] = self.output  # no connections between networks
        each = side_by_side, self.hidden_bias, block
        shapes = (features, -1), (-1,), (networks * units, -1)
        weights, bias, output = (
            np.ascontiguousarray(one.reshape(shape), dtype=np.float32)
            for one, shape in zip(each, shapes, strict=True)
        )
        return weights, bias, output


def _parts(targets: Index, groups: Words, networks: int) -> list[tuple[Index, Index]]:
    """Training and test frames of each network, as indices."""
    everything = np.arange(len(targets)), np.arange(0)
    count = min(networks, len(set(groups.tolist())))
    parts = folds(groups.tolist(), count) if count > 1 else [everything]
    usable = [part if len(set(targets[part[0]].tolist())) > 1 else everything for part in parts]
    return [usable[number % len(usable)] for number in range(networks)]


def _fit(seed: int, features: Array, targets: Index, profile: Profile, classes: int) -> Networks:
    """Train one network, without calibration."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPClassifier

    counts = np.bincount(targets, minlength=classes)
    there = np.flatnonzero(counts)
    # By the root of how rare a class is: with balanced weights, networks would raise alarms for the
    # rarest one. Calibration restores the frequencies.
    weights = np.sqrt(counts.max() / counts[targets])
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
        network.fit(features, targets, weights)
    # scikit-learn has no output for a class that it does not see, and of two for the second alone.
    learnt = there if len(there) > 2 else there[1:]
    output = np.zeros((1, profile.units, classes))
    output_bias = np.where(counts > 0, 0.0, UNSEEN)[None]
    output[0][:, learnt], output_bias[0, learnt] = network.coefs_[1], network.intercepts_[1]
    return Networks(
        hidden=network.coefs_[0][None],
        hidden_bias=network.intercepts_[0][None],
        output=output,
        output_bias=output_bias,
        known=np.stack((features.min(axis=0), features.max(axis=0))),
        calibration=identity(classes),
        frequency=counts / len(targets),
        alarm=profile.alarm,
    )
