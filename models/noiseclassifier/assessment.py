"""The assessment of a model on recordings: all measures, as JSON and as text."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import isnan
from typing import Any

import numpy as np

from noiseclassifier.classifier import Classifier, Model
from noiseclassifier.dataset import Dataset, Examples, check
from noiseclassifier.errors import DatasetError, SignalError
from noiseclassifier.labels import Event, Labels, interval
from noiseclassifier.matching import FALSE, UNCLEAR, Predictions, Unanswered, within
from noiseclassifier.measures import (
    LEAST_GROUPS,
    RATES,
    WORST,
    Estimate,
    Evaluation,
    Part,
    Protocol,
    Resampling,
    calibration,
    frame_estimates,
    plain,
)
from noiseclassifier.recording import Recording, check_apart, group_of, seen
from noiseclassifier.signals import Array, named

FORMAT = "noise-evaluation/3"
ADVICE = "measure it on other runs, or accept them with a remark in the report (--seen-too)"
NO_FRAME = "no frame without a gap"
NAME, WIDE, NARROW = 38, 26, 12
"""Widths of the columns: names, figures with intervals, plain numbers."""
CLASS = 24
"""Width of the names of classes."""
SHOWN, ROWS_SHOWN = 5, 12
"""Most lines of a list, and most rows of a table by robot or domain; the JSON has all."""
LONGEST = 32
"""Characters of a name at most."""
ROWS = (
    ("False alarms per hour of ok time", "false_alarms_per_hour", "false_alarms"),
    ("  by findings unknown", "unknown_false_alarms_per_hour", "unknown_false_alarms"),
    ("Ok time flagged", "ok_flagged", ""),
    ("Alarms per hour of unlabelled time", "alarms_in_unlabelled_per_hour", "alarms_in_unlabelled"),
    ("Faults found, of all injected", "recall_injected", "found/faults"),
    ("Faults found, of detectable", "recall_felt", "found_felt/felt"),
    ("Onset right within 0.2 s, of found", "onset_within", "onset_close/found"),
    ("Events by class, precision", "class_precision", "matched_by_class/findings"),
    ("  recall", "class_recall", "matched_by_class/faults"),
    ("  F1", "class_f1", ""),
    ("Events of any class, precision", "any_precision", "matched/findings"),
    ("  recall", "any_recall", "matched/faults"),
    ("  F1", "any_f1", ""),
)
"""Title, measure and counts of each row."""
COLUMNS = (
    ("false/h", "false_alarms_per_hour"),
    ("ok flagged", "ok_flagged"),
    ("unlab./h", "alarms_in_unlabelled_per_hour"),
    ("found", "recall_injected"),
    ("detectable", "recall_felt"),
    ("F1 class", "class_f1"),
    ("delay", "delay"),
)


Localise = Callable[[Recording, Labels], tuple[tuple[Event, ...], tuple[Event, ...]]]
"""Gives the events of labels by their frames, and the same from onset to end."""


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
        evaluation: All frames that are cut from blocks.
        frames: Its measures with intervals, by name, and the measures of each class by class.
        reliability: Confidence beside truth in bins; None if the scores are no probabilities.
        calibration_error: Expected calibration error; None likewise.
    """

    runs: int
    groups: int
    blocks: dict[str, int]
    runs_with: dict[str, int]
    copies: dict[str, str]
    seen: dict[str, str]
    protocol: Protocol
    evaluation: Evaluation
    frames: dict[str, Any]
    reliability: dict[str, Array] | None
    calibration_error: Estimate | None

    def as_dict(self) -> dict[str, Any]:
        """All measures for JSON, None where undefined."""
        frames = {
            name: (
                {label: one.as_dict() for label, one in each.items()}
                if isinstance(each, dict)
                else each.as_dict()
            )
            for name, each in self.frames.items()
        }
        bins = {name: plain(each.tolist()) for name, each in (self.reliability or {}).items()}
        return {
            "format": FORMAT,
            "runs": self.runs,
            "groups": self.groups,
            "blocks": self.blocks,
            "runs_with": self.runs_with,
            "copies": self.copies,
            "seen": self.seen,
            "protocol": self.protocol.as_dict(),
            "classes": list(self.evaluation.classes),
            "confusion": self.evaluation.confusion.tolist(),
            "frames": {"frames": int(self.evaluation.frames), **frames},
            "calibration_error": self.calibration_error and self.calibration_error.as_dict(),
            "reliability": bins or None,
        }

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
        DatasetError: If the model was trained on a recording, unless ``seen_too``, there is no
            annotated frame, no recording has a verdict, or a name repeats.
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
        if not seen_too:
            check_apart(model.runs, {name: digest}, ADVICE)
        if digest in first:
            copies[name] = first[digest]
            continue
        first[digest] = name
        try:
            bound = model.at(recording.rate, named(recording.signal))
            found = predict(bound, recording, localise)
            reason = "" if len(found.labels) else NO_FRAME
        except SignalError as error:
            reason = str(error)
        if reason:
            unanswered[name] = Unanswered(name, recording.facts, reason)
        else:
            predictions[name] = found
    return measure(
        tuple(predictions.values()), tuple(unanswered.values()), copies=copies, known=known
    )


