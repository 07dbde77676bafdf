"""Found and annotated classes in a recording: lanes, scores, events."""

from collections.abc import Iterator

import numpy as np
import rerun as rr

from inspector import colors
from inspector.analysis.analyse import Analysis
from inspector.recording import series
from inspector.report.markdown import sentence
from models import Event, Labels
from noisemodel import Block


def log(recording: rr.RecordingStream, analysis: Analysis) -> None:
    """Log what a model found, and what somebody annotated.

    Args:
        recording: Where to.
        analysis: The run with its labels and blocks.
    """
    run, labels = analysis.run, analysis.labels
    annotated = {block.label for block in run.blocks}
    known = () if labels is None else labels.classes
    colours = colors.of_classes((*known, *sorted(annotated - set(known))))
    if labels is not None:
        heard = (*known, *sorted(set(labels.label.tolist()) - set(known)))
        shown = colors.of_classes(heard)
        series.log_lane(recording, "/class/found", list(_stretches(labels)), shown)
        _log_scores(recording, labels, colours)
    if run.blocks:
        lane = [(block.start, block.stop, block.label) for block in run.blocks]
        series.log_lane(recording, "/class/annotated", lane, colours)
    _log_events(recording, analysis, colours)


def _stretches(labels: Labels) -> Iterator[tuple[float, float, str]]:
    """Give each frame the time around its centre, up to halfway to its neighbours."""
    centres = (labels.start + labels.stop) / 2
    hop = float(np.median(np.diff(centres))) if len(centres) > 1 else 0.1
    halfway = (centres[1:] + centres[:-1]) / 2
    apart = np.diff(centres) > 1.5 * hop
    begins = np.where(apart, centres[1:] - hop / 2, halfway)
    ends = np.where(apart, centres[:-1] + hop / 2, halfway)
    yield from zip(
        [*(centres[:1] - hop / 2), *begins],
        [*ends, *(centres[-1:] + hop / 2)],
        map(str, labels.debounced),
        strict=True,
    )


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
    found: list[tuple[str, str, Event | Block]] = [
        ("WARN", "found", event) for event in analysis.findings
    ]
    found += [("INFO", "annotated", block) for block in analysis.run.blocks if block.label != "ok"]
    rows = sorted(found, key=lambda row: row[2].start)
    if rows:
        recording.send_columns(
            "/events",
            indexes=[series.at(np.array([event.start for _, _, event in rows]))],
            columns=rr.TextLog.columns(
                text=[f"{how}: {sentence(analysis, event)}" for _, how, event in rows],
                level=[level for level, _, _ in rows],
                color=np.array([(*colours[event.label], 255) for *_, event in rows], np.uint8),
            ),
        )
