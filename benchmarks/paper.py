"""The three tables of the paper, with the measures of models on simulated runs.

    python benchmarks/paper.py --training DATA --test DATA … --output build/paper
        [--part test] [--from 10] [--good DATA …] [--seeds 8] [--profiles norms …]
        [--models FILE …] [--limit RUNS] [--jobs 2]

Profiles are trained on the training part of a data set; since the time of libsvm grows with the
square of the frames, `--seeds` limits the seeds of each robot. A profile with a model in the output
is not trained again. All models, also the shipped ones, are measured on the same runs: by frames of
annotated blocks, as in the paper, and by false alarms in whole runs. The test set is what is held
out by hash, from the seed `--from` on. Hours of good motion (`--good`) count for false alarms only:
as a part of all frames they would make every error small.

The third table is the question of the paper whether a model serves another robot: the same models
get fewer joints, in the paper the knees and ankles of LOLA. Samples have norms of whole limbs, and
only the legs of our walkers are driven, so that both legs of TALOS have 98 % of the power of its
noise; one leg has half of it, with other values over time. For Go2 it is two feet that swing
together, since front and hind legs are similar. Failures at a foot that is left out count too.
"""

import argparse
import os
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple, NoReturn

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np

import noiseclassifier as nc
from inspector.training.train import PARTS, classified, of_run, train
from noiseclassifier.assessment import measure, number, percent, predict
from noiseclassifier.matching import Predictions
from noiseclassifier.scenarios.robots import limbs
from noisemodel import Run
from noisemodel.parallel import DIED, in_order

SHIPPED = Path(__file__).parents[1] / "models"
RATE = 10_000.0
PROFILES = (
    *("noisytest-linear", "noisytest-rbf", "paper-linear", "paper-rbf"),
    *("scalar", "norms"),
)
HALF = {"talos": ("left_sole_link",), "go2": ("FL_foot", "RR_foot")}
"""Limbs of the third table; an arm has only one."""


class Printed(NamedTuple):
    """The measures of a model in the paper, in percent of all frames."""

    false_negative: tuple[float, ...]
    false_positive: tuple[float, ...]
    detection: float
    accuracy: float


PAPER = {
    "linear": Printed((0.0, 1.0, 5.8, 4.7), (5.8, 5.8, 0.0, 0.0), 94.2, 88.5),
    "RBF": Printed((0.5, 2.6, 6.3, 0.0), (2.1, 2.6, 0.0, 4.7), 97.9, 90.6),
    "RBF on reduced joints": Printed((1.6, 4.2, 6.3, 7.3), (9.4, 7.9, 0.0, 2.1), 90.6, 80.6),
}
FRAMES = np.array([129, 11, 12, 39])
"""Frames of each class in the paper's validation set, as its annotations are cut."""


class Score(NamedTuple):
    """The measures of a model on some runs."""

    frames: nc.Assessment
    """On the test set, by frames of blocks."""
    alarms: nc.Assessment
    """On the test set and the good motion, by alarms."""


@dataclass(frozen=True)
class Measured:
    """The measures of a model."""

    name: str
    trained_on: int
    whole: Score
    reduced: tuple[Score, ...]


