"""The assessment of a model on recordings: all measures, as JSON and as text."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import isnan
from typing import Any

import numpy as np

from noiseclassifier.classifier import Classifier, Model
from noiseclassifier.dataset import Dataset, Examples, check
from noiseclassifier.errors import DatasetError, SignalError
from noiseclassifier.labels import Event, Labels, interval
from noiseclassifier.matching import (
    FALSE,
    OK,
    UNCLEAR,
    Predictions,
    Unanswered,
    origin_of,
    truth_of,
    within,
)
from noiseclassifier.measures import (
    LEAST_GROUPS,
    RATES,
    WORST,
    Estimate,
    Evaluation,
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
COLUMNS = {
    "false/h": "false_alarms_per_hour",
    "ok flagged": "ok_flagged",
    "unlab./h": "alarms_in_unlabelled_per_hour",
    "found": "recall_injected",
    "detectable": "recall_felt",
    "F1 class": "class_f1",
    "delay": "delay",
}
"""Measures of a table by robot or domain, by title."""

Form = Callable[[float], str]
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
        names = ("runs", "groups", "blocks", "runs_with", "copies", "seen")
        return {
            "format": FORMAT,
            **{name: getattr(self, name) for name in names},
            "protocol": self.protocol.as_dict(),
            "classes": list(self.evaluation.classes),
            "confusion": self.evaluation.confusion.tolist(),
            "frames": {"frames": int(self.evaluation.frames), **plain(self.frames)},
            "calibration_error": plain(self.calibration_error),
            "reliability": plain(self.reliability),
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
    """Predictions of a model on a recording, on its annotated blocks and from end to end."""
    profile, blocks, step = classifier.profile, within(recording), 1.0 / recording.rate
    check(recording, profile)
    labels = classifier.classify(
        recording.signal, recording.rate, start=recording.start, valid=recording.valid
    )
    truth = predicted = np.array([], dtype=str)
    if profile.reference:
        # Frames that are cut out of blocks have no reference: those of the whole recording count.
        truth = truth_of(labels.start, labels.stop, blocks, step=step)
        truth, predicted = truth[truth != UNCLEAR], labels.label[truth != UNCLEAR]
    else:
        with suppress(DatasetError):  # all blocks lie in gaps
            # Frames that are cut from blocks, as the paper does for validation.
            dataset = Dataset.of([recording], profile, training=False)
            truth, predicted = dataset.labels, classifier.predict(dataset.frames)
    return Predictions(
        recording.name,
        group_of(recording.name),
        step,
        blocks,
        truth,
        predicted,
        labels,
        recording.events,
        recording.facts,
        localise(recording, labels) if localise and len(labels) else None,
    )


def measure(
    predictions: Sequence[Predictions],
    unanswered: Sequence[Unanswered] = (),
    *,
    copies: Mapping[str, str] | None = None,
    known: Mapping[str, str] | None = None,
) -> Assessment:
    """Assessment of predictions; the other recordings are listed."""
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
    foot = ["Brackets are 95 % confidence intervals over groups of runs."]
    if assessment.groups < LEAST_GROUPS:
        foot.append(f"Measures of fewer than {LEAST_GROUPS} groups have none.")
    paragraphs = [
        _head(assessment),
        *protocol_lines(assessment.protocol, by),
        _errors(assessment.protocol),
        _frames(assessment),
        _paper(assessment),
        _confusion(assessment.evaluation),
        foot,
    ]
    return "\n\n".join("\n".join(lines) for lines in paragraphs if lines)


def protocol_lines(protocol: Protocol, by: str = "") -> list[list[str]]:
    """Paragraphs of lines: the measures, where they are worst, and by robot and domain."""
    keys = [by] if by else [key for key in ("robot", "domain") if len(protocol.by[key]) > 1]
    parts = [_summary(protocol), _not_answered(protocol), _worst(protocol)]
    parts += [_table(protocol, key, whole=bool(by)) for key in keys]
    return [part for part in parts if part]


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
    counts, alike, pooled = protocol.counts, protocol.alike, protocol.pooled
    lines = [
        "At the operating point that ships: findings as `inspector classify` reports them",
        _line("", ["robots alike", "all runs pooled"], ["by chance", "counts"]),
    ]
    for title, name, behind in ROWS:
        figures = [_ranged(each[name], _form(name)) for each in (alike, pooled)]
        chance = _share(protocol.by_chance[name]) if name in protocol.by_chance else ""
        count = " of ".join(f"{counts[each]:.0f}" for each in behind.split("/")) if behind else ""
        lines.append(_line(title, figures, [chance, count]))
    late = f"{_time(alike['delay'].value)}, 90 %: {_time(alike['late_delay'].value)}"
    figures = [late, _ranged(pooled["delay"], _time)]
    runs = len(protocol.outcomes) + len(protocol.unanswered)
    count = f"{len(protocol.unanswered)} of {runs}"
    return [
        *lines,
        _line("Delay until a live listener knows", figures),
        _line("AUC of runs, mean over domains", [_share(protocol.auc), ""], ["50.0%"]),
        _line("pAUC (FPR up to 10 %)", [_share(protocol.pauc), ""], ["50.0%"]),
        _line("Score of DCASE task 2 (harmonic mean)", [_share(protocol.official), ""], ["50.0%"]),
        _line("Runs without a verdict", [_share(protocol.not_answered), ""], ["", count]),
    ]


def _not_answered(protocol: Protocol) -> list[str]:
    """Reasons why runs have no verdict, each with its runs and robots."""
    reasons: dict[str, list[str]] = {}
    for each in protocol.unanswered:
        reasons.setdefault(each.reason, []).append(origin_of(each)["robot"])
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
    for measure, what in (
        ("false_alarms_per_hour", "ok time"),
        ("alarms_in_unlabelled_per_hour", "unlabelled time"),
    ):
        alarms, hours = RATES[measure]
        if worst := protocol.worst(cells, measure):
            head = f"The worst {len(worst)} of robot and domain, by alarms per hour of {what}"
            lines.append(head)
        for key in worst:
            counts = cells[key].counts
            rate = f"{_rate(cells[key].measures[measure])} per hour"
            found = f"{counts[alarms]:.0f} in {counts[hours]:.3g} h"
            lines.append(_line("  " + _short(" ".join(key)), [rate], [found]))
    return lines


def _table(protocol: Protocol, key: str, *, whole: bool) -> list[str]:
    """A row for each robot, domain or scenario; of many the worst, each cell as wide as needed."""
    parts = protocol.by[key]
    names, head, lines = list(parts), f"By {key}", list[str]()
    if not whole and len(names) > ROWS_SHOWN:
        f1 = {name: part.measures["class_f1"] for name, part in parts.items()}
        names = sorted(names, key=lambda name: 2.0 if isnan(f1[name]) else f1[name])[:ROWS_SHOWN]
        lines = [f"By {key}, the worst {ROWS_SHOWN} of {len(parts)} by F1 of the class"]
        head = ""
    ranked = protocol.ranked if key == "domain" else {}
    titles = ["runs", "ok h", *COLUMNS, *(("AUC", "pAUC") if ranked else ())]
    rows = [(head, titles)]
    for name in names:
        part = parts[name]
        runs = f"{part.counts['runs']:.0f}" + (f"+{part.unanswered}" if part.unanswered else "")
        figures = [runs, f"{part.counts['ok_hours']:.3g}"]
        figures += [_form(measure)(part.measures[measure]) for measure in COLUMNS.values()]
        if ranked:
            own = ranked.get(name)
            figures += [_share(own.auc), _share(own.pauc)] if own else ["-", "-"]
        rows.append((_short(name), figures))
    for name, cells in rows:
        pairs = zip(cells, titles, strict=True)
        figures = [cell.rjust(max(len(title), 7) + 2) for cell, title in pairs]
        lines.append(name.ljust(LONGEST) + "".join(figures))
    if any(part.unanswered for part in parts.values()):
        lines.append("(+n: runs without a verdict)")
    return lines


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
        figures = [_ranged(frames[name][label]) for name in ("recall", "precision")]
        behind = [count, assessment.blocks[label], assessment.runs_with[label]]
        lines.append(_row(label, figures, behind))
    error = assessment.calibration_error
    calibrated = f"{_ranged(error)} in ten bins" if error else "- (the scores are no probabilities)"
    return [
        *lines,
        _row("Balanced accuracy", [_ranged(frames["balanced_accuracy"])]),
        _row("Failure recall", [_ranged(frames["failure_recall"])]),
        _row("False alarm rate", [_ranged(frames["false_alarm_rate"])]),
        _row("Calibration error", [calibrated]),
    ]


def _paper(assessment: Assessment) -> list[str]:
    frames, evaluation = assessment.frames, assessment.evaluation
    ok = evaluation.confusion[[name == OK for name in evaluation.classes]].sum()
    errors = ("false_negative_errors", "false_positive_errors")
    nothing = f"(calling all frames ok: {ok / evaluation.frames:.1%})"
    return [
        "As the paper measures, in shares of ALL frames",
        _row("", [name.replace("_", " ") for name in errors]),
        *(
            _row(label, [_ranged(frames[name][label]) for name in errors])
            for label in evaluation.classes
        ),
        _row("Failure detection rate", [_ranged(frames["failure_detection_rate"]), nothing]),
        _row("Subset accuracy", [_ranged(frames["subset_accuracy"])]),
    ]


def _confusion(evaluation: Evaluation) -> list[str]:
    width = max(len(name) for name in evaluation.classes) + 2
    rows = [("Frames of row predicted", evaluation.classes)]
    rows += zip(evaluation.classes, evaluation.confusion.tolist(), strict=True)
    return [
        name.ljust(CLASS) + "".join(str(cell).rjust(width) for cell in cells)
        for name, cells in rows
    ]


# --- figures, rows and lists


def _share(value: float) -> str:
    return "-" if isnan(value) else f"{100.0 * value:.1f}%"


def _rate(value: float) -> str:
    return "-" if isnan(value) else f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"


def _time(value: float) -> str:
    return "-" if isnan(value) else f"{value:.3g} s"


def _form(measure: str) -> Form:
    return _time if measure == "delay" else _rate if measure in RATES else _share


def _ranged(estimate: Estimate, form: Form = _share) -> str:
    """A figure and its bounds as text: ``97.9% [96.1, 98.8]``."""
    if isnan(estimate.value) or isnan(estimate.low):
        return form(estimate.value)
    bounds = f" [{form(estimate.low)}, {form(estimate.high)}]"
    return form(estimate.value) + bounds.replace("%", "").replace(" s", "")


def _line(name: str, figures: Sequence[str], others: Sequence[str] = ()) -> str:
    line = name.ljust(NAME) + "".join(figure.ljust(WIDE) for figure in figures)
    return (line + "".join(other.ljust(NARROW) for other in others)).rstrip()


def _row(name: str, figures: Sequence[str], counts: Sequence[object] = ()) -> str:
    line = name.ljust(CLASS) + "".join(figure.ljust(WIDE + 1) for figure in figures)
    return (line + "".join(str(count).rjust(NARROW - 2) for count in counts)).rstrip()


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
