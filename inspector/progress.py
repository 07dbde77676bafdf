"""A progress bar on a terminal, plain lines elsewhere."""

import sys
from collections.abc import Iterable, Iterator
from time import monotonic
from typing import TypeVar

T = TypeVar("T")

EVERY = 10.0
"""Time between two lines, in [s]."""


def progress(items: Iterable[T], what: str, *, total: int) -> Iterator[T]:
    """Items as they come, with a progress bar on a terminal, or a line every 10 s elsewhere."""
    if total < 2:
        yield from items
    elif sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import track

        yield from track(items, what, total=total, console=Console(stderr=True), transient=True)
    else:
        yield from _lines(items, what, total)


def _lines(items: Iterable[T], what: str, total: int) -> Iterator[T]:
    begun = said = monotonic()
    for number, item in enumerate(items, start=1):
        yield item
        now = monotonic()
        if now - said >= EVERY and number < total:
            said = now
            left = (now - begun) / number * (total - number)
            print(f"{what}: {number} of {total}, {left:.0f} s left", file=sys.stderr, flush=True)
