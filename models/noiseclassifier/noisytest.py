"""NoisyTest's folders, and its ``.log``: a row of time and noise for each sample."""

import hashlib
import stat
from array import array
from collections.abc import Iterator
from math import inf, isfinite
from pathlib import Path

import numpy as np

from noiseclassifier.errors import AnnotationError, FileError, RateError
from noiseclassifier.jsontext import from_toml, text_of
from noiseclassifier.profile import TOLERANCE
from noiseclassifier.recording import Block, Recording
from noiseclassifier.signals import Array

LONGEST_LINE = 2**16  # characters of a line: far more than two numbers and a comment have


def read_log(path: str | Path) -> tuple[Array, Array]:
    """Read a noise signal of two columns, separated by blanks or tabs.

    Comments start with ``#``, anywhere; empty lines, a missing header and a missing last line end
    are all right.

    Returns:
        Times in [s] and the noise estimate, each of shape (samples,).

    Raises:
        FileError: If the file is missing or empty, a line is no pair of finite numbers, or
            time does not go forward in even steps; the line is named.
    """
    try:
        # A device or a pipe may have no end.
        if not (stat.S_ISREG(Path(path).stat().st_mode) or Path(path).is_dir()):
            raise FileError(path, "is no regular file; save what it holds to one")
        time, noise = _columns(path)
    except OSError as error:
        raise FileError(path, f"cannot be read ({error.strerror or error})") from error
    _check_time(path, time)
    return time, noise


def nominal_rate(time: Array) -> float:
    """Sample rate that evenly spaced times have on the whole, in [Hz]."""
    return float(f"{(len(time) - 1) / (time[-1] - time[0]):.9g}")


def _columns(path: str | Path) -> tuple[Array, Array]:
    """Times and noise, each of shape (rows,); the line that is wrong is named."""
    found = array("d")
    with Path(path).open(encoding="utf-8-sig", errors="replace") as stream:
        lines = iter(lambda: stream.readline(LONGEST_LINE), "")
        for number, line in enumerate(lines, start=1):
            if len(line) == LONGEST_LINE:
                raise FileError(path, f"has a line of more than {LONGEST_LINE} characters")
            words = line.partition("#")[0].split()
            try:
                row = [float(word) for word in words]
            except ValueError:
                row = []
            if words and not (len(row) == 2 and all(map(isfinite, row))):
                problem = f"line {number} is {line[:80].strip()!r}, expected time and noise, finite"
                raise FileError(path, problem)
            found.extend(row)
    if not found:
        raise FileError(path, "is empty; expected rows of time and noise")
    time, noise = np.array(found).reshape(-1, 2).T.copy()
    return time, noise


def _check_time(path: str | Path, time: Array) -> None:
    if len(time) < 2:
        raise FileError(path, "has one row; a rate takes two or more")
    steps = np.diff(time)
    step = np.median(steps)
    # Printed times are rounded, so that half a step is no gap yet.
    wrong = np.flatnonzero((steps <= 0) | (np.abs(steps - step) > 0.5 * step))
    if len(wrong):
        row = int(wrong[0])
        raise FileError(
            path,
            f"time is not in even steps of {step:.6g} s from row {row + 1} to row {row + 2}:"
            f" {time[row]:.9g} s, then {time[row + 1]:.9g} s",
        )


END = -1.0  # a stop that stands for the end of the recording
LATEST = 1e12  # all times lie before, in [s]


def read_folder(folder: str | Path, *, rate: float | None = None) -> Iterator[Recording]:
    """Recordings of a folder of ``.log`` and ``.toml``, sorted, of one rate in [Hz] if given."""
    logs = sorted(Path(folder).glob("*.log"))
    if not logs:
        state = "has no .log file" if Path(folder).is_dir() else "is no folder"
        raise FileError(folder, f"{state}; name a folder of .log files with .toml beside them")
    for log in logs:
        yield read_recording(log, rate=rate)


def read_recording(log: str | Path, *, rate: float | None = None) -> Recording:
    """Recording of a ``.log`` and the annotations in the ``.toml`` of the same name."""
    log = Path(log)
    blocks = read_annotations(log.with_suffix(".toml"))
    time, noise = read_log(log)
    own = nominal_rate(time)
    if rate is not None and abs(own / rate - 1.0) > TOLERANCE:
        raise RateError(own, [rate], f"{log} does not fit; lower its rate, or take another profile")
    digest = hashlib.sha256(log.read_bytes()).hexdigest()
    return Recording(log.stem, noise, rate or own, blocks, start=float(time[0]), sha256=digest)


def read_annotations(path: str | Path) -> tuple[Block, ...]:
    """Annotated blocks of a ``.toml``, in their order; see `parse_annotations`."""
    try:
        return tuple(parse_annotations(text_of(path)))
    except OSError as error:
        problem = f"cannot be read ({error.strerror}); each .log needs its .toml"
        raise FileError(path, problem) from error
    except ValueError as error:
        raise FileError(path, str(error)) from error


def parse_annotations(text: str) -> Iterator[Block]:
    """Annotated blocks: ``chunk_ranges`` and ``chunk_labels`` of the table ``data``."""
    try:
        data = from_toml(text).get("data", {})
    except ValueError as error:
        raise AnnotationError(f"not TOML ({error})") from error
    table = data if isinstance(data, dict) else {}
    ranges, labels = table.get("chunk_ranges"), table.get("chunk_labels")
    if not (isinstance(ranges, list) and isinstance(labels, list) and len(ranges) == len(labels)):
        raise AnnotationError("lacks chunk_ranges and chunk_labels, lists of one length, in [data]")
    for count, (span, label) in enumerate(zip(ranges, labels, strict=True), start=1):
        numbers = isinstance(span, list) and [
            type(each) in (int, float) and -LATEST < each < LATEST for each in span
        ]
        if numbers != [True, True] or not isinstance(label, str):
            expected = "expected [start, stop] in seconds and text"
            raise AnnotationError(f"{span!r} with label {label!r}, {expected}", f"chunk {count}")
        start, stop = map(float, span)
        yield Block(start, inf if stop == END else stop, label)
