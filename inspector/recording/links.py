"""The noise of links in a recording: lanes, sound power, and the robot's colours."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.urdf import UrdfTree

from inspector import colors
from inspector.recording import robot, series
from noisemodel.links import LinkNoise
from noisemodel.noise import REFERENCE_POWER
from noisemodel.types import Array

STATES = colors.LEVELS
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
    """Levels of the links' vibration every 50 ms (or bin, if that is longer).

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
    """States of a link, with hysteresis so that they do not flicker.

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


LANES = 5
LINES = 8
FLOOR_DB = -20.0
"""Sound power below this is drawn at it, in [dB re 1 pW]."""


def log(recording: rr.RecordingStream, tree: UrdfTree, noise: LinkNoise) -> None:
    """Log the noise of a robot's links.

    Args:
        recording: Where to.
        tree: The robot.
        noise: Its links' power.
    """
    found = levels(noise)
    for index in sorted(noise.loudest[:LANES]):
        _log_lane(recording, noise.links[index], found, index)
    _log_power(recording, "/power/total", noise, noise.total, colors.NOISE)
    for place, index in enumerate(noise.loudest[:LINES]):
        color = colors.of_series(LINES)[place]
        path = f"/power/links/{noise.links[index]}"
        _log_power(recording, path, noise, noise.power[:, index], color)
    for place, (term, power) in enumerate(noise.terms.items()):
        _log_power(recording, f"/power/terms/{term}", noise, power, colors.of_series(3)[place])
    rgba = shades(found.level)
    colours = {link: rgba[:, index] for index, link in enumerate(noise.links)}
    robot.log_colours(recording, tree, found.time, colours, rest=shades(np.array([-np.inf])))


def _log_lane(recording: rr.RecordingStream, link: str, found: Levels, index: int) -> None:
    step = found.time[1] - found.time[0] if len(found.time) > 1 else 0.0
    edges = [*found.time.tolist(), float(found.time[-1] + step)]
    named = states(found.level[:, index])
    stretches = [(*edge, state) for edge, state in zip(pairwise(edges), named, strict=True)]
    series.log_lane(recording, f"/level/{link}", stretches, STATES)


def _log_power(
    recording: rr.RecordingStream, path: str, noise: LinkNoise, power: Array, color: colors.Color
) -> None:
    with np.errstate(divide="ignore"):
        level = np.maximum(10 * np.log10(power / REFERENCE_POWER), FLOOR_DB)
    name = path.rpartition("/")[2]
    series.log_lines(recording, path, noise.time, level[:, None], names=[name], colours=[color])
