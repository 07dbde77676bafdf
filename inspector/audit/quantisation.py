"""Quantisation steps of a log, and their noise floor."""

import numpy as np

from inspector.audit.differentiation import Differentiator
from inspector.audit.spectrum import Spectrum, smoothed
from noisemodel import Run
from noisemodel.types import Array, Real

SAMPLES = 20_000
"""Most samples of a signal that are used, evenly spread."""

LEVELS = 8
"""Fewest different values of a signal that have a step."""

WHOLE = 0.02
"""Largest deviation of the distance of two values from a whole number of steps."""


def step_of(values: Real) -> float:
    """Quantisation step of a signal.

    Args:
        values: Shape (samples,).

    Returns:
        The step of which all values are multiples, in the signal's unit; 0 if there is none.
    """
    thinned = values[:: max(1, len(values) // SAMPLES)].astype(np.float64)
    distances = np.diff(np.unique(thinned))
    distances = distances[distances > 1e-12 * np.abs(thinned).max()]  # below: a sum's rounding
    if len(distances) < LEVELS - 1:
        return 0.0
    steps = distances / distances.min()
    fits = np.mean(np.abs(steps - np.rint(steps)) <= WHOLE) >= 0.99
    return float(distances.min()) if fits else 0.0


def steps_of(run: Run, differentiator: Differentiator | None) -> Array:
    """Quantisation steps of the signal from which a run's velocities come.

    Args:
        run: The run.
        differentiator: How velocities were computed from positions; None if they were measured.

    Returns:
        Steps of the positions if those were differentiated, else of the velocities, 0 where there
        are none, shape (joints,), in [rad] or [rad/s].
    """
    signal = run.position if differentiator and run.position is not None else run.velocity
    return np.array([step_of(values) for values in signal[run.mask].T])


def quantisation_noise(
    steps: Array, spectrum: Spectrum, differentiator: Differentiator | None
) -> Array:
    """Spectrum of the quantisation noise of velocities.

    Args:
        steps: Shape (joints,), in [rad/s], or in [rad] if positions were differentiated.
        spectrum: Of the velocities.
        differentiator: How velocities were computed from positions; None if they were measured.

    Returns:
        Sum over the joints, shape (frequency,), in [(rad/s)²/Hz].
    """
    # B. Widrow, IRE Trans. Circuit Theory 3 (1956): white noise of power step² / 12.
    white = float(np.square(steps).sum()) / 12.0 / (spectrum.rate / 2)
    frequency = spectrum.frequency
    gain = np.ones(len(frequency))
    if differentiator:
        gain = differentiator.response(frequency, spectrum.rate)
    return np.asarray(white * np.square(gain))


def floor_frequency(spectrum: Spectrum, floor: Array) -> float:
    """Frequency above which a spectrum is less than twice its noise floor, in amplitude.

    Args:
        spectrum: Of the velocities.
        floor: Density of the noise floor, shape (frequency,), in [(rad/s)²/Hz].

    Returns:
        The frequency, in [Hz]; the Nyquist frequency if the spectrum stays above.
    """
    frequency, level = smoothed(spectrum.frequency, spectrum.total, np.mean)
    _, lowest = smoothed(spectrum.frequency, floor, np.mean)
    above = np.flatnonzero(level > lowest + 6.0)
    # The last band is left out: anti-aliasing filters end there.
    above = above[above < len(level) - 1]
    first = int(above[-1]) + 1 if len(above) else 0
    return float(frequency[first]) if first < len(level) - 1 else spectrum.rate / 2
