"""Sensors of the domains elsewhere: what a log has in place of the simulated motion."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from noisemodel.types import Array

# Standard deviation of the white noise of a measured velocity, in [rad/s].
NOISE: Mapping[str, float] = MappingProxyType(
    {"exact": 0.0, "1 mrad/s": 1e-3, "5 mrad/s": 5e-3, "20 mrad/s": 2e-2}
)
# Encoders whose positions are differentiated and filtered.
BITS: Mapping[str, int] = MappingProxyType({"20 bit": 20, "17 bit": 17, "14 bit": 14})
SENSORS = (*NOISE, *BITS)


def sensed(
    position: Array, velocity: Array, *, sensor: str, rate: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Positions and velocities as a sensor measures them.

    Args:
        position: Joint positions, shape (samples, joints), in [rad].
        velocity: Joint velocities, shape (samples, joints), in [rad/s].
        rate: Sample rate, in [Hz].
    """
    if sensor in NOISE:
        return position, velocity + NOISE[sensor] * rng.standard_normal(velocity.shape)
    from scipy.signal import butter, sosfilt

    step = 2 * np.pi / 2 ** BITS[sensor]
    counted = step * np.round(position / step)
    raw = np.diff(counted, axis=0, prepend=counted[:1]) * rate
    cut_off = min(rng.uniform(30.0, 150.0), 0.4 * rate)
    return counted, sosfilt(butter(1, cut_off, fs=rate, output="sos"), raw, axis=0)
