"""Found and annotated classes in a recording: lanes, scores, events."""

from typing import TypeAlias

import numpy as np
import rerun as rr

from inspector import colors
from inspector.analysis.analyse import Analysis
from inspector.recording import series
from inspector.report.markdown import sentence
from models import Event, Labels
from noisemodel import Block, Run

Lane: TypeAlias = list[tuple[float, float, str]]
"""Start and stop in [s] and class of stretches in order of time."""


def log(recording: rr.RecordingStream, inspection: Inspection) -> None:
    """Log the classes that a model found, and those that are annotated.

    Args:
        recording: Where to.
        analysis: The run with its labels and blocks.
    """
    run, labels = analysis.run, analysis.labels
    annotations = {block.label for block in run.blocks}
    known = () if labels is None else labels.classes
    colours = colors.of_classes((*known, *sorted(annotations - set(known))))
    if labels is not None:
        predicted = (*known, *sorted(set(labels.label.tolist()) - set(known)))
        series.log_lane(recording, "/class/found", found(labels), colors.of_classes(predicted))
        _log_scores(recording, labels, colours)
    if run.blocks:
        series.log_lane(recording, "/class/annotated", annotated(run), colours)
    _log_events(recording, analysis, colours)


def found(labels: Labels) -> Lane:
    """The class of each frame for the time around its centre, up to halfway to its neighbours."""
    centres = (labels.start + labels.stop) / 2
    hop = float(np.median(np.diff(centres))) if len(centres) > 1 else 0.1
    halfway = (centres[1:] + centres[:-1]) / 2
    apart = np.diff(centres) > 1.5 * hop
    starts = [*(centres[:1] - hop / 2), *np.where(apart, centres[1:] - hop / 2, halfway)]
    stops = [*np.where(apart, centres[:-1] + hop / 2, halfway), *(centres[-1:] + hop / 2)]
    return list(zip(starts, stops, map(str, labels.debounced), strict=True))


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
