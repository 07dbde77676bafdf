"""Which joints and links vibrate, in a recording: their levels as colours, and the robot's."""

from collections.abc import Sequence

import numpy as np
import rerun as rr
from rerun.urdf import UrdfTree

from inspector import colors, levels
from inspector.analysis.analyse import Analysis
from inspector.analysis.loudest import chosen
from inspector.levels import Scale
from inspector.recording import axes, robot, rows, series
from inspector.recording.axes import Panel
from noisemodel.links import LinkNoise
from noisemodel.noise import REFERENCE_POWER
from noisemodel.types import Array

ROW = 18.0
"""Height of a row, in points; what is drawn is lower, so that rows are told apart."""
WIDTH, STROKES = 7.0, 3
"""Of the lines of a row, in points, and how many there are."""
SHADES = 16
"""Colours of the robot."""
LINES = 8
FLOOR_DB = -20.0
"""Sound power below this is drawn at it, in [dB re 1 pW]."""
KEY = Panel("key", 285.0)
"""The scale beside the robot."""


def log_joints(recording: rr.RecordingStream, analysis: Analysis) -> Panel | None:
    """Log the levels of the joints that vibrate most.

    Args:
        recording: Where to.
        analysis: The run.

    Returns:
        Their panel; None without joints.
    """
    run = analysis.run
    if not run.joint_names:
        return None
    time, level = analysis.joint_levels
    stop = float(run.time[-1]) + 1.0 / run.rate
    return _log_strips(
        recording, "joints", analysis, np.append(time, stop), level, run.joint_names, levels.JOINTS
    )


def log(
    recording: rr.RecordingStream, tree: UrdfTree, analysis: Analysis, noise: LinkNoise
) -> Panel:
    """Log the noise of a robot's links: levels of those that vibrate most, power, colours.

    Args:
        recording: Where to.
        tree: The robot.
        analysis: The run.
        noise: Its links' power.

    Returns:
        The panel of the levels.
    """
    time, level = levels.link_levels(noise)
    _log_power(recording, "/power/total", noise, noise.total, colors.NOISE)
    for place, index in enumerate(noise.loudest[:LINES]):
        color = colors.of_series(LINES)[place]
        path = f"/power/links/{noise.links[index]}"
        _log_power(recording, path, noise, noise.power[:, index], color)
    for place, (term, power) in enumerate(noise.terms.items()):
        _log_power(recording, f"/power/terms/{term}", noise, power, colors.of_series(3)[place])
    rgba = levels.LINKS.colours(level, shades=SHADES)
    colours = {link: rgba[:, index] for index, link in enumerate(noise.links)}
    quiet = levels.LINKS.colours(np.array([-np.inf]))
    robot.log_colours(recording, tree, time, colours, rest=quiet)
    axes.log_scale(recording, KEY, levels.LINKS, "dB re\n1 pW")
    width = float(np.median(np.diff(noise.time))) if len(noise.time) > 1 else levels.STEP
    edges = np.append(time, noise.time[-1] + width / 2)
    return _log_strips(recording, "links", analysis, edges, level, noise.links, levels.LINKS)


def _log_strips(
    recording: rr.RecordingStream,
    name: str,
    analysis: Analysis,
    edges: Array,
    level: Array,
    names: Sequence[str],
    scale: Scale,
) -> Panel:
    which = chosen(analysis, edges[:-1], level)
    own = [names[index] for index in which]
    panel = Panel(name, ROW * len(own) + axes.AXIS)
    shown = level[:, which].T
    rgba = scale.colours(np.nan_to_num(shown, nan=-np.inf), shades=rows.SHADES)
    rgba = rows.blank(rgba, np.asarray(~np.isnan(shown).all(axis=0)))
    called = [f"{each} [{scale.unit}]" for each in own]
    rows.log(recording, f"/strips/{name}", edges, rgba, names=called, width=WIDTH, lines=STROKES)
    axes.log_left(recording, panel, axes.rows(own))
    axes.log_scale(recording, panel, scale)
    return panel


def _log_power(
    recording: rr.RecordingStream, path: str, noise: LinkNoise, power: Array, color: colors.Color
) -> None:
    with np.errstate(divide="ignore"):
        level = np.maximum(10 * np.log10(power / REFERENCE_POWER), FLOOR_DB)
    name = path.rpartition("/")[2]
    series.log_lines(recording, path, noise.time, level[:, None], names=[name], colours=[color])
