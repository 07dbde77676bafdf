"""The findings of repetitions that are new, resolved or louder after a change."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from inspector.compare.changes import NEW, RESOLVED
from inspector.compare.pair import SAME_RATE
from inspector.pair.alignment import Alignment, align
from inspector.regression.measure import Finding, Measured
from noisemodel import decimated

LOUDER = "louder"
LOUDER_DB = 3.0
"""A finding this much above the loudest of the reference at the same time is louder."""
COVERED = 0.8
"""Share of the shorter run that has to lie within the other: parts of motions are often alike."""
SLACK = 0.1
"""Time by which findings may miss each other: most onsets and ends are that exact, in [s]."""


@dataclass(frozen=True)
class ChangedFinding:
    """A finding that one side has, or that became louder.

    Attributes:
        kind: "new", "resolved" or "louder".
        path: The run that it is of: one of the reference if it is resolved.
        label: Its class.
        start: On the clock of its run, in [s].
        stop: On the clock of its run, in [s].
        level: How loud it is, above 10 Hz, in [dB re 1 rad/s].
        change: By how much it is louder than the loudest of the reference, in [dB]; NaN unless it
            is in both.
    """

    kind: str
    path: Path
    label: str
    start: float
    stop: float
    level: float
    change: float = float("nan")

    def __str__(self) -> str:
        louder = f", {self.change:+.1f} dB" if np.isfinite(self.change) else ""
        span = f"{self.start:.2f} s to {self.stop:.2f} s"
        return f"{self.kind}: {self.label}, {span}{louder} ({self.path})"


def changed_findings(
    reference: Sequence[Measured], candidate: Sequence[Measured]
) -> tuple[tuple[ChangedFinding, ...], bool]:
    """Compare the findings of all repetitions of a scenario.

    A finding is new if no repetition of the reference has one of its class at its time, and
    resolved the other way round. Runs are laid beside each other by their motion; where that
    does not determine the lag with any run, as in runs of different motion, the time does not
    count.

    Args:
        reference: The runs before the change.
        candidate: The runs after it.

    Returns:
        The changes, run by run, the new ones first; and whether the time of some findings did not
        count.
    """
    lags = {
        (before.path, after.path): lag(before, after) for before in reference for after in candidate
    }
    found, untimed = [], False
    for after in candidate:
        offsets = [(r, lags[r.path, after.path]) for r in reference]
        untimed |= bool(after.findings) and not _timed(offsets)
        for finding in after.findings:
            twins = _twins(finding, after, offsets, direction=1)
            if not twins:
                found.append(_changed(NEW, after, finding))
            elif (change := finding.level - max(t.level for t in twins)) >= LOUDER_DB:
                found.append(_changed(LOUDER, after, finding, change))
    for before in reference:
        offsets = [(c, lags[before.path, c.path]) for c in candidate]
        untimed |= bool(before.findings) and not _timed(offsets)
        found += [
            _changed(RESOLVED, before, finding)
            for finding in before.findings
            if not _twins(finding, before, offsets, direction=-1)
        ]
    rank = (NEW, LOUDER, RESOLVED)
    return tuple(sorted(found, key=lambda change: rank.index(change.kind))), untimed


def new_findings(run: Measured) -> tuple[ChangedFinding, ...]:
    """The findings of a run of the candidate that has no reference: all of them are new."""
    return tuple(_changed(NEW, run, finding) for finding in run.findings)


def aligned(before: Measured, after: Measured) -> Alignment:
    """Lay the motion of a run beside that of another."""
    one, other = before.motion, after.motion
    rate = min(one.rate, other.rate)
    one, other = (
        decimated(run, rate) if run.rate > rate * (1 + SAME_RATE) else run for run in (one, other)
    )
    return align(one, other)


def lag(before: Measured, after: Measured) -> float | None:
    """Time by which a run starts later than another of one motion, in [s]; None of another one."""
    alignment = aligned(before, after)
    seconds = alignment.seconds
    both = min(before.duration, seconds + after.duration) - max(0.0, seconds)
    covered = both >= COVERED * min(before.duration, after.duration)
    return seconds if alignment.alike and covered else None


def _timed(others: Sequence[tuple[Measured, float | None]]) -> bool:
    """Whether any other run is of the same motion, so that the time of findings counts."""
    return any(seconds is not None for _, seconds in others)


def _twins(
    finding: Finding,
    run: Measured,
    others: Sequence[tuple[Measured, float | None]],
    *,
    direction: int,
) -> list[Finding]:
    """Findings of one class at one time in the runs of the other side."""
    timed = _timed(others)
    found = []
    for other, seconds in others:
        if timed and seconds is None:
            continue
        same = [each for each in other.findings if each.event.label == finding.event.label]
        if seconds is not None:
            begin = float(other.clock[0] - run.clock[0]) + direction * seconds
            same = [
                each
                for each in same
                if each.event.start <= finding.event.stop + begin + SLACK
                and each.event.stop >= finding.event.start + begin - SLACK
            ]
        found += same
    return found


def _changed(
    kind: str, run: Measured, finding: Finding, change: float = float("nan")
) -> ChangedFinding:
    event = finding.event
    return ChangedFinding(
        kind, run.path, event.label, event.start, event.stop, finding.level, change
    )
