"""Rows of samples as text: CSV with a header, or a JSON object per line."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from time import perf_counter, sleep
from typing import BinaryIO, NamedTuple, Protocol

from inspector.live.samples import LiveError
from noisemodel.types import Array

CHUNK_BYTES = 1 << 18
"""Bytes that are read at once, if there are so many."""
MAX_LINE_BYTES = 1 << 24
SMALL_CHUNK_BYTES = 1 << 15
"""Below this, reading waits for more: half of what a pipe holds by default."""


class Rows(NamedTuple):
    """Samples of some rows."""

    signals: Mapping[str, Array]
    """By name, each of shape (samples, columns)."""
    time: Array | None
    """Shape (samples,), in [s]; None if rows have no time."""


class Note(Protocol):
    """Called with each row that cannot be read."""

    def __call__(self, kind: str, line: str, count: int = 1) -> None:
        """Count ``count`` rows of a kind, and warn by the line if they are the first."""


class Reader(Protocol):
    """Reads one format."""

    names: tuple[str, ...]
    """Names of the joints; empty if the format has none."""

    def read(self, lines: bytes, first: int, note: Note) -> Iterator[Rows]:
        """Read whole lines, the first of which has a number."""


def widen(stream: BinaryIO) -> None:
    """Set a pipe's buffer to as much as is read at once, so that its writer need not wait."""
    import fcntl

    with suppress(AttributeError, OSError):  # another system; no pipe
        fcntl.fcntl(stream.fileno(), fcntl.F_SETPIPE_SZ, CHUNK_BYTES)


def chunks(stream: BinaryIO, *, gather: float = 0.0) -> Iterator[tuple[bytes, int, float]]:
    """Whole lines of a stream as they come.

    Args:
        gather: How long a small chunk waits for more, in [s]: to read row by row costs most.
    """
    read: Callable[[int], bytes] = getattr(stream, "read1", stream.read)
    rest, number, waited = b"", 1, 0.0
    while chunk := read(CHUNK_BYTES):
        received = perf_counter() - waited
        lines, end, rest = (rest + chunk).rpartition(b"\n")
        if end:
            yield lines + end, number, received
            number += lines.count(b"\n") + 1
        elif len(rest) > MAX_LINE_BYTES:
            raise LiveError(
                f"line {number} is longer than {MAX_LINE_BYTES} bytes: this is no CSV or JSON"
            )
        waited = gather if len(chunk) < SMALL_CHUNK_BYTES else 0.0
        sleep(waited)
    if rest.strip():
        yield rest + b"\n", number, perf_counter()
