"""Found and annotated classes in a recording: lanes, scores, events."""

from collections.abc import Sequence
from typing import TypeAlias

import rerun as rr

from inspector import colors
from inspector.analysis.analyse import Analysis
from inspector.recording import series
from inspector.report.markdown import sentence
from models import Event, Labels
from noisemodel import Block, Run

Lane: TypeAlias = Sequence[tuple[float, float, str]]
"""Start and stop in [s] and class of stretches in order of time."""


def log(recording: rr.RecordingStream, analysis: Analysis) -> None:
    """Log the classes that a model found, and those that are annotated.

    Args:
        recording: Where to.
        analysis: The run with its labels and blocks.
    """
    run, labels = analysis.run, analysis.labels
    colours = colours_of(analysis)
    if labels is not None:
        series.log_lane(recording, "/class/found", analysis.lane, colours)
        _log_scores(recording, labels, colours)
    if run.blocks:
        series.log_lane(recording, "/class/annotated", annotated(run), colours)
    _log_events(recording, analysis, colours)


def colours_of(*sides: Analysis) -> dict[str, colors.Color]:
    """The colours of all classes of runs, found or annotated, those of their models first."""
    known = dict.fromkeys(name for side in sides if side.labels for name in side.labels.classes)
    others = {name for side in sides for *_, name in (*side.lane, *annotated(side.run))}
    others |= {event.label for side in sides for event in side.findings}
    return colors.of_classes((*known, *sorted(others - set(known))))


def annotated(run: Run) -> Lane:
    """The annotated blocks of a run."""
    return [(block.start, block.stop, block.label) for block in run.blocks]


def _log_scores(
    recording: rr.RecordingStream, labels: Labels, colours: dict[str, colors.Color]
) -> None:
    centres = (labels.start + labels.stop) / 2
    for index, name in enumerate(labels.classes):
        score = labels.scores[:, index : index + 1]
        series.log_lines(
            recording, f"/score/{name}", centres, score, names=[name], colours=[colours[name]]
        )


def _log_events(
    recording: rr.RecordingStream, analysis: Analysis, colours: dict[str, colors.Color]
) -> None:
    """List the failures that were found and annotated, by time: findings are warnings."""
    rows: list[tuple[str, Event | Block]] = [("found", event) for event in analysis.findings]
    rows += [("annotated", block) for block in analysis.run.blocks if block.label != "ok"]
    rows.sort(key=lambda row: row[1].start)
    if rows:
        series.log_events(
            recording,
            [event.start for _, event in rows],
            [f"{how}: {sentence(analysis, event)}" for how, event in rows],
            [colours[event.label] for _, event in rows],
            warnings=[how == "found" for how, _ in rows],
        )
