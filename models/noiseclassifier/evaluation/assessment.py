"""The assessment: all measures of a model on recordings, with confidence intervals."""

import typing
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from math import isnan
from typing import Any

import numpy as np

from noiseclassifier.classifier import Classifier
from noiseclassifier.errors import DatasetError, SeenError, SignalError
from noiseclassifier.evaluation import eventmeasures, eventscore, framescore, protocol
from noiseclassifier.evaluation.calibration import Reliability, reliability
from noiseclassifier.evaluation.eventmeasures import EventMeasures
from noiseclassifier.evaluation.eventscore import EventScore
from noiseclassifier.evaluation.framescore import FrameScore
from noiseclassifier.evaluation.intervals import LEAST_GROUPS, Estimate, Resampling
from noiseclassifier.evaluation.matching import Matched, with_frames
from noiseclassifier.evaluation.outcomes import FALSE
from noiseclassifier.evaluation.predictions import (
    UNNAMED,
    Localise,
    Predictions,
    Unanswered,
    predict,
)
from noiseclassifier.evaluation.protocol import Protocol
from noiseclassifier.evaluation.protocoltable import lines_of
from noiseclassifier.evaluation.tradeoff import TradeOff, trade_off
from noiseclassifier.labels import interval
from noiseclassifier.recording import Recording
from noiseclassifier.signals import named
from noiseclassifier.splitting import seen
from noiseclassifier.types import Array

FORMAT = "noise-evaluation/2"
ADVICE = "measure it on other runs, or accept them with a remark in the report (--seen-too)"
WORDS = ("of", "measure", "class", "robot", "domain", "scenario")
"""Columns of the table of Arrow that name a row."""
BUDGETS = (5.0, 20.0, 100.0)
"""False-alarm budgets, per hour, at which recall is read from the trade-off."""


class Model(typing.Protocol):
    """What is assessed: a model of one rate, or of any."""

    @property
    def runs(self) -> Mapping[str, str]:
        """SHA-256 of each training recording, by name."""

    def at(self, rate: float, signals: Collection[str], /) -> Classifier:
        """The model for a sample rate, in [Hz], and for signals by name."""


@dataclass(frozen=True, eq=False)
class Assessment:
    """All measures of a model.

    Attributes:
        runs: How many recordings.
        groups: How many groups of them that share their motion.
        blocks: Annotated blocks of each class.
        runs_with: Recordings with such a block, of each class.
        copies: Recordings that were left out, and the equal one of each, by name.
        seen: Recordings that the model was trained on, and what of them, by name.
        protocol: Measures of the findings as they are reported, robots weighed alike.
        frames: Measures of the frames that are cut from blocks.
        events: Measures of whole recordings.
        by_robot: The same of each robot alone.
        score: The events themselves.
        trade_off: Counts at falling thresholds.
        at_budgets: For each false-alarm budget, recall of failure frames and failures found.
        reliability: Confidence and truth; None if the scores are no probabilities.
        calibration_error: Expected calibration error; None likewise.
    """

    runs: int
    groups: int
    blocks: dict[str, int]
    runs_with: dict[str, int]
    copies: dict[str, str]
    seen: dict[str, str]
    protocol: Protocol
    frames: FrameScore
    events: EventMeasures
    by_robot: dict[str, EventMeasures]
    score: EventScore
    trade_off: TradeOff
    at_budgets: dict[float, tuple[Estimate, Estimate]]
    reliability: Reliability | None
    calibration_error: Estimate | None

    def as_dict(self) -> dict[str, Any]:
        """All measures for JSON, None where undefined."""
        evaluation, table = self.frames.evaluation, self.reliability
        return {
            "format": FORMAT,
            "runs": self.runs,
            "groups": self.groups,
            "blocks": self.blocks,
            "runs_with": self.runs_with,
            "copies": self.copies,
            "seen": self.seen,
            "protocol": self.protocol.as_dict(),
            "classes": list(evaluation.classes),
            "confusion": evaluation.confusion.tolist(),
            "frames": self.frames.as_dict(),
            "events": self.events.as_dict(),
            "by_robot": {robot: each.as_dict() for robot, each in self.by_robot.items()},
            "at_budgets": [
                {
                    "false_alarms_per_hour": budget,
                    "failure_recall": recall.as_dict(),
                    "events_found": found.as_dict(),
                }
                for budget, (recall, found) in self.at_budgets.items()
            ],
            "calibration_error": self.calibration_error and self.calibration_error.as_dict(),
            "reliability": table and _columns(table.table()),
            "curve": _columns(self.trade_off.curve()),
            "missed": self.score.missed(),
            "false_alarms": self.score.false_alarms(),
        }

    def to_arrow(self) -> Any:
        """All measures as a table of Arrow in long form; needs pyarrow.

        Returns:
            A ``pyarrow.Table`` with one row for each measure, and of it for each class and robot.
            Columns: ``of`` (protocol, pooled or chance, frames, events or scores), ``measure``,
            ``class``, ``robot``, ``domain``, ``scenario``, ``budget`` in false alarms per hour,
            ``value``, ``low``, ``high``, ``runs`` and ``groups``; null where undefined.
        """
        import pyarrow as pa

        rows = _protocol_rows(self.protocol)
        rows += [*_rows("frames", vars(self.frames)), *_rows("events", vars(self.events))]
        for robot, events in self.by_robot.items():
            rows += _rows("events", vars(events), robot=robot)
        for budget, (recall, found) in self.at_budgets.items():
            measures = {"failure_recall": recall, "events_found": found}
            rows += _rows("scores", measures, budget=budget)
        rows += _rows("scores", {"calibration_error": self.calibration_error})
        columns = {name: pa.string() for name in WORDS}
        columns |= {name: pa.float64() for name in ("budget", "value", "low", "high")}
        columns |= {name: pa.int64() for name in ("runs", "groups")}
        return pa.Table.from_pylist(rows, schema=pa.schema(columns))

    def __str__(self) -> str:
        return table(self)


