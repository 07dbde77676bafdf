"""Tuning: measures of the points of a grid on recordings that they were not trained on.

What a point predicts is what `Classifier.train` with its profile would predict.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from math import isnan
from typing import Literal, TypeAlias, get_args

import numpy as np

from noiseclassifier.confusion import Evaluation
from noiseclassifier.errors import DatasetError
from noiseclassifier.features import standard
from noiseclassifier.labels import UNKNOWN
from noiseclassifier.profile import Profile
from noiseclassifier.tuning.kernels import Decisions, decide
from noiseclassifier.tuning.logloss import balanced_log_loss
from noiseclassifier.tuning.trial import FrameFeatures, Trial, frame_features
from noiseclassifier.types import Index, Words

Criterion: TypeAlias = Literal["balanced-accuracy", "log-loss", "subset-accuracy"]
CRITERIA: tuple[Criterion, ...] = get_args(Criterion)

DIGITS = 9
"""Decimals of a measure: equal measures stay equal whatever the order of summation."""


@dataclass(frozen=True)
class Measures:
    """Measures of a point; all but the loss are shares from 0 to 1, NaN where undefined.

    Attributes:
        balanced_accuracy: Mean recall of the classes.
        log_loss: Balanced log-loss, in nats.
        failure_recall: Failure frames that were predicted as any failure, of the failure frames.
        false_alarm_rate: `ok` frames that were predicted as a failure, of the `ok` frames.
        subset_accuracy: Frames with the right prediction, of all: the paper's criterion.
    """

    balanced_accuracy: float
    log_loss: float
    failure_recall: float
    false_alarm_rate: float
    subset_accuracy: float

    def as_dict(self) -> dict[str, float | None]:
        """All measures for JSON, None where undefined."""
        return {name: None if isnan(value) else value for name, value in asdict(self).items()}


@dataclass(frozen=True, eq=False)
class Validation:
    """Decisions of points, which share their features, on all test frames.

    Attributes:
        classes: Names of the classes.
        truth: Class of each frame, as an index, shape (frames,).
        runs: Name of the recording that each is from, shape (frames,).
        decisions: Of each point.
        training_frames: Number of training frames in all.
    """

    classes: tuple[str, ...]
    truth: Index
    runs: Words
    decisions: Sequence[Decisions]
    training_frames: int

    def measures(self) -> list[Measures]:
        """Measures of each point."""
        names = (*self.classes, UNKNOWN)
        measures = []
        for each in self.decisions:
            cells = np.zeros((len(names), len(names)), dtype=np.int64)
            np.add.at(cells, (self.truth, each.chosen), 1)
            found = Evaluation(names, cells)
            values = (
                found.balanced_accuracy,
                balanced_log_loss(each.margins, self.truth),
                found.failure_recall,
                found.false_alarm_rate,
                found.subset_accuracy,
            )
            measures.append(Measures(*(round(value, DIGITS) for value in values)))
        return measures


def order(criterion: Criterion) -> Callable[[Measures], tuple[float, float]]:
    """Key that sorts points, the best first.

    Args:
        criterion: The measure; the log-loss breaks ties.
    """
    if criterion == "log-loss":
        return lambda measures: (measures.log_loss, 0.0)
    name = criterion.replace("-", "_")
    return lambda measures: (-getattr(measures, name), measures.log_loss)


def measure(profiles: Sequence[Profile], trial: Trial) -> list[Measures]:
    """Measures of points on test frames, see `validate`."""
    return validate(profiles, trial).measures()


def validate(profiles: Sequence[Profile], trial: Trial) -> Validation:
    """Train points, and decide on all test frames by each.

    Args:
        profiles: Points that share their features; it pays if those of one gamma follow each other.
        trial: Training and test recordings.

    Returns:
        Their decisions.

    Raises:
        DatasetError: If there are fewer than two classes, or a test class that some split has no
            training frame of.
        ModelsError: If a recording does not fit the profile.
    """
    known = frame_features(trial, profiles[0], training=True)
    fresh = frame_features(trial, profiles[0], training=False)
    classes = _classes(known, fresh, profiles[0])
    chosen = np.empty((len(profiles), len(fresh.labels)), dtype=np.intp)
    margins = np.empty((*chosen.shape, len(classes)))
    for learn, check in trial.splits:
        learnt, checked = known.of(learn), fresh.of(check)
        if not checked.any():
            continue
        _check_learnt(known.labels[learnt], fresh, classes)
        near, far = known.features[learnt], fresh.features[checked]
        mean, scale = standard(near, profiles[0])
        targets, groups = _indices(known.labels[learnt], classes), known.groups[learnt]
        found = decide((near - mean) / scale, targets, groups, (far - mean) / scale, profiles)
        for point, each in enumerate(found):
            chosen[point, checked], margins[point, checked] = each
    decisions = [Decisions(*each) for each in zip(chosen, margins, strict=True)]
    truth = _indices(fresh.labels, classes)
    return Validation(classes, truth, fresh.runs, decisions, len(known.labels))


def _classes(known: FrameFeatures, fresh: FrameFeatures, profile: Profile) -> tuple[str, ...]:
    there = {*known.labels.tolist(), *fresh.labels.tolist()}
    if len(there) < 2:
        raise DatasetError(f"all frames are {', '.join(there)}; tuning takes two classes")
    return tuple(name for name in profile.classes if name in there)


def _check_learnt(learnt: Words, fresh: FrameFeatures, classes: Sequence[str]) -> None:
    if missing := [name for name in classes if name not in learnt]:
        runs = sorted(set(fresh.runs[fresh.labels == missing[0]].tolist()))
        raise DatasetError(
            f"no frame of {missing[0]} to learn from where those of {', '.join(runs[:3])}"
            " are checked; give more recordings of it, or take other folds"
        )


def _indices(labels: Words, classes: Sequence[str]) -> Index:
    return np.array([classes.index(label) for label in labels.tolist()])
