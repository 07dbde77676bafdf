"""Two runs with what they have in common: signals, rate, and a stretch of time."""

from dataclasses import replace
from typing import Any

import numpy as np

from inspector.errors import InspectorError
from inspector.pair.alignment import Alignment
from noisemodel import Block, Run, decimated
from noisemodel.run import part
from noisemodel.types import Array, Real

SAME_RATE = 1e-3
"""Rates that differ by less are one."""
REMARKED = 0.005
"""Time from which on a stretch that is left out is remarked on, in [s]."""


def alike(before: Run, after: Run) -> tuple[Run, Run, tuple[str, ...]]:
    """Two runs with the signals and the rate that both have.

    Args:
        before: A run.
        after: Another.

    Returns:
        Both, and what was done, a sentence each.
    """
    remarks = []
    for field, name in (
        ("velocity_desired", "desired velocities"),
        ("base_velocity", "a base velocity"),
    ):
        having = [run for run in (before, after) if getattr(run, field) is not None]
        if len(having) == 1:
            which = "before" if having[0] is before else "after"
            remarks.append(f"Only the run {which} has {name}: they are left out of both.")
            nothing: dict[str, Any] = {field: None}
            before, after = replace(before, **nothing), replace(after, **nothing)
    rate = min(before.rate, after.rate)
    for which, run in (("before", before), ("after", after)):
        if run.rate > rate * (1 + SAME_RATE):
            remarks.append(
                f"The run {which} has {run.rate:g} Hz: decimated to the {rate:g} Hz of the other"
                " one, its efforts are left out."
            )
    before, after = (_at_rate(run, rate) for run in (before, after))
    return before, after, tuple(remarks)


def together(before: Run, after: Run, alignment: Alignment) -> tuple[Run, Run, tuple[str, ...]]:
    """Cut two runs to the stretch that both cover, on the time axis of the first.

    Args:
        before: A run.
        after: Another at the same rate.
        alignment: How they lie.

    Returns:
        Two runs of the same times, and what was left out of either, a sentence each.

    Raises:
        PairError: If they have fewer than two samples in common.
    """
    first = max(0, alignment.lag)
    stop = min(len(before.time), len(after.time) + alignment.lag)
    if stop - first < 2:
        raise PairError(
            f"before lasts {before.duration:.2f} s, and after starts"
            f" {alignment.seconds:+.2f} s from it: they share no time; `--align start` lays their"
            " starts beside each other"
        )
    time = before.time[first:stop]
    cut_before = _cut(before, first, stop, time)
    cut_after = _cut(after, first - alignment.lag, stop - alignment.lag, time)
    remarks = [
        f"The run {which} has {run.duration - cut.duration:.2f} s that the other one has not:"
        " they are not compared."
        for which, run, cut in (("before", before, cut_before), ("after", after, cut_after))
        if run.duration - cut.duration >= REMARKED
    ]
    return cut_before, cut_after, tuple(remarks)


def _at_rate(run: Run, rate: float) -> Run:
    """Decimate a run, but keep the positions that its links are placed by."""
    if run.rate <= rate * (1 + SAME_RATE):
        return run
    lower = decimated(run, rate)
    nearest = np.round(np.arange(len(lower.time)) * run.rate / rate).astype(int)
    nearest = np.minimum(nearest, len(run.time) - 1)

    def at(signal: Real | None) -> Real | None:
        return None if signal is None else signal[nearest]

    return replace(
        lower,
        position=at(run.position),
        position_desired=at(run.position_desired),
        base_pose=at(run.base_pose),
    )


def _cut(run: Run, first: int, stop: int, time: Array) -> Run:
    """A part of a run, with other times."""
    blocks = _moved(run, float(time[0] - run.time[first]), float(time[0]), float(time[-1]))
    return part(run, first, stop, time=time, blocks=blocks)


def _moved(run: Run, shift: float, start: float, stop: float) -> tuple[Block, ...]:
    """Shift blocks, and cut them to a stretch of time."""
    shifted = [
        Block(max(block.start + shift, start), min(block.stop + shift, stop), block.label)
        for block in run.blocks
    ]
    return tuple(block for block in shifted if block.start < block.stop)


class PairError(InspectorError):
    """Two runs that cannot be laid beside each other."""
