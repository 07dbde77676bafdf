"""What a run has only for a while: a line of a joint that the rest of its run lacks.

A tone of half a second is too short for what lasts, and trees do not know how little of its
frequency a joint has otherwise. A line is a *burst* if its frequency holds most of its octave, it
stands out from the frequencies within a factor of 1.5 around it, and it is far above what the same
few frequencies of the joint have in the rest of the run: motion, impacts and the noise of sensors
are broad, and what a drive or a gait does again and again is in the rest, too.

The rest of a file is before and after. A stream has only its past, and no burst before there is
enough of it.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from noiseclassifier.labels import Event
from noiseclassifier.lasting import (
    AROUND,
    MEASURED,
    STRONG,
    TINY,
    Windows,
    loud,
    merged,
    slow,
    spectrum,
)
from noiseclassifier.signals import Array, Index

WINDOW, HOP = 0.5, 0.125  # duration of a window, and time from one to the next, in [s]
# Time by which a burst begins after its window, and ends before it, in [s]: those of windows that
# follow each other overlap, and are one.
MARGIN = (WINDOW - HOP) / 2 - 0.01
LOWEST = 13.0  # lowest frequency, in [Hz]
WIDTH = 5  # frequencies of a window that are one line
NEAR = 5  # windows on either side that are no rest
REST, PAST = 8, 16  # least windows of the rest of a file, and of the past of a stream
# Thresholds: of 528 good runs of 24 simulated robots (0.88 h) at 1000 and 250 Hz, 11 of six motions
# have a burst. Of tones of half a second, 33, 66, 89 and 98 % are found at 10, 15, 20 and 30 dB
# above the level of their joint and octave.
LEVEL = -50.0  # least level of a line, in [dB re 1 rad/s]
PROMINENT = 22.0  # least level of a line over the median of the frequencies around it, in [dB]
# Score of a burst: that of a line of this strength that lasts. How much less the rest of the run
# has is not known of a stream.
SCORE = 1.0 - 0.5 * 10.0 ** (-(PROMINENT - STRONG) / 10.0)
PURE = 0.7  # least share of a line in its octave
ALONE = (
    0.99  # the same of a line that is no part of its neighbourhood: ripple and ringing are broad
)
# Least level of a line over the mean of the rest of the run at its frequencies, in [dB]. Where the
# joint moves faster than in the rest, it is that much more: what a drive does rises with its speed.
ABOVE = 18.0
# Level of a line over the motion of its joint from which it is no ripple of that motion, in [dB]:
# in good runs it has up to -16 dB.
RIPPLE = -12.0


@dataclass(frozen=True)
class Lines:
    """The lines that are prominent in a window; arrays have shape (lines,)."""

    row: Index  # the joint
    place: Index  # the middle one of the frequencies
    power: Array  # the mean square
    near: Array  # sum of these over the windows nearby, and the own one
    motion: Array  # mean square of the slow motion of its joint
    moving: Array  # sum of these, as of ``near``
    windows: int  # how many these are
    first: int  # number of the first sample


class Bursts(Windows):
    """Finds bursts in signals that come in chunks of any size.

    Args:
        whole: Whether the signal is known to its end before `events` are asked for: a file, and no
            stream.
    """

    SIGNALS = (MEASURED,)

    def __init__(self, rate: float, *, start: float = 0.0, whole: bool = False) -> None:
        # One sample more: its differences have a length that is transformed fast.
        super().__init__(rate, WINDOW + 1.0 / rate, HOP, start)
        self._whole = whole
        self._sum: Array = np.zeros(())  # of the spectra of all windows
        self._frequency: Array = np.zeros(0)  # of a spectrum, in [Hz]
        self._windows = 0
        # The same before each of the latest windows, those that are nearby.
        self._recent: deque[Array] = deque(maxlen=NEAR + 1)
        self._open: deque[Lines] = deque()  # windows that are nearby may still come
        self._lines: list[Lines] = []
        self._events: list[Event] = []

    @property
    def events(self) -> tuple[Event, ...]:
        """Findings so far, in order of time."""
        if not self._whole:
            return tuple(self._events)
        lines = [*self._lines, *map(self._closed, self._open)]
        found = (self._event(each, REST) for each in lines)
        return merged(*(event for event in found if event is not None))

    def _found(self, slopes: Array) -> Iterable[tuple[Array, Index, Index]]:
        power, frequency = spectrum(slopes[0], self.rate)
        self._frequency = frequency
        row, window, place = prominent(power, frequency, self.rate)
        for number in range(power.shape[1]):
            own = window == number
            yield power[:, number], row[own], place[own]

    def _follow(self, found: tuple[Array, Index, Index]) -> None:
        power, row, place = found
        while self._open and self._first - self._open[0].first > NEAR * self._hop:
            self._lines.append(self._closed(self._open.popleft()))
        self._recent.append(self._sum if self._windows else np.zeros_like(power))
        self._sum = self._recent[-1] + power
        self._windows += 1
        if not len(row):
            return
        # Of the windows nearby, what is before them is subtracted until they have come.
        own, before = summed(power, row, place), summed(self._recent[0], row, place)
        motion, moved = self._motion(power, row), self._motion(self._recent[0], row)
        count = len(self._recent) - self._windows
        lines = Lines(row, place, own, -before, motion, -moved, count, self._first)
        if self._whole:
            self._open.append(lines)
        elif event := self._event(self._closed(lines), PAST):
            self._events = [*merged(*self._events, event)]

    def _motion(self, power: Array, row: Index) -> Array:
        """Mean square of the slow motion of some joints, from the spectra of all."""
        return slow(power, self._frequency)[row]

    def _closed(self, lines: Lines) -> Lines:
        """Lines of which the latest window is the last one nearby."""
        near = lines.near + summed(self._sum, lines.row, lines.place)
        moving = lines.moving + self._motion(self._sum, lines.row)
        return replace(lines, near=near, moving=moving, windows=lines.windows + self._windows)

    def _end(self, rest: Array) -> None:
        """Nothing ends: windows before a gap may have the same line as those after it."""

    def _event(self, lines: Lines, least: int) -> Event | None:
        """The finding that lines are, if there is enough of the rest of the run and it has less."""
        windows = self._windows - lines.windows
        if windows < least:
            return None
        rest = (summed(self._sum, lines.row, lines.place) - lines.near) / windows
        motion = (self._motion(self._sum, lines.row) - lines.moving) / windows
        needed = 10.0 ** (ABOVE / 10.0) * rest
        faster = needed * np.maximum(lines.motion / np.maximum(motion, TINY), 1.0)
        ripple = np.maximum(10.0 ** (RIPPLE / 10.0) * lines.motion, needed)
        above = lines.power * (lines.power >= np.minimum(faster, ripple))
        if not above.any():
            return None
        first, best = self.start + lines.first / self.rate, int(above.argmax())
        line = int(lines.row[best]), float(self._frequency[lines.place[best]])
        return Event("oscillations", first + MARGIN, first + WINDOW - MARGIN, SCORE, line=line)


def summed(power: Array, row: Index, place: Index) -> Array:
    """Sum over the frequencies of each line, of powers of shape (joints, frequencies)."""
    own = place[:, None] + np.arange(-(WIDTH // 2), WIDTH // 2 + 1)
    there = own < power.shape[1]
    found: Array = (there * power[row[:, None], np.where(there, own, 0)]).sum(axis=1)
    return found


def prominent(power: Array, frequency: Array, rate: float) -> tuple[Index, Index, Index]:
    """Joint, window and place of each prominent line.

    The power is the mean square at each frequency, shape (joints, windows, frequencies).
    """
    lowest = int(np.searchsorted(frequency, LOWEST))
    loudest = power[..., lowest:].max(axis=2, initial=0.0)
    rows, windows = np.nonzero(loudest >= 10.0 ** (LEVEL / 10.0))  # most often few
    power = power[rows, windows]
    pair, place = loud(power, frequency, LEVEL, LOWEST, rate)
    first, stop = place - WIDTH // 2, np.minimum(place + WIDTH // 2 + 1, len(frequency))
    low, high = around(frequency, place, np.sqrt(2.0))
    low, high = np.minimum(low, first), np.maximum(high, stop)
    sums = power.cumsum(axis=1)
    own = sums[pair, stop - 1] - sums[pair, first - 1]
    whole = sums[pair, high - 1] - sums[pair, low - 1]
    share = own / np.maximum(whole, TINY)
    pure = share >= PURE
    pair, place, alone = pair[pure], place[pure], share[pure] >= ALONE
    # It is far enough above the median of those beside if it is above more than half of them. Of a
    # low line that is all but alone in its octave, its own are none of these.
    low, high = around(frequency, place, AROUND)
    number = np.arange(len(frequency))
    beside = (number >= low[:, None]) & (number < high[:, None])
    beside &= ~alone[:, None] | (np.abs(number - place[:, None]) > WIDTH // 2)
    far = 10.0 ** (PROMINENT / 10.0) * power[pair] <= power[pair, place][:, None]
    kept = 2 * (far & beside).sum(axis=1) > beside.sum(axis=1)
    return rows[pair[kept]], windows[pair[kept]], place[kept]


def around(frequency: Array, places: Any, ratio: float) -> Any:
    """The first of the frequencies within a ratio of some, and the one after the last."""
    centres = frequency[places]
    return np.searchsorted(frequency, centres / ratio), np.searchsorted(frequency, centres * ratio)
