"""The simplified noise estimate: all that the paper keeps."""

import numpy as np

from noisemodel.errors import NoiseModelError
from noisemodel.types import Array, Real

CHUNK = 4096
"""Samples that are squared at once: few enough for the cache."""


def simplified(velocity: Real, velocity_desired: Real | None = None) -> Array:
    """Estimate a robot's noise pressure from its joint velocities, all constants 1.

    Args:
        velocity: Measured velocities, those of a floating base included,
            shape (samples, n), in [rad/s] and [m/s].
        velocity_desired: Desired joint velocities, shape (samples, m); none counts as zero.

    Returns:
        The noise estimate p_hat, shape (samples,), in [rad/s].

    Raises:
        NoiseModelError: If an array is not two-dimensional or the lengths differ.
    """
    power = _power(velocity)
    if velocity_desired is not None:
        if len(velocity_desired) != len(velocity):
            raise NoiseModelError(
                f"velocity has {len(velocity)} samples, velocity_desired {len(velocity_desired)}"
            )
        power = power + _power(velocity_desired)
    return np.sqrt(power)  # p_hat = sqrt(|qd|^2 + |qd_desired|^2), Sygulla & Rixen, Sec. II-A


def _power(velocity: Real) -> Array:
    if velocity.ndim != 2:
        raise NoiseModelError(f"velocities of shape {velocity.shape}, expected (samples, joints)")
    power = np.empty(len(velocity))
    for start in range(0, len(velocity), CHUNK):
        part = slice(start, start + CHUNK)
        exact = velocity[part].astype(np.float64, copy=False)
        np.einsum("sj,sj->s", exact, exact, out=power[part])
    return power
