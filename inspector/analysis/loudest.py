"""The joints and links of a run that are shown first: those that vibrate most."""

import numpy as np

from inspector import levels
from inspector.analysis.analyse import Analysis
from noisemodel.types import Array

SHOWN = 8
"""Joints and links that have a row in a picture."""


def chosen(analysis: Analysis, time: Array, level: Array) -> list[int]:
    """Columns of those that are loudest during findings, or at any time of a run without.

    Args:
        analysis: The run.
        time: Starts of the steps, shape (steps,), in [s].
        level: Shape (steps, columns), in [dB]; NaN in gaps.

    Returns:
        Up to eight, in the order of the columns.
    """
    inside = np.zeros(len(time), dtype=bool)
    for event in analysis.findings:
        inside |= (time > event.start - levels.STEP) & (time < event.stop)
    shown = level[inside] if inside.any() else level
    peaks = np.where(np.isnan(shown), -np.inf, shown).max(axis=0, initial=-np.inf)
    return sorted(np.argsort(-peaks, kind="stable")[:SHOWN].tolist())
