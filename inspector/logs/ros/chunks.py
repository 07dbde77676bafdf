"""Compressed chunks of bags, unpacked piece by piece, and no more of them than a bag may hold."""

import bz2
from collections.abc import Callable
from contextvars import ContextVar
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO, Self

from noisemodel.archive import PIECE, check_unpacked

_size: ContextVar[int] = ContextVar("size", default=0)
_unpacked: ContextVar[int] = ContextVar("unpacked", default=0)


def begin(path: Path) -> None:
    """Begin to read a bag: what has been unpacked is counted from here.

    Args:
        path: The bag, a file or a folder.
    """
    files = [each for each in path.iterdir() if each.is_file()] if path.is_dir() else [path]
    _size.set(sum(each.stat().st_size for each in files))
    _unpacked.set(0)


def unpack(method: str, data: bytes) -> bytes:
    """Unpack a chunk.

    Args:
        method: "bz2", "lz4" or "zstd"; others are not compressed.
        data: The chunk.

    Raises:
        ArchiveError: If the bag unpacks to more than `noisemodel.archive.check_unpacked` allows.
    """
    if method not in METHODS:
        return data
    with Unpacking(method, BytesIO(data)) as stream:
        return b"".join(iter(lambda: stream.read(PIECE), b""))


class Unpacking:
    """A stream that is unpacked while it is read.

    Args:
        method: A key of ``METHODS``.
        stream: What is compressed.
    """

    def __init__(self, method: str, stream: BinaryIO) -> None:
        self._stream = METHODS[method](stream)

    def read(self, size: int) -> bytes:
        """Read up to so many bytes.

        Raises:
            ArchiveError: As `unpack`.
        """
        piece: bytes = self._stream.read(min(size, PIECE))
        _unpacked.set(_unpacked.get() + len(piece))
        check_unpacked(_unpacked.get(), _size.get())
        return piece

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()


def bound_rosbags() -> None:
    """Let rosbags unpack by this module: its own functions have no limit."""
    from rosbags.rosbag1 import reader as reader1
    from rosbags.rosbag2 import reader as reader2
    from rosbags.rosbag2 import storage_mcap

    own: Any = (reader1.decompressors, storage_mcap.DECOMPRESSORS)
    for method in ("bz2", "lz4"):
        own[0][method] = lambda data, method=method: unpack(method, data)
    for method in ("lz4", "zstd"):
        own[1][method] = lambda data, _, method=method: unpack(method, data)
    zstd = SimpleNamespace(
        open=lambda stream, _: Unpacking("zstd", stream),
        decompress=lambda data: unpack("zstd", data),
    )
    vars(reader2)["zstd"] = zstd


def _lz4(stream: BinaryIO) -> Any:
    import lz4.frame

    return lz4.frame.open(stream)


def _zstd(stream: BinaryIO) -> Any:
    import zstandard

    return zstandard.ZstdDecompressor().stream_reader(stream, read_across_frames=True)


METHODS: dict[str, Callable[[BinaryIO], Any]] = {"bz2": bz2.open, "lz4": _lz4, "zstd": _zstd}
"""What opens a compressed stream, by the name that bags have for it."""
