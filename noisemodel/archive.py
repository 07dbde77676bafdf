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
from typing import IO, Any, TypeVar

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

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


def read(path: Path, names: Collection[str] | None = None) -> dict[str, NDArray[Any]]:
    """Read the arrays of an .npz file.

    Args:
        path: The file.
        names: Those that are read, all unless given.

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
                    found[name] = read_array(stream, name, member.file_size)
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
        seen.add(name)
        if member.compress_type not in METHODS:
            raise ArchiveError(f"{name} is compressed by another method than NumPy's")