def main() -> None:
    """Train, measure and print."""
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("--training", type=Path, required=True)
    arguments.add_argument("--test", type=Path, nargs="+", required=True)
    arguments.add_argument("--output", type=Path, required=True, help="folder of the models")
    arguments.add_argument("--part", choices=PARTS, default="test", help="of the test")
    arguments.add_argument("--from", type=int, default=0, dest="first", help="seed of the test")
    arguments.add_argument("--good", type=Path, nargs="*", default=[], help="measured whole")
    arguments.add_argument("--seeds", type=int, help="of each robot, to train on; by default all")
    arguments.add_argument("--profiles", nargs="*", choices=PROFILES, default=PROFILES)
    arguments.add_argument("--models", type=Path, nargs="*", default=sorted(SHIPPED.glob("*.npz")))
    arguments.add_argument("--limit", type=int, help="most runs to train on and to measure")
    arguments.add_argument("--jobs", type=int, default=1, help="parallel models")
    given = arguments.parse_args()
    known = spread(first_seeds(files([given.training], "training"), given.seeds), given.limit)
    fresh = [path for path in files(given.test, given.part) if seed_of(path) >= given.first]
    test, good = spread(fresh, given.limit), spread(files(given.good, "all"), given.limit)
    given.output.mkdir(parents=True, exist_ok=True)
    work = partial(measured, known=known, test=test, good=good, folder=given.output)
    found = list(in_order(work, [*given.models, *given.profiles], jobs=given.jobs, died=stop))
    print(tables(found[len(given.models) :] + found[: len(given.models)]))
    print(f"\nRuns trained on: {', '.join(f'{one.name} {one.trained_on}' for one in found)}.")


def stop(task: Path | str) -> NoReturn:
    """Give up: a table without this row is none."""
    raise SystemExit(f"{task}: {DIED}")


def files(folders: Sequence[Path], part: str) -> list[Path]:
    """The samples of a part."""
    every = [path for folder in folders for path in sorted(folder.rglob("*.npz"))]
    if part == "all":
        return every
    test = part == "test"
    return [path for path in every if nc.held_out(nc.group_of(name_of(path))) == test]


def name_of(path: Path) -> str:
    """Name of the recording of a sample."""
    return f"{path.parent.name}/{path.stem}"


def seed_of(path: Path) -> int:
    """Seed of a sample, from its name."""
    return int(path.stem.rpartition("-")[2])


def first_seeds(paths: Sequence[Path], count: int | None) -> list[Path]:
    """The samples of the lowest seeds of each robot."""
    seeds: dict[str, set[int]] = {}
    for path in paths:
        seeds.setdefault(path.parent.name, set()).add(seed_of(path))
    kept = {robot: sorted(each)[:count] for robot, each in seeds.items()}
    return [path for path in paths if seed_of(path) in kept[path.parent.name]]


