"""Arrays of .npz and .npy files, and what any compressed file may unpack to.

Sizes are checked before an array is made: a file of some kilobytes may state any.
"""

import lzma
import os
import stat
import struct
import zipfile
import zlib
from collections.abc import Callable, Collection, Iterable
from math import prod
from pathlib import Path
from threading import Lock
from typing import IO, Any, TypeVar, cast

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from noisemodel.ondemand import OnDemand

MAX_UNPACKED = "NOISE_MAX_UNPACKED"
"""Environment variable with another limit than ``UNPACKED``, in bytes."""

UNPACKED = 512 * 2**20
"""Bytes that any compressed file may unpack to."""

RATIO = 20
"""A large file may unpack to so many times its own size; the numbers of logs hardly shrink."""

DAMAGE = (
    *(EOFError, MemoryError, RuntimeError, UnicodeDecodeError),
    *(struct.error, zlib.error, lzma.LZMAError),
)
"""What zipfile and NumPy raise on archives that are broken, encrypted, of a kind that zipfile does
not read, or state a wrong size."""

TEXT = 64 * 2**20
"""Most bytes of a text that is read at once."""

PIECE = 2**20
"""Bytes that are unpacked at once."""

MARKS = 256
"""Places of a packed array from which it can be unpacked again, each of about 45 KB."""

METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Those of NumPy; others of zipfile unpack a few bytes to gigabytes at once."""


Result = TypeVar("Result")


class ArchiveError(ValueError):
    """A file that is no archive of plain arrays, is damaged, or unpacks to more than is read."""


class ObjectArrayError(ArchiveError):
    """An array of Python objects, which is never unpickled.

    Args:
        name: Its name.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        super().__init__(f"Object arrays cannot be loaded: {name} holds Python objects")


def read(
    path: Path, names: Collection[str] | None = None, *, on_demand: float = float("inf")
) -> dict[str, NDArray[Any]]:
    """Read the arrays of an .npz file.

    Args:
        path: The file.
        names: Those that are read, all unless given.
        on_demand: Larger arrays stay in the file, in bytes: a `noisemodel.ondemand.OnDemand` stands
            in for each. They raise ArchiveError or OSError where they are read.

    Returns:
        The arrays by name.

    Raises:
        ArchiveError: If it is no archive of plain arrays, has two of one name, is damaged, or
            unpacks to more than `check_unpacked` allows.
        OSError: If it cannot be opened.
    """

    def arrays(archive: zipfile.ZipFile) -> dict[str, NDArray[Any]]:
        found = {}
        for member in archive.infolist():
            name = member.filename.removesuffix(".npy")
            if names is None or name in names:
                with archive.open(member) as stream:
                    large = member.file_size > on_demand
                    kept = _kept(path, stream, name, member) if large else None
                    found[name] = (
                        read_array(stream, name, member.file_size)
                        if kept is None
                        else cast(NDArray[Any], kept)
                    )
        return found

    return _opened(path, arrays)


def names_in(path: Path) -> tuple[str, ...]:
    """Names of the arrays of an .npz file.

    Raises:
        ArchiveError: As `read`.
        OSError: If it cannot be opened.
    """
    return _opened(
        path, lambda archive: tuple(name.removesuffix(".npy") for name in archive.namelist())
    )


def read_array(stream: IO[bytes], name: str, size: int) -> NDArray[Any]:
    """Read an array of NumPy's format, once its header agrees with its size.

    Args:
        stream: The array.
        name: Its name, for errors.
        size: Bytes of the stream.

    Raises:
        ArchiveError: If it is no array, holds objects, or states another size than it has.
    """
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
    except Exception as error:  # NumPy lets those of its parser through: any, by the bytes
        raise ArchiveError(f"{name} is no array ({one_line(error)})") from error
    if dtype.hasobject:
        raise ObjectArrayError(name)
    held = size - stream.tell()
    if min(shape, default=0) < 0 or length * dtype.itemsize != held or not dtype.itemsize:
        raise ArchiveError(f"damaged: {name} states shape {shape} of {dtype}, but has {held} bytes")
    return shape, fortran, dtype


def _kept(path: Path, stream: IO[bytes], name: str, info: zipfile.ZipInfo) -> OnDemand | None:
    """An array that stays in the file; None, and nothing is read, where that does not pay.

    That is an array of one axis, or one that is packed column by column.
    """
    shape, fortran, dtype = _header(stream, name, info.file_size)
    begin = stream.tell()
    if len(shape) < 2 or (fortran and info.compress_type != zipfile.ZIP_STORED):
        stream.seek(0)
        return None
    member = _Member(path, name, info)
    member.read(0, begin)
    if not fortran:
        row = dtype.itemsize * prod(shape[1:])

        def rows(first: int, stop: int) -> NDArray[Any]:
            content = member.read(begin + first * row, begin + stop * row)
            return content.view(dtype).reshape(stop - first, *shape[1:])

        return OnDemand(shape, dtype, rows)
    for place in range(begin, info.file_size, PIECE):  # in order, for the checksum
        member.read(place, min(place + PIECE, info.file_size))

    def columns(first: int, stop: int) -> NDArray[Any]:
        places = begin + dtype.itemsize * shape[0] * np.arange(prod(shape[1:]))
        parts = [
            member.read(place + first * dtype.itemsize, place + stop * dtype.itemsize).view(dtype)
            for place in places.tolist()
        ]
        return np.array(parts).T.reshape((stop - first, *shape[1:]), order="F")

    return OnDemand(shape, dtype, columns)


