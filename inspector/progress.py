"""A progress bar on a terminal, nothing elsewhere."""

import sys
from collections.abc import Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")


def progress(items: Iterable[T], what: str, *, total: int) -> Iterator[T]:
    """Items as they come, with a progress bar on a terminal.

    Args:
        items: To be passed on.
        what: Name of the task.
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
