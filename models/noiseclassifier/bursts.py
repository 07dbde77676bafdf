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
from dataclasses import dataclass
from typing import Any

import numpy as np

from noiseclassifier.labels import Event
from noiseclassifier.lasting import AROUND, MEASURED, STRONG, Windows, loud, merged, spectrum
from noiseclassifier.signals import Array

WINDOW, HOP = 0.5, 0.125  # duration of a window, and time from one to the next, in [s]
# Time by which a burst begins after its window, and ends before it, in [s]: those of windows that
# follow each other overlap, and are one.
MARGIN = (WINDOW - HOP) / 2 - 0.01
LOWEST = 13.0  # lowest frequency, in [Hz]
WIDTH = 5  # frequencies of a window that are one line
NEAR = 5  # windows on either side that are no rest
REST, PAST = 8, 16  # least windows of the rest of a file, and of the past of a stream
# Thresholds: of 457 good runs of 24 simulated robots (0.76 h) at 1000 and 250 Hz, 8 have a burst,
# of which 6 have a finding anyway. Of tones of half a second, 17, 51, 73 and 91 % are found at 10,
# 15, 20 and 30 dB above the level of their joint and octave.
LEVEL = -50.0  # least level of a line, in [dB re 1 rad/s]
PROMINENT = 25.0  # least level of a line over the median of the frequencies around it, in [dB]
# Score of a burst: that of a line of this strength that lasts. How much less the rest of the run
# has is not known of a stream.
SCORE = 1.0 - 0.5 * 10.0 ** (-(PROMINENT - STRONG) / 10.0)
PURE = 0.7  # least share of a line in its octave
# Least level of a line over the mean of the rest of the run at its frequencies, in [dB].
ABOVE = 20.0


@dataclass
class Line:
    """A line that is prominent in a window."""

    row: int  # the joint
    places: slice  # its frequencies
    power: float  # its mean square
    near: float  # sum of these over the windows nearby, and its own
    windows: int  # how many these are
    first: int  # number of its first sample


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
        self._windows = 0
        self._recent: deque[Array] = deque(maxlen=NEAR)
        self._lines: list[Line] = []
        self._events: list[Event] = []

    @property
    def events(self) -> tuple[Event, ...]:
        """Findings so far, in order of time."""
        if not self._whole:
            return tuple(self._events)
        found = (self._event(line, REST) for line in self._lines)
        return merged(*(event for event in found if event is not None))

    def _found(self, slopes: Array) -> Iterable[tuple[Array, list[tuple[int, slice]]]]:
        power, frequency = spectrum(slopes[0], self.rate)
        return zip(power.swapaxes(0, 1), prominent(power, frequency, self.rate), strict=True)

    def _follow(self, found: tuple[Array, list[tuple[int, slice]]]) -> None:
        power, lines = found
        self._sum = self._sum + power
        self._windows += 1
        for line in reversed(self._lines if self._whole else []):
            if self._first - line.first > NEAR * self._hop:
                break
            line.near += float(power[line.row, line.places].sum())
            line.windows += 1
        for row, places in lines:
            own = float(power[row, places].sum())
            near = own + sum(float(each[row, places].sum()) for each in self._recent)
            line = Line(row, places, own, near, len(self._recent) + 1, self._first)
            if self._whole:
                self._lines.append(line)
            elif event := self._event(line, PAST):
                self._events = [*merged(*self._events, event)]
        self._recent.append(power)

    def _end(self, rest: Array) -> None:
        """Nothing ends: windows before a gap may have the same line as those after it."""

    def _event(self, line: Line, least: int) -> Event | None:
        """The finding that a line is, if there is enough of the rest of the run and it has less."""
        windows = self._windows - line.windows
        if windows < least:
            return None
        rest = (float(self._sum[line.row, line.places].sum()) - line.near) / windows
        if line.power < 10.0 ** (ABOVE / 10.0) * rest:
            return None
        first = self.start + line.first / self.rate
        return Event("oscillations", first + MARGIN, first + WINDOW - MARGIN, SCORE)


def prominent(power: Array, frequency: Array, rate: float) -> list[list[tuple[int, slice]]]:
    """Joint and frequencies of each prominent line of each window.

    The power is the mean square at each frequency, shape (joints, windows, frequencies).
    """
    row, window, place = loud(power, frequency, LEVEL, LOWEST, rate)
    found: list[list[tuple[int, slice]]] = [[] for _ in range(power.shape[1])]
    first, stop = place - WIDTH // 2, np.minimum(place + WIDTH // 2 + 1, len(frequency))
    low, high = around(frequency, place, np.sqrt(2.0))
    low, high = np.minimum(low, first), np.maximum(high, stop)
    summed = power.cumsum(axis=2)
    own = summed[row, window, stop - 1] - summed[row, window, first - 1]
    whole = summed[row, window, high - 1] - summed[row, window, low - 1]
    pure = own >= PURE * whole
    row, window, place = row[pure], window[pure], place[pure]
    kept = np.empty(len(place), dtype=bool)
    for each in np.unique(place).tolist():
        same = np.flatnonzero(place == each)
        low, high = around(frequency, each, AROUND)
        middle = (high - low) // 2
        beside = np.partition(power[row[same], window[same], low:high], middle, axis=1)
        own = power[row[same], window[same], each]
        kept[same] = own >= 10.0 ** (PROMINENT / 10.0) * beside[:, middle]
    for k in np.flatnonzero(kept).tolist():
        line = slice(
            int(place[k]) - WIDTH // 2, min(int(place[k]) + WIDTH // 2 + 1, len(frequency))
        )
        found[window[k]].append((int(row[k]), line))
    return found


def around(frequency: Array, places: Any, ratio: float) -> Any:
    """The first of the frequencies within a ratio of some, and the one after the last."""
    centres = frequency[places]
    return np.searchsorted(frequency, centres / ratio), np.searchsorted(frequency, centres * ratio)
