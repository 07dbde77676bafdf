"""Levels of a run by joint, octave and time, and the slow motion by which runs are aligned.

A frame lasts 0.2 s and the next one begins 0.05 s later. Octaves go from 8 Hz to 0.45 of the rate.
Each joint has two signals: its velocity, and its tracking error where a velocity is desired.
"""

from bisect import bisect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy import fft
from numpy.typing import NDArray

from noisemodel import Run
from noisemodel.noise import in_both
from noisemodel.runfile import pieces
from noisemodel.types import Array, Real

HOP = 0.05  # from one frame to the next, in [s]
BINS = 4  # hops in a frame
# Lower edge of the first octave, in [Hz], and upper edge of the last as a share of the rate.
LOWEST, HIGHEST = 8.0, 0.45
SETTLING = 1.0  # time after which filters have rung out, in [s]
# Stretch of a stream that is measured at once, and longest stream that is kept, in [s].
PIECE, LONGEST = 3.0, 3600.0
LATEST = 2  # pieces of a stream that are compared while it runs
SIGNALS = ("velocity", "tracking error")
OVER_TIME = ("level", "guide", "pace")  # what `Levels` has of each frame
# What the slow motion is taken from, the best first.
GUIDES = {
    "position_desired": "desired positions",
    "velocity_desired": "desired velocities",
    "position": "measured positions",
    "velocity": "measured velocities",
}
# What code 0 of a stored level stands for, the step between codes, and the code of no level.
LEAST_DB, STEP_DB, ABSENT = -100.0, 0.5, 255
Codes = NDArray[np.uint8]
Octaves = tuple[tuple[float, float], ...]


@dataclass(frozen=True, eq=False)
class Levels:
    """The levels of a run."""

    name: str  # its scenario
    run: str  # its file, as people read it
    sha256: str  # of its file; empty without
    robot: str  # that it names; empty without
    joints: tuple[str, ...]
    rate: float  # [Hz]
    start: float  # [s]
    duration: float  # [s]
    octaves: Octaves  # lower and upper edges, in [Hz]
    # Shape (frames, joints, 2, octaves), in [dB re 1 rad/s]; NaN in gaps, and of tracking errors
    # that are not known.
    level: NDArray[np.float32]
    guide: NDArray[np.float32]  # slow positions, shape (frames, joints), in [rad] or [m]
    guided_by: str  # what these are, of `GUIDES`
    pace: NDArray[np.float32]  # slow speed, rms over the joints, shape (frames,), in [rad/s]
    origin: NDArray[np.float32] | None = None  # first of the guide of the stream it is a part of

    @property
    def apart(self) -> str:
        """Name of a scenario of its own, if another motion has its name: with that of its file."""
        folder, _, last = self.name.rpartition("/")
        stem = Path(self.run).stem
        if not stem:
            return self.name
        if not stem.startswith(last):
            return f"{self.name}/{stem}"
        return f"{folder}/{stem}" if folder else stem

    @property
    def first(self) -> NDArray[np.float32]:
        """Slow positions at the start of the run or stream, shape (joints,), in [rad] or [m]."""
        return self.guide[0] if self.origin is None else self.origin

    @property
    def time(self) -> Array:
        """Middle of each frame, shape (frames,), in [s]."""
        return np.asarray(self.start + (np.arange(len(self.guide)) + BINS / 2) * HOP)

    @cached_property
    def tracked(self) -> tuple[str, ...]:
        """Joints with tracking errors."""
        errors = self.level[:, :, 1]
        return tuple(j for at, j in enumerate(self.joints) if np.isfinite(errors[:, at]).any())

    @property
    def guided(self) -> tuple[str, ...]:
        """Joints of which the guide is known: desired signals may be of some joints alone."""
        return (self.guided_by.startswith("desired") and self.tracked) or self.joints

    @property
    def speed(self) -> Array:
        """Slow velocities, shape (frames, joints), in [rad/s] or [m/s]."""
        if len(self.guide) < 2:
            return np.zeros(self.guide.shape)
        return np.asarray(np.gradient(self.guide.astype(np.float64), HOP, axis=0))


def octaves(rate: float) -> Octaves:
    """Edges of the octaves at a rate, in [Hz]; the last one may be cut, to half of its width."""
    top, found, low = HIGHEST * rate, [], LOWEST
    while low * 1.5 <= top:
        found.append((low, min(2 * low, top)))
        low *= 2
    return tuple(found)