def assess(
    model: Model,
    recordings: Iterable[Recording | Unanswered],
    *,
    seen_too: bool = False,
    localise: Localise | None = None,
) -> Assessment:
    """Assessment of a model on recordings, each of which is released once it is classified.

    Args:
        model: The model.
        recordings: Annotated noise at its rate, or at any for a general model, each of another
            name. Of recordings that are equal bit for bit, the first counts. Those that have no
            verdict, because they came as such, do not fit the model, or have no frame without a
            gap, are listed.
        seen_too: Whether recordings count that the model was trained on, or that share their
            motion with such; the assessment lists them.
        localise: Estimates onset and end of the findings; else they last as their frames do.

    Returns:
        All measures.

    Raises:
        SeenError: If the model was trained on a recording, unless ``seen_too``.
        DatasetError: If there is no annotated frame, no recording has a verdict, or a name repeats.
        ModelsError: If a recording has another rate, or a label that is no class.
    """
    predictions: dict[str, Predictions] = {}
    unanswered: dict[str, Unanswered] = {}
    first, copies, known = dict[str, str](), dict[str, str](), dict[str, str]()
    for recording in recordings:
        name = recording.name
        if name in predictions or name in copies or name in unanswered:
            raise DatasetError(f"two recordings are called {name!r}; name them apart")
        if isinstance(recording, Unanswered):
            unanswered[name] = recording
            continue
        digest = recording.sha256
        known |= seen(model.runs, {name: digest})
        if known and not seen_too:
            raise SeenError(known, 1, ADVICE)
        if digest in first:
            copies[name] = first[digest]
        else:
            first[digest] = name
            try:
                bound = model.at(recording.rate, named(recording.signal))
                found = predict(bound, recording, localise)
                if bound.profile.reference:  # which frames that are cut out of blocks do not have
                    found = with_frames(found)
                reason = "" if len(found.labels) else NO_FRAME
            except SignalError as error:
                reason = str(error)
            if reason:
                unanswered[name] = Unanswered(name, recording.facts, reason)
            else:
                predictions[name] = found
    return measure(
        tuple(predictions.values()),
        unanswered=tuple(unanswered.values()),
        copies=copies,
        known=known,
    )


