"""The joints and links of a run that are shown first: those that vibrate most."""

import numpy as np

from inspector import levels
from inspector.analysis.analyse import Analysis
from inspector.analysis.moments import worst
from noisemodel.extended import vibrating
from noisemodel.runfile import pieces
from noisemodel.types import Array

SHOWN = 8
"""Joints and links that have a row in a picture."""


def worst_joint(analysis: Analysis) -> int:
    """Column of the joint that the worst finding is localised at; else that of the loudest."""
    moment = worst(analysis)[:1]
    for event, known in analysis.localisations.items() if analysis.findings and moment else ():
        if known.joints and event.start <= moment[0].peak <= event.stop:
            return analysis.run.joint_names.index(known.joints[0][0])
    _, level = analysis.joint_levels
    power = np.nansum(10.0 ** (level / 10.0), axis=0)
    return int(np.argmax(power))


def worst_signal(analysis: Analysis, joint: int) -> Array:
    """Velocity of a joint above 10 Hz, shape (samples,), in [rad/s] or [m/s].

    The noise is a norm, in which a vibration of 35 Hz has 70 Hz.
    """
    run = analysis.run
    own = [run.velocity[rows][:, joint].astype(np.float64) for rows in pieces(run.velocity)]
    return np.asarray(vibrating(np.concatenate(own)[:, None], run.mask, run.rate)[:, 0])


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
