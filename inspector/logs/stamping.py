"""Stamps from numbers: in which unit they are, and which column of a log they are in."""

from collections.abc import Iterable
from decimal import Decimal
from math import log
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs.columns import TIMES, listed
from inspector.logs.log import Stamps
from inspector.logs.reading import Reading

UNITS = {"seconds": "1", "milliseconds": "1e-3", "microseconds": "1e-6", "nanoseconds": "1e-9"}
"""The units that stamps may have, in [s]."""

SLOWEST, FASTEST_NS = 0.5, 1e4
"""A step of up to the first is taken for seconds, from the second on for nanoseconds."""


def unit_of(path: Path, steps: NDArray[Any], rate: float | None) -> str:
    """Tell the unit of stamps from their median step, and from the log's rate if it is known.

    Raises:
        LogError: If it may be any.
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
    """Make stamps of an array of numbers.

    Args:
        path: The log, for errors.
        name: What the log calls them.
        values: Seconds, whole nanoseconds or times of NumPy's own kind, shape (samples,).
        rate: The log's rate, if it is known, in [Hz].

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


def time_name(names: Iterable[str], reading: Reading) -> str:
    """Choose the array that holds the stamps; empty if there is none."""
    known = {name.rpartition("/")[2].lower(): name for name in reversed(list(names))}
    if reading.time:
        return reading.time if reading.time in known.values() else ""
    return next((known[name] for name in TIMES if name in known), "")


def without_stamps(path: Path, samples: int, reading: Reading, names: Iterable[str]) -> Stamps:
    """Make the stamps of a log that has none, from the rate that a person said.

    Raises:
        LogError: If nobody did.
    """
    if reading.rate is None:
        raise LogError(
            path,
            "there are no stamps; say the log's rate (--rate), or where they are (--map"
            f" time=COLUMN); it has {listed(list(names))}",
        )
    return Stamps.every(1 / reading.rate, samples)
