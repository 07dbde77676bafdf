"""Grid search over the settings of a profile: the measures of all points, and the best trained."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from math import isnan
from pathlib import Path
from typing import Any, NoReturn

import noiseclassifier as nc
from inspector.errors import InspectorError
from inspector.progress import progress
from inspector.training.part import Part
from inspector.training.recordings import Simulators, recordings
from inspector.training.training import profile_at
from inspector.training.tuningfile import opened
from noiseclassifier.modelfile import versions
from noiseclassifier.recording import check_apart, folds, group_of
from noiseclassifier.tuning.grid import ESTIMATOR_SETTINGS, Grid, Point
from noiseclassifier.tuning.search import Criterion, Measures, Validation, measure, order, validate
from noiseclassifier.tuning.trial import Trial
from noisemodel.atomic import refuse_existing
from noisemodel.parallel import DIED, Jobs, in_order

BATCHES = 4
"""Least number of batches per job: a stopped job loses one; all end at nearly the same time."""

WORKERS = 16
"""For how many workers of a cluster there should be enough batches."""

HEADS = {
    "balanced_accuracy": ("balanced", "accuracy"),
    "log_loss": ("", "log-loss"),
    "failure_recall": ("failure", "recall"),
    "false_alarm_rate": ("false", "alarms"),
    "subset_accuracy": ("subset", "accuracy"),
}
"""Headings of the columns of measures, in two lines."""
WIDTH = 10
"""Least width of a column, in characters."""


@dataclass(frozen=True, kw_only=True)
class Search:
    """The settings of a grid search.

    Attributes:
        training: Annotated runs, folders of them, or NoisyTest folders.
        validation: Recordings of a validation set; without any, the training set is folded.
        part: The part of all these recordings to read.
        folds: Number of folds without a validation set.
        profile: One of ``PROFILES``.
        rate: Rate of the model, in [Hz], to which faster runs are decimated.
        grid: Texts that `Grid.of` reads.
    """

    training: Sequence[Path]
    validation: Sequence[Path] = ()
    part: Part = Part.ALL
    folds: int = 5
    profile: str = "noisytest-rbf"
    rate: float = 10_000.0
    grid: Sequence[str] = ("paper",)


@dataclass(frozen=True, eq=False)
class Tuned:
    """The results of a grid search.

    Attributes:
        search: The settings of the search.
        grid: The points.
        profiles: The profile of each point.
        measures: The measures of each point.
        untuned: The profile before tuning.
        reference: The predictions of the untuned profile.
        trial: The recordings to train on and to measure on.
    """

    search: Search
    grid: Grid
    profiles: Sequence[nc.Profile]
    measures: Sequence[Measures]
    untuned: nc.Profile
    reference: Validation
    trial: Trial

    def ranked(self, criterion: Criterion) -> list[int]:
        """Indices of the points, best first by a criterion; ties stay in the order of the grid."""
        keys = list(map(order(criterion), self.measures))
        return sorted(range(len(keys)), key=keys.__getitem__)

    def train(self, output: Path, criterion: Criterion, *, overwrite: bool = False) -> None:
        """Train the best point on the whole training set, and write the model.

        Args:
            output: The model file to write.
            criterion: The criterion that ranks the points.
            overwrite: Whether a file that exists may be replaced.

        Raises:
            OutputError: If the file exists or cannot be written.
        """
        best = self.profiles[self.ranked(criterion)[0]]
        learn, check = self._recordings()
        simulators = Simulators()
        examples = nc.Examples.read(simulators.noting(learn), best)
        validation = nc.Dataset.of(check, best, training=False) if check else None
        trained = nc.Classifier.train(examples, best, validation=validation)
        classifier = simulators.signed(trained)
        classifier.save(output, overwrite=overwrite)

    def table(self, criterion: Criterion, *, rows: int = 10) -> str:
        """The best points as a table, with remarks.

        Args:
            criterion: The criterion that ranks the points.
            rows: Number of points.
        """
        names = list(self.grid.axes)
        ranked, points = self.ranked(criterion)[:rows], list(self.grid.points())
        untuned = {name: getattr(self.untuned, name) for name in names}
        titles = [str(place + 1) for place in range(len(ranked))]
        cells = [
            ["", *("" for _ in names), *(upper for upper, _ in HEADS.values())],
            ["", *names, *(lower for _, lower in HEADS.values())],
            *(
                [t, *_cells(points[i], self.measures[i])]
                for t, i in zip(titles, ranked, strict=True)
            ),
            ["untuned", *_cells(untuned, self.reference.measures()[0])],
        ]
        widths = [7, *(max(WIDTH, len(name) + 2) for name in names), *(WIDTH for _ in HEADS)]
        lines = ["".join(c.rjust(w) for c, w in zip(row, widths, strict=True)) for row in cells]
        return "\n".join([self._basis(), "", *lines, "", *self._remarks(criterion)])

    def as_dict(self, criterion: Criterion, *, rows: int = 10) -> dict[str, Any]:
        """The best points as JSON can hold them.

        Args:
            criterion: The criterion that ranks the points.
            rows: Number of points.
        """
        points, ranked = list(self.grid.points()), self.ranked(criterion)
        return {
            "points": len(points),
            "criterion": criterion,
            "shared_by": {name: self._shared(name) for name in HEADS},
            "best": [{**points[i], **self.measures[i].as_dict()} for i in ranked[:rows]],
            "profile": self.profiles[ranked[0]].as_dict(),
            "untuned": self.reference.measures()[0].as_dict(),
        }

    def _basis(self) -> str:
        splits = self.trial.splits
        trained = len({index for learn, _ in splits for index in learn.tolist()})
        others = f"{len(set(self.reference.runs.tolist()))} others"
        if not self.search.validation:
            others = f"the same, in {len(splits)} folds"
        return (
            f"{len(self.grid)} points of {self.search.profile}, trained on"
            f" {self.reference.training_frames} frames of {trained} recordings, measured on"
            f" {len(self.reference.truth)} frames of {others}"
        )

    def _remarks(self, criterion: Criterion) -> list[str]:
        best = self.ranked(criterion)[0]
        lines = []
        if criterion != "log-loss":
            value = getattr(self.measures[best], criterion.replace("-", "_"))
            lines.append(
                f"{self._share(criterion.replace('-', '_'))} the best"
                f" {criterion.replace('-', ' ')}, {value:.1%}; the log-loss breaks ties."
            )
        if criterion != "subset-accuracy":
            most = max(measures.subset_accuracy for measures in self.measures)
            lines.append(
                f"{self._share('subset_accuracy')} the best subset accuracy, {most:.1%},"
                " which is the paper's criterion."
            )
        for name, values in self.grid.axes.items():
            value = getattr(self.profiles[best], name)
            numbers = [each for each in values if not isinstance(each, str)]
            if len(numbers) > 1 and value in (min(numbers), max(numbers)):
                lines.append(
                    f"{name} {value:.6g} is an end of the grid: a wider one may hold better."
                )
        return lines

    def _share(self, name: str) -> str:
        count = self._shared(name)
        return f"{count} of {len(self.grid)} points {'has' if count == 1 else 'share'}"

    def _shared(self, name: str) -> int:
        """Number of points with the best value of a measure."""
        found = [getattr(measures, name) for measures in self.measures]
        values = [value for value in found if not isnan(value)]
        best = min if name in ("log_loss", "false_alarm_rate") else max
        return values.count(best(values)) if values else 0

    def _recordings(self) -> tuple[list[nc.Recording], list[nc.Recording]]:
        """Recordings of the training set, and of the validation set."""
        if not self.search.validation:
            return list(self.trial.recordings), []
        ((learn, check),) = self.trial.splits
        return [self.trial.recordings[i] for i in learn], [self.trial.recordings[i] for i in check]


def tune(
    search: Search,
    output: Path,
    *,
    model: Path | None = None,
    jobs: Jobs = 1,
    overwrite: bool = False,
) -> Tuned:
    """Measure the points of a grid that a results file does not have yet.

    Args:
        search: The settings of the search.
        output: The results file; the search resumes if it exists.
        model: A model file to write afterwards; if it exists, it is refused before the work.
        jobs: Number of parallel processes, or the address of a Dask scheduler.
        overwrite: Whether to discard the results in the file.

    Returns:
        The measures of all points.

    Raises:
        InspectorError: If there is no such profile, the file has other results, or a worker dies.
        GridError: If the grid cannot be searched.
        ModelsError: If the recordings cannot be trained on, or some are in both sets.
    """
    if model:
        refuse_existing(model, overwrite=overwrite)
    base = profile_at(search.profile, search.rate)
    grid = Grid.of(search.grid, base.kernel)
    points, profiles = list(grid.points()), grid.profiles(base)
    training, validation = _read(search, search.training), _read(search, search.validation)
    trial = _trial(training, validation, search.folds)
    facts = {
        "grid": {name: list(values) for name, values in grid.axes.items()},
        "profile": {k: v for k, v in base.as_dict().items() if k not in grid.axes},
        "training_set": _digests(training),
        "validation_set": _digests(validation),
        "number_of_folds": None if validation else search.folds,
        "software": versions(),
    }
    reference = validate([base], trial)  # first: data that cannot be trained on leave no file
    with opened(output, facts, points, overwrite=overwrite) as results:
        done = len(results.measures)
        least = BATCHES * (jobs if isinstance(jobs, int) else WORKERS)
        batches = _batches(points[done:], profiles[done:], least)
        one, names = partial(measure, trial=trial), list(grid.axes)
        found = in_order(one, batches, jobs=jobs, died=partial(_died, names=names))
        for measures in progress(found, "tune", total=len(batches)):
            results.add(measures)
    return Tuned(search, grid, profiles, results.measures, base, reference, trial)


def _read(search: Search, paths: Sequence[Path]) -> list[nc.Recording]:
    found = list(recordings(paths, search.rate, search.part))
    if paths and not found:
        names = ", ".join(map(str, paths))
        raise InspectorError(f"{names}: no recording (of part {search.part.value!r})")
    return found


def _trial(
    training: Sequence[nc.Recording], validation: Sequence[nc.Recording], count: int
) -> Trial:
    if not validation:
        return Trial(training, folds([group_of(recording.name) for recording in training], count))
    check_apart(
        {recording.name: recording.sha256 for recording in training},
        {_validation_name(recording): recording.sha256 for recording in validation},
    )
    return Trial.against(training, validation)


def _validation_name(recording: nc.Recording) -> str:
    """A name that is not in the training set: both folders of NoisyTest have the same names."""
    name = recording.name
    return f"{name} of the validation set" if group_of(name) == name else name


def _batches(
    points: Sequence[Point], profiles: Sequence[nc.Profile], least: int
) -> list[list[nc.Profile]]:
    """Points in groups that share their features, or their kernel matrix if those are too few."""
    found: list[list[nc.Profile]] = []
    for fast in (ESTIMATOR_SETTINGS, ("regularization",)):
        keys = [tuple(v for name, v in point.items() if name not in fast) for point in points]
        pairs = groupby(zip(keys, profiles, strict=True), key=lambda pair: pair[0])
        found = [[profile for _, profile in group] for _, group in pairs]
        if len(found) >= least:
            break
    return found


def _died(batch: Sequence[nc.Profile], names: Sequence[str]) -> NoReturn:
    first = ", ".join(f"{name}={getattr(batch[0], name)}" for name in names)
    others = f" and {len(batch) - 1} more" if len(batch) > 1 else ""
    raise InspectorError(f"{first}{others}: {DIED}; the same command resumes there")


def _digests(found: Sequence[nc.Recording]) -> Mapping[str, Any]:
    """SHA-256 of each recording with its annotations, by name."""
    return {
        each.name: hashlib.sha256(f"{each.sha256} {each.start} {each.blocks}".encode()).hexdigest()
        for each in found
    }


def _cells(point: Point, measures: Measures) -> list[str]:
    settings = [value if isinstance(value, str) else f"{value:.6g}" for value in point.values()]
    return settings + [_cell(name, getattr(measures, name)) for name in HEADS]


def _cell(name: str, value: float) -> str:
    if isnan(value):
        return "-"
    return f"{value:.4f}" if name == "log_loss" else f"{value:.1%}"
