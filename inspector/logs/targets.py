"""Desired positions that are held from target to target, interpolated in place of jumping.

A policy sets targets 10 to 100 times a second, and a faster log holds each until the next: its
velocity would be a pulse at each target, which no joint was ever told to follow.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inspector.hold import hold_length, updates
from inspector.logs.resample import TimedTrack, clock_of
from inspector.text import plain
from noisemodel.types import Array, Indices

SLOWER = 1.5
"""Least ratio of the targets' hold to that of the measured values."""


def without_held_targets(
    tracks: Sequence[TimedTrack],
) -> tuple[tuple[TimedTrack, ...], tuple[str, ...]]:
    """Tracks whose held desired positions are interpolated between the samples that set them.

    Positions with a logged desired velocity are left as they are, and so are those of a log that
    holds its measured values as long. What follows the last target is cut off.

    Args:
        tracks: All tracks, on one clock.

    Returns:
        The tracks, and what was decided, a sentence each.
    """
    logged = {
        joint
        for each in tracks
        if each.track.signal == "velocity_desired"
        for joint in each.track.joints
    }
    measured = max(
        (_hold(each) for each in tracks if each.track.signal in ("position", "velocity")),
        default=1.0,
    )
    found, remarks = [], []
    for each in tracks:
        joined = None
        if each.track.signal == "position_desired" and not logged & set(each.track.joints):
            joined = _joined(each, measured)
        if joined:
            hold = _hold(each)
            remarks.append(
                f"position_desired: each target is held for {hold:.3g} samples"
                f" ({plain(each.clock.nominal / hold, 4)} Hz); interpolated from target to target"
            )
        found.append(joined or each)
    return tuple(found), tuple(remarks)


def _joined(timed: TimedTrack, measured: float) -> TimedTrack | None:
    """The track interpolated from its first target to its last; None without a hold."""
    from scipy.interpolate import Akima1DInterpolator

    values = np.asarray(timed.track.values, dtype=np.float64)
    places = updates(values, np.ones(len(values), dtype=bool))
    if places is None or _hold(timed) < SLOWER * measured:
        return None
    places = places[places < len(values)]
    held = values[places.clip(min=0)]
    held = np.where(timed.angles, np.unwrap(held, axis=0), held)
    set_at = _evenly(places)
    samples = np.arange(len(values))
    before = np.minimum(set_at, 0) / timed.clock.nominal
    known = np.interp(set_at, samples, timed.time) + before
    time = timed.time[: int(set_at[-1]) + 1]
    # Akima's polynomials hardly overshoot jumps, and meet peaks better than monotone ones.
    joined = Akima1DInterpolator(known, held, axis=0)(time)
    stamps = replace(timed.track.stamps, time=timed.track.stamps.time[: len(time)])
    track = replace(timed.track, stamps=stamps, values=joined)
    return TimedTrack(track, time, clock_of(time, held=stamps.held), timed.angles)


def _evenly(places: Indices) -> Array:
    """Places at even distances, in samples, if all are within a sample of theirs.

    A policy whose rate does not divide the log's sets targets between samples.
    """
    steps = np.diff(places)
    ticks = np.concatenate(([0.0], np.cumsum(np.round(steps / np.mean(steps)))))
    slope, first = np.polyfit(ticks, places, 1)
    even = first + slope * ticks
    chosen = even if np.abs(even - places).max() < 1 else places.astype(np.float64)
    return np.concatenate(([min(chosen[0], 0.0)], chosen[1:]))


def _hold(timed: TimedTrack) -> float:
    values = np.asarray(timed.track.values)
    return hold_length(values, np.ones(len(values), dtype=bool))