def levels(run: Run, *, name: str = "", file: str = "", sha256: str = "") -> Levels:
    """Measure the levels of a run; what stays in its file is read piece by piece."""
    bands = octaves(run.rate)
    of_sample = np.floor(np.arange(len(run.time)) / (run.rate * HOP) + 1e-9).astype(np.int64)
    count = int(of_sample[-1]) + 1
    firsts = np.searchsorted(of_sample, np.arange(count))
    sizes = np.diff(np.append(firsts, len(of_sample)))
    frames = max(0, int(count - (sizes[-1] < 0.9 * run.rate * HOP)) - BINS + 1)
    energy = _energies(run, bands, of_sample, count)
    samples = np.maximum(_framed(sizes.astype(float), frames), 1.0)[:, None, None]
    level = energy[:frames]
    for place in range(len(bands)):  # one by one, in place: all at once take several times as much
        power = _framed(energy[..., place].astype(np.float64), frames) / samples
        level[..., place] = np.maximum(10 * np.log10(np.maximum(power, 1e-30)), LEAST_DB)
    lost = np.add.reduceat((~run.mask).astype(np.int64), firsts) > 0
    # The filters still ring a frame after a gap.
    level[_framed(np.convolve(lost, np.ones(BINS + 1))[:count], frames) > 0] = np.nan
    level[:, np.setdiff1d(np.arange(len(run.joint_names)), _tracked(run)[0]), 1] = np.nan
    guide, guided_by = _guide(run, of_sample, count, lost)
    moved = _framed(_means(run.velocity, of_sample, count), frames) / BINS
    return Levels(
        name,
        file,
        sha256,
        run.robot or "",
        run.joint_names,
        run.rate,
        float(run.time[0]),
        run.duration,
        bands,
        level,
        (_framed(guide, frames) / BINS).astype(np.float32),
        guided_by,
        np.sqrt(np.square(moved).sum(axis=1) / max(1, moved.shape[1])).astype(np.float32),
    )


