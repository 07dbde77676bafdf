"""Make the files that ship: simulate, train the model, measure it, cut the demo run.

    python models/build.py [--folder build] [--jobs 2]

The model learns from logs of wide domains at many rates and from a few seeds of the scenarios at
home: the training part of the sources, none of the targets (robots, control and sensing that are
never learnt from). It is measured on the held-out part of the sources, on the targets, and at home,
each with a section of its card. Killed and started again, this simulates only what is missing.
"""

import argparse
from pathlib import Path
from zlib import crc32

import noiseclassifier as nc
from inspector.progress import progress
from inspector.train import ANY_RATE, evaluate, train
from noiseclassifier import scenarios
from noiseclassifier.scenarios.dataset import (
    DatasetSpec,
    Folder,
    Side,
    Task,
    choose,
    make,
    wide_tasks,
    write_logs,
)
from noiseclassifier.scenarios.dataset import (
    logs as logs_of,
)
from noiseclassifier.scenarios.logs import with_faults
from noiseclassifier.scenarios.robots import TARGETS, WIDE
from noiseclassifier.scenarios.simulation import GOOD, RECIPE
from noisemodel import Run

HERE = Path(__file__).parent
DOMAINS = 10
"""Seeds of every robot in wide domains, each with a good run and two with faults."""
FAST = (10_018,)
"""A further one, the first whose runs are kept at 10 kHz."""
HOME = ("panda", "go2", "solo12", "anymal", "g1")
"""Robots whose scenarios at home are learnt from, too."""
SEEDS = 2
"""Their seeds in every scenario, from 0."""
TEST, FIRST, LAST = ("panda", "go2", "talos"), 55, 56
"""Robots whose scenarios at home are measured on, their first seed, and the one after the last."""
RATES = (10_000.0, 2000.0, 1000.0, 500.0, 250.0, 125.0, 80.0)
"""Rates of the logs that are learnt from, in [Hz]."""
SHOWN = (1000.0, 500.0, 250.0, 125.0)
"""Rates of the logs of targets, in [Hz]."""
COPIES = 2
"""Logs of each run at 1 kHz and above, each of another logger; below, one."""
NAME = "general"
DEMO = ("panda", "obstacle-full", 102, 4.0)
CARD = """# {name}

Classifies frames of noise at any rate from 80 Hz to 10 kHz, by whatever signals a log has (desired
and measured velocities, joint by joint or as norms, efforts; the noise alone): {classes}, or
unknown.

Made by `make models`: profile `general`, trained on {runs} logs of {robots} robots: logs of wide
domains (docs/domains.md, {domains} seeds of every source robot) at {rates} Hz, copies of
the good ones with faults added (scenarios/domains/added.py), and {seeds} seeds of every scenario at
home (recipe {recipe}) of {home}, each without the part that is held out
by hash. The model file has the hashes of all of them. Their licences allow anyone anything
(docs/robots.md).

Never learnt from: {targets}; impedance control, encoders of 13 bit or fewer, samples held four
times or more; any real robot; any other simulator. Measures are defined in docs/evaluation.md.

{sections}"""


