"""The failures that are new, resolved, louder, quieter and unchanged, matched in time."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from inspector.analysis.analyse import Analysis
from inspector.pair.levels import STEP, Level, steps, within
from inspector.pair.pair import Pair
from inspector.report.markdown import spoken
from noiseclassifier import Event
from noisemodel import Block

NEW, LOUDER, UNCHANGED, QUIETER, RESOLVED = "new", "louder", "unchanged", "quieter", "resolved"
KINDS = (NEW, LOUDER, RESOLVED, QUIETER, UNCHANGED)
"""In the order in which they matter."""
LOUDER_DB = 3.0
"""A failure in both runs whose level changed by as much is louder or quieter."""


@dataclass(frozen=True)
class Change:
    """A failure in either run, or in both at the same time.

    Attributes:
        kind: One of ``KINDS``.
        label: Its class.
        start: In [s], of whichever run has it first.
        stop: In [s], of whichever has it last.
        level: How loud both runs are there, above 10 Hz, in [dB re 1 rad/s].
    """

    kind: str
    label: str
    start: float
    stop: float
    level: Level

    def __str__(self) -> str:
        return (
            f"{self.kind}: {spoken(self.label)}, {self.start:.2f} s to {self.stop:.2f} s,"
            f" {self.level.change:+.1f} dB"
        )


def changes(pair: Pair) -> tuple[Change, ...]:
    """Match the failures of two runs.

    Findings of one class that overlap in time, whichever run they are of, are one failure. If both
    runs have a part in it, it is louder or quieter by 3 dB or more, or else unchanged; otherwise it
    is new or resolved.

    Args:
        pair: The two runs.

    Returns:
        Changes in order of time; of annotated blocks, unless both runs could be labelled.
    """
    found = [
        Change(_kind(kind, level := within(pair, start, stop)), label, start, stop, level)
        for kind, label, start, stop in _matched(*(failures(pair, s) for _, s in pair.sides))
    ]
    return tuple(sorted(found, key=lambda change: (change.start, change.stop, change.label)))


def largest_change(pair: Pair, found: Sequence[Change]) -> tuple[float, float]:
    """Start and stop of what is to be shown first, in [s].

    The failure in which the level changed most, new before louder before resolved before quieter
    ones; of runs without such, the largest change of level.
    """
    time, level = steps(pair)
    change = np.abs(level[:, 1] - level[:, 0])

    def most(each: Change) -> float:
        inside = (time > each.start - STEP) & (time < each.stop + STEP)
        return float(change[inside].max(initial=0.0))

    changed = [each for each in found if each.kind != UNCHANGED]
    if changed:
        worst = min(changed, key=lambda each: (KINDS.index(each.kind), -most(each)))
        return max(worst.start, float(pair.time[0])), min(worst.stop, float(pair.time[-1]))
    place = float(time[change.argmax()])
    return place - STEP, place + STEP


def failures(pair: Pair, side: Analysis) -> Sequence[Event | Block]:
    """The failures of a run that are matched: its findings, or its annotated blocks."""
    if labelled(pair):
        return side.findings
    return [block for block in side.run.blocks if block.label != "ok"]


def labelled(pair: Pair) -> bool:
    """Whether both runs could be labelled, so that findings are what is matched."""
    return pair.before.labels is not None and pair.after.labels is not None


def _kind(kind: str, level: Level) -> str:
    if kind != UNCHANGED or abs(level.change) < LOUDER_DB:
        return kind
    return LOUDER if level.change > 0.0 else QUIETER


def _matched(
    before: Sequence[Event | Block], after: Sequence[Event | Block]
) -> Iterator[tuple[str, str, float, float]]:
    """Merge failures of a class that overlap: kind, class, start and stop."""
    kinds = {frozenset({True}): NEW, frozenset({False}): RESOLVED}
    every = [(f.label, f.start, f.stop, False) for f in before]
    every += [(f.label, f.start, f.stop, True) for f in after]
    for label in sorted({each[0] for each in every}):
        own = sorted(each[1:] for each in every if each[0] == label)
        groups: list[list[tuple[float, float, bool]]] = []
        for each in own:
            if groups and each[0] < max(stop for _, stop, _ in groups[-1]):
                groups[-1].append(each)
            else:
                groups.append([each])
        for group in groups:
            kind = kinds.get(frozenset(later for *_, later in group), UNCHANGED)
            yield kind, label, group[0][0], max(stop for _, stop, _ in group)
