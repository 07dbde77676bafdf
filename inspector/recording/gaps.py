"""Gaps of a run in a recording: hatched, in every panel over time."""

import numpy as np
import rerun as rr

from inspector import colors
from inspector.analysis.moments import gaps
from inspector.recording import series
from noisemodel import Run

HATCHES = 6
"""Strokes of a gap."""


def log_gaps(
    recording: rr.RecordingStream, path: str, run: Run, between: tuple[float, float]
) -> None:
    """Hatch the gaps of a run in a plot, by a line that goes up and down.

    Args:
        recording: Where to.
        path: Entity path of the plot.
        run: The run.
        between: Lower and upper end of the plot.
    """
    found = gaps(run)
    if found:
        times = [np.append(np.linspace(*gap, HATCHES + 1), gap[1]) for gap in found]
        stroke = np.append(np.resize(between, HATCHES + 1), np.nan)
        line = np.tile(stroke, len(found))[:, None]
        shade, names = [colors.CLASSES["unknown"]], ["gap: no samples"]
        path = f"{path}/gap"
        series.log_lines(recording, path, np.concatenate(times), line, names=names, colours=shade)
