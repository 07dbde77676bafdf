"""Predictions of a model on a recording: on its annotated blocks, and from end to end."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf

import numpy as np

from noiseclassifier.classifier import Classifier
from noiseclassifier.dataset import Dataset
from noiseclassifier.errors import DatasetError
from noiseclassifier.labels import ANOMALY, Event, Labels
from noiseclassifier.recording import Block, Fault, Recording
from noiseclassifier.splitting import group_of, robot_of
from noiseclassifier.types import Index, Words

UNNAMED = "unnamed"
"""Robot or domain of a recording that names none."""

Localise = Callable[[Recording, Labels], tuple[tuple[Event, ...], tuple[Event, ...]]]
"""Gives the events of labels by their frames, and the same from onset to end."""


@dataclass(frozen=True)
class Origin:
    """Where a recording comes from."""

    name: str
    facts: Mapping[str, str] = field(default_factory=dict)

    @property
    def robot(self) -> str:
        """Its robot."""
        return self.facts.get("robot") or robot_of(self.name) or UNNAMED

    @property
    def domain(self) -> str:
        """Its domain: simulator, drives, sensing and control together."""
        return self.facts.get("domain") or UNNAMED

    @property
    def scenario(self) -> str:
        """Its scenario: the name of what was made to happen."""
        return self.facts.get("scenario") or UNNAMED


@dataclass(frozen=True)
class Unanswered:
    """A recording that a model cannot classify."""

    name: str
    """Its name."""
    facts: Mapping[str, str] = field(default_factory=dict)
    """Its robot, scenario and domain."""
    reason: str = ""
    """Why there is no verdict, in a few words."""

    @cached_property
    def origin(self) -> Origin:
        """Where it comes from."""
        return Origin(self.name, self.facts)

    def as_dict(self) -> dict[str, str]:
        """All of it for JSON."""
        origin = self.origin
        own = {"robot": origin.robot, "domain": origin.domain, "scenario": origin.scenario}
        return {"run": self.name, **own, "reason": self.reason}


@dataclass(frozen=True, eq=False)
class Predictions:
    """Annotations of one recording, and predictions of a model.

    Attributes:
        name: Of the recording.
        group: Of the recording, as `splitting.group_of` names it.
        step: Time from one sample to the next, in [s].
        blocks: Annotations, in order; each ends with the recording at the latest.
        truth: Class of each frame that is cut from a block, shape (frames,).
        predicted: Predicted class of it, shape (frames,).
        labels: Predictions on the whole recording.
        events: All injected faults; empty where they are not known.
        facts: Robot, scenario and domain of the recording.
        located: Findings by their frames, and from onset to end; those of the labels unless given.
    """

    name: str
    group: str
    step: float
    blocks: tuple[Block, ...]
    truth: Words
    predicted: Words
    labels: Labels
    events: tuple[Fault, ...] = ()
    facts: Mapping[str, str] = field(default_factory=dict)
    located: tuple[tuple[Event, ...], tuple[Event, ...]] | None = None

    @cached_property
    def origin(self) -> Origin:
        """Where it comes from."""
        return Origin(self.name, self.facts)

    @cached_property
    def spans(self) -> tuple[Event, ...]:
        """Findings by their frames."""
        return self.labels.events() if self.located is None else self.located[0]

    @cached_property
    def findings(self) -> tuple[Event, ...]:
        """The same findings from onset to end, as they are reported."""
        return self.spans if self.located is None else self.located[1]


def predict(
    classifier: Classifier, recording: Recording, localise: Localise | None = None
) -> Predictions:
    """Predictions of a model on a recording.

    Args:
        classifier: The model.
        recording: Annotated noise at its rate.
        localise: Estimates onset and end of the findings; else they last as their frames do.

    Returns:
        Predictions; a recording whose blocks all lie in gaps has no frame of a block. For a
        baseline, which names no failure, each failure is an anomaly.

    Raises:
        ModelsError: If the recording does not fit the model.
    """
    if ANOMALY in classifier.classes:
        blocks = tuple(map(_unnamed, recording.blocks))
        events = tuple(fault._replace(label=ANOMALY) for fault in recording.events)
        recording = replace(recording, blocks=blocks, events=events)
    truth, predicted = _of_blocks(classifier, recording)
    labels = _whole(classifier, recording)
    return Predictions(
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


def silent(recording: Recording, starts: Index, duration: float) -> Predictions:
    """Predictions of nothing but `ok` on frames of a recording.

    Args:
        recording: The recording.
        starts: First sample of each frame, shape (frames,).
        duration: Of a frame, in [s].
    """
    begin = recording.start + starts / recording.rate
    ok = np.full(len(starts), "ok")
    labels = Labels(begin, begin + duration, ok, np.ones((len(starts), 1)), ("ok",))
    nothing = np.array([], dtype=str)
    return Predictions(
        recording.name,
        group_of(recording.name),
        1.0 / recording.rate,
        within(recording),
        nothing,
        nothing,
        labels,
        recording.events,
        recording.facts,
    )


def _unnamed(block: Block) -> Block:
    return block if block.label == "ok" else block._replace(label=ANOMALY)


def _whole(classifier: Classifier, recording: Recording) -> Labels:
    """Labels of a recording from end to end, as a user would see them."""
    return classifier.classify(
        recording.signal, recording.rate, start=recording.start, valid=recording.valid
    )


def _of_blocks(classifier: Classifier, recording: Recording) -> tuple[Words, Words]:
    """True and predicted classes of frames cut from blocks as the paper does for validation."""
    try:
        dataset = Dataset.of([recording], classifier.profile, training=False)
    except DatasetError:  # no frame without a gap
        return np.array([], dtype=str), np.array([], dtype=str)
    return dataset.labels, classifier.predict(dataset.frames)


def within(recording: Recording) -> tuple[Block, ...]:
    """Blocks of a recording, in order; each ends with the recording at the latest."""
    end = recording.start + len(recording.time) / recording.rate
    return tuple(
        sorted(
            block._replace(stop=end if block.stop == inf else block.stop)
            for block in recording.blocks
        )
    )
