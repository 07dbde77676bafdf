"""Levels of vibrating links over time: states with hysteresis for lanes, colours for the robot."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inspector import colors
from inspector.linknoise import LinkNoise
from noisemodel.types import Array

STATES = colors.LOUDNESS
"""From below -20 dB to above -6 dB of the loudest link's peak."""
THRESHOLDS_DB = (-20.0, -12.0, -6.0)
HYSTERESIS_DB = 3.0
RANGE_DB = 30.0
STEP = 0.05
"""Time over which a level is taken, in [s]."""
SHADES = 16


@dataclass(frozen=True, eq=False)
class Levels:
    """Levels of all links, relative to the loudest peak of any.

    Attributes:
        time: Starts of the steps, shape (steps,), in [s].
        level: Shape (steps, links), in [dB], at most 0.
    """

    time: Array
    level: Array


def levels(noise: LinkNoise) -> Levels:
    """Take the levels of the links' vibration every 50 ms (or bin, if that is longer).

    The whole motion would not do: a link that moves fast and smoothly would be the loudest.

    Args:
        noise: The links' power.

    Returns:
        Their levels; silence is at -inf.
    """
    width = float(np.median(np.diff(noise.time))) if len(noise.time) > 1 else STEP
    size = max(1, round(STEP / width))
    firsts = np.arange(0, len(noise.time), size)
    counts = np.diff(np.append(firsts, len(noise.time)))
    mean = np.add.reduceat(noise.vibration, firsts, axis=0) / counts[:, None]
    peak = mean.max(initial=0.0) or 1.0
    with np.errstate(divide="ignore"):
        return Levels(noise.time[firsts] - width / 2, 10 * np.log10(mean / peak))


def states(level: Array) -> list[str]:
    """Tell states apart so that they do not flicker.

    A state is entered at its threshold and left 3 dB below.

    Args:
        level: Of one link, shape (steps,), in [dB].

    Returns:
        A name of ``STATES`` per step.
    """
    names = list(STATES)
    entered = np.searchsorted(THRESHOLDS_DB, level, side="right")
    held = np.searchsorted(np.array(THRESHOLDS_DB) - HYSTERESIS_DB, level, side="right")
    state, found = 0, []
    for up, stay in zip(entered.tolist(), held.tolist(), strict=True):
        state = max(up, min(state, stay))
        found.append(names[state])
    return found


def shades(level: Array) -> NDArray[np.uint8]:
    """Colour levels from slate over amber to pale yellow, in few shades: few changes are logged.

    Args:
        level: Any shape, in [dB].

    Returns:
        Red, green, blue and opacity, shape (…, 4).
    """
    place = np.clip(1.0 + level / RANGE_DB, 0.0, 1.0)
    place = np.round(place * (SHADES - 1)) / (SHADES - 1)
    scale = np.array(list(STATES.values()), dtype=np.float64)
    places = np.linspace(0.0, 1.0, len(scale))
    channels = [np.interp(place, places, scale[:, channel]) for channel in range(3)]
    return np.stack([*channels, np.full(place.shape, 255.0)], axis=-1).astype(np.uint8)
