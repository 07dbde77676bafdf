"""Ctrl-C: ends waiting at once, and work only when it is done."""

import signal
from collections.abc import Iterator
from types import FrameType
from typing import Any, Self, TypeVar

Item = TypeVar("Item")


class Interrupt:
    """While it is entered, the first Ctrl-C ends what `until` hands out, and nothing else.

    The second one is as usual.
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
        """Pass items on until Ctrl-C is pressed.

        Args:
            items: What may have to be waited for.

        Yields:
            The items.
        """
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
