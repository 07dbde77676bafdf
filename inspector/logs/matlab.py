"""MATLAB's .mat files: variables, and structs that hold stamps and joints.

Files of version 5 are read by SciPy, once the sizes that they state agree with what they hold;
those of version 7.3 by `inspector.logs.hdf5`.
"""

import zlib
from collections.abc import Collection, Iterator, Mapping
from io import BytesIO
from math import prod
from pathlib import Path
from struct import error as struct_error
from struct import unpack_from
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inspector.errors import LogError
from inspector.logs.arrays import log_of, single_numbers
from inspector.logs.log import Log, LogReader
from inspector.logs.mapping import ReadOptions
from inspector.logs.names import time_column
from noisemodel.runfile import PIECE, ArchiveError, check_unpacked, one_line

HEADER = 128
"""Bytes before the first variable."""
MATRIX, COMPRESSED = 14, 15
"""Types of elements: a variable, and one that is packed."""
NESTED = (1, 2)
"""Classes of variables that hold others: cells and structs. Class 3 is an object of MATLAB's."""
DEPTH = 20
"""Structs and cells within each other."""

DATA = ("signals/values", "Data", "data", "Values", "values")
"""Fields of a timeseries, or of what Simulink logs as a struct, that hold the signal itself."""
STAMPS = ("Time", "time", "t")

OBJECTS = (
    "holds MATLAB objects ({}), such as a timeseries or Simulink's logsout, not numbers; in MATLAB:"
    " t = ts.Time; q = ts.Data; save('log.mat', 't', 'q'); of Simulink, ts = logsout{{1}}.Values"
)


def open_log(path: Path, options: ReadOptions) -> LogReader:
    """Reader of a file of version 5."""
    variables = _variables(path)
    return LogReader(
        "MATLAB 5",
        ("",),
        lambda episode, progress: log_of_variables(path, _variables(path), options),
        lambda: tuple(f"{name}  {each.dtype} {each.shape}" for name, each in variables.items()),
    )


def log_of_variables(
    path: Path, variables: Mapping[str, NDArray[Any]], options: ReadOptions
) -> Log:
    """Log of variables, whose samples are along either axis, as in MATLAB."""
    flat = {name: each.ravel() if 1 in each.shape else each for name, each in variables.items()}
    named = {_plain(name): each for name, each in flat.items() if each.dtype.kind in "iuf"}
    time = options.time or time_column([name for name, each in named.items() if each.ndim == 1])
    longest = max((max(each.shape) for each in named.values() if each.ndim), default=0)
    samples = len(named[time]) if time in named else longest
    turned = {
        name: each.T if each.ndim == 2 and each.shape[1] == samples != each.shape[0] else each
        for name, each in named.items()
    }
    return log_of(path, turned, options, numbers=single_numbers(turned))


def _plain(name: str) -> str:
    """Name of a signal from the name of its field: ``q/Data`` is ``q``, its stamps are ``Time``."""
    for field in DATA:
        if name.endswith(f"/{field}") and name != f"/{field}":
            return name.removesuffix(f"/{field}")
    last = name.rpartition("/")[2]
    return last if last in STAMPS else name


def _variables(path: Path) -> dict[str, NDArray[Any]]:
    from scipy.io import loadmat

    objects: list[str] = []
    try:
        data = b"".join(_checked(path, objects))
        content: Any = BytesIO(data)
        found = loadmat(content, squeeze_me=False, struct_as_record=True)
    except (ArchiveError, OSError) as error:
        raise LogError(path, one_line(error)) from error
    except Exception as error:  # SciPy lets errors of any kind through
        raise LogError(path, f"damaged or cut off ({one_line(error)})") from error
    flat = {
        name: each
        for variable, value in found.items()
        if not variable.startswith("__")
        for name, each in _flat(variable, value, DEPTH)
    }
    check_numbers(path, flat, objects)
    return flat


def check_numbers(path: Path, arrays: Mapping[str, NDArray[Any]], objects: Collection[str]) -> None:
    """Refuse a file of objects alone: only MATLAB's own code reads what they hold."""
    if objects and not any(each.size > 1 for each in arrays.values()):
        raise LogError(path, OBJECTS.format(", ".join(sorted(set(objects))[:3])))


