"""Make the files that ship: simulate a data set, train the models, measure them, cut the demo run.

    python assets/build.py [--folder build] [--jobs 2]

Models learn from the training part of the data set and are measured on the part that is held out
by hash; each gets a card beside it, with the figures. Started again, this makes what is missing of
the data set and redoes nothing of it.
"""

import argparse
from pathlib import Path

import numpy as np

import models
import scenarios
from inspector.part import Part
from inspector.progress import progress
from inspector.training import evaluate, train
from noisemodel import Block, Run
from scenarios.dataset import make
from scenarios.folder import Folder
from scenarios.simulation import RECIPE
from scenarios.tasks import Wish, choose

HERE = Path(__file__).parent
ROBOTS = ("talos", "go2", "panda")
SEEDS = 10
MODELS = {
    "general-10khz": ("general", 10_000.0),
    "general-1khz": ("general", 1000.0),
    "scalar-10khz": ("scalar", 10_000.0),
    "scalar-1khz": ("scalar", 1000.0),
}
"""Profile and rate, in [Hz], by name."""
DEMO = ("panda", "obstacle-full", 100, 4.0)
CARD = """# {name}

Listens to {signals} at {rate:g} Hz, and tells {classes} apart, or says unknown.

Made by `make models`: profile `{profile}`, {runs} runs of the training part of {robots}, seeds 0 to
{last}, every scenario (`scenarios`, recipe {recipe}); hashes of all of them are in the model file.
Below is what it does on the part that is held out by hash: robots that it knows, seeds that it has
not seen.

What it does not know: any other robot, real drives (gears, friction that is not Coulomb's, belts),
payloads, hands at work. What is unlike all of its runs it calls unknown, as far as that can be told
from levels alone.

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
    data = options.folder / "data"
    folder = Folder.opened(data)
    missing = folder.missing(Wish(choice=choose(ROBOTS), seeds=SEEDS).tasks())
    for _ in progress(make(folder, missing, jobs=options.jobs), "simulate", total=len(missing)):
        pass
    for name, (profile, rate) in MODELS.items():
        path = HERE / "models" / f"{name}.npz"
        train([data], profile, rate, path, part=Part.TRAINING, overwrite=True)
        report = str(evaluate(path, [data], part=Part.TEST))
        path.with_suffix(".md").write_text(card(path, report), encoding="utf-8")
        print(f"\n{name}\n{report}")
    demo().save(HERE / "runs" / "demo.npz", overwrite=True)


def card(path: Path, report: str) -> str:
    """Say of a model what it is made of, what it can, and what it cannot."""
    model = models.Classifier.load(path)
    return CARD.format(
        name=path.stem,
        signals=", ".join(model.profile.signals),
        rate=model.rate,
        classes=", ".join(model.classes),
        profile=MODELS[path.stem][0],
        runs=len(model.runs),
        robots=", ".join(ROBOTS),
        last=SEEDS - 1,
        recipe=RECIPE,
        report=report,
    )


def demo() -> Run:
    """Cut the demo from a run: what the inspector shows, no more."""
    robot, scenario, seed, seconds = DEMO
    run = scenarios.simulate(robot, scenario, seed)
    kept = slice(0, int(np.searchsorted(run.time, seconds)))
    assert run.position is not None
    assert run.velocity_desired is not None
    return Run(
        time=run.time[kept],
        velocity=run.velocity[kept],
        position=run.position[kept],
        velocity_desired=run.velocity_desired[kept],
        joint_names=run.joint_names,
        robot=run.robot,
        blocks=tuple(
            Block(block.start, min(block.stop, seconds), block.label)
            for block in run.blocks
            if block.start < seconds
        ),
        meta=run.meta,
    )


if __name__ == "__main__":
    main()
