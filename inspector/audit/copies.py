"""Measured signals that equal desired ones: one is a copy."""

from dataclasses import dataclass

import numpy as np

from inspector.audit.differentiation import derived
from noisemodel import Run
from noisemodel.types import Real

FARTHEST = 10
"""Largest lag of a copy, before or after, in samples."""

EXAMINED = 1000
"""Samples in motion that are compared, evenly spread, or a few more."""

SAME = 0.99
"""Least share of equal samples, bit for bit, among those in motion."""


@dataclass(frozen=True)
class Copy:
    """A measured signal that equals the desired one.

    Attributes:
        signal: "position" or "velocity".
        joints: Its joints.
        lag: Samples by which the measured signal comes after the desired one.
    """

    signal: str
    joints: tuple[str, ...]
    lag: int


def copies(run: Run) -> tuple[Copy, ...]:
    """Find desired signals that equal measured ones, perhaps some samples apart.

    Args:
        run: The run; only signals that were logged are compared.

    Returns:
        At most one for each of position and velocity.
    """
    found = []
    for signal in ("position", "velocity"):
        measured, desired = getattr(run, signal), getattr(run, f"{signal}_desired")
        if measured is None or desired is None or derived(run, signal):
            continue
        actual, wanted = (np.ascontiguousarray(each[run.mask].T) for each in (measured, desired))
        lags = {}
        for name in (name for name in run.joint_names if name in run.desired_joint_names):
            lag = _lag(
                actual[run.joint_names.index(name)], wanted[run.desired_joint_names.index(name)]
            )
            if lag is not None:
                lags[name] = lag
        if lags:
            found.append(Copy(signal, tuple(lags), min(lags.values(), key=abs)))
    return tuple(found)


def _lag(measured: Real, desired: Real) -> int | None:
    """Find the shift at which two signals are equal, None if there is none."""
    samples = len(measured)
    changes = np.flatnonzero(desired[1:] != desired[:-1])
    for lag in sorted(range(-FARTHEST, FARTHEST + 1), key=abs):
        ends = np.searchsorted(changes, (max(-lag, 0), samples - max(lag, 0) - 1))
        moving = changes[slice(*ends)]
        moving = moving[:: max(1, len(moving) // EXAMINED)]
        equal = np.count_nonzero(measured[moving + lag] == desired[moving])
        if len(moving) >= FARTHEST and equal >= SAME * len(moving):
            return lag
    return None