def spread(paths: Sequence[Path], limit: int | None) -> list[Path]:
    """At most so many samples, evenly from the list."""
    count = len(paths) if limit is None else min(limit, len(paths))
    return [paths[index * len(paths) // count] for index in range(count)]


def measured(
    job: str | Path,
    *,
    known: Sequence[Path],
    test: Sequence[Path],
    good: Sequence[Path],
    folder: Path,
) -> Measured:
    """Measures of a model; a profile is trained first."""
    path = job if isinstance(job, Path) else trained(job, known, folder)
    classifier, reduced = nc.Classifier.load(path), ()
    every = [*test, *good]
    names = {name_of(one) for one in test}
    both = (each for each, _ in classified(every, classifier.rate))
    read = (each for each in both if isinstance(each, nc.Recording))
    found = predictions(classifier, read)
    if classifier.profile.kernel != "linear":
        limbed = [one for one in every if one.parent.name in HALF]
        half = predictions(classifier, halved(limbed, classifier.rate))
        same = {one.name for one in half}
        reduced = scored([one for one in found if one.name in same], names), scored(half, names)
    name = path.stem if isinstance(job, str) else f"{path.stem}, as shipped"
    return Measured(name, len(classifier.runs), scored(found, names), reduced)


def predictions(classifier: nc.Classifier, read: Iterable[nc.Recording]) -> list[Predictions]:
    """Predictions for recordings that the model was not trained on; of equal ones, the first."""
    found: dict[str, Predictions] = {}
    for recording in read:
        nc.check_apart(classifier.runs, {recording.name: recording.sha256})
        if recording.sha256 not in found:
            found[recording.sha256] = predict(classifier, recording)
    return list(found.values())


def scored(found: Sequence[Predictions], test: Collection[str]) -> Score:
    """Measures by frames on the test set, and by alarms on all."""
    return Score(measure([one for one in found if one.name in test]), measure(found))


def trained(profile: str, paths: Sequence[Path], folder: Path) -> Path:
    """Model of a profile, trained unless it exists."""
    path = folder / f"{profile}.npz"
    if not path.exists():
        train(paths, profile, RATE, path)
    elif set(nc.Classifier.load(path).runs) != set(map(name_of, paths)):
        raise SystemExit(f"{path}: trained on other runs; remove it, or take another --output")
    return path


def halved(paths: Sequence[Path], rate: float) -> Iterator[nc.Recording]:
    """Recordings of half of the limbs of runs."""
    for path in paths:
        run = Run.load(path)
        robot = str(run.robot)
        assert run.velocity_desired is not None
        names = [joint for limb in HALF[robot] for joint in limbs(robot)[limb]]
        mine = [run.joint_names.index(joint) for joint in names]
        half = Run(
            time=run.time,
            joint_names=tuple(names),
            velocity=run.velocity[:, mine],
            velocity_desired=run.velocity_desired[:, mine],
            robot=robot,
            blocks=run.blocks,
            meta=run.meta,
        )
        yield of_run(path, half, rate)


def tables(found: Sequence[Measured]) -> str:
    """The three tables, in Markdown."""
    linear = [(one.name, one.whole) for one in found if not one.reduced]
    others = [(one.name, one.whole) for one in found if one.reduced]
    halves = [
        (f"{one.name}, {what}", score)
        for one in found
        for what, score in zip(("all joints", "half of the limbs"), one.reduced, strict=False)
    ]
    rows = dict(zip(PAPER, (linear, others, halves), strict=True))
    return "\n\n".join(_table(title, mine) for title, mine in rows.items())


def printed(title: str) -> str:
    """Row of the measures in the paper, and of those that follow from them."""
    table = PAPER[title]
    missed = (np.array(table.false_negative) / 100.0 * FRAMES.sum()).round()
    missed_failures = round(table.false_positive[0] / 100.0 * FRAMES.sum())
    recall, balanced = 1.0 - missed_failures / FRAMES[1:].sum(), (1.0 - missed / FRAMES).mean()
    return _row(
        f"*the paper, {title}*",
        *(" / ".join(f"{share:.1f}" for share in side) for side in table[:2]),
        *(f"{table.detection}%", f"{table.accuracy}%", f"{recall:.1%}", f"{balanced:.1%}", "?"),
    )


def row(name: str, score: Score) -> str:
    """Row of our measures."""
    frames = score.frames.frames
    errors = (frames["false_negative_errors"], frames["false_positive_errors"])
    shares = (
        *(frames["failure_detection_rate"], frames["subset_accuracy"]),
        *(frames["failure_recall"], frames["balanced_accuracy"]),
    )
    return _row(
        name,
        *(" / ".join(f"{100.0 * side[c].value:.1f}" for c in nc.CLASSES) for side in errors),
        *map(percent, shares),
        number(score.alarms.protocol.pooled["false_alarms_per_hour"]),
    )


def _table(title: str, found: Sequence[tuple[str, Score]]) -> str:
    head = (
        *("", "false negative errors [%]: ok / impact / highacc. / osc.", "false positive [%]"),
        *("failure detection rate", "subset accuracy", "failure recall", "balanced accuracy"),
        "false alarms per hour",
    )
    lines = [f"### {title}", "", _row(*head), "|---" * len(head) + "|", printed(title)]
    lines += [row(name, score) for name, score in found]
    for _, (frames, alarms) in found[:1]:
        counts = frames.evaluation.confusion.sum(axis=1).tolist()
        each_class = ", ".join(f"{n} {c}" for c, n in zip(nc.CLASSES, counts, strict=False))
        lines += [
            "",
            f"{sum(counts)} frames ({each_class}) of {frames.runs} runs in {frames.groups} groups;"
            f" false alarms in {alarms.protocol.counts['ok_hours']:.3g} h of ok motion of"
            f" {alarms.runs} runs in {alarms.groups} groups.",
        ]
    return "\n".join(lines)


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
