"""The assessment: how well a model does on recordings, and how sure that is."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.classifier import Classifier
from models.errors import DatasetError, SeenError
from models.measuring import eventmeasures, eventscore, framescore, table
from models.measuring.calibration import Reliability, reliability
from models.measuring.eventmeasures import EventMeasures
from models.measuring.eventscore import EventScore
from models.measuring.framescore import FrameScore
from models.measuring.heard import Heard, hear
from models.measuring.intervals import Estimate, Resampling
from models.measuring.matching import Matched
from models.measuring.tradeoff import TradeOff, trade_off
from models.recording import Recording
from models.splitting import robot_of, seen
from models.types import Array

FORMAT = "noise-evaluation/1"
ADVICE = "measure it on other runs, or have the report say so (--seen-too)"
BUDGETS = (5.0, 20.0, 100.0)
"""False alarms per hour at which it is read what could be found."""


@dataclass(frozen=True, eq=False)
class Assessment:
    """All measures of a model.

    Attributes:
        runs: How many recordings.
        groups: How many groups of them that share their motion.
        blocks: Annotated blocks of each class.
        runs_with: Recordings with such a block, of each class.
        copies: Recordings that were left out, and which other each equals, by their names.
        seen: What the model knew of some recordings, by their names.
        frames: Measures of the frames that are cut from blocks.
        events: Measures of whole recordings.
        by_robot: The same of each robot alone, if names say which there are.
        score: The events themselves.
        trade_off: Counts at falling thresholds.
        at_budgets: For each budget of false alarms per hour, failure frames and failures found.
        reliability: Confidence and truth; None if the scores are no probabilities.
        calibration_error: Expected calibration error; None likewise.
    """

    runs: int
    groups: int
    blocks: dict[str, int]
    runs_with: dict[str, int]
    copies: dict[str, str]
    seen: dict[str, str]
    frames: FrameScore
    events: EventMeasures
    by_robot: dict[str, EventMeasures]
    score: EventScore
    trade_off: TradeOff
    at_budgets: dict[float, tuple[Estimate, Estimate]]
    reliability: Reliability | None
    calibration_error: Estimate | None

    def as_dict(self) -> dict[str, Any]:
        """Give everything as JSON can hold it, None for what is not defined."""
        evaluation, table = self.frames.evaluation, self.reliability
        return {
            "format": FORMAT,
            "runs": self.runs,
            "groups": self.groups,
            "blocks": self.blocks,
            "runs_with": self.runs_with,
            "copies": self.copies,
            "seen": self.seen,
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

    def __str__(self) -> str:
        return table.table(self)


def assess(
    classifier: Classifier, recordings: Iterable[Recording], *, seen_too: bool = False
) -> Assessment:
    """Measure a model by recordings, each of which is let go once it was heard.

    Args:
        classifier: The model.
        recordings: Annotated noise at its rate, each of another name. Of recordings that are equal
            bit for bit, the first counts.
        seen_too: Whether recordings count that the model has learnt from, or that share their
            motion with such; the assessment lists them.

    Returns:
        All measures.

    Raises:
        SeenError: If the model knows a recording, unless that is asked for.
        DatasetError: If there is no annotated frame, or a name repeats.
        ModelsError: If a recording does not fit the model.
    """
    heard: dict[str, Heard] = {}
    first, copies, known = dict[str, str](), dict[str, str](), dict[str, str]()
    for recording in recordings:
        name, digest = recording.name, recording.sha256
        if name in heard or name in copies:
            raise DatasetError(f"two recordings are called {name!r}; name them apart")
        known |= seen(classifier.runs, {name: digest})
        if known and not seen_too:
            raise SeenError(known, 1, ADVICE)
        if digest in first:
            copies[name] = first[digest]
        else:
            first[digest] = name
            heard[name] = hear(classifier, recording)
    return judge(tuple(heard.values()), copies=copies, known=known)


def judge(
    heard: Sequence[Heard],
    *,
    copies: Mapping[str, str] | None = None,
    known: Mapping[str, str] | None = None,
) -> Assessment:
    """Measure what a model heard.

    Args:
        heard: Recordings.
        copies: Recordings that were left out, and which other each equals.
        known: What the model knew of some of them.

    Returns:
        All measures.

    Raises:
        DatasetError: If there is no annotated frame.
    """
    if not any(len(one.truth) for one in heard):
        raise DatasetError(f"no annotated frame in {len(heard)} recordings; annotate blocks")
    groups = [one.group for one in heard]
    resampling, matched = Resampling.of(groups), Matched.of(heard)
    events, curve, table = eventscore.score(matched), trade_off(matched), reliability(matched)
    robots = np.array([robot_of(one.name) for one in heard])
    frames = framescore.score(heard, resampling)
    owned = {
        label: [sum(block.label == label for block in one.blocks) for one in heard]
        for label in frames.evaluation.classes
    }
    return Assessment(
        runs=len(heard),
        groups=len(set(groups)),
        blocks={label: sum(counts) for label, counts in owned.items()},
        runs_with={label: sum(map(bool, counts)) for label, counts in owned.items()},
        copies=dict(copies or {}),
        seen=dict(known or {}),
        frames=frames,
        events=eventmeasures.measure(events, resampling),
        by_robot={
            robot: eventmeasures.measure(events, resampling, robots == robot)
            for robot in sorted(set(robots.tolist()) - {""})
        },
        score=events,
        trade_off=curve,
        at_budgets=dict(zip(BUDGETS, curve.at_budgets(BUDGETS, resampling), strict=True)),
        reliability=table,
        calibration_error=table.error(resampling) if table else None,
    )


def _columns(table: Mapping[str, Array]) -> dict[str, list[float | None]]:
    return {
        name: [None if np.isnan(value) else float(value) for value in column]
        for name, column in table.items()
    }
