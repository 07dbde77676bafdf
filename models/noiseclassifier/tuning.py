"""Tuning: the points of a grid, each as good as a model trained by itself, many at once.

A grid is written as texts, one for each setting: ``stride=224:1024:100`` counts from a first value
to a last one, both included, ``C=0.1:1000:x10`` multiplies, ``bands=comb,adjacent`` lists. The word
``paper`` stands for the grid that the paper searched.

What a point predicts is what `Classifier.train` with its profile would predict. Points that differ
in settings of the estimator alone share their features; support vector machines that differ in C
and gamma share the distances between frames, and those that differ in C alone the kernel matrix, so
that a point costs little more than libsvm's own work.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from itertools import accumulate, groupby, product, repeat, takewhile
from math import floor, isnan, log, nan, prod
from typing import Any, Self, TypeAlias

import numpy as np

from noiseclassifier.dataset import Dataset
from noiseclassifier.errors import DatasetError, ProfileError
from noiseclassifier.estimators import SupportVectorMachines, balance, choose, svc
from noiseclassifier.features import standard
from noiseclassifier.labels import UNKNOWN
from noiseclassifier.measures import Evaluation, plain
from noiseclassifier.profile import Kernel, Profile
from noiseclassifier.recording import Recording
from noiseclassifier.signals import Array, Index, Words

Value: TypeAlias = int | float | str
Point: TypeAlias = Mapping[str, Value]

# Settings of the features that can be tuned.
FEATURE_SETTINGS = ("window", "stride", "bands", "floor", "least_deviation")
# Settings of support vector machines; points that differ in these alone share their features.
ESTIMATOR_SETTINGS = ("multiclass", "gamma", "regularization")
# Settings that can be tuned: all that come after framing; the last varies fastest.
SETTINGS = FEATURE_SETTINGS + ESTIMATOR_SETTINGS
MOST = 1_000_000  # points that a grid may have
# Training frames up to which a kernel matrix is kept, 200 MB then; above, libsvm has a cache.
LARGEST = 5000
DIGITS = 9  # decimals of a measure: equal measures stay equal whatever the order of summation


# --- the grid


@dataclass(frozen=True)
class Grid:
    """Settings of a profile, and the values of each, sorted as ``SETTINGS`` are."""

    axes: Mapping[str, tuple[Value, ...]]

    def __post_init__(self) -> None:
        """Check the axes, and sort them."""
        for name, values in self.axes.items():
            if name not in SETTINGS:
                raise ProfileError(f"no setting {name!r} to tune; there are {', '.join(SETTINGS)}")
            if not values or len(set(values)) < len(values):
                raise ProfileError(f"grid of {name} needs one or more values, each once")
        if not self.axes or len(self) > MOST:
            count = len(self) * bool(self.axes)
            raise ProfileError(f"grid of {count} points, expected 1 to {MOST}")
        ordered = {name: self.axes[name] for name in SETTINGS if name in self.axes}
        object.__setattr__(self, "axes", ordered)

    @classmethod
    def paper(cls, kernel: Kernel = "rbf") -> Self:
        """The grid that the paper searched, 24,300 points for the RBF kernel, 1,620 for the linear.

        Its values are NoisyTest's to the bit: it adds a step to a float, so that errors add up
        (C is 1.0999999999999999 where 1.1 is meant) and the last C and gamma just fall out.
        """

        def added_up(first: float, last: float, step: float) -> tuple[float, ...]:
            values = accumulate(repeat(step), initial=first)
            return tuple(takewhile(lambda value: value <= last, values))

        gamma = {"gamma": added_up(4.5e-4, 6.0e-4, 1.0e-5)} if kernel == "rbf" else {}
        strides = tuple(range(224, 1026, 10))
        return cls({"stride": strides, "regularization": added_up(0.5, 2.5, 0.1), **gamma})

    @classmethod
    def of(cls, texts: Iterable[str], kernel: Kernel = "rbf") -> Self:
        """Read ``paper``, or settings and their values; a later text replaces earlier ones."""
        axes: dict[str, tuple[Value, ...]] = {}
        for text in texts:
            if text == "paper":
                axes |= cls.paper(kernel).axes
                continue
            name, equals, values = text.partition("=")
            if not equals:
                raise ProfileError(f"grid {text!r}, expected paper or NAME=VALUES, say C=0.1,1,10")
            name = "regularization" if name == "C" else name
            axes[name] = _values(name, values)
        return cls(axes)

    def points(self) -> Iterator[Point]:
        """Yield a value for each setting, every combination once."""
        for values in product(*self.axes.values()):
            yield dict(zip(self.axes, values, strict=True))

    def profiles(self, base: Profile) -> list[Profile]:
        """Profile of each point; all other settings are as in ``base``."""
        if "gamma" in self.axes and base.kernel == "linear":
            raise ProfileError(
                "gamma does nothing with the linear kernel; leave it out of the grid"
            )
        for stride in self.axes.get("stride", ()):
            if isinstance(stride, int) and stride > base.length:
                raise ProfileError(
                    f"stride of {stride} samples is longer than a frame of {base.length}"
                )
        changes: Iterator[dict[str, Any]] = (dict(point) for point in self.points())
        return [replace(base, **each) for each in changes]

    def __len__(self) -> int:
        return prod(len(values) for values in self.axes.values())


def _values(name: str, text: str) -> tuple[Value, ...]:
    """Read the values of a setting: words, a list of numbers, or a range of them."""
    kind = {field.name: field.type for field in fields(Profile)}.get(name)
    if kind not in (int, float):
        return tuple(filter(None, text.split(",")))
    try:
        given = _range(text) if ":" in text else map(float, filter(str.strip, text.split(",")))
        numbers = tuple(given)
        whole = tuple(map(int, numbers))  # refuses what is not finite
    except (ValueError, OverflowError):
        numbers, whole = (nan,), ()
    if isnan(sum(numbers)) or (kind is int and numbers != whole):
        count = "whole samples" if kind is int else "finite numbers"
        raise ProfileError(
            f"{name} is {text!r}, expected {count}: values with commas, first:last:step, or"
            f" first:last:xfactor, at most {MOST}"
        )
    return whole if kind is int else numbers


def _range(text: str) -> list[float]:
    """Values from a first to a last one, both included, by a step or a factor."""
    first, last, step = text.split(":")
    start, stop, by = float(first), float(last), float(step.removeprefix("x"))
    times = step.startswith("x")
    if not (by > 1 and start > 0 if times else by > 0):
        raise ValueError
    if stop < start:
        return []
    steps = log(stop / start) / log(by) if times else (stop - start) / by
    if not steps < MOST:
        raise ValueError
    exact = (start * by**i if times else start + i * by for i in range(floor(steps + 1e-9) + 1))
    return [float(f"{each:.12g}") for each in exact]  # 0.7, and not 0.7000000000000001


# --- measures of points


@dataclass(frozen=True, eq=False)
class Trial:
    """Recordings to train points on and to measure them by; each is tested in one split at most."""

    recordings: Sequence[Recording]
    splits: Sequence[tuple[Index, Index]]  # indices of the training recordings, and of the others

    @classmethod
    def against(cls, training: Sequence[Recording], validation: Sequence[Recording]) -> Self:
        """A single split: train on some recordings, test on others."""
        every = np.arange(len(training) + len(validation))
        return cls([*training, *validation], [(every[: len(training)], every[len(training) :])])

    def names(self, indices: Index) -> list[str]:
        """Names of some of the recordings."""
        return [self.recordings[index].name for index in indices.tolist()]

    def examples(self, profile: Profile, *, training: bool) -> Dataset:
        """Features of the training recordings, or of the test recordings, one by one."""
        wanted = np.unique(np.concatenate([split[not training] for split in self.splits]))
        found = [self.recordings[index] for index in wanted.tolist()]
        return Dataset.of(found, profile, training=training)


@dataclass(frozen=True)
class Measures:
    """Measures of a point, as `Evaluation` has them."""

    balanced_accuracy: float
    failure_recall: float
    false_alarm_rate: float
    subset_accuracy: float

    def as_dict(self) -> dict[str, float | None]:
        """All measures for JSON, None where undefined."""
        return dict(plain(asdict(self)))


@dataclass(frozen=True, eq=False)
class Validation:
    """Decisions of points, which share their features, on all test frames."""

    classes: tuple[str, ...]
    truth: Index  # class of each frame, as an index, shape (frames,)
    runs: Words  # name of the recording that each is from, shape (frames,)
    chosen: Index  # its predicted class, beyond the classes if unknown, shape (points, frames)
    training_frames: int

    def measures(self) -> list[Measures]:
        """Measures of each point."""
        names, wanted = (*self.classes, UNKNOWN), [field.name for field in fields(Measures)]
        measures = []
        for chosen in self.chosen:
            cells = np.zeros((len(names), len(names)), dtype=np.int64)
            np.add.at(cells, (self.truth, chosen), 1)
            found = Evaluation(names, cells).measures
            measures.append(Measures(*(round(float(found[name]), DIGITS) for name in wanted)))
        return measures


def rank(measures: Measures) -> tuple[float, float]:
    """Sorts points, the best first: by balanced accuracy, ties by subset accuracy."""
    return -measures.balanced_accuracy, -measures.subset_accuracy


def measure(profiles: Sequence[Profile], trial: Trial) -> list[Measures]:
    """Measures of points on test frames, see `validate`."""
    return validate(profiles, trial).measures()


def validate(profiles: Sequence[Profile], trial: Trial) -> Validation:
    """Train points that share their features, and decide on all test frames by each.

    Those of one gamma should follow each other.
    """
    known = trial.examples(profiles[0], training=True)
    fresh = trial.examples(profiles[0], training=False)
    there = {*known.labels.tolist(), *fresh.labels.tolist()}
    if len(there) < 2:
        raise DatasetError(f"all frames are {', '.join(there)}; tuning takes two classes")
    classes = tuple(name for name in profiles[0].classes if name in there)
    groups = known.groups
    targets, truth = (
        np.array([classes.index(label) for label in each.labels.tolist()])
        for each in (known, fresh)
    )
    chosen = np.empty((len(profiles), len(fresh)), dtype=np.intp)
    for learn, check in trial.splits:
        learnt = np.isin(known.runs, trial.names(learn))
        checked = np.isin(fresh.runs, trial.names(check))
        if not checked.any():
            continue
        if missing := [name for name in classes if name not in known.labels[learnt]]:
            runs = sorted(set(fresh.runs[fresh.labels == missing[0]].tolist()))
            raise DatasetError(
                f"no frame of {missing[0]} to learn from where those of {', '.join(runs[:3])}"
                " are checked; give more recordings of it, or take other folds"
            )
        near, far = known.features[learnt], fresh.features[checked]
        mean, scale = standard(near, profiles[0])
        near, far = (near - mean) / scale, (far - mean) / scale
        decided = _decide(near, targets[learnt], groups[learnt], far, profiles)
        for point, each in enumerate(decided):
            chosen[point, checked] = each
    return Validation(classes, truth, fresh.runs, chosen, len(known))


def _decide(
    known: Array, targets: Index, groups: Words, fresh: Array, profiles: Sequence[Profile]
) -> Iterator[Index]:
    """Train the estimator of each point, and give its choices for test frames."""
    if len(known) > LARGEST:
        for profile in profiles:
            svms = SupportVectorMachines.fit(known, targets, groups, profile)
            yield svms.choose(svms.decision(fresh))
        return
    from sklearn import config_context

    classes = int(targets.max()) + 1
    near, far = known @ known.T, fresh @ known.T
    rbf = profiles[0].kernel == "rbf"
    if rbf:  # K(x, y) = exp(-gamma |x - y|^2)
        squares = near.diagonal()
        far = np.einsum("ij,ij->i", fresh, fresh)[:, None] + squares - 2.0 * far
        near = squares[:, None] + squares - 2.0 * near
    for gamma, points in groupby(profiles, key=lambda profile: profile.gamma):
        train, test = (np.exp(-gamma * near), np.exp(-gamma * far)) if rbf else (near, far)
        for profile in points:
            # The input checks of scikit-learn would take a sixth of the time here.
            with config_context(assume_finite=True, skip_parameter_validation=True):
                found = _decisions(train, test, targets, profile)
            yield choose(found, classes=classes, multiclass=profile.multiclass)


def _decisions(train: Array, test: Array, targets: Index, profile: Profile) -> Array:
    """Decision values of SVMs trained on a kernel matrix, shape (frames, decisions)."""
    weights = balance(targets)
    if profile.multiclass == "one-vs-one":
        weighted = dict(enumerate(weights.tolist()))
        fitted = svc(profile, profile.regularization, weighted, precomputed=True)
        decisions: Array = fitted.fit(train, targets).decision_function(test)
        # With two classes, scikit-learn turns the sign so that positive means the second.
        return decisions if decisions.ndim == 2 else -decisions[:, None]
    found = []
    for number, weight in enumerate(weights.tolist()):
        one = svc(profile, profile.regularization * weight, precomputed=True)
        found.append(one.fit(train, targets == number).decision_function(test))
    return np.stack(found, axis=1)
