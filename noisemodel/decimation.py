"""Runs decimated to a lower sample rate, as a logger of that rate would have recorded them."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from typing import cast

import numpy as np

from noisemodel.errors import RunError
from noisemodel.ondemand import OnDemand, rows_at_once
from noisemodel.run import Run
from noisemodel.types import Array, Mask, Real

EDGE = 10
"""Samples at the lower rate that the low-pass filter reaches to either side."""


def decimated(run: Run, rate: float) -> Run:
    """The run at a lower rate: its velocities, low-pass filtered and decimated.

    The noise of a run at a lower rate is computed after this: it is not the decimated noise.

    Args:
        run: The run.
        rate: The lower sample rate, in [Hz].

    Returns:
        A run with its velocities alone (measured, desired, base, stages), its names, blocks and
        meta. Samples that the filter took partly from a gap are marked as not valid.

    Raises:
        RunError: If ``rate`` is above that of the run, or leaves fewer than two samples.
    """
    ratio = Fraction(rate / run.rate).limit_denominator(1000)  # jitter of 0.1 % is none
    if not 0 < ratio <= 1:
        raise RunError(f"a run of {run.rate:g} Hz cannot be decimated to {rate:g} Hz")
    samples = int(len(run.time) * ratio)
    if samples < 2:
        raise RunError(f"{run.duration:.3g} s of motion are too short for {rate:g} Hz")
    if ratio == 1:
        return run

    def optional(signal: Real | None) -> Real | None:
        return None if signal is None else _resampled(signal, ratio)

    time = run.time[0] + np.arange(samples) / rate
    valid = np.ones(samples, dtype=bool)
    for gap in np.flatnonzero(~run.mask).tolist():
        center = int(gap * ratio)
        valid[max(0, center - EDGE) : center + EDGE + 1] = False
    velocity = _without_gaps(_resampled(run.velocity, ratio), valid)
    return replace(
        run,
        time=time,
        velocity=velocity,
        velocity_desired=optional(run.velocity_desired),
        base_velocity=optional(run.base_velocity),
        stages={name: _resampled(stage, ratio) for name, stage in run.stages.items()},
        position=None,
        position_desired=None,
        effort=None,
        base_pose=None,
        valid=valid,
    )


def _resampled(signal: Real, ratio: Fraction) -> Real:
    from scipy.signal import resample_poly

    up, down = ratio.numerator, ratio.denominator
    samples = int(len(signal) * ratio)
    if not isinstance(signal, OnDemand):
        exact = signal.astype(np.float64)
        return np.asarray(resample_poly(exact, up, down, axis=0, padtype="line")[:samples])
    # What "line" means: before and after the signal goes on as from its first to its last sample.
    first, last = (signal[at : at + 1].astype(np.float64) for at in (0, len(signal) - 1))
    slope = (last - first) / (len(signal) - 1)
    reach = EDGE * max(up, down) // (up * down) + 2  # of the filter, in `down` samples

    def block(start: int, stop: int) -> Array:
        low, high = (start // up - reach) * down, (-(-stop // up) + reach) * down
        before = first + slope * np.arange(low, 0)[:, None]
        after = last + slope * np.arange(1, high - len(signal) + 1)[:, None]
        inside = signal[max(0, low) : min(high, len(signal))].astype(np.float64)
        part = np.concatenate((before, inside, after))
        found = resample_poly(part, up, down, axis=0)
        return np.asarray(found[start - low // down * up :][: stop - start])

    def rows(start: int, stop: int) -> Array:
        size = max(1, int(rows_at_once(signal) * ratio))
        edges = [*range(start, stop, size), stop]
        return np.concatenate([block(*each) for each in pairwise(edges)] or [block(start, stop)])

    return cast(Real, OnDemand((samples, signal.shape[1]), np.float64, rows))


def _without_gaps(signal: Real, valid: Mask) -> Real:
    """A signal with zeros in gaps."""
    if not isinstance(signal, OnDemand):
        signal[~valid] = 0.0
        return signal
    return cast(
        Real,
        OnDemand(
            signal.shape,
            signal.dtype,
            lambda first, stop: signal[first:stop] * valid[first:stop, None],
        ),
    )
