"""What is new in each stage of the control flow: what the stage before it does not foretell.

What counts is how suddenly velocities change: over 1 ms, less the mean of such changes over the
20 ms before. Both look back only, so that nothing shows before it happens. The change of each
joint at a stage is foretold from those at the stage before, now and up to 12 ms ago, by least
squares over quiet stretches of the same run; the rest is new. In the first stage everything is.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspector.localisation.flow import Flow, flow
from inspector.localisation.quiet import quiet
from models import Event
from noisemodel import Block, Run
from noisemodel.types import Array, Indices, Mask

SPAN = 0.001
"""Time over which a velocity's change is taken, in [s]."""
TRAIL = 0.02
"""What changes for longer than this is a motion, in [s]."""
LAGS = (0.0, 0.0005, 0.001, 0.0015, 0.002, 0.003, 0.004, 0.006, 0.008, 0.012)
"""How long ago the stage before may have done what a stage does, in [s]."""
LENGTH = 0.1
"""Of a quiet stretch, in [s]."""
WARM = TRAIL + LAGS[-1] + SPAN
"""Time that has to pass until what is new is known, in [s]."""
PARTS = 16
"""Quiet stretches that are learnt from."""
ROWS = 3000
"""Samples that the least squares are taken over, at most."""
RIDGE = 1e-3
"""Share of the mean power that keeps them determined."""


@dataclass(frozen=True, eq=False)
class News:
    """What is new in a stretch of a run.

    Attributes:
        change: What changes suddenly, shape (stages, samples, joints), in [rad/s²].
        unforetold: What of it the stage before did not foretell, of the same shape.
        whole: Norm of all changes over the joints, shape (stages, samples), in [rad/s²].
        new: That of what is new, shape (stages, samples), in [rad/s²]: what is not foretold, but
            no more than all changes, for what was foretold and stays away is no news.
    """

    change: Array
    unforetold: Array
    whole: Array
    new: Array


@dataclass(frozen=True, eq=False)
class Usual:
    """What a run's stages do when nothing fails.

    Attributes:
        weights: Of what a stage foretells about the next, shape (stages - 1, joints, lags).
        power: Mean square of what is new in each stage, shape (stages,), in [rad²/s⁴].
        peak: Its peak in one of ten quiet stretches, shape (stages,), in [rad/s²].
    """

    weights: Array
    power: Array
    peak: Array

    def news(self, stages: Flow) -> News:
        """Tell what is new in a stretch of the run."""
        change = changes(stages)
        lags = _lags(stages.rate)
        new = change.copy()
        for place, weights in enumerate(self.weights):
            for column, lag in enumerate(lags.tolist()):
                past = change[place, : change.shape[1] - lag]
                new[place + 1, lag:] -= weights[:, column] * past
        new[:, ~stages.valid] = 0.0
        whole, rest = np.linalg.norm(change, axis=2), np.linalg.norm(new, axis=2)
        return News(change, new, whole, np.minimum(whole, rest))


def usual(run: Run, failures: Sequence[Event | Block]) -> Usual:
    """Learn from the quiet stretches of a run what its stages do.

    Args:
        run: The run.
        failures: All of its failures, found and annotated.

    Returns:
        What is usual; without quiet stretches nothing is, and all is new.
    """
    parts = quiet(run, failures, length=LENGTH + WARM, most=PARTS)
    calm = [flow(run, part) for part in parts]
    stages, _, joints = (calm[0] if calm else flow(run, slice(0, 1))).velocity.shape
    lags = _lags(run.rate)
    nothing = Usual(np.zeros((stages - 1, joints, len(lags))), np.zeros(stages), np.zeros(stages))
    if not calm:
        return nothing
    warm = min(calm[0].samples(WARM), calm[0].velocity.shape[1] - 1)
    change = [changes(each) for each in calm]
    size = change[0].shape[1]
    rows = np.arange(warm, size, max(1, (size - warm) * len(change) // ROWS))
    told = np.concatenate([each[:, rows] for each in change], axis=1)
    past = np.concatenate([each[:-1, rows[:, None] - lags] for each in change], axis=1)
    past = past.transpose(0, 3, 1, 2)  # stages, joints, samples, lags
    square = past.transpose(0, 1, 3, 2) @ past
    mean = np.trace(square, axis1=2, axis2=3)[..., None, None] / len(lags)
    square = square + (RIDGE * mean + np.finfo(float).tiny) * np.eye(len(lags))
    right = np.einsum("kjsl,ksj->kjl", past, told[1:])
    weights = np.linalg.solve(square, right[..., None])[..., 0]
    known = Usual(weights, nothing.power, nothing.peak)
    new = np.array([known.news(each).new[:, warm:] for each in calm])  # parts, stages, samples
    return Usual(
        weights,
        power=np.percentile(np.square(new).mean(axis=2), 90.0, axis=0),
        peak=np.percentile(new.max(axis=2), 90.0, axis=0),
    )


def changes(stages: Flow) -> Array:
    """Tell what changes suddenly at each stage.

    Args:
        stages: A stretch of a run.

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
