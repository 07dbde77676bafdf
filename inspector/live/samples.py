"""Samples as they arrive: collected in a buffer, checked by a clock, counted where lost."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from inspector.errors import InspectorError
from inspector.recording.views import FARTHEST
from noisemodel.run import LARGEST
from noisemodel.types import Array, Mask


class LiveError(InspectorError):
    """Samples that cannot be taken at all."""


class SinkError(InspectorError):
    """A viewer or a file that nothing can be drawn into."""


class Warnings:
    """Counts warnings by kind, and emits the first of each."""

    def __init__(self, emit: Callable[[str], None]) -> None:
        self.emit = emit
        self.counts: Counter[str] = Counter()

    def note(self, kind: str, line: str, count: int = 1) -> None:
        """Count a warning, and emit it if it is the first of its kind."""
        if count > 0:
            if kind not in self.counts:
                self.emit(line)
            self.counts[kind] += count


# What a session takes, besides the time; as the run file names it.
SIGNALS = ("velocity", "velocity_desired", "position", "base_velocity", "base_pose")


class SampleBuffer:
    """Collects a batch of samples, beside some that wait for those that follow."""

    def __init__(self, size: int, widths: Mapping[str, int], warnings: Warnings) -> None:
        self._size, self._widths, self._warnings = size, widths, warnings
        self._pieces: list[dict[str, Array]] = []
        self.held = self._waiting = 0

    @property
    def room(self) -> int:
        """Samples that are missing from a batch."""
        return self._size + self._waiting - self.held

    @property
    def stamps(self) -> Array:
        """Timestamps of all samples that are held, shape (held,)."""
        names = ("time", *self._widths)
        joined = {name: np.concatenate([each[name] for each in self._pieces]) for name in names}
        self._pieces = [joined]
        return joined["time"]

    def put(self, rows: Mapping[str, Array], time: Array) -> None:
        """Take samples; missing signals, or of other widths, are unknown."""
        widths = {name: values.shape[1] for name, values in rows.items()}
        for name in sorted(widths.keys() | self._widths.keys()):
            now, first = widths.get(name, 0), self._widths.get(name, 0)
            if now != first:
                line = (
                    f"{name} has {now} columns from {time[0]:.3f} s on, and had {first} at first:"
                    " not shown, and not labelled where it makes noise"
                )
                self._warnings.note(f"samples with another width of {name}", line, len(time))
        piece = {"time": time}
        for name, width in self._widths.items():
            known = widths.get(name) == width
            piece[name] = rows[name] if known else np.full((len(time), width), np.nan)
        self._pieces.append(piece)
        self.held += len(time)

    def take(self, kept: Mask) -> dict[str, Array]:
        """Take out the signals of the samples that are kept; those after them wait."""
        (whole,) = self._pieces
        signals = {name: whole[name][: len(kept)][kept] for name in self._widths}
        for values in signals.values():
            values[~(np.abs(values) < LARGEST)] = np.nan  # the square of others would overflow
        self._pieces = [{name: values[len(kept) :] for name, values in whole.items()}]
        self.held = self._waiting = self.held - len(kept)
        return signals


def rows_of(given: Mapping[str, ArrayLike]) -> dict[str, Array]:
    """Bring one sample or a chunk of them into rows, each of shape (samples, columns)."""
    rows: dict[str, Array] = {}
    for name, values in given.items():
        try:
            array = np.array(values, dtype=np.float64)  # a copy: a caller may use his again
        except (TypeError, ValueError) as error:
            raise LiveError(f"{name}: holds no numbers ({error})") from error
        if array.ndim not in (1, 2):
            raise LiveError(
                f"{name}: shape {array.shape}, expected (joints,) for one sample or"
                " (samples, joints)"
            )
        rows[name] = array if array.ndim == 2 else array.reshape(1, -1)
        if len(rows[name]) != len(rows["velocity"]):
            listed = ", ".join(f"{len(array)} of {name}" for name, array in rows.items())
            raise LiveError(f"samples differ in number: {listed}")
    return rows


def widths_of(rows: Mapping[str, Array], joint_names: Sequence[str]) -> dict[str, int]:
    """Fix the signals of a session, and their columns, by its first samples."""
    joints = len(joint_names) or rows["velocity"].shape[1]
    for name, array in rows.items():
        width = {"base_velocity": 6, "base_pose": 7}.get(name, joints)
        if array.shape[1] != width:
            raise LiveError(
                f"{name}: {array.shape[1]} columns in the first sample, expected {width}"
            )
    return {name: array.shape[1] for name, array in rows.items()}


GAP_STEPS = 1.5  # steps after which a sample is taken to be missing; timestamps may jitter by less
JUMP_STEPS = 20.0  # steps beyond which a timestamp is believed only once others agree with it
AGREE = 5  # timestamps in a row that make a jump a new segment, and no outlier
LONGEST = 3600.0  # jump ahead up to which samples are missing, in [s]; beyond, the clock was set
RATE_TOLERANCE = 0.05  # share by which the rate of the timestamps may differ from the nominal one
RATE_STEPS = 20  # steps from which a rate is estimated
# Units of timestamps, by the power of ten by which their steps exceed the rate's.
UNITS = {3: "milliseconds", 6: "microseconds", 9: "nanoseconds"}
BACKWARDS, TIMELESS = "samples out of order", "samples without time"
OUTLYING = "outlying timestamps"
# Kinds of warnings of samples that are left out.
DROPPED = (BACKWARDS, TIMELESS, OUTLYING, "malformed rows")


class Clock:
    """Decides by its timestamp what becomes of each sample.

    A sample that follows the one before within 20 steps is taken. A timestamp that lies elsewhere
    is an outlier, unless the next ones agree with it: then the clock has jumped. Up to an hour
    ahead that is a gap; anything else is a new segment, whose times go on from the last one. The
    cost does not depend on how far the clock jumps.
    """

    def __init__(self, rate: float, warnings: Warnings) -> None:
        self._rate, self._warnings = rate, warnings
        self._unit = 0.0  # until it is known
        self._last = self._shift = 0.0  # timestamp of the last sample taken; from there to its time
        self._before: float | None = None  # its time
        self._checked = False

    def take(self, stamps: Array, *, ended: bool = False) -> tuple[Mask, Array, Array]:
        """Decide about samples, those that waited before first.

        Args:
            stamps: Timestamps, shape (samples,), in [s], or in the unit that the rate tells.
            ended: Whether none will follow, so that none has to wait.

        Returns:
            Which samples are kept, shape (decided,), since of those at the end only what follows
            can decide; how many are missing before each that is kept; and their times, always
            increasing, in [s].
        """
        stamps = np.where(np.abs(stamps) < 1e100, stamps, np.nan)  # differences would overflow
        if not self._unit and not self._begin(stamps, ended=ended):
            return np.zeros(0, dtype=bool), np.empty(0), np.empty(0)
        known = stamps * self._unit
        kept, time = np.zeros(len(known), dtype=bool), np.empty(len(known))
        place, decided = 0, len(known)
        while place < decided:
            follows = self._follows(np.append(self._last, known[place:-1]), known[place:])
            run = decided - place if follows.all() else int(follows.argmin())
            part = slice(place, place + run)
            kept[part], time[part] = True, known[part] + self._shift
            place += run
            if run:
                self._last = float(known[place - 1])
            if place < decided:
                stop, found = self._ahead(known, place)
                if found == "open" and not ended:
                    decided = stop
                stop = decided if found == "open" else stop
                self._note_dropped(known[place:stop])
                if found == "jump":
                    self._jump(float(known[stop]))
                place = stop
        time = time[:decided][kept[:decided]]
        return kept[:decided], self._lost(time), time

    def _begin(self, stamps: Array, *, ended: bool) -> bool:
        """Take the unit of timestamps from the first ones, if there are enough."""
        finite = stamps[np.isfinite(stamps)]
        if len(finite) < AGREE and len(stamps) < 2 * AGREE and not ended:
            return False
        steps = np.diff(finite[:RATE_STEPS])
        step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0 / self._rate
        power = 3 * round(np.log10(step * self._rate) / 3)
        self._unit = 1.0
        if power in UNITS and 0.5 < step * self._rate / 10.0**power < 2.0:
            self._unit = 10.0**-power
            line = f"timestamps count {UNITS[power]} at {self._rate:g} Hz: read as such"
            self._warnings.emit(line)
        first = float(finite[0]) * self._unit if len(finite) else 0.0
        self._last = first - 1.0 / self._rate
        self._shift = -first if abs(first) > FARTHEST else 0.0
        return True

    def _follows(self, before: Array | float, after: Array | float) -> Mask:
        # Of times, not of stamps: tiny steps vanish in the sum, and times have to increase.
        steps = self._rate * ((after + self._shift) - (before + self._shift))
        return np.asarray((steps > 0.0) & (steps <= JUMP_STEPS))

    def _ahead(self, stamps: Array, place: int) -> tuple[int, str]:
        """Where to go on after a sample that does not follow the last one, and why.

        "old": that sample follows; "jump": from there on enough follow each other; "open": those
        from there on do, but are too few yet.
        """
        first, agree, before = len(stamps), 0, 0.0
        for index in range(place, len(stamps)):
            stamp = float(stamps[index])
            if not np.isfinite(stamp):
                continue
            if self._follows(self._last, stamp):
                return index, "old"
            if agree and self._follows(before, stamp):
                agree += 1
            else:
                first, agree = index, 1
            before = stamp
            if agree == AGREE:
                return first, "jump"
        return first, "open"

    def _jump(self, stamp: float) -> None:
        """Go on at a timestamp that lies elsewhere."""
        ahead = stamp - self._last
        if not JUMP_STEPS < ahead * self._rate <= LONGEST * self._rate:
            now = self._last + self._shift
            line = f"the clock jumps by {ahead:+.6g} s at {now:.3f} s: times go on from there"
            self._warnings.note("clock jumps", line)
            self._shift = now + 2.0 / self._rate - stamp  # one sample, at least, is missing
        self._last = stamp - 1.0 / self._rate

    def _lost(self, time: Array) -> Array:
        """Samples that are missing before each time; warns of them, and once of a wrong rate."""
        if not len(time):
            return np.empty(0)
        before = time[0] if self._before is None else self._before
        steps = self._rate * np.diff(time, prepend=before)
        self._before = float(time[-1])
        lost = np.where(steps >= GAP_STEPS, np.round(steps) - 1.0, 0.0)
        if lost.any():
            first = int(np.argmax(lost > 0))
            line = f"gap at {time[first]:.3f} s: {lost[first]:.0f} samples are missing"
            self._warnings.note("missing samples", line, int(lost.sum()))
        if not self._checked and len(steps) > RATE_STEPS:
            self._checked = True
            step = float(np.median(steps))
            if abs(step - 1.0) > RATE_TOLERANCE:
                line = (
                    f"timestamps have {self._rate / step:.4g} Hz, the nominal rate is"
                    f" {self._rate:g} Hz: labels and spectrogram are wrong, set --rate"
                )
                self._warnings.note("wrong rate", line)
        return lost

    def _note_dropped(self, stamps: Array) -> None:
        before, after = stamps[stamps <= self._last], stamps[stamps > self._last]
        if len(before):
            line = f"time stands still or runs backwards at {before[0]:.6g} s: left out"
            self._warnings.note(BACKWARDS, line, len(before))
        if len(after):
            line = f"a timestamp of {after[0]:.6g} s after {self._last:.6g} s: left out"
            self._warnings.note(OUTLYING, line, len(after))
        unknown = len(stamps) - len(before) - len(after)
        self._warnings.note(TIMELESS, "a time is no number: left out", unknown)
