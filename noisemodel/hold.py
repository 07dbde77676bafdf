"""Zero-order hold: slow signals that were sampled faster, each value held until the next."""

import numpy as np

from noisemodel.runfile import pieces
from noisemodel.types import Array, Indices, Mask, Real

FEWEST = 10  # fewest jumps that show a hold
REGULAR = 0.8  # least share of the jumps that come at the median distance
EXAMINED = 100_000  # jumps whose size is examined, evenly spread, or a few more
LARGER = 1.5  # least ratio of median to smallest jump: jumps of one size are quantisation
NEAR = 1.5  # samples within which those of an even hold are from where it sets values
EVEN = 0.99  # least share of them that are


def hold_length(signal: Real, valid: Mask | None = None) -> float:
    """Length of the zero-order hold of a signal, in samples; ``valid`` is False in gaps."""
    return jumps(signal, valid)[0]


def updates(signal: Real, valid: Mask | None = None) -> tuple[float, Indices]:
    """Length of a hold, and the samples at which the values were set, the first perhaps below 0."""
    hold, changed = jumps(signal, valid)
    places = np.flatnonzero(changed)
    if hold <= 1:
        return hold, places
    first = places[0] + 1
    changes = np.concatenate(([first - hold * np.ceil(first / hold)], places + 1, [len(signal)]))
    # A value that rests was set again and again.
    counts = np.maximum(1, np.round(np.diff(changes) / hold)).astype(np.int64)
    ticks = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return hold, np.round(np.repeat(changes[:-1], counts) + hold * ticks).astype(np.int64)


def moments(places: Indices) -> Array:
    """When the values of a hold were set, in samples, by the samples at which it shows.

    They are at even distances if nearly all are within a sample of theirs, and half a sample of
    jitter: a policy whose rate does not divide the log's sets targets between samples.
    """
    ticks = np.arange(len(places))
    slope, first = np.polyfit(ticks, places, 1)
    even = first + slope * ticks
    return even if np.mean(np.abs(even - places) < NEAR) > EVEN else places.astype(np.float64)


def joined(values: Array, places: Indices, set_at: Array) -> Array:
    """Held values, shape (samples, columns), interpolated between the samples that set them.

    ``places`` are these samples and ``set_at`` when they were set, in samples; those outside of the
    values but the last before them do not count. After the last one the values go on as before.
    """
    from scipy.interpolate import Akima1DInterpolator

    inside = slice(
        max(0, np.searchsorted(places, 0, side="right") - 1), np.searchsorted(places, len(values))
    )
    known, when = values[places[inside].clip(min=0)], set_at[inside]
    if len(known) < 2:
        return values
    known = np.concatenate((known, 2 * known[-1:] - known[-2:-1]))
    when = np.append(when, max(2 * when[-1] - when[-2], len(values)))
    # Akima's polynomials hardly overshoot jumps, and meet peaks better than monotone ones.
    curve = Akima1DInterpolator(when, known, axis=0, extrapolate=True)
    return np.asarray(curve(np.arange(len(values))))


def jumps(signal: Real, valid: Mask | None) -> tuple[float, Mask]:
    """Length of a hold, 1 without, and whether the next sample is another one, outside of gaps."""
    changed = np.ones(len(signal) - 1, dtype=bool) if valid is None else valid[1:] & valid[:-1]
    for rows in pieces(signal):
        part = signal[rows.start : rows.stop + 1]
        changed[rows.start : rows.stop] &= (part[1:] != part[:-1]).any(axis=1)
    count = np.count_nonzero(changed)
    # With more pairs of jumps than that, their median distance is less than 2.
    if count < FEWEST or 2 * np.count_nonzero(changed[1:] & changed[:-1]) >= count - 1:
        return 1.0, changed
    places = np.flatnonzero(changed)
    distances = np.diff(places)
    middle = np.median(distances)
    regular = np.abs(distances - middle) <= max(1.0, 0.1 * middle)
    if regular.mean() < REGULAR:
        return 1.0, changed
    places = places[:: max(1, len(places) // EXAMINED)]
    sizes = np.abs(signal[places + 1].astype(np.float64) - signal[places])
    sizes = np.where(sizes > 0, sizes, np.nan)
    sizes = sizes[:, ~np.isnan(sizes).all(axis=0)]
    if (np.nanmedian(sizes, axis=0) < LARGER * np.nanmin(sizes, axis=0)).all():
        return 1.0, changed  # each joint jumps by one quantisation step
    return float(distances[regular].mean()), changed