def measure(
    predictions: Sequence[Predictions],
    *,
    unanswered: Sequence[Unanswered] = (),
    copies: Mapping[str, str] | None = None,
    known: Mapping[str, str] | None = None,
) -> Assessment:
    """Assessment of predictions.

    Args:
        predictions: Of a model, on recordings.
        unanswered: Recordings without a verdict.
        copies: Recordings that were left out, and the equal one of each.
        known: Recordings that the model was trained on, and what of them.

    Returns:
        All measures.

    Raises:
        DatasetError: If there is no annotated frame, or no recording has a verdict.
    """
    if unanswered and not predictions:
        first = unanswered[0]
        raise DatasetError(
            f"none of {len(unanswered)} recordings has a verdict; {first.name}: {first.reason}"
        )
    if not any(len(one.truth) for one in predictions):
        raise DatasetError(f"no annotated frame in {len(predictions)} recordings; annotate blocks")
    groups = [one.group for one in predictions]
    resampling, matched = Resampling.of(groups), Matched.of(predictions)
    events, curve, table = eventscore.score(matched), trade_off(matched), reliability(matched)
    robots = np.array([one.origin.robot for one in predictions])
    frames = framescore.score(predictions, resampling)
    owned = {
        label: [sum(block.label == label for block in one.blocks) for one in predictions]
        for label in frames.evaluation.classes
    }
    return Assessment(
        runs=len(predictions),
        groups=len(set(groups)),
        blocks={label: sum(counts) for label, counts in owned.items()},
        runs_with={label: sum(map(bool, counts)) for label, counts in owned.items()},
        copies=dict(copies or {}),
        seen=dict(known or {}),
        protocol=protocol.measure(predictions, resampling, unanswered),
        frames=frames,
        events=eventmeasures.measure(events, resampling),
        by_robot={
            robot: eventmeasures.measure(events, resampling, robots == robot)
            for robot in sorted(set(robots.tolist()) - {UNNAMED})
        },
        score=events,
        trade_off=curve,
        at_budgets=dict(zip(BUDGETS, curve.at_budgets(BUDGETS, resampling), strict=True)),
        reliability=table,
        calibration_error=table.error(resampling) if table else None,
    )


def _protocol_rows(found: Protocol) -> list[dict[str, Any]]:
    """Rows of the protocol: means over robots, runs pooled, by chance, and parts of the runs."""
    ranking = {"auc": found.auc, "pauc": found.pauc, "official_score": found.official}
    rows = _rows("protocol", {**found.alike, **ranking, "not_answered": found.not_answered})
    rows += _rows("pooled", found.pooled)
    rows += _rows("chance", found.by_chance)
    for key in ("robot", "domain"):
        for name, part in found.by[key].items():
            rows += _rows("protocol", part.measures, **{key: name})
    for second, parts in (("domain", found.cells), ("scenario", found.cases)):
        for (robot, name), part in parts.items():
            rows += _rows("protocol", part.measures, robot=robot, **{second: name})
    for name, ranked in found.ranked.items():
        rows += _rows("protocol", {"auc": ranked.auc, "pauc": ranked.pauc}, domain=name)
    return rows


def _rows(of: str, measures: Mapping[str, Any], **keys: str | float) -> list[dict[str, Any]]:
    """Rows of the measures that are estimates, estimates by class, or plain numbers."""
    rows = []
    for measure, found in measures.items():
        for label, each in found.items() if isinstance(found, dict) else [(None, found)]:
            row = {"of": of, "measure": measure, "class": label, **keys}
            if isinstance(each, Estimate):
                rows.append(row | each.as_dict())
            elif isinstance(each, (int, float)):
                rows.append(row | {"value": None if isnan(each) else float(each)})
    return rows


def _columns(table: Mapping[str, Array]) -> dict[str, list[float | None]]:
    return {
        name: [None if np.isnan(value) else float(value) for value in column]
        for name, column in table.items()
    }


NAME, CELL, COUNT = 24, 27, 10
"""Widths of the columns: names, figures with intervals, plain numbers."""
NO_FRAME = "no frame without a gap"
SHOWN = 5
"""Lines at most of missed failures, and of false alarms."""


