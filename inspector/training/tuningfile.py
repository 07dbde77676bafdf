"""The results file of a grid search, one line of JSON per point of the grid.

The first line is the header: profile, grid, training and validation set, and versions of software.
Points follow in the order of the grid, so that any number of complete lines is a valid beginning. A
killed search resumes there; a complete one is only read.
"""

import fcntl
import json
import os
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from math import nan
from pathlib import Path
from typing import IO, Any

from inspector.errors import FileError, InspectorError
from noiseclassifier.jsontext import from_json
from noiseclassifier.tuning.grid import Point
from noiseclassifier.tuning.search import Measures

FORMAT = "noise-tuning/1"

MAX_BYTES = 256 * 2**20
"""Most bytes of a results file that is read: those of some hundred thousand points."""


class ResultsError(FileError):
    """A results file that the search cannot resume."""

    advice = "; name another file, or overwrite it (--overwrite)"


@dataclass(eq=False)
class Results:
    """The measures of the points of a grid, in their order.

    Attributes:
        path: The results file.
        points: All points.
        measures: Measures of the first of them.
    """

    path: Path
    points: Sequence[Point]
    measures: list[Measures]
    _file: IO[bytes]

    def add(self, measures: Sequence[Measures]) -> None:
        """Append the measures of the next points, flushed to the disk.

        Raises:
            InspectorError: If they cannot be written.
        """
        points = self.points[len(self.measures) :][: len(measures)]
        rows = zip(points, measures, strict=True)
        lines = [_line({**point, **each.as_dict()}) for point, each in rows]
        _append(self.path, self._file, b"".join(lines))
        self.measures += measures


@contextmanager
def opened(
    path: Path, settings: Mapping[str, Any], points: Sequence[Point], *, overwrite: bool = False
) -> Iterator[Results]:
    """Open a results file to resume, or create it.

    Args:
        path: The file.
        settings: The settings of the search, by name, as JSON can hold them.
        points: All points of the grid.
        overwrite: Whether to discard what the file holds.

    Yields:
        The results so far.

    Raises:
        ResultsError: If the file is no such file, is damaged, or of other settings.
        InspectorError: If it cannot be read or written, or another process is writing it.
    """
    with _locked(path) as file:
        about = os.fstat(file.fileno())
        if not stat.S_ISREG(about.st_mode) or about.st_size > MAX_BYTES:
            raise ResultsError(path, f"is no regular file of {MAX_BYTES} bytes or less")
        file.seek(0)
        whole, _, torn = (b"" if overwrite else file.read()).rpartition(b"\n")
        header = _line({"format": FORMAT, **settings})
        measures: list[Measures] = []
        if whole:
            first, *rows = whole.split(b"\n")
            _check_header(path, first, json.loads(header))
            measures = _read(path, rows, points)
        elif not header.startswith(torn):
            raise ResultsError(path, "holds no results of tuning")
        # A line without its end was being written when the process was killed.
        file.truncate(len(whole) + bool(whole))
        if not whole:
            _append(path, file, header)
        yield Results(path, points, measures, file)


def _locked(path: Path) -> IO[bytes]:
    try:
        file = path.open("a+b")
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        file.close()
        raise InspectorError(
            f"{path}: is being written by another process; wait for it, or name another file"
        ) from error
    except OSError as error:
        raise InspectorError(f"{path}: cannot be written ({error.strerror or error})") from error
    return file


def _append(path: Path, file: IO[bytes], content: bytes) -> None:
    try:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    except OSError as error:
        raise InspectorError(f"{path}: cannot be written ({error.strerror or error})") from error


def _check_header(path: Path, line: bytes, settings: Mapping[str, Any]) -> None:
    try:
        there = from_json(line)
    except ValueError:
        there = None
    if not isinstance(there, dict) or not str(there.get("format")).startswith("noise-tuning/"):
        raise ResultsError(path, "holds no results of tuning")
    for topic, mine in settings.items():
        if there.get(topic) != mine:
            name = topic.replace("_", " ")
            raise ResultsError(
                path, f"holds results of another {name} ({_difference(there.get(topic), mine)})"
            )


def _difference(there: Any, mine: Any) -> str:
    """The first difference, in words."""
    if not (isinstance(there, dict) and isinstance(mine, dict)):
        return f"{there}, not {mine}"
    names = [*mine, *(name for name in there if name not in mine)]
    name = next(name for name in names if there.get(name) != mine.get(name))
    if name in there and name in mine:
        return f"{name} differs"
    return f"{name} was {'in' if name in there else 'not in'} it"


def _read(path: Path, rows: Sequence[bytes], points: Sequence[Point]) -> list[Measures]:
    """The measures in the rows, which must be of these points."""
    if len(rows) > len(points):
        raise ResultsError(path, f"is damaged: {len(rows)} points of {len(points)}")
    names = [field.name for field in fields(Measures)]
    measures = []
    for number, (row, point) in enumerate(zip(rows, points, strict=False), start=2):
        try:
            found = from_json(row)
            values = [nan if found[name] is None else float(found[name]) for name in names]
            fits = {name: found[name] for name in point} == point
        except (ValueError, KeyError, TypeError, OverflowError):
            fits = False
        if not fits:
            raise ResultsError(path, f"is damaged in line {number}")
        measures.append(Measures(*values))
    return measures


def _line(content: Mapping[str, Any]) -> bytes:
    return json.dumps(content, allow_nan=False).encode() + b"\n"
