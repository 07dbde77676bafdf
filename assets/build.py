"""Make the files that ship: simulate a data set, train the models, measure them, cut the demo run.

    python assets/build.py [--folder build] [--jobs 2]

Models are trained on the training part of the data set. They are measured on what is held out by
hash of further seeds, and on good motion that is simulated for this alone; each gets a card beside
it, with the figures. Killed and started again, this simulates only what is missing.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import models
import scenarios
from inspector.progress import progress
from inspector.training.part import Part
from inspector.training.recordings import recordings
from inspector.training.training import train
from noisemodel import Run
from scenarios.dataset import make
from scenarios.folder import Folder
from scenarios.simulation import RECIPE
from scenarios.tasks import DatasetSpec, Task, choose

HERE = Path(__file__).parent
SEEDS = {"talos": 20, "go2": 40, "panda": 23, "solo12": 6, "anymal": 6}
"""Training seeds of each robot in every scenario, from 0; those that are held out are left out."""
LOOKED_AT, LAST = 55, 90
"""First test seed, and the one after the last: what is held out of them is measured on. What is
held out of the seeds below was used while the profiles were chosen."""
HOURS, FIRST = {"talos": 0.4, "go2": 0.4, "panda": 1.05}, 2000
"""Good motion of each robot in which false alarms are counted, in [h], and its first seed."""
MODELS = {
    "joints-1khz": ("joints", 1000.0),
    "general-10khz": ("general", 10_000.0),
    "general-1khz": ("general", 1000.0),
    "scalar-10khz": ("scalar", 10_000.0),
    "scalar-1khz": ("scalar", 1000.0),
}
"""Profile and rate, in [Hz], by name."""
DEMO = ("panda", "obstacle-full", 100, 4.0)
CARD = """# {name}

Classifies frames of noise at {rate:g} Hz: {classes}, or unknown.
Input signals: {signals}.

Made by `make models`: profile `{profile}`, trained on {runs} runs, the training part of
{seeds}, in every scenario (`scenarios`, recipe {recipe});
the model file has the hashes of all of them. The figures below are measured on what is held out by
hash of seeds {looked_at} to {last}, and on {hours:.3g} h more of good motion: robots of the
training set, seeds outside it (docs/classifier.md says how often this test set was used).

Not in the training set: any other robot, real drives (gears, friction other than Coulomb's, belts),
payloads, manipulation. Frames unlike the training set are out of distribution, as far as levels
alone show it. Real logs and other simulators: docs/classifier.md, "Open".

```
{report}
```
"""


def main() -> None:
    """Make everything."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--folder", type=Path, default=HERE.parent / "build")
    arguments.add_argument("--jobs", type=int, default=2)
    options = arguments.parse_args()
    data, good = options.folder / "data", options.folder / "good"
    tasks = [
        task
        for robot, count in SEEDS.items()
        for task in DatasetSpec(choice=choose((robot,)), seeds=LAST).tasks()
        if wanted(task, count)
    ]
    healthy = [
        task
        for robot, hours in HOURS.items()
        for task in DatasetSpec(
            choice=choose((robot,), healthy=True), first=FIRST, hours=hours
        ).tasks()
    ]
    simulate(data, tasks, options.jobs)
    simulate(good, healthy, options.jobs)
    for name, (profile, rate) in MODELS.items():
        path = HERE / "models" / f"{name}.npz"
        train([data], profile, rate, path, part=Part.TRAINING, overwrite=True)
        model = models.Classifier.load(path)
        report = str(models.assess(model, unseen(data, good, rate)))
        path.with_suffix(".md").write_text(card(name, model, report), encoding="utf-8")
        print(f"\n{name}\n{report}")
    demo().save(HERE / "runs" / "demo.npz", overwrite=True)


def wanted(task: Task, count: int) -> bool:
    """Whether a run is of the first seeds and not held out, or of the last, and held out."""
    if models.held_out(models.group_of(task.name)):
        return task.seed >= LOOKED_AT and task.robot in HOURS
    return task.seed < count


def simulate(path: Path, tasks: list[Task], jobs: int) -> None:
    """Simulate what is missing of a folder of samples."""
    folder = Folder.opened(path)
    missing = folder.missing(tasks)
    for _ in progress(make(folder, missing, jobs=jobs), "simulate", total=len(missing)):
        pass


def unseen(data: Path, good: Path, rate: float) -> Iterator[models.Recording]:
    """Runs that models are measured on."""
    yield from recordings([data], rate, Part.TEST)
    yield from recordings([good], rate)


def card(name: str, model: models.Classifier, report: str) -> str:
    """Card of a model: what it was trained on, its figures, its limits."""
    return CARD.format(
        name=name,
        signals=", ".join(model.profile.signals),
        rate=model.rate,
        classes=", ".join(model.classes),
        profile=MODELS[name][0],
        runs=len(model.runs),
        seeds=", ".join(f"{robot} (seeds 0 to {count - 1})" for robot, count in SEEDS.items()),
        recipe=RECIPE,
        looked_at=LOOKED_AT,
        last=LAST - 1,
        hours=sum(HOURS.values()),
        report=report,
    )


def demo() -> Run:
    """The demo run, with no more arrays than the inspector shows."""
    robot, scenario, seed, seconds = DEMO
    run = scenarios.simulate(robot, scenario, seed)
    cut = run.cut(-np.inf, seconds)
    return Run(
        time=cut.time,
        velocity=cut.velocity,
        position=cut.position,
        velocity_desired=cut.velocity_desired,
        joint_names=cut.joint_names,
        robot=cut.robot,
        blocks=cut.blocks,
        meta=cut.meta,
    )


if __name__ == "__main__":
    main()
