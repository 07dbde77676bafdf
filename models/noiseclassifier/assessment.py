"""The assessment of a model on recordings: all measures, as JSON and as text."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import isnan
from typing import Any

import numpy as np

from noiseclassifier.classifier import Classifier, Model
from noiseclassifier.dataset import Dataset, check
from noiseclassifier.errors import DatasetError, SignalError
from noiseclassifier.labels import Event, Labels, interval
from noiseclassifier.matching import UNCLEAR, Predictions, Unanswered, origin_of, truth_of, within
from noiseclassifier.measures import (
    LEAST_GROUPS,
    RATES,
    Estimate,
    Evaluation,
    Part,
    Protocol,
    Resampling,
)
from noiseclassifier.recording import Recording, check_apart, group_of, seen
from noiseclassifier.signals import named

FORMAT = "noise-evaluation/3"
ADVICE = "measure it on other runs, or accept them with a remark in the report (--seen-too)"
NO_FRAME = "no frame without a gap"
# Of the columns of the summary: names, figures with intervals, plain numbers.
WIDTHS = (38, 26, 26, 12, 12)
SHOWN = 5  # most lines of a list; the JSON has all
WIDTH = 32  # of the names in a table by robot, domain or scenario; longer ones push their row
# Title, measure and counts of each row.
ROWS = (
    ("False alarms per hour of ok time", "false_alarms_per_hour", "false_alarms"),
    ("Ok time flagged", "ok_flagged", ""),
    ("Alarms per hour of unlabelled time", "alarms_in_unlabelled_per_hour", "alarms_in_unlabelled"),
    ("Faults found, of all injected", "recall_injected", "found/faults"),
    ("Faults found, of detectable", "recall_felt", "found_felt/felt"),
    ("Onset right within 0.2 s, of found", "onset_within", "onset_close/found"),
    ("Events by class, precision", "class_precision", "matched_by_class/findings"),
    ("  recall", "class_recall", "matched_by_class/faults"),
    ("  F1", "class_f1", ""),
    ("Delay until a live listener knows", "delay", ""),
    ("  90 %", "late_delay", ""),
)
# Measures of a table by robot, domain or scenario, by title.
COLUMNS = {
    "false/h": "false_alarms_per_hour",
    "ok flagged": "ok_flagged",
    "found": "recall_injected",
    "detectable": "recall_felt",
    "F1 class": "class_f1",
    "delay": "delay",
    "AUC": "auc",
    "pAUC": "pauc",
}
# Gives the events of labels by their frames, and the same from onset to end.
Localise = Callable[[Recording, Labels], tuple[tuple[Event, ...], tuple[Event, ...]]]


@dataclass(frozen=True, eq=False)
class Assessment:
    """All measures of a model."""

    runs: int  #: recordings that have a verdict
    groups: int  #: groups of them that share their motion
    copies: dict[str, str]  #: recordings that were left out, and the equal one of each, by name
    seen: dict[str, str]  #: recordings that the model was trained on, and what of them, by name
    protocol: Protocol  #: measures of the findings as they are reported
    evaluation: Evaluation  #: all frames that are cut from blocks

    def as_dict(self) -> dict[str, Any]:
        """All measures for JSON, None where undefined."""
        names = ("runs", "groups", "copies", "seen")
        return {
            "format": FORMAT,
            **{name: getattr(self, name) for name in names},
            "protocol": self.protocol.as_dict(),
            "frames": self.evaluation.as_dict(),
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
    # As of a file: what is found has to stand out from the rest of the run, not only from its past.
    pieces = [(recording.signal, recording.valid)]
    labels = classifier.classify_pieces(pieces, recording.rate, start=recording.start, whole=True)
    truth = predicted = np.array([], dtype=str)
    if profile.reference:
        # Frames that are cut out of blocks have no reference: those of the whole recording count.
        truth = truth_of(labels.start, labels.stop, blocks, step=step)
        truth, predicted = truth[truth != UNCLEAR], labels.label[truth != UNCLEAR]
    else:
        with suppress(DatasetError):  # all blocks lie in gaps
            # Frames that are cut from blocks, as the paper does for validation.
            dataset = Dataset.of([recording], profile, training=False)
            truth, predicted = dataset.labels, classifier.predict(dataset.features)
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
    return Assessment(
        runs=len(predictions),
        groups=len(set(groups)),
        copies=dict(copies or {}),
        seen=dict(known or {}),
        protocol=Protocol.of(predictions, Resampling.of(groups), unanswered),
        evaluation=Evaluation.of(
            np.concatenate([one.truth for one in predictions]),
            np.concatenate([one.predicted for one in predictions]),
            predictions[0].labels.classes,
        ),
    )


# --- as text


def table(assessment: Assessment, by: str = "") -> str:
    """Table of an assessment, as text; ``by`` names the one table of parts to print."""
    protocol = assessment.protocol
    keys = [by] if by else [key for key in ("robot", "domain") if len(protocol.by[key]) > 1]
    foot = ["Brackets are 95 % confidence intervals over groups of runs."]
    if assessment.groups < LEAST_GROUPS:
        foot.append(f"Measures of fewer than {LEAST_GROUPS} groups have none.")
    paragraphs = [
        _head(assessment),
        _summary(protocol),
        _not_answered(protocol),
        *(_parts(key, protocol.by[key]) for key in keys),
        _errors(protocol),
        ["Frames that are cut from annotated blocks", *str(assessment.evaluation).splitlines()],
        foot,
    ]
    return "\n\n".join("\n".join(lines) for lines in paragraphs if lines)


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
    counts, unanswered = protocol.counts, len(protocol.unanswered)
    lines = [
        "At the operating point that ships: findings as `inspector classify` reports them",
        _line("", "robots alike", "all runs pooled", "by chance", "counts"),
    ]
    for title, name, behind in ROWS:
        figures = [_ranged(name, each[name]) for each in (protocol.alike, protocol.pooled)]
        chance = _figure("", protocol.by_chance[name]) if name in protocol.by_chance else ""
        count = " of ".join(f"{counts[each]:.0f}" for each in behind.split("/")) if behind else ""
        lines.append(_line(title, *figures, chance, count))
    runs = f"{unanswered} of {len(protocol.outcomes) + unanswered}"
    return [
        *lines,
        _line("AUC of runs, mean over domains", _figure("auc", protocol.auc), "", "50.0%"),
        _line("pAUC (FPR up to 10 %)", _figure("pauc", protocol.pauc), "", "50.0%"),
        _line("Runs without a verdict", _figure("", protocol.not_answered), "", "", runs),
    ]


def _not_answered(protocol: Protocol) -> list[str]:
    """Reasons why runs have no verdict, each with its runs and robots."""
    reasons: dict[str, list[str]] = {}
    for each in protocol.unanswered:
        reasons.setdefault(each.reason, []).append(origin_of(each)["robot"])
    return [
        f"not answered: {_many(len(robots), 'run')} ({reason}) of {_named(set(robots), 'robot')}"
        for reason, robots in reasons.items()
    ]


def _parts(key: str, parts: Mapping[str, Part]) -> list[str]:
    """A row for each robot, domain or scenario."""
    titles = ["runs", "ok h", *COLUMNS]
    rows = [(f"By {key}", titles)]
    for name, part in parts.items():
        runs = f"{part.counts['runs']:.0f}" + (f"+{part.unanswered}" if part.unanswered else "")
        figures = [_figure(measure, part.measures[measure]) for measure in COLUMNS.values()]
        rows.append((name, [runs, f"{part.counts['ok_hours']:.3g}", *figures]))
    lines = []
    for name, cells in rows:
        pairs = zip(cells, titles, strict=True)
        columns = [cell.rjust(max(len(title), 7) + 2) for cell, title in pairs]
        lines.append(f"{name}  ".ljust(WIDTH) + "".join(columns))
    if any(part.unanswered for part in parts.values()):
        lines.append("(+n: runs without a verdict)")
    return lines


def _errors(protocol: Protocol) -> list[str]:
    lines = []
    for title, errors in (
        ("Missed, of the detectable faults", [e for e in protocol.missed() if e["felt"]]),
        ("False alarms", protocol.false_alarms()),
    ):
        if errors:
            lines.append(title)
            lines += _few(
                [f"  {e['label']} in {e['run']}, {interval(e['start'], e['stop'])}" for e in errors]
            )
    return lines


def _line(*cells: str) -> str:
    return "".join(cell.ljust(width) for cell, width in zip(cells, WIDTHS, strict=False)).rstrip()


def _figure(measure: str, value: float) -> str:
    """A value as text: a delay, a rate per hour, or a share."""
    if isnan(value):
        return "-"
    if measure.endswith("delay"):
        return f"{value:.3g} s"
    if measure in RATES:
        return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"
    return f"{100.0 * value:.1f}%"


def _ranged(measure: str, estimate: Estimate) -> str:
    """A figure and its bounds as text: ``97.9% [96.1, 98.8]``."""
    value, low, high = (_figure(measure, each) for each in vars(estimate).values())
    return value if low == "-" else f"{value} [{low}, {high}]".replace("%,", ",").replace("%]", "]")


def _named(names: Iterable[str], what: str) -> str:
    """How many there are, with their names if they are few."""
    names = sorted(names)
    few = f" ({', '.join(names)})" if len(names) <= SHOWN else ""
    return f"{_many(len(names), what)}{few}"


def _few(lines: Sequence[str]) -> list[str]:
    rest = len(lines) - SHOWN
    return [*lines[:SHOWN], *([f"  and {rest} more"] if rest > 0 else [])]


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
