"""Read NoisyTest's `.log`: a row for each sample, with its time and its noise."""

import stat
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TextIO

import numpy as np

from noiseclassifier.errors import DataFileError
from noiseclassifier.types import Array

LARGE = 1_000_000
"""Files of so many bytes or more are read by Arrow: a quarter of NumPy's time, after 45 ms for its
import."""
LONGEST_LINE = 2**16
"""Characters of a line: far more than those of two numbers and a comment."""


def read_log(path: str | Path) -> tuple[Array, Array]:
    """Read a noise signal of two columns, separated by blanks or tabs.

    Comments start with ``#``, anywhere; empty lines, a missing header and a missing last line end
    are all right.

    Args:
        path: The file.

    Returns:
        Times in [s] and the noise estimate, each of shape (samples,).

    Raises:
        DataFileError: If the file is missing or empty, a line is no pair of finite numbers, or
            time does not go forward in even steps; the line is named.
    """
    _check_regular(path)
    columns = _read_fast(path)
    if columns is None or columns.shape[1] != 2 or not np.isfinite(columns).all():
        columns = _read_slowly(path)
    time, noise = columns.T.copy()
    _check_time(path, time)
    return time, noise


def nominal_rate(time: Array) -> float:
    """Sample rate that evenly spaced times have on the whole, in [Hz].

    Args:
        time: Times, shape (samples,), two or more, in [s].

    Returns:
        The rate to nine digits, in [Hz].
    """
    return float(f"{(len(time) - 1) / (time[-1] - time[0]):.9g}")


def _check_regular(path: str | Path) -> None:
    """Refuse a device or a pipe, which may have no end."""
    try:
        regular = stat.S_ISREG(Path(path).stat().st_mode) or Path(path).is_dir()
    except OSError as error:
        raise DataFileError(path, f"cannot be read ({error.strerror or error})") from error
    if not regular:
        raise DataFileError(path, "is no regular file; save what it holds to one")


def _read_fast(path: str | Path) -> Array | None:
    """Array by a compiled reader; None if it fails, or the rows are ragged."""
    with suppress(OSError):
        if Path(path).stat().st_size >= LARGE and (columns := _read_by_arrow(path)) is not None:
            return columns
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            with Path(path).open(encoding="latin-1") as stream:
                return np.loadtxt(_lines(path, stream), ndmin=2)
        except DataFileError:
            raise
        except (ValueError, UserWarning):
            return None
        except OSError as error:
            raise DataFileError(path, f"cannot be read ({error.strerror or error})") from error


def _read_by_arrow(path: str | Path) -> Array | None:
    """Array of rows with one blank, below comments; None of any other layout."""
    import pyarrow
    from pyarrow import csv

    start = 0
    with Path(path).open("rb") as stream:
        while stream.readline(LONGEST_LINE).startswith(b"#"):
            start = stream.tell()
        stream.seek(start)
        try:
            table = csv.read_csv(
                stream,
                read_options=csv.ReadOptions(use_threads=False, column_names=["time", "noise"]),
                parse_options=csv.ParseOptions(delimiter=" ", quote_char=False),
                convert_options=csv.ConvertOptions(
                    column_types=dict.fromkeys(("time", "noise"), pyarrow.float64()), null_values=[]
                ),
            )
        except pyarrow.ArrowInvalid:
            return None
    return np.stack([column.to_numpy() for column in table.columns], axis=1)


def _lines(path: str | Path, stream: TextIO) -> Iterator[str]:
    """Lines of a log, which end."""
    while line := stream.readline(LONGEST_LINE):
        if len(line) == LONGEST_LINE:
            raise DataFileError(path, f"has a line of more than {LONGEST_LINE} characters")
        yield line


def _read_slowly(path: str | Path) -> Array:
    """Read line by line, to name the line that is wrong."""
    rows = []
    with Path(path).open(encoding="utf-8-sig", errors="replace") as lines:
        for number, line in enumerate(_lines(path, lines), start=1):
            words = line.partition("#")[0].split()
            if words:
                rows.append(_row(path, number, words))
    if not rows:
        raise DataFileError(path, "is empty; expected rows of time and noise")
    return np.array(rows)


def _row(path: str | Path, number: int, words: list[str]) -> list[float]:
    if len(words) != 2:
        raise DataFileError(
            path, f"line {number} has {len(words)} columns, expected time and noise"
        )
    try:
        row = [float(word) for word in words]
    except ValueError as error:
        raise DataFileError(path, f"line {number}: {error}") from error
    if not np.isfinite(row).all():
        raise DataFileError(path, f"line {number} is not finite: {' '.join(words)}")
    return row


def _check_time(path: str | Path, time: Array) -> None:
    if len(time) < 2:
        raise DataFileError(path, "has one row; a rate takes two or more")
    steps = np.diff(time)
    step = np.median(steps)
    # Printed times are rounded, so that half a step is no gap yet.
    wrong = np.flatnonzero((steps <= 0) | (np.abs(steps - step) > 0.5 * step))
    if len(wrong):
        row = int(wrong[0])
        what = "goes backward or stands still" if steps[row] <= 0 else "is not in even steps"
        raise DataFileError(
            path,
            f"time {what} from row {row + 1} to row {row + 2}:"
            f" {time[row]:.9g} s, then {time[row + 1]:.9g} s, where a step is {step:.6g} s",
        )
