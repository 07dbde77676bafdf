"""Localisation of failures: stage of the control flow, joints, frequency band, links.

Onset and end of a finding: change points of its power in its first and its last frame.

A classifier labels frames (0.4 s, every 0.1 s). A finding begins with its first frame, most of
which the failure has not reached yet. The onset is the time t in the first frame that splits the
power into two levels best. For n samples of mean power p, of which n1 before t have p1 and n2
after it p2, the log likelihood of two levels exceeds the one of a single level by

    (n log p - n1 log p1 - n2 log p2) / 2

if samples are independent and normal. This is the criterion by which seismologists pick the onset
of waves (Maeda 1985), and of a change of variance in general (Inclan & Tiao 1994). Only a rise
counts. Samples of a vibration are not independent: a time of `INDEPENDENT` counts as one sample.
The mean of the log likelihoods of two powers is taken: of the tracking error (of the motion,
if no velocity is desired) above 10 Hz, and of the sudden changes of the motion, as
`inspector.stage` has them. Both filters are causal, so that nothing rises before
it happens.

The frame before the first was not labelled, so that the failure sets in during the first frame's
last hop. This is the prior: a normal distribution with `ONSET` and `DEVIATION`. Its mean is the
result where nothing stands out. Where no frame fits in before the first one, because the run
begins or a gap ends there, the mean is the frame's start, and the deviation a frame's.

The end is the onset of the same stretch reversed in time, with the prior `END`.

Neither likelihood nor prior depends on scale. A scalar noise is a run of one joint.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from inspector.stage import (
    Localisation,
    first_stage,
    quiet_statistics,
    quiet_stretches,
    sudden,
)
from noiseclassifier import Event
from noisemodel import Block, Run
from noisemodel.noise import FAST, LinkNoise, in_both
from noisemodel.types import Array, Indices, Mask, Real

BIN = 0.001  # time over which power is taken, in [s], or one sample if that is longer
# Time of the past mean that is subtracted, twice, in [s]: what is slower than 10 Hz is motion.
PAST = 0.05
WARM = 0.02  # time after the start of the run or the end of a gap whose power is not used, in [s]
SHORTEST_LEVEL = 0.005  # shortest time that has a level, in [s]
BEYOND = 0.05  # time after the first frame that counts towards the level after an onset, in [s]
INDEPENDENT = 0.02  # time that counts as one independent sample, in [s]
# Means of the priors: from the onset to the stop of the first frame, and from the end to the stop
# of the last frame, in hops.
ONSET, END = 0.9, 2.0
DEVIATION = 0.35  # standard deviation of both, in hops
# Share of the whole energy that is added to each side, so that silence has a logarithm.
LEAST = 1e-6


def extent(
    run: Run, start: float, stop: float, *, frame: float = 0.4, hop: float = 0.1
) -> tuple[float, float]:
    """Estimate when a finding sets in and when it ends.

    Args:
        run: The run, or a scalar noise as a run of one joint; desired velocities are optional.
        start: Start of the finding's first frame, in [s].
        stop: Stop of its last frame, in [s].
        frame: Duration of a frame, in [s].
        hop: Time from the start of a frame to the start of the next, in [s].

    Returns:
        Onset, from ``start`` to the stop of the first frame, and end, after the onset and up to
        ``stop``, in [s].
    """
    begin, sample = float(run.time[0]), 1.0 / run.rate
    start = min(max(start, begin), begin + run.duration - sample)
    stop = max(min(stop, begin + run.duration), start + sample)
    room = max(0.0, min(frame, stop - start - sample))  # not -1e-17 by rounding
    prior = frame - ONSET * hop, DEVIATION * hop
    onset = start + _rise(run, start, room, prior, frame=frame, hop=hop)
    room = max(0.0, min(frame, stop - onset - sample))
    prior = END * hop, DEVIATION * hop
    return onset, stop - _rise(run, stop, room, prior, frame=frame, hop=hop, backwards=True)


def _rise(
    run: Run,
    edge: float,
    room: float,
    prior: tuple[float, float],
    *,
    frame: float,
    hop: float,
    backwards: bool = False,
) -> float:
    """Time from an outer edge of a finding to the rise of its power, up to ``room``, in [s]."""
    samples, size = len(run.time), max(1, round(BIN * run.rate))
    step = size / run.rate
    at = round((edge - float(run.time[0])) * run.rate)
    at = samples - at if backwards else at
    past = min(round(2.0 * PAST / step), at // size)
    ahead = min(round((frame + BEYOND) / step), (samples - at) // size)
    power, known = _powers(run, at - past * size, past + ahead, size, backwards=backwards)
    mask = run.mask[::-1] if backwards else run.mask
    outside = at - round(hop * run.rate)
    mean, deviation = prior if outside >= 0 and mask[outside:at].all() else (0.0, frame)
    gain = _gain(power[past:], known[past:], max(1, round(SHORTEST_LEVEL / step)))
    if not gain.any():
        return max(0.0, min(mean, room))
    offset = np.arange(len(gain)) * step
    offset, gain = offset[offset <= room], gain[offset <= room]
    score = gain * step / (2.0 * INDEPENDENT) - np.square((offset - mean) / deviation) / 2.0
    return float(offset[np.argmax(score)])


def _powers(run: Run, first: int, bins: int, size: int, *, backwards: bool) -> tuple[Array, Mask]:
    """Power of error and sudden changes, shape (bins, 2), and where they can be used."""
    part = slice(first, first + bins * size)
    if backwards:
        part = slice(len(run.time) - part.stop, len(run.time) - first)
    order = slice(None, None, -1) if backwards else slice(None)
    velocity = motion = error = run.velocity[part][order]
    if run.base_velocity is not None:
        motion = error = np.hstack((run.base_velocity[part][order], motion))
    measured, desired = in_both(run) if run.velocity_desired is not None else ([], [])
    if run.velocity_desired is not None and measured:
        error = run.velocity_desired[part][order][:, desired] - velocity[:, measured]
    motion, error = motion.reshape(bins, size, -1), error.reshape(bins, size, -1)
    valid = np.asarray(run.mask[part][order].reshape(bins, size).all(axis=1), dtype=np.bool_)
    rate = run.rate / size
    last = np.arange(1, bins + 1)
    begin = np.maximum.accumulate(np.where(valid, 0, last))  # of the stretch without a gap
    middle = error.mean(axis=1, dtype=np.float64)
    # What is left of a steady acceleration is constant: the second time removes that.
    fast = _high_passed(_high_passed(middle, begin, rate), begin, rate)
    within = error.var(axis=1, dtype=np.float64) if size > 1 else np.zeros_like(middle)
    changes = sudden(motion.mean(axis=1, dtype=np.float64), valid, rate)
    known = valid & (last - begin > round(WARM * rate))
    power = ((np.square(fast) + within).sum(axis=1), np.square(changes).sum(axis=1))
    return np.stack(power, axis=1), known


def _high_passed(signal: Array, begin: Indices, rate: float) -> Array:
    """Signal of shape (bins, joints), less its mean over the past, which ``begin`` limits."""
    last = np.arange(1, len(signal) + 1)
    first = np.maximum(begin, last - round(PAST * rate))
    sums = np.concatenate((np.zeros((1, signal.shape[1])), np.cumsum(signal, axis=0)))
    return np.asarray(signal - (sums[1:] - sums[first]) / np.maximum(last - first, 1)[:, None])


def _gain(power: Array, known: Mask, shortest: int) -> Array:
    """Twice the gain in log likelihood of a rise before each bin, shape (bins + 1,)."""
    count = np.concatenate(([0], np.cumsum(known)))[:, None]
    energy = np.concatenate((np.zeros((1, power.shape[1])), np.cumsum(power * known[:, None], 0)))
    before, after = count, count[-1] - count
    enough = (before >= shortest) & (after >= shortest) & (energy[-1] > 0.0)
    n, total = count[-1], energy[-1] * (1.0 + 2.0 * LEAST)
    with np.errstate(divide="ignore", invalid="ignore"):
        low = (energy + LEAST * energy[-1]) / before
        high = (energy[-1] - energy + LEAST * energy[-1]) / after
        gain = n * np.log(total / n) - before * np.log(low) - after * np.log(high)
    return np.asarray(np.where(enough & (high > low), gain, 0.0).mean(axis=1))


ANNOTATED = 0.1  # how long after the start of an annotation its failure may set in, in [s]


def localise(
    run: Run, found: Sequence[Event], *, frame: float = 0.0
) -> dict[Event | Block, Localisation]:
    """Localise each failure of a run.

    Args:
        frame: Duration of the frames that they consist of, in [s]: a finding may set in at any
            time of its first.
    """
    annotated = [block for block in run.blocks if block.label != "ok"]
    failures: list[Event | Block] = [*found, *annotated]
    if not failures:
        return {}
    quiet = quiet_statistics(run, failures) if has_stages(run) else None
    localised = {}
    for failure in failures:
        reach = max(ANNOTATED, frame) if failure in found else ANNOTATED
        stage = Localisation() if quiet is None else first_stage(run, quiet, failure, reach=reach)
        localised[failure] = replace(stage, band=band(run, failure, failures))
    return localised


def has_stages(run: Run) -> bool:
    """Whether a run has a stage to compare the measured motion with."""
    return bool(run.stages) or run.velocity_desired is not None


# Windows of the spectrum, in [s]: as long as the failure, between these.
SHORTEST, LONGEST = 0.1, 0.4
MOST = 16  # most windows of a failure
# Percentile of the quiet stretches' spectra that is subtracted: vibration of a robot that walks
# comes and goes.
PERCENTILE = 90.0
SHARE = 0.7  # share of the excess power that lies in the band


def band(
    run: Run, failure: Event | Block, failures: Sequence[Event | Block]
) -> tuple[float, float] | None:
    """Frequency band in which the joints vibrate more than in quiet stretches.

    The excess is the power spectrum of the measured velocities above 10 Hz, mean over the failure,
    less the 90th percentile of the quiet stretches' spectra. The band is the narrowest that holds
    70 % of it.

    Args:
        failures: All failures of the run, found and annotated.

    Returns:
        Lowest and highest frequency, in [Hz]; None without excess. The resolution is the inverse
        of the failure's duration, and 2.5 Hz at best.
    """
    length = min(max(failure.stop - failure.start, SHORTEST), LONGEST, run.duration)
    size = max(2, round(length * run.rate))
    first, last = np.searchsorted(run.time, (failure.start, failure.stop))
    # The window of a shorter failure extends beyond it.
    first = max(0, min(int(first), len(run.time) - size))
    starts = np.arange(first, max(first + 1, int(last) - size + 1), max(1, size // 2))
    if len(starts) > MOST:
        starts = starts[np.linspace(0, len(starts) - 1, MOST).astype(int)]
    during = [slice(start, start + size) for start in starts.tolist()]
    during = [part for part in during if run.mask[part].all()]
    if not during:
        return None
    reference = [
        _spectrum(run.velocity[part]) for part in quiet_stretches(run, failures, length=length)
    ]
    excess = np.mean([_spectrum(run.velocity[part]) for part in during], axis=0)
    if reference:
        excess = excess - np.percentile(reference, PERCENTILE, axis=0)
    frequency = np.arange(len(excess)) * run.rate / size
    excess = np.where(frequency >= FAST, np.maximum(excess, 0.0), 0.0)
    if not excess.sum() > 0.0:
        return None
    # The narrowest band: for each first bin, the last one with which it holds enough.
    below = np.concatenate(([0.0], np.cumsum(excess)))
    stops = np.searchsorted(below, below[:-1] + SHARE * below[-1])
    firsts = np.flatnonzero(stops < len(below))
    best = firsts[np.argmin(stops[firsts] - firsts)]
    return float(frequency[best]), float(frequency[stops[best] - 1])


def _spectrum(velocity: Real) -> Array:
    """Power of all joints together, shape (frequency,)."""
    # A trend would leak into all frequencies.
    line = np.linspace(velocity[0], velocity[-1], len(velocity), dtype=np.float64)
    waves = np.fft.rfft((velocity - line).T * np.hanning(len(velocity)), axis=1)
    return np.asarray(np.square(np.abs(waves)).sum(axis=0))


Failure: TypeAlias = Event | Block  # a finding, or an annotated block
NAMED = 3  # most links that are named
# Time after the onset of a blow or jump in which its excess power is measured, in [s].
BEGINNING = 0.05


def fault_links(
    links: LinkNoise,
    failure: Failure,
    others: Sequence[Failure],
    *,
    known: Localisation | None = None,
) -> tuple[tuple[str, float], ...]:
    """Name the links at which a failure is localised.

    A link's excess is its power above 10 Hz, less its median outside of all failures. A blow or
    jump spreads over the whole robot within a step, so that only its beginning counts. Even then
    a light foot is louder than the limb that was hit, hence a second criterion: the joints of the
    largest innovation. Named is the link of the largest excess; of each such joint that moves none
    of the named ones, the link of the largest excess that it moves; and then the links of the
    largest excess.

    Args:
        others: All failures of the run, found and annotated.
        known: Its localisation, if there is one: onset and joints are used.
    """
    time, vibration = links.time, links.vibration
    start, stop = failure.start, failure.stop
    if known is not None and known.onset is not None:
        half = (time[1] - time[0]) / 2.0  # bins that it covers in part count too
        start, stop = known.onset - half, known.onset + BEGINNING + half
    inside = (time >= start) & (time < stop)
    busy = np.any([(time >= each.start) & (time < each.stop) for each in others], axis=0)
    if not inside.any():
        return ()
    quiet = np.median(vibration[~busy], axis=0) if not busy.all() else 0.0
    excess = np.maximum(vibration[inside].mean(axis=0) - quiet, 0.0)
    ranked = [index for index in np.argsort(-excess, kind="stable").tolist() if excess[index] > 0.0]
    named = ranked[:1]
    for joint, _ in () if known is None else known.joints:
        moved = [index for index in ranked if joint in links.movers[index]]
        if not set(moved) & set(named):
            named += moved[:1]
    named += [index for index in ranked if index not in named]
    largest_first = sorted(named[:NAMED], key=ranked.index)
    return tuple((links.links[i], float(excess[i] / excess.sum())) for i in largest_first)
