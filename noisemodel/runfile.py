"""The run file, version 1: which arrays it has, and how they are read, checked and written."""

import zipfile
import zlib
from collections.abc import Mapping
from math import inf
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from noisemodel import archive
from noisemodel.atomic import replacing
from noisemodel.errors import OutputError, RunFileError, hint
from noisemodel.ondemand import OnDemand

FORMAT = "noise-run/1"
STAGE = "stage_"

ARRAYS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "time": ("f", ("samples",)),
    "velocity": ("f", ("samples", "joints")),
    "position": ("f", ("samples", "joints")),
    "velocity_desired": ("f", ("samples", "desired")),
    "position_desired": ("f", ("samples", "desired")),
    "effort": ("f", ("samples", "joints")),
    "valid": ("b", ("samples",)),
    "joint_names": ("U", ("joints",)),
    "desired_joint_names": ("U", ("desired",)),
    "base_pose": ("f", ("samples", "7")),
    "base_velocity": ("f", ("samples", "6")),
    "robot": ("U", ()),
    "block_start": ("f", ("blocks",)),
    "block_stop": ("f", ("blocks",)),
    "block_label": ("U", ("blocks",)),
    "format": ("U", ()),
    "meta": ("U", ()),
}
"""The arrays of a run file: the kind of number or text that each holds, and its axes."""

COMPRESSIBLE = 0.8
"""Arrays are compressed if that leaves less than this share of their size."""
STRETCH, STRETCHES = 4096, 16
"""Bytes of a stretch on which compression is tried, and how many there are."""

STAGE_ARRAY = ("f", ("samples", "joints"))
KIND_WORDS = {"f": "numbers", "b": "booleans", "U": "text"}


LARGE = 2**26
"""Bytes from which an array can stay in the file."""


def read(path: Path, *, on_demand: bool = False) -> dict[str, NDArray[Any]]:
    """Read the arrays of a run file.

    Args:
        path: The file.
        on_demand: Whether large arrays stay in the file, see `noisemodel.ondemand`.

    Returns:
        Its arrays by name; integers become floating-point where numbers are expected.

    Raises:
        RunFileError: If the file cannot be read, is no archive of plain arrays, names an
            unknown array, holds another kind of array, or is of another version.
    """
    try:
        names = archive.names_in(path)
        for name in names:
            if name not in ARRAYS and not name.startswith(STAGE):
                raise RunFileError(
                    path,
                    f"unknown array {name!r}{hint(name, ARRAYS)}; a run file has time, and velocity"
                    f" or position, and of {', '.join(ARRAYS)} and {STAGE}<name> what there is;"
                    " anything else belongs into meta",
                )
        arrays = archive.read(path, on_demand=LARGE if on_demand else inf)
        found = {name: _plain(path, name, _reading(path, each)) for name, each in arrays.items()}
    except archive.ObjectArrayError as error:
        raise RunFileError(
            path,
            f"not a run file: {error.name} holds a Python object, such as None; leave it out, or"
            f" save {_kind(error.name)}",
        ) from error
    except (OSError, archive.ArchiveError) as error:
        raise _unread(path, error) from error
    version = str(found.get("format", FORMAT))
    if version != FORMAT:
        raise RunFileError(path, f"format {version!r}, expected {FORMAT!r}")
    return found


def _unread(path: Path, error: OSError | archive.ArchiveError) -> RunFileError:
    if isinstance(error, OSError):
        return RunFileError(path, f"cannot be read ({error.strerror or error})")
    csv = "; `inspector import` makes a run of a CSV log" if path.suffix == ".csv" else ""
    return RunFileError(path, f"not a run file: {error}{csv}")


def _reading(path: Path, array: Any) -> Any:
    """An array that raises RunFileError where it is read from the file."""
    if not isinstance(array, OnDemand):
        return array
    read = array.read

    def rows(first: int, stop: int) -> NDArray[Any]:
        try:
            return read(first, stop)
        except (OSError, archive.ArchiveError) as error:
            raise _unread(path, error) from error

    return OnDemand(array.shape, array.dtype, rows)


def write(path: Path, arrays: Mapping[str, Any], *, overwrite: bool) -> None:
    """Write the arrays of a run file, compressed, whole or not at all.

    Args:
        path: The file to write.
        arrays: Arrays by name.
        overwrite: Whether a file that exists may be replaced.

    Raises:
        OutputError: If the file exists or cannot be written.
    """
    with replacing(path, overwrite=overwrite) as temporary:
        try:
            with temporary.open("wb") as stream:
                _pack(stream, arrays)
        except ValueError as error:
            raise OutputError(f"{path}: cannot be written ({archive.one_line(error)})") from error


def _pack(stream: IO[bytes], arrays: Mapping[str, Any]) -> None:
    """Write what ``np.savez_compressed`` would, in a tenth of its time.

    Compression hardly makes the noise of a log smaller, and to undo it takes most of the time of
    loading: what it would not make smaller by a fifth is left as it is, and the quickest will do.
    """
    with zipfile.ZipFile(stream, "w", compresslevel=1) as packed:
        for name, array in arrays.items():
            packed.compression = zipfile.ZIP_DEFLATED if _shrinks(array) else zipfile.ZIP_STORED
            with packed.open(f"{name}.npy", "w", force_zip64=True) as member:  # dated 1980
                np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)


def _shrinks(array: Any) -> bool:
    """Whether compression pays, tried on some stretches that are spread over an array."""
    data = np.atleast_1d(array).ravel(order="K").view(np.uint8)
    starts = np.linspace(0, max(0, len(data) - STRETCH), STRETCHES).astype(int)
    tried = b"".join(data[start : start + STRETCH].tobytes() for start in starts.tolist())
    return len(zlib.compress(tried, 1)) < COMPRESSIBLE * len(tried)


def _kind(name: str) -> str:
    return KIND_WORDS[ARRAYS.get(name, STAGE_ARRAY)[0]]


def _plain(path: Path, name: str, array: NDArray[Any]) -> NDArray[Any]:
    wanted, axes = ARRAYS.get(name, STAGE_ARRAY)
    if array.ndim != len(axes):
        raise RunFileError(
            path, f"{name} has shape {array.shape}, expected ({', '.join(axes) or 'a single text'})"
        )
    if wanted == "f" and array.dtype.kind in "iu":
        return array.astype(np.float64)
    if wanted == "U" and array.size == 0:
        return array.astype(str)
    if array.dtype.kind != wanted:
        raise RunFileError(path, f"{name} holds {array.dtype}, expected {KIND_WORDS[wanted]}")
    return array
