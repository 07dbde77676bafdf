"""Where a finding comes from: onset and end, stage of the control flow, joints, band and links."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from noiseclassifier import Event
from noisemodel import Block, Run
from noisemodel.noise import FAST, LinkNoise, in_both
from noisemodel.types import Array, Indices, Mask, Real

Failure: TypeAlias = Event | Block  # a finding, or an annotated block


# --- onset and end

FINE = 0.001  # time over which power is taken, in [s], or one sample if that is longer
# Time of the past mean that is subtracted, twice, in [s]: what is slower than 10 Hz is motion.
PAST = 0.05
SETTLED = 0.02  # time after a start or the end of a gap whose power is not used, in [s]
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
    """Estimate when a finding sets in and when it ends, in [s]: change points of its power.

    A finding begins with its first frame, most of which the failure has not reached yet. The onset
    is the time t in it that splits n samples of mean power p into two levels best: n1 samples of p1
    before t, and n2 of p2 after it. The gain in the log likelihood of independent normal samples is

        (n log p - n1 log p1 - n2 log p2) / 2

    (Maeda 1985 for seismic waves; Inclan & Tiao 1994 for any change of variance). Only a rise
    counts, and a time of `INDEPENDENT` as one sample. The gain is the mean of those of two powers:
    of the tracking error (of the motion, if no velocity is desired) above 10 Hz, and of the
    `sudden` changes of the motion. Both filters are causal: nothing rises before it happens.

    The frame before the first was not labelled, so that the failure sets in during the first
    frame's last hop. This is the prior: a normal distribution with `ONSET` and `DEVIATION`, or, if
    the run begins or a gap ends there, with the frame's start and duration. The end is the onset of
    the same stretch reversed in time, with the prior `END`.
    """
    begin, sample = float(run.time[0]), 1.0 / run.rate
    start = min(max(start, begin), begin + run.duration - sample)
    stop = max(min(stop, begin + run.duration), start + sample)
    onset = start + _rise(run, start, stop - start, frame - ONSET * hop, frame, hop)
    return onset, stop - _rise(run, stop, stop - onset, END * hop, frame, hop, backwards=True)


def _rise(
    run: Run,
    edge: float,
    length: float,
    mean: float,
    frame: float,
    hop: float,
    *,
    backwards: bool = False,
) -> float:
    """Time from an outer edge of a finding of some length to the rise of its power, in [s]."""
    samples, size = len(run.time), max(1, round(FINE * run.rate))
    step, deviation = size / run.rate, DEVIATION * hop
    room = max(0.0, min(frame, length - 1.0 / run.rate))  # not -1e-17 by rounding
    at = round((edge - float(run.time[0])) * run.rate)
    at = samples - at if backwards else at
    past = min(round(2.0 * PAST / step), at // size)
    ahead = min(round((frame + BEYOND) / step), (samples - at) // size)
    power, known = _powers(run, at - past * size, past + ahead, size, backwards=backwards)
    mask = run.mask[::-1] if backwards else run.mask
    outside = at - round(hop * run.rate)
    if outside < 0 or not mask[outside:at].all():
        mean, deviation = 0.0, frame
    gain = _gain(power[past:], known[past:], max(1, round(SHORTEST_LEVEL / step)))
    if not gain.any():
        return max(0.0, min(mean, room))
    offset = np.arange(len(gain)) * step
    offset, gain = offset[offset <= room], gain[offset <= room]
    score = gain * step / (2.0 * INDEPENDENT) - np.square((offset - mean) / deviation) / 2.0
    return float(offset[np.argmax(score)])


def _powers(run: Run, start: int, bins: int, size: int, *, backwards: bool) -> tuple[Array, Mask]:
    """Power of error and sudden changes, shape (bins, 2), and where they can be used."""
    part, step = slice(start, start + bins * size), 1
    if backwards:
        part, step = slice(len(run.time) - part.stop, len(run.time) - start), -1
    velocity = motion = error = run.velocity[part][::step]
    if run.base_velocity is not None:
        motion = error = np.hstack((run.base_velocity[part][::step], motion))
    if run.velocity_desired is not None and (both := in_both(run))[0]:
        error = run.velocity_desired[part][::step][:, both[1]] - velocity[:, both[0]]
    motion, error = motion.reshape(bins, size, -1), error.reshape(bins, size, -1)
    valid = np.asarray(run.mask[part][::step].reshape(bins, size).all(axis=1), dtype=np.bool_)
    rate = run.rate / size
    last = np.arange(1, bins + 1)
    begin = np.maximum.accumulate(np.where(valid, 0, last))  # of the stretch without a gap
    middle = error.mean(axis=1, dtype=np.float64)
    fast, first = middle, np.maximum(begin, last - round(PAST * rate))
    for _ in range(2):  # what is left of a steady acceleration is constant: the second removes that
        sums = np.concatenate((np.zeros((1, fast.shape[1])), np.cumsum(fast, axis=0)))
        fast = fast - (sums[1:] - sums[first]) / np.maximum(last - first, 1)[:, None]
    within = error.var(axis=1, dtype=np.float64) if size > 1 else np.zeros_like(middle)
    changes = sudden(motion.mean(axis=1, dtype=np.float64), valid, rate)
    known = valid & (last - begin > round(SETTLED * rate))
    power = ((np.square(fast) + within).sum(axis=1), np.square(changes).sum(axis=1))
    return np.stack(power, axis=1), known


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


BRIEF, PERIODS = 0.05, 3.0  # least length of a window on a line, in [s], and in periods
LOUDEST = 90.0  # percentile of the amplitudes around an edge that is taken for that of the line
NEAR = 1.0  # time within a finding that is looked at for its edges, in [s]


def line_extent(run: Run, event: Event, reach: float) -> tuple[float, float]:
    """When the line of a finding sets in and ends, in [s]: at half of its amplitude in its joint.

    It is looked for up to a time ``reach`` before and after the finding, also beyond a gap.
    """
    begin, last = float(run.time[0]), len(run.time) - 1
    edges = []
    for edge, sign in ((event.start, 1.0), (event.stop, -1.0)):
        outer, inner = edge - sign * reach, edge + sign * min(NEAR, event.stop - event.start)
        ends = sorted(round((time - begin) * run.rate) for time in (outer, inner))
        part = slice(max(0, ends[0]), min(last, ends[1]) + 1)
        amplitude = _amplitude(run, event, part)
        loud = np.flatnonzero(amplitude >= 0.5 * np.percentile(amplitude, LOUDEST))
        edges.append(begin + (part.start + int(loud[0] if sign > 0 else loud[-1])) / run.rate)
    return edges[0], edges[1] + 1.0 / run.rate


def _amplitude(run: Run, event: Event, part: slice) -> Array:
    """Amplitude of a finding's line around each sample of a part, in any unit; 0 in gaps."""
    assert event.line is not None
    row, frequency = event.line
    joint = row if run.velocity_desired is None else in_both(run)[0][row]
    # Of differences: slow motion, which is far louder, would leak.
    velocity, valid = run.velocity[part, joint].astype(np.float64), run.mask[part]
    slope = np.diff(velocity, prepend=velocity[:1])
    slope[~valid | ~np.append(False, valid[:-1])] = 0.0
    wave = slope * np.exp(-2j * np.pi * frequency / run.rate * np.arange(len(slope)))
    size = min(round(max(BRIEF, PERIODS / frequency) * run.rate), len(slope) - 1)
    taper = np.hanning(size + 2)[1:-1]
    there = np.convolve(valid, taper, "same")
    return np.asarray(valid * np.abs(np.convolve(wave, taper, "same")) / np.maximum(there, 1e-9))


