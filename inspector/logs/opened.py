"""A log that was recognised: what it is, which episodes it has, and how to read one of them."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol

from inspector.logs.log import Log
from noisemodel import Run


class Watch(Protocol):
    """What is told how reading goes on."""

    def __call__(self, items: Iterable[Any], total: int) -> Iterable[Any]:
        """Pass items on; ``total`` of them are expected, 0 if nobody knows."""


def unwatched(items: Iterable[Any], total: int) -> Iterable[Any]:
    """Pass items on and tell nobody."""
    return items


@dataclass(frozen=True)
class Opened:
    """A log that was recognised.

    Attributes:
        kind: What it is, for people.
        episodes: Names of what it holds, each of which becomes a run; a single "" for a log
            without episodes.
        read: Reads one episode by its name.
        listing: Lists what is inside without reading all of it; a line each.
        run: Reads the run, where the log is a run file.
    """

    kind: str
    episodes: tuple[str, ...]
    read: Callable[[str, Watch], Log]
    listing: Callable[[], tuple[str, ...]]
    run: Callable[[], Run] | None = None