class _Member:
    """The bytes of a member of an archive, from any place.

    The file is opened for each piece. What is packed is unpacked from the last mark before the
    piece: a state of the decompressor, kept every so many bytes. The checksum is compared once the
    member was read in order.
    """

    def __init__(self, path: Path, name: str, info: zipfile.ZipInfo) -> None:
        self._path, self._name, self._info = path, name, info
        with path.open("rb") as file:
            self._known = _identity(file)
            file.seek(info.header_offset)
            lengths = struct.unpack("<26xHH", file.read(30))
        self._begin = info.header_offset + 30 + sum(lengths)
        self._apart = max(PIECE, info.file_size // MARKS)
        # Places of the unpacked and the packed member, and the decompressor's state there.
        self._marks = [(0, 0, zlib.decompressobj(-zlib.MAX_WBITS))]
        self._last = self._marks[0]
        self._lock = Lock()
        self._sum, self._summed = 0, 0

    def read(self, start: int, stop: int) -> NDArray[np.uint8]:
        """Bytes from a place to another.

        Raises:
            ArchiveError: If the file is damaged, or was changed.
            OSError: If it cannot be read.
        """
        content = np.empty(max(0, stop - start), dtype=np.uint8)
        with self._lock, self._path.open("rb") as file:
            if _identity(file) != self._known:
                raise ArchiveError("was changed while it was read")
            if self._info.compress_type == zipfile.ZIP_STORED:
                file.seek(self._begin + start)
                count = file.readinto(content.data)
            else:
                try:
                    count = self._unpack(file, start, content)
                except DAMAGE as error:
                    raise ArchiveError(f"damaged: {one_line(error)}") from error
            if count < len(content):
                raise ArchiveError(f"damaged: {self._name} is cut off")
            if start == self._summed:
                self._sum = zlib.crc32(content.data, self._sum)
                self._summed = stop
                if stop == self._info.file_size and self._sum != self._info.CRC:
                    raise ArchiveError(f"damaged: wrong checksum of {self._name}")
        return content

    def _unpack(self, file: IO[bytes], start: int, content: NDArray[np.uint8]) -> int:
        """Unpack what begins at a place, and count the bytes."""
        before = [mark for mark in (*self._marks, self._last) if mark[0] <= start]
        place, packed, state = max(before, key=lambda mark: mark[0])
        state = state.copy()
        file.seek(self._begin + packed)
        stop, waiting = start + len(content), b""
        while place < stop and not state.eof:
            if not waiting:
                left = self._info.compress_size - packed
                waiting = file.read(max(0, min(PIECE, left)))
            some = state.decompress(waiting, min(PIECE, stop - place))
            if not some and not waiting:
                break
            packed += len(waiting) - len(state.unconsumed_tail)
            waiting = state.unconsumed_tail
            low, high = max(place, start), place + len(some)
            if high > low:
                content[low - start : high - start] = np.frombuffer(some, np.uint8)[low - place :]
            place = high
            if place >= self._marks[-1][0] + self._apart:
                self._marks.append((place, packed, state.copy()))
        self._last = place, packed, state
        return max(0, place - start)


def _identity(file: IO[bytes]) -> tuple[int, ...]:
    """What changes with a file."""
    status = os.fstat(file.fileno())
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


def check_regular(path: Path) -> None:
    """Refuse a device, pipe or socket, which may have no end.

    Raises:
        ArchiveError: If it is one.
        OSError: If there is no such file.
    """
    mode = path.stat().st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise ArchiveError("is no regular file; save what it holds to one")


def read_text(path: Path) -> str:
    """Text of a regular file in UTF-8 of up to ``TEXT`` bytes.

    Raises:
        ArchiveError: If it is no regular file, too long, or not text in UTF-8.
        OSError: If it cannot be read.
    """
    check_regular(path)
    if (size := path.stat().st_size) > TEXT:
        raise ArchiveError(f"{size} bytes, the limit is {TEXT}")
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ArchiveError("not text in UTF-8") from error


def check_unpacked(unpacked: int, packed: int) -> None:
    """Refuse what would unpack to more than ``UNPACKED`` bytes and ``RATIO`` times its size.

    Args:
        unpacked: Bytes that it would unpack to.
        packed: Bytes that it has.

    Raises:
        ArchiveError: If it would.
    """
    stated = os.environ.get(MAX_UNPACKED, str(UNPACKED))
    if not stated.isdecimal():
        raise ArchiveError(f"{MAX_UNPACKED} is {stated!r}, expected bytes")
    limit = max(int(stated), RATIO * packed)
    if unpacked > limit:
        raise ArchiveError(
            f"unpacks to {unpacked / 1e9:.3g} GB from {packed / 1e6:.3g} MB, the limit is"
            f" {limit / 1e9:.3g} GB; --max-unpacked GB (or {MAX_UNPACKED}=bytes) raises it"
        )


def one_line(error: BaseException) -> str:
    """The words of an error, or its name."""
    return " ".join(str(error).split()) or type(error).__name__


def _opened(path: Path, use: Callable[[zipfile.ZipFile], Result]) -> Result:
    check_regular(path)
    try:
        with zipfile.ZipFile(path) as archive:
            _check(archive.infolist(), path.stat().st_size)
            return use(archive)
    except zipfile.BadZipFile as error:
        raise ArchiveError(one_line(error)) from error
    except DAMAGE as error:
        raise ArchiveError(f"damaged: {one_line(error)}") from error


def _check(members: Iterable[zipfile.ZipInfo], packed: int) -> None:
    members = list(members)
    check_unpacked(sum(member.file_size for member in members), packed)
    seen = set()
    for member in members:
        name = member.filename.removesuffix(".npy")
        if name in seen:
            raise ArchiveError(f"has two arrays named {name!r}")
        if not name.isprintable():
            raise ArchiveError(f"has an array named {name!r}")
        seen.add(name)
        if member.compress_type not in METHODS:
            raise ArchiveError(f"{name} is compressed by another method than NumPy's")
