"""A log as it was written: arrays with stamps; and the signals that they hold."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inspector.errors import InspectorError, LogError
from noisemodel import Run
from noisemodel.run import LONGEST, SHORTEST
from noisemodel.types import Array, Mask, Real

SAMPLES = "samples"  # the unit of stamps that count samples, of a log whose rate is not known yet

# Round rates are these, times a power of ten, in [Hz].
ROUND = (1.0, 1.25, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
NEAR = 0.05  # largest relative difference of a nominal rate to the round one that replaces it
UNIFORM = 1e-3  # largest relative deviation of a uniform clock's steps from their median
GAP = 5.0  # length of a step, in nominal ones, above which it is a gap

PART = re.compile(r"(?P<name>.+)\[(?P<first>\d*)(?P<colon>:?)(?P<last>\d*)\]")
JOINT = "{joint}"  # what stands for the name of a joint in a pattern of a mapping


@dataclass(frozen=True)
class Clock:
    """Rate, jitter and gaps of timestamps."""

    nominal: float  # inverse of the median step, in [Hz]
    rate: float  # given; else the nominal one if stamps are uniform, or the nearest round one
    uniform: bool
    jitter_rms: float  # deviation of the steps from that rate's, without gaps, in [s]
    jitter_max: float  # in [s]
    gaps: tuple[tuple[float, float], ...]  # start and end of each, in [s]
    stretches: tuple[slice, ...]  # the samples between gaps


@dataclass(frozen=True, eq=False)
class Stamps:
    """Timestamps of samples; fields that were sampled together share them."""

    start: Decimal  # the first stamp, in [s], exact
    time: Array  # time since the first stamp, as logged, shape (samples,), in [s]
    rows: Sequence[int] | None = None  # line number of each sample, if the file has lines
    unit: str = "seconds"  # of the stamps in the log; `SAMPLES` until the rate is known
    remark: str = ""  # on their source, if it is not the expected one
    rate: float | None = None  # that the log is said to have, in [Hz]
    name: str = ""  # of their column
    stated: tuple[str, float | None] = ("", None)  # what else tells the rate, and that, in [Hz]

    @classmethod
    def of_nanoseconds(cls, stamps: NDArray[np.int64], *, remark: str = "") -> "Stamps":
        """Stamps from whole nanoseconds, shape (samples,)."""
        first = int(stamps[0])
        return cls(Decimal(first).scaleb(-9), np.multiply(stamps - first, 1e-9), remark=remark)

    @classmethod
    def counted(cls, samples: int) -> "Stamps":
        """Stamps of a log that has none, until its rate is known."""
        return cls(Decimal(0), np.arange(samples, dtype=np.float64), unit=SAMPLES)

    @cached_property
    def clock(self) -> Clock:
        """Rate, jitter and gaps of increasing stamps."""
        steps = np.diff(self.time)
        step = float(np.median(steps))
        if not SHORTEST <= step <= LONGEST:
            raise InspectorError(
                f"the stamps' median step is {step:g} s, expected {SHORTEST:g} s to {LONGEST:g} s"
            )
        nominal = float(f"{1 / step:.9g}")
        uniform = bool((np.abs(steps - step) <= UNIFORM * step).all())
        rate = self.rate or nominal
        if not self.rate and not uniform:
            power = 10.0 ** np.floor(np.log10(nominal))
            near = float(power * min(ROUND, key=lambda digit: abs(digit * power / nominal - 1)))
            rate = near if abs(near / nominal - 1) <= NEAR else nominal
        uniform = uniform and abs(rate * step - 1) <= UNIFORM
        wide = np.flatnonzero(steps > GAP / rate)
        deviations = np.delete(steps, wide) - 1 / rate
        edges = [0, *(wide + 1), len(self.time)]
        return Clock(
            nominal=nominal,
            rate=rate,
            uniform=uniform,
            jitter_rms=float(np.sqrt(np.mean(deviations**2))),
            jitter_max=float(np.abs(deviations).max()),
            gaps=tuple((float(self.time[at]), float(self.time[at + 1])) for at in wide),
            stretches=tuple(slice(start, stop) for start, stop in pairwise(edges)),
        )


@dataclass(frozen=True, eq=False)
class Field:
    """One array of a log, as logged."""

    name: str
    values: Real  # shape (samples, columns)
    stamps: Stamps
    joints: tuple[str, ...] = ()  # of the columns, if the log names them
    signal: str = ""  # if the format defines it
    source: str = ""  # the topic or file that it comes from
    rank: int = 0  # of several sources of one signal those with the lowest rank are taken


@dataclass(frozen=True, eq=False)
class Track:
    """One signal of some joints, or of the base."""

    signal: str  # one of `inspector.logs.names.SIGNALS`
    joints: tuple[str, ...]  # of the columns; empty for the base
    labels: tuple[str, ...]  # names of the columns in the log
    stamps: Stamps
    values: Real  # shape (samples, columns)
    missing: Mask | None = None  # samples without values, which are interpolated, shape (samples,)
    angles: Sequence[bool] = ()  # whether each column is an angle, which may wrap

    @property
    def is_desired(self) -> bool:
        """Whether it holds desired motion."""
        return self.signal.endswith("_desired")

    @property
    def quantity(self) -> str:
        """The signal, without saying whether it is desired."""
        return self.signal.removesuffix("_desired")

    def of(self, joints: Sequence[str]) -> Real:
        """Values of some of its joints, shape (samples, joints); no copy if these are all."""
        if tuple(joints) == self.joints:
            return self.values
        return self.values[:, [self.joints.index(joint) for joint in joints]]

    def fault(self, path: Path, problem: str, sample: int) -> LogError:
        """Error that names the place of a problem in the log."""
        if self.stamps.rows is not None:
            return LogError(path, problem, self.stamps.rows[sample])
        at = self.stamps.time[sample] - self.stamps.time[0]
        return LogError(path, f"{problem} (sample {sample + 1}, {at:.6g} s into the log)")


@dataclass(frozen=True)
class Entry:
    """Mapping of one column or array to a signal, or of many columns by a pattern."""

    signal: str  # one of `inspector.logs.names.SIGNALS`, or "time"
    joint: str  # of a single column; of a base its convention; empty for an array of all joints
    source: str  # the column or array, or a part of it: `qpos[7:]`, `qvel[6]`

    @property
    def target(self) -> str:
        """Text before the equals sign."""
        return f"{self.signal}.{self.joint}" if self.joint else self.signal

    @property
    def is_pattern(self) -> bool:
        """Whether it maps all columns that its source fits."""
        return JOINT in self.joint

    def part(self) -> tuple[str, slice]:
        """Name of the array in the source, and its columns."""
        match = PART.fullmatch(self.source)
        if match is None or not (match["first"] or match["colon"]):
            return self.source, slice(None)
        first = int(match["first"] or 0)
        if not match["colon"]:
            return match["name"], slice(first, first + 1)
        return match["name"], slice(first, int(match["last"]) if match["last"] else None)


@dataclass(frozen=True, eq=False)
class Log:
    """One recording, as logged, and once its signals are known."""

    path: Path
    fields: tuple[Field, ...]  # none once `tracks` are known
    not_read: tuple[str, ...] = ()  # names of what was not read
    remarks: tuple[str, ...] = ()  # what was lost or decided, a sentence each
    units: str = ""  # why the unit of angles is not known, if the format does not define it
    suggested: tuple[Entry, ...] = ()  # the format's mapping; the options' takes precedence
    meta: Mapping[str, Any] = field(default_factory=dict)
    time: str = ""  # name of the column or array with the stamps
    tracks: tuple[Track, ...] = ()  # its signals, in SI units, with increasing stamps
    names: tuple[str, ...] = ()  # of columns and arrays, which a mapping may refer to
    in_degrees: tuple[str, ...] = ()  # "position" and "velocity" if found to be in degrees


@dataclass(frozen=True)
class LogReader:
    """A log of a known format: its episodes, and functions that read it."""

    kind: str  # name of the format
    episodes: tuple[str, ...]  # each becomes a run; a single "" for a log without episodes
    read: Callable[[str], Log]  # one episode, by its name
    listing: Callable[[], tuple[str, ...]]  # the contents, without reading all, a line each
    run: Callable[[], Run] | None = None  # of a run file
