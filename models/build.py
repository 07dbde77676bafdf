"""Make the files that ship: simulate, train the model, measure it, cut the demo run.

    python models/build.py [--folder build] [--jobs 2] [--seeds 10]

The model learns from logs of wide domains at many rates and from a few seeds of the scenarios at
home: the training part of the sources, none of the targets (robots, control and sensing that are
never trained on). It learns what happens; what lasts for a whole run is measured too, but found by
`noiseclassifier.Lasting`. It is measured on the held-out part of the sources, on pieces of them
that begin anywhere, on the targets, and at home, each with a section of its card. Every step is
kept in the folder: killed and started again, this goes on where it was; only at the end are the
files that ship replaced.
"""

import argparse
import os
import shutil
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

import noiseclassifier as nc
from inspector.text import progress
from inspector.training import ANY_RATE, evaluate, train
from noiseclassifier import scenarios
from noiseclassifier.scenarios import dataset
from noiseclassifier.scenarios.dataset import Folder, Side, Task, scenario_tasks, wide_tasks
from noiseclassifier.scenarios.faults import octave
from noiseclassifier.scenarios.labels import visible
from noiseclassifier.scenarios.logs import overlap
from noiseclassifier.scenarios.robots import TARGETS, WIDE
from noiseclassifier.scenarios.simulation import GOOD, RECIPE, WIDE_RECIPE
from noisemodel import Block, Run

HERE = Path(__file__).parent
DOMAINS = 10  # seeds of every robot in wide domains: a good run, two with faults of a while,
THROUGHOUT = 1  # and one with a fault of the whole run
FAST = 10_018  # a further one, the first whose runs are kept at 10 kHz
# Robots whose scenarios are in the training data, too.
HOME = ("panda", "go2", "solo12", "anymal", "g1")
SEEDS = 6  # their seeds in every scenario, from 0
# Robots whose scenarios at home are measured on, and their seed.
TEST, FIRST = ("panda", "go2", "talos"), 55
# Rates of the logs in the training data, in [Hz].
RATES = (10_000.0, 2000.0, 1000.0, 500.0, 250.0, 125.0, 80.0)
SHOWN = (1000.0, 500.0, 250.0, 125.0)  # rates of the logs of targets, in [Hz]
COPIES = 2  # logs of each run at 1 kHz and above, each of another logger; below, one
WHOLE = "throughout"  # in the names of runs with a fault of the whole run
# Faults that are added to good logs, and the class of each kind.
ADDED = {"tone": "oscillations", "noise": "oscillations", "blow": "impact"}
LOWEST = 15.0  # lowest frequency, in [Hz]; the highest is 0.45 of the sample rate
LEVELS = 0.03, 10.0  # least and most root mean square while it lasts, in [rad/s]
LASTS = 0.4, 1.2  # shortest and longest tone or noise, in [s]
BLOW = 0.1  # duration of a blow, in [s]
APART = 2.5  # from the start of a fault to that of the next, in [s]
UNLABELLED = 0.05  # time around a fault that has no label, in [s]
PIECE = 1.0, 4.0  # shortest and longest piece of a log that begins anywhere, in [s]
ALL = 0.3  # share of the faults that all joints have
NAME = "general"
DEMO = ("panda", "obstacle-full", 102, 4.0)
CARD = """# {name}

Classifies frames of noise at any rate from 80 Hz to 10 kHz, by whatever signals a log has (desired
and measured velocities, joint by joint or as norms, efforts; the noise alone): {classes}, or
unknown.

Made by `make models`: profile `general`, trained on {runs} logs of {robots} robots: logs of wide
domains (recipe {wide}, {domains} seeds of every source robot) at {rates} Hz, with faults of a
while; copies of the good ones with faults added (models/build.py); and {seeds} seeds of every
scenario at home (recipe {recipe}) of {home}, each without the part that is held out by hash. The
model file has the hashes of all of them. Their licences are permissive (docs/robots.md).

Not in the training data: {targets}; impedance control, encoders of 13 bit or fewer, samples held
four times or more; any real robot; any other simulator. Measures are defined in docs/metrics.md.

{sections}"""


