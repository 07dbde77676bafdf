"""Grid search over the settings of a profile: the measures of all points, and the best trained.

The results file has one line of JSON for each point of the grid. The first line is the header:
profile, grid, training and validation set, and versions of software. Points follow in the order of
the grid, so that any number of complete lines is a valid beginning. A killed search resumes there;
a complete one is only read.
"""

import hashlib
import json
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
from inspector.report.picture import require
from inspector.text import progress
from inspector.training.train import LeftOut, classified, profile_at
from inspector.verdict import resumed
from noiseclassifier.jsontext import from_json
from noiseclassifier.modelfile import versions
from noiseclassifier.recording import check_apart, folds, group_of
from noiseclassifier.tuning import (
    ESTIMATOR_SETTINGS,
    Criterion,
    Grid,
    Measures,
    Point,
    Trial,
    Validation,
    measure,
    order,
    validate,
)
from noisemodel.files import refuse_existing, replacing
from noisemodel.parallel import DIED, Jobs, in_order

FORMAT = "noise-tuning/1"
BATCHES, WORKERS = 4, 16
"""Least number of batches per job, since a stopped job loses one and all should end at nearly the
same time; and for how many workers of a cluster there should be enough."""
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
        profile: One of ``inspector.training.train.PROFILES``.
        rate: Rate of the model, in [Hz], to which faster runs are decimated.
        grid: Texts that `Grid.of` reads.
    """

    training: Sequence[Path]
    validation: Sequence[Path] = ()
    part: str = "all"
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
        """Train the best point on the whole training set, and write the model."""
        best = self.profiles[self.ranked(criterion)[0]]
        learn, check = list(self.trial.recordings), list[nc.Recording]()
        if self.search.validation:
            ((first, second),) = self.trial.splits
            learn, check = [learn[i] for i in first], [learn[i] for i in second]
        examples = nc.Examples.read(learn, best)
        validation = nc.Dataset.of(check, best, training=False) if check else None
        trained = nc.Classifier.train(examples, best, validation=validation)
        trained.save(output, overwrite=overwrite)

    def table(self, criterion: Criterion, *, rows: int = 10) -> str:
        """The best points as a table, with remarks."""
        names = list(self.grid.axes)
        ranked, points = self.ranked(criterion)[:rows], list(self.grid.points())
        untuned = {name: getattr(self.untuned, name) for name in names}
        cells = [
            ["", *("" for _ in names), *(upper for upper, _ in HEADS.values())],
            ["", *names, *(lower for _, lower in HEADS.values())],
            *([str(n), *_cells(points[i], self.measures[i])] for n, i in enumerate(ranked, 1)),
            ["untuned", *_cells(untuned, self.reference.measures()[0])],
        ]
        widths = [7, *(max(WIDTH, len(name) + 2) for name in names), *(WIDTH for _ in HEADS)]
        lines = ["".join(c.rjust(w) for c, w in zip(row, widths, strict=True)) for row in cells]
        return "\n".join([self._basis(), "", *lines, "", *self._remarks(criterion)])

    def as_dict(self, criterion: Criterion, *, rows: int = 10) -> dict[str, Any]:
        """The best points as JSON can hold them."""
        points, ranked = list(self.grid.points()), self.ranked(criterion)
        return {
            "points": len(points),
            "criterion": criterion,
            "shared_by": {name: self._shared(name) for name in HEADS},
            "best": [{**points[i], **self.measures[i].as_dict()} for i in ranked[:rows]],
            "profile": self.profiles[ranked[0]].as_dict(),
            "untuned": self.reference.measures()[0].as_dict(),
        }

    def along(self, name: str, criterion: Criterion) -> list[tuple[Any, Measures]]:
        """Values of a setting and the measures there; all others are the best point's."""
        points, best = list(self.grid.points()), self.ranked(criterion)[0]
        others = {key: value for key, value in points[best].items() if key != name}
        return [
            (point[name], found)
            for point, found in zip(points, self.measures, strict=True)
            if others.items() <= point.items()
        ]

    def draw(self, path: Path, criterion: Criterion, *, overwrite: bool = False) -> None:
        """Draw the accuracy along each setting around the best point, as a PNG file."""
        require()
        from matplotlib.figure import Figure

        best = self.profiles[self.ranked(criterion)[0]]
        names = list(self.grid.axes)
        figure = Figure(figsize=(4.0 * len(names), 3.4), dpi=100, layout="constrained")
        row = figure.subplots(1, len(names), squeeze=False, sharey=True)[0]
        for axes, name in zip(row, names, strict=True):
            values, measures = zip(*self.along(name, criterion), strict=True)
            words = isinstance(values[0], str)
            places = list(range(len(values))) if words else list(values)
            for measure_name in ("balanced_accuracy", "subset_accuracy"):
                shares = [getattr(each, measure_name) for each in measures]
                axes.plot(places, shares, ".-", label=measure_name.replace("_", " "))
            place = values.index(getattr(best, name))
            axes.axvline(places[place], color="0.6", ls=":")
            if words:
                axes.set_xticks(places, values)
            elif min(values) > 0 and max(values) >= 100 * min(values):
                axes.set_xscale("log")
            best_value = getattr(best, name)
            axes.set_xlabel(f"{name}, best: {best_value if words else format(best_value, '.6g')}")
            axes.grid(alpha=0.4)
        row[0].set_ylabel("share of frames, or mean recall")
        row[0].legend(fontsize=8)
        figure.suptitle(f"{self.search.profile}: accuracy along each setting, others at the best")
        with replacing(path, overwrite=overwrite) as temporary:
            figure.savefig(temporary, format="png")

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
            name = criterion.replace("-", "_")
            value, words = getattr(self.measures[best], name), criterion.replace("-", " ")
            lines.append(
                f"{self._share(name)} the best {words}, {value:.1%}; the log-loss breaks ties."
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
                end = f"{name} {value:.6g} is an end of the grid"
                lines.append(f"{end}: a wider one may hold better.")
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
        output: The results file; the search resumes if it exists.
        model: A model file to write afterwards; if it exists, it is refused before the work.
        jobs: Number of parallel processes, or the address of a Dask scheduler.
        overwrite: Whether to discard the results in the file.
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
    with opened(output, facts, points, overwrite=overwrite) as results:
        done = len(results.measures)
        least = BATCHES * (jobs if isinstance(jobs, int) else WORKERS)
        batches = _batches(points[done:], profiles[done:], least)
        one, names = partial(measure, trial=trial), list(grid.axes)
        found = in_order(one, batches, jobs=jobs, died=partial(_died, names=names))
        for measures in progress(found, "tune", total=len(batches)):
            results.add(measures)
    return Tuned(search, grid, profiles, results.measures, base, reference, trial)


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


def _cells(point: Point, measures: Measures) -> list[str]:
    cells = [value if isinstance(value, str) else f"{value:.6g}" for value in point.values()]
    for name in HEADS:
        value = getattr(measures, name)
        figure = f"{value:.4f}" if name == "log_loss" else f"{value:.1%}"
        cells.append("-" if isnan(value) else figure)
    return cells


# --- the results file


@dataclass(eq=False)
class Results:
    """The measures of the first points of a grid, in their order."""

    points: Sequence[Point]
    measures: list[Measures]
    _append: Callable[[Mapping[str, Any]], None]

    def add(self, measures: Sequence[Measures]) -> None:
        """Append the measures of the next points, each flushed to the disk."""
        points = self.points[len(self.measures) :][: len(measures)]
        for point, each in zip(points, measures, strict=True):
            self._append({**point, **each.as_dict()})
        self.measures += measures


@contextmanager
def opened(
    path: Path, settings: Mapping[str, Any], points: Sequence[Point], *, overwrite: bool = False
) -> Iterator[Results]:
    """Open a results file to resume, or create it.

    Args:
        settings: The settings of the search, by name, as JSON can hold them.
    """
    header = {"format": FORMAT, **settings}

    def read(first: bytes, rows: list[bytes]) -> list[Measures]:
        _check_header(path, first, json.loads(json.dumps(header)))
        return _measures(path, rows, points)

    refused = partial(_refused, path)
    with resumed(path, header, read, refused, afresh=overwrite) as (measures, append):
        yield Results(points, measures or [], append)


def _refused(path: Path, problem: str) -> InspectorError:
    return InspectorError(f"{path}: {problem}; name another file, or overwrite it (--overwrite)")


def _check_header(path: Path, line: bytes, settings: Mapping[str, Any]) -> None:
    try:
        there = from_json(line)
    except ValueError:
        there = None
    if not isinstance(there, dict) or not str(there.get("format")).startswith("noise-tuning/"):
        raise _refused(path, "holds no results of tuning")
    for topic, mine in settings.items():
        other = there.get(topic)
        if other == mine:
            continue
        difference = f"{other}, not {mine}"
        if isinstance(other, dict) and isinstance(mine, dict):
            name = next(name for name in [*mine, *other] if other.get(name) != mine.get(name))
            difference = f"{name} was {'in' if name in other else 'not in'} it"
            if name in other and name in mine:
                difference = f"{name} differs"
        raise _refused(path, f"holds results of another {topic.replace('_', ' ')} ({difference})")


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
