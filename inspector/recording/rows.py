"""Rows of colours over time in a recording: spectrograms, and the levels of joints and links.

Rerun has no heat map over time; a line whose colour changes is a row of one, on the time axis of
the other plots.
"""

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from inspector import colors
from inspector.recording import axes
from inspector.recording.series import at, scalars
from noisemodel.types import Array, Mask

EMPTY = (*colors.BACKGROUNDS[0], 255)
"""Of a row where nothing is known: that of the viewer."""
SHADES = 32
"""Colours of a row: few change rarely."""


def log(
    recording: rr.RecordingStream,
    path: str,
    edges: Array,
    rgba: NDArray[np.uint8],
    *,
    names: Sequence[str],
    width: float,
    lines: int = 1,
) -> None:
    """Log rows of colours, the first at the top.

    Args:
        recording: Where to.
        path: Entity path below which the rows are numbered.
        edges: Starts of the columns and the end of the last one, shape (columns + 1,), in [s].
        rgba: Shape (rows, columns, 4).
        names: One per row.
        width: Of a line, in points.
        lines: Lines of a row, beside each other. Where its colour changes, a line begins with a
            round end that is half as long as it is wide: a few narrow lines blur time less.
    """
    apart = (np.arange(lines) - (lines - 1) / 2) * axes.TOP / len(names) / (lines + 1)
    for row, (name, place) in enumerate(zip(names, axes.middles(len(names)), strict=True)):
        entity, own = f"{path}/{row:02d}", rgba[row]
        style = rr.SeriesLines(
            names=[name] * lines, widths=[width] * lines, aggregation_policy="Off"
        )
        recording.log(entity, style, static=True)
        # A segment takes the colour of its end.
        kept = np.concatenate(([True], (own[1:] != own[:-1]).any(axis=1), [True]))
        shown = np.concatenate((own[:1], own))[kept]
        recording.send_columns(
            entity,
            indexes=[at(edges[kept])],
            columns=[
                *scalars(np.tile(place + apart, (len(shown), 1))),
                *rr.SeriesLines.columns(colors=shown.repeat(lines, axis=0)).partition(
                    np.full(len(shown), lines)
                ),
            ],
        )


def blank(rgba: NDArray[np.uint8], known: Mask) -> NDArray[np.uint8]:
    """Colours without those of columns of which nothing is known, shape (rows, columns, 4)."""
    return np.where(known[None, :, None], rgba, np.array(EMPTY, dtype=np.uint8))
