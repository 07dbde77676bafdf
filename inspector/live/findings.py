"""Events of labels while they arrive, the same as those of all labels at once."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models import Event, Labels


class Findings:
    """Collects labels, and keeps of them what may still become part of an event.

    A stretch of frames that are not `ok` is decided when it has ended. Memory grows with events and
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
        quiet = np.flatnonzero(waiting.label == "ok")
        if not len(quiet):
            self._open = waiting
            return
        # The frame that is `ok` belongs to both parts: neither ends where the signal goes on.
        last = int(quiet[-1])
        if len(quiet) <= last:  # most often all of it is `ok`, and a label must not wait
            self._closed = _merged(self._closed, waiting.part(slice(last + 1)).events())
        self._open = waiting.part(slice(last, None))

    @property
    def events(self) -> tuple[Event, ...]:
        """The events so far, as if the signal ended here."""
        rest = () if self._open is None else self._open.events()
        return tuple(_merged(self._closed, rest))


def _merged(events: Sequence[Event], others: Sequence[Event]) -> list[Event]:
    """Join events with later ones of their label that overlap or touch, in order of time."""
    found, latest = list(events), {event.label: place for place, event in enumerate(events)}
    for other in others:
        place = latest.get(other.label, -1)
        if place >= 0 and found[place].stop >= other.start:
            event = found[place]
            found[place] = replace(
                event,
                stop=max(event.stop, other.stop),
                score=max(event.score, other.score),
                novel=event.novel or other.novel,
            )
        else:
            latest[other.label] = len(found)
            found.append(other)
    return sorted(found, key=lambda event: (event.start, event.stop))
