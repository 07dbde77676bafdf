"""What every reader of logs gives: named fields, each with its own stamps, and a log of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs.reading import Entry
from noisemodel.types import Array, Real


@dataclass(frozen=True, eq=False)
class Stamps:
    """When samples were taken; fields that were taken together share one of these.

    Attributes:
        start: The first stamp, in [s], exact.
        time: Time since the first stamp, as logged, shape (samples,), in [s].
        rows: The line of the file in which each sample stands, where the file has lines.
        unit: The unit that the stamps had.
        origin: Where they come from, if not from where one would think.
        held: Whether values hold between stamps however far these lie apart, as those of a
            planned trajectory do.
    """

    start: Decimal
    time: Array
    rows: Sequence[int] | None = None
    unit: str = "seconds"
    origin: str = ""
    held: bool = False

    @classmethod
    def of_nanoseconds(
        cls, stamps: NDArray[np.int64], *, origin: str = "", held: bool = False
    ) -> "Stamps":
        """Make stamps of whole nanoseconds, shape (samples,)."""
        first = int(stamps[0])
        return cls(
            Decimal(first).scaleb(-9), np.multiply(stamps - first, 1e-9), origin=origin, held=held
        )

    @classmethod
    def every(cls, step: float, samples: int) -> "Stamps":
        """Make the stamps of a log that has none, but a known step in [s]."""
        return cls(Decimal(0), np.arange(samples, dtype=np.float64) * step)


@dataclass(frozen=True, eq=False)
class Field:
    """One array of a log, as it was logged.

    Attributes:
        name: What the log calls it.
        values: Shape (samples, columns).
        stamps: When its samples were taken.
        joints: What the log says the columns belong to; empty if it does not say.
        signal: What the format itself says the array holds; empty if it does not say.
        source: The topic or file that it comes from; choices are made among these.
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
    """One recording, read but not yet understood.

    Attributes:
        path: The file or folder.
        fields: Its arrays.
        episode: Name of the episode, where the file holds several.
        left: What was not read, by name.
        remarks: What was lost or decided in reading, a sentence each.
        units: Why the unit of angles is not known, where the format leaves it open.
        urdf: Text of the URDF that came with the log, may be empty.
        suggested: What the format says of its arrays; what a person says goes before it.
        meta: What else the log says of itself.
    """

    path: Path
    fields: tuple[Field, ...]
    episode: str = ""
    left: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    units: str = ""
    urdf: str = ""
    suggested: tuple[Entry, ...] = ()
    meta: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Track:
    """One signal of some joints, or of the base.

    Attributes:
        signal: One of ``inspector.logs.columns.SIGNALS``.
        joints: Whom the columns belong to; empty for the base.
        labels: What the log calls each column.
        stamps: When its samples were taken.
        values: Shape (samples, columns).
    """

    signal: str
    joints: tuple[str, ...]
    labels: tuple[str, ...]
    stamps: Stamps
    values: Real

    @property
    def is_desired(self) -> bool:
        """Whether it holds desired motion."""
        return self.signal.endswith("_desired")

    def fault(self, path: Path, problem: str, sample: int) -> LogError:
        """Make an error that says where in the log a problem is."""
        if self.stamps.rows is not None:
            return LogError(path, problem, self.stamps.rows[sample])
        at = self.stamps.time[sample] - self.stamps.time[0]
        return LogError(path, f"{problem} (sample {sample + 1}, {at:.6g} s into the log)")
