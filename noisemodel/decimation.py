"""Runs decimated to a lower sample rate, as a logger of that rate would have recorded them."""

from dataclasses import replace
from fractions import Fraction

import numpy as np

from noisemodel.errors import RunError
from noisemodel.run import Run
from noisemodel.types import Real

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
        return None if signal is None else _resampled(signal, ratio)[:samples]

    time = run.time[0] + np.arange(samples) / rate
    valid = np.ones(samples, dtype=bool)
    for gap in np.flatnonzero(~run.mask).tolist():
        center = int(gap * ratio)
        valid[max(0, center - EDGE) : center + EDGE + 1] = False
    velocity = _resampled(run.velocity, ratio)[:samples]
    velocity[~valid] = 0.0
    return replace(
        run,
        time=time,
        velocity=velocity,
        velocity_desired=optional(run.velocity_desired),
        base_velocity=optional(run.base_velocity),
        stages={name: _resampled(stage, ratio)[:samples] for name, stage in run.stages.items()},
        position=None,
        position_desired=None,
        effort=None,
        base_pose=None,
        valid=valid,
    )


def _resampled(signal: Real, ratio: Fraction) -> Real:
    from scipy.signal import resample_poly

    resampled: Real = resample_poly(
        signal.astype(np.float64), ratio.numerator, ratio.denominator, axis=0, padtype="line"
    )
    return resampled
