"""Signals with separate clocks, resampled to one uniform time base."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from inspector.errors import InspectorError
from inspector.logs.floatingbase import interpolated
from inspector.logs.log import Track
from noisemodel.checks import LONGEST, SHORTEST
from noisemodel.types import Array, Indices, Mask, Real

ROUND = (1.0, 1.25, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
"""Round rates are these, times a power of ten, in [Hz]."""

NEAR = 0.05
"""Largest relative difference of a nominal rate to the round one that replaces it."""

UNIFORM = 1e-3
"""Largest relative deviation of a uniform clock's steps from their median."""

GAP = 5.0
"""Length of a step, in nominal ones, above which it is a gap."""

BLOCK = 500_000
"""Values that are interpolated at once, which takes about ten times their memory."""


@dataclass(frozen=True)
class Clock:
    """Rate, jitter and gaps of timestamps.

    Attributes:
        nominal: Inverse of the median step, in [Hz].
        rate: The rate that is used, in [Hz].
        uniform: Whether the stamps are uniform.
        jitter_rms: Root mean square deviation of the steps from that rate's, without gaps, in [s].
        jitter_max: Largest deviation, in [s].
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


@dataclass(frozen=True, eq=False)
class TimedTrack:
    """A track with its times on the common clock.

    Attributes:
        track: The signal as it was logged.
        time: Increasing, shape (samples,), in [s].
        clock: Clock of ``time``.
        angles: Whether each column is an angle, which may wrap.
    """

    track: Track
    time: Array
    clock: Clock
    angles: Sequence[bool]


def clock_of(time: Array, rate: float | None = None, *, held: bool = False) -> Clock:
    """Clock of the stamps of a log.

    Args:
        time: Increasing, shape (samples,), in [s].
        rate: The rate, if known, in [Hz].
        held: Whether values apply between stamps however far apart, so that there are no gaps.

    Returns:
        The clock. Unless given, its rate is the nominal one of uniform stamps, and otherwise the
        nearest round one.
    """
    steps = np.diff(time)
    step = float(np.median(steps))
    if not SHORTEST <= step <= LONGEST:
        raise InspectorError(
            f"the stamps' median step is {step:g} s, expected {SHORTEST:g} s to {LONGEST:g} s"
        )
    nominal = float(f"{1 / step:.9g}")
    uniform = bool((np.abs(steps - step) <= UNIFORM * step).all())
    if rate is None:
        rate = nominal if uniform else _round(nominal)
    uniform = uniform and abs(rate * step - 1) <= UNIFORM
    wide = np.flatnonzero(steps > GAP / rate) if not held else np.empty(0, dtype=np.int64)
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


def common_time(tracks: Sequence[TimedTrack], main: TimedTrack) -> tuple[Array, Mask]:
    """Uniform time base of a run, over the time that all tracks cover.

    Args:
        tracks: All tracks.
        main: The track whose rate the run has; its time starts at 0.

    Returns:
        Time, shape (instants,), in [s], and whether each instant is outside of all gaps; no
        instants if the tracks do not overlap.
    """
    slack = UNIFORM / main.clock.rate  # tolerance for rounding at the last sample
    time = grid(main.time, main.clock)
    starts = max(track.time[0] for track in tracks) - slack
    stops = min(track.time[-1] for track in tracks) + slack
    time = time[(time >= starts) & (time <= stops)]
    valid = np.ones(len(time), dtype=bool)
    for track in {id(track.track.stamps): track for track in tracks}.values():
        valid &= _covered(time, track, slack)
    for track in tracks:
        if track.track.missing is not None:
            valid &= ~_beside(time, track, track.track.missing, slack)
    return time, valid


def grid(time: Array, clock: Clock) -> Array:
    """Uniform time base of a track: its own stamps if these are uniform.

    Args:
        time: The track's stamps, from 0, shape (samples,), in [s].
        clock: Their clock.

    Returns:
        Time base, shape (instants,), in [s].
    """
    if clock.uniform:
        return time
    return np.arange(int(time[-1] * clock.rate + UNIFORM) + 1) / clock.rate


def resampled(instants: Array, valid: Mask, track: TimedTrack, *, slack: float) -> Real:
    """Values of a track on a time base.

    If each instant coincides with a sample, within ``slack``, samples are not changed; else they
    are interpolated monotonically (PCHIP), without overshoot.

    Args:
        instants: The time base, shape (instants,), in [s].
        valid: False in gaps, shape (instants,).
        track: The track.
        slack: Largest difference of coinciding times, in [s].

    Returns:
        Values, 0 in gaps, shape (instants, columns).
    """
    places = _places(instants, track, slack)
    if places is not None:
        if valid.all() and places[-1] - places[0] == len(places) - 1:
            return track.track.values[places[0] : places[-1] + 1]  # no copy of a long log
        return np.where(valid[:, None], track.track.values[places], 0.0)
    if track.track.signal == "base_pose":
        pose = np.asarray(track.track.values, dtype=np.float64)
        found = interpolated(pose, lambda values: _interpolated(instants, track, values, slack))
    else:
        found = np.empty((len(instants), track.track.values.shape[1]))
        block = max(1, BLOCK // len(track.time))
        for first in range(0, found.shape[1], block):
            part = slice(first, first + block)
            values = np.asarray(track.track.values[:, part], dtype=np.float64)
            angles = track.angles[part]
            if any(angles):
                values = np.where(angles, np.unwrap(values, axis=0), values)
            found[:, part] = _interpolated(instants, track, values, slack)
    found[~valid] = 0.0
    return found


def _places(instants: Array, track: TimedTrack, slack: float) -> Indices | None:
    """Index of the sample at each instant; None if an instant has none."""
    if not track.clock.uniform:
        return None
    places = np.searchsorted(track.time, instants - slack).clip(max=len(track.time) - 1)
    return places if (np.abs(track.time[places] - instants) <= slack).all() else None


def _covered(instants: Array, track: TimedTrack, slack: float) -> Mask:
    if _places(instants, track, slack) is not None:
        return np.ones(len(instants), dtype=bool)
    reached = np.zeros(len(instants), dtype=bool)
    for part, _ in _parts(instants, track, slack):
        reached[part] = True
    return reached


def _beside(instants: Array, track: TimedTrack, missing: Mask, slack: float) -> Mask:
    """Whether a missing sample is at an instant, or next to one between samples."""
    after = np.searchsorted(track.time, instants - slack).clip(max=len(track.time) - 1)
    between = np.abs(track.time[after] - instants) > slack
    return np.asarray(missing[after] | (between & missing[np.maximum(after - 1, 0)]))


def _interpolated(instants: Array, track: TimedTrack, values: Real, slack: float) -> Array:
    from scipy.interpolate import PchipInterpolator

    found = np.zeros((len(instants), values.shape[1]))
    for part, stretch in _parts(instants, track, slack):
        if part.stop > part.start:
            known = PchipInterpolator(track.time[stretch], values[stretch], axis=0)
            found[part] = known(instants[part])
    return found


def _parts(instants: Array, track: TimedTrack, slack: float) -> Iterator[tuple[slice, slice]]:
    """The instants within each stretch between gaps, and the stretch's samples."""
    for stretch in track.clock.stretches:
        known = track.time[stretch]
        if len(known) > 1:
            edges = np.searchsorted(instants, [known[0] - slack, known[-1] + slack])
            yield slice(int(edges[0]), int(edges[1])), stretch


def _round(rate: float) -> float:
    """The nearest round rate, or the rate itself if none is near."""
    power = 10.0 ** np.floor(np.log10(rate))
    near = float(power * min(ROUND, key=lambda digit: abs(digit * power / rate - 1)))
    return near if abs(near / rate - 1) <= NEAR else rate
