"""Run files and other .npz files, read within limits, and arrays that stay in their file.

Sizes are checked before an array is made: a file of some kilobytes may state any. What goes through
a run piece by piece (`pieces`) takes the memory of a piece, also of a run of gigabytes.
"""

import lzma
import os
import stat
import struct
import zipfile
import zlib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from math import inf, prod
from pathlib import Path
from threading import Lock
from typing import IO, Any, cast

import numpy as np
from numpy.lib import format as npy
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

from noisemodel.files import replacing
from noisemodel.types import Array, OutputError, RunFileError, hint

FORMAT = "noise-run/1"
STAGE = "stage_"

# The arrays of a run file: the kind of number or text that each holds, and its axes.
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
STAGE_ARRAY = ("f", ("samples", "joints"))
KIND_WORDS = {"f": "numbers", "b": "booleans", "U": "text"}

COMPRESSIBLE = 0.8  # arrays are compressed if that leaves less than this share of their size
STRETCH, STRETCHES = 4096, 16  # bytes of a stretch on which compression is tried, and their number

LARGE = 2**26  # bytes from which an array is not compressed, and can stay in the file
AT_ONCE = 2**23  # bytes of an array that are read at once
MAX_UNPACKED = "NOISE_MAX_UNPACKED"  # environment variable with another limit than ``UNPACKED``
UNPACKED = 512 * 2**20  # bytes that any compressed file may unpack to
RATIO = 20  # a large file may unpack to so many times its size; the numbers of logs hardly shrink

# What zipfile and NumPy raise on archives that are broken, encrypted, of a kind that zipfile does
# not read, or state a wrong size.
DAMAGE = (
    *(EOFError, MemoryError, RuntimeError, UnicodeDecodeError),
    *(struct.error, zlib.error, lzma.LZMAError),
)
TEXT = 64 * 2**20  # most bytes of a text that is read at once
PIECE = 2**20  # bytes that are unpacked at once
# NumPy's; zipfile has others, which unpack a few bytes to gigabytes at once.
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


class ArchiveError(ValueError):
    """A file that is no archive of plain arrays, is damaged, or unpacks to more than is read."""


class ObjectArrayError(ArchiveError):
    """An array of Python objects, which is never unpickled."""

    def __init__(self, name: str) -> None:
        self.name = name
        instead = "leave it out, or save plain numbers or text"
        super().__init__(f"{name} holds a Python object, such as None; {instead}")


def read(path: Path, *, on_demand: bool = False) -> dict[str, NDArray[Any]]:
    """Read the arrays of a run file, of which large ones may stay in the file, see `OnDemand`.

    Integers become floating-point where numbers are expected.
    """
    try:
        for name in names_in(path):
            if name not in ARRAYS and not name.startswith(STAGE):
                raise RunFileError(
                    path,
                    f"unknown array {name!r}{hint(name, ARRAYS)}; a run file has time, and velocity"
                    f" or position, and of {', '.join(ARRAYS)} and {STAGE}<name> what there is;"
                    " anything else belongs into meta",
                )
        arrays = read_npz(path, on_demand=LARGE if on_demand else inf)
        found = {name: _plain(path, name, each) for name, each in arrays.items()}
    except (OSError, ArchiveError) as error:
        raise _unread(path, error) from error
    version = str(found.get("format", FORMAT))
    if version != FORMAT:
        raise RunFileError(path, f"format {version!r}, expected {FORMAT!r}")
    return found


def _unread(path: Path, error: OSError | ArchiveError) -> RunFileError:
    if isinstance(error, OSError):
        return RunFileError(path, f"cannot be read ({error.strerror or error})")
    csv = "; `inspector import` makes a run of a CSV log" if path.suffix == ".csv" else ""
    return RunFileError(path, f"not a run file: {error}{csv}")


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


