"""Events: which failures a model finds in whole recordings, how soon, and how often it errs.

Conventions: an *alarm* is a stretch of frames that belong to a finding, of whichever class or
`unknown`, and overlap or touch. An
annotated failure is *found* if an alarm overlaps it, and *named* if a frame of its own class does;
its *delay* is the time from its start until the first overlapping frame of an alarm is complete.
An alarm is *false* if a frame of it lies wholly in `ok` blocks and it overlaps no failure.

An alarm that runs on into a failure is not false, which a model that flags every frame profits
from. Therefore *wrong stretches* count too: alarms of the frames alone that lie wholly in `ok`.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from noiseclassifier.evaluation.matching import Matched
from noiseclassifier.types import Array, Index, Mask


@dataclass(frozen=True, eq=False)
class Alarms:
    """Stretches of frames that belong to a finding.

    Attributes:
        run: Recording of each, shape (alarms,).
        start: When it starts, shape (alarms,), in [s].
        stop: When it stops, shape (alarms,), in [s].
        false: Whether it is false, shape (alarms,).
    """

    run: Index
    start: Array
    stop: Array
    false: Mask

    def __len__(self) -> int:
        return len(self.run)


@dataclass(frozen=True, eq=False)
class EventScore:
    """Found and missed failures, delays and alarms of a model.

    Attributes:
        matched: The recordings.
        found: Whether each failure is found, shape (failures,).
        named: Whether it is named, shape (failures,).
        delay: Its delay, NaN if it is not found, shape (failures,), in [s].
        alarms: All alarms.
        wrong: Wrong stretches of each recording, shape (runs,).
    """

    matched: Matched
    found: Mask
    named: Mask
    delay: Array
    alarms: Alarms
    wrong: Array

    def missed(self) -> list[dict[str, Any]]:
        """List the failures that are not found."""
        failures, names = self.matched.failures, self.matched.names
        return [
            {
                "run": names[failures.run[item]],
                "label": str(failures.label[item]),
                "start": float(failures.start[item]),
                "stop": float(failures.stop[item]),
            }
            for item in np.flatnonzero(~self.found)
        ]

    def false_alarms(self) -> list[dict[str, Any]]:
        """List the false alarms."""
        alarms, names = self.alarms, self.matched.names
        return [
            {
                "run": names[alarms.run[item]],
                "start": float(alarms.start[item]),
                "stop": float(alarms.stop[item]),
            }
            for item in np.flatnonzero(alarms.false)
        ]


def score(matched: Matched) -> EventScore:
    """Events found, named and missed by the debounced predictions.

    Args:
        matched: The recordings.
    """
    frames, failures = matched.frames, matched.failures
    flagged = frames.flagged
    found = hit(matched, flagged)
    named = np.zeros(len(failures), dtype=bool)
    for label in np.unique(failures.label).tolist():
        named |= (failures.label == label) & hit(matched, frames.predicted == label)
    own = np.append(np.flatnonzero(flagged), 0)  # the last one is for those that are not found
    complete = frames.stop[own[np.searchsorted(own[:-1], failures.first)]] if len(frames) else 0.0
    return EventScore(
        matched,
        found,
        named,
        np.where(found, complete - failures.start, np.nan),
        alarms(matched, flagged),
        matched.by_run(alarms(matched, flagged & frames.in_ok).run),
    )


def hit(matched: Matched, flagged: Mask) -> Mask:
    """Which failures flagged frames overlap.

    Args:
        matched: The recordings.
        flagged: Some of their frames, shape (frames,).

    Returns:
        Shape (failures,).
    """
    count = np.append(0, np.cumsum(flagged))
    hits: Mask = count[matched.failures.end] > count[matched.failures.first]
    return hits


def alarms(matched: Matched, flagged: Mask) -> Alarms:
    """Merge flagged frames that overlap or touch.

    Args:
        matched: The recordings.
        flagged: Some of their frames, shape (frames,).
    """
    frames, own = matched.frames, np.flatnonzero(flagged)
    if not len(own):
        return Alarms(own, np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool))
    before, after = own[:-1], own[1:]
    apart = frames.start[after] > frames.stop[before] + matched.slack
    first = np.append(0, np.flatnonzero(apart | (frames.run[after] != frames.run[before])) + 1)
    last = np.append(first[1:], len(own)) - 1
    in_ok = np.logical_or.reduceat(frames.in_ok[own], first)
    failing = np.logical_or.reduceat(frames.failing[own], first)
    return Alarms(
        frames.run[own[first]],
        frames.start[own[first]],
        frames.stop[own[last]],
        in_ok & ~failing,
    )
