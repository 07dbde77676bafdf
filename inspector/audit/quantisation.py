"""The steps in which a log counts, and the noise that rounding to them makes."""

import numpy as np

from inspector.audit.differentiation import Slope
from inspector.audit.spectrum import Spectrum, smoothed
from noisemodel import Run
from noisemodel.types import Array, Real

SAMPLES = 20_000
"""Samples of a signal that are looked at, evenly spread."""

LEVELS = 8
"""Different values that a signal has at least, or nothing is told from it."""

WHOLE = 0.02
"""By how much the distance of two values may miss a whole number of steps."""


def step_of(values: Real) -> float:
    """Find the step that all values of a signal are multiples of.

    Args:
        values: Shape (samples,).

    Returns:
        The step, in the signal's unit; 0 if there is none.
    """
    thinned = values[:: max(1, len(values) // SAMPLES)].astype(np.float64)
    distances = np.diff(np.unique(thinned))
    distances = distances[distances > 1e-12 * np.abs(thinned).max()]  # below: a sum's rounding
    if len(distances) < LEVELS - 1:
        return 0.0
    steps = distances / distances.min()
    fits = np.mean(np.abs(steps - np.rint(steps)) <= WHOLE) >= 0.99
    return float(distances.min()) if fits else 0.0


def steps_of(run: Run, slope: Slope | None) -> Array:
    """Find the steps of what a run's velocities come from.

    Args:
        run: The run.
        slope: How velocities were had from positions; None if they were measured.

    Returns:
        Steps of the positions if those were differentiated, else of the velocities, 0 where there
        are none, shape (joints,), in [rad] or [rad/s].
    """
    signal = run.position if slope and run.position is not None else run.velocity
    return np.array([step_of(values) for values in signal[run.mask].T])


def rounding_noise(steps: Array, spectrum: Spectrum, slope: Slope | None) -> Array:
    """Estimate the spectrum of what rounding adds to the velocities.

    Args:
        steps: Shape (joints,), in [rad/s], or in [rad] if positions were differentiated.
        spectrum: Of the velocities.
        slope: How velocities were had from positions; None if they were measured.

    Returns:
        Sum over the joints, shape (frequency,), in [(rad/s)²/Hz].
    """
    # B. Widrow, IRE Trans. Circuit Theory 3 (1956): rounding is white, of power step² / 12.
    white = float(np.square(steps).sum()) / 12.0 / (spectrum.rate / 2)
    frequency = spectrum.frequency
    gain = slope.response(frequency, spectrum.rate) if slope else np.ones(len(frequency))
    return np.asarray(white * np.square(gain))


def drowning(spectrum: Spectrum, floor: Array) -> float:
    """Find the frequency from which on a spectrum is less than twice its floor, in amplitude.

    Args:
        spectrum: Of the velocities.
        floor: What nothing can be told from, shape (frequency,), in [(rad/s)²/Hz].

    Returns:
        The frequency, in [Hz]; the Nyquist frequency if the spectrum stays above.
    """
    frequency, level = smoothed(spectrum.frequency, spectrum.total, np.mean)
    _, lowest = smoothed(spectrum.frequency, floor, np.mean)
    heard = np.flatnonzero(level > lowest + 6.0)
    # The last band is no sign of anything: filters of all kinds end there.
    heard = heard[heard < len(level) - 1]
    drowned = int(heard[-1]) + 1 if len(heard) else 0
    return float(frequency[drowned]) if drowned < len(level) - 1 else spectrum.rate / 2