def main() -> None:
    """Make everything that is not there yet."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--folder", type=Path, default=HERE.parent / "build")
    arguments.add_argument("--jobs", type=int, default=2)
    arguments.add_argument("--seeds", type=int, default=DOMAINS, help="of wide domains")
    arguments.add_argument("--trial", action="store_true", help="replace no file that ships")
    given = arguments.parse_args()
    build: Path = given.folder
    tasks = wide_tasks(seeds=given.seeds, throughout=THROUGHOUT)
    tasks += wide_tasks(first=FAST, seeds=1, throughout=THROUGHOUT)
    wide = timed("simulate domains", simulate, build / "domains", tasks, given.jobs, wide=True)
    seeds = max(1, round(SEEDS * given.seeds / DOMAINS))
    learnt = scenario_tasks(HOME, seeds=seeds)
    home = timed("simulate home", simulate, build / "home", learnt, given.jobs)
    fresh = scenario_tasks(TEST, first=FIRST, seeds=1)
    test = timed("simulate the test", simulate, build / "home-test", fresh, given.jobs)
    sources = [timed(f"logs at {rate:g} Hz", logs, wide, build, rate, "source") for rate in RATES]
    added = [copies(source, "added", with_faults, GOOD) for source in sources]
    files = [
        file for folder in (*sources, home.path, *added) for file in sorted(folder.rglob("*.npz"))
    ]
    inputs = [file for file in files if WHOLE not in file.name]
    model = build / f"{NAME}.npz"
    if not model.exists():
        timed("train", train, inputs, ANY_RATE, None, model, part="training")
    sections = {"Other seeds of the same robots, in wide domains, at 1 kHz": sources[2]}
    title = "Logs of other seeds of the same robots that begin anywhere, at 1 kHz"
    sections[title] = copies(sources[2], "pieces", beginning_anywhere, "")
    for rate in SHOWN:
        title = f"Robots and controllers not in the training data, at {rate:g} Hz"
        sections[title] = logs(wide, build, rate, "target")
    title = "Loggers not in the training data, other seeds of the same robots"
    sections[title] = logs(wide, build, 1000.0, "logger")
    sections[f"The scenarios at home, seed {FIRST}"] = test.path
    texts = [timed(title, measured, model, title, path) for title, path in sections.items()]
    if given.trial:
        return
    shutil.copyfile(model, HERE / f"{NAME}.npz")
    (HERE / f"{NAME}.md").write_text(card(model, texts), encoding="utf-8")
    demo().save(HERE.parent / "assets" / "runs" / "demo.npz", overwrite=True)


def timed(what: str, step: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    """The result of a step, whose time is printed."""
    start, used = time.monotonic(), sum(os.times()[:4])
    found = step(*args, **kwargs)
    took, used = time.monotonic() - start, sum(os.times()[:4]) - used
    print(f"{what}: {took:.0f} s, {used:.0f} s of processor time", flush=True)
    return found


def simulate(path: Path, tasks: list[Task], jobs: int, *, wide: bool = False) -> Folder:
    """Simulate what is missing of a data set; runs of the scenarios are kept at 1 kHz."""
    folder = Folder.opened(path, wide=wide, rate=1000.0)
    missing = folder.missing(tasks)
    for _ in progress(dataset.make(folder, missing, jobs=jobs), "simulate", total=len(missing)):
        pass
    return folder


def logs(wide: Folder, build: Path, rate: float, side: Side) -> Path:
    """Logs of one rate of sources or of targets, written unless they are there."""
    path = build / f"{side}-{rate:g}"
    if not path.exists():
        part = path.with_suffix(".part")
        copies = COPIES if rate >= 1000.0 else 1
        for _ in dataset.write_logs(wide, part, copies=copies, rate=rate, side=side):
            pass
        part.rename(path)
    return path


def copies(source: Path, kind: str, change: Callable[..., Run], fault: str) -> Path:
    """Logs of sources that are changed, written unless they are there."""
    path = source.with_name(source.name.replace("source", kind))
    if not path.exists():
        part = path.with_suffix(".part")
        for file in sorted(source.rglob(f"{fault}*.npz")):
            name = file.name.replace(GOOD, kind, 1) if fault else f"{kind}-{file.name}"
            target = part / file.parent.name / name
            target.parent.mkdir(parents=True, exist_ok=True)
            seed = crc32(f"{file.parent.name}/{file.stem}".encode())
            change(Run.load(file), seed=seed).save(target, overwrite=True)
        part.rename(path)
    return path


def with_faults(run: Run, *, seed: int) -> Run:
    """A good log with faults added to its measured velocities."""
    rng = np.random.default_rng(seed)
    velocity = run.velocity.astype(np.float64)
    end, blocks, events = len(velocity) / run.rate, list[Block](), list[dict[str, Any]]()
    starts = np.arange(1.0, end - LASTS[1], APART) + rng.uniform(0.0, 0.3)
    edge = 0.0
    for start in starts.tolist():
        kind = str(rng.choice(list(ADDED)))
        stop = start + (BLOW if kind == "blow" else rng.uniform(*LASTS))
        part = slice(round(start * run.rate), round(stop * run.rate))
        added = np.zeros_like(velocity)
        added[part] = some_fault(kind, part.stop - part.start, run, rng)
        around = slice(max(0, part.start - round(run.rate / 2)), part.stop + round(run.rate / 2))
        seen = visible(added[around], run.velocity[around], rate=run.rate).any()
        velocity += added
        labelled = stop - start if seen else 0.0
        events.append({"label": ADDED[kind], "start": start, "stop": stop, "labelled": labelled})
        blocks.append(Block(edge, start - UNLABELLED, "ok"))
        blocks += [Block(start, stop, ADDED[kind])] if seen else []
        edge = stop + UNLABELLED
    blocks.append(Block(edge, end, "ok"))
    meta = {**run.meta, "scenario": "added", "events": events}
    return replace(run, velocity=velocity.astype(np.float32), blocks=tuple(blocks), meta=meta)


def some_fault(kind: str, samples: int, run: Run, rng: np.random.Generator) -> Any:
    """A fault of any frequency and level on one joint or all, shape (samples, joints)."""
    frequency = LOWEST * (0.45 * run.rate / LOWEST) ** rng.uniform()
    level = LEVELS[0] * (LEVELS[1] / LEVELS[0]) ** rng.uniform()
    joints = np.arange(run.velocity.shape[1])
    if rng.uniform() > ALL:
        joints = rng.choice(joints, 1)
    added = np.zeros((samples, run.velocity.shape[1]))
    added[:, joints] = level * fault(kind, samples, frequency, run.rate, rng)[:, None]
    return added


def fault(kind: str, samples: int, frequency: float, rate: float, rng: np.random.Generator) -> Any:
    """A fault of level 1, shape (samples,)."""
    if kind == "noise":
        signal = octave(rng.standard_normal(samples), frequency, 1 / rate)
    else:
        time = np.arange(samples) / rate
        signal = np.sin(2 * np.pi * (frequency * time + rng.uniform()))
        if kind == "blow":
            signal *= np.exp(-time * frequency / 3.0)
    return signal / max(np.sqrt(np.mean(signal**2)), 1e-9)


def beginning_anywhere(run: Run, *, seed: int) -> Run:
    """A piece of a log: it begins in standing or in motion, or, one in two, in a failure."""
    rng = np.random.default_rng((seed, 2))
    end = len(run.velocity) / run.rate
    last = max(end - PIECE[0], 0.0)
    failures = [block for block in run.blocks if block.label != "ok" and block.start < last]
    start = rng.uniform(0.0, last)
    if failures and rng.uniform() < 0.5:
        chosen = failures[int(rng.integers(len(failures)))]
        start = min(rng.uniform(chosen.start, chosen.stop), last)
    piece = run.cut(start, start + rng.uniform(*PIECE))
    first = float(piece.time[0])
    blocks = tuple(
        replace(block, start=max(block.start - first, 0.0), stop=block.stop - first)
        for block in piece.blocks
    )
    over = len(piece.time) / piece.rate
    events = [
        {
            **event,
            "start": max(event["start"] - first, 0.0),
            "stop": min(event["stop"] - first, over),
            "labelled": overlap({**event, "start": event["start"] - first}, blocks),
        }
        for event in run.meta["events"]
        if event["stop"] > first and event["start"] < first + over
    ]
    meta = {**run.meta, "events": events, "piece": [first, first + over]}
    return replace(piece, time=piece.time - first, blocks=blocks, meta=meta)


def measured(model: Path, title: str, path: Path) -> str:
    """A section of the card; measured unless it is there."""
    part = "test" if "same robots" in title else "all"
    kept = model.with_name(f"section-{crc32(title.encode()):08x}.md")
    if not kept.exists():
        report = evaluate(model, [path], part=part)
        kept.write_text(f"## {title}\n\n```\n{report}\n```\n", encoding="utf-8")
    return kept.read_text(encoding="utf-8")


def card(path: Path, texts: list[str]) -> str:
    """The card of a model: what it was trained on, its figures, its limits."""
    model = nc.load(path)
    robots = {nc.recording.robot_of(run) for run in model.runs}
    return CARD.format(
        name=path.stem,
        rates=", ".join(f"{rate:g}" for rate in RATES),
        classes=", ".join(model.classes),
        runs=len(model.runs),
        robots=len(robots & set(WIDE)),
        domains=DOMAINS,
        seeds=SEEDS,
        home=", ".join(HOME),
        recipe=RECIPE,
        wide=WIDE_RECIPE,
        targets=", ".join(TARGETS),
        sections="\n".join(texts),
    )


def demo() -> Run:
    """The demo run, with no more arrays than the inspector shows."""
    robot, scenario, seed, seconds = DEMO
    cut = scenarios.simulate(robot, scenario, seed).cut(float("-inf"), seconds)
    kept = ("time", "velocity", "position", "velocity_desired", "joint_names", "robot")
    return Run(**{name: getattr(cut, name) for name in (*kept, "blocks", "meta")})


if __name__ == "__main__":
    main()
