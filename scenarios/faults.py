"""The faults of one run, in the five places where they act, and the signals they consist of."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from noisemodel.types import Array
from scenarios.events import Event
from scenarios.shapes import Box

Signal: TypeAlias = Callable[[Array], Array]


def _no_shift(time: Array) -> Array:
    return np.zeros((len(time), 3))


def _no_overlay(time: Array) -> Array:
    return np.zeros((len(time), 2))


def _no_force(time: Array) -> Array:
    return np.zeros(len(time))


@dataclass(frozen=True, kw_only=True)
class Faults:
    """The faults of one run; by default there are none.

    Attributes:
        boxes: What stands on the ground and was not expected.
        decalibration: What the encoders of joints, by index, read too much, in [rad].
        shift: Added to the planned place of the tool: time to shape (ticks, 3), in [m].
        overlay: Height and its rate added to what the drives are to follow: time to shape
            (samples, 2), in [m] and [m/s].
        force: Added to the force sensor: time to shape (ticks,), in [N].
        force_gain: Scale of the force control's gain.
        events: What is known to go wrong before the robot moves.
        facts: What was drawn, for the record.
    """

    boxes: tuple[Box, ...] = ()
    decalibration: Mapping[int, float] = field(default_factory=dict)
    shift: Signal = _no_shift
    overlay: Signal = _no_overlay
    force: Signal = _no_force
    force_gain: float = 1.0
    events: tuple[Event, ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)


def ramps(time: Array, *, starts: Array, rises: Array, moves: Array) -> Array:
    """Sum of movements at constant speed, shape (ticks, 3)."""
    return np.clip((time[:, None] - starts) / rises, 0, 1) @ moves


def pulses(time: Array, *, starts: Array, stops: Array, sizes: Array) -> Array:
    """Sum of rectangular pulses, shape (ticks,)."""
    return ((starts <= time[:, None]) & (time[:, None] < stops)) @ sizes


def sines(
    time: Array, *, rates: Array, phases: Array, amplitude: float, start: float, stop: float
) -> Array:
    """Sum of sines that fades in and out over 0.1 s, and its rate, shape (samples, 2)."""
    out = np.zeros((len(time), 2))
    inside = (start < time) & (time < stop)
    now = time[inside]
    envelope = np.minimum(1, np.minimum(now - start, stop - now) / 0.1)
    angles = np.outer(now, rates) + phases
    scale = amplitude / np.sqrt(len(rates)) * envelope
    out[inside, 0] = scale * np.sin(angles).sum(axis=1)
    out[inside, 1] = scale * (np.cos(angles) @ rates)
    return out