def predict(
    classifier: Classifier, recording: Recording, localise: Localise | None = None
) -> Predictions:
    """Predictions of a model on a recording, on its annotated blocks and from end to end.

    A recording whose blocks all lie in gaps has no frame of a block.

    Args:
        localise: Estimates onset and end of the findings; else they last as their frames do.
    """
    check(recording, classifier.profile)
    truth = predicted = np.array([], dtype=str)
    if not classifier.profile.reference:
        with suppress(DatasetError):  # no frame without a gap
            # Frames that are cut from blocks, as the paper does for validation.
            dataset = Dataset.of([recording], classifier.profile, training=False)
            truth, predicted = dataset.labels, classifier.predict(dataset.frames)
    labels = classifier.classify(
        recording.signal, recording.rate, start=recording.start, valid=recording.valid
    )
    found = Predictions(
        recording.name,
        group_of(recording.name),
        1.0 / recording.rate,
        within(recording),
        truth,
        predicted,
        labels,
        recording.events,
        recording.facts,
        localise(recording, labels) if localise and len(labels) else None,
    )
    if not classifier.profile.reference:
        return found
    # Frames that are cut out of blocks have no reference: those of the whole recording count.
    known = found.whole_truth != UNCLEAR
    return replace(found, truth=found.whole_truth[known], predicted=labels.label[known])


def measure(
    predictions: Sequence[Predictions],
    unanswered: Sequence[Unanswered] = (),
    *,
    copies: Mapping[str, str] | None = None,
    known: Mapping[str, str] | None = None,
) -> Assessment:
    """Assessment of predictions.

    Args:
        unanswered: Recordings without a verdict.
        copies: Recordings that were left out, and the equal one of each.
        known: Recordings that the model was trained on, and what of them.
    """
    if unanswered and not predictions:
        first = unanswered[0]
        raise DatasetError(
            f"none of {len(unanswered)} recordings has a verdict; {first.name}: {first.reason}"
        )
    if not any(len(one.truth) for one in predictions):
        raise DatasetError(f"no annotated frame in {len(predictions)} recordings; annotate blocks")
    groups = [one.group for one in predictions]
    resampling = Resampling.of(groups)
    evaluation, frames = frame_estimates(predictions, resampling)
    reliability, error = calibration(predictions, resampling) or (None, None)
    owned = {
        label: [sum(block.label == label for block in one.blocks) for one in predictions]
        for label in evaluation.classes
    }
    return Assessment(
        runs=len(predictions),
        groups=len(set(groups)),
        blocks={label: sum(counts) for label, counts in owned.items()},
        runs_with={label: sum(map(bool, counts)) for label, counts in owned.items()},
        copies=dict(copies or {}),
        seen=dict(known or {}),
        protocol=Protocol.of(predictions, resampling, unanswered),
        evaluation=evaluation,
        frames=frames,
        reliability=reliability,
        calibration_error=error,
    )


def evaluate(classifier: Classifier, dataset: Dataset) -> Evaluation:
    """Confusion matrix of a classifier on annotated frames, and all measures that follow from it.

    Labels that the classifier does not have count as missed.
    """
    return classifier.evaluate(Examples.of(dataset, classifier.profile))


