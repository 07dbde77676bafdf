"""A log as it was written: arrays with stamps; and the signals that they hold."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inspector.errors import InspectorError, LogError
from noisemodel import Run
from noisemodel.run import LONGEST, SHORTEST
from noisemodel.types import Array, Mask, Real

SAMPLES = "samples"
"""The unit of stamps that count samples, of a log whose rate is not known yet."""

ROUND = (1.0, 1.25, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
"""Round rates are these, times a power of ten, in [Hz]."""
NEAR = 0.05
"""Largest relative difference of a nominal rate to the round one that replaces it."""
UNIFORM = 1e-3
"""Largest relative deviation of a uniform clock's steps from their median."""
GAP = 5.0
"""Length of a step, in nominal ones, above which it is a gap."""

PART = re.compile(r"(?P<name>.+)\[(?P<first>\d*)(?P<colon>:?)(?P<last>\d*)\]")
JOINT = "{joint}"
"""What stands for the name of a joint in a pattern of a mapping."""


@dataclass(frozen=True)
class Clock:
    """Rate, jitter and gaps of timestamps.

    Attributes:
        nominal: Inverse of the median step, in [Hz].
        rate: The rate that is used: the nominal one of uniform stamps, else the nearest round
            one, unless it is given; in [Hz].
        uniform: Whether the stamps are uniform.
        jitter_rms: Root mean square deviation of the steps from that rate's, without gaps, in [s].
        jitter_max: Largest deviation, in [s].
        gaps: Start and end of each gap, in [s].
        stretches: The samples between gaps.
    """

    nominal: float
    rate: float
    uniform: bool
    jitter_rms: float
    jitter_max: float
    gaps: tuple[tuple[float, float], ...]
    stretches: tuple[slice, ...]


@dataclass(frozen=True, eq=False)
class Stamps:
    """Timestamps of samples; fields that were sampled together share them.

    Attributes:
        start: The first stamp, in [s], exact.
        time: Time since the first stamp, as logged, shape (samples,), in [s].
        rows: Line number of each sample, if the file has lines.
        unit: Unit of the stamps in the log; ``SAMPLES`` until the rate is known.
        remark: On their source, if it is not the expected one.
        held: Whether values apply between stamps however far apart, as in a planned
            trajectory do.
        rate: The rate that the log is said to have, in [Hz].
        name: Their column.
    """

    start: Decimal
    time: Array
    rows: Sequence[int] | None = None
    unit: str = "seconds"
    remark: str = ""
    held: bool = False
    rate: float | None = None
    name: str = ""

    @classmethod
    def of_nanoseconds(
        cls, stamps: NDArray[np.int64], *, remark: str = "", held: bool = False
    ) -> "Stamps":
        """Stamps from whole nanoseconds, shape (samples,)."""
        first = int(stamps[0])
        return cls(
            Decimal(first).scaleb(-9), np.multiply(stamps - first, 1e-9), remark=remark, held=held
        )

    @classmethod
    def every(cls, step: float, samples: int, remark: str = "") -> "Stamps":
        """Stamps of a log that has none, with a known step in [s]."""
        return cls(Decimal(0), np.arange(samples, dtype=np.float64) * step, remark=remark)

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
        rate = self.rate or (nominal if uniform else _round(nominal))
        uniform = uniform and abs(rate * step - 1) <= UNIFORM
        wide = np.empty(0, dtype=np.int64) if self.held else np.flatnonzero(steps > GAP / rate)
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


def _round(rate: float) -> float:
    """The nearest round rate, or the rate itself if none is near."""
    power = 10.0 ** np.floor(np.log10(rate))
    near = float(power * min(ROUND, key=lambda digit: abs(digit * power / rate - 1)))
    return near if abs(near / rate - 1) <= NEAR else rate


@dataclass(frozen=True, eq=False)
class Field:
    """One array of a log, as logged.

    Attributes:
        name: Its name in the log.
        values: Shape (samples, columns).
        stamps: Its timestamps.
        joints: Joints of the columns, if the log names them; else empty.
        signal: The signal, if the format defines it; else empty.
        source: The topic or file that it comes from.
        rank: Of several sources of one signal those with the lowest rank are taken.
    """

    name: str
    values: Real
    stamps: Stamps
    joints: tuple[str, ...] = ()
    signal: str = ""
    source: str = ""
    rank: int = 0


@dataclass(frozen=True, eq=False)
class Track:
    """One signal of some joints, or of the base.

    Attributes:
        signal: One of ``inspector.logs.names.SIGNALS``.
        joints: Joints of the columns; empty for the base.
        labels: Names of the columns in the log.
        stamps: Its timestamps.
        values: Shape (samples, columns).
        missing: Samples that hold no values, where they are interpolated, shape (samples,); None
            if there are none.
        angles: Whether each column is an angle, which may wrap.
    """

    signal: str
    joints: tuple[str, ...]
    labels: tuple[str, ...]
    stamps: Stamps
    values: Real
    missing: Mask | None = None
    angles: Sequence[bool] = ()

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
    """Mapping of one column or array to a signal, or of many columns by a pattern.

    Attributes:
        signal: One of ``inspector.logs.names.SIGNALS``, or "time".
        joint: The joint, for a single column; for a base its convention; empty for an
            array of all joints. In a pattern it holds ``{joint}``, as the source does.
        source: The column or array, or a part of it: ``qpos[7:]``, ``qvel[6]``.
    """

    signal: str
    joint: str
    source: str

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
    """One recording, as logged, and once its signals are known.

    Attributes:
        path: The file or folder.
        fields: Its arrays; none once ``tracks`` are known.
        episode: Name of the episode, where the file holds several.
        not_read: Names of what was not read.
        remarks: What was lost or decided, a sentence each.
        units: Why the unit of angles is not known, if the format does not define it.
        urdf: Text of the URDF in the log, may be empty.
        suggested: Mapping that the format defines; the options' mapping takes precedence.
        meta: Further metadata of the log.
        time: Name of the column or array with the stamps, if it has one.
        tracks: Its signals, in SI units, with increasing stamps.
        names: Names of its columns and arrays, which a mapping may refer to.
        in_degrees: "position" and "velocity" if these were found to be in degrees.
    """

    path: Path
    fields: tuple[Field, ...]
    episode: str = ""
    not_read: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    units: str = ""
    urdf: str = ""
    suggested: tuple[Entry, ...] = ()
    meta: Mapping[str, Any] = field(default_factory=dict)
    time: str = ""
    tracks: tuple[Track, ...] = ()
    names: tuple[str, ...] = ()
    in_degrees: tuple[str, ...] = ()


Progress: TypeAlias = Callable[[Iterable[Any], int], Iterable[Any]]
"""Wraps what is read, to show how much is done; of so many items, 0 if that is not known."""


def without_progress(items: Iterable[Any], total: int) -> Iterable[Any]:
    """Pass items on without showing progress."""
    return items


@dataclass(frozen=True)
class LogReader:
    """A log of a known format: its episodes, and functions that read it.

    Attributes:
        kind: Name of the format.
        episodes: Names of the episodes, each of which becomes a run; a single "" for a log
            without episodes.
        read: Reads one episode by its name.
        listing: Lists the contents without reading all of them, a line each.
        run: Reads the run, if the log is a run file.
    """

    kind: str
    episodes: tuple[str, ...]
    read: Callable[[str, Progress], Log]
    listing: Callable[[], tuple[str, ...]]
    run: Callable[[], Run] | None = None