def write(path: Path, arrays: Mapping[str, Any], *, overwrite: bool) -> None:
    """Write the arrays of a run file whole or not at all: as ``np.savez_compressed``, but faster.

    What is large, or would not become smaller by a fifth, is not compressed: noise hardly does.
    """
    with replacing(path, overwrite=overwrite) as temporary:
        try:
            with zipfile.ZipFile(temporary, "w", compresslevel=1) as packed:
                for name, array in arrays.items():
                    shrinks = getattr(array, "nbytes", 0) < LARGE and _shrinks(array)
                    packed.compression = zipfile.ZIP_DEFLATED if shrinks else zipfile.ZIP_STORED
                    with packed.open(f"{name}.npy", "w", force_zip64=True) as member:  # dated 1980
                        npy.write_array(member, np.asanyarray(array), allow_pickle=False)
        except ValueError as error:
            raise OutputError(f"{path}: cannot be written ({one_line(error)})") from error


def _shrinks(array: Any) -> bool:
    """Whether compression pays, tried on some stretches that are spread over an array."""
    data = np.atleast_1d(array).ravel(order="K").view(np.uint8)
    starts = np.linspace(0, max(0, len(data) - STRETCH), STRETCHES).astype(int).tolist()
    tried = b"".join(data[start : start + STRETCH].tobytes() for start in starts)
    return len(zlib.compress(tried, 1)) < COMPRESSIBLE * len(tried)


