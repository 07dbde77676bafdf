"""Evaluation of frames: the paper's measures, and recall and precision."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan, nan
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from noiseclassifier.errors import DatasetError
from noiseclassifier.types import Array, Words


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Confusion matrix of frames, and measures of it, which are shares from 0 to 1.

    Attributes:
        classes: Names of the classes.
        confusion: Frames by true (row) and predicted class (column), shape (classes, classes).
    """

    classes: tuple[str, ...]
    confusion: NDArray[np.int64]

    @classmethod
    def of(cls, truth: Words, predicted: Words, classes: Sequence[str]) -> Self:
        """Confusion matrix of predictions.

        Args:
            truth: True class of each frame, shape (frames,).
            predicted: Predicted class of each frame, shape (frames,).
            classes: Names of the classes, in their order; others that occur come after them.

        Raises:
            DatasetError: If there are no frames, or the lengths differ.
        """
        if len(truth) != len(predicted) or not len(truth):
            raise DatasetError(
                f"{len(truth)} labels and {len(predicted)} predictions, expected as many,"
                " one or more"
            )
        there = {str(each) for each in (*truth, *predicted)}
        names = (*classes, *sorted(there - set(classes)))
        from sklearn.metrics import confusion_matrix

        confusion = confusion_matrix(truth, predicted, labels=list(names))
        return cls(names, confusion)

    @property
    def frames(self) -> int:
        """How many frames were compared."""
        return int(self.confusion.sum())

    @property
    def false_negative_errors(self) -> Array:
        """Frames of a class that were predicted as another, of ALL frames, shape (classes,)."""
        missed: Array = (self.confusion.sum(axis=1) - self._right) / self.frames
        return missed

    @property
    def false_positive_errors(self) -> Array:
        """Frames of others that were predicted as the class, of ALL frames, shape (classes,)."""
        mistaken: Array = (self.confusion.sum(axis=0) - self._right) / self.frames
        return mistaken

    @property
    def failure_detection_rate(self) -> float:
        """The paper's: 1 less the false positive errors of `ok`."""
        return float(1.0 - self.false_positive_errors[self._ok].sum())

    @property
    def subset_accuracy(self) -> float:
        """Frames with the right prediction, of all frames."""
        return float(self._right.sum() / self.frames)

    @property
    def recall(self) -> Array:
        """Frames of a class that were predicted as it, of its frames; NaN if it has none."""
        recall: Array = ratio(self._right.astype(float), self.confusion.sum(axis=1))
        return recall

    @property
    def precision(self) -> Array:
        """Frames of a class, of those that were predicted as it; NaN if there are none."""
        precision: Array = ratio(self._right.astype(float), self.confusion.sum(axis=0))
        return precision

    @property
    def balanced_accuracy(self) -> float:
        """Mean recall of the classes that occur."""
        return float(np.nanmean(self.recall))

    @property
    def failure_recall(self) -> float:
        """Failure frames that were not predicted as `ok`, of the failure frames; NaN if none."""
        failures = self.confusion[~self._ok]
        return float(ratio(failures[:, ~self._ok].sum(), failures.sum()))

    @property
    def false_alarm_rate(self) -> float:
        """`ok` frames that were not predicted as `ok`, of the `ok` frames; NaN if none."""
        ok = self.confusion[self._ok]
        return float(ratio(ok[:, ~self._ok].sum(), ok.sum()))

    def as_dict(self) -> dict[str, Any]:
        """All measures for JSON, None where undefined."""

        def by_class(values: Array) -> dict[str, float | None]:
            return {name: _plain(value) for name, value in zip(self.classes, values, strict=True)}

        return {
            "frames": self.frames,
            "false_negative_errors": by_class(self.false_negative_errors),
            "false_positive_errors": by_class(self.false_positive_errors),
            "failure_detection_rate": self.failure_detection_rate,
            "subset_accuracy": self.subset_accuracy,
            "classes": list(self.classes),
            "confusion": self.confusion.tolist(),
            "recall": by_class(self.recall),
            "precision": by_class(self.precision),
            "balanced_accuracy": self.balanced_accuracy,
            "failure_recall": _plain(self.failure_recall),
            "false_alarm_rate": _plain(self.false_alarm_rate),
        }

    def __str__(self) -> str:
        ok = self.confusion[self._ok].sum() / self.frames
        width = max(26, *(len(name) + 2 for name in self.classes))

        def line(title: str, cells: Sequence[object]) -> str:
            return title.ljust(width) + "".join(str(cell).rjust(19) for cell in cells)

        def shares(title: str, *values: float) -> str:
            return line(title, ["-" if isnan(value) else f"{value:.1%}" for value in values])

        return "\n".join(
            [
                line(f"{self.frames} frames", self.classes),
                "",
                "As the paper measures",
                shares("False negative errors", *self.false_negative_errors),
                shares("False positive errors", *self.false_positive_errors),
                shares("Failure detection rate", self.failure_detection_rate),
                shares("Subset accuracy", self.subset_accuracy),
                "",
                "Of the frames in question",
                shares("Recall", *self.recall),
                shares("Precision", *self.precision),
                shares("Balanced accuracy", self.balanced_accuracy),
                shares("Failure recall", self.failure_recall),
                shares("False alarm rate", self.false_alarm_rate),
                "",
                "Frames of (row) predicted (column)",
                *(
                    line(name, row)
                    for name, row in zip(self.classes, self.confusion.tolist(), strict=True)
                ),
                "",
                f"The paper divides by all frames: predicting ok for all of them would detect"
                f" {ok:.1%} of failures by its measure, and none by failure recall.",
            ]
        )

    @property
    def _right(self) -> NDArray[np.int64]:
        return self.confusion.diagonal()

    @property
    def _ok(self) -> NDArray[np.bool_]:
        return np.array([name == "ok" for name in self.classes])


def ratio(part: Array | np.float64 | float, whole: Array | np.float64 | float) -> Array:
    """Quotient, NaN where the denominator is 0."""
    part, whole = np.broadcast_arrays(np.asarray(part, float), np.asarray(whole, float))
    share: Array = np.divide(part, whole, out=np.full(whole.shape, nan), where=whole > 0)
    return share


def _plain(value: float) -> float | None:
    return None if isnan(value) else float(value)
