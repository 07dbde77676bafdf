"""Found and annotated classes in a recording: a row for each class, scores, events."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import rerun as rr
from rerun.components import MarkerShapeLike

from inspector import colors
from inspector.analysis.analyse import Analysis
from inspector.analysis.moments import gaps
from inspector.recording import axes, series, unstable
from inspector.recording.axes import Label, Panel
from inspector.recording.gaps import log_gaps
from inspector.report.markdown import brief, classes_of, finding_of, spoken
from noiseclassifier import Event, Labels
from noisemodel import Block, Run

Lane: TypeAlias = Sequence[tuple[float, float, str]]
"""Start and stop in [s] and class of stretches in order of time."""
ROW = 20.0
"""Height of a class, in points."""
FOUND, ANNOTATED = (0.10, 0.62), (0.68, 0.88)
"""From where to where in its row each is drawn, from above."""
MARKERS: tuple[MarkerShapeLike, ...] = (
    "Diamond",
    "Square",
    "Up",
    "Circle",
    "Cross",
    "Plus",
    "Down",
    "Asterisk",
)
"""Of the classes, so that a finding shorter than a pixel is seen."""


def log(recording: rr.RecordingStream, analysis: Analysis) -> Panel | None:
    """Log the classes that a model found, and those that are annotated.

    Args:
        recording: Where to.
        analysis: The run with its labels and blocks.

    Returns:
        The panel of the rows; None if nothing was found or annotated.
    """
    run, labels = analysis.run, analysis.labels
    colours = colours_of(analysis)
    if labels is not None:
        _log_scores(recording, labels, colours)
    _log_events(recording, analysis, colours)
    names = classes_of(analysis)
    if not names:
        return None
    lost = gaps(run)
    count = len(names) + bool(lost)
    panel = Panel("class", ROW * count + axes.AXIS)
    for row, name in enumerate(names):
        found = _found(analysis, name)
        blocks = [(block.start, block.stop) for block in run.blocks if block.label == name]
        _log_row(recording, "found", name, found, colours[name], (row, count), FOUND)
        _log_row(recording, "annotated", name, blocks, axes.INK, (row, count), ANNOTATED)
    _log_marks(recording, analysis, names, colours, count)
    if lost:
        log_gaps(recording, "/class", run, (0.1 * axes.TOP / count, 0.9 * axes.TOP / count))
    shown = [(spoken(name), readable(colours[name])) for name in names]
    shown += [("gap: no samples", axes.INK)] * bool(lost)
    places = axes.rows([name for name, _ in shown])
    named = [replace(at, color=shade) for at, (_, shade) in zip(places, shown, strict=True)]
    axes.log_left(recording, panel, named)
    both = labels is not None and bool(run.blocks)
    told = [Label(0.8, "thick:\nfound"), Label(0.3, "thin:\nannotated")] if both else []
    only = "found" if labels is not None else "annotated"
    axes.log_right(recording, panel, told or [Label(0.5, only)])
    return panel


def colours_of(*sides: Analysis) -> dict[str, colors.Color]:
    """The colours of all classes of runs, found or annotated, those of their models first."""
    known = dict.fromkeys(name for side in sides if side.labels for name in side.labels.classes)
    others = {name for side in sides for *_, name in (*side.lane, *annotated(side.run))}
    others |= {event.label for side in sides for event in side.findings}
    return colors.of_classes((*known, *sorted(others - set(known))))


def annotated(run: Run) -> Lane:
    """The annotated blocks of a run."""
    return [(block.start, block.stop, block.label) for block in run.blocks]


def readable(color: colors.Color) -> colors.Color:
    """A colour that text is legible in on a dark background: half as far from white."""
    red, green, blue = (round((channel + 255) / 2) for channel in color)
    return red, green, blue


def log_shades(
    recording: rr.RecordingStream, path: str, analysis: Analysis, between: tuple[float, float]
) -> None:
    """Shade the findings in a plot, each in the colour of its class.

    Args:
        recording: Where to.
        path: Entity path below which each class has its own.
        analysis: The run.
        between: Lower and upper end of the plot.
    """
    colours = colours_of(analysis)
    for name in dict.fromkeys(event.label for event in analysis.findings):
        unstable.log_stretches(
            recording,
            f"{path}/{name}",
            series.TIMELINE,
            [(event.start, event.stop) for event in analysis.findings if event.label == name],
            between=between,
            name=f"found: {spoken(name)}",
            color=colours[name],
        )


def _found(analysis: Analysis, name: str) -> list[tuple[float, float]]:
    """When a class was found: findings as they are reported, and what else frames cover."""
    events = [(event.start, event.stop) for event in analysis.findings if event.label == name]
    return events + [(start, stop) for start, stop, label in analysis.lane if label == name]


def _log_row(
    recording: rr.RecordingStream,
    how: str,
    name: str,
    stretches: Sequence[tuple[float, float]],
    color: colors.Color,
    place: tuple[int, int],
    between: tuple[float, float],
) -> None:
    if stretches:
        row, count = place
        upper, lower = (axes.TOP * (1.0 - (row + share) / count) for share in between)
        unstable.log_stretches(
            recording,
            f"/class/{how}/{name}",
            series.TIMELINE,
            stretches,
            between=(lower, upper),
            name=f"{how}: {spoken(name)}",
            color=color,
            opaque=True,
        )


def _log_marks(
    recording: rr.RecordingStream,
    analysis: Analysis,
    names: Sequence[str],
    colours: Mapping[str, colors.Color],
    count: int,
) -> None:
    for row, name in enumerate(names):
        events = [event for event in analysis.findings if event.label == name]
        if events:
            place = axes.TOP * (1.0 - (row + sum(FOUND) / 2) / count)
            points = rr.SeriesPoints(
                names=[spoken(name)],
                colors=[colours[name]],
                markers=[MARKERS[row % len(MARKERS)]],
                marker_sizes=[4.0],
            )
            recording.log(f"/class/mark/{name}", points, static=True)
            recording.send_columns(
                f"/class/mark/{name}",
                indexes=[series.at(np.array([event.start for event in events]))],
                columns=series.scalars(np.full(len(events), place)),
            )


def _log_scores(
    recording: rr.RecordingStream, labels: Labels, colours: dict[str, colors.Color]
) -> None:
    centres = (labels.start + labels.stop) / 2
    for index, name in enumerate(labels.classes):
        score = labels.scores[:, index : index + 1]
        names, shade = [spoken(name)], [colours[name]]
        series.log_lines(recording, f"/score/{name}", centres, score, names=names, colours=shade)


def events(analysis: Analysis) -> list[tuple[str, Event | Block]]:
    """List findings, and annotated failures that were not found, by time."""
    rows: list[tuple[str, Event | Block]] = [("found", event) for event in analysis.findings]
    missed = "annotated" if analysis.labels is None else "not found"
    rows += [
        (missed, block)
        for block in analysis.run.blocks
        if block.label != "ok" and finding_of(analysis, block) is None
    ]
    return sorted(rows, key=lambda row: row[1].start)


def _log_events(
    recording: rr.RecordingStream, analysis: Analysis, colours: dict[str, colors.Color]
) -> None:
    """List events: findings are warnings."""
    rows = events(analysis)
    if rows:
        series.log_events(
            recording,
            [event.start for _, event in rows],
            [f"{how}: {brief(analysis, event)}" for how, event in rows],
            [colours[event.label] for _, event in rows],  # legible in light themes, too
            warnings=[how == "found" for how, _ in rows],
        )
