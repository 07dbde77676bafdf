"""The level of each joint's vibration in octaves over time."""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from noisemodel import Run
from noisemodel.types import Array, Real

WINDOW, STEP = 0.2, 0.1
"""Length of the windows and time from one to the next, in [s]."""
LOWEST = 16.0
"""Centre of the lowest octave, in [Hz]: what is slower is motion."""
CHUNK = 64
"""Windows that are transformed at once."""


@dataclass(frozen=True, eq=False)
class Levels:
    """Mean squares of joint velocities by octave, in Hann windows of 0.2 s every 0.1 s.

    Attributes:
        time: Middles of the windows that touch no gap, shape (steps,), in [s].
        joints: Names of the joints.
        bands: Centres of the octaves, shape (bands,), in [Hz].
        power: Shape (steps, joints, bands), in [rad²/s²].
    """

    time: Array
    joints: tuple[str, ...]
    bands: tuple[float, ...]
    power: Array


def octaves(rate: float) -> tuple[float, ...]:
    """Centres of the octaves from 16 Hz that end below half a rate, in [Hz]."""
    count = int(np.floor(np.log2(rate / 2 / LOWEST / np.sqrt(2)))) + 1
    return tuple(LOWEST * 2**place for place in range(max(count, 0)))


def edges(centre: float) -> tuple[float, float]:
    """Limits of an octave, in [Hz]."""
    return centre / np.sqrt(2), centre * np.sqrt(2)


def levels(run: Run) -> Levels:
    """Compute the mean squares of a run's joint velocities by octave and time.

    Args:
        run: A run.

    Returns:
        The powers; no step if the run is shorter than a window, no band if its rate is below 46 Hz.
    """
    size, hop = round(WINDOW * run.rate), max(1, round(STEP * run.rate))
    bands = octaves(run.rate)
    firsts = np.arange(0, len(run.time) - size + 1, hop)
    lost = np.concatenate(([0], np.cumsum(~run.mask)))
    firsts = firsts[lost[firsts + size] == lost[firsts]]
    window = np.hanning(size + 1)[:-1] if size > 1 else np.ones(1)
    frequency = np.fft.rfftfreq(size, 1 / run.rate)
    inside = np.array(
        [(frequency >= low) & (frequency < high) for low, high in map(edges, bands)]
    ).reshape(len(bands), len(frequency))
    parts = [
        _power(run.velocity, firsts[place : place + CHUNK], window) @ inside.T
        for place in range(0, len(firsts), CHUNK)
    ]
    empty = np.zeros((0, len(run.joint_names), len(bands)))
    return Levels(
        time=run.time[firsts] + (size - 1) / 2 / run.rate,
        joints=run.joint_names,
        bands=bands,
        power=np.concatenate([empty, *parts]),
    )


def _power(velocity: Real, firsts: Array, window: Array) -> Array:
    """Periodograms of windows, shape (windows, joints, frequencies); they add up to the power."""
    part = velocity[firsts[0] : firsts[-1] + len(window)]
    views = sliding_window_view(part, len(window), axis=0)[firsts - firsts[0]].astype(np.float64)
    amplitudes = np.fft.rfft((views - views.mean(axis=-1, keepdims=True)) * window, axis=-1)
    return np.asarray(2 * np.abs(amplitudes) ** 2 / (len(window) * np.sum(window**2)))