class LevelStream:
    """Measures the levels of a run while it comes, 3 s at a time, so that no sample is kept.

    Args:
        tell: Called with the levels of the last 6 s after every 3 s, a second later.
    """

    def __init__(
        self,
        joint_names: tuple[str, ...],
        rate: float,
        robot: str = "",
        tell: Callable[[Levels], None] | None = None,
    ) -> None:
        self._joints, self._rate, self._robot, self._tell = joint_names, rate, robot, tell
        self._names: tuple[str, ...] = ()  # of the signals that are held
        # Samples that wait, shape (samples, signals, joints); NaN where they are not known.
        self._held = np.empty((0, 0, 0), np.float32)
        self._before = 0  # bins of the samples held that were measured already
        # Numbers of samples, and their times in [s]: the true rate is seldom the nominal one.
        self._clock: list[tuple[int, float]] = []
        self._count = self._frames = 0  # of samples that came, of frames that are measured
        self._parts: list[Levels] = []
        self._origin: NDArray[np.float32] | None = None
        self.too_long = False

    def push(
        self, time: Array, signals: Mapping[str, Array], valid: NDArray[np.bool_], lost: Array
    ) -> None:
        """Take samples.

        Args:
            time: Their times, shape (samples,), in [s].
            signals: Velocities, desired ones and positions, each of shape (samples, joints).
            valid: Which samples are known, shape (samples,).
            lost: How many samples are missing before each, shape (samples,).
        """
        # Positions tell the motion only where no desired velocity does.
        guides = [name for name in ("velocity_desired", "position") if name in signals]
        self._names = ("velocity", *guides[:1])
        known = valid & np.isfinite(signals[self._names[-1]]).all(axis=1)
        samples = np.stack([signals[name] for name in self._names], axis=1, dtype=np.float32)
        samples[~known] = np.nan
        if not self._count:
            self._held = samples[:0]
        for first, stop in pairwise([0, *np.flatnonzero(lost[1:] > 0) + 1, len(samples)]):
            missing, piece = int(lost[first]), round(PIECE * self._rate)
            if missing > LONGEST * self._rate:
                self.too_long = True
                missing = piece
            count, end = self._count + missing, float(time[stop - 1]) + 1.0 / self._rate
            self._clock[-1:] = [(count, float(time[first])), (count + stop - first, end)]
            for done in range(0, missing, piece):
                shape = min(piece, missing - done), *samples.shape[1:]
                self._add(np.full(shape, np.nan, np.float32))
            self._add(samples[first:stop])

    def finish(self) -> Levels | None:
        """Levels of what came; None of less than a frame, or of more than an hour.

        Of more than an hour, the last samples are told as those before were.
        """
        if len(self._held) > 1:
            self._measure(len(self._held), None)
        if self.too_long or not self._parts:
            return None
        found, firsts = self._joined(self._parts), [part.start for part in self._parts]
        # Frames of a stream that is faster or slower than its nominal rate, anew every 0.05 s.
        numbers = np.cumsum([0, *(len(part.guide) for part in self._parts)])
        ends = [*firsts, self._time()]
        time = np.arange(firsts[0], ends[-1] - HOP / 2, HOP)
        taken = np.interp(time, ends, numbers).round().astype(int).clip(max=self._frames - 1)
        anew: dict[str, Any] = {name: getattr(found, name)[taken] for name in OVER_TIME}
        duration = self._clock[-1][1] - firsts[0]
        return replace(found, start=firsts[0], duration=duration, **anew)

    def _joined(self, parts: Sequence[Levels]) -> Levels:
        """The last pieces as one."""
        whole: dict[str, Any] = {
            name: np.concatenate([getattr(each, name) for each in parts]) for name in OVER_TIME
        }
        frames = len(whole["guide"])
        start = parts[-1].start - (frames - len(parts[-1].guide)) * HOP
        duration = (frames + BINS - 1) * HOP
        return replace(parts[-1], start=start, duration=duration, origin=self._origin, **whole)

    def _add(self, samples: NDArray[np.float32]) -> None:
        self._count += len(samples)
        self.too_long = self.too_long or self._count > LONGEST * self._rate
        if self.too_long:
            self._parts = self._parts[-LATEST:]
        self._held = np.concatenate((self._held, samples))
        bins, around = round(PIECE / HOP), round(SETTLING / HOP)
        # Filters need a second of samples to each side.
        while len(self._held) > (enough := self._samples(self._before + bins + BINS + around)):
            self._measure(enough, bins)
            self._held = self._held[self._samples(self._before + bins - around) :]
            self._before = around

    def _time(self) -> float:
        """Time at which the next frame to be measured begins; of those before it none is kept."""
        sample = self._frames * self._rate * HOP
        counts, times = zip(*self._clock, strict=True)
        self._clock = self._clock[max(0, bisect(counts, sample) - 1) :]
        return float(np.interp(sample, counts, times))

    def _samples(self, bins: int) -> int:
        return int(np.ceil(bins * self._rate * HOP - 1e-9))

    def _measure(self, samples: int, frames: int | None) -> None:
        """Measure frames of the first samples that are held; all that there are if None."""
        held = self._held[:samples]
        valid = np.asarray(np.isfinite(held).all(axis=(1, 2)))
        signals = np.where(valid[:, None, None], held, np.float32(0.0)).transpose(1, 0, 2)
        run = Run(
            time=np.arange(samples) / self._rate,
            joint_names=self._joints,
            valid=valid if valid.any() else None,
            robot=self._robot or None,
            **dict(zip(self._names, signals, strict=True)),
        )
        found = levels(run)
        guide, level = found.guide, found.level
        if not valid.any():
            level = np.full_like(level, np.nan)
        if self._parts and len(guide) >= self._before:
            # What is integrated or unwrapped goes on from the piece before.
            step = self._parts[-1].guide[-1] - guide[self._before - 1]
            if not found.guided_by.endswith("velocities"):
                step = 2 * np.pi * np.round(step / (2 * np.pi))
            guide = (guide + step).astype(np.float32)
        taken = slice(self._before, None if frames is None else self._before + frames)
        part = replace(found, start=self._time(), level=level[taken], guide=guide[taken])
        part = replace(part, pace=found.pace[taken])
        if len(part.guide):
            self._origin = part.guide[0] if self._origin is None else self._origin
            self._parts.append(part)
            self._frames += len(part.guide)
            if self._tell is not None and (frames is not None or self.too_long):
                self._tell(self._joined(self._parts[-LATEST:]))


def encoded(level: NDArray[np.float32]) -> Codes:
    """Levels in steps of 0.5 dB; NaN is ``ABSENT``."""
    codes = np.clip(np.round((level - LEAST_DB) / STEP_DB), 0, ABSENT - 1)
    return np.where(np.isnan(codes), ABSENT, codes).astype(np.uint8)


def decoded(codes: Codes) -> NDArray[np.float32]:
    """Undo `encoded`."""
    level = LEAST_DB + STEP_DB * codes.astype(np.float32)
    return np.where(codes == ABSENT, np.float32(np.nan), level)


def _framed(binned: Array, frames: int) -> Array:
    """Sum over the bins of each frame."""
    total = np.concatenate((np.zeros((1, *binned.shape[1:])), np.cumsum(binned, axis=0)))
    return np.asarray(total[BINS : BINS + frames] - total[:frames])


