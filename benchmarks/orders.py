"""Order tracking: what is locked to a joint's angle, in periods per turn of the joint.

Gears repeat with the angle: teeth that pass n times per turn shake the joint at n |qd| / 2 pi, a
frequency that smears as the speed changes. At equal steps of the angle it is one line, at order n
(computed order tracking, Fyfe and Munck 1997).
"""

import numpy as np

from noisemodel.differentiate import stretches
from noisemodel.types import Array, Mask

SLOWEST = 0.05
"""Slower motion is left out, in [rad/s]."""
SPAN = 0.3
"""Angle over which one spectrum is taken, in [rad]: motions at home are hardly longer. Lines are
2 pi / 0.3 = 21 orders wide."""
TURN = 8192
"""Steps of the angle per turn."""
PADDED = 2048
"""Length of the transform: orders are 4 apart."""
ORDERS: Array = np.fft.rfftfreq(PADDED, 1 / TURN)
"""Orders of the spectra, in periods per turn of the joint."""


def order_spectra(velocity: Array, *, rate: float, valid: Mask | None = None) -> Array:
    """Amplitudes of one joint's velocity by order, in each part of its motion.

    In each stretch of motion in one direction the velocity is interpolated at equal steps of the
    angle, its integral. Parts of ``SPAN`` that overlap by half are freed of their quadratic trend
    and weighted by a Hann window.

    Args:
        velocity: Shape (samples,), in [rad/s].
        rate: Sample rate, in [Hz].
        valid: False in gaps, shape (samples,).

    Returns:
        At ``ORDERS``, shape (parts, orders), in [rad/s].
    """
    velocity = np.asarray(velocity, dtype=np.float64)
    inside = np.isfinite(velocity) if valid is None else np.asarray(valid)
    step = 2 * np.pi / TURN
    length = round(SPAN / step)
    place, window = np.linspace(-1, 1, length), np.hanning(length)
    spectra = []
    for sign in (-1.0, 1.0):
        for stretch in stretches(inside & (sign * velocity > SLOWEST), len(velocity)):
            speed = sign * velocity[stretch]
            angle = np.r_[0.0, np.cumsum(speed[1:] + speed[:-1]) / 2 / rate]
            even = np.interp(np.arange(0.0, angle[-1], step), angle, speed)
            for first in range(0, len(even) - length + 1, length // 2):
                part = even[first : first + length]
                part = part - np.polyval(np.polyfit(place, part, 2), place)
                spectra.append(np.abs(np.fft.rfft(window * part, PADDED)) * 2 / window.sum())
    return np.array(spectra).reshape(-1, len(ORDERS))
