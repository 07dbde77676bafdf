"""Samples as they arrive: collected in a buffer, checked by a clock, counted where lost."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inspector.errors import InspectorError
from noisemodel.checks import LARGEST
from noisemodel.types import Array, Mask


class LiveError(InspectorError):
    """Samples that cannot be taken at all."""


class SinkError(InspectorError):
    """A viewer or a file that nothing can be drawn into."""


class Warnings:
    """Warnings by kind."""

    def __init__(self, emit: Callable[[str], None]) -> None:
        self.emit = emit
        self._counts: Counter[str] = Counter()

    def note(self, kind: str, line: str, count: int = 1) -> None:
        """Count a warning, and emit it if it is the first of its kind."""
        if count <= 0:
            return
        if kind not in self._counts:
            self.emit(line)
        self._counts[kind] += count

    @property
    def counts(self) -> dict[str, int]:
        """How many there were of each kind."""
        return dict(self._counts)


SIGNALS = ("velocity", "velocity_desired", "position", "base_velocity", "base_pose")
"""What a session takes, besides the time; as the run file names it."""


class SampleBuffer:
    """Room for some samples."""

    def __init__(self, size: int, widths: Mapping[str, int], warnings: Warnings) -> None:
        self._size, self._warnings = size, warnings
        self.signals = {name: np.empty((size, width)) for name, width in widths.items()}
        self.time, self.received = np.empty(size), np.empty(size)
        self.held = 0

    @property
    def full(self) -> bool:
        """Whether no sample fits in."""
        return self.held == self._size

    def put(self, rows: Mapping[str, Array], time: Array, received: float) -> int:
        """Take as many samples as fit in.

        Args:
            rows: Signals, each of shape (samples, columns); those that are missing or of another
                width are unknown in these samples.
            time: Shape (samples,), in [s].
            received: When they were, in [s] on the clock that delays are measured by.
        """
        count = min(len(time), self._size - self.held)
        place = slice(self.held, self.held + count)
        self.time[place], self.received[place] = time[:count], received
        for name, values in self.signals.items():
            given = rows.get(name)
            fits = given is not None and given.shape[1] == values.shape[1]
            values[place] = given[:count] if given is not None and fits else np.nan
            if not fits:
                self._note(name, given, values.shape[1], time[0], count)
        for name in rows:
            if name not in self.signals:
                line = f"{name} from {time[0]:.3f} s on was not there at first: not shown"
                self._warnings.note(f"samples with a new {name}", line, count)
        self.held += count
        return count

    def take(self) -> tuple[Array, Array, dict[str, Array]]:
        """Take all samples out."""
        held, self.held = self.held, 0
        signals = {name: values[:held] for name, values in self.signals.items()}
        for values in signals.values():
            values[~(np.abs(values) < LARGEST)] = np.nan
        return self.time[:held], self.received[:held], signals

    def _note(self, name: str, given: Array | None, width: int, time: float, count: int) -> None:
        if given is None:
            line = f"no {name} from {time:.3f} s on: it was there at first"
            self._warnings.note(f"samples without {name}", line, count)
        else:
            line = (
                f"{name} of {given.shape[1]} columns from {time:.3f} s on, where it had {width}:"
                " not shown, and not labelled where it makes noise"
            )
            self._warnings.note(f"samples with another width of {name}", line, count)


def rows_of(given: Mapping[str, ArrayLike]) -> dict[str, Array]:
    """Bring one sample or a chunk of them into rows.

    Args:
        given: Signals by name, the velocity first: of shape (columns,) for one sample, or
            (samples, columns).

    Returns:
        Each of shape (samples, columns).
    """
    rows: dict[str, Array] = {}
    for name, values in given.items():
        try:
            array = np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise LiveError(f"{name}: holds no numbers ({error})") from error
        rows[name] = array if array.ndim == 2 else array.reshape(1, -1)
        if array.ndim not in (1, 2):
            raise LiveError(
                f"{name}: shape {array.shape}, expected (joints,) for one sample or"
                " (samples, joints)"
            )
        if len(rows[name]) != len(rows["velocity"]):
            listed = ", ".join(f"{len(array)} of {name}" for name, array in rows.items())
            raise LiveError(f"samples differ in number: {listed}")
    return rows


def widths_of(rows: Mapping[str, Array], joint_names: Sequence[str]) -> dict[str, int]:
    """Fix the signals of a session by its first samples.

    Args:
        rows: Signals, each of shape (samples, columns).
    """
    joints = len(joint_names) or rows["velocity"].shape[1]
    wanted = {"base_velocity": 6, "base_pose": 7}
    for name, array in rows.items():
        width = wanted.get(name, joints)
        if array.shape[1] != width:
            raise LiveError(
                f"{name}: {array.shape[1]} columns in the first sample, expected {width}"
            )
    return {name: array.shape[1] for name, array in rows.items()}


GAP_STEPS = 1.5
"""Steps after which a sample is taken to be missing; timestamps may jitter by less."""
RATE_TOLERANCE = 0.05
"""Share by which the rate of the timestamps may differ from the nominal one."""
LATEST = 1e19
"""Larger stamps are no times, not even in nanoseconds."""
RATE_STEPS = 20
"""Steps from which a rate is estimated."""


class Taken(NamedTuple):
    """Which samples a clock takes."""

    kept: Mask
    """False where time stands still or runs backwards, shape (samples,)."""
    lost: Array
    """Samples that are missing before each of those that are kept, shape (kept,)."""


class Clock:
    """Finds gaps in timestamps.

    Args:
        rate: Nominal samples per second, in [Hz].
    """

    def __init__(self, rate: float, warnings: Warnings) -> None:
        self._rate, self._warnings = rate, warnings
        self._last: float | None = None
        self._checked = False

    def take(self, stamps: Array) -> Taken:
        """Check the timestamps of some samples.

        Args:
            stamps: Timestamps, shape (samples,), in [s].
        """
        finite = np.abs(stamps) < LATEST
        before = -np.inf if self._last is None else self._last
        latest = np.maximum.accumulate(np.where(finite, stamps, -np.inf))
        kept = finite & (stamps > np.maximum(before, np.append(-np.inf, latest[:-1])))
        self._note_dropped(stamps[finite & ~kept], int((~finite).sum()))
        times = stamps[kept]
        steps = self._rate * np.diff(times, prepend=times[:1] if self._last is None else before)
        lost = np.where(steps >= GAP_STEPS, np.round(steps) - 1.0, 0.0)
        if lost.any():
            first = int(np.argmax(lost > 0))
            line = f"gap at {times[first]:.3f} s: {lost[first]:.0f} samples are missing"
            self._warnings.note("missing samples", line, int(lost.sum()))
        self._check_rate(steps)
        if len(times):
            self._last = float(times[-1])
        return Taken(kept, lost)

    def _note_dropped(self, backwards: Array, unknown: int) -> None:
        if len(backwards):
            line = f"time stands still or runs backwards at {backwards[0]:.6g} s: left out"
            self._warnings.note("samples out of order", line, len(backwards))
        self._warnings.note("samples without time", "a time is no number: left out", unknown)

    def _check_rate(self, steps: Array) -> None:
        if self._checked or len(steps) <= RATE_STEPS:
            return
        self._checked = True
        step = float(np.median(steps))
        if abs(step - 1.0) > RATE_TOLERANCE:
            line = (
                f"timestamps have {self._rate / step:.4g} Hz, the nominal rate is"
                f" {self._rate:g} Hz: labels and spectrogram are wrong, set --rate"
            )
            self._warnings.note("wrong rate", line)
