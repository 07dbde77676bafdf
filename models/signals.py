"""Signals: what is listened to, one noise estimate or several side by side."""

from collections.abc import Collection, Mapping, Sequence
from typing import TypeAlias

import numpy as np

from models.errors import MissingSignalError, SignalError
from models.types import Mask, Real

NOISE = "noise"
"""The one signal of the paper, p_hat = sqrt(|qd|^2 + |qd_desired|^2) (Sec. II-A)."""

Signals: TypeAlias = Real | Mapping[str, Real]
"""The noise, shape (samples,), or signals by name, each of that shape."""


def named(signals: Signals) -> Mapping[str, Real]:
    """Give each signal its name; one alone is the noise."""
    return signals if isinstance(signals, Mapping) else {NOISE: signals}


def feeds(there: Collection[str], names: Sequence[str]) -> bool:
    """Whether all that are named are there; the noise can be made of its two parts."""
    parts = "measured" in there and "desired" in there
    return all(name in there or (name == NOISE and parts) for name in names)


def stacked(signals: Signals, names: Sequence[str]) -> Real:
    """Lay signals side by side.

    Args:
        signals: The noise, or signals by name.
        names: Those that are wanted, in order. ``noise`` is made of ``measured`` and ``desired``
            where it is not there.

    Returns:
        One signal as it is, shape (samples,); several of shape (signals, samples).

    Raises:
        MissingSignalError: If one is not there.
        SignalError: If one is not one-dimensional, or they differ in length.
    """
    there = named(signals)
    if lacking := [name for name in names if name not in there]:
        if not feeds(there, names):
            raise MissingSignalError(lacking, there)
        there = {**there, NOISE: np.hypot(there["measured"], there["desired"])}
    chosen = [np.asarray(there[name]) for name in names]
    if chosen[0].ndim != 1 or len({signal.shape for signal in chosen}) > 1:
        found = ", ".join(f"{name} {s.shape}" for name, s in zip(names, chosen, strict=True))
        raise SignalError(f"a signal has another shape, {found}, expected (samples,)")
    return chosen[0] if len(chosen) == 1 else np.array(chosen)


def check(samples: Real, valid: Mask | None = None, *, first: int = 0) -> None:
    """Check what is to be classified.

    Args:
        samples: Shape (samples,) or (signals, samples).
        valid: False in gaps, of which there are none unless given.
        first: Number of the first sample.

    Raises:
        SignalError: If the shapes do not fit, or a value is not finite.
    """
    count = samples.shape[-1]
    if valid is not None and valid.shape != (count,):
        raise SignalError(
            f"samples of shape {samples.shape} and validity of shape {valid.shape},"
            " expected (samples,) for both"
        )
    if not np.isfinite(samples).all():
        plain = samples.reshape(-1, count)
        number, row = np.argwhere(~np.isfinite(plain))[0].tolist()
        raise SignalError(
            f"sample {first + row} of the signal is not finite ({plain[number, row]})"
        )
