"""The classes of both runs in a recording: lanes of each, a lane and a list of what changed."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import rerun as rr

from inspector import colors
from inspector.analysis.analyse import Analysis
from inspector.pair.changes import CAME, Change
from inspector.pair.colors import KINDS
from inspector.pair.pair import Pair
from inspector.recording import series


def log(recording: rr.RecordingStream, pair: Pair, found: Sequence[Change]) -> int:
    """Log found and annotated classes, and the changes.

    Args:
        recording: Where to.
        pair: The two runs.
        found: What changed between them.

    Returns:
        How many lanes there are.
    """
    sides = [side for _, side in pair.sides]
    known = [name for side in sides if side.labels for name in side.labels.classes]
    annotated = sorted({block.label for side in sides for block in side.run.blocks})
    every = colors.of_classes(tuple(dict.fromkeys([*known, *annotated])))
    lanes = [
        (f"/class/{name}/{how}", stretches)
        for name, side in pair.sides
        for how, stretches in (("found", _found(side)), ("annotated", _annotated(side)))
        if stretches
    ]
    for path, stretches in lanes:
        series.log_lane(recording, path, stretches, every)
    if not found:
        return len(lanes)
    series.log_lane(recording, "/class/change", _one_at_a_time(found), KINDS)
    rgba = [(*every[change.label], 255) for change in found]
    recording.send_columns(
        "/events",
        indexes=[series.at(np.array([change.start for change in found]))],
        columns=rr.TextLog.columns(
            text=[str(change) for change in found],
            level=["WARN" if change.kind == CAME else "INFO" for change in found],
            color=np.array(rgba, np.uint8),
        ),
    )
    return len(lanes) + 1


def _found(side: Analysis) -> list[tuple[float, float, str]]:
    """Give each frame the time up to halfway to its neighbours, half a hop at most."""
    labels = side.labels
    if labels is None:
        return []
    centres = (labels.start + labels.stop) / 2
    hop = float(np.median(np.diff(centres))) if len(centres) > 1 else 0.1
    reach = 0.501 * hop  # frames that follow each other meet halfway, whatever rounding does
    halfway = (centres[1:] + centres[:-1]) / 2
    begins = np.maximum(np.append(-np.inf, halfway), centres - reach)
    ends = np.minimum(np.append(halfway, np.inf), centres + reach)
    return list(zip(begins.tolist(), ends.tolist(), map(str, labels.debounced), strict=True))


def _annotated(side: Analysis) -> list[tuple[float, float, str]]:
    return [(block.start, block.stop, block.label) for block in side.run.blocks]


def _one_at_a_time(found: Sequence[Change]) -> list[tuple[float, float, str]]:
    """Lay changes into one lane: what came hides what went, and that what stayed."""
    rank = list(KINDS)
    edges = sorted({edge for change in found for edge in (change.start, change.stop)})
    lane = []
    for start, stop in pairwise(edges):
        kinds = [c.kind for c in found if c.start <= start and stop <= c.stop]
        if kinds:
            lane.append((start, stop, min(kinds, key=rank.index)))
    return lane
