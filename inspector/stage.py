"""First stage of the control flow in which a failure shows, from the run alone.

There is no run without the failure to compare with. The innovation of each stage shows where the
failure enters. Two kinds of failures are distinguished:

- A *blow or jump* passes one stage after the other, so these are ordered by onset. It is looked
  for where the innovation of a stage, relative to its peak in quiet stretches, first rises
  steeply. The onset in a stage is the first time at which the innovation exceeds a fifth of its
  peak and twice its level in the 50 ms before. A stage has no onset if that peak is less than four
  times the level before, or less than a fifth of all changes there: it passes on what the stage
  before it did. The first stage has no prediction, hence its peak also has to exceed 1.5 times
  that in quiet stretches, or the next stage has to follow within 3 ms. The earliest onset
  wins; of simultaneous ones, the stage that a motion passes first.
- A *lasting vibration* has gone round the control loop many times, and its onset, such as the
  touch that starts a limit cycle, is not its source. It lies in the first stage that adds to it:
  whose innovation has at least a quarter of the largest excess power of any stage, and more than
  twice the power in quiet stretches.

A failure lasts if its vibration is within 6 dB of its loudest 50 ms for 0.3 s in all, of the first
second. A failure without an onset is treated as if it lasted.

The *innovation* of a stage is its changes less their linear prediction. Sudden changes of
velocities are used: over 1 ms, less the mean of such changes over the past 20 ms. Both filters are
causal, so that nothing shows before it happens. The change of each joint at a stage is predicted
from the changes at the stage before, now and up to 12 ms ago, by least squares over quiet stretches
of the same run; the prediction residual is the innovation. The first stage has no prediction.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noiseclassifier import Event
from noisemodel import Block, Run
from noisemodel.types import Array, Indices, Mask

MOST = 16  # most stretches that are picked; a long run is not read whole


def quiet_stretches(
    run: Run, failures: Sequence[Event | Block], *, length: float, most: int = MOST
) -> list[slice]:
    """Pick stretches without failures or gaps, spread evenly over a run.

    Args:
        length: Length of a stretch, in [s].
    """
    size = max(1, round(length * run.rate))
    free = run.mask.copy()
    for failure in failures:
        first, last = np.searchsorted(run.time, (failure.start, failure.stop))
        free[first:last] = False
    count = len(free) // size
    starts = size * np.flatnonzero(free[: count * size].reshape(count, size).all(axis=1))
    if len(starts) > most:
        starts = starts[np.linspace(0, len(starts) - 1, most).astype(int)]
    return [slice(start, start + size) for start in starts.tolist()]


DESIRED, MEASURED = "desired", "measured"


@dataclass(frozen=True, eq=False)
class Flow:
    """The velocities of a stretch of a run at each stage of the control flow."""

    # Of the stages: those that the run names, in its order, then desired and measured.
    names: tuple[str, ...]
    joints: tuple[str, ...]
    velocity: Array  # shape (stages, samples, joints), in [rad/s] or [m/s]
    time: Array  # shape (samples,), in [s]
    valid: Mask  # False in gaps, shape (samples,)
    rate: float  # samples per second, in [Hz]

    def samples(self, seconds: float) -> int:
        """Number of samples in a time, at least one."""
        return max(1, round(seconds * self.rate))


def flow(run: Run, part: slice) -> Flow:
    """Gather the stages of a run, for the joints that all of them have."""
    own = list(range(len(run.joint_names)))
    stages = [(name, signal, own) for name, signal in run.stages.items()]
    joints = own
    if run.velocity_desired is not None:
        places = {name: index for index, name in enumerate(run.desired_joint_names)}
        joints = [index for index in own if run.joint_names[index] in places]
        wanted = [places[run.joint_names[index]] for index in joints]
        stages.append((DESIRED, run.velocity_desired, wanted))
    stages.append((MEASURED, run.velocity, own))
    return Flow(
        names=tuple(name for name, _, _ in stages),
        joints=tuple(run.joint_names[index] for index in joints),
        velocity=np.array(
            [
                signal[part][:, columns if name == DESIRED else joints]
                for name, signal, columns in stages
            ],
            dtype=np.float64,
        ),
        time=run.time[part],
        valid=run.mask[part],
        rate=run.rate,
    )


SPAN = 0.001  # time over which a velocity's change is taken, in [s]
TRAIL = 0.02  # time of the mean that is subtracted from changes, in [s]
# Lags of the prediction, in [s].
LAGS = (0.0, 0.0005, 0.001, 0.0015, 0.002, 0.003, 0.004, 0.006, 0.008, 0.012)
LENGTH = 0.1  # length of a quiet stretch, in [s]
WARM = TRAIL + LAGS[-1] + SPAN  # transient of filters and prediction, in [s]
PARTS = 16  # most quiet stretches that the prediction is fitted to
ROWS = 3000  # most samples of the least squares
RIDGE = 1e-3  # regularisation of the least squares, as a share of the mean power


@dataclass(frozen=True, eq=False)
class Innovation:
    """Innovation of a stretch of a run."""

    change: Array  # sudden changes, shape (stages, samples, joints), in [rad/s²]
    residual: Array  # their prediction residual, of the same shape
    total: Array  # norm of the changes over the joints, shape (stages, samples), in [rad/s²]
    # Norm of the residual, but no more than ``total``, shape (stages, samples), in [rad/s²]: a
    # change that was predicted and does not occur is no innovation.
    level: Array


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


def quiet_statistics(run: Run, failures: Sequence[Event | Block]) -> QuietStatistics:
    """Fit the prediction to the quiet stretches of a run, and measure its residual there."""
    parts = quiet_stretches(run, failures, length=LENGTH + WARM, most=PARTS)
    stretches = [flow(run, part) for part in parts]
    first = stretches[0] if stretches else flow(run, slice(0, 1))
    stages, _, joints = first.velocity.shape
    lags = np.unique(np.round(np.array(LAGS) * run.rate).astype(np.int64))
    zeros = np.zeros(stages)
    if not stretches:
        return QuietStatistics(np.zeros((stages - 1, joints, len(lags))), lags, zeros, zeros)
    velocity = np.stack([each.velocity for each in stretches])
    size = velocity.shape[2]
    warm = min(first.samples(WARM), size - 1)
    change = sudden(velocity, np.ones(size, dtype=bool), run.rate)
    step = max(1, (size - warm) * len(change) // ROWS)
    # By stage, joint, stretch and sample, and then with all samples in a row.
    moved = np.ascontiguousarray(change.transpose(1, 3, 0, 2))
    target = moved[1:, ..., warm::step].reshape(stages - 1, joints, -1)
    past = np.stack(
        [moved[:-1, ..., warm - lag : size - lag : step] for lag in lags.tolist()], axis=2
    ).reshape(stages - 1, joints, len(lags), -1)
    square = past @ past.swapaxes(2, 3)
    mean = np.trace(square, axis1=2, axis2=3)[..., None, None] / len(lags)
    square = square + (RIDGE * mean + np.finfo(float).tiny) * np.eye(len(lags))
    weights = np.linalg.solve(square, past @ target[..., None])[..., 0]
    total = np.linalg.norm(change, axis=3)
    rest = np.linalg.norm(_residual(change, weights, lags), axis=3)
    level = np.minimum(total, rest)[..., warm:]  # stretches, stages, samples
    return QuietStatistics(
        weights,
        lags,
        power=np.percentile(np.square(level).mean(axis=2), 90.0, axis=0),
        peak=np.percentile(level.max(axis=2), 90.0, axis=0),
    )


def _residual(change: Array, weights: Array, lags: Indices) -> Array:
    """Changes less their prediction, shape (..., stages, samples, joints)."""
    residual = change.copy()
    for place, own in enumerate(weights):
        for column, lag in enumerate(lags.tolist()):
            past = change[..., place, : change.shape[-2] - lag, :]
            residual[..., place + 1, lag:, :] -= own[:, column] * past
    return residual


def sudden(velocity: Array, valid: Mask, rate: float) -> Array:
    """Change over 1 ms, less the mean of such changes over the past 20 ms.

    Args:
        velocity: Shape (..., samples, joints), in [rad/s].
        valid: False in gaps, shape (samples,).
        rate: Samples per second, in [Hz].

    Returns:
        Of the same shape, in [rad/s²]; 0 next to gaps.
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
    run: Run, quiet: QuietStatistics, failure: Event | Block, *, reach: float
) -> Localisation:
    """Find the stage in which a failure shows first.

    Args:
        reach: How long after its start it may have set in, in [s].

    Returns:
        The stage, its lag to the next and its joints, without the band; empty if no stage shows
        the failure.
    """
    stop = min(failure.stop, failure.start + LONGEST)
    edges = (failure.start - BEFORE, max(stop, failure.start + reach) + AFTER)
    first, last = (int(index) for index in np.searchsorted(run.time, edges))
    stages = flow(run, slice(first, last))
    start, end = (int(index) for index in np.searchsorted(stages.time, (failure.start, stop)))
    if end <= start or not stages.valid[start:end].any():
        return Localisation()
    change = sudden(stages.velocity, stages.valid, stages.rate)
    residual = _residual(change, quiet.weights, quiet.lags)
    residual[:, ~stages.valid] = 0.0
    total, rest = np.linalg.norm(change, axis=2), np.linalg.norm(residual, axis=2)
    innovation = Innovation(change, residual, total, np.minimum(total, rest))
    found, during = None, slice(start, end)
    level, size = innovation.level[-1, during], stages.samples(BIN)
    power = np.add.reduceat(np.square(level), np.arange(0, len(level), size)) / size
    loud = power > max(LOUD * power.max(), MORE * float(quiet.power[-1]))
    if not loud.sum() * BIN >= LASTING:
        edges = (failure.start - EARLY, failure.start + reach)
        first, last = np.searchsorted(stages.time, edges).tolist()
        found = _earliest(stages, innovation, quiet, first, last)
    return found or _adding(stages, innovation, quiet, during) or Localisation()


