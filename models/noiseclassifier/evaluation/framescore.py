"""Frames of annotated blocks: the measures of `evaluation`, each with its interval."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from noiseclassifier.classifier import Classifier
from noiseclassifier.confusion import Evaluation
from noiseclassifier.dataset import Dataset
from noiseclassifier.evaluation.intervals import Estimate, Resampling, ratio
from noiseclassifier.evaluation.matching import OK
from noiseclassifier.evaluation.predictions import Predictions
from noiseclassifier.types import Array, Index, Mask


@dataclass(frozen=True, eq=False)
class FrameScore:
    """How a model does by frames.

    Attributes:
        evaluation: All frames together.
        recall: Of each class.
        precision: Of each class.
        balanced_accuracy: Mean recall of the classes that occur.
        failure_recall: Failure frames that are not predicted as `ok`, of the failure frames.
        false_alarm_rate: `ok` frames that are not predicted as `ok`, of the `ok` frames.
        false_negative_errors: Of each class, as the paper counts them, of ALL frames.
        false_positive_errors: Of each class, as the paper counts them, of ALL frames.
        failure_detection_rate: The paper's: 1 less the false positive errors of `ok`.
        subset_accuracy: Frames with the right prediction, of all frames.
    """

    evaluation: Evaluation
    recall: dict[str, Estimate]
    precision: dict[str, Estimate]
    balanced_accuracy: Estimate
    failure_recall: Estimate
    false_alarm_rate: Estimate
    false_negative_errors: dict[str, Estimate]
    false_positive_errors: dict[str, Estimate]
    failure_detection_rate: Estimate
    subset_accuracy: Estimate

    def as_dict(self) -> dict[str, Any]:
        """Give all measures as JSON can hold them."""
        plain: dict[str, Any] = {"frames": self.evaluation.frames}
        for name, value in vars(self).items():
            if isinstance(value, Estimate):
                plain[name] = value.as_dict()
            elif isinstance(value, dict):
                plain[name] = {label: each.as_dict() for label, each in value.items()}
        return plain


def score(predictions: Sequence[Predictions], resampling: Resampling) -> FrameScore:
    """Measures of the frames that were cut from annotated blocks.

    Args:
        predictions: Recordings, with one such frame or more.
        resampling: Sets of them.

    Raises:
        DatasetError: If there is no frame.
    """
    evaluation = Evaluation.of(
        np.concatenate([one.truth for one in predictions]),
        np.concatenate([one.predicted for one in predictions]),
        predictions[0].labels.classes,
    )
    names = evaluation.classes
    counts = _confusions(predictions, names)
    numbers = np.arange(len(names))
    truth, predicted = np.meshgrid(numbers, numbers, indexing="ij")
    right, all_frames = truth == predicted, np.ones(truth.shape, dtype=bool)
    ok, predicted_ok = truth == names.index(OK), predicted == names.index(OK)

    def share(part: Mask, whole: Mask) -> Estimate:
        return resampling.share(counts[:, part].sum(axis=1), counts[:, whole].sum(axis=1))

    def each(of: Index, part: Mask, whole: Mask | None = None) -> dict[str, Estimate]:
        return {
            name: share(part & (of == number), of == number if whole is None else whole)
            for number, name in enumerate(names)
        }

    return FrameScore(
        evaluation,
        recall=each(truth, right),
        precision=each(predicted, right),
        balanced_accuracy=_balanced(counts, resampling),
        failure_recall=share(~ok & ~predicted_ok, ~ok),
        false_alarm_rate=share(ok & ~predicted_ok, ok),
        false_negative_errors=each(truth, ~right, all_frames),
        false_positive_errors=each(predicted, ~right, all_frames),
        failure_detection_rate=share(~(predicted_ok & ~right), all_frames),
        subset_accuracy=share(right, all_frames),
    )


def _balanced(counts: Array, resampling: Resampling) -> Estimate:
    """Mean recall of the classes that occur."""
    right, frames = np.diagonal(counts, axis1=1, axis2=2), counts.sum(axis=2)
    there = np.flatnonzero(frames.sum(axis=0))
    # A set without a frame of some class gives no recall of it.
    drawn = ratio(resampling.weights @ right, resampling.weights @ frames)[:, there].mean(axis=1)
    value = ratio(right.sum(axis=0), frames.sum(axis=0))[there].mean()
    return resampling.bounded(float(value), drawn, [frames[:, number] > 0 for number in there])


def _confusions(predictions: Sequence[Predictions], names: Sequence[str]) -> Array:
    """Frames of each recording by true and predicted class, shape (runs, classes, classes)."""
    counts = np.zeros((len(predictions), len(names), len(names)))
    for number, one in enumerate(predictions):
        if len(one.truth):
            found = Evaluation.of(one.truth, one.predicted, names)
            counts[number] = found.confusion
    return counts


def evaluate(classifier: Classifier, dataset: Dataset) -> Evaluation:
    """Confusion matrix of a classifier on annotated frames.

    Args:
        classifier: The classifier.
        dataset: Annotated frames; labels that the classifier does not have count as missed.

    Returns:
        Counts, and all measures that follow from them.
    """
    return Evaluation.of(dataset.labels, classifier.predict(dataset.frames), classifier.classes)
