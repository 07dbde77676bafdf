"""The links of both runs in a recording: their power, and the robot coloured by what changed."""

import numpy as np
import rerun as rr
from rerun.urdf import UrdfTree

from inspector import colors
from inspector.pair import colors as sides
from inspector.pair.levels import by_link, link_steps, shared_links
from inspector.pair.noise import COLOURS, LOWEST_POWER_DB
from inspector.pair.pair import Pair
from inspector.recording import robot, series
from noisemodel.noise import REFERENCE_POWER, decibel

LINES = 8
BOTH = 4
"""Links whose power before and after is shown."""


def log(recording: rr.RecordingStream, tree: UrdfTree, pair: Pair) -> list[str]:
    """Log the noise of links, and colour them by how much louder they became.

    Args:
        recording: Where to.
        tree: The robot.
        pair: Two runs of it.

    Returns:
        The links whose power is logged, that which changed most first.
    """
    assert pair.links is not None
    names = [level.name for level in by_link(pair)]
    time, change = link_steps(pair, names)
    for place, name in enumerate(names[:LINES]):
        path = f"/change/links/{name}"
        color = colors.of_series(LINES)[place]
        series.log_lines(recording, path, time, change[:, [place]], names=[name], colours=[color])
    for (side, _), noise in zip(pair.sides, pair.links, strict=True):
        for name in names[:BOTH]:
            power = noise.vibration[:, [noise.links.index(name)]]
            level = np.maximum(decibel(power / REFERENCE_POWER), LOWEST_POWER_DB)
            series.log_lines(
                recording,
                f"/links/{name}/{side}",
                noise.time,
                level,
                names=[side],
                colours=[COLOURS[side]],
            )
    _log_colours(recording, tree, pair)
    return names[:BOTH]


def _log_colours(recording: rr.RecordingStream, tree: UrdfTree, pair: Pair) -> None:
    names, shapes = shared_links(pair), robot.shapes(tree)
    time, change = link_steps(pair, names)
    rgba = sides.diverging(change)
    for link, members in robot.moving_links(tree).items():
        paths = [path for member in members for path in tree.get_visual_geometry_paths(member)]
        if link not in names:
            for path in paths:  # the base of an arm: it never moves
                resting = {robot.COLOURED[shapes[path]]: sides.diverging(np.zeros(1))}
                recording.log(path, getattr(rr, shapes[path]).from_fields(**resting), static=True)
            continue
        own = rgba[:, names.index(link)]
        changed = np.concatenate(([True], (own[1:] != own[:-1]).any(axis=1)))
        for path in paths:
            colour = {robot.COLOURED[shapes[path]]: own[changed]}
            columns = getattr(rr, shapes[path]).columns(**colour)
            recording.send_columns(path, indexes=[series.at(time[changed])], columns=columns)
