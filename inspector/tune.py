"""Grid search over the settings of a profile: the measures of all points, and the best trained.

The results file has one line of JSON for each point of the grid. The first line is the header:
profile, grid, training and validation set, and versions of software. Points follow in the order of
the grid, so that any number of complete lines is a valid beginning. A killed search resumes there;
a complete one is only read.
"""

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import partial
from itertools import groupby
from math import isnan, nan
from pathlib import Path
from typing import Any, NoReturn

import noiseclassifier as nc
from inspector.errors import InspectorError
from inspector.text import progress
from inspector.training import LeftOut, classified, profile_at
from inspector.verdict import resumed
from noiseclassifier.jsontext import from_json
from noiseclassifier.modelfile import versions
from noiseclassifier.recording import check_apart, folds, group_of
from noiseclassifier.tuning import (
    ESTIMATOR_SETTINGS,
    Grid,
    Measures,
    Point,
    Trial,
    Validation,
    Value,
    measure,
    rank,
    validate,
)
from noisemodel.files import refuse_existing
from noisemodel.parallel import DIED, Jobs, in_order

FORMAT = "noise-tuning/1"
# Least number of batches per job, since a stopped job loses one and all should end at nearly the
# same time; and for how many workers of a cluster there should be enough.
BATCHES, WORKERS = 4, 16
# Headings of the columns of measures, in two lines.
HEADS = {
    "balanced_accuracy": ("balanced", "accuracy"),
    "failure_recall": ("failure", "recall"),
    "false_alarm_rate": ("false", "alarms"),
    "subset_accuracy": ("subset", "accuracy"),
}
WIDTH = 10  # least width of a column, in characters
ROWS = 10  # best points that are printed; the results file has all


@dataclass(frozen=True, kw_only=True)
class Search:
    """The settings of a grid search."""

    training: Sequence[Path]  # annotated runs, folders of them, or NoisyTest folders
    validation: Sequence[Path] = ()  # without any, the training set is folded
    part: str = "all"  # of all these recordings
    folds: int = 5
    profile: str = "noisytest-rbf"  # one of ``inspector.training.PROFILES``
    rate: float = 10_000.0  # of the model, in [Hz], to which faster runs are decimated
    grid: Sequence[str] = ("paper",)  # texts that `Grid.of` reads


