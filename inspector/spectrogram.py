"""Spectrograms: amplitude over time and frequency, and over time and periods per turn of a joint.

For orders, each window is resampled to equal steps of the joint's angle (Fyfe & Munck 1997, see
`inspector.localisation.order`): what goes with the joint's speed stays at one height.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from inspector.analysis import Analysis
from inspector.localisation.order import SLOWEST
from noisemodel.extended import vibrating
from noisemodel.runfile import pieces
from noisemodel.types import Array, Mask

WINDOW = 0.1024
"""Length of the window in [s]: the paper's 1024 samples at 10 kHz."""
COLUMNS = 400
RANGE_DB = 70.0


@dataclass(frozen=True, eq=False)
class Spectrogram:
    """Amplitudes of a signal in windows.

    Attributes:
        time: Centres of the windows, shape (columns,), in [s].
        frequency: Shape (bins,), in [Hz]; the mean is left out.
        amplitude: Shape (bins, columns), in the unit of the signal; 0 in windows that touch a gap.
        valid: False for windows that touch a gap, shape (columns,).
    """

    time: Array
    frequency: Array
    amplitude: Array
    valid: Mask

    @cached_property
    def decibel(self) -> Array:
        """Levels of the amplitudes, shape (bins, columns), in [dB]; -inf where there is none."""
        with np.errstate(divide="ignore"):
            return np.asarray(20 * np.log10(self.amplitude))

    @cached_property
    def level(self) -> Array:
        """Shape (bins, columns), in [dB] relative to the largest amplitude, at least -70."""
        largest = self.amplitude.max(initial=0.0) or 1.0
        floor = 10 ** (-RANGE_DB / 20)
        return np.asarray(20 * np.log10(np.maximum(self.amplitude / largest, floor)))


def spectrogram(signal: Array, rate: float, *, start: float, valid: Mask) -> Spectrogram:
    """Compute the spectrogram of a signal for viewing.

    Args:
        signal: Such as noise, shape (samples,).
        rate: Samples per second, in [Hz].
        start: Time of the first sample, in [s].
        valid: False in gaps, shape (samples,).
    """
    length = min(window_length(rate), len(signal))
    hop = max(1, length // 4, -(-(len(signal) - length) // (COLUMNS - 1)))
    windows = np.lib.stride_tricks.sliding_window_view(signal, length)[::hop]
    whole = np.lib.stride_tricks.sliding_window_view(valid, length)[::hop].all(axis=1)
    columns = np.arange(len(windows), dtype=np.float64)
    bins = np.arange(1, length // 2 + 1, dtype=np.float64)
    return Spectrogram(
        time=start + (columns * hop + length / 2) / rate,
        frequency=bins * rate / length,
        amplitude=amplitudes(windows).T * whole,
        valid=np.asarray(whole),
    )


def in_bands(frequency: Array, amplitude: Array, edges: Array) -> Array:
    """The largest amplitude in each of several bands, such as the bands of a logarithmic axis.

    Args:
        frequency: In order, shape (bins,).
        edges: Of the bands, in order, in the unit of the frequency, shape (bands + 1,).
    """
    firsts = np.searchsorted(frequency, edges[:-1])
    lasts = np.searchsorted(frequency, edges[1:])
    middles = np.sqrt(edges[:-1] * edges[1:])
    nearest = np.abs(frequency[:, None] - middles).argmin(axis=0)
    rows = [
        amplitude[first:last].max(axis=0) if last > first else amplitude[near]
        for first, last, near in zip(firsts, lasts, nearest, strict=True)
    ]
    return np.stack(rows)


def window_length(rate: float) -> int:
    """Length of a window, in samples; at least 8."""
    return max(round(WINDOW * rate), 8)


def amplitudes(windows: Array) -> Array:
    """Amplitude spectra of Hann windows, each freed of its mean."""
    hann = _hann(windows.shape[1])
    centred = windows - windows.mean(axis=1, keepdims=True)
    return np.asarray(np.abs(np.fft.rfft(centred * hann, axis=1))[:, 1:] * 2 / hann.sum())


@lru_cache(maxsize=4)
def _hann(length: int) -> Array:
    """Periodic Hann window."""
    return np.hanning(length + 1)[:-1]


ORDER_WINDOW = 0.8
"""Length of a window, in [s]: at 1 rad/s it resolves 8 periods per turn."""
LOWEST, HIGHEST = 10.0, 3000.0
"""Orders that are shown, in periods per turn."""
LINES = 96
"""Orders that are shown, in equal ratios."""
ORDER_COLUMNS = 200
"""Most windows."""


def orders(analysis: Analysis) -> tuple[str, Spectrogram] | None:
    """Compute the order spectrogram of the noise over the angle of one joint.

    The joint is the first finding's with an order; else the one that vibrates most while it
    moves.

    Returns:
        The joint, and amplitudes whose frequencies are orders, in periods per turn: at most 200
        columns; 0 and not valid in windows in which the joint is at rest or turns back. None if
        there are no others.
    """
    run = analysis.run
    size = round(ORDER_WINDOW * run.rate)
    if analysis.audit is None or not run.joint_names or len(run.time) < size or size < 16:
        return None
    joint = _joint(analysis)
    speed = np.concatenate(
        [run.velocity[rows][:, joint].astype(np.float64) for rows in pieces(run.velocity)]
    )
    speed = speed - vibrating(speed[:, None], run.mask, run.rate)[:, 0]
    hop = max(1, size // 8, -(-(len(speed) - size) // (ORDER_COLUMNS - 1)))
    firsts = np.arange(0, len(speed) - size + 1, hop)
    edges = np.geomspace(LOWEST, HIGHEST, LINES + 1)
    amplitude = np.zeros((LINES, len(firsts)))
    moves = np.zeros(len(firsts), dtype=bool)
    for column, first in enumerate(firsts.tolist()):
        part = slice(first, first + size)
        own = speed[part] * np.sign(speed[part].sum())
        if run.mask[part].all() and own.min() > SLOWEST:
            moves[column] = True
            amplitude[:, column] = _spectrum(analysis.noise[part], own / run.rate, edges)
    if not moves.any():
        return None
    middles = np.asarray(float(run.time[0]) + (firsts + size / 2) / run.rate, dtype=np.float64)
    shown = np.asarray(np.sqrt(edges[:-1] * edges[1:]))
    return run.joint_names[joint], Spectrogram(middles, shown, amplitude, moves)


def _joint(analysis: Analysis) -> int:
    run = analysis.run
    for known in analysis.orders.values():
        return run.joint_names.index(known.joint)
    _, level = analysis.joint_levels
    fastest = [np.abs(run.velocity[rows]).max(axis=0) for rows in pieces(run.velocity)]
    moving = np.max(fastest, axis=0) > SLOWEST
    power = np.nansum(10.0 ** (level / 10.0), axis=0)
    return int(np.argmax(np.where(moving, power, -1.0)))


def _spectrum(wave: Array, steps: Array, edges: Array) -> Array:
    """Largest amplitudes between some orders, by how far the joint turns in each sample."""
    angle = np.concatenate(([0.0], np.cumsum(steps[:-1])))
    even = np.interp(np.linspace(0.0, angle[-1], len(wave), endpoint=False), angle, wave)
    found = amplitudes(even[None])[0]
    own = np.arange(1, len(found) + 1) * 2.0 * np.pi / angle[-1]
    inside = (edges[1:] > own[0]) & (edges[:-1] < own[-1])
    return np.asarray(in_bands(own, found[:, None], edges)[:, 0] * inside)
