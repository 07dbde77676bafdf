"""The part of a long run that is looked at closely."""

from dataclasses import replace

import numpy as np

from noisemodel import Run
from noisemodel.types import Real

LONGEST = 60_000
"""Samples of an excerpt: a minute at 1 kHz."""


def excerpt(run: Run) -> Run:
    """Take the part of a run around its fastest motion, so that an hour costs what minutes do.

    Args:
        run: The run.

    Returns:
        The run itself if it is short; else a part of it with its joints' motion alone.
    """
    if len(run.time) <= LONGEST:
        return run
    speed = np.einsum("sj,sj->s", run.velocity, run.velocity)
    fastest = int(np.argmax(np.where(run.mask, speed, -1.0)))
    start = min(max(0, fastest - LONGEST // 2), len(run.time) - LONGEST)
    part = slice(start, start + LONGEST)

    def cut(signal: Real | None) -> Real | None:
        return None if signal is None else signal[part]

    return replace(
        run,
        time=run.time[part],
        velocity=run.velocity[part],
        position=cut(run.position),
        velocity_desired=cut(run.velocity_desired),
        position_desired=cut(run.position_desired),
        valid=run.mask[part],
        effort=None,
        base_pose=None,
        base_velocity=None,
        stages={},
        blocks=(),
    )
