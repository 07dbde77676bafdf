"""The classes of both runs in a recording: lanes of each, a lane and a list of what changed."""

from collections.abc import Sequence
from itertools import pairwise

import rerun as rr

from inspector.pair.changes import NEW, Change
from inspector.pair.colors import KINDS
from inspector.pair.pair import Pair
from inspector.recording import classes, series


def log(recording: rr.RecordingStream, pair: Pair, found: Sequence[Change]) -> int:
    """Log found and annotated classes, and the changes.

    Args:
        recording: Where to.
        pair: The two runs.
        found: What changed between them.

    Returns:
        How many lanes there are.
    """
    every = classes.colours_of(*(side for _, side in pair.sides))
    lanes: dict[str, classes.Lane] = {}
    for name, side in pair.sides:
        if side.labels is not None:
            lanes[f"/class/{name}/found"] = side.lane
        if side.run.blocks:
            lanes[f"/class/{name}/annotated"] = classes.annotated(side.run)
    for path, lane in lanes.items():
        series.log_lane(recording, path, lane, every)
    if not found:
        return len(lanes)
    series.log_lane(recording, "/class/change", _one_at_a_time(found), KINDS)
    series.log_events(
        recording,
        [change.start for change in found],
        [str(change) for change in found],
        [every[change.label] for change in found],
        warnings=[change.kind == NEW for change in found],
    )
    return len(lanes) + 1


def _one_at_a_time(found: Sequence[Change]) -> classes.Lane:
    """Changes in one lane: new failures hide resolved ones, and these unchanged ones."""
    rank = list(KINDS)
    edges = sorted({edge for change in found for edge in (change.start, change.stop)})
    lane = []
    for start, stop in pairwise(edges):
        kinds = [c.kind for c in found if c.start <= start and stop <= c.stop]
        if kinds:
            lane.append((start, stop, min(kinds, key=rank.index)))
    return lane
