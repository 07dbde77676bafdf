"""A desired velocity that is none: zeros as a placeholder, or slopes of rounded positions."""

from dataclasses import replace

import numpy as np

from inspector.audit.differentiation import SMOOTH, derived
from inspector.audit.quantisation import SAMPLES, step_of
from noisemodel import Run
from noisemodel.ondemand import pieces

MOVES = 0.1
"""Speed from which a joint moves, in [rad/s] or [m/s]: pushes on a standing arm peak below."""
WINDOW = 2.0
"""Stretch of time in which it has to move, in [s]."""
SHARE = 0.75
"""Share of that time: a motion reverses now and then, a push is over sooner."""
STEP = 1e-6
"""Change of a desired position from which it changes, in [rad] or [m]."""
AT_ONCE = 1_000_000
"""Samples that are counted at once."""
FAINTEST = 0.05
"""Most quantisation noise of a differentiated velocity, RMS in [rad/s]: faults begin there."""


def placeholder(run: Run) -> str:
    """Check whether the desired velocity is not the desired motion.

    Controllers that take position targets write zeros in its place. They are a placeholder if the
    desired position changes meanwhile, or if some joint is faster than 0.1 rad/s for three quarters
    of any two seconds. The zeros of a robot that has to stand remain, also when it is pushed.
    A velocity that was differentiated from desired positions is none if their quantisation steps
    alone make more than 0.05 rad/s of it.

    Args:
        run: The run.

    Returns:
        A clause that says so; empty if the desired velocity is one, or there is none.
    """
    desired = run.velocity_desired
    if desired is None or not desired.size:
        return ""
    if any(np.any(desired[rows]) for rows in pieces(desired)):
        return _coarse(run)
    if _changes(run):
        return "the desired velocity is zero throughout while the desired position changes"
    if _moves(run):
        return (
            "the desired velocity is zero throughout while joints move at more than"
            f" {MOVES:g} rad/s for seconds"
        )
    return ""


def without_placeholder(run: Run) -> tuple[Run, str]:
    """Leave a desired velocity out that is a placeholder.

    Args:
        run: The run.

    Returns:
        The run, without its desired velocity if that is a placeholder, and a sentence that says
        so; the run itself and an empty text otherwise.
    """
    clause = placeholder(run)
    if not clause:
        return run, ""
    said = f"{clause[0].upper()}{clause[1:]}: it was left out."
    return replace(run, velocity_desired=None), said


def _changes(run: Run) -> bool:
    """Whether the desired position changes."""
    if run.position_desired is None:
        return False
    wanted = run.position_desired
    low, high = np.full(wanted.shape[1], np.inf), np.full(wanted.shape[1], -np.inf)
    for rows in pieces(wanted):
        part = wanted[rows][run.mask[rows]]
        low = np.minimum(low, part.min(axis=0, initial=np.inf))
        high = np.maximum(high, part.max(axis=0, initial=-np.inf))
    return bool((high - low).max() > STEP)


def _coarse(run: Run) -> str:
    """Say that desired positions have steps too large to be differentiated; empty if not."""
    if not derived(run, "velocity_desired") or run.position_desired is None:
        return ""
    valid = np.flatnonzero(run.mask)
    thinned = valid[:: max(1, len(valid) // SAMPLES)]
    step = max(step_of(position) for position in run.position_desired[thinned].T)
    # B. Widrow, IRE Trans. Circuit Theory 3 (1956): white noise of power step² / 12.
    noise = step / 12**0.5 * run.rate * float(np.linalg.norm(SMOOTH.weights))
    if noise <= FAINTEST:
        return ""
    return (
        f"the desired velocity has {noise:.2g} rad/s of noise, since it was differentiated from"
        f" positions in steps of {step:.2g} rad"
    )


def _moves(run: Run) -> bool:
    """Whether some joint is faster than ``MOVES`` for most of some ``WINDOW``."""
    size = round(WINDOW * run.rate)
    if len(run.time) < size or not run.joint_names:
        return False
    fast = run.mask.copy()
    for rows in pieces(run.velocity):
        fast[rows] &= np.abs(run.velocity[rows]).max(axis=1) > MOVES
    for first in range(0, len(fast) - size + 1, AT_ONCE):
        count = np.append(0, np.cumsum(fast[first : first + AT_ONCE + size]))
        if (count[size:] - count[:-size]).max() >= SHARE * size:
            return True
    return False
