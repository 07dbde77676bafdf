"""What readers of logs return: fields with stamps, in a log; and tracks, with known signals."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs.options import Entry
from noisemodel import Run
from noisemodel.types import Array, Mask, Real


@dataclass(frozen=True, eq=False)
class Stamps:
    """Timestamps of samples; fields that were sampled together share them.

    Attributes:
        start: The first stamp, in [s], exact.
        time: Time since the first stamp, as logged, shape (samples,), in [s].
        rows: Line number of each sample, if the file has lines.
        unit: Unit of the stamps in the log.
        remark: On their source, if it is not the expected one.
        held: Whether values apply between stamps however far apart, as those of a planned
            trajectory do.
    """

    start: Decimal
    time: Array
    rows: Sequence[int] | None = None
    unit: str = "seconds"
    remark: str = ""
    held: bool = False

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
    def every(cls, step: float, samples: int) -> "Stamps":
        """Stamps of a log that has none, with a known step in [s]."""
        return cls(Decimal(0), np.arange(samples, dtype=np.float64) * step)


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
class Log:
    """One recording as logged, before signals are assigned to its fields.

    Attributes:
        path: The file or folder.
        fields: Its arrays.
        episode: Name of the episode, where the file holds several.
        not_read: Names of what was not read.
        remarks: What was lost or decided during reading, a sentence each.
        units: Why the unit of angles is not known, if the format does not define it.
        urdf: Text of the URDF in the log, may be empty.
        suggested: Mapping that the format defines; that of the options takes precedence.
        meta: Further metadata of the log.
        time: Name of the column or array with the stamps, if it has one.
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


@dataclass(frozen=True, eq=False)
class Track:
    """One signal of some joints, or of the base.

    Attributes:
        signal: One of ``inspector.logs.signals.SIGNALS``.
        joints: Joints of the columns; empty for the base.
        labels: Names of the columns in the log.
        stamps: Its timestamps.
        values: Shape (samples, columns).
        missing: Samples without a number in a column, where values are interpolated, shape
            (samples,); None if there are none.
    """

    signal: str
    joints: tuple[str, ...]
    labels: tuple[str, ...]
    stamps: Stamps
    values: Real
    missing: Mask | None = None

    @property
    def is_desired(self) -> bool:
        """Whether it holds desired motion."""
        return self.signal.endswith("_desired")

    def fault(self, path: Path, problem: str, sample: int) -> LogError:
        """Error that names the place of a problem in the log."""
        if self.stamps.rows is not None:
            return LogError(path, problem, self.stamps.rows[sample])
        at = self.stamps.time[sample] - self.stamps.time[0]
        return LogError(path, f"{problem} (sample {sample + 1}, {at:.6g} s into the log)")


class Progress(Protocol):
    """Wraps what is read, to show how much is done."""

    def __call__(self, items: Iterable[Any], total: int) -> Iterable[Any]:
        """Pass items on; ``total`` of them are expected, 0 if unknown."""


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