# --- as text


def table(assessment: Assessment, by: str = "") -> str:
    """Table of an assessment, as text, in lines of up to 140 characters.

    Args:
        by: ``robot``, ``domain`` or ``scenario``: the one table of parts to print, whole.
    """
    protocol = assessment.protocol
    paragraphs = [_head(assessment), *protocol_lines(protocol, by), _errors(protocol)]
    paragraphs += [part(assessment) for part in (_frames, _paper, _confusion, _foot)]
    return "\n\n".join("\n".join(lines) for lines in paragraphs if lines)


def protocol_lines(protocol: Protocol, by: str = "") -> list[list[str]]:
    """Paragraphs of lines: the measures, where they are worst, and by robot and domain."""
    keys = [by] if by else [key for key in ("robot", "domain") if len(protocol.by[key]) > 1]
    parts = [_summary(protocol), _not_answered(protocol), _worst(protocol)]
    parts += [_table(protocol, key, whole=bool(by)) for key in keys]
    return [part for part in parts if part]


def percent(estimate: Estimate) -> str:
    """A share as text: ``97.9% [96.1, 98.8]``."""
    return _ranged(estimate, _share)


def number(estimate: Estimate, unit: str = "") -> str:
    """A number of any unit as text: ``0.14 s [0.12, 0.15]``."""
    text = _ranged(estimate, _rate)
    value, bracket, bounds = text.partition(" [")
    return f"{value} {unit}{bracket}{bounds}" if unit and text != "-" else text