def _earliest(
    stages: Flow, innovation: Innovation, quiet: QuietStatistics, first: int, last: int
) -> Localisation | None:
    """Order the stages by the onset of a blow or jump."""
    rate, samples = stages.rate, len(stages.time)
    # A stage without innovation in quiet stretches would exceed its peak at once.
    scale = quiet.peak + PASSED_ON * (float(quiet.peak.max()) or 1.0)
    relative = (innovation.level / scale[:, None]).max(axis=0)
    moment = rise(relative, first, last, rate=rate)
    early, late = (max(1, round(time * rate)) for time in AROUND)
    around = slice(max(0, moment - early), min(samples, moment + late))
    onsets = [
        (onset(level, moment, around, rate=rate, least=PASSED_ON * float(peak)), place)
        for place, (level, peak) in enumerate(
            zip(innovation.level, innovation.total[:, around].max(axis=1), strict=True)
        )
    ]
    found = sorted((at, place) for at, place in onsets if at is not None)
    if found and found[0][1] == 0 and len(innovation.level) > 1:
        common = float(innovation.level[0, around].max()) <= EXCEEDS * quiet.peak[0]
        responses = [at for at, place in found if place == 1]
        if common and not any(at - found[0][0] <= RESPONSE * rate for at in responses):
            found = found[1:]
    if not found:
        return None
    earliest, place = found[0]
    at, other = next((later for later in found if later[0] > earliest), (earliest, None))
    fresh = slice(earliest, earliest + stages.samples(SPREAD))
    return Localisation(
        stage=stages.names[place],
        following="" if other is None else stages.names[other],
        lag=(at - earliest) / rate,
        joints=_joints(stages, innovation.residual[place, fresh]),
        onset=float(stages.time[earliest]),
    )