def table(assessment: Assessment, by: str = "") -> str:
    """Table of an assessment, as text: the protocol first, then all other measures.

    Args:
        assessment: The measures.
        by: ``robot``, ``domain`` or ``scenario``: the one table of parts to print, whole.

    Returns:
        Lines of up to 140 characters.
    """
    parts = [_errors, _frames, _events, _paper, _confusion, _scores, _foot]
    paragraphs = [_head(assessment), *lines_of(assessment.protocol, by)]
    paragraphs += [lines for part in parts if (lines := part(assessment))]
    return "\n\n".join("\n".join(lines) for lines in paragraphs)


def percent(estimate: Estimate) -> str:
    """A share as text: ``97.9% [96.1, 98.8]``."""
    return _figure(estimate, lambda value: f"{100 * value:.1f}", "%")


def number(estimate: Estimate, unit: str = "") -> str:
    """A number of any unit as text: ``0.14 s [0.12, 0.15]``."""

    def text(value: float) -> str:
        return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"

    return _figure(estimate, text, f" {unit}" if unit else "")


def _head(assessment: Assessment) -> list[str]:
    counts, by = assessment.protocol.counts, assessment.protocol.by
    lines = [
        f"{_many(assessment.runs, 'run')} in {_many(assessment.groups, 'group')} (runs of a group"
        f" share their motion) of {_named(by['robot'], 'robot')} in"
        f" {_named(by['domain'], 'domain')}",
        f"{_many(int(counts['faults']), 'injected fault')} ({counts['felt']:.0f} felt),"
        f" {counts['ok_hours']:.3g} h of ok time, {counts['unlabelled_hours']:.3g} h unlabelled",
    ]
    if assessment.seen:
        lines += [
            f"NOT A TEST: {len(assessment.seen)} of these runs were trained on, or share their"
            " motion with such:",
            *_few([f"  {name}: {what}" for name, what in assessment.seen.items()]),
        ]
    if assessment.copies:
        lines += [
            "left out, since they equal others bit for bit:",
            *_few([f"  {name} ({other})" for name, other in assessment.copies.items()]),
        ]
    return lines


def _frames(assessment: Assessment) -> list[str]:
    frames = assessment.frames
    counts = frames.evaluation.confusion.sum(axis=1).tolist()
    lines = [
        "Frames that are cut from annotated blocks, as the paper does",
        _row("", ["recall", "precision"], ["frames", "blocks", "runs"]),
    ]
    for label, count in zip(frames.evaluation.classes, counts, strict=True):
        figures = [percent(frames.recall[label]), percent(frames.precision[label])]
        behind = [count, assessment.blocks[label], assessment.runs_with[label]]
        lines.append(_row(label, figures, behind))
    return [
        *lines,
        _row("Balanced accuracy", [percent(frames.balanced_accuracy)]),
        _row("Failure recall", [percent(frames.failure_recall)]),
        _row("False alarm rate", [percent(frames.false_alarm_rate)]),
    ]


def _events(assessment: Assessment) -> list[str]:
    events = assessment.events
    lines = [
        "Whole runs by frames and annotated blocks, robots not weighed (`noise-evaluation/1`)",
        _row("", ["found", "by its own name"], ["failures", "", "runs"]),
    ]
    for label, found in events.found.items():
        figures = [percent(found), percent(events.named[label])]
        lines.append(_row(label, figures, [assessment.blocks.get(label, 0), "", found.runs]))
    late = f"90th percentile {number(events.late_delay, 's')}"
    return [
        *lines,
        _row(
            "all failures",
            [percent(events.all_found), percent(events.all_named)],
            [len(assessment.score.found), "", events.all_found.runs],
        ),
        _row("Delay of onset", [f"median {number(events.delay, 's')}, {late}"]),
        _row("False alarms", [_per_hour(events.false_alarms, events.false_alarms_per_hour)]),
        _row(
            "Wrong stretches",
            [_per_hour(events.wrong_stretches, events.wrong_stretches_per_hour)],
        ),
        _row("Failure recall", [f"{percent(events.failure_recall)} of all frames"]),
        _row("False alarm rate", [f"{percent(events.false_alarm_rate)} of all frames"]),
    ]