def _flat(name: str, value: Any, depth: int) -> Iterator[tuple[str, NDArray[Any]]]:
    """Arrays of numbers in a variable; of a struct its fields, of cells each by its number."""
    if not isinstance(value, np.ndarray) or not depth:
        return
    if value.dtype.names:
        for number, each in enumerate(value.ravel()):
            place = f"{name}/{number}" if value.size > 1 else name
            for field in value.dtype.names:
                yield from _flat(f"{place}/{field}", each[field], depth - 1)
    elif value.dtype.kind == "O":
        for number, each in enumerate(value.ravel()):
            yield from _flat(f"{name}/{number}" if value.size > 1 else name, each, depth - 1)
    elif value.dtype.kind in "iuf" and value.ndim <= 2:
        yield name, value


def _checked(path: Path, objects: list[str]) -> Iterator[bytes]:
    """The file unpacked, without objects; each element's size agrees with what it holds."""
    data = path.read_bytes()
    yield data[:HEADER]
    if data[126:128] != b"IM":
        raise ArchiveError("a MATLAB file of another byte order; save it again with MATLAB")
    place, total = HEADER, 0
    while place + 8 <= len(data):
        kind, size = unpack_from("<II", data, place)
        body = data[place + 8 : place + 8 + size]
        if len(body) < size:
            raise ArchiveError("damaged or cut off: a variable is shorter than it states")
        place += 8 + size
        element = data[place - 8 - size : place]
        if kind == COMPRESSED:
            pieces, unpacker, waiting = [], zlib.decompressobj(), body
            while waiting and not unpacker.eof:
                try:
                    pieces.append(unpacker.decompress(waiting, PIECE))
                except zlib.error as error:
                    raise ArchiveError(f"damaged: {error}") from error
                waiting = unpacker.unconsumed_tail
                total += len(pieces[-1])
                check_unpacked(total, len(data))
            element = b"".join(pieces)
        try:
            (kind,) = unpack_from("<I", element)
            if kind == MATRIX and _is_plain(element, 8, len(element), DEPTH):
                yield element
            elif kind == MATRIX:
                objects.append(_name_of(element))
        except struct_error as error:
            raise ArchiveError("damaged: a variable is cut off") from error


def _name_of(element: bytes) -> str:
    """Name of a variable that is an object, as far as it can be told."""
    parts = list(_elements(element, 8, len(element)))
    texts = [element[start:stop] for kind, start, stop in parts if kind in (1, 2)]
    return next((text.decode("ascii", "replace") for text in texts if text.strip(b"\0")), "unnamed")


def _elements(data: bytes, place: int, stop: int) -> Iterator[tuple[int, int, int]]:
    """Type, start and end of each element: small ones have their data in their tag."""
    while place + 8 <= stop:
        kind, size = unpack_from("<II", data, place)
        if kind >> 16:
            kind, size, start = kind & 0xFFFF, kind >> 16, place + 4
            following = place + 8
        else:
            start = place + 8
            following = start + size + (-size % 8)
        if start + size > stop:
            raise ArchiveError("damaged: an element is longer than its variable")
        yield kind, start, start + size
        place = following


def _is_plain(data: bytes, place: int, stop: int, depth: int) -> bool:
    """Whether a variable holds numbers, text, cells or structs, of the sizes that it states."""
    parts = list(_elements(data, place, stop))
    if not parts:
        return True  # an empty cell
    if not depth or len(parts) < 3 or parts[0][0] != 6 or parts[1][0] != 5:
        return False
    (flags,) = unpack_from("<I", data, parts[0][1])
    kind = flags & 0xFF
    dims = unpack_from(f"<{(parts[1][2] - parts[1][1]) // 4}i", data, parts[1][1])
    if kind == 3 or kind in (5, 16, 17, 18) or min(dims, default=0) < 0:
        return False  # objects, sparse matrices, functions
    count, inner = prod(dims), [part for part in parts if part[0] == MATRIX]
    if kind in NESTED:
        if count > max(1, len(inner)):
            raise ArchiveError(f"damaged: a variable states {count} cells and holds {len(inner)}")
        return all(_is_plain(data, start, end, depth - 1) for _, start, end in inner)
    held = sum(end - start for _, start, end in parts[3:])
    if count > max(held, 0):
        raise ArchiveError(f"damaged: a variable states {count} numbers and holds {held} bytes")
    return True
