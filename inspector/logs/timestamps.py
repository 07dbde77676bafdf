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
from inspector.logs.signals import TIME_UNITS, listed, time_column, without_unit

UNITS = {"seconds": "1", "milliseconds": "1e-3", "microseconds": "1e-6", "nanoseconds": "1e-9"}
"""The units that stamps may have, in [s]."""

SLOWEST_SECONDS = 0.5
"""Median step up to which stamps are in seconds, in [s]."""

RATES = (20.0, 20e3)
"""Rates of logs, from which the unit of larger steps follows, in [Hz]."""

NEARLY = 4.0
"""Two units are ambiguous if a rate is within this factor of the ends of ``RATES``."""

EPOCH = (9e8, 5e9)
"""Time since 1970, from 1998 to 2128, by which absolute stamps tell their unit, in [s]."""


def unit_of(
    path: Path, steps: NDArray[Any], rate: float | None, *, name: str = "", first: float = 0.0
) -> str:
    """Unit of stamps: by the log's rate, their column's name, the epoch, or their median step.

    Args:
        path: The log, for errors.
        steps: Differences of the stamps, shape (samples - 1,).
        rate: The log's rate, if known, in [Hz].
        name: Name of their column, which may end with a unit.
        first: The first stamp.

    Raises:
        LogError: If it is ambiguous.
    """
    rising = steps[steps > 0]
    step = float(np.median(rising)) if len(rising) else 0.0
    if rate is not None and step > 0:
        return min(UNITS, key=lambda unit: abs(log(step * float(UNITS[unit]) * rate)))
    if known := TIME_UNITS.get(without_unit(name)[1]):
        return known
    start = {unit: first * float(UNITS[unit]) for unit in UNITS}
    if step <= SLOWEST_SECONDS and start["seconds"] < EPOCH[1]:
        return "seconds"
    rates = {unit: 1 / (step * float(UNITS[unit])) for unit in UNITS} if step else {}
    low, high = RATES[0] / NEARLY, RATES[1]
    possible = {
        unit: f"{each:g}"
        for unit, each in rates.items()
        if (low < each or unit == "nanoseconds") and each <= high and start[unit] < EPOCH[1]
    }
    found = [unit for unit in possible if start[unit] > EPOCH[0]] or list(possible)
    is_count = step == 1 and first in (0, 1) and bool((steps == 1).all())
    if len(found) == 1 and not is_count:
        return found[0]
    why = "they may count samples" if is_count else f"that is {' or '.join(found) or 'none'}"
    raise LogError(
        path,
        f"the stamps' median step is {step:g}; expected seconds or a unit that gives"
        f" {RATES[0]:g} Hz to {RATES[1]:g} Hz, but {why}; with the log's rate it is recognised:"
        f" --rate {next(iter(possible.values()), '100')}",
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
    unit = unit_of(path, np.diff(since), rate, name=name, first=float(values[0]))
    return Stamps(
        start=Decimal(str(values[0])) * Decimal(UNITS[unit]),
        time=since if unit == "seconds" else since * float(UNITS[unit]),
        unit=unit,
    )


def time_name(names: Iterable[str], options: ReadOptions) -> str:
    """Name of the array that holds the stamps; empty if there is none."""
    known = list(names)
    if options.time:
        return options.time if options.time in known else ""
    return time_column(known)


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
