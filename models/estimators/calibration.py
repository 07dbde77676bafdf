"""Calibration: by which probabilities come true."""

import numpy as np

from models.types import Array, Index

TINY = 1e-12
"""The least probability that is told from none."""


def calibrated(answers: Array, calibration: Array) -> Array:
    """Make probabilities come true: scale their logarithms, and shift each class.

    Vector scaling with one scale for all classes, C. Guo et al., *On Calibration of Modern Neural
    Networks*, 2017, Sec. 4.2.

    Args:
        answers: Logarithms of probabilities, or of what is proportional to them, shape
            (frames, classes).
        calibration: Scale and offsets, shape (1 + classes,).

    Returns:
        Logarithms of calibrated probabilities, shape (frames, classes).
    """
    scaled = calibration[0] * answers + calibration[1:]
    found: Array = scaled - np.logaddexp.reduce(scaled, -1, keepdims=True)
    return found


def calibrate(answers: Array, targets: Index) -> Array:
    """Find the calibration by which probabilities come true, at the least log-loss.

    Of a class that no frame is of, nothing can be told: it is not shifted.

    Args:
        answers: Logarithms of probabilities, or of what is proportional to them, shape
            (frames, classes).
        targets: What the frames are, shape (frames,).

    Returns:
        Scale and offsets, as `calibrated` takes them, shape (1 + classes,).
    """
    from scipy.optimize import minimize

    there, truth = np.unique(targets, return_inverse=True)
    classes, rows = answers.shape[1], np.arange(len(targets))
    answers = answers.take(there, axis=1)

    def loss(calibration: Array) -> tuple[float, Array]:
        found = calibrated(answers, calibration)
        excess = np.exp(found)
        excess[rows, truth] -= 1.0
        slope = np.append((excess * answers).sum(), excess.sum(axis=0)) / len(targets)
        return float(-found[rows, truth].mean()), slope

    calibration = plain(classes)
    best = minimize(loss, plain(len(there)), jac=True, method="L-BFGS-B").x
    calibration[[0, *(1 + there)]] = best
    return calibration


def familiar(targets: Index, known: Index, fresh: Index) -> Index:
    """Keep those frames whose class was learnt: of all others, every answer is wrong.

    Args:
        targets: Class of each frame, shape (frames,).
        known: Which of them were learnt from.
        fresh: Which of them could be asked about.
    """
    return fresh[np.isin(targets[fresh], targets[known])]


def plain(classes: int) -> Array:
    """Give the calibration that changes nothing, shape (1 + classes,)."""
    return np.append(1.0, np.zeros(classes))
