"""Vector scaling: calibrated probabilities from logits."""

import numpy as np

from noiseclassifier.types import Array, Index

TINY = 1e-12
"""Added to a probability before its logarithm."""


def calibrated(logits: Array, calibration: Array) -> Array:
    """Logarithms of calibrated probabilities: logits scaled, and shifted for each class.

    Vector scaling with one scale for all classes, C. Guo et al., *On Calibration of Modern Neural
    Networks*, 2017, Sec. 4.2.

    Args:
        logits: Logarithms of what is proportional to probabilities, shape (frames, classes).
        calibration: Scale and offsets, shape (1 + classes,).

    Returns:
        Logarithms of calibrated probabilities, shape (frames, classes).
    """
    scaled = calibration[0] * logits + calibration[1:]
    found: Array = scaled - np.logaddexp.reduce(scaled, -1, keepdims=True)
    return found


def calibrate(logits: Array, targets: Index) -> Array:
    """Calibration of the least log-loss.

    A class without frames is not shifted.

    Args:
        logits: Logarithms of what is proportional to probabilities, shape (frames, classes).
        targets: Class of each frame, as an index, shape (frames,).

    Returns:
        Scale and offsets, as `calibrated` takes them, shape (1 + classes,).
    """
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
    """Indices of the test frames whose class is in the training set.

    Args:
        targets: Class of each frame, shape (frames,).
        train: Indices of the training frames.
        test: Indices of the test frames.
    """
    return test[np.isin(targets[test], targets[train])]


def unthinned(calibration: Array, thin: int) -> Array:
    """Calibration for all frames, of one for every ``thin``-th `ok` frame and all failures.

    Args:
        calibration: Scale and offsets, as `calibrated` takes them, shape (1 + classes,).
        thin: The odds of `ok`, the first class, are multiplied by it.
    """
    shift = np.zeros(len(calibration))
    shift[1] = np.log(thin)
    return calibration + shift


def identity(classes: int) -> Array:
    """The calibration that changes nothing, shape (1 + classes,)."""
    return np.append(1.0, np.zeros(classes))
