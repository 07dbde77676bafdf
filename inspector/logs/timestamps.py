"""Timestamps of a log: the column that holds them, and their unit."""

from collections.abc import Iterable
from decimal import Decimal
from math import log
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs.log import Stamps
from inspector.logs.options import ReadOptions
from inspector.logs.signals import TIMES, listed

UNITS = {"seconds": "1", "milliseconds": "1e-3", "microseconds": "1e-6", "nanoseconds": "1e-9"}
"""The units that stamps may have, in [s]."""

SLOWEST, FASTEST_NS = 0.5, 1e4
"""A median step up to the first is in seconds, one from the second on in nanoseconds."""


def unit_of(path: Path, steps: NDArray[Any], rate: float | None) -> str:
    """Unit of stamps by their median step, and by the log's rate if known.

    Raises:
        LogError: If it is ambiguous.
    """
    rising = steps[steps > 0]
    step = float(np.median(rising)) if len(rising) else 0.0
    if rate is not None and step > 0:
        return min(UNITS, key=lambda unit: abs(log(step * float(UNITS[unit]) * rate)))
    if step <= SLOWEST:
        return "seconds"
    if step >= FASTEST_NS:
        return "nanoseconds"
    raise LogError(
        path,
        f"the stamps' median step is {step:g}; expected seconds or nanoseconds; with the log's"
        " rate (--rate) other units are recognised",
    )


def stamps_of(path: Path, name: str, values: NDArray[Any], rate: float | None) -> Stamps:
    """Stamps from an array of numbers.

    Args:
        path: The log, for errors.
        name: Their name in the log.
        values: Seconds, whole nanoseconds or NumPy datetimes, shape (samples,).
        rate: The log's rate, if known, in [Hz].

    Raises:
        LogError: If they are not finite, or in an unknown unit.
    """
    if values.dtype.kind == "M":
        values = values.astype("datetime64[ns]").astype(np.int64)
    if values.dtype.kind not in "iuf" or values.ndim != 1 or len(values) < 2:
        raise LogError(
            path,
            f"{name!r} holds {values.dtype} of shape {values.shape}; expected two stamps or more",
        )
    if not np.isfinite(values).all():
        sample = int(np.argmin(np.isfinite(values)))
        raise LogError(path, f"column {name!r} holds {values[sample]} (sample {sample + 1})")
    since = (values - values[0]).astype(np.float64)
    unit = unit_of(path, np.diff(since), rate)
    return Stamps(
        start=Decimal(str(values[0])) * Decimal(UNITS[unit]),
        time=since if unit == "seconds" else since * float(UNITS[unit]),
        unit=unit,
    )


def time_name(names: Iterable[str], options: ReadOptions) -> str:
    """Name of the array that holds the stamps; empty if there is none."""
    known = {name.rpartition("/")[2].lower(): name for name in reversed(list(names))}
    if options.time:
        return options.time if options.time in known.values() else ""
    return next((known[name] for name in TIMES if name in known), "")


def stamps_at_rate(path: Path, samples: int, options: ReadOptions, names: Iterable[str]) -> Stamps:
    """Stamps of a log that has none, at the specified rate.

    Raises:
        LogError: If no rate is specified.
    """
    if options.rate is None:
        raise LogError(
            path,
            "there are no stamps; specify the log's rate (--rate), or their column (--map"
            f" time=COLUMN); it has {listed(list(names))}",
        )
    return Stamps.every(1 / options.rate, samples)
