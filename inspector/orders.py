"""Order spectrogram of a run: amplitude over time and periods per turn of a joint.

Each window is resampled to equal steps of the joint's angle (Fyfe & Munck 1997, see
`inspector.localisation.order`): what goes with the joint's speed stays at one height.
"""

import numpy as np

from inspector.analysis import Analysis
from inspector.localisation.order import SLOWEST
from inspector.spectrogram import Spectrogram, amplitudes, in_bands
from noisemodel.extended import vibrating
from noisemodel.runfile import pieces
from noisemodel.types import Array

WINDOW = 0.8
"""Length of a window, in [s]: at 1 rad/s it resolves 8 periods per turn."""
LOWEST, HIGHEST = 10.0, 3000.0
"""Orders that are shown, in periods per turn."""
LINES = 96
"""Orders that are shown, in equal ratios."""
COLUMNS = 200
"""Most windows."""


def orders(analysis: Analysis) -> tuple[str, Spectrogram] | None:
    """Compute the order spectrogram of the noise over the angle of one joint.

    The joint is the first finding's with an order; else the one that vibrates most while it
    moves.

    Returns:
        The joint, and amplitudes whose frequencies are orders, in periods per turn: at most 200
        columns; 0 and not valid in windows in which the joint is at rest or turns back. None if
        there are no others.
    """
    run = analysis.run
    size = round(WINDOW * run.rate)
    if analysis.audit is None or not run.joint_names or len(run.time) < size or size < 16:
        return None
    joint = _joint(analysis)
    speed = np.concatenate(
        [run.velocity[rows][:, joint].astype(np.float64) for rows in pieces(run.velocity)]
    )
    speed = speed - vibrating(speed[:, None], run.mask, run.rate)[:, 0]
    hop = max(1, size // 8, -(-(len(speed) - size) // (COLUMNS - 1)))
    firsts = np.arange(0, len(speed) - size + 1, hop)
    edges = np.geomspace(LOWEST, HIGHEST, LINES + 1)
    amplitude = np.zeros((LINES, len(firsts)))
    moves = np.zeros(len(firsts), dtype=bool)
    for column, first in enumerate(firsts.tolist()):
        part = slice(first, first + size)
        own = speed[part] * np.sign(speed[part].sum())
        if run.mask[part].all() and own.min() > SLOWEST:
            moves[column] = True
            amplitude[:, column] = _spectrum(analysis.noise[part], own / run.rate, edges)
    if not moves.any():
        return None
    middles = np.asarray(float(run.time[0]) + (firsts + size / 2) / run.rate, dtype=np.float64)
    shown = np.asarray(np.sqrt(edges[:-1] * edges[1:]))
    return run.joint_names[joint], Spectrogram(middles, shown, amplitude, moves)


def _joint(analysis: Analysis) -> int:
    run = analysis.run
    for known in analysis.orders.values():
        return run.joint_names.index(known.joint)
    _, level = analysis.joint_levels
    fastest = [np.abs(run.velocity[rows]).max(axis=0) for rows in pieces(run.velocity)]
    moving = np.max(fastest, axis=0) > SLOWEST
    power = np.nansum(10.0 ** (level / 10.0), axis=0)
    return int(np.argmax(np.where(moving, power, -1.0)))


def _spectrum(wave: Array, steps: Array, edges: Array) -> Array:
    """Largest amplitudes between some orders, by how far the joint turns in each sample."""
    angle = np.concatenate(([0.0], np.cumsum(steps[:-1])))
    even = np.interp(np.linspace(0.0, angle[-1], len(wave), endpoint=False), angle, wave)
    found = amplitudes(even[None])[0]
    own = np.arange(1, len(found) + 1) * 2.0 * np.pi / angle[-1]
    inside = (edges[1:] > own[0]) & (edges[:-1] < own[-1])
    return np.asarray(in_bands(own, found[:, None], edges)[:, 0] * inside)
