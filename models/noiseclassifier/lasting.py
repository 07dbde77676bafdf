"""What lasts: a line in the spectrum of a joint that stands out, for as long as it is there.

Trees on features relative to a run see what changes in it; a joint that vibrates from the first
sample to the last is its own reference. A line needs no past: its *prominence* is its level over
the median level of the frequencies within a factor of 1.5 around it. Motion, impacts and the noise
of sensors are broad; a control loop that chatters, a resonance that is excited or an added tone are
lines. The *strength* of a line, in [dB], is its prominence, but at most its level re 1 rad/s plus
50 dB: a line of 3 mrad/s has the strength 0 however silent the joint is beside it.

Where there is a tracking error, a line of both stands out from the neighbourhood in either: motion
is no part of the error. A line of the error alone is none of the robot: the desired motion has it.

A line that is strong in windows that follow each other, in one joint and at one frequency, is
oscillations. The ripple of a drive follows the speed of its joint from window to window, and thus
has no one frequency. Files and streams have the same windows, hence the same numbers.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from noiseclassifier.labels import UNKNOWN, Event
from noiseclassifier.signals import JOINTS, Array, Index, Mask, Real, Tail

WINDOW, HOP = 1.0, 0.25  # duration of a window, and time from one to the next, in [s]
# Time by which a finding begins after the first of its windows, and ends before the last, in [s],
# but where the signal begins or ends.
MARGIN = (WINDOW - HOP) / 2
# Shortest stretch without a gap that can be judged, in [s]: it is a window of its own.
SHORTEST = 0.6
# Lines that count: lowest frequency, in [Hz], and highest, as a share of the sample rate.
LOWEST, HIGHEST = 10.0, 0.47
AROUND = 1.5  # ratio of frequencies up to which the neighbourhood of a line reaches
BAND = 1.1  # ratio of frequencies whose lines have one neighbourhood
FLOOR = -50.0  # level of a line whose strength is 0 at most, in [dB re 1 rad/s]
# Thresholds: of 72 good runs of 20 simulated robots, the strongest line has 15 dB in three windows,
# and 18 dB in one, but 23 and 31 dB in two runs. Of 49 runs with oscillations, half have more than
# 18 dB in three windows. `python -m benchmarks.lasting` measures them anew.
STRONG = 18.0  # strength of a line in each of ``WINDOWS`` windows that makes it a finding, in [dB]
WINDOWS = 3  # windows in a row; in a stretch that has fewer, all of them
SHARP = 25.0  # strength in one window that makes a finding of a strong line of any length, in [dB]
# Least level of a line over the motion of its joint, the level below ``LOWEST``, in [dB]. Targets
# that a policy holds for a while leave lines in proportion to the motion. Of 352 good runs, 11 have
# strong ones, all 28.6 dB or more below it; of 159 runs with oscillations, 143 have a strong line
# less than 25.9 dB below it.
MOVING = -27.0
DRIFT = 2.0  # how far a line moves from one window to the next, in [Hz]
# Level by which a line may be lower in each half of a window than in the window, in [dB].
HALVES = 10.0
TINY = 1e-30  # mean square of silence, in [rad²/s²]
MEASURED, ERROR = JOINTS[1], JOINTS[2]
# How many samples are transformed at once, of all joints: more leave the cache of the processor.
AT_ONCE = 2**15
Peak: TypeAlias = tuple[int, float, float]  # joint, frequency in [Hz] and strength in [dB]


@dataclass(frozen=True)
class Line:
    """A strong line of a joint that was followed from window to window."""

    row: int  # the joint
    frequency: float  # in the latest window, in [Hz]
    strength: float  # least strength of its windows, in [dB]
    windows: int  # how many it was followed through
    first: int  # number of the first one's first sample
    stop: int  # number of the sample after its last window
    sharp: float  # largest strength of a window, in [dB]

    @property
    def found(self) -> bool:
        """Whether it is a finding."""
        return self.windows >= WINDOWS or self.sharp >= SHARP


class Windows(ABC):
    """Cuts signals that come in chunks of any size into windows, none of which touches a gap.

    Rate in [Hz]; window, hop and start in [s].
    """

    SIGNALS: ClassVar[tuple[str, ...]] = (MEASURED, ERROR)  # that are taken
    LEAST: ClassVar[int] = 1  # windows that are taken at once

    def __init__(self, rate: float, window: float, hop: float, start: float) -> None:
        self.rate, self.start = rate, start
        self._length, self._hop = round(window * rate), max(1, round(hop * rate))
        self._first = 0  # number of the first sample that is held
        self._count = 0  # samples of the stretch from where the next window begins
        self._last: list[Array] = []  # of these, the latest one
        # Their differences: slow motion, which is far louder, would leak into all frequencies.
        self._slopes = Tail(0, 0)

    def push(self, signals: Mapping[str, Real], valid: Mask | None = None) -> None:
        """Take samples.

        Args:
            signals: By name; measured velocities and tracking errors joint by joint are taken, of
                shape (joints, samples).
            valid: False in gaps, shape (samples,); no window touches a gap.
        """
        if MEASURED not in signals:
            return
        names = [name for name in self.SIGNALS if name in signals]
        fresh = [np.asarray(signals[name], np.float64) for name in names]
        if valid is None or valid.all():
            self._take(fresh)
            return
        gaps = np.flatnonzero(np.diff(valid, prepend=True)).tolist()
        for first, stop in pairwise([0, *gaps, len(valid)]):
            if first == stop or valid[first]:
                self._take([each[:, first:stop] for each in fresh])
            else:
                self.skip(stop - first)

    def skip(self, samples: int) -> None:
        """Skip a gap."""
        self.finish()
        self._first += samples

    def finish(self) -> None:
        """End a stretch: the signal ends, or a gap begins."""
        self._end(self._slopes.samples)
        self._first += self._count
        self._count = 0

    def _take(self, fresh: Sequence[Array]) -> None:
        joints, count = fresh[0].shape
        if not count:
            return
        begun = int(self._count > 0)
        if not begun:
            self._slopes = Tail(len(fresh), joints)
        slopes = self._slopes.more(count - 1 + begun)
        for number, samples in enumerate(fresh):
            np.subtract(samples[:, 1:], samples[:, :-1], out=slopes[number, :, begun:])
            if begun:
                np.subtract(samples[:, 0], self._last[number], out=slopes[number, :, 0])
        self._last = [samples[:, -1].copy() for samples in fresh]
        self._count += count
        windows = max(0, 1 + (self._count - self._length) // self._hop)
        if not windows:
            return
        cut = sliding_window_view(self._slopes.samples, self._length - 1, axis=2)
        cut = cut[:, :, : windows * self._hop : self._hop]
        at_once = max(self.LEAST, AT_ONCE // (joints * self._length))
        for first in range(0, windows, at_once):
            for found in self._found(cut[:, :, first : first + at_once]):
                self._follow(found)
                self._first += self._hop
        self._slopes.drop(windows * self._hop)
        self._count -= windows * self._hop

    @abstractmethod
    def _found(self, slopes: Array) -> Iterable[Any]:
        """What is found in each of some windows of differences, (signals, joints, windows, n)."""

    @abstractmethod
    def _follow(self, found: Any) -> None:
        """Take what is found in the next window of a stretch."""

    @abstractmethod
    def _end(self, rest: Array) -> None:
        """End a stretch, of which a rest is in no window or in earlier ones: its differences."""


class Lasting(Windows):
    """Finds lines that last in signals that come in chunks of any size."""

    LEAST = 8  # one at a time takes a third longer

    def __init__(self, rate: float, *, start: float = 0.0) -> None:
        super().__init__(rate, WINDOW, HOP, start)
        self._margin = round(MARGIN * rate)
        self._windows = 0  # of the stretch
        self._halves = np.empty((0, 0))  # greatest mean square of a line of the last two halves
        self.examined = 0  # windows; none where each stretch is shorter than ``SHORTEST``
        self._lines: list[Line] = []  # of the latest window
        self._events: list[Event] = []

    @property
    def events(self) -> tuple[Event, ...]:
        """Findings so far, in order of time."""
        return tuple(self._events)

    @property
    def decided(self) -> float:
        """Time before which no finding begins that is still to come, in [s]."""
        firsts = [line.first for line in self._lines]
        return self.start + min([self._first, *firsts]) / self.rate

    def _found(self, slopes: Array) -> Iterable[list[Peak]]:
        return strong(slopes, self.rate, self._heard(slopes[0]))

    def _heard(self, slopes: Array) -> Mask:
        """Joints and windows that may have a strong line, (joints, windows): a half is loud.

        Few are. A window ends with a half of its own; the two before are the last of the two
        windows before it.
        """
        ends = slopes[..., 2 * self._hop :]
        if not self._windows:
            starts = [slopes[:, :1, first:][..., : ends.shape[2]] for first in (0, self._hop)]
            self._halves = self._loudest(np.concatenate(starts, axis=1))
        halves = np.concatenate((self._halves, self._loudest(ends)), axis=1)
        self._halves = halves[:, -2:]
        level = sliding_window_view(halves, 3, axis=1).max(axis=2)
        return np.asarray(level >= 10.0 ** ((STRONG + FLOOR - HALVES) / 10.0))

    def _loudest(self, halves: Array) -> Array:
        """Greatest mean square of a line of each half, shape (joints, halves)."""
        longer = np.zeros((*halves.shape[:2], halves.shape[2] + 1))  # it is transformed fast
        longer[..., 1:] = halves
        power, frequency = spectrum(longer, self.rate)
        least = max(1, int(np.searchsorted(frequency, LOWEST)) - 1)
        found: Array = power[..., least:].max(axis=2, initial=0.0)
        return found

    def _end(self, rest: Array) -> None:
        length = self._count
        if not self._windows and length >= SHORTEST * self.rate:
            slopes = rest[:, :, None]
            (peaks,) = strong(slopes, self.rate, np.ones(slopes.shape[1:3], dtype=bool))
            self._follow(peaks, length)
        for line in self._lines:
            if line.found or line.windows == self._windows < WINDOWS:
                self._add(line, self._first + length)
        self._lines, self._windows = [], 0

    def _follow(self, found: list[Peak], length: int = 0) -> None:
        """Continue the lines of the window before with the peaks of the next one."""
        stop, lines = self._first + (length or self._length), []
        self._windows += 1
        self.examined += 1
        for row, frequency, strength in found:
            line = Line(row, frequency, strength, 1, self._first, stop, strength)
            before = [
                each
                for each in self._lines
                if each.row == row and abs(each.frequency - frequency) <= DRIFT
            ]
            if before:
                best = max(before, key=lambda each: (each.windows, each.strength))
                line = replace(
                    line,
                    first=best.first,
                    windows=best.windows + 1,
                    strength=min(strength, best.strength),
                    sharp=max(strength, best.sharp),
                )
            lines.append(line)
        self._lines = lines
        for line in lines:
            if line.found:
                self._add(line, line.stop - self._margin)

    def _add(self, line: Line, stop: int) -> None:
        # The line begins somewhere in its first window, but with that of a stretch.
        first = line.first + (self._margin if line.windows < self._windows else 0)
        times = self.start + first / self.rate, self.start + stop / self.rate
        score = 1.0 - 0.5 * 10.0 ** (-max(line.strength - STRONG, 0.0) / 10.0)
        event = Event("oscillations", *times, score, line=(line.row, line.frequency))
        self._events = [*merged(*self._events, event)]


def strong(slopes: Array, rate: float, heard: Mask) -> list[list[Peak]]:
    """The strong lines of each window.

    It takes differences of measured velocities, and of tracking errors if there are any, in
    [rad/s], of shape (1 or 2, joints, windows, samples), and which joints and windows may have any.
    """
    found: list[list[Peak]] = [[] for _ in range(slopes.shape[2])]
    rows, windows = np.nonzero(heard)
    line, frequency = spectrum(slopes[0, rows, windows], rate)
    pair, place = loud(line, frequency, STRONG + FLOOR, LOWEST, rate)
    counts = line[pair, place] >= 10.0 ** (MOVING / 10.0) * slow(line, frequency)[pair]
    pair, place = pair[counts], place[counts]
    if not len(place):
        return found
    pairs, pair = np.unique(pair, return_inverse=True)
    rows, windows = rows[pairs], windows[pairs]
    errors = spectrum(slopes[1:, rows, windows], rate)[0]
    power = np.concatenate((line[None, pairs], errors))
    median = np.empty((len(power), len(place)))
    band = np.floor(np.log(frequency[place] / LOWEST) / np.log(BAND))
    for each in np.unique(band).tolist():
        centre = LOWEST * BAND ** (each + 0.5)
        around = slice(*np.searchsorted(frequency, (centre / AROUND, centre * AROUND)))
        own = np.flatnonzero(band == each)
        beside = power[:, pair[own], around]
        middle = beside.shape[-1] // 2
        median[:, own] = np.partition(beside, middle, axis=-1)[..., middle]
    # A line of both, at the level of the weaker one.
    shared = np.maximum(np.minimum(power[0, pair, place], power[:, pair, place]), TINY)
    level = 10.0 * np.log10(shared)
    prominence = level - 10.0 * np.log10(np.maximum(median, TINY))
    strength = np.minimum(prominence, level - FLOOR).max(axis=0)
    for k in np.flatnonzero(strength >= STRONG).tolist():
        peak = int(rows[pair[k]]), float(frequency[place[k]]), float(strength[k])
        found[windows[pair[k]]].append(peak)
    return found


def loud(
    power: Array, frequency: Array, level: float, lowest: float, rate: float
) -> tuple[Index, ...]:
    """Where a line has a level in [dB] or more, from a frequency on: the indices of each axis.

    The power is the mean square at each frequency, shape (..., frequencies).
    """
    first = max(1, int(np.searchsorted(frequency, lowest)))
    stop = min(len(frequency) - 1, int(np.searchsorted(frequency, HIGHEST * rate, "right")))
    *spectra, place = np.nonzero(power[..., first:stop] >= 10.0 ** (level / 10.0))
    place += first
    own = power[*spectra, place]
    top = (own >= power[*spectra, place - 1]) & (own >= power[*spectra, place + 1])
    return tuple(each[top] for each in (*spectra, place))


def slow(power: Array, frequency: Array) -> Array:
    """Mean square of the motion, below `LOWEST`, of spectra of shape (..., frequencies)."""
    total: Array = power[..., 1 : int(np.searchsorted(frequency, LOWEST))].sum(axis=-1)
    return total


def spectrum(slopes: Array, rate: float) -> tuple[Array, Array]:
    """Mean square of the line at each frequency, shape (..., frequencies), and these in [Hz].

    It takes the differences of samples, shape (..., samples - 1).
    """
    length = slopes.shape[-1]
    taper, response = _taper(length)
    waves = np.fft.rfft(slopes * taper, axis=-1)
    power = np.square(waves.real)
    power += np.square(waves.imag)
    power *= response
    return power, np.arange(waves.shape[-1]) * (rate / length)


@lru_cache
def _taper(length: int) -> tuple[Array, Array]:
    """Hann window, and factors from squares of the transform to mean squares of the signal."""
    taper = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    slope = 2.0 * np.sin(np.pi * np.arange(length // 2 + 1) / length)
    slope[0] = np.inf
    return taper, 2.0 / np.square(taper.sum() * slope)


def merged(*events: Event) -> tuple[Event, ...]:
    """Events in order of time, those that overlap or touch as one."""
    found: list[Event] = []
    for event in sorted(events, key=lambda event: (event.start, event.stop)):
        if found and found[-1].stop >= event.start:
            found[-1] = joined(found[-1], event)
        else:
            found.append(event)
    return tuple(found)


def joined(event: Event, other: Event) -> Event:
    """One event of two that overlap or touch, of the class that is known and lasts longer.

    Of two that last equally long, that of the higher score gives the line.
    """
    longer = max(
        event, other, key=lambda each: (each.label != UNKNOWN, each.stop - each.start, each.score)
    )
    return replace(
        longer,
        start=min(event.start, other.start),
        stop=max(event.stop, other.stop),
        score=max(event.score, other.score) if event.label == other.label else longer.score,
        novel=event.novel or other.novel,
    )