# --- stage and joints

MOST = 16  # most stretches that are picked; a long run is not read whole


def quiet_stretches(
    run: Run, failures: Sequence[Failure], *, length: float, most: int = MOST
) -> list[slice]:
    """Pick stretches of a length, in [s], without failures or gaps, evenly spread over a run."""
    size = max(1, round(length * run.rate))
    free = run.mask.copy()
    for failure in failures:
        first, last = np.searchsorted(run.time, (failure.start, failure.stop))
        free[first:last] = False
    count = len(free) // size
    starts = size * np.flatnonzero(free[: count * size].reshape(count, size).all(axis=1))
    return _spread(starts, size, most)


def _spread(starts: Indices, size: int, most: int = MOST) -> list[slice]:
    """Stretches of a size at some starts, evenly spread if there are more than ``most``."""
    if len(starts) > most:
        starts = starts[np.linspace(0, len(starts) - 1, most).astype(int)]
    return [slice(start, start + size) for start in starts.tolist()]


def stages_of(run: Run, part: slice) -> Array:
    """Velocities of a part of a run at each stage, shape (stages, samples, joints).

    Stages are those that the run names, in its order, then desired and measured. Joints are those
    that all of them have.
    """
    joints, wanted = list(range(len(run.joint_names))), list[int]()
    if run.velocity_desired is not None:
        joints, wanted = in_both(run)
    signals = [each[part][:, joints] for each in run.stages.values()]
    if run.velocity_desired is not None:
        signals.append(run.velocity_desired[part][:, wanted])
    return np.array([*signals, run.velocity[part][:, joints]], dtype=np.float64)


