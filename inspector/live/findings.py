"""Events of labels while they arrive, the same as those of all labels at once; and their news."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from noiseclassifier import Event, Labels

SETTLED = 3
"""Hops after the start of an event by which its class is told from that of its edge."""


class Findings:
    """Collects labels, and keeps of them what may still become part of an event.

    A finding is decided when a frame begins after it. Memory grows with events and
    with the stretch that lasts, not with time.

    Attributes:
        frames: Frames that were added.
    """

    def __init__(self) -> None:
        self.frames = 0
        self._closed: list[Event] = []
        self._open: Labels | None = None

    def add(self, labels: Labels) -> None:
        """Take the labels of the next frames."""
        self.frames += len(labels)
        waiting = labels if self._open is None else Labels.concatenated((self._open, labels))
        quiet = waiting.label == "ok"
        # How far the frames reach that are not `ok`; those that it touches join them.
        reached = np.maximum.accumulate(np.where(quiet, -np.inf, waiting.stop))
        apart = np.flatnonzero(quiet & (waiting.start > np.append(-np.inf, reached[:-1])))
        if not len(apart):
            self._open = waiting
            return
        # The frame that is `ok` belongs to both parts: neither ends where the signal goes on.
        last = int(apart[-1])
        if not quiet[:last].all():  # most often all of it is `ok`, and a label must not wait
            self._closed += waiting.part(slice(last + 1)).events()
        self._open = waiting.part(slice(last, None))

    @property
    def decided(self) -> float:
        """Time at which the earliest frame starts whose event may still change, in [s]."""
        return -float("inf") if self._open is None else float(self._open.start[0])

    @property
    def confirmed(self) -> tuple[Event, ...]:
        """The events that will not vanish, whatever comes: as if an `ok` frame came next."""
        if self._open is None:
            return tuple(self._closed)
        last = self._open.part(slice(-1, None))
        quiet = replace(
            last,
            label=np.full_like(last.label, "ok"),
            above_threshold=None if last.above_threshold is None else np.zeros(1, dtype=bool),
            novel=None if last.novel is None else np.zeros(1, dtype=bool),
        )
        return (*self._closed, *Labels.concatenated((self._open, quiet)).events())

    @property
    def events(self) -> tuple[Event, ...]:
        """The events so far, as if the signal ended here."""
        return (*self._closed, *(() if self._open is None else self._open.events()))


class News:
    """Tells of each event twice: when it is there, and when it is over.

    The frames at the edges of a failure often look like another one: an event is told of when there
    are frames that begin `SETTLED` hops after it. What it is called may still change: `unknown`
    frames take the class of a failure that follows. Such an event is told of again under its new
    name, and only that ends.

    Args:
        tell: Called with an event, and whether it is over.
        wait: Time from the start of an event to the stop of the frames that it waits for, in [s].
    """

    def __init__(self, tell: Callable[[Event, bool], None], wait: float = 0.0) -> None:
        self._tell, self._wait = tell, wait
        self._begun: dict[str, float] = {}
        self._ended: dict[str, float] = {}

    def update(self, events: Sequence[Event], decided: float, now: float = float("inf")) -> None:
        """Tell of what is new.

        Args:
            events: All events so far, in order of time.
            now: Stop of the latest frame, in [s].
            decided: Time up to which nothing changes any more, in [s]: an event that stops earlier
                is over, since what continues it would begin before its end.
        """
        never = -float("inf")
        for event in events:
            if event.stop <= self._ended.get(event.label, never):
                continue
            if event.start + self._wait > now and event.stop >= decided:
                continue
            if event.stop > self._begun.get(event.label, never) and not self._lasts(event):
                self._tell(event, False)
            self._begun[event.label] = max(event.stop, self._begun.get(event.label, never))
            if event.stop < decided:
                self._ended[event.label] = event.stop
                self._tell(event, True)

    def _lasts(self, event: Event) -> bool:
        """Whether an event has been told of before: it continues one of its class."""
        return self._begun.get(event.label, -float("inf")) >= event.start
