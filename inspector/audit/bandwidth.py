"""Bandwidth of a log, and what limits it."""

from dataclasses import dataclass

import numpy as np

from inspector.audit.differentiation import Differentiator, differentiator_of
from inspector.audit.quantisation import floor_frequency, quantisation_noise, steps_of
from inspector.audit.spectrum import PER_OCTAVE, Spectrum, smoothed, spectrum
from inspector.hold import hold_length
from noiseclassifier import LogBands
from noisemodel import Run
from noisemodel.types import Array, Mask

ENCODER_NOISE = LogBands().floor
"""Least amplitude in one window of the shipped models: no encoder has less noise, in [rad/s]."""

RESOLUTION = 1.0 / LogBands().window
"""Frequency resolution of one window of those models, in [Hz]."""


@dataclass(frozen=True)
class Bandwidth:
    """The frequencies that a log holds.

    Attributes:
        nyquist: Half the sample rate, in [Hz].
        hold: Length of the zero-order hold of measured values, in samples; 1 without one.
        differentiator: How velocities were computed from positions; None if they were measured.
        corner: -3 dB frequency of a filter, in [Hz]; None without a sign of one.
        step: Largest quantisation step, in [rad/s], or in [rad] of the positions that were
            differentiated; 0 without one.
        floor_from: Frequency above which the spectrum is at the quantisation floor, in [Hz]; None
            if it stays above, or the run is too short for a spectrum.
        floor_amplitude: Largest oscillation that quantisation masks at ``floor_from``, in [rad/s].
        quiet_from: Frequency above which the level is below any encoder's noise, in [Hz]; None if
            it stays above.
    """

    nyquist: float
    hold: float = 1.0
    differentiator: Differentiator | None = None
    corner: float | None = None
    step: float = 0.0
    floor_from: float | None = None
    floor_amplitude: float = 0.0
    quiet_from: float | None = None

    @property
    def limits(self) -> dict[str, float]:
        """Upper limits of the bandwidth by their cause, in [Hz]."""
        rate = 2 * self.nyquist
        limits = {f"half the rate of {rate:g} Hz": self.nyquist}
        if self.hold > 1:
            limits[f"zero-order hold of {self.hold:.3g} samples"] = self.nyquist / self.hold
        if self.differentiator:
            limits["velocities were differentiated"] = self.differentiator.corner(rate)
        if self.corner:
            limits["the log looks filtered"] = self.corner
        return limits

    @property
    def usable(self) -> float:
        """Lowest of the limits, in [Hz]."""
        return min(self.limits.values())

    @property
    def limit(self) -> str:
        """Cause of the lowest limit."""
        return min(self.limits, key=lambda name: self.limits[name])


def bandwidth(run: Run) -> Bandwidth:
    """Measure the bandwidth of a run.

    Args:
        run: The run.

    Returns:
        Its bandwidth; without filter and quantisation floor, which require a spectrum, if no
        stretch between gaps lasts 0.4 s and 128 samples.
    """
    differentiator, hold = differentiator_of(run), hold_length(run.velocity, run.mask)
    if run.position is not None and differentiator:
        hold = max(hold, hold_length(run.position, run.mask))
    plain = Bandwidth(run.rate / 2, hold, differentiator)
    found = spectrum(run.velocity, run.rate, run.mask)
    if found is None or not found.total.any():
        return plain
    steps = steps_of(run, differentiator)
    noise = quantisation_noise(steps, found, differentiator)
    # A sine of amplitude a in a band of width b has the mean density a² / 2b.
    encoders = np.full(len(noise), ENCODER_NOISE**2 / (2 * RESOLUTION))
    floor, quiet = floor_frequency(found, noise), floor_frequency(found, encoders)
    place = min(int(np.searchsorted(found.frequency, floor)), len(noise) - 1)
    # Hold and differentiation attenuate high frequencies too, without a filter.
    attenuated = hold > 1 or differentiator is not None
    return Bandwidth(
        run.rate / 2,
        hold,
        differentiator,
        corner=None if attenuated else corner(found, np.maximum(noise, encoders)),
        step=float(steps.max()),
        floor_from=floor if floor < run.rate / 2 else None,
        floor_amplitude=(
            float(np.sqrt(2 * RESOLUTION * noise[place])) if floor < run.rate / 2 else 0.0
        ),
        quiet_from=quiet if quiet < run.rate / 2 else None,
    )


FLAT = 4.5
"""Most variation in a flat octave, less than the 6 of a first-order filter, in [dB]."""

STEEP = 9.0
"""Least slope of a filter: below second order's 12, above the 6 with which encoders and drives
attenuate white noise, in [dB] an octave."""

DROP = 15.0
"""Least attenuation of a filter within two octaves or up to the Nyquist frequency, in [dB]."""

LOUD = 0.03
"""Root mean square from which an octave is vibration, not background noise: no filter ends it. The
threshold of the scenarios' labels, in [rad/s]."""


def corner(spectrum: Spectrum, floor: Array) -> float | None:
    """Find the corner frequency of a filter.

    A robot's spectrum falls from its motion to the noise of sensors and drives, which is flat or
    falls gently. A filter shows as an octave of that noise that is flat, and a fall that is steep
    and extends to the Nyquist frequency or into the ``floor``. A vibration in one band falls
    steeply too, but is louder, or ends on noise.

    Args:
        spectrum: Of the measured velocities.
        floor: Density of the noise floor, shape (frequency,), in [(rad/s)²/Hz].

    Returns:
        Its -3 dB frequency, in [Hz]; None if there is no sign of a filter.
    """
    frequency, level = smoothed(spectrum.frequency, spectrum.total, np.median)
    _, lowest = smoothed(spectrum.frequency, floor, np.median)
    above = level > lowest + 3.0
    for place in range(len(frequency) - 2, PER_OCTAVE - 1, -1):
        flat = level[place - PER_OCTAVE : place + 1]
        end = min(place + 2 * PER_OCTAVE, len(frequency) - 1)
        drop = level[place] - level[end]
        octaves = np.log2(frequency[end] / frequency[place])
        if not above[place] or np.ptp(flat) > FLAT or drop < max(DROP, STEEP * octaves):
            continue
        octave = 10.0 ** (np.median(flat) / 10.0) * frequency[place] / 2
        if octave < LOUD**2 and _goes_on(level, above, place):
            plateau = float(np.median(flat))
            return float(frequency[np.flatnonzero(level[: place + 1] >= plateau - 3.0)[-1]])
    return None


def _goes_on(level: Array, above: Mask, place: int) -> bool:
    """Whether what follows ``place`` falls, octave by octave, into the floor or up to the end."""
    below = np.flatnonzero(~above[place:])
    end = place + int(below[0]) if len(below) else len(level) - 1
    starts = np.arange(place + 1, end - PER_OCTAVE + 1)
    falls = level[starts] - level[starts + PER_OCTAVE]
    return bool((falls >= STEEP).all())