def _errors(assessment: Assessment) -> list[str]:
    missed = [
        f"  {each['label']} in {each['run']}, {interval(each['start'], each['stop'])}"
        for each in assessment.protocol.missed()
        if each["felt"]
    ]
    false = [
        f"  {each['label']} in {each['run']}, {interval(each['start'], each['stop'])}"
        for each in assessment.protocol.alarms(FALSE)
    ]
    lines = ["Missed, of the faults that are felt", *_few(missed)] if missed else []
    return lines + (["False alarms", *_few(false)] if false else [])


def _scores(assessment: Assessment) -> list[str]:
    lines = [
        "NOT the operating point: trade-off with thresholds chosen on these very runs",
        _row("at most", ["failures found", "recall of frames"]),
    ]
    for budget, (recall, found) in assessment.at_budgets.items():
        title = f"{budget:g} false alarms per h"
        lines.append(_row(title, [percent(found), percent(recall)]))
    error = assessment.calibration_error
    figure = f"{percent(error)} in ten bins" if error else "- (the scores are no probabilities)"
    return [*lines, _row("Calibration error", [figure])]


def _paper(assessment: Assessment) -> list[str]:
    frames = assessment.frames
    evaluation = frames.evaluation
    ok = evaluation.confusion[[name == "ok" for name in evaluation.classes]].sum()
    lines = [
        "As the paper measures, in shares of ALL frames",
        _row("", ["false negative errors", "false positive errors"]),
    ]
    for label, negative in frames.false_negative_errors.items():
        figures = [percent(negative), percent(frames.false_positive_errors[label])]
        lines.append(_row(label, figures))
    nothing = f"(calling all frames ok: {ok / evaluation.frames:.1%})"
    return [
        *lines,
        _row("Failure detection rate", [percent(frames.failure_detection_rate), nothing]),
        _row("Subset accuracy", [percent(frames.subset_accuracy)]),
    ]


def _confusion(assessment: Assessment) -> list[str]:
    evaluation = assessment.frames.evaluation
    width = max(len(name) for name in evaluation.classes) + 2
    head = "Frames of row predicted".ljust(NAME)
    return [
        head + "".join(name.rjust(width) for name in evaluation.classes),
        *(
            name.ljust(NAME) + "".join(str(count).rjust(width) for count in row)
            for name, row in zip(evaluation.classes, evaluation.confusion.tolist(), strict=True)
        ),
    ]


def _foot(assessment: Assessment) -> list[str]:
    lines = ["Brackets are 95 % confidence intervals over groups of runs."]
    if assessment.groups < LEAST_GROUPS:
        lines.append(f"Measures of fewer than {LEAST_GROUPS} groups have none.")
    return lines


def _figure(estimate: Estimate, text: Callable[[float], str], unit: str) -> str:
    if isnan(estimate.value):
        return "-"
    bounds = f" [{text(estimate.low)}, {text(estimate.high)}]" if not isnan(estimate.low) else ""
    return f"{text(estimate.value)}{unit}{bounds}"


def _per_hour(count: int, rate: Estimate) -> str:
    return f"{count}, or {number(rate, 'per hour')} of ok motion"


def _row(name: str, figures: Sequence[str], counts: Sequence[object] = ()) -> str:
    line = name.ljust(NAME) + "".join(figure.ljust(CELL) for figure in figures)
    return (line + "".join(str(count).rjust(COUNT) for count in counts)).rstrip()


def _named(names: Iterable[str], what: str) -> str:
    """How many there are, with their names if they are few."""
    names = list(names)
    few = f" ({', '.join(names)})" if len(names) <= SHOWN else ""
    return f"{_many(len(names), what)}{few}"


def _few(lines: Sequence[str]) -> list[str]:
    rest = len(lines) - SHOWN
    return [*islice(lines, SHOWN), *([f"  and {rest} more"] if rest > 0 else [])]


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
