"""Predictions of a model on a recording: on its annotated blocks, and from end to end."""

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from models.classifier import Classifier
from models.dataset import Dataset
from models.errors import DatasetError
from models.labels import ANOMALY, Labels
from models.recording import Block, Recording
from models.splitting import group_of
from models.types import Words


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
    """

    name: str
    group: str
    step: float
    blocks: tuple[Block, ...]
    truth: Words
    predicted: Words
    labels: Labels


def predict(classifier: Classifier, recording: Recording) -> Predictions:
    """Predictions of a model on a recording.

    Args:
        classifier: The model.
        recording: Annotated noise at its rate.

    Returns:
        Predictions; a recording whose blocks all lie in gaps has no frame of a block. For a
        baseline, which names no failure, each failure is an anomaly.

    Raises:
        ModelsError: If the recording does not fit the model.
    """
    if ANOMALY in classifier.classes:
        recording = replace(recording, blocks=tuple(map(_unnamed, recording.blocks)))
    truth, predicted = _of_blocks(classifier, recording)
    return Predictions(
        recording.name,
        group_of(recording.name),
        1.0 / recording.rate,
        _within(recording),
        truth,
        predicted,
        _whole(classifier, recording),
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


def _within(recording: Recording) -> tuple[Block, ...]:
    end = recording.start + len(recording.time) / recording.rate
    return tuple(
        sorted(
            block._replace(stop=end if block.stop == inf else block.stop)
            for block in recording.blocks
        )
    )
