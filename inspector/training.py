"""Models on files: training, evaluation, and the grid search over the settings of a profile.

The results file of a search has one line of JSON for each point of the grid. The first line is the
header: profile, grid, training and validation set, and versions of software. Points follow in the
order of the grid, so that any number of complete lines is a valid beginning. A killed search
resumes there; a complete one is only read.
"""

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from functools import partial
from itertools import groupby
from math import isnan, nan
from pathlib import Path
from typing import Any, NoReturn

import noiseclassifier as nc
import noisemodel as nm
from inspector.analysis import extents
from inspector.audit.signals import without_placeholder
from inspector.errors import InspectorError, OptionError
from inspector.library import lines, signals_of
from inspector.logs.clocks import without_hold
from inspector.logs.mapping import check_joints
from inspector.text import progress
from inspector.verdict import resumed
from noiseclassifier import Assessment
from noiseclassifier.jsontext import from_json
from noiseclassifier.modelfile import versions
from noiseclassifier.profile import HIGHEST, LOWEST, NOMINAL
from noiseclassifier.recording import check_apart, folds, group_of
from noiseclassifier.tuning import (
    ESTIMATOR_SETTINGS,
    Grid,
    Measures,
    Point,
    Trial,
    Validation,
    measure,
    rank,
    validate,
)
from noisemodel.files import also_reading, refuse_existing
from noisemodel.parallel import DIED, Jobs, in_order

# A recording, and the run file that it is of.
Read = tuple[nc.Recording | nc.Unanswered, nm.Run | None]
# Findings by their frames, and from onset to end.
Located = tuple[tuple[nc.Event, ...], tuple[nc.Event, ...]]
ANY_RATE = "general"  # the profile of a model for any rate
RATE = 10_000.0  # rate of a model of one rate unless another is given, in [Hz]
MANY = 500  # logs above which a general model learns from a part of the quiet `ok` frames,
THIN = 8  # which is every so many
# Profiles by name, at a rate in [Hz].
PROFILES: dict[str, Callable[[float], nc.Profile]] = {
    "logbands": nc.LogBands().at,
    "noisytest-rbf": lambda _: nc.Profile.noisytest("rbf"),
    "noisytest-linear": lambda _: nc.Profile.noisytest("linear"),
    "paper-rbf": lambda _: nc.Profile.paper("rbf"),
    "paper-linear": lambda _: nc.Profile.paper("linear"),
}


def classified(
    inputs: Sequence[Path], rate: float | None, part: str = "all", *, bare_too: bool = False
) -> Iterator[Read]:
    """Annotated noise as `inspector classify` takes it, and the runs that it cannot take.

    A desired velocity that is a placeholder, and an error of zero throughout, are left out of run
    files, and values that are held count once. A simulated run may have no annotated block: its
    failures were too faint to be labelled either way.

    Args:
        rate: The rate to decimate runs to, in [Hz]; slower ones have no verdict. None: each at its
            own, as a general model takes it.
        part: "all", "training" or "test", by ``noiseclassifier.held_out``.
        bare_too: Whether to yield run files without any annotation, in place of an error.
    """
    taken: set[str] = set()
    for path, (one, run) in _all(inputs, rate, bare_too=bare_too):
        each = _apart(one, path, taken)
        if part == "all" or nc.held_out(nc.group_of(each.name)) == (part == "test"):
            yield each, run


def _all(
    inputs: Sequence[Path], rate: float | None, *, bare_too: bool
) -> Iterator[tuple[Path, Read]]:
    for path in inputs:
        if path.is_dir() and any(path.glob("*.toml")):
            also_reading([path])
            for each in nc.noisytest.read_folder(path, rate=rate):
                yield path / each.name, (each, None)
            continue
        for file in sorted(path.rglob("*.npz")) if path.is_dir() else [path]:
            also_reading([file])
            yield file, _as_classified(file, rate, bare_too=bare_too)


