"""Columns of a rerun recording: lines, events. Never row by row."""

from collections.abc import Sequence

import numpy as np
import rerun as rr

from inspector.colors import Color
from noisemodel.types import Array, Real

TIMELINE = "time"


def at(time: Array) -> rr.TimeColumn:
    """Index columns by seconds from the start of the run."""
    return rr.TimeColumn(TIMELINE, duration=np.round(time * 1e9).astype("timedelta64[ns]"))


def scalars(values: Real) -> list[rr.ComponentColumn]:
    """Make columns as ``rr.Scalars.columns`` does, at a third of its cost.

    Args:
        values: Shape (samples,) or (samples, series).
    """
    width = values[:1].size
    batch = rr.components.ScalarBatch(np.ascontiguousarray(values).ravel())
    edges = np.arange(len(values) + 1, dtype=np.int32) * np.int32(width)
    return [rr.ComponentColumn(rr.Scalars.descriptor_scalars(), batch, offsets=edges)]


def log_lines(
    recording: rr.RecordingStream,
    path: str,
    time: Array,
    values: Real,
    *,
    names: Sequence[str],
    colours: Sequence[Color],
) -> None:
    """Log one line or several that share their times.

    Args:
        recording: Where to.
        path: Entity path.
        time: Shape (samples,), in [s].
        values: Shape (samples, series).
        names: One per series, with its unit.
        colours: One per series.
    """
    style_lines(recording, path, names=names, colours=colours)
    recording.send_columns(path, indexes=[at(time)], columns=scalars(values))


def style_lines(
    recording: rr.RecordingStream, path: str, *, names: Sequence[str], colours: Sequence[Color]
) -> None:
    """Log how the lines of one entity are drawn; see `log_lines`."""
    # Rerun's default aggregation draws the mean of a pixel's extremes, which hides vibration.
    style = rr.SeriesLines(
        names=list(names),
        colors=list(colours),
        widths=[1.0] * len(names),
        aggregation_policy="MinMax",
    )
    recording.log(path, style, static=True)


def log_events(
    recording: rr.RecordingStream,
    time: Sequence[float],
    text: Sequence[str],
    colours: Sequence[Color],
    *,
    warnings: Sequence[bool] | None = None,
) -> None:
    """List events, a line of text each.

    Args:
        recording: Where to.
        time: When, in [s].
        text: One per event.
        colours: One per event.
        warnings: Which of them are warnings; without it, no event has a level.
    """
    level = None if warnings is None else ["WARN" if each else "INFO" for each in warnings]
    recording.send_columns(
        "/events",
        indexes=[at(np.array(time))],
        columns=rr.TextLog.columns(
            text=text, level=level, color=np.array([(*color, 255) for color in colours], np.uint8)
        ),
    )