SPAN = 0.001  # time over which a velocity's change is taken, in [s]
TRAIL = 0.02  # time of the mean that is subtracted from changes, in [s]
# Lags of the prediction, in [s].
LAGS = (0.0, 0.0005, 0.001, 0.0015, 0.002, 0.003, 0.004, 0.006, 0.008, 0.012)
LENGTH = 0.1  # length of a quiet stretch, in [s]
WARM = TRAIL + LAGS[-1] + SPAN  # transient of filters and prediction, in [s]
ROWS = 3000  # most samples of the least squares
RIDGE = 1e-3  # regularisation of the least squares, as a share of the mean power


@dataclass(frozen=True, eq=False)
class QuietStatistics:
    """Prediction and innovation of a run's stages in its quiet stretches."""

    # Of the linear prediction of each stage but the first, shape (stages - 1, joints, lags).
    weights: Array
    lags: Indices  # of the prediction, in samples
    # 90th percentile over the stretches of the innovation's mean square, shape (stages,), in
    # [rad²/s⁴].
    power: Array
    peak: Array  # 90th percentile of its peak, shape (stages,), in [rad/s²]


def quiet_statistics(run: Run, failures: Sequence[Failure]) -> QuietStatistics:
    """Fit the prediction to the quiet stretches of a run, and measure its residual there."""
    lags = np.unique(np.round(np.array(LAGS) * run.rate).astype(np.int64))
    parts = quiet_stretches(run, failures, length=LENGTH + WARM)
    if not parts:
        nothing = np.zeros(len(stages_of(run, slice(0, 1))))
        return QuietStatistics(np.zeros((0, 0, len(lags))), lags, nothing, nothing)
    velocity = np.stack([stages_of(run, part) for part in parts])
    _, stages, size, joints = velocity.shape
    valid, warm = np.ones(size, dtype=np.bool_), min(max(1, round(WARM * run.rate)), size - 1)
    change = sudden(velocity, valid, run.rate)
    nothing = np.zeros((0, joints, len(lags)))
    weights = _prediction(change, lags, warm) if stages > 1 else nothing
    *_, level = _innovation(change, weights, lags, valid)
    level = level[..., warm:]  # shape (stretches, stages, samples)
    power = np.percentile(np.square(level).mean(axis=2), 90.0, axis=0)
    return QuietStatistics(weights, lags, power, np.percentile(level.max(axis=2), 90.0, axis=0))


