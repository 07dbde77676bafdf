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
    shared = shared_links(pair)
    time, change = link_steps(pair, shared)
    rgba = sides.diverging(change)
    colours = {link: rgba[:, index] for index, link in enumerate(shared)}
    robot.log_colours(recording, tree, time, colours, rest=sides.diverging(np.zeros(1)))
    return names[:BOTH]