def main() -> None:
    """Make everything."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--folder", type=Path, default=HERE.parent / "build")
    arguments.add_argument("--jobs", type=int, default=2)
    options = arguments.parse_args()
    build: Path = options.folder
    wide = simulate(build / "domains", source_tasks(), options.jobs, wide=True)
    home = simulate(build / "home", home_tasks(), options.jobs)
    test = simulate(build / "home-test", test_tasks(), options.jobs)
    sources = [logs(wide, build, rate, "source") for rate in RATES]
    path = HERE / f"{NAME}.npz"
    more = [added(source) for source in sources]
    train([*sources, *more, home.path], ANY_RATE, None, path, part="training", overwrite=True)
    sections = {"Other seeds of the same robots, in wide domains, at 1 kHz": [sources[2]]}
    for rate in SHOWN:
        title = f"Robots and control that were never learnt from, at {rate:g} Hz"
        sections[title] = [logs(wide, build, rate, "target")]
    sections["Loggers that were never learnt from, other seeds of the same robots"] = [
        logs(wide, build, 1000.0, "logger")
    ]
    sections[f"The scenarios at home, seed {FIRST}"] = [test.path]
    write_card(path, sections)
    demo().save(HERE.parent / "assets" / "runs" / "demo.npz", overwrite=True)


def source_tasks() -> list[Task]:
    """Runs of wide domains, of sources and of targets."""
    seeds = (wide_tasks(first=seed, seeds=1) for seed in FAST)
    return [*wide_tasks(seeds=DOMAINS), *(task for tasks in seeds for task in tasks)]


def home_tasks() -> list[Task]:
    """Runs of the scenarios at home that are learnt from."""
    return DatasetSpec(choice=choose(HOME), seeds=SEEDS).tasks()


def test_tasks() -> list[Task]:
    """Runs of the scenarios at home that are measured on."""
    return DatasetSpec(choice=choose(TEST), first=FIRST, seeds=LAST - FIRST).tasks()


def simulate(path: Path, tasks: list[Task], jobs: int, *, wide: bool = False) -> Folder:
    """Simulate what is missing of a data set; runs of the scenarios are kept at 1 kHz."""
    folder = Folder.opened(path, wide=wide, rate=1000.0)
    missing = folder.missing(tasks)
    for _ in progress(make(folder, missing, jobs=jobs), "simulate", total=len(missing)):
        pass
    return folder


def logs(wide: Folder, build: Path, rate: float, side: Side) -> Path:
    """Logs of one rate of sources or of targets, written unless they are there."""
    path = build / f"{side}-{rate:g}"
    if not path.exists():
        part = path.with_suffix(".part")
        copies = COPIES if rate >= 1000.0 else 1
        found = logs_of(wide, copies=copies, rate=rate, side=side)
        for _ in write_logs(found, part):
            pass
        part.rename(path)
    return path


def added(source: Path) -> Path:
    """Good logs of sources with faults added, written unless they are there."""
    path = source.with_name(source.name.replace("source", "added"))
    if not path.exists():
        part = path.with_suffix(".part")
        for file in sorted(source.rglob(f"{GOOD}*.npz")):
            target = part / file.parent.name / file.name.replace(GOOD, "added", 1)
            target.parent.mkdir(parents=True, exist_ok=True)
            seed = crc32(f"{file.parent.name}/{file.stem}".encode())
            with_faults(Run.load(file), seed=seed).save(target, overwrite=True)
        part.rename(path)
    return path


def write_card(path: Path, sections: dict[str, list[Path]]) -> None:
    """Measure a model, and write its card: what it was trained on, its figures, its limits."""
    model = nc.load(path)
    texts = []
    for title, inputs in sections.items():
        part = "test" if "same robots" in title else "all"
        report = evaluate(path, inputs, part=part)
        texts.append(f"## {title}\n\n```\n{report}\n```\n")
        print(f"\n{path.stem}: {title}\n{report}", flush=True)
    robots = {nc.recording.robot_of(run) for run in model.runs}
    card = CARD.format(
        name=path.stem,
        rates=", ".join(f"{rate:g}" for rate in RATES),
        classes=", ".join(model.classes),
        runs=len(model.runs),
        robots=len(robots & set(WIDE)),
        domains=DOMAINS,
        seeds=SEEDS,
        home=", ".join(HOME),
        recipe=RECIPE,
        targets=", ".join(TARGETS),
        sections="\n".join(texts),
    )
    path.with_suffix(".md").write_text(card, encoding="utf-8")


def demo() -> Run:
    """The demo run, with no more arrays than the inspector shows."""
    robot, scenario, seed, seconds = DEMO
    run = scenarios.simulate(robot, scenario, seed)
    cut = run.cut(float("-inf"), seconds)
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
