"""Tune a profile: measure all points of a grid, and train the best."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

import models
from inspector.errors import InspectorError
from inspector.progress import progress
from inspector.training.part import Part
from inspector.training.training import recordings, settings
from inspector.training.tuningfile import opened
from models.modelfile import versions
from models.splitting import check_apart, folds, group_of
from models.tuning.grid import ESTIMATOR_SETTINGS, Grid, Point
from models.tuning.search import Criterion, Measures, Validation, measure, order, validate
from models.tuning.trial import Trial
from noisemodel.atomic import refuse_existing
from noisemodel.parallel import each

BATCHES = 4
"""Batches of points for each job at least: a killed job loses one, and the last wait less."""


@dataclass(frozen=True, kw_only=True)
class Question:
    """What is to be tuned, and on what.

    Attributes:
        training: Annotated runs, samples, folders of them, or NoisyTest folders.
        validation: Others to measure by; if there are none, folds of the training set.
        part: Which of all these recordings are meant.
        folds: How many folds, if there are no others to measure by.
        profile: One of ``PROFILES``.
        rate: Rate of the model, in [Hz]; faster runs are lowered to it.
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
    """What came out.

    Attributes:
        question: What was asked.
        grid: The points.
        profiles: The profile of each.
        measures: The measures of each.
        untuned: The profile as it was.
        asked: What it says.
        trial: What all were trained on, and measured by.
    """

    question: Question
    grid: Grid
    profiles: Sequence[models.Profile]
    measures: Sequence[Measures]
    untuned: models.Profile
    asked: Validation
    trial: Trial

    def ranked(self, criterion: Criterion) -> list[int]:
        """Sort the points by a criterion, the best first; of equals, the first of the grid."""
        keys = list(map(order(criterion), self.measures))
        return sorted(range(len(keys)), key=keys.__getitem__)

    def train(self, output: Path, criterion: Criterion, *, overwrite: bool = False) -> None:
        """Train the best point on the whole training set, and write the model.

        Args:
            output: The model file to write.
            criterion: What makes it the best.
            overwrite: Whether a file that exists may be replaced.

        Raises:
            OutputError: If the file exists or cannot be written.
        """
        best = self.profiles[self.ranked(criterion)[0]]
        learn, check = self._recordings()
        known = models.Examples.read(learn, best)
        fresh = models.Dataset.of(check, best, training=False) if check else None
        classifier = models.Classifier.train(known, best, validation=fresh)
        classifier.save(output, overwrite=overwrite)

    def _recordings(self) -> tuple[list[models.Recording], list[models.Recording]]:
        """List those of the training set, and of the validation set."""
        if not self.question.validation:
            return list(self.trial.recordings), []
        ((learn, check),) = self.trial.splits
        return [self.trial.recordings[i] for i in learn], [self.trial.recordings[i] for i in check]


def tune(
    question: Question,
    output: Path,
    *,
    model: Path | None = None,
    jobs: int = 1,
    overwrite: bool = False,
) -> Tuned:
    """Measure all points of a grid that a file of results does not have yet.

    Args:
        question: What is to be tuned, and on what.
        output: The file of results, which is made or gone on with.
        model: A model file that will be written; it is refused before the work if it exists.
        jobs: Processes at once.
        overwrite: Whether to start anew, whatever the file holds.

    Returns:
        The measures of all points.

    Raises:
        InspectorError: If there is no such profile, or the file cannot be gone on with.
        GridError: If the grid cannot be searched.
        ModelsError: If the recordings cannot be learnt from, or some are in both sets.
    """
    if model:
        refuse_existing(model, overwrite=overwrite)
    base = settings(question.profile, question.rate)
    grid = Grid.of(question.grid, base.kernel)
    points, profiles = list(grid.points()), grid.profiles(base)
    learnt, fresh = _read(question, question.training), _read(question, question.validation)
    trial = _trial(learnt, fresh, question.folds)
    facts = {
        "grid": {name: list(values) for name, values in grid.axes.items()},
        "profile": {k: v for k, v in base.as_dict().items() if k not in grid.axes},
        "training_set": _digests(learnt),
        "validation_set": _digests(fresh),
        "number_of_folds": None if fresh else question.folds,
        "software": versions(),
    }
    asked = validate([base], trial)  # first, so that data that cannot be learnt from leave no file
    with opened(output, facts, points, overwrite=overwrite) as results:
        done = len(results.measures)
        batches = _batches(points[done:], profiles[done:], BATCHES * jobs)
        found = each(partial(measure, trial=trial), batches, jobs=jobs)
        for measures in progress(found, "tune", total=len(batches)):
            results.add(measures)
    return Tuned(question, grid, profiles, results.measures, base, asked, trial)


def _read(question: Question, paths: Sequence[Path]) -> list[models.Recording]:
    found = list(recordings(paths, question.rate, question.part))
    if paths and not found:
        names = ", ".join(map(str, paths))
        raise InspectorError(f"{names}: no recording (of part {question.part.value!r})")
    return found


def _trial(
    learnt: Sequence[models.Recording], fresh: Sequence[models.Recording], count: int
) -> Trial:
    if not fresh:
        return Trial(learnt, folds([group_of(recording.name) for recording in learnt], count))
    check_apart(
        {recording.name: recording.sha256 for recording in learnt},
        {_apart(recording): recording.sha256 for recording in fresh},
    )
    return Trial.against(learnt, fresh)


def _apart(recording: models.Recording) -> str:
    """Name a recording to be measured by: of NoisyTest's, two folders have logs of one name."""
    name = recording.name
    return f"{name} of the validation set" if group_of(name) == name else name


def _batches(
    points: Sequence[Point], profiles: Sequence[models.Profile], least: int
) -> list[list[models.Profile]]:
    """Group points that share their features, or their kernel matrix if those are too few."""
    found: list[list[models.Profile]] = []
    for fast in (ESTIMATOR_SETTINGS, ("regularization",)):
        keys = [tuple(v for name, v in point.items() if name not in fast) for point in points]
        pairs = groupby(zip(keys, profiles, strict=True), key=lambda pair: pair[0])
        found = [[profile for _, profile in group] for _, group in pairs]
        if len(found) >= least:
            break
    return found


def _digests(found: Sequence[models.Recording]) -> Mapping[str, Any]:
    """Hash each recording with its annotations, by name."""
    return {
        each.name: hashlib.sha256(f"{each.sha256} {each.start} {each.blocks}".encode()).hexdigest()
        for each in found
    }
