"""Models on files: training, evaluation, and the grid search over the settings of a profile.

The results file of a search has one line of JSON for each point of the grid. The first line is the
header: profile, grid, training and validation set, and versions of software. Points follow in the
order of the grid, so that any number of complete lines is a valid beginning. A killed search
resumes there; a complete one is only read.
"""

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
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
from inspector.library import Events, lines, signals_of
from inspector.logs.clocks import without_hold
from inspector.logs.mapping import check_joints
from inspector.text import counted, progress
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
    in_folder = path.parent.name == run.robot
    name, facts = f"{run.robot}/{path.stem}" if in_folder else path.stem, _facts(run)
    if chosen.rate < wanted * (1 - NOMINAL):
        return nc.Unanswered(name, facts, f"rate {chosen.rate:g} Hz < {wanted:g} Hz"), None
    lower = min(wanted, chosen.rate)
    decimated = nm.decimated(chosen, lower)
    if not (decimated.blocks or "events" in run.meta or bare_too):
        raise InspectorError(f"{path}: has no annotated blocks")
    found = nc.Recording(
        name=name,
        signal=signals_of(decimated),
        rate=lower,
        blocks=tuple(nc.Block(b.start, b.stop, b.label) for b in decimated.blocks),
        start=float(decimated.time[0]),
        valid=decimated.mask,
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        events=_faults(path, chosen),
        facts=facts,
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


def annotated(
    found: Iterable[nc.Recording | nc.Unanswered], rate: float, left_out: dict[str, list[str]]
) -> Iterator[nc.Recording]:
    """Annotated recordings of a rate in [Hz]; names of the others come to ``left_out``, by reason.

    A profile cannot be trained on those.
    """
    for each in found:
        if isinstance(each, nc.Recording) and each.blocks:
            yield each
            continue
        below = isinstance(each, nc.Unanswered)
        reason = f"below {rate:g} Hz" if below else "without annotated blocks"
        left_out.setdefault(reason, []).append(each.name)


def _told(left_out: Mapping[str, Sequence[str]]) -> str:
    """Runs that are left out in a line: how many for each reason, and the name of one."""
    if not left_out:
        return "no run was left out"
    (reason, first), *others = left_out.items()
    more = "".join(f", {len(names)} {why}" for why, names in others)
    return f"left out: {counted(len(first), 'run')} {reason}{more}, e.g. {first[0]}"


def train(
    inputs: Sequence[Path],
    profile: str,
    rate: float | None,
    output: Path,
    *,
    part: str = "all",
    overwrite: bool = False,
) -> tuple[nc.Evaluation, str]:
    """Train a model and write it; its evaluation on the same runs, and a line on those left out.

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
    chosen = None
    if profile != ANY_RATE:
        chosen = profile_at(profile, RATE if rate is None else rate)
    elif rate is not None:
        raise OptionError(f"profile {profile} is for any rate; leave out --rate {rate:g}")
    refuse_existing(output, overwrite=overwrite)
    files, left_out = count(inputs), dict[str, list[str]]()
    thin = THIN if files > MANY else 1
    taken = None if chosen is None else chosen.rate
    read = progress(classified(inputs, taken, part, bare_too=True), "read", total=files)
    usable = annotated((recording for recording, _ in read), taken or LOWEST, left_out)
    model: nc.Classifier | nc.General
    try:
        if chosen is None:
            parts = list(nc.frames_of(usable, nc.ANY, thin=thin))
            if not parts:
                raise nc.NoFrameError(0, nc.ANY.classes)
            frames = nc.Dataset.joined(parts)
            model = nc.General.train(frames, nc.ANY, thin=thin)
        else:
            frames = nc.Dataset.of(usable, chosen)
            model = nc.Classifier.train(frames, chosen)
    except nc.NoFrameError as error:
        if error.count or not left_out:
            raise
        raise InspectorError(f"no run to train {profile} on; {_told(left_out)}") from error
    model.save(output, overwrite=overwrite)
    return model.evaluate(frames), _told(left_out)


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

    def localise(recording: nc.Recording, labels: nc.Labels) -> tuple[Events, Events]:
        run = source[recording.name]
        if run is None:  # NoisyTest's noise, as the motion of one joint
            velocity = nc.signals.stacked(recording.signal, (nc.NOISE,))[:, None]
            time, valid = recording.time, recording.valid
            run = nm.Run(time=time, velocity=velocity, joint_names=("joint0",), valid=valid)
        run = without_hold(run)
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


@dataclass(frozen=True, eq=False)
class Tuned:
    """The results of a grid search."""

    profile: str  # one of ``PROFILES``
    grid: Grid
    profiles: Sequence[nc.Profile]  # of each point
    measures: Sequence[Measures]  # of each point
    untuned: nc.Profile
    reference: Validation  # the predictions of the untuned profile
    trial: Trial

    @property
    def ranked(self) -> list[int]:
        """Indices of the points, best first; ties stay in the order of the grid."""
        return sorted(range(len(self.measures)), key=lambda point: rank(self.measures[point]))

    def train(self, output: Path, *, overwrite: bool = False) -> None:
        """Train the best point on the whole training set, and write the model."""
        best = self.profiles[self.ranked[0]]
        examples = self.trial.examples(best, training=True)  # of folds, these are all
        folded = len(self.trial.splits) > 1
        validation = None if folded else self.trial.examples(best, training=False)
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
        if len(splits) > 1:
            others = f"the same, in {len(splits)} folds"
        return (
            f"{len(self.grid)} points of {self.profile}, trained on"
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
    training: Sequence[Path],
    output: Path,
    *,
    validation: Sequence[Path],
    number_of_folds: int,
    part: str,
    profile: str,
    rate: float,
    grid: Sequence[str],
    model: Path | None,
    jobs: Jobs,
    overwrite: bool,
) -> Tuned:
    """Measure the points of a grid that a results file does not have yet.

    Args:
        validation: Runs to measure on; without any, those of the training set are folded.
        rate: Rate of the model, in [Hz], to which faster runs are decimated.
        grid: Texts that `Grid.of` reads.
        model: A model file to write afterwards; if it exists, it is refused before the work.
    """
    if model:
        refuse_existing(model, overwrite=overwrite)
    base = profile_at(profile, rate)
    axes = Grid.of(grid, base.kernel)
    points, profiles = list(axes.points()), axes.profiles(base)
    learn, check = (_read_part(paths, base, part) for paths in (training, validation))
    trial = _trial(learn, check, number_of_folds)
    settings = {
        "grid": {name: list(values) for name, values in axes.axes.items()},
        "profile": {k: v for k, v in base.as_dict().items() if k not in axes.axes},
        "training_set": _digests(learn),
        "validation_set": _digests(check),
        "number_of_folds": None if check else number_of_folds,
        "software": versions(),
    }
    reference = validate([base], trial)  # first: data that cannot be trained on leave no file
    with opened(output, settings, points, overwrite=overwrite) as (done, append):
        least = BATCHES * (jobs if isinstance(jobs, int) else WORKERS)
        batches = _batches(profiles[len(done) :], axes, least)
        one, died = partial(measure, trial=trial), partial(_died, names=list(axes.axes))
        found = in_order(one, batches, jobs=jobs, died=died)
        for measures in progress(found, "tune", total=len(batches)):
            append(measures)
    return Tuned(profile, axes, profiles, done, base, reference, trial)


def _read_part(paths: Sequence[Path], base: nc.Profile, part: str) -> list[nc.Recording]:
    left_out: dict[str, list[str]] = {}
    read = (one for one, _ in classified(paths, base.rate, part, bare_too=True))
    found = list(annotated(read, base.rate, left_out))
    if paths and not found:
        names = ", ".join(map(str, paths))
        reason = f"; {_told(left_out)}" if left_out else ""
        raise InspectorError(f"{names}: no recording (of part {part!r}){reason}")
    return found


def _trial(
    training: Sequence[nc.Recording], validation: Sequence[nc.Recording], count: int
) -> Trial:
    if not validation:
        return Trial(training, folds([group_of(recording.name) for recording in training], count))
    # A name may be there twice: both folders of NoisyTest have the same names.
    other = {
        f"{one.name}{' of the validation set' * (group_of(one.name) == one.name)}": one.sha256
        for one in validation
    }
    check_apart({one.name: one.sha256 for one in training}, other)
    return Trial.against(training, validation)


def _batches(profiles: Sequence[nc.Profile], grid: Grid, least: int) -> list[list[nc.Profile]]:
    """Points in groups that share their features, or their kernel matrix if those are too few."""
    found: list[list[nc.Profile]] = []
    for fast in (ESTIMATOR_SETTINGS, ("regularization",)):
        slow = [name for name in grid.axes if name not in fast]
        groups = groupby(profiles, key=lambda each: [getattr(each, name) for name in slow])
        found = [list(group) for _, group in groups]
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

    def refused(problem: str) -> InspectorError:
        how = "name another file, or overwrite it (--overwrite)"
        return InspectorError(f"{path}: {problem}; {how}")

    header, what = {"format": FORMAT, **settings}, "results of tuning"
    names, done = [field.name for field in fields(Measures)], list[Measures]()
    with resumed(path, header, refused, what=what, afresh=overwrite) as (rows, write):
        if len(rows) > len(points):
            raise refused(f"is damaged: {len(rows)} points of {len(points)}")
        for number, (row, point) in enumerate(zip(rows, points, strict=False), start=2):
            try:
                found = from_json(row)
                values = [nan if found[name] is None else float(found[name]) for name in names]
                fits = {name: found[name] for name in point} == point
            except (ValueError, KeyError, TypeError, OverflowError):
                fits = False
            if not fits:
                raise refused(f"is damaged in line {number}")
            done.append(Measures(*values))

        def append(measures: Sequence[Measures]) -> None:
            for each in measures:
                write({**points[len(done)], **each.as_dict()})
                done.append(each)

        yield done, append
