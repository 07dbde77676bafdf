"""The classes of both runs in a recording: a row for each, before above after; what changed."""

from collections.abc import Sequence

import rerun as rr

from inspector import colors
from inspector.analysis.analyse import Analysis
from inspector.pair.changes import NEW, Change
from inspector.pair.colors import SIDES
from inspector.pair.pair import Pair
from inspector.recording import axes, series, unstable
from inspector.recording.axes import Label, Panel
from inspector.report.markdown import classes_of, spoken

ROW, LEAST = 26.0, 50.0
"""Height of a class, and of all of them at least, in points."""
FOUND = {"before": (0.06, 0.34), "after": (0.52, 0.80)}
ANNOTATED = {"before": (0.37, 0.45), "after": (0.83, 0.91)}
"""From where to where in its row each side is drawn, from above."""


def log(recording: rr.RecordingStream, pair: Pair, found: Sequence[Change]) -> Panel:
    """Log found and annotated classes, and the changes.

    Args:
        recording: Where to.
        pair: The two runs.
        found: What changed between them.

    Returns:
        The panel of the classes.
    """
    names = [name for name in dict.fromkeys(_every(pair)) if name != "ok"]
    panel = Panel("class", max(ROW * len(names), LEAST) + axes.AXIS)
    for row, name in enumerate(names):
        for side, analysis in pair.sides:
            place = (row, len(names))
            _log_row(recording, f"{side}/found", name, _found(analysis, name), place, FOUND[side])
            blocks = [(b.start, b.stop) for b in analysis.run.blocks if b.label == name]
            _log_row(recording, f"{side}/annotated", name, blocks, place, ANNOTATED[side])
    titles = [Label(label.place, spoken(label.text)) for label in axes.rows(names)]
    axes.log_left(recording, panel, titles or [Label(0.5, "no failure\nin either run")])
    told = [Label(0.8, "before", color=SIDES["before"]), Label(0.45, "after", color=SIDES["after"])]
    if any(side.run.blocks for _, side in pair.sides):
        told.append(Label(0.1, "thin: annotated"))
    axes.log_right(recording, panel, told)
    if found:
        series.log_events(
            recording,
            [change.start for change in found],
            [str(change) for change in found],
            [_shade(change) for change in found],
            warnings=[change.kind == NEW for change in found],
        )
    return panel


def log_shades(
    recording: rr.RecordingStream,
    path: str,
    found: Sequence[Change],
    between: tuple[float, float],
) -> None:
    """Shade the changes in a plot, in the colour of the run that has them.

    Args:
        recording: Where to.
        path: Entity path below which each kind has its own.
        found: What changed.
        between: Lower and upper end of the plot.
    """
    for kind in dict.fromkeys(change.kind for change in found):
        own = [change for change in found if change.kind == kind]
        unstable.log_stretches(
            recording,
            f"{path}/{kind}",
            series.TIMELINE,
            [(change.start, change.stop) for change in own],
            between=between,
            name=kind,
            color=_shade(own[0]),
        )


def _shade(change: Change) -> colors.Color:
    shades = {"new": "after", "louder": "after", "resolved": "before", "quieter": "before"}
    return SIDES[shades[change.kind]] if change.kind in shades else axes.INK


def _every(pair: Pair) -> list[str]:
    known = [name for _, side in pair.sides for name in classes_of(side)]
    return [name for name in known if any(_occurs(side, name) for _, side in pair.sides)]


def _occurs(side: Analysis, name: str) -> bool:
    return bool(_found(side, name)) or any(block.label == name for block in side.run.blocks)


def _found(side: Analysis, name: str) -> list[tuple[float, float]]:
    """When a class was found: findings as they are reported, and what else frames cover."""
    events = [(event.start, event.stop) for event in side.findings if event.label == name]
    return events + [(start, stop) for start, stop, label in side.lane if label == name]


def _log_row(
    recording: rr.RecordingStream,
    how: str,
    name: str,
    stretches: Sequence[tuple[float, float]],
    place: tuple[int, int],
    between: tuple[float, float],
) -> None:
    if not stretches:
        return
    row, count = place
    upper, lower = (axes.TOP * (1.0 - (row + share) / count) for share in between)
    side = how.partition("/")[0]
    unstable.log_stretches(
        recording,
        f"/class/{how}/{name}",
        series.TIMELINE,
        stretches,
        between=(lower, upper),
        name=f"{how.replace('/', ', ')}: {spoken(name)}",
        color=SIDES[side],
        opaque=True,
    )
