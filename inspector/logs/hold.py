"""Zero-order hold: a slow signal that was sampled faster by holding its values, and without it."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from noiseclassifier.types import Index
from noisemodel import Run
from noisemodel.run import SAMPLED
from noisemodel.runfile import OnDemand, pieces
from noisemodel.types import Mask, Real

FEWEST = 10
"""Fewest jumps that show a hold."""

REGULAR = 0.8
"""Least share of the jumps that come at the median distance."""

ALIGNED = 0.99
"""Least share of the jumps that come a multiple of the hold after each other."""

EXAMINED = 100_000
"""Jumps whose size is examined, evenly spread, or a few more."""

LARGER = 1.5
"""Least ratio of median to smallest jump: jumps of one size are quantisation."""


def hold_length(signal: Real, valid: Mask) -> float:
    """Length of the zero-order hold of a signal.

    Args:
        valid: False in gaps, shape (samples,).
    """
    return _length(signal, _changes(signal, valid))


def updates(signal: Real, valid: Mask) -> Index | None:
    """Samples at which the values of a signal with a zero-order hold were set.

    Args:
        valid: False in gaps, shape (samples,).

    Returns:
        Indices, at the distance of the hold also where a value was set to what it was before;
        the first may be negative, as the first value was set before the first sample. None
        without a hold.
    """
    changed = _changes(signal, valid)
    hold = _length(signal, changed)
    if hold <= 1:
        return None
    jumps = np.flatnonzero(changed)
    first = jumps[0] + 1
    changes = [first - hold * np.ceil(first / hold), *(jumps + 1), len(signal)]
    found = [
        start + hold * np.arange(max(1, round((stop - start) / hold)))
        for start, stop in pairwise(changes)
    ]
    return np.round(np.concatenate(found)).astype(np.int64)


def without_hold(run: Run) -> Run:
    """The run at the rate of its values: one of each n samples, if each value is there n times."""
    changed = _changes(run.velocity, run.mask)
    hold = _length(run.velocity, changed)
    count = round(hold)
    if count < 2 or abs(hold - count) > 1e-3:
        return run
    jumps = np.flatnonzero(changed)
    phases = np.bincount((jumps + 1) % count, minlength=count)
    first = int(phases.argmax())
    if phases[first] < ALIGNED * len(jumps) or len(run.time) <= first + count:
        return run
    own = slice(first, None, count)
    every = {name: getattr(run, name) for name in SAMPLED}
    fields: dict[str, Any] = {
        name: None if each is None else _every(each, own) for name, each in every.items()
    }
    return replace(run, **fields, stages={name: _every(s, own) for name, s in run.stages.items()})


def _every(signal: Any, own: slice) -> Any:
    """Some rows of a signal; of one on demand, on demand."""
    if not isinstance(signal, OnDemand):
        return np.ascontiguousarray(signal[own])
    start, stop, step = own.indices(len(signal))
    kept = OnDemand(
        (len(range(start, stop, step)), *signal.shape[1:]),
        signal.dtype,
        lambda first, last: signal[start + step * first : start + step * last : step],
    )
    kept.checked = signal.checked
    return kept


def _changes(signal: Real, valid: Mask) -> Mask:
    """Whether the next sample of a signal is another one, outside of gaps, (samples - 1,)."""
    changes = valid[1:] & valid[:-1]
    for rows in pieces(signal):
        part = signal[rows.start : rows.stop + 1]
        changes[rows.start : rows.stop] &= (part[1:] != part[:-1]).any(axis=1)
    return changes


def _length(signal: Real, changed: Mask) -> float:
    count = np.count_nonzero(changed)
    if count < FEWEST:
        return 1.0
    if 2 * np.count_nonzero(changed[1:] & changed[:-1]) >= count - 1:
        return 1.0  # the median distance of two jumps is less than 2
    jumps = np.flatnonzero(changed)
    distances = np.diff(jumps)
    middle = np.median(distances)
    regular = np.abs(distances - middle) <= max(1.0, 0.1 * middle)
    if regular.mean() < REGULAR:
        return 1.0
    jumps = jumps[:: max(1, len(jumps) // EXAMINED)]
    if _one_size(np.abs(signal[jumps + 1].astype(np.float64) - signal[jumps])):
        return 1.0
    return float(distances[regular].mean())


def _one_size(sizes: Real) -> bool:
    """Whether each joint jumps by one quantisation step, up or down."""
    sizes = np.where(sizes > 0, sizes, np.nan)
    moving = ~np.isnan(sizes).all(axis=0)
    middle, least = np.nanmedian(sizes[:, moving], axis=0), np.nanmin(sizes[:, moving], axis=0)
    return bool((middle < LARGER * least).all())
