"""Signals with clocks of their own, brought onto one uniform time base."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from noisemodel.types import Array, Mask

ROUND = (1.0, 1.25, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
"""Round rates are these times a power of ten, in [Hz]."""

NEAR = 0.05
"""Share by which the nominal rate may miss a round one that is taken for it."""

UNIFORM = 1e-3
"""Share by which the steps of a uniform clock may differ from each other."""

GAP = 5.0
"""Nominal steps above which a step is a gap."""


@dataclass(frozen=True)
class Clock:
    """How samples lie in time.

    Attributes:
        nominal: Inverse of the median step, in [Hz].
        rate: The rate that the samples are taken to have, in [Hz].
        uniform: Whether the stamps are regular already.
        jitter_rms: Deviation of the steps from that rate's, gaps left out, in [s].
        jitter_max: The same at its largest, in [s].
        gaps: Start and end of each gap, in [s].
        stretches: The samples between gaps.
    """

    nominal: float
    rate: float
    uniform: bool
    jitter_rms: float
    jitter_max: float
    gaps: tuple[tuple[float, float], ...]
    stretches: tuple[slice, ...]


@dataclass(frozen=True)
class Track:
    """Signals with a clock of their own.

    Attributes:
        time: Rising, shape (samples,), in [s].
        table: The signals, shape (samples, columns).
        clock: How ``time`` lies.
    """

    time: Array
    table: Array
    clock: Clock


def clock_of(time: Array, rate: float | None = None) -> Clock:
    """Look at the stamps of a log.

    Args:
        time: Rising, shape (samples,), in [s].
        rate: The rate, if it is known, in [Hz].

    Returns:
        The clock. Unless given, its rate is the nominal one of uniform stamps, and of others the
        round one that this is near to.
    """
    steps = np.diff(time)
    step = float(np.median(steps))
    nominal = float(f"{1 / step:.9g}")
    uniform = bool((np.abs(steps - step) <= UNIFORM * step).all())
    if rate is None:
        rate = nominal if uniform else _round(nominal)
    uniform = uniform and abs(rate * step - 1) <= UNIFORM
    wide = np.flatnonzero(steps > GAP / rate)
    deviations = np.delete(steps, wide) - 1 / rate
    edges = [0, *(wide + 1), len(time)]
    return Clock(
        nominal=nominal,
        rate=rate,
        uniform=uniform,
        jitter_rms=float(np.sqrt(np.mean(deviations**2))),
        jitter_max=float(np.abs(deviations).max()),
        gaps=tuple((float(time[before]), float(time[before + 1])) for before in wide),
        stretches=tuple(slice(start, stop) for start, stop in pairwise(edges)),
    )


def together(tracks: Sequence[Track]) -> tuple[Array, Mask, Array]:
    """Bring tracks onto the uniform time base of the first, where all of them reach.

    Args:
        tracks: One or more, their stamps on one clock.

    Returns:
        Time, shape (instants,), in [s]; whether each instant lies outside of all gaps, shape
        (instants,); the tracks' signals side by side, 0 in gaps, shape (instants, columns). Where
        tracks do not overlap there are no instants.
    """
    first = tracks[0]
    slack = UNIFORM / first.clock.rate  # an instant may miss a last sample by rounding
    time = grid(first.time, first.clock)
    starts = max(track.time[0] for track in tracks) - slack
    stops = min(track.time[-1] for track in tracks) + slack
    time = time[(time >= starts) & (time <= stops)]
    tables, reached = zip(*(_onto(time, track, slack) for track in tracks), strict=True)
    valid = np.logical_and.reduce(reached)
    return time, valid, np.where(valid[:, None], np.hstack(tables), 0.0)


def grid(time: Array, clock: Clock) -> Array:
    """Make the uniform time base of a track: its own stamps where these are uniform already.

    Args:
        time: The track's stamps, from 0, shape (samples,), in [s].
        clock: How they lie.

    Returns:
        Time base, shape (instants,), in [s].
    """
    if clock.uniform:
        return time
    return np.arange(int(time[-1] * clock.rate + UNIFORM) + 1) / clock.rate


def _onto(instants: Array, track: Track, slack: float) -> tuple[Array, Mask]:
    """Take samples as they are where all instants fall on one, within ``slack``; else interpolate.

    Between samples values are monotonic, so that nothing overshoots; gaps are left at 0.
    """
    if track.clock.uniform:
        places = np.searchsorted(track.time, instants - slack).clip(max=len(track.time) - 1)
        if (np.abs(track.time[places] - instants) <= slack).all():
            return track.table[places], np.ones(len(instants), dtype=bool)
    from scipy.interpolate import PchipInterpolator

    values = np.zeros((len(instants), track.table.shape[1]))
    valid = np.zeros(len(instants), dtype=bool)
    for stretch in track.clock.stretches:
        known = track.time[stretch]
        if len(known) > 1:
            part = slice(*np.searchsorted(instants, [known[0] - slack, known[-1] + slack]))
            values[part] = PchipInterpolator(known, track.table[stretch], axis=0)(instants[part])
            valid[part] = True
    return values, valid


def _round(rate: float) -> float:
    """Find the round rate that a rate is near to, or leave it."""
    power = 10.0 ** np.floor(np.log10(rate))
    near = float(power * min(ROUND, key=lambda digit: abs(digit * power / rate - 1)))
    return near if abs(near / rate - 1) <= NEAR else rate