@dataclass(frozen=True, eq=False)
class Tuned:
    """The results of a grid search."""

    search: Search
    grid: Grid
    profiles: Sequence[nc.Profile]  # of each point
    measures: Sequence[Measures]  # of each point
    untuned: nc.Profile
    reference: Validation  # the predictions of the untuned profile
    trial: Trial

    @property
    def ranked(self) -> list[int]:
        """Indices of the points, best first; ties stay in the order of the grid."""
        keys = list(map(rank, self.measures))
        return sorted(range(len(keys)), key=keys.__getitem__)

    def train(self, output: Path, *, overwrite: bool = False) -> None:
        """Train the best point on the whole training set, and write the model."""
        best = self.profiles[self.ranked[0]]
        learn, check = list(self.trial.recordings), list[nc.Recording]()
        if self.search.validation:
            ((first, second),) = self.trial.splits
            learn, check = [learn[i] for i in first], [learn[i] for i in second]
        examples = nc.Dataset.of(learn, best)
        validation = nc.Dataset.of(check, best, training=False) if check else None
        trained = nc.Classifier.train(examples, best, validation=validation)
        trained.save(output, overwrite=overwrite)

    def table(self) -> str:
        """The best points as a table, with remarks."""
        names = list(self.grid.axes)
        ranked, points = self.ranked[:ROWS], list(self.grid.points())
        untuned = {name: getattr(self.untuned, name) for name in names}
        cells = [
            ["", *("" for _ in names), *(upper for upper, _ in HEADS.values())],
            ["", *names, *(lower for _, lower in HEADS.values())],
            *([str(n), *_cells(points[i], self.measures[i])] for n, i in enumerate(ranked, 1)),
            ["untuned", *_cells(untuned, self.reference.measures()[0])],
        ]
        widths = [7, *(max(WIDTH, len(name) + 2) for name in names), *(WIDTH for _ in HEADS)]
        lines = ["".join(c.rjust(w) for c, w in zip(row, widths, strict=True)) for row in cells]
        return "\n".join([self._basis(), "", *lines, *self._ends()])

    def as_dict(self) -> dict[str, Any]:
        """The best points as JSON can hold them."""
        points, ranked = list(self.grid.points()), self.ranked
        return {
            "points": len(points),
            "best": [{**points[i], **self.measures[i].as_dict()} for i in ranked[:ROWS]],
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

    def _ends(self) -> Iterator[str]:
        """Settings of the best point that lie at an end of the grid."""
        best = self.profiles[self.ranked[0]]
        for name, values in self.grid.axes.items():
            numbers = [each for each in values if not isinstance(each, str)]
            value = getattr(best, name)
            if len(numbers) > 1 and value in (min(numbers), max(numbers)):
                yield (f"{name} {value:.6g} is an end of the grid: a wider one may hold better.")


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
        model: A model file to write afterwards; if it exists, it is refused before the work.
    """
    if model:
        refuse_existing(model, overwrite=overwrite)
    base = profile_at(search.profile, search.rate)
    grid = Grid.of(search.grid, base.kernel)
    points, profiles = list(grid.points()), grid.profiles(base)
    training, validation = (
        _read_part(search, paths, base) for paths in (search.training, search.validation)
    )
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
    with opened(output, facts, points, overwrite=overwrite) as (done, append):
        least = BATCHES * (jobs if isinstance(jobs, int) else WORKERS)
        batches = _batches(points[len(done) :], profiles[len(done) :], least)
        one, names = partial(measure, trial=trial), list(grid.axes)
        found = in_order(one, batches, jobs=jobs, died=partial(_died, names=names))
        for measures in progress(found, "tune", total=len(batches)):
            append(measures)
    return Tuned(search, grid, profiles, done, base, reference, trial)


def _read_part(search: Search, paths: Sequence[Path], base: nc.Profile) -> list[nc.Recording]:
    left_out = LeftOut()
    read = (one for one, _ in classified(paths, search.rate, search.part, bare_too=True))
    found = list(left_out.without(read, base))
    if paths and not found:
        names = ", ".join(map(str, paths))
        reason = f"; {left_out}" if left_out.runs else ""
        raise InspectorError(f"{names}: no recording (of part {search.part!r}){reason}")
    return found


def _trial(
    training: Sequence[nc.Recording], validation: Sequence[nc.Recording], count: int
) -> Trial:
    if not validation:
        return Trial(training, folds([group_of(recording.name) for recording in training], count))

    def name(one: nc.Recording) -> str:
        # Not one of the training set: both folders of NoisyTest have the same names.
        plain = group_of(one.name) == one.name
        return f"{one.name} of the validation set" if plain else one.name

    check_apart(
        {one.name: one.sha256 for one in training}, {name(one): one.sha256 for one in validation}
    )
    return Trial.against(training, validation)


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


def _text(value: Value) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"


def _cells(point: Point, measures: Measures) -> list[str]:
    cells = [_text(value) for value in point.values()]
    for name in HEADS:
        value = getattr(measures, name)
        cells.append("-" if isnan(value) else f"{value:.1%}")
    return cells


# --- the results file


@contextmanager
def opened(
    path: Path, settings: Mapping[str, Any], points: Sequence[Point], *, overwrite: bool = False
) -> Iterator[tuple[list[Measures], Callable[[Sequence[Measures]], None]]]:
    """Open a results file to resume, or create it.

    Args:
        settings: The settings of the search, by name, as JSON can hold them.

    Returns:
        The measures of the first points, and a function that appends those of the next ones.
    """
    refused, header = partial(_refused, path), {"format": FORMAT, **settings}
    what = "results of tuning"
    with resumed(path, header, refused, what=what, afresh=overwrite) as (rows, write):
        done = _measures(path, rows, points)

        def append(measures: Sequence[Measures]) -> None:
            for each in measures:
                write({**points[len(done)], **each.as_dict()})
                done.append(each)

        yield done, append


def _refused(path: Path, problem: str) -> InspectorError:
    return InspectorError(f"{path}: {problem}; name another file, or overwrite it (--overwrite)")


def _measures(path: Path, rows: Sequence[bytes], points: Sequence[Point]) -> list[Measures]:
    """The measures in the rows, which must be of these points."""
    if len(rows) > len(points):
        raise _refused(path, f"is damaged: {len(rows)} points of {len(points)}")
    names = [field.name for field in fields(Measures)]
    measures = []
    for number, (row, point) in enumerate(zip(rows, points, strict=False), start=2):
        try:
            found = from_json(row)
            values = [nan if found[name] is None else float(found[name]) for name in names]
            fits = {name: found[name] for name in point} == point
        except (ValueError, KeyError, TypeError, OverflowError):
            fits = False
        if not fits:
            raise _refused(path, f"is damaged in line {number}")
        measures.append(Measures(*values))
    return measures
