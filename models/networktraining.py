"""Train small neural networks with scikit-learn, and calibrate them on runs they have not seen."""

import warnings
from dataclasses import replace
from typing import Any

import numpy as np

from models.networks import Networks, calibrated
from models.profile import Profile
from models.splitting import folds
from models.types import Array, Index, Words

FOLDS = 4
"""Parts of the training runs by which the networks are calibrated."""
RATE, BATCH = 2e-3, 256
"""Of the gradient descent (Adam)."""
NEVER = -30.0
"""Bias of a class that networks have not seen."""
USUAL = 1e-3
"""Share of the training frames that lie below, and as many above, what is known."""


def fit_networks(features: Array, targets: Index, groups: Words, profile: Profile) -> Networks:
    """Learn networks, each from another start, and calibrate their average.

    Rare classes count more, by the root of how much rarer they are: balanced in full, networks
    would raise alarms for the sake of the rarest class. Calibration takes that back: it is learnt
    on grouped folds, where networks speak about runs that they were not trained on.

    Args:
        features: Standardised, shape (frames, features).
        targets: Class of each, as an index from 0 without a gap, shape (frames,).
        groups: What shares its motion, shape (frames,).
        profile: Size and training of the networks.

    Returns:
        The networks; equal input gives equal networks. Those of a single group are not calibrated.
    """
    networks = _fit(features, targets, profile, int(targets.max()) + 1)
    known = np.quantile(features, (USUAL, 1.0 - USUAL), axis=0)
    calibration = networks.calibration
    if (count := min(FOLDS, len(set(groups.tolist())))) > 1:
        calibration = calibrate(*_unseen(features, targets, groups, profile, count))
    return replace(networks, calibration=calibration, known=known)


def calibrate(decisions: Array, targets: Index) -> Array:
    """Find the calibration by which probabilities come true, at the least log-loss.

    Args:
        decisions: Logarithms of probabilities, shape (frames, classes).
        targets: What the frames are, shape (frames,).

    Returns:
        Scale and offsets, as `networks.calibrated` takes them, shape (1 + classes,).
    """
    from scipy.optimize import minimize

    rows = np.arange(len(targets))

    def loss(calibration: Array) -> tuple[float, Array]:
        answers = calibrated(decisions, calibration)
        excess = np.exp(answers)
        excess[rows, targets] -= 1.0
        slope = np.append((excess * decisions).sum(), excess.sum(axis=0)) / len(targets)
        return float(-answers[rows, targets].mean()), slope

    start = np.append(1.0, np.zeros(decisions.shape[1]))
    calibration: Array = minimize(loss, start, jac=True, method="L-BFGS-B").x
    return calibration


def _unseen(
    features: Array, targets: Index, groups: Words, profile: Profile, count: int
) -> tuple[Array, Index]:
    """Let networks answer about groups that they have not learnt from; and the truth."""
    answers, truth = [], []
    for train, test in folds(groups.tolist(), count):
        if len(set(targets[train].tolist())) > 1:
            networks = _fit(features[train], targets[train], profile, int(targets.max()) + 1)
            answers.append(networks.average(features[test]))
            truth.append(targets[test])
    return np.concatenate(answers), np.concatenate(truth)


def _fit(features: Array, targets: Index, profile: Profile, classes: int) -> Networks:
    """Learn networks whose calibration changes nothing."""
    counts = np.bincount(targets, minlength=classes)
    weights = np.sqrt(counts.max() / np.maximum(counts, 1))[targets]
    there = np.flatnonzero(counts)
    nets = [_train(seed, features, targets, weights, profile) for seed in range(profile.networks)]
    # scikit-learn has no output for a class that it does not see, and of two for the second alone.
    learnt = there if len(there) > 2 else there[1:]
    output = np.zeros((len(nets), profile.units, classes))
    output_bias = np.where(counts > 0, 0.0, NEVER) * np.ones((len(nets), 1))
    output[:, :, learnt] = [net.coefs_[1] for net in nets]
    output_bias[:, learnt] = [net.intercepts_[1] for net in nets]
    return Networks(
        np.stack([net.coefs_[0] for net in nets]),
        np.stack([net.intercepts_[0] for net in nets]),
        output,
        output_bias,
        np.append(1.0, np.zeros(classes)),
        np.stack((features.min(axis=0), features.max(axis=0))),
        profile.alarm,
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