def _head(assessment: Assessment) -> list[str]:
    counts, by = assessment.protocol.counts, assessment.protocol.by
    lines = [
        f"{_many(assessment.runs, 'run')} in {_many(assessment.groups, 'group')} (runs of a group"
        f" share their motion) of {_named(by['robot'], 'robot')} in"
        f" {_named(by['domain'], 'domain')}",
        f"{_many(int(counts['faults']), 'injected fault')} ({counts['felt']:.0f} detectable),"
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


def _summary(protocol: Protocol) -> list[str]:
    counts, delay = protocol.counts, protocol.pooled["delay"]
    lines = [
        "At the operating point that ships: findings as `inspector classify` reports them",
        _line("", ["robots alike", "all runs pooled"], ["by chance", "counts"]),
    ]
    for title, name, behind in ROWS:
        form = _rate if name in RATES else _share
        chance = protocol.by_chance.get(name)
        count = " of ".join(f"{counts[each]:.0f}" for each in behind.split("/")) if behind else ""
        figures = [_ranged(each[name], form) for each in (protocol.alike, protocol.pooled)]
        lines.append(_line(title, figures, ["" if chance is None else _share(chance), count]))
    late = _time(protocol.alike["late_delay"].value)
    figures = [f"{_time(protocol.alike['delay'].value)}, 90 %: {late}", _ranged(delay, _time)]
    lines.append(_line("Delay until a live listener knows", figures))
    for title, value in (
        ("AUC of runs, mean over domains", protocol.auc),
        ("pAUC (FPR up to 10 %)", protocol.pauc),
        ("Score of DCASE task 2 (harmonic mean)", protocol.official),
    ):
        lines.append(_line(title, [_share(value), ""], ["50.0%"]))
    runs = len(protocol.outcomes) + len(protocol.unanswered)
    count = f"{len(protocol.unanswered)} of {runs}"
    figures = [_share(protocol.not_answered), ""]
    return [*lines, _line("Runs without a verdict", figures, ["", count])]


def _not_answered(protocol: Protocol) -> list[str]:
    """Reasons why runs have no verdict, each with its runs and robots."""
    reasons: dict[str, list[str]] = {}
    for each in protocol.unanswered:
        reasons.setdefault(each.reason, []).append(each.origin["robot"])
    lines = []
    for reason, robots in reasons.items():
        names = sorted(set(robots))
        rest = f" and {len(names) - WORST} more" if len(names) > WORST else ""
        few = ", ".join(names[:WORST])
        lines.append(f"not answered: {_many(len(robots), 'run')} ({reason}) of {few}{rest}")
    return lines


def _worst(protocol: Protocol) -> list[str]:
    lines = []
    cases, cells = protocol.cases, protocol.cells
    if worst := protocol.worst(cases, "recall_injected"):
        lines.append(f"The worst {len(worst)} of robot and scenario, by injected faults found")
        for key in worst:
            counts = cases[key].counts
            found = (
                f"{counts['found']:.0f} of {counts['faults']:.0f} injected,"
                f" {counts['found_felt']:.0f} of {counts['felt']:.0f} detectable"
            )
            share = _share(cases[key].measures["recall_injected"])
            lines.append(_line("  " + _short(" ".join(key)), [share], [found]))
    for measure in ("false_alarms_per_hour", "alarms_in_unlabelled_per_hour"):
        if worst := protocol.worst(cells, measure):
            what = "unlabelled time" if "unlabelled" in measure else "ok time"
            lines.append(
                f"The worst {len(worst)} of robot and domain, by alarms per hour of {what}"
            )
            alarms, hours = RATES[measure]
            for key in worst:
                counts = cells[key].counts
                rate = f"{_rate(cells[key].measures[measure])} per hour"
                found = f"{counts[alarms]:.0f} in {counts[hours]:.3g} h"
                lines.append(_line("  " + _short(" ".join(key)), [rate], [found]))
    return lines


def _table(protocol: Protocol, key: str, *, whole: bool) -> list[str]:
    parts = protocol.by[key]
    names = list(parts)
    head = f"By {key}"
    lines = []
    if not whole and len(names) > ROWS_SHOWN:
        names = sorted(names, key=lambda name: _order(parts[name]))[:ROWS_SHOWN]
        lines = [f"By {key}, the worst {ROWS_SHOWN} of {len(parts)} by F1 of the class"]
        head = ""
    ranked = protocol.ranked if key == "domain" else {}
    titles = ["runs", "ok h", *(title for title, _ in COLUMNS)]
    titles += ["AUC", "pAUC"] if ranked else []
    lines.append(_cells(head, titles, titles))
    for name in names:
        part = parts[name]
        figures = [_figure(measure, part.measures[measure]) for _, measure in COLUMNS]
        if ranked:
            own = ranked.get(name)
            figures += [_share(own.auc), _share(own.pauc)] if own else ["-", "-"]
        runs = f"{part.counts['runs']:.0f}" + (f"+{part.unanswered}" if part.unanswered else "")
        figures = [runs, f"{part.counts['ok_hours']:.3g}", *figures]
        lines.append(_cells(_short(name), figures, titles))
    if any(part.unanswered for part in parts.values()):
        lines.append("(+n: runs without a verdict)")
    return lines


def _order(part: Part) -> float:
    value = part.measures["class_f1"]
    return 2.0 if isnan(value) else value


def _errors(protocol: Protocol) -> list[str]:
    lines = []
    for title, errors in (
        ("Missed, of the detectable faults", [e for e in protocol.missed() if e["felt"]]),
        ("False alarms", protocol.alarms(FALSE)),
    ):
        if errors:
            lines.append(title)
            lines += _few(
                [f"  {e['label']} in {e['run']}, {interval(e['start'], e['stop'])}" for e in errors]
            )
    return lines


def _frames(assessment: Assessment) -> list[str]:
    frames, evaluation = assessment.frames, assessment.evaluation
    lines = [
        "Frames that are cut from annotated blocks, as the paper does",
        _row("", ["recall", "precision"], ["frames", "blocks", "runs"]),
    ]
    for label, count in zip(evaluation.classes, evaluation.confusion.sum(axis=1), strict=True):
        figures = [percent(frames[name][label]) for name in ("recall", "precision")]
        behind = [count, assessment.blocks[label], assessment.runs_with[label]]
        lines.append(_row(label, figures, behind))
    error = assessment.calibration_error
    calibrated = f"{percent(error)} in ten bins" if error else "- (the scores are no probabilities)"
    return [
        *lines,
        _row("Balanced accuracy", [percent(frames["balanced_accuracy"])]),
        _row("Failure recall", [percent(frames["failure_recall"])]),
        _row("False alarm rate", [percent(frames["false_alarm_rate"])]),
        _row("Calibration error", [calibrated]),
    ]


def _paper(assessment: Assessment) -> list[str]:
    frames, evaluation = assessment.frames, assessment.evaluation
    ok = evaluation.confusion[[name == "ok" for name in evaluation.classes]].sum()
    errors = ("false_negative_errors", "false_positive_errors")
    nothing = f"(calling all frames ok: {ok / evaluation.frames:.1%})"
    return [
        "As the paper measures, in shares of ALL frames",
        _row("", [name.replace("_", " ") for name in errors]),
        *(
            _row(label, [percent(frames[name][label]) for name in errors])
            for label in evaluation.classes
        ),
        _row("Failure detection rate", [percent(frames["failure_detection_rate"]), nothing]),
        _row("Subset accuracy", [percent(frames["subset_accuracy"])]),
    ]


def _confusion(assessment: Assessment) -> list[str]:
    evaluation = assessment.evaluation
    width = max(len(name) for name in evaluation.classes) + 2
    head = "Frames of row predicted".ljust(CLASS)
    return [
        head + "".join(name.rjust(width) for name in evaluation.classes),
        *(
            name.ljust(CLASS) + "".join(str(count).rjust(width) for count in row)
            for name, row in zip(evaluation.classes, evaluation.confusion.tolist(), strict=True)
        ),
    ]


def _foot(assessment: Assessment) -> list[str]:
    lines = ["Brackets are 95 % confidence intervals over groups of runs."]
    if assessment.groups < LEAST_GROUPS:
        lines.append(f"Measures of fewer than {LEAST_GROUPS} groups have none.")
    return lines


# --- figures, rows and lists


def _share(value: float) -> str:
    return "-" if isnan(value) else f"{100.0 * value:.1f}%"


def _rate(value: float) -> str:
    return "-" if isnan(value) else f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"


def _time(value: float) -> str:
    return "-" if isnan(value) else f"{value:.3g} s"


def _figure(measure: str, value: float) -> str:
    if measure == "delay":
        return _time(value)
    return (_rate if measure in RATES else _share)(value)


def _ranged(estimate: Estimate, form: Callable[[float], str]) -> str:
    bounds = "" if isnan(estimate.low) else f" [{form(estimate.low)}, {form(estimate.high)}]"
    bounds = "" if isnan(estimate.value) else bounds.replace("%", "").replace(" s", "")
    return form(estimate.value) + bounds


def _line(name: str, figures: Sequence[str], others: Sequence[str] = ()) -> str:
    line = name.ljust(NAME) + "".join(figure.ljust(WIDE) for figure in figures)
    return (line + "".join(other.ljust(NARROW) for other in others)).rstrip()


def _row(name: str, figures: Sequence[str], counts: Sequence[object] = ()) -> str:
    line = name.ljust(CLASS) + "".join(figure.ljust(WIDE + 1) for figure in figures)
    return (line + "".join(str(count).rjust(NARROW - 2) for count in counts)).rstrip()


def _cells(name: str, cells: Sequence[str], titles: Sequence[str]) -> str:
    """A row, each cell as wide as its title or a figure."""
    widths = [max(len(title), 7) + 2 for title in titles]
    figures = (cell.rjust(width) for cell, width in zip(cells, widths, strict=True))
    return name.ljust(LONGEST) + "".join(figures)


def _short(name: str) -> str:
    """A name that fits its column: its middle is left out if it is long."""
    most = LONGEST - 2
    half = (most - 1) // 2
    return name if len(name) <= most else f"{name[:half]}…{name[-half:]}"


def _named(names: Iterable[str], what: str) -> str:
    """How many there are, with their names if they are few."""
    names = list(names)
    few = f" ({', '.join(names)})" if len(names) <= SHOWN else ""
    return f"{_many(len(names), what)}{few}"


def _few(lines: Sequence[str]) -> list[str]:
    rest = len(lines) - SHOWN
    return [*lines[:SHOWN], *([f"  and {rest} more"] if rest > 0 else [])]


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