def _prediction(change: Array, lags: Indices, warm: int) -> Array:
    """Weights by which each stage's changes in quiet stretches predict those of the next one."""
    count, stages, size, joints = change.shape
    step = max(1, (size - warm) * count // ROWS)
    # By stage, joint, stretch and sample, and then with all samples in a row.
    moved = np.ascontiguousarray(change.transpose(1, 3, 0, 2))
    target = moved[1:, ..., warm::step].reshape(stages - 1, joints, -1)
    past = np.stack(
        [moved[:-1, ..., warm - lag : size - lag : step] for lag in lags.tolist()], axis=2
    ).reshape(stages - 1, joints, len(lags), -1)
    square = past @ past.swapaxes(2, 3)
    mean = np.trace(square, axis1=2, axis2=3)[..., None, None] / len(lags)
    square = square + (RIDGE * mean + np.finfo(float).tiny) * np.eye(len(lags))
    return np.asarray(np.linalg.solve(square, past @ target[..., None])[..., 0])


def _innovation(
    change: Array, weights: Array, lags: Indices, valid: Mask
) -> tuple[Array, Array, Array]:
    """Innovation of sudden changes of shape (..., stages, samples, joints), in [rad/s²].

    Returns their prediction residual, of the same shape, and over the joints, the norm of the
    changes and of the residual, but no more than the former: a change that was predicted and does
    not occur is no innovation.
    """
    residual = change.copy()
    for place, own in enumerate(weights):
        for column, lag in enumerate(lags.tolist()):
            past = change[..., place, : change.shape[-2] - lag, :]
            residual[..., place + 1, lag:, :] -= own[:, column] * past
    residual[..., ~valid, :] = 0.0
    total, level = np.linalg.norm(change, axis=-1), np.linalg.norm(residual, axis=-1)
    return residual, total, np.minimum(total, level)


def sudden(velocity: Array, valid: Mask, rate: float) -> Array:
    """Change over 1 ms, less the mean of such changes over the past 20 ms: both are causal.

    Velocities have the shape (..., samples, joints); changes are in [rad/s²], and 0 next to gaps.
    """
    step = max(1, round(SPAN * rate))
    trail = max(1, round(TRAIL * rate), 2 * step)
    change = np.zeros_like(velocity)
    together = valid[step:] & valid[:-step]
    change[..., step:, :] = (velocity[..., step:, :] - velocity[..., :-step, :]) * rate / step
    change[..., step:, :][..., ~together, :] = 0.0
    sums = np.cumsum(change, axis=-2)
    past = sums.copy()
    past[..., trail:, :] -= sums[..., :-trail, :]
    change -= past / np.minimum(np.arange(1, past.shape[-2] + 1), trail)[:, None]
    change[..., ~valid, :] = 0.0
    return change


EARLY = 0.015  # how long before its start a failure may have set in, in [s]
BEFORE, AFTER = 0.1 + WARM, 0.05  # time before and after a failure that is used, in [s]
LONGEST = 1.0  # time of a failure that is used, in [s]
BIN = 0.05  # time over which a vibration's power is taken, in [s]
LOUD = 0.25  # share of the loudest bin's power from which a bin counts: -6 dB
LASTING = 0.3  # loud time of a lasting vibration, in [s]
# Least share of the innovation in a stage's changes; with less it passes on the stage before.
PASSED_ON = 0.2
EXCEEDS = 1.5  # factor by which the first stage's peak has to exceed that in quiet stretches
RESPONSE = 0.003  # time within which the second stage else has to follow the first, in [s]
ADDS = 0.25  # share of the largest excess power from which a stage counts as adding to a vibration
MORE = 2.0  # factor by which the power of a stage that adds exceeds that in quiet stretches
JOINTS = 3  # most joints that are named
SPREAD = 0.005  # time after its onset in which a blow or jump has not spread over the robot, in [s]
SLOWEST = 0.02  # longest lag between two stages that vibrate together, in [s]
AHEAD, BACK = 0.01, 0.05  # times after and before a moment that are compared, in [s]
# Times before and after the steepest rise in which the onsets of stages lie, in [s].
AROUND = (0.02, 0.03)
STEEP = 0.25  # least steepness of a rise, as a share of the steepest
PEAK = 4.0  # least peak of a stage that shows a failure, in multiples of the level before
CLEAR = 2.0  # level at the onset, in multiples of the level before
SHARE = 0.2  # level at the onset, as a share of the peak


@dataclass(frozen=True)
class Localisation:
    """Where a failure enters the control flow, and its frequencies."""

    # First stage of the control flow in which it shows; empty if no stage shows it, or if the run
    # has the measured one alone.
    stage: str = ""
    following: str = ""  # next stage in which it shows; empty if it is in no other
    lag: float = 0.0  # time from the first of these stages to the next, in [s]
    # Up to three joints and their shares of the innovation's power in that stage, the largest
    # first.
    joints: tuple[tuple[str, float], ...] = ()
    # When a blow or jump sets in, in [s]; None of a vibration that lasts.
    onset: float | None = None
    # Lowest and highest frequency of its vibration, in [Hz]; None if it is not louder than quiet
    # stretches.
    band: tuple[float, float] | None = None


def first_stage(
    run: Run, quiet: QuietStatistics, failure: Failure, *, reach: float
) -> Localisation:
    """Find the stage in which a failure shows first; empty if none shows it, without its band.

    It may have set in up to a time ``reach`` after its start, in [s].

    There is no run without the failure to compare with: the *innovation* of each stage shows where
    it enters, its `sudden` changes less their linear prediction from the stage before.

    - A *blow or jump* passes one stage after the other: the earliest onset wins (`_earliest`).
    - A *lasting vibration* has gone round the control loop many times, and its onset, such as the
      touch that starts a limit cycle, is not its source: the first stage that adds to it wins
      (`_adding`). A failure lasts if its vibration is within 6 dB of its loudest 50 ms for 0.3 s in
      all, of the first second; one without an onset is treated as if it lasted.
    """
    stop = min(failure.stop, failure.start + LONGEST)
    edges = (failure.start - BEFORE, max(stop, failure.start + reach) + AFTER)
    part = slice(*np.searchsorted(run.time, edges).tolist())
    time, valid, rate = run.time[part], run.mask[part], run.rate
    start, end = np.searchsorted(time, (failure.start, stop)).tolist()
    if end <= start or not valid[start:end].any():
        return Localisation()
    change, during = sudden(stages_of(run, part), valid, rate), slice(start, end)
    residual, total, level = _innovation(change, quiet.weights, quiet.lags, valid)
    size = max(1, round(BIN * rate))
    power = np.square(level[-1, during])
    power = np.add.reduceat(power, np.arange(0, len(power), size)) / size
    loud = power > max(LOUD * power.max(), MORE * float(quiet.power[-1]))
    blow = None
    if not loud.sum() * BIN >= LASTING:
        edges = (failure.start - EARLY, failure.start + reach)
        first, last = np.searchsorted(time, edges).tolist()
        blow = _earliest(total, level, quiet, first, last, rate=rate)
    found = blow or _adding(change, total, level, quiet, during, rate=rate)
    if found is None:
        return Localisation()
    stage, following, lag, rows = found
    desired = run.velocity_desired is not None
    names = [*run.stages, *(["desired"] if desired else []), "measured"]
    joints = [n for n in run.joint_names if not desired or n in run.desired_joint_names]
    power = np.square(residual[stage, rows]).sum(axis=0)
    shares = power / (power.sum() or 1.0)
    ranked = np.argsort(-shares, kind="stable")[:JOINTS].tolist()
    return Localisation(
        stage=names[stage] if len(names) > 1 else "",
        following="" if following is None else names[following],
        lag=lag / rate,
        joints=tuple((joints[i], float(shares[i])) for i in ranked if shares[i] > 0.0),
        onset=None if blow is None else float(time[rows.start]),
    )


def _earliest(
    total: Array, level: Array, quiet: QuietStatistics, first: int, last: int, *, rate: float
) -> tuple[int, int | None, int, slice] | None:
    """Order the stages by the onset of a blow or jump, around the steepest rise of any of them.

    A stage whose peak is less than a fifth of all changes there passes on what the stage before it
    did. The first stage has no prediction: its peak has to exceed that in quiet stretches, or the
    next stage to follow within 3 ms. Of simultaneous ones, the one that a motion passes first wins.
    It gives the first stage, the next one, the lag between them, and where the joints show.
    """
    # A stage without innovation in quiet stretches would exceed its peak at once.
    scale = quiet.peak + PASSED_ON * (float(quiet.peak.max()) or 1.0)
    moment = rise((level / scale[:, None]).max(axis=0), first, last, rate=rate)
    early, late = (max(1, round(time * rate)) for time in AROUND)
    around = slice(max(0, moment - early), min(level.shape[1], moment + late))
    least = PASSED_ON * total[:, around].max(axis=1)
    stages = zip(level, least.tolist(), strict=True)
    onsets = [onset(each, moment, around, rate=rate, least=own) for each, own in stages]
    found = sorted((at, place) for place, at in enumerate(onsets) if at is not None)
    if found and found[0][1] == 0 and len(onsets) > 1:
        common = float(level[0, around].max()) <= EXCEEDS * quiet.peak[0]
        if common and (onsets[1] is None or onsets[1] - found[0][0] > RESPONSE * rate):
            found = found[1:]
    if not found:
        return None
    earliest, place = found[0]
    at, other = next((later for later in found if later[0] > earliest), (earliest, None))
    fresh = slice(earliest, earliest + max(1, round(SPREAD * rate)))
    return place, other, at - earliest, fresh


def _adding(
    change: Array, total: Array, level: Array, quiet: QuietStatistics, during: slice, *, rate: float
) -> tuple[int, int | None, int, slice] | None:
    """Find the first stage whose innovation has a quarter of the largest excess power of any.

    It gives what `_earliest` does; the next stage is the measured one.
    """
    power = np.square(level[:, during]).mean(axis=1)
    least = np.maximum(MORE * quiet.power, PASSED_ON**2 * np.square(total[:, during]).mean(axis=1))
    excess = np.where(power > least, power - quiet.power, 0.0)
    if not excess.max() > 0.0:
        return None
    place, last = int(np.argmax(excess >= ADDS * excess.max())), len(excess) - 1
    if place == last:
        return place, None, 0, during
    # The lag, up to the slowest, at which one follows the other best, all joints together.
    most = max(1, round(SLOWEST * rate))
    size = during.stop - during.start + most
    cause, effect = (np.fft.rfft(change[each, during], size, axis=0) for each in (place, last))
    together = np.fft.irfft((effect * cause.conj()).sum(axis=1), size)
    return place, last, int(np.argmax(together[: most + 1])), during


def rise(level: Array, first: int, last: int, *, rate: float) -> int:
    """Find where a level first rises: 10 ms against the 50 ms before, both as mean squares."""
    ahead, back = (max(1, round(time * rate)) for time in (AHEAD, BACK))
    energy = np.concatenate(([0.0], np.cumsum(np.square(level))))
    first = min(max(first, 1), len(level) - 1)
    at = np.arange(first, max(min(last, len(level) - ahead), first + 1))
    behind = np.maximum(0, at - back)
    after = (energy[np.minimum(at + ahead, len(level))] - energy[at]) / ahead
    before = (energy[at] - energy[behind]) / (at - behind)
    reference = before + np.median(level) ** 2 + np.finfo(float).tiny
    steep = (after - before) / np.sqrt(reference)
    enough = steep >= STEEP * steep.max()
    begin = int(np.argmax(enough))
    length = int(np.argmin(enough[begin:])) or len(enough) - begin
    return int(at[begin + np.argmax(steep[begin : begin + length])])


def onset(
    level: Array, moment: int, around: slice, *, rate: float, least: float = 0.0
) -> int | None:
    """Find the first sample, around the steepest rise, of a fifth of the peak; None without one.

    It also has twice the level before, and the peak four times that, and more than ``least``.
    """
    back, ahead = (round(time * rate) for time in (BACK, AHEAD))
    before = level[max(0, moment - back - ahead) : max(1, moment - ahead)]
    reference = max(float(np.sqrt(np.mean(np.square(before)))), float(np.median(level)))
    peak = float(level[around].max(initial=0.0))
    if not peak > max(PEAK * reference, least):
        return None
    return int(around.start + np.argmax(level[around] > max(SHARE * peak, CLEAR * reference)))


# --- band

# Windows of the spectrum, in [s]: as long as the failure, between these.
BRIEFEST, WIDEST = 0.1, 0.4
# Percentile of the quiet stretches' spectra that is subtracted: vibration of a robot that walks
# comes and goes.
PERCENTILE = 90.0
HELD = 0.7  # share of the excess power that lies in the band


def band(run: Run, failure: Failure, failures: Sequence[Failure]) -> tuple[float, float] | None:
    """Frequency band in which the joints vibrate more than in quiet stretches.

    The excess is the power spectrum of the measured velocities above 10 Hz, mean over the failure,
    less the 90th percentile of the spectra of quiet stretches, without any of ``failures``. The
    band is the narrowest that holds 70 % of it, in [Hz], of several the one that holds most; None
    without excess. The resolution is the inverse of the failure's duration, and 2.5 Hz at best.
    """
    length = min(max(failure.stop - failure.start, BRIEFEST), WIDEST, run.duration)
    size = max(2, round(length * run.rate))
    first, last = np.searchsorted(run.time, (failure.start, failure.stop))
    # The window of a shorter failure extends beyond it.
    first = max(0, min(int(first), len(run.time) - size))
    starts = np.arange(first, max(first + 1, int(last) - size + 1), max(1, size // 2))
    during = [part for part in _spread(starts, size) if run.mask[part].all()]
    if not during:
        return None
    quiet = quiet_stretches(run, failures, length=length)
    reference = [_spectrum(run.velocity[part]) for part in quiet]
    excess = np.mean([_spectrum(run.velocity[part]) for part in during], axis=0)
    if reference:
        excess = excess - np.percentile(reference, PERCENTILE, axis=0)
    frequency = np.arange(len(excess)) * run.rate / size
    # Motion leaks into the line at 10 Hz, whatever the last digits of the rate.
    excess = np.where(frequency > 1.001 * FAST, np.maximum(excess, 0.0), 0.0)
    if not excess.sum() > 0.0:
        return None
    # The narrowest band: for each first bin, the last one with which it holds enough.
    below = np.concatenate(([0.0], np.cumsum(excess)))
    stops = np.searchsorted(below, below[:-1] + HELD * below[-1])
    firsts = np.flatnonzero(stops < len(below))
    held = below[stops[firsts]] - below[firsts]
    best = firsts[np.lexsort((-held, stops[firsts] - firsts))[0]]
    return float(frequency[best]), float(frequency[stops[best] - 1])


def _of_line(run: Run, event: Event, frequency: float, known: Localisation) -> Localisation:
    """With joints by their shares of a line's power, and its frequency with the resolution."""
    duration = min(max(event.stop - event.start, BRIEF), NEAR, run.duration)
    size = max(3, round(duration * run.rate))
    first = min(round((event.start - float(run.time[0])) * run.rate), len(run.time) - size)
    last = round((event.stop - float(run.time[0])) * run.rate)
    starts = np.arange(first, max(first + 1, last - size + 1), size)
    power, wave = np.zeros(run.velocity.shape[1]), 2.0 * np.pi * frequency / run.rate
    for part in _spread(starts, size):
        slope = np.diff(run.velocity[part].astype(np.float64), axis=0)
        taper = np.hanning(len(slope) + 2)[1:-1] * np.exp(-1j * wave * np.arange(len(slope)))
        power += np.square(np.abs(taper @ slope))
    shares = power / (power.sum() or 1.0)
    ranked = np.argsort(-shares, kind="stable")[:JOINTS].tolist()
    joints = tuple((run.joint_names[i], float(shares[i])) for i in ranked if shares[i] > 0.0)
    band = (max(0.0, frequency - 1.0 / duration), frequency + 1.0 / duration)
    return replace(known, joints=joints, band=band, onset=None)


def _spectrum(velocity: Real) -> Array:
    """Power of all joints together, shape (frequency,)."""
    # A trend would leak into all frequencies.
    line = np.linspace(velocity[0], velocity[-1], len(velocity), dtype=np.float64)
    waves = np.fft.rfft((velocity - line).T * np.hanning(len(velocity)), axis=1)
    return np.asarray(np.square(np.abs(waves)).sum(axis=0))


# --- links

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

    A link's excess is its power above 10 Hz, less its median outside of all failures, ``others``. A
    blow or jump spreads over the whole robot within a step, so that only its beginning counts. Even
    then a light foot is louder than the limb that was hit. So the link of the largest excess is
    named, the loudest one of each joint of the largest innovation that moves none of the named
    ones, and then the links of the largest excess.
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


# --- all of a run

ANNOTATED = 0.1  # how long after the start of an annotation its failure may set in, in [s]


def localise(
    run: Run, found: Sequence[Event], *, frame: float = 0.0
) -> dict[Failure, Localisation]:
    """Localise each failure of a run; a finding may set in at any time of its first frame."""
    annotated = [block for block in run.blocks if block.label != "ok"]
    failures: list[Failure] = [*found, *annotated]
    if not failures:
        return {}
    quiet, localised = quiet_statistics(run, failures), dict[Failure, Localisation]()
    for failure in failures:
        reach = max(ANNOTATED, frame) if failure in found else ANNOTATED
        known = first_stage(run, quiet, failure, reach=reach)
        if isinstance(failure, Event) and failure.line is not None:
            localised[failure] = _of_line(run, failure, failure.line[1], known)
        else:
            localised[failure] = replace(known, band=band(run, failure, failures))
    return localised
