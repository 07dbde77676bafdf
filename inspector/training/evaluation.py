"""The measures of a model on annotated runs, printed, as JSON and as a picture."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import noiseclassifier as nc
import noisemodel as nm
from inspector.analysis.analyse import extents
from inspector.colors import SERIES, Color, of_classes
from inspector.compare import picture
from inspector.progress import progress
from inspector.text import counted
from inspector.training.part import Part
from inspector.training.recordings import classified, count
from noiseclassifier import Assessment
from noisemodel.atomic import refuse_existing, replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from noiseclassifier.evaluation.intervals import Estimate

Located = tuple[tuple[nc.Event, ...], tuple[nc.Event, ...]]
"""Findings by their frames, and from onset to end."""


def evaluate(
    model: Path, inputs: Sequence[Path], *, part: Part = Part.ALL, seen_too: bool = False
) -> Assessment:
    """Measure a model.

    Args:
        model: A model file.
        inputs: Annotated runs or NoisyTest folders that it was not trained on.
        part: The part of the recordings to measure it on.
        seen_too: Whether to accept runs that it was trained on, or that share their motion with
            such.

    Returns:
        The measures of the protocol at the operating point that ships, those of the paper, of
        frames and of events.

    Raises:
        DatasetError: If it was trained on a run, unless ``seen_too``.
    """
    classifier = nc.load(model)
    rate = None if isinstance(classifier, nc.General) else classifier.rate
    source: dict[str, nm.Run | None] = {}

    def read() -> Iterator[nc.Recording | nc.Unanswered]:
        for recording, run in classified(inputs, rate, part):
            source.clear()  # one run at a time stays in memory
            source[recording.name] = run
            yield recording

    def localise(recording: nc.Recording, labels: nc.Labels) -> Located:
        return extents(source[recording.name] or _run(recording), labels)

    return nc.assess(
        classifier,
        progress(read(), "evaluate", total=count(inputs)),
        seen_too=seen_too,
        localise=localise,
    )


def _run(recording: nc.Recording) -> nm.Run:
    """A run of what a sample keeps: its joints, or its noise as the motion of one joint."""
    signals = nc.signals.named(recording.signal)
    desired = None
    if "measured_joints" in signals:
        velocity = signals["measured_joints"].T
        desired = signals["desired_joints"].T if "desired_joints" in signals else None
    else:
        velocity = nc.signals.stacked(recording.signal, (nc.NOISE,))[:, None]
    return nm.Run(
        time=recording.time,
        velocity=velocity,
        velocity_desired=desired,
        joint_names=tuple(f"joint{number}" for number in range(velocity.shape[1])),
        valid=recording.valid,
    )


@dataclass(frozen=True)
class Outputs:
    """The files to write; None is not written.

    Attributes:
        json: All measures, and each missed fault.
        picture: A PNG file.
        overwrite: Whether files that exist may be replaced.
    """

    json: Path | None = None
    picture: Path | None = None
    overwrite: bool = False

    def check(self) -> None:
        """Refuse files that cannot be written, before the work.

        Raises:
            OutputError: If a file exists and may not be replaced, or cannot be written.
            InspectorError: If matplotlib is not installed.
        """
        for path in filter(None, (self.json, self.picture)):
            refuse_existing(path, overwrite=self.overwrite)
        if self.picture:
            require()

    def write(self, assessment: Assessment, model: Path) -> None:
        """Write the files.

        Args:
            assessment: The measures.
            model: The file of the model.

        Raises:
            OutputError: If a file exists and may not be replaced, or cannot be written.
        """
        if self.json:
            with replacing(self.json, overwrite=self.overwrite) as temporary:
                temporary.write_text(as_json(assessment, model) + "\n", encoding="utf-8")
        if self.picture:
            draw(assessment, self.picture, title=model.stem, overwrite=self.overwrite)


def as_json(assessment: Assessment, model: Path) -> str:
    """The measures of a model as a JSON text.

    Args:
        assessment: The measures.
        model: The file of the model.
    """
    return dumps({"model": model.name, **assessment.as_dict()}, indent=1, allow_nan=False)


SIZE = (14.0, 5.0)
"""Width and height, in [inch]."""
DPI = 100
BLUE = SERIES[6]
GREY = "0.6"

require = picture.require


def draw(assessment: Assessment, path: Path, *, title: str, overwrite: bool = False) -> None:
    """Draw the measures of a model as a PNG file.

    Args:
        assessment: The measures.
        path: The file to write.
        title: The name of the model.
        overwrite: Whether a file that exists may be replaced.

    Raises:
        InspectorError: If matplotlib is not installed.
        OutputError: If the file exists or cannot be written.
    """
    require()
    from matplotlib.figure import Figure

    figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
    confusion, intervals, reliability = figure.subplots(1, 3, width_ratios=(4, 4, 3))
    _confusion(confusion, assessment)
    _intervals(intervals, assessment)
    _reliability(reliability, assessment)
    seen = f", NOT A TEST: {len(assessment.seen)} were trained on" if assessment.seen else ""
    figure.suptitle(
        f"{title}: {counted(assessment.runs, 'run')} of {counted(assessment.groups, 'group')},"
        f" {assessment.protocol.counts['ok_hours']:.3g} h of ok motion{seen}"
    )
    with replacing(path, overwrite=overwrite) as temporary:
        figure.savefig(temporary, format="png")


def _confusion(axes: "Axes", assessment: Assessment) -> None:
    """Draw the confusion matrix, each row in the colour of its class, shaded by share."""
    evaluation = assessment.frames.evaluation
    names, counts = evaluation.classes, evaluation.confusion
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    inks = np.array([_ink(color) for color in of_classes(names).values()])
    # The share is the opacity of the colour, on white.
    axes.imshow(1.0 - shares[..., None] * (1.0 - inks[:, None, :]), aspect="auto")
    for row, column in np.ndindex(counts.shape):
        text = f"{counts[row, column]}\n{shares[row, column]:.1%}" if counts[row, column] else "0"
        axes.text(column, row, text, ha="center", va="center", fontsize=9)
    axes.set_xticks(range(len(names)), names, fontsize=8)
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.set_xlabel("predicted")
    axes.set_title("Frames of annotated blocks (share of the row)", fontsize=10)


def _intervals(axes: "Axes", assessment: Assessment) -> None:
    frames, found = assessment.frames, assessment.protocol.pooled
    colors = of_classes(frames.evaluation.classes)
    rows: list[tuple[str, Estimate, Color]] = [
        (f"recall of {name}", each, colors[name]) for name, each in frames.recall.items()
    ]
    rows += [
        ("balanced accuracy", frames.balanced_accuracy, (0, 0, 0)),
        ("failure recall", frames.failure_recall, (0, 0, 0)),
        ("faults found", found["recall_injected"], (0, 0, 0)),
        ("faults found, if felt", found["recall_felt"], (0, 0, 0)),
        ("found with the right class", found["class_recall"], (0, 0, 0)),
        ("ok time flagged", found["ok_flagged"], (0, 0, 0)),
    ]
    rows = [row for row in rows if not np.isnan(row[1].value)]
    for place, (_, each, color) in enumerate(rows):
        axes.hlines(place, each.low, each.high, color=_ink(color), lw=6, alpha=0.55)
        axes.plot(each.value, place, "|", color="black", markersize=14, markeredgewidth=1.5)
    labels = [f"{name}\n{each.runs} runs, {each.groups} groups" for name, each, _ in rows]
    axes.set_yticks(range(len(rows)), labels, fontsize=8)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.grid(axis="x", alpha=0.4)
    axes.set_xlim(right=1.01)
    axes.set_title("Measures with their 95 % intervals", fontsize=10)


def _reliability(axes: "Axes", assessment: Assessment) -> None:
    axes.set_title("Reliability", fontsize=10)
    axes.set_xlabel("confidence")
    axes.set_ylabel("share of correct classes")
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.0)
    if assessment.reliability is None or assessment.calibration_error is None:
        axes.text(0.5, 0.5, "the scores are not probabilities", ha="center", va="center")
        return
    axes.plot([0.0, 1.0], [0.0, 1.0], "--", color=GREY, lw=1)
    table = assessment.reliability.table()
    width = table["high"] - table["low"]
    axes.bar(table["low"], table["right"], width, align="edge", color=_ink(BLUE), alpha=0.35)
    axes.plot(table["confidence"], table["right"], "o", color=_ink(BLUE))
    for x, y, frames in zip(table["confidence"], table["right"], table["frames"], strict=True):
        if frames:
            axes.annotate(f"{frames:.0f}", (x, y), (0, -12), textcoords="offset points", fontsize=7)
    error = assessment.calibration_error
    axes.text(0.03, 0.94, f"expected calibration error {error.value:.1%}")


def _ink(color: Color) -> tuple[float, float, float]:
    red, green, blue = color
    return red / 255.0, green / 255.0, blue / 255.0
