"""A live session that is fed by rows of text."""

import signal
from collections.abc import Callable, Iterator
from itertools import chain
from types import FrameType
from typing import Any, BinaryIO, Self, TypeVar

from inspector.live.csvrows import CsvReader
from inspector.live.jsonrows import JsonReader
from inspector.live.rows import Reader, chunks, widen
from inspector.live.samples import LiveError
from inspector.live.session import LiveSession, Summary

GATHER = 0.02
"""How long rows wait for more, in [s]: less than half of a session's batch."""
EXPECTED = "expected a CSV header and rows, or a JSON object per line"


def follow(
    stream: BinaryIO,
    names: tuple[str, ...],
    session_of: Callable[[tuple[str, ...]], LiveSession],
    *,
    enough: Callable[[], bool] = lambda: False,
) -> Summary:
    """Show rows as they arrive, until they end, Ctrl-C is pressed, or there are enough."""
    widen(stream)
    with Interrupt() as interrupt:
        incoming = interrupt.until(chunks(stream, gather=GATHER))
        lines, number, received = next(incoming, (b"", 1, 0.0))
        head, _, rest = lines.partition(b"\n")
        if not head.strip():
            raise LiveError(f"the input is empty; {EXPECTED}")
        reader, is_header = reader_of(head, names)
        start = (rest, number + 1, received) if is_header else (lines, number, received)
        with session_of(reader.names) as session:
            for lines, number, received in chain([start], incoming):
                for rows in reader.read(lines, number, session.note):
                    session.push(**rows.signals, time=rows.time, received=received)
                if enough():
                    break
    if not session.summary.samples:
        raise LiveError(f"the input has no samples; {EXPECTED}")
    return session.summary


Item = TypeVar("Item")


class Interrupt:
    """While it is entered, the first Ctrl-C ends what `until` hands out, and nothing else.

    The second one raises KeyboardInterrupt.
    """

    def __init__(self) -> None:
        self._pressed = self._waits = False
        self._before: Any = None

    def __enter__(self) -> Self:
        self._before = signal.signal(signal.SIGINT, self._press)
        return self

    def __exit__(self, *_: object) -> None:
        signal.signal(signal.SIGINT, self._before)

    def until(self, items: Iterator[Item]) -> Iterator[Item]:
        """Pass items on until Ctrl-C is pressed."""
        while not self._pressed:
            self._waits = True
            try:
                item = next(items)
            except (StopIteration, KeyboardInterrupt):
                return
            finally:
                self._waits = False
            yield item

    def _press(self, number: int, frame: FrameType | None) -> None:
        again, self._pressed = self._pressed, True
        if again or self._waits:
            raise KeyboardInterrupt


def reader_of(head: bytes, names: tuple[str, ...]) -> tuple[Reader, bool]:
    """Choose a format by the first line."""
    if head.lstrip().startswith(b"{"):
        return JsonReader(names), False
    return CsvReader(head, names), True
