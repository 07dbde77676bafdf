"""Innovation of each stage of the control flow: its changes less their linear prediction.

Sudden changes of velocities are used: over 1 ms, less the mean of such changes over the past
20 ms. Both filters are causal, so that nothing shows before it happens. The change of each joint
at a stage is predicted from those at the stage before, now and up to 12 ms ago, by least squares
over quiet stretches of the same run; the prediction residual is the innovation. The first stage
has no prediction.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspector.localisation.flow import Flow, flow
from inspector.localisation.quiet import quiet_stretches
from noiseclassifier import Event
from noisemodel import Block, Run
from noisemodel.types import Array, Indices, Mask

SPAN = 0.001
"""Time over which a velocity's change is taken, in [s]."""
TRAIL = 0.02
"""Time of the mean that is subtracted from changes, in [s]."""
LAGS = (0.0, 0.0005, 0.001, 0.0015, 0.002, 0.003, 0.004, 0.006, 0.008, 0.012)
"""Lags of the prediction, in [s]."""
LENGTH = 0.1
"""Length of a quiet stretch, in [s]."""
WARM = TRAIL + LAGS[-1] + SPAN
"""Transient of filters and prediction, in [s]."""
PARTS = 16
"""Most quiet stretches that the prediction is fitted to."""
ROWS = 3000
"""Most samples of the least squares."""
RIDGE = 1e-3
"""Regularisation of the least squares, as a share of the mean power."""


@dataclass(frozen=True, eq=False)
class Innovation:
    """Innovation of a stretch of a run.

    Attributes:
        change: Sudden changes, shape (stages, samples, joints), in [rad/s²].
        residual: Their prediction residual, of the same shape.
        total: Norm of the changes over the joints, shape (stages, samples), in [rad/s²].
        level: Norm of the residual, but no more than ``total``, shape (stages, samples), in
            [rad/s²]: a change that was predicted and does not occur is no innovation.
    """

    change: Array
    residual: Array
    total: Array
    level: Array


@dataclass(frozen=True, eq=False)
class QuietStatistics:
    """Prediction and innovation of a run's stages in its quiet stretches.

    Attributes:
        weights: Of the linear prediction of each stage but the first, shape
            (stages - 1, joints, lags).
        power: 90th percentile over the stretches of the innovation's mean square, shape
            (stages,), in [rad²/s⁴].
        peak: 90th percentile of its peak, shape (stages,), in [rad/s²].
    """

    weights: Array
    power: Array
    peak: Array

    def innovation(self, stages: Flow) -> Innovation:
        """Compute the innovation of a stretch of the run."""
        change = changes(stages)
        lags = _lags(stages.rate)
        residual = change.copy()
        for place, weights in enumerate(self.weights):
            for column, lag in enumerate(lags.tolist()):
                past = change[place, : change.shape[1] - lag]
                residual[place + 1, lag:] -= weights[:, column] * past
        residual[:, ~stages.valid] = 0.0
        total, rest = np.linalg.norm(change, axis=2), np.linalg.norm(residual, axis=2)
        return Innovation(change, residual, total, np.minimum(total, rest))


def quiet_statistics(run: Run, failures: Sequence[Event | Block]) -> QuietStatistics:
    """Fit the prediction to the quiet stretches of a run, and measure its residual there."""
    parts = quiet_stretches(run, failures, length=LENGTH + WARM, most=PARTS)
    stretches = [flow(run, part) for part in parts]
    first = stretches[0] if stretches else flow(run, slice(0, 1))
    stages, _, joints = first.velocity.shape
    lags = _lags(run.rate)
    zeros = np.zeros(stages)
    if not stretches:
        return QuietStatistics(np.zeros((stages - 1, joints, len(lags))), zeros, zeros)
    warm = min(first.samples(WARM), first.velocity.shape[1] - 1)
    change = [changes(each) for each in stretches]
    size = change[0].shape[1]
    rows = np.arange(warm, size, max(1, (size - warm) * len(change) // ROWS))
    target = np.concatenate([each[:, rows] for each in change], axis=1)
    past = np.concatenate([each[:-1, rows[:, None] - lags] for each in change], axis=1)
    past = past.transpose(0, 3, 1, 2)  # stages, joints, samples, lags
    square = past.transpose(0, 1, 3, 2) @ past
    mean = np.trace(square, axis1=2, axis2=3)[..., None, None] / len(lags)
    square = square + (RIDGE * mean + np.finfo(float).tiny) * np.eye(len(lags))
    right = np.einsum("kjsl,ksj->kjl", past, target[1:])
    weights = np.linalg.solve(square, right[..., None])[..., 0]
    fitted = QuietStatistics(weights, zeros, zeros)
    # stretches, stages, samples
    level = np.array([fitted.innovation(each).level[:, warm:] for each in stretches])
    return QuietStatistics(
        weights,
        power=np.percentile(np.square(level).mean(axis=2), 90.0, axis=0),
        peak=np.percentile(level.max(axis=2), 90.0, axis=0),
    )


def changes(stages: Flow) -> Array:
    """Sudden changes at each stage.

    Returns:
        Shape (stages, samples, joints), in [rad/s²]; 0 next to gaps.
    """
    return sudden(stages.velocity, stages.valid, stages.rate)


def sudden(velocity: Array, valid: Mask, rate: float) -> Array:
    """Change over 1 ms, less the mean of such changes over the past 20 ms.

    Args:
        velocity: Shape (..., samples, joints), in [rad/s].
        valid: False in gaps, shape (samples,).
        rate: Samples per second, in [Hz].

    Returns:
        Of the same shape, in [rad/s²]; 0 next to gaps.
    """
    step = max(1, round(SPAN * rate))
    trail = max(1, round(TRAIL * rate), 2 * step)
    change = np.zeros_like(velocity)
    together = valid[step:] & valid[:-step]
    change[..., step:, :] = (velocity[..., step:, :] - velocity[..., :-step, :]) * rate / step
    change[..., step:, :][..., ~together, :] = 0.0
    samples = change.shape[-2]
    sums = np.zeros((*change.shape[:-2], samples + 1, change.shape[-1]))
    np.cumsum(change, axis=-2, out=sums[..., 1:, :])
    last = np.arange(1, samples + 1)
    first = np.maximum(0, last - trail)
    change -= (sums[..., last, :] - sums[..., first, :]) / (last - first)[:, None]
    change[..., ~valid, :] = 0.0
    return change


def _lags(rate: float) -> Indices:
    return np.unique(np.round(np.array(LAGS) * rate).astype(np.int64))
