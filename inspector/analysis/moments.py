"""The moments of a run to be shown first."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inspector.analysis.analyse import Analysis
from inspector.levels import FLOOR_DB, STEP
from noiseclassifier import Event
from noisemodel import Block, Run
from noisemodel.types import Array

MOST = 3
LOUDEST = "loudest"


@dataclass(frozen=True)
class Moment:
    """A stretch of a run, and where in it the noise is loudest.

    Attributes:
        label: Its class; ``loudest`` where nothing was found or annotated.
        start: In [s].
        stop: In [s].
        peak: Middle of its loudest 50 ms, in [s].
    """

    label: str
    start: float
    stop: float
    peak: float

    @property
    def failure(self) -> bool:
        """Whether it was found, or annotated, to be one."""
        return self.label != LOUDEST


def gaps(run: Run) -> list[tuple[float, float]]:
    """Start and stop of each gap, in [s]."""
    lost = np.concatenate(([False], ~run.mask, [False]))
    edges = np.flatnonzero(lost[1:] != lost[:-1]).reshape(-1, 2)
    last = len(run.time) - 1
    return [
        (float(run.time[first]), float(run.time[min(stop, last)])) for first, stop in edges.tolist()
    ]


def worst(analysis: Analysis) -> tuple[Moment, ...]:
    """Pick the findings whose noise vibrates most, up to three.

    Where nothing was found, annotated failures take their place, and without these the loudest
    moment of the run.

    Args:
        analysis: A run with what was found in it.

    Returns:
        The worst first, at least one.
    """
    run = analysis.run
    failures: Sequence[Event | Block] = analysis.findings or [
        block for block in run.blocks if block.label != "ok"
    ]
    stretches = [(failure.label, failure.start, failure.stop) for failure in failures]
    begin, end = float(run.time[0]), float(run.time[-1])
    time, level = _level(analysis)
    found = []
    for label, start, stop in stretches or [(LOUDEST, begin, end)]:
        inside = np.flatnonzero((time >= start - STEP / 2) & (time <= stop + STEP / 2))
        if len(inside):
            peak = inside[level[inside].argmax()]
            moment = Moment(label, max(start, begin), min(stop, end), float(time[peak]))
            found.append((float(level[peak]), moment))
    found.sort(key=lambda pair: -pair[0])
    return tuple(moment for _, moment in found[:MOST])


def _level(analysis: Analysis) -> tuple[Array, Array]:
    """Level of the noise above 10 Hz, every 50 ms: middles of the steps and values, in [dB]."""
    run = analysis.run
    starts, level = analysis.noise_level
    stop = float(run.time[-1]) + 1.0 / run.rate
    middles = (starts + np.append(starts[1:], stop)) / 2
    return middles, np.nan_to_num(level[:, 0], nan=FLOOR_DB)