def _adding(
    stages: Flow, innovation: Innovation, quiet: QuietStatistics, during: slice
) -> Localisation | None:
    """Find the first stage that adds to a vibration."""
    power = np.square(innovation.level[:, during]).mean(axis=1)
    total = np.square(innovation.total[:, during]).mean(axis=1)
    least = np.maximum(MORE * quiet.power, PASSED_ON**2 * total)
    excess = np.where(power > least, power - quiet.power, 0.0)
    if not excess.max() > 0.0:
        return None
    place = int(np.argmax(excess >= ADDS * excess.max()))
    joints = _joints(stages, innovation.residual[place, during])
    if place == len(excess) - 1:
        return Localisation(stages.names[place], joints=joints)
    cause, effect = innovation.change[place, during], innovation.change[-1, during]
    # The lag, up to the slowest, at which one follows the other best, all joints together.
    most = stages.samples(SLOWEST)
    waves = [np.fft.rfft(signal, len(cause) + most, axis=0) for signal in (effect, cause)]
    together = np.fft.irfft((waves[0] * waves[1].conj()).sum(axis=1), len(cause) + most)
    lag = int(np.argmax(together[: most + 1])) / stages.rate
    return Localisation(stages.names[place], stages.names[-1], lag, joints=joints)


def _joints(stages: Flow, residual: Array) -> tuple[tuple[str, float], ...]:
    """Joints of the largest residual, shape (samples, joints), and their shares of its power."""
    power = np.square(residual).sum(axis=0)
    shares = power / (power.sum() or 1.0)
    ranked = np.argsort(-shares, kind="stable")[:JOINTS].tolist()
    return tuple((stages.joints[i], float(shares[i])) for i in ranked if shares[i] > 0.0)


def rise(level: Array, first: int, last: int, *, rate: float) -> int:
    """Find where a level first rises: 10 ms against the 50 ms before, both as mean squares.

    Args:
        rate: Samples per second, in [Hz].
    """
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
    """Find the onset of a blow or jump.

    Args:
        moment: Sample of the steepest rise, and the samples around it in which the onset lies.
        rate: Samples per second, in [Hz].
        least: Peak that has to be exceeded in any case, in the same unit.

    Returns:
        The sample; None if the level hardly exceeds that before.
    """
    back, ahead = (round(time * rate) for time in (BACK, AHEAD))
    before = level[max(0, moment - back - ahead) : max(1, moment - ahead)]
    reference = max(float(np.sqrt(np.mean(np.square(before)))), float(np.median(level)))
    peak = float(level[around].max(initial=0.0))
    if not peak > max(PEAK * reference, least):
        return None
    return int(around.start + np.argmax(level[around] > max(SHARE * peak, CLEAR * reference)))
