"""Signs of other units than radians and seconds."""

from collections.abc import Iterator

import numpy as np

from inspector.audit.differentiation import derived
from noisemodel import Run
from noisemodel.types import Array

TURNS = 4 * np.pi
"""Largest plausible position of a joint that is not continuous, in [rad]."""

FAST = 100.0
"""Largest plausible velocity of a joint, in [rad/s]."""

ROUND_ENDS = (1.0, 100.0)
"""Ends of the ranges that positions are normalised to."""

FACTORS = {
    180 / np.pi: "velocities look like degrees per second beside positions in radians",
    np.pi / 180: "positions look like degrees beside velocities in radians per second",
    30 / np.pi: "velocities look like turns per minute beside positions in radians",
    1 / 6: "velocities look like turns per minute beside positions in degrees",
    1 / (2 * np.pi): "velocities look like turns per second beside positions in radians",
}
"""Warnings by the ratio of velocities to the slope of positions."""

NEAR = 0.02
"""Largest relative deviation from a factor, less than half the distance of two of them."""

STRETCH = 0.2
"""Time over which velocities are integrated and compared with positions, in [s]."""


def unit_warnings(run: Run) -> Iterator[str]:
    """Warnings about values that look like another unit, a clause each.

    Args:
        run: The run.
    """
    if not run.joint_names:
        return
    factor = _factor(run)
    for known, warning in FACTORS.items():
        if factor is not None and abs(factor / known - 1) <= NEAR:
            yield f"{warning} ({factor:.4g} times their slope)"
    if run.position is not None:
        yield from _angles(run, np.abs(run.position[run.mask]).max(axis=0))
    speeds = np.abs(run.velocity[run.mask]).max(axis=0)
    fast = int(np.argmax(speeds))
    if speeds[fast] > FAST:
        yield (
            f"velocities look like degrees or turns per minute"
            f" ({run.joint_names[fast]} reaches {speeds[fast]:.4g})"
        )


def _angles(run: Run, reach: Array) -> Iterator[str]:
    """Warnings about positions that reach too far, or stop at round numbers."""
    largest = float(reach.max())
    if largest in ROUND_ENDS and _stops_at(run, largest) >= 2:
        yield f"positions look normalised: several joints stop at {largest:g}"
        return
    moving = np.ptp(run.velocity[run.mask], axis=0) > 0
    far = (reach > TURNS / 2) & moving
    enough = np.sum(far) > 1 or (reach[far] > TURNS).any()
    if enough and 2 * np.sum(far) >= max(1, np.sum(moving)):
        other = " or normalised" if largest <= max(ROUND_ENDS) else ""
        joint = run.joint_names[int(np.argmax(reach))]
        yield f"positions look like degrees{other} ({joint} reaches {largest:.4g})"


def _stops_at(run: Run, end: float) -> int:
    """Count the joints that are at one position, to the bit, for two samples in a row."""
    assert run.position is not None
    there = np.abs(run.position) == end
    return int(np.sum((there[1:] & there[:-1]).any(axis=0)))


def _factor(run: Run) -> float | None:
    """Ratio of integrated velocities to the change of positions; None if it is not known."""
    if run.position is None or derived(run, "velocity"):
        return None
    length = max(2, round(STRETCH * run.rate))
    starts = np.arange(0, len(run.time) - length, length)
    gaps = np.concatenate(([0], np.cumsum(~run.mask)))
    starts = starts[gaps[starts + length + 1] == gaps[starts]]
    if not len(starts):
        return None
    way = run.position[starts + length].astype(np.float64) - run.position[starts]
    whole = run.velocity[: len(run.time) // length * length]
    sums = whole.reshape(-1, length, way.shape[1]).sum(axis=1, dtype=np.float64)[starts // length]
    ends = (run.velocity[starts + length].astype(np.float64) - run.velocity[starts]) / 2
    summed = (sums + ends) / run.rate  # trapezoids
    clear = np.square(way).sum(axis=0) > 0
    if not clear.any():
        return None
    factors = (summed * way).sum(axis=0)[clear] / np.square(way).sum(axis=0)[clear]
    return float(np.median(factors))
