"""Tuning: how the points of a grid do on recordings that they were not trained on.

What a point predicts is what `Classifier.train` with its profile would predict.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from math import isnan
from typing import Literal, TypeAlias, get_args

import numpy as np

from models.confusion import Evaluation
from models.errors import DatasetError
from models.features import standard
from models.labels import UNKNOWN
from models.profile import Profile
from models.tuning.kernels import Answer, answers
from models.tuning.logloss import balanced_log_loss
from models.tuning.trial import Predictions, Trial, predict_features
from models.types import Index, Words

Criterion: TypeAlias = Literal["balanced-accuracy", "log-loss", "subset-accuracy"]
CRITERIA: tuple[Criterion, ...] = get_args(Criterion)

DIGITS = 9
"""Of a measure, so that what is equal stays so, in whatever order it was added up."""


@dataclass(frozen=True)
class Measures:
    """How a point does; all but the loss are shares from 0 to 1, NaN where nothing is to count.

    Attributes:
        balanced_accuracy: Mean recall of the classes.
        log_loss: Balanced log-loss, in nats.
        failure_recall: Failure frames that were called some failure, of the failure frames.
        false_alarm_rate: `ok` frames that were called a failure, of the `ok` frames.
        subset_accuracy: Frames that were called what they are, of all: the paper's criterion.
    """

    balanced_accuracy: float
    log_loss: float
    failure_recall: float
    false_alarm_rate: float
    subset_accuracy: float

    def as_dict(self) -> dict[str, float | None]:
        """Give all measures as JSON can hold them, None for what is not defined."""
        return {name: None if isnan(value) else value for name, value in asdict(self).items()}


@dataclass(frozen=True, eq=False)
class Asked:
    """What points that share their features say of the frames to check.

    Attributes:
        classes: Names of the classes.
        truth: Class of each frame, as an index, shape (frames,).
        runs: Name of the recording that each is from, shape (frames,).
        answers: What each point says; of one that is unknown, the index is beyond the classes.
        learnt: How many frames there were to learn from in all.
    """

    classes: tuple[str, ...]
    truth: Index
    runs: Words
    answers: Sequence[Answer]
    learnt: int

    def measures(self) -> list[Measures]:
        """Measure each point."""
        names = (*self.classes, UNKNOWN)
        measures = []
        for answer in self.answers:
            cells = np.zeros((len(names), len(names)), dtype=np.int64)
            np.add.at(cells, (self.truth, answer.chosen), 1)
            found = Evaluation(names, cells)
            values = (
                found.balanced_accuracy,
                balanced_log_loss(answer.graded, self.truth),
                found.failure_recall,
                found.false_alarm_rate,
                found.subset_accuracy,
            )
            measures.append(Measures(*(round(value, DIGITS) for value in values)))
        return measures


def order(criterion: Criterion) -> Callable[[Measures], tuple[float, float]]:
    """Make the key that sorts points, the best first.

    Args:
        criterion: What counts; where it is the same, the log-loss decides.
    """
    if criterion == "log-loss":
        return lambda measures: (measures.log_loss, 0.0)
    name = criterion.replace("-", "_")
    return lambda measures: (-getattr(measures, name), measures.log_loss)


def measure(profiles: Sequence[Profile], trial: Trial) -> list[Measures]:
    """Train and check points, see `ask`."""
    return ask(profiles, trial).measures()


def ask(profiles: Sequence[Profile], trial: Trial) -> Asked:
    """Train points, and ask each about all frames to check.

    Args:
        profiles: Points that share their features; it pays if those of one gamma follow each other.
        trial: What they learn from, and what they are asked about.

    Returns:
        What they say.

    Raises:
        DatasetError: If there are fewer than two classes, or one to check that some split does not
            learn.
        ModelsError: If a recording does not fit the profile.
    """
    known = predict_features(trial, profiles[0], training=True)
    fresh = predict_features(trial, profiles[0], training=False)
    classes = _classes(known, fresh, profiles[0])
    chosen = np.empty((len(profiles), len(fresh.labels)), dtype=np.intp)
    graded = np.empty((*chosen.shape, len(classes)))
    for learn, check in trial.splits:
        learnt, checked = known.of(learn), fresh.of(check)
        if not checked.any():
            continue
        _check_learnt(known.labels[learnt], fresh, classes)
        near, far = known.features[learnt], fresh.features[checked]
        mean, scale = standard(near, profiles[0])
        targets, groups = _indices(known.labels[learnt], classes), known.groups[learnt]
        found = answers((near - mean) / scale, targets, groups, (far - mean) / scale, profiles)
        for point, answer in enumerate(found):
            chosen[point, checked], graded[point, checked] = answer
    said = [Answer(*each) for each in zip(chosen, graded, strict=True)]
    return Asked(classes, _indices(fresh.labels, classes), fresh.runs, said, len(known.labels))


def _classes(known: Predictions, fresh: Predictions, profile: Profile) -> tuple[str, ...]:
    there = {*known.labels.tolist(), *fresh.labels.tolist()}
    if len(there) < 2:
        raise DatasetError(f"all frames are {', '.join(there)}; tuning takes two classes")
    return tuple(name for name in profile.classes if name in there)


def _check_learnt(learnt: Words, fresh: Predictions, classes: Sequence[str]) -> None:
    if missing := [name for name in classes if name not in learnt]:
        runs = sorted(set(fresh.runs[fresh.labels == missing[0]].tolist()))
        raise DatasetError(
            f"no frame of {missing[0]} to learn from where those of {', '.join(runs[:3])}"
            " are checked; give more recordings of it, or take other folds"
        )


def _indices(labels: Words, classes: Sequence[str]) -> Index:
    return np.array([classes.index(label) for label in labels.tolist()])