class OnDemand(NDArrayOperatorsMixin):
    """An array whose rows are read when they are needed: ``read`` has the first and the last + 1.

    Slices and indices of rows read these; whatever else is done with it reads it whole, once.
    """

    def __init__(
        self, shape: tuple[int, ...], dtype: Any, read: Callable[[int, int], NDArray[Any]]
    ) -> None:
        self.shape, self.dtype, self.read = shape, np.dtype(dtype), read
        self.ndim, self.size = len(shape), prod(shape)
        self.nbytes = self.size * int(self.dtype.itemsize)
        self.checked = False
        self._whole: NDArray[Any] | None = None

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, key: Any) -> NDArray[Any]:
        """Read rows, or parts of rows; the result is in memory."""
        rows, *others = key if isinstance(key, tuple) else (key,)
        if isinstance(rows, slice):
            start, stop, step = rows.indices(len(self))
            if step == 1:
                found = self.read(start, max(start, stop))
            else:
                found = self._rows(np.arange(start, stop, step))
        elif isinstance(rows, np.ndarray) and rows.ndim == 1 and rows.dtype.kind in "biu":
            found = self._rows(np.flatnonzero(rows) if rows.dtype.kind == "b" else rows)
        else:
            return np.asarray(np.asarray(self)[key])
        return found[:, *others] if others else found

    def _rows(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Rows by their indices; the file is read piece by piece."""
        found = np.empty((len(rows), *self.shape[1:]), self.dtype)
        rows = np.where(rows < 0, rows + len(self), rows)
        for piece in pieces(self):
            inside = (rows >= piece.start) & (rows < piece.stop)
            if inside.any():
                found[inside] = self.read(piece.start, piece.stop)[rows[inside] - piece.start]
        return found

    def astype(self, dtype: Any, **_: Any) -> "OnDemand":
        """The array in another type, on demand too."""
        return OnDemand(self.shape, dtype, lambda first, stop: self.read(first, stop).astype(dtype))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        if self._whole is None:
            whole = self._whole = self.read(0, len(self))
            self.read = lambda first, stop: whole[first:stop]
        return self._whole if dtype is None else self._whole.astype(dtype, copy=False)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **settings: Any) -> Any:
        """Compute with the whole array."""
        plain = [np.asarray(each) if isinstance(each, OnDemand) else each for each in inputs]
        return getattr(ufunc, method)(*plain, **settings)

    def __getattr__(self, name: str) -> Any:
        """Anything else that an array has, of the whole array."""
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(np.asarray(self), name)


def either_way(
    sources: Iterable[Any],
    shape: tuple[int, ...],
    read: Callable[[int, int], NDArray[Any]],
    dtype: Any = np.float64,
) -> Array:
    """What ``read`` computes from arrays: on demand if one of them is so, else at once."""
    if any(isinstance(source, OnDemand) for source in sources):
        return cast(Array, OnDemand(shape, dtype, read))
    return read(0, shape[0])


def rows_at_once(array: Any) -> int:
    """Rows of an array that are taken at once: at least one."""
    row: int = array.dtype.itemsize * prod(array.shape[1:])
    return max(1, AT_ONCE // max(1, row))


def pieces(array: Any, multiple: int = 1) -> Iterator[slice]:
    """Rows of an array, piece by piece; all but the last have a multiple of so many rows."""
    size = max(1, rows_at_once(array) // multiple) * multiple
    for first in range(0, len(array), size):
        yield slice(first, min(first + size, len(array)))


def read_npz(
    path: Path, names: Collection[str] | None = None, *, on_demand: float = inf
) -> dict[str, NDArray[Any]]:
    """Read the arrays of an .npz file with these names, all unless given.

    Arrays of more than ``on_demand`` bytes stay in the file, unless they have one axis, are stored
    column by column or are compressed. They raise RunFileError where they are read.
    """
    found: dict[str, Any] = {}
    with _opened(path) as archive:
        for member in archive.infolist():
            name = member.filename.removesuffix(".npy")
            if names is None or name in names:
                with archive.open(member) as stream:
                    large = member.file_size > on_demand
                    kept = _kept(path, stream, name, member) if large else None
                    whole = kept is None
                    found[name] = read_array(stream, name, member.file_size) if whole else kept
    return found


def names_in(path: Path) -> tuple[str, ...]:
    """Names of the arrays of an .npz file; raises as `read_npz`."""
    with _opened(path) as archive:
        return tuple(name.removesuffix(".npy") for name in archive.namelist())


def read_array(stream: IO[bytes], name: str, size: int) -> NDArray[Any]:
    """Read an array of NumPy's format from so many bytes, once its header agrees with them."""
    shape, fortran, dtype = _header(stream, name, size)
    held = size - stream.tell()
    content = np.empty(held, dtype=np.uint8)
    view, place = content.data, 0
    while place < held:
        piece = stream.read(min(PIECE, held - place))
        if not piece:
            raise ArchiveError(f"damaged: {name} is cut off")
        view[place : place + len(piece)] = piece
        place += len(piece)
    try:
        return content.view(dtype).reshape(shape, order="F" if fortran else "C")
    except (ValueError, OverflowError) as error:
        raise ArchiveError(f"damaged: {name} states shape {shape}") from error


def _header(stream: IO[bytes], name: str, size: int) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, order and type of an array, once they agree with its size."""
    try:
        version = npy.read_magic(stream)
        header = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}[version]
        shape, fortran, dtype = header(stream)
        length = prod(shape)
    except Exception as error:  # NumPy lets any error of its parser through
        raise ArchiveError(f"{name} is no array ({one_line(error)})") from error
    if dtype.hasobject:
        raise ObjectArrayError(name)
    held = size - stream.tell()
    if min(shape, default=0) < 0 or length * dtype.itemsize != held or not dtype.itemsize:
        raise ArchiveError(f"damaged: {name} states shape {shape} of {dtype}, but has {held} bytes")
    return shape, fortran, dtype


def _kept(path: Path, stream: IO[bytes], name: str, info: zipfile.ZipInfo) -> OnDemand | None:
    """An array that stays in the file; None, and nothing is read, where that does not pay."""
    shape, fortran, dtype = _header(stream, name, info.file_size)
    begin = stream.tell()
    if len(shape) < 2 or fortran or info.compress_type != zipfile.ZIP_STORED:
        stream.seek(0)
        return None
    member = _Member(path, name, info)
    member.read(0, begin)
    row = dtype.itemsize * prod(shape[1:])

    def rows(first: int, stop: int) -> NDArray[Any]:
        try:
            content = member.read(begin + first * row, begin + stop * row)
        except (OSError, ArchiveError) as error:
            raise _unread(path, error) from error
        return content.view(dtype).reshape(stop - first, *shape[1:])

    return OnDemand(shape, dtype, rows)


class _Member:
    """The bytes of a member of an archive that is not compressed, from any place.

    The file is opened for each piece. The checksum is compared once the member was read in order.
    """

    def __init__(self, path: Path, name: str, info: zipfile.ZipInfo) -> None:
        self._path, self._name, self._info = path, name, info
        with path.open("rb") as file:
            self._known = _identity(file)
            file.seek(info.header_offset)
            lengths = struct.unpack("<26xHH", file.read(30))
        self._begin = info.header_offset + 30 + sum(lengths)
        self._lock = Lock()
        self._sum, self._summed = 0, 0

    def read(self, start: int, stop: int) -> NDArray[np.uint8]:
        """Bytes from a place to another; ArchiveError if the file is damaged, or was changed."""
        content = np.empty(max(0, stop - start), dtype=np.uint8)
        with self._lock, self._path.open("rb") as file:
            if _identity(file) != self._known:
                raise ArchiveError("was changed while it was read")
            file.seek(self._begin + start)
            if file.readinto(content.data) < len(content):
                raise ArchiveError(f"damaged: {self._name} is cut off")
            if start == self._summed:
                self._sum = zlib.crc32(content.data, self._sum)
                self._summed = stop
                if stop == self._info.file_size and self._sum != self._info.CRC:
                    raise ArchiveError(f"damaged: wrong checksum of {self._name}")
        return content


def _identity(file: IO[bytes]) -> tuple[int, ...]:
    """What changes with a file."""
    status = os.fstat(file.fileno())
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


@contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """An archive that unpacks to no more than is read, with names of its own for all arrays."""
    check_regular(path)
    try:
        with zipfile.ZipFile(path) as archive:
            members, seen = archive.infolist(), set()
            check_unpacked(sum(member.file_size for member in members), path.stat().st_size)
            for member in members:
                name = member.filename.removesuffix(".npy")
                if name in seen:
                    raise ArchiveError(f"has two arrays named {name!r}")
                if not name.isprintable():
                    raise ArchiveError(f"has an array named {name!r}")
                seen.add(name)
                if member.compress_type not in METHODS:
                    raise ArchiveError(f"{name} is compressed by another method than NumPy's")
            yield archive
    except zipfile.BadZipFile as error:
        raise ArchiveError(one_line(error)) from error
    except DAMAGE as error:
        raise ArchiveError(f"damaged: {one_line(error)}") from error


def check_regular(path: Path) -> None:
    """Refuse a device, pipe or socket, which may have no end."""
    mode = path.stat().st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise ArchiveError("is no regular file; save what it holds to one")


def read_text(path: Path) -> str:
    """Text of a regular file in UTF-8 of up to ``TEXT`` bytes."""
    check_regular(path)
    if (size := path.stat().st_size) > TEXT:
        raise ArchiveError(f"{size} bytes, the limit is {TEXT}")
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ArchiveError("not text in UTF-8") from error


def check_unpacked(unpacked: int, packed: int) -> None:
    """Refuse what would unpack to more than ``UNPACKED`` bytes and ``RATIO`` times its size."""
    stated = os.environ.get(MAX_UNPACKED, str(UNPACKED))
    if not stated.isdecimal():
        raise ArchiveError(f"{MAX_UNPACKED} is {stated!r}, expected bytes")
    most = max(int(stated), RATIO * packed)
    if unpacked > most:
        raise ArchiveError(
            f"unpacks to {unpacked / 1e9:.3g} GB from {packed / 1e6:.3g} MB, the limit is"
            f" {most / 1e9:.3g} GB; --max-unpacked GB (or {MAX_UNPACKED}=bytes) raises it"
        )


def one_line(error: BaseException) -> str:
    """The words of an error, or its name."""
    return " ".join(str(error).split()) or type(error).__name__
