"""The faults to inject into one run, and the signals that they consist of."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from noiseclassifier.scenarios.events import Event
from noiseclassifier.scenarios.loads import Load
from noiseclassifier.scenarios.shapes import Box
from noisemodel.types import Array

Integers: TypeAlias = NDArray[np.int64]
Signal: TypeAlias = Callable[[Array], Array]
"""From times, shape (times,), in [s], to values, their first axis the times."""


@dataclass(frozen=True, kw_only=True)
class Faults:
    """The faults to inject into one run; by default none.

    Attributes:
        decalibration: Offsets of encoders by the index of the joint, in [rad].
        shift: Added to the planned places of the effectors: time to shape
            (ticks, effectors, 3), in [m].
        overlay: Heights and their rates, added to the reference of the drives: time to shape
            (samples, effectors, 2), in [m] and [m/s].
        sensors: Added to the values of sensors, by name: time to shape (ticks, values).
        gain: Scale of the force control's gains: time to shape (ticks,).
    """

    boxes: tuple[Box, ...] = ()
    ground: tuple[Box, ...] | None = None
    decalibration: Mapping[int, float] = field(default_factory=dict)
    shift: Signal | None = None
    overlay: Signal | None = None
    sensors: Mapping[str, Signal] = field(default_factory=dict)
    gain: Signal = np.ones_like
    loads: tuple[Load, ...] = ()
    events: tuple[Event, ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)

    def offsets(self, joints: int) -> Array:
        """Offsets of a number of encoders, shape (joints,), in [rad]."""
        return np.array([self.decalibration.get(joint, 0.0) for joint in range(joints)])


def ramps(
    time: Array, *, starts: Array, rises: Array, moves: Array, effectors: Integers, count: int
) -> Array:
    """Sum of movements at constant speed, each of one effector, shape (times, count, 3)."""
    share = np.clip((time[:, None] - starts) / rises, 0, 1)
    out = np.zeros((len(time), count, 3))
    for effector in range(count):
        mine = effectors == effector
        out[:, effector] = share[:, mine] @ moves[mine]
    return out


def pulses(time: Array, *, starts: Array, stops: Array, sizes: Array) -> Array:
    """Sum of rectangular pulses of sizes (pulses, values), shape (times, values)."""
    return ((starts <= time[:, None]) & (time[:, None] < stops)) @ sizes


def step(time: Array, *, start: float, factor: float) -> Array:
    """Step from 1 to a factor, shape (times,)."""
    return np.where(time < start, 1.0, factor)


def sines(
    time: Array,
    *,
    rates: Array,
    phases: Array,
    amplitude: float,
    start: float,
    stop: float,
    shares: Array,
) -> Array:
    """Sum of sines that fades in and out over 0.1 s, and its rate.

    Args:
        time: Shape (times,), in [s].
        rates: Of the sines, shape (sines,), in [rad/s].
        phases: Of the sines, shape (sines,), in [rad].
        start: When it starts, in [s].
        stop: When it ends, in [s].
        shares: Scale of each effector, shape (effectors,).
    """
    out = np.zeros((len(time), len(shares), 2))
    inside = (start < time) & (time < stop)
    now = time[inside]
    envelope = np.minimum(1, np.minimum(now - start, stop - now) / 0.1)
    angles = np.outer(now, rates) + phases
    scale = amplitude / np.sqrt(len(rates)) * envelope
    wave = np.stack((scale * np.sin(angles).sum(axis=1), scale * (np.cos(angles) @ rates)), axis=1)
    out[inside] = shares[:, None] * wave[:, None]
    return out
