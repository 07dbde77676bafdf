"""The corner of a filter that a log went through: where a flat spectrum breaks off for good."""

import numpy as np

from inspector.audit.spectrum import PER_OCTAVE, Spectrum, smoothed
from noisemodel.types import Array, Mask

FLAT = 4.5
"""By how much a flat octave may vary, less than a filter of first order takes, 6, in [dB]."""

STEEP = 9.0
"""Slope from which a fall is a filter's: below second order's 12, above what encoders and drives
do to white noise, 6, in [dB] an octave."""

DROP = 15.0
"""What a filter takes away at least, within two octaves or up to the Nyquist frequency, in [dB]."""

LOUD = 0.03
"""Root mean square from which an octave is no background noise but vibration, whose end is no
filter's doing: what the scenarios' labels call felt, in [rad/s]."""


def corner(spectrum: Spectrum, floor: Array) -> float | None:
    """Find where a filter sets in.

    A robot's spectrum falls from its motion to the noise of sensors and drives, which is flat or
    falls gently. A filter shows as an octave of that noise that is flat, and a fall that is steep
    and goes on to the Nyquist frequency or into the ``floor``. A vibration in one band falls
    steeply too, but is louder, or ends on noise.

    Args:
        spectrum: Of the measured velocities.
        floor: Density that nothing can be told from, shape (frequency,), in [(rad/s)²/Hz].

    Returns:
        The frequency at which it takes 3 dB, in [Hz]; None if there is no sign of a filter.
    """
    frequency, level = smoothed(spectrum.frequency, spectrum.total, np.median)
    _, lowest = smoothed(spectrum.frequency, floor, np.median)
    heard = level > lowest + 3.0
    for place in range(len(frequency) - 2, PER_OCTAVE - 1, -1):
        flat = level[place - PER_OCTAVE : place + 1]
        end = min(place + 2 * PER_OCTAVE, len(frequency) - 1)
        drop = level[place] - level[end]
        octaves = np.log2(frequency[end] / frequency[place])
        if not heard[place] or np.ptp(flat) > FLAT or drop < max(DROP, STEEP * octaves):
            continue
        octave = 10.0 ** (np.median(flat) / 10.0) * frequency[place] / 2
        if octave < LOUD**2 and _goes_on(level, heard, place):
            plateau = float(np.median(flat))
            return float(frequency[np.flatnonzero(level[: place + 1] >= plateau - 3.0)[-1]])
    return None


def _goes_on(level: Array, heard: Mask, place: int) -> bool:
    """Whether what follows ``place`` falls, octave by octave, into the floor or up to the end."""
    silent = np.flatnonzero(~heard[place:])
    end = place + int(silent[0]) if len(silent) else len(level) - 1
    starts = np.arange(place + 1, end - PER_OCTAVE + 1)
    falls = level[starts] - level[starts + PER_OCTAVE]
    return bool((falls >= STEEP).all())
