"""The links of both runs in a recording: both robots by their levels, rows by what changed."""

from collections.abc import Mapping

import numpy as np
import rerun as rr
from rerun.urdf import UrdfTree

from inspector.levels import LINKS, link_levels
from inspector.pair.colors import CHANGE, SHADES, SIDES
from inspector.pair.levels import by_link, link_steps
from inspector.pair.noise import DETAILS, LOWEST_POWER_DB
from inspector.pair.pair import Pair
from inspector.recording import axes, robot, rows, series
from inspector.recording.axes import Label, Panel
from noisemodel.noise import REFERENCE_POWER, decibel

SHOWN = 8
"""Links that have a row, those that changed most."""
LINES = 3
"""Lines of a row, since thick ones have round ends."""
BOTH = 4
"""Links whose power before and after is shown."""
KEY = Panel("key", 260.0)
"""The scale beside the robots."""
ROBOT_SHADES = 16


def log(
    recording: rr.RecordingStream, trees: Mapping[str, UrdfTree], pair: Pair
) -> tuple[Panel, list[str]]:
    """Log the noise of links: colour both robots by it, and rows by how it changed.

    Args:
        recording: Where to.
        trees: The robot before and after.
        pair: Two runs of it.

    Returns:
        The panel of the rows, and the links whose power is logged, that which changed most first.
    """
    assert pair.links is not None
    for tree, noise in zip(trees.values(), pair.links, strict=True):
        time, level = link_levels(noise)
        rgba = LINKS.colours(level, shades=ROBOT_SHADES)
        colours = {link: rgba[:, index] for index, link in enumerate(noise.links)}
        quiet = LINKS.colours(np.array([-np.inf]))
        robot.log_colours(recording, tree, time, colours, rest=quiet)
    axes.log_scale(recording, KEY, LINKS, "dB re\n1 pW")
    names = [level.name for level in by_link(pair)]
    for (side, _), noise in zip(pair.sides, pair.links, strict=True):
        for name in names[:BOTH]:
            power = noise.vibration[:, [noise.links.index(name)]]
            level = np.maximum(decibel(power / REFERENCE_POWER), LOWEST_POWER_DB)
            path = f"/links/{name}/{side}"
            shade = [SIDES[side]]
            series.log_lines(recording, path, noise.time, level, names=[side], colours=shade)
    own = names[:SHOWN]
    time, change = link_steps(pair, own)
    panel = Panel("links", DETAILS)
    if own:
        end = float(pair.time[-1]) + 1.0 / pair.rate
        rgba = CHANGE.colours(change.T, shades=SHADES)
        called = [f"{name}, change [dB]" for name in own]
        width = (DETAILS - axes.AXIS) / len(own) / (LINES + 1) + 2.0
        edges = np.append(time, max(end, float(time[-1])))
        rows.log(recording, "/change/links", edges, rgba, names=called, width=width, lines=LINES)
    axes.log_left(recording, panel, axes.rows(own) or [Label(0.5, "no links")])
    axes.log_scale(recording, panel, CHANGE)
    return panel, names[:BOTH]
