"""Velocities that were not measured but differentiated from positions."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from noisemodel import Run
from noisemodel.differentiate import ORDER, WINDOW
from noisemodel.types import Array

EXACT = 1e-12
"""Largest deviation of a difference of positions, as a share of the largest velocity."""

EXAMINED = 5000
"""Samples that are compared, evenly spread, or a few more."""

COARSE = 1e-4
"""Largest share of floating-point rounding in a velocity that is compared."""


@dataclass(frozen=True)
class Differentiator:
    """Method by which velocities were computed from positions.

    Attributes:
        name: The method.
        weights: Of the positions before and after, evenly about the middle, times the rate;
            shape (taps,).
    """

    name: str
    weights: tuple[float, ...]

    def response(self, frequency: Array, rate: float) -> Array:
        """Frequency response: velocity by position.

        Args:
            frequency: Shape (frequency,), in [Hz].
            rate: Sample rate, in [Hz].

        Returns:
            Amplitude of the velocity by that of the position, shape (frequency,), in [1/s].
        """
        taps = np.arange(len(self.weights)) - (len(self.weights) - 1) / 2
        turns = np.exp(2j * np.pi * np.outer(frequency, taps) / rate)
        return np.asarray(rate * np.abs(turns @ np.array(self.weights)))

    def corner(self, rate: float) -> float:
        """-3 dB frequency of the method, in [Hz]."""
        frequency = np.linspace(0.0, rate / 2, 1001)[1:]
        kept = self.response(frequency, rate) / (2 * np.pi * frequency)
        lost = kept < np.sqrt(0.5)
        return float(frequency[np.argmax(lost)] if lost.any() else rate / 2)


def _savitzky_golay() -> tuple[float, ...]:
    """Weights of the polynomial's slope in the middle, as `noisemodel.differentiate` takes it."""
    places = np.arange(WINDOW) - WINDOW // 2
    fit = np.linalg.pinv(np.vander(places, ORDER + 1, increasing=True).astype(np.float64))
    return tuple(fit[1].tolist())


BACKWARD = Differentiator("difference to the sample before", (-1.0, 1.0))
FORWARD = Differentiator("difference to the sample after", (-1.0, 1.0))
CENTRAL = Differentiator("difference of the samples before and after", (-0.5, 0.0, 0.5))
SMOOTH = Differentiator(f"Savitzky-Golay, window {WINDOW}, order {ORDER}", _savitzky_golay())


def derived(run: Run, signal: str) -> bool:
    """Whether a run's ``meta`` states that a signal was differentiated at import.

    Args:
        run: The run.
        signal: Its name, say "velocity".
    """
    differentiated = run.meta.get("differentiated")
    return isinstance(differentiated, Mapping) and signal in differentiated


def differentiator_of(run: Run) -> Differentiator | None:
    """Method by which a run's velocities were differentiated from its positions.

    Args:
        run: The run.

    Returns:
        The method, by the run's ``meta`` or as a difference that holds in 99 of 100 samples; None
        where velocities were measured, or neither is known.
    """
    if derived(run, "velocity"):
        return SMOOTH
    if run.position is None or len(run.time) < 3:
        return None
    inner = np.flatnonzero(run.mask[:-2] & run.mask[1:-1] & run.mask[2:]) + 1
    inner = inner[:: max(1, len(inner) // EXAMINED)]
    moves = np.ptp(run.velocity[run.mask], axis=0) > 0
    if not (len(inner) and moves.any()):
        return None
    before, here, after = (
        run.position[inner + step][:, moves].astype(np.float64) for step in (-1, 0, 1)
    )
    velocity = run.velocity[inner][:, moves].astype(np.float64)
    grain = max(np.finfo(run.position.dtype).eps, np.finfo(run.velocity.dtype).eps)
    rounding = 4.0 * grain * max(np.abs(run.position).max() * run.rate, np.abs(velocity).max())
    tolerance = rounding + EXACT * np.abs(velocity).max()
    if tolerance > COARSE * np.sqrt(np.mean(np.square(velocity))):
        return None
    found = {
        BACKWARD: (here - before) * run.rate,
        FORWARD: (after - here) * run.rate,
        CENTRAL: (after - before) * run.rate / 2,
    }
    return next((how for how, v in found.items() if _same(v - velocity, tolerance)), None)


def _same(difference: Array, tolerance: float) -> bool:
    return bool(np.mean(np.abs(difference) <= tolerance) >= 0.99)