def _as_classified(path: Path, rate: float | None, *, bare_too: bool) -> Read:
    run, _ = without_placeholder(nm.Run.load(path))
    check_joints(run.joint_names, run.robot)
    slower = without_hold(run)
    wanted = min(max(slower.rate, LOWEST), HIGHEST) if rate is None else rate
    held = rate is None or slower.rate >= rate * (1 - NOMINAL)
    chosen = slower if held else run
    if chosen.rate < wanted * (1 - NOMINAL):
        reason = f"rate {chosen.rate:g} Hz < {wanted:g} Hz"
        return nc.Unanswered(_name(path, run.robot), _facts(run), reason), None
    lower = min(wanted, chosen.rate)
    decimated = nm.decimated(chosen, lower)
    if not (decimated.blocks or "events" in run.meta or bare_too):
        raise InspectorError(f"{path}: has no annotated blocks")
    found = nc.Recording(
        name=_name(path, run.robot),
        signal=signals_of(decimated),
        rate=lower,
        blocks=tuple(nc.Block(b.start, b.stop, b.label) for b in decimated.blocks),
        start=float(decimated.time[0]),
        valid=decimated.mask,
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        events=_faults(path, chosen),
        facts=_facts(run),
    )
    return found, run


def _apart(
    one: nc.Recording | nc.Unanswered, path: Path, taken: set[str]
) -> nc.Recording | nc.Unanswered:
    """Name a recording apart from others of its name, by as much of its folder as it takes.

    A simulated run keeps its robot, scenario and seed, which tell the group.
    """
    name, depth = one.name, 0
    robot, _, rest = name.partition("/")
    folders = path.absolute().parent.parts[1:]
    folders = folders[:-1] if rest and folders[-1:] == (robot,) else folders
    while name in taken and depth < len(folders):
        depth += 1
        folder = "/".join(folders[-depth:])
        name = f"{robot}/{folder}/{rest}" if rest else f"{one.name} ({folder})"
    taken.add(name)
    return one if name == one.name else replace(one, name=name)


def _name(path: Path, robot: str | None) -> str:
    """Name of a run file: with its robot before, if its folder is named so."""
    return f"{robot}/{path.stem}" if path.parent.name == robot else path.stem


def _facts(run: nm.Run) -> dict[str, str]:
    """Robot, scenario and domain of a run, as far as they are known."""
    domain = run.meta.get("domain")
    named = domain.get("name") if isinstance(domain, Mapping) else domain
    found = {
        "robot": run.robot,
        "scenario": run.meta.get("scenario"),
        "domain": named or run.meta.get("simulator") or run.meta.get("source"),
    }
    return {name: str(value) for name, value in found.items() if value}


def _faults(path: Path, run: nm.Run) -> tuple[nc.Fault, ...]:
    """All faults that were injected into a run, as the events of its meta have them."""
    bad = [block for block in run.blocks if block.label != "ok"]
    begin, end, found = float(run.time[0]), float(run.time[-1]), []
    events = run.meta.get("events") or ()
    for event in events if isinstance(events, list | tuple) else (events,):
        try:
            label, start, stop = str(event["label"]), float(event["start"]), float(event["stop"])
            overlaps = any(block.start <= stop and block.stop >= start for block in bad)
            felt = float(event["labelled"]) > 0.0 if "labelled" in event else overlaps
        except (LookupError, TypeError, ValueError, OverflowError) as error:
            raise InspectorError(
                f"{path}: an event of its meta lacks label, start or stop as numbers in s"
            ) from error
        if stop > begin and start < end:  # a piece of a run has the events of all of it
            found.append(nc.Fault(start, stop, label, felt))
    return tuple(found)


def count(inputs: Sequence[Path]) -> int:
    """Number of recordings in files and folders, or a few more: the length of a progress bar."""
    return sum(
        sum(1 for file in path.rglob("*.*") if file.suffix in (".npz", ".toml")) or 1
        for path in inputs
    )


@dataclass(frozen=True)
class LeftOut:
    """Runs that a profile cannot be trained on."""

    runs: dict[str, list[str]] = field(default_factory=dict)  # their names, by reason

    def without(
        self, found: Iterable[nc.Recording | nc.Unanswered], profile: nc.Profile
    ) -> Iterator[nc.Recording]:
        """Recordings that have all signals of a profile, at its rate; notes the others."""
        for each in found:
            if isinstance(each, nc.Recording) and each.blocks:
                yield each
                continue
            below = isinstance(each, nc.Unanswered)
            reason = f"below {profile.rate:g} Hz" if below else "without annotated blocks"
            self.runs.setdefault(reason, []).append(each.name)

    def __str__(self) -> str:
        if not self.runs:
            return "no run was left out"
        counts = [f"{len(names)} {reason}" for reason, names in self.runs.items()]
        first = next(iter(self.runs.values()))
        counts[0] = counts[0].replace(" ", " run " if len(first) == 1 else " runs ", 1)
        return f"left out: {', '.join(counts)}, e.g. {first[0]}"


