"""A progress bar where somebody watches, nothing elsewhere."""

import sys
from collections.abc import Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")


def progress(items: Iterable[T], what: str, *, total: int) -> Iterator[T]:
    """Pass items on, and show on a terminal how many came.

    Args:
        items: What is worked off.
        what: Says what is being done.
        total: How many there will be.

    Yields:
        The items.
    """
    if total < 2 or not sys.stderr.isatty():
        yield from items
        return
    from rich.console import Console
    from rich.progress import track

    yield from track(items, what, total=total, console=Console(stderr=True), transient=True)