def _tracked(run: Run) -> tuple[list[int], list[int]]:
    """Columns of the joints with tracking errors, in measured and in desired velocities."""
    return ([], []) if run.velocity_desired is None else in_both(run)


def _energies(
    run: Run, bands: Octaves, of_sample: NDArray[np.int64], count: int
) -> NDArray[np.float32]:
    """Energy of each bin, shape (bins, joints, 2, octaves)."""
    joints, settling = len(run.joint_names), round(SETTLING * run.rate)
    energy = np.zeros((count, 2 * joints, len(bands)), np.float32)
    before = np.zeros((2 * joints, settling))
    for rows, signals in _signals(run):
        # The filters start from rest, or from the end of the piece before; zeros let them ring out.
        around = np.concatenate((before, signals), axis=1)
        before = around[:, -settling:]
        size = -(-(around.shape[1] + settling) // 1024) * 1024  # a length of small factors
        spectrum = fft.rfft(around, size, axis=1)
        frequency = np.arange(spectrum.shape[1]) * (run.rate / size)
        s = 1j * np.tan(np.pi * np.clip(frequency, 1e-9, run.rate * (0.5 - 1e-9)) / run.rate)
        bins = of_sample[rows]
        starts = np.flatnonzero(np.diff(bins, prepend=-1))
        for place, band in enumerate(bands):
            passed = fft.irfft(spectrum * _response(s, band, run.rate), size, axis=1)
            passed = passed[:, settling : around.shape[1]]
            energy[bins[starts], :, place] += np.add.reduceat(passed**2, starts, axis=1).T
    return energy.reshape(count, 2, joints, len(bands)).transpose(0, 2, 1, 3)


def _response(
    s: NDArray[np.complex128], band: tuple[float, float], rate: float
) -> NDArray[np.complex128]:
    """Response of a digital Butterworth band-pass of second order, by the bilinear transform.

    It is the filter of ``scipy.signal.butter``, which takes half a second to import.
    """
    low, high = np.tan(np.pi * np.array(band) / rate)
    s = (s**2 + low * high) / ((high - low) * s)
    return np.asarray(1.0 / (s**2 + np.sqrt(2.0) * s + 1.0))


def _signals(run: Run) -> Iterator[tuple[slice, Array]]:
    """Velocities, then tracking errors, less their first values, held over gaps, by piece."""
    own, wanted = _tracked(run)
    first = last = np.empty(0)
    for rows in pieces(run.velocity):
        velocity = np.asarray(run.velocity[rows], dtype=np.float64)
        error = np.zeros_like(velocity)
        if run.velocity_desired is not None:
            error[:, own] = velocity[:, own] - run.velocity_desired[rows][:, wanted]
        both = np.hstack((velocity, error))
        valid = run.mask[rows]
        if not len(first):
            first = last = both[valid.argmax()]
        # In a gap all values are 0: the last valid one stands in, without a step.
        before = np.maximum.accumulate(np.where(valid, np.arange(len(both)), -1))
        both = np.where((before < 0)[:, None], last, both[before])
        last = both[-1]
        yield rows, np.ascontiguousarray((both - first).T)


def _guide(
    run: Run, of_sample: NDArray[np.int64], count: int, lost: NDArray[np.bool_]
) -> tuple[Array, str]:
    """Mean slow positions in bins, and what they are."""
    signal = next(each for each in GUIDES if getattr(run, each) is not None)
    means = _means(getattr(run, signal), of_sample, count)
    known = np.flatnonzero(~lost)
    if len(known) and lost.any():
        every = np.arange(count)
        means = np.stack([np.interp(every, known, column[known]) for column in means.T], axis=1)
    if signal.startswith("velocity"):
        means = np.cumsum(means, axis=0) * HOP
    else:
        means = np.unwrap(means, axis=0)
    if signal.endswith("desired"):
        guide, (own, wanted) = np.zeros((count, len(run.joint_names))), in_both(run)
        guide[:, own] = means[:, wanted]
        means = guide
    return means, GUIDES[signal]


def _means(values: Real, of_sample: NDArray[np.int64], count: int) -> Array:
    """Means of signals in bins, shape (bins, joints)."""
    sums = np.zeros((count, values.shape[1]))
    for rows in pieces(values):
        bins = of_sample[rows]
        starts = np.flatnonzero(np.diff(bins, prepend=-1))
        part = np.asarray(values[rows], dtype=np.float64)
        sums[bins[starts]] += np.add.reduceat(part, starts, axis=0)
    return np.asarray(sums / np.bincount(of_sample, minlength=count)[:, None])
