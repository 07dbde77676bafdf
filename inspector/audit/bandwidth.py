"""How far up a log reaches, and what stops it."""

from dataclasses import dataclass

import numpy as np

from inspector.audit.differentiation import Slope, slope_of
from inspector.audit.hold import held_for
from inspector.audit.quantisation import drowning, rounding_noise, steps_of
from inspector.audit.spectrum import PER_OCTAVE, Spectrum, smoothed, spectrum
from models import LogBands
from noisemodel import Run
from noisemodel.types import Array, Mask

ENCODERS = LogBands().floor
"""Amplitude in one window of the models that ship below which all is the same to them, since no
encoder is that quiet, in [rad/s]."""

RESOLUTION = 1.0 / LogBands().window
"""Width of what one window of those models tells apart, in [Hz]."""


@dataclass(frozen=True)
class Bandwidth:
    """The frequencies that a log holds.

    Attributes:
        nyquist: Half the sample rate, in [Hz].
        held: Samples for which each measured value is held; 1 if none is.
        slope: How velocities were had from positions; None if they were measured.
        corner: Where a filter takes 3 dB, in [Hz]; None without a sign of one.
        step: Largest step that values are rounded to, in [rad/s], or in [rad] of the positions
            that were differentiated; 0 without one.
        drowned: Above this there is hardly more than rounding, in [Hz]; None if there is more up to
            the end, or too little time to tell.
        hidden: What rounding hides: amplitude of an oscillation at ``drowned``, in [rad/s].
        quiet: Above this the signal is quieter than any encoder, in [Hz]; None if it is not.
    """

    nyquist: float
    held: float = 1.0
    slope: Slope | None = None
    corner: float | None = None
    step: float = 0.0
    drowned: float | None = None
    hidden: float = 0.0
    quiet: float | None = None

    @property
    def limits(self) -> dict[str, float]:
        """What lets nothing through above a frequency, and that, in [Hz]."""
        rate = 2 * self.nyquist
        limits = {f"half the rate of {rate:g} Hz": self.nyquist}
        if self.held > 1:
            limits[f"values are held for {self.held:.3g} samples"] = self.nyquist / self.held
        if self.slope:
            limits["velocities were differentiated"] = self.slope.corner(rate)
        if self.corner:
            limits["the log looks filtered"] = self.corner
        return limits

    @property
    def usable(self) -> float:
        """The lowest of the limits, in [Hz]."""
        return min(self.limits.values())

    @property
    def limit(self) -> str:
        """What sets the lowest limit."""
        return min(self.limits, key=lambda name: self.limits[name])


def bandwidth(run: Run) -> Bandwidth:
    """Measure how far up a run reaches.

    Args:
        run: The run.

    Returns:
        Its bandwidth. What takes a spectrum to tell (a filter, drowning in rounding) is left open
        where no stretch between gaps lasts 0.4 s and 128 samples.
    """
    slope, held = slope_of(run), held_for(run.velocity, run.mask)
    if run.position is not None and slope:
        held = max(held, held_for(run.position, run.mask))
    plain = Bandwidth(run.rate / 2, held, slope)
    found = spectrum(run.velocity, run.rate, run.mask)
    if found is None or not found.total.any():
        return plain
    steps = steps_of(run, slope)
    noise = rounding_noise(steps, found, slope)
    # A sine of amplitude a in a band of width b has the mean density a² / 2b.
    encoders = np.full(len(noise), ENCODERS**2 / (2 * RESOLUTION))
    drowned, quiet = drowning(found, noise), drowning(found, encoders)
    place = min(int(np.searchsorted(found.frequency, drowned)), len(noise) - 1)
    # Held or differentiated values fall off by themselves: that is no filter's doing.
    natural = held > 1 or slope is not None
    return Bandwidth(
        run.rate / 2,
        held,
        slope,
        corner=None if natural else corner(found, np.maximum(noise, encoders)),
        step=float(steps.max()),
        drowned=drowned if drowned < run.rate / 2 else None,
        hidden=float(np.sqrt(2 * RESOLUTION * noise[place])) if drowned < run.rate / 2 else 0.0,
        quiet=quiet if quiet < run.rate / 2 else None,
    )


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
