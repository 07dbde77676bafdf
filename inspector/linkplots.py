"""The noise of links in a recording: lanes, sound power, and the robot's colours."""

from itertools import pairwise

import numpy as np
import rerun as rr
from rerun.urdf import UrdfTree

from inspector import colors, scene, series
from inspector.linklevels import STATES, Levels, levels, shades, states
from inspector.linknoise import LinkNoise
from noisemodel.noise import REFERENCE_POWER
from noisemodel.types import Array

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
    _log_colours(recording, tree, noise, found)


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


def _log_colours(
    recording: rr.RecordingStream, tree: UrdfTree, noise: LinkNoise, found: Levels
) -> None:
    shapes, rgba = scene.shapes(tree), shades(found.level)
    for link, members in scene.moving_links(tree).items():
        paths = [path for member in members for path in tree.get_visual_geometry_paths(member)]
        if link not in noise.links:
            for path in paths:  # the base of an arm: it never moves
                resting = {scene.COLOURED[shapes[path]]: shades(np.array([-np.inf]))}
                recording.log(path, getattr(rr, shapes[path]).from_fields(**resting), static=True)
            continue
        index = noise.links.index(link)
        changed = np.concatenate(([True], (rgba[1:, index] != rgba[:-1, index]).any(axis=1)))
        times = [series.at(found.time[changed])]
        for path in paths:
            colour = {scene.COLOURED[shapes[path]]: rgba[changed, index]}
            columns = getattr(rr, shapes[path]).columns(**colour)
            recording.send_columns(path, indexes=times, columns=columns)