def train(
    inputs: Sequence[Path],
    profile: str,
    rate: float | None,
    output: Path,
    *,
    part: str = "all",
    overwrite: bool = False,
) -> tuple[nc.Evaluation, LeftOut]:
    """Train a model and write it.

    Runs below the rate and those without an annotation are left out; a desired velocity that is a
    placeholder is none, as in `inspector classify`.

    Args:
        inputs: Annotated run files, folders of them, or NoisyTest folders.
        profile: ``ANY_RATE``, or one of ``PROFILES``.
        rate: Rate of a model of one rate, in [Hz], to which faster runs are decimated; None for
            ``RATE``. A general model takes each run at its own.
        part: The part of the recordings to train on.
        overwrite: Whether a file that exists may be replaced.
    """
    general = profile == ANY_RATE
    if general and rate is not None:
        raise OptionError(f"profile {profile} is for any rate; leave out --rate {rate:g}")
    rate = None if general else RATE if rate is None else rate
    chosen = nc.ANY.at(LOWEST, (nc.NOISE,)) if rate is None else profile_at(profile, rate)
    refuse_existing(output, overwrite=overwrite)
    left_out = LeftOut()
    files = count(inputs)
    thin = THIN if files > MANY else 1
    read = progress(classified(inputs, rate, part, bare_too=True), "read", total=files)
    usable = left_out.without((recording for recording, _ in read), chosen)
    model: nc.Classifier | nc.General
    try:
        if general:
            parts = list(nc.frames_of(usable, nc.ANY, thin=thin))
            if not parts:
                raise nc.NoFrameError(0, nc.ANY.classes)
            frames = nc.Dataset.joined(parts)
            model = nc.General.train(frames, nc.ANY, thin=thin)
        else:
            frames = nc.Dataset.of(usable, chosen)
            model = nc.Classifier.train(frames, chosen)
    except nc.NoFrameError as error:
        if error.count or not left_out.runs:
            raise
        raise InspectorError(f"no run to train {profile} on; {left_out}") from error
    model.save(output, overwrite=overwrite)
    return model.evaluate(frames), left_out


def profile_at(name: str, rate: float) -> nc.Profile:
    """A profile by its name."""
    if name not in PROFILES:
        raise OptionError(f"no profile {name!r} of one rate; there are {', '.join(PROFILES)}")
    found = PROFILES[name](rate)
    if found.rate != rate:
        raise OptionError(f"profile {name} exists at {found.rate:g} Hz only, not {rate:g}")
    return found


def evaluate(
    model: Path, inputs: Sequence[Path], *, part: str = "all", seen_too: bool = False
) -> Assessment:
    """Measure a model."""
    classifier = nc.load(model)
    rate = None if isinstance(classifier, nc.General) else classifier.rate
    source: dict[str, nm.Run | None] = {}

    def read() -> Iterator[nc.Recording | nc.Unanswered]:
        for recording, run in classified(inputs, rate, part):
            source.clear()  # one run at a time stays in memory
            source[recording.name] = run
            yield recording

    def localise(recording: nc.Recording, labels: nc.Labels) -> Located:
        run = source[recording.name]
        if run is None:  # NoisyTest's noise, as the motion of one joint
            velocity = nc.signals.stacked(recording.signal, (nc.NOISE,))[:, None]
            time, valid = recording.time, recording.valid
            run = nm.Run(time=time, velocity=velocity, joint_names=("joint0",), valid=valid)
        return extents(run, labels, *(found.events for found in lines(run)))

    return nc.assess(
        classifier,
        progress(read(), "evaluate", total=count(inputs)),
        seen_too=seen_too,
        localise=localise,
    )


# --- grid search

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
    profile: str = "noisytest-rbf"  # one of ``PROFILES``
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


def _cells(point: Point, measures: Measures) -> list[str]:
    cells = [value if isinstance(value, str) else f"{value:.6g}" for value in point.values()]
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
