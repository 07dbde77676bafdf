"""Simulated runs for tests: each is made once, and kept by the content of what makes it."""

import hashlib
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from noiseclassifier import scenarios
from noiseclassifier.scenarios import dataset
from noiseclassifier.scenarios.domains import Logger
from noiseclassifier.scenarios.simulation import scenario_of, software
from noisemodel import Block, Run

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "build" / "simulated-runs"
# A logger that changes nothing.
PLAIN = Logger(
    rate=1000.0, velocity="measured", bits=23, cutoff=700.0, noise=0.0, jitter=0.0, lost=0.0,
    repeated=0.0, hold=1, ripple=0.0, roughness=0.0, gear=100.0, resonances=(),
    desired="commanded", effort_bits=24,
)  # fmt: skip
SOURCES = (ROOT / "models" / "noiseclassifier" / "scenarios", ROOT / "noisemodel")


@cache
def _made_by() -> str:
    """Hash of the code, the tables and the software that simulated runs depend on."""
    hashed = hashlib.sha256(repr(software()).encode())
    for folder in SOURCES:
        for path in sorted(each for each in folder.iterdir() if each.suffix in (".py", ".toml")):
            hashed.update(path.read_bytes())
    return hashed.hexdigest()[:16]


def simulated(robot: str, scenario: str | int, seed: int, **settings: float | bool) -> Run:
    """The run of `scenarios.simulate`, from a folder that all processes of a session share."""
    words = "-".join(f"{name}={value}" for name, value in sorted(settings.items()))
    path = KEPT / _made_by() / f"{robot}-{scenario}-{seed}-{words}.npz"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        made = scenarios.simulate(robot, scenario, seed, **settings)
        made.save(path, overwrite=True)  # written whole, whoever is first
    return Run.load(path)


def stub(robot: str, scenario: str, seed: int, duration: float | None = None) -> Run:
    """A run of two seconds that is not simulated, and swings in the second one."""
    generator, joints = np.random.default_rng(seed), scenarios.ROBOTS[robot].drives.joints
    time = np.arange(20_000) * 1e-4
    speed = 1 + 0.01 * generator.normal(size=(20_000, len(joints)))
    speed[10_000:] += 0.3 * np.sin(2 * np.pi * 200 * time[10_000:, None])
    speed = speed.astype(np.float32)
    signals = {"velocity": speed, "position": speed, "velocity_desired": np.ones_like(speed)}
    blocks = (Block(0.0, 1.0, "ok"), Block(1.0, 2.0, "oscillations"))
    meta = {"scenario": scenario, "seed": seed, "duration": duration or 7.0, "events": []}
    return Run(time=time, joint_names=joints, robot=robot, blocks=blocks, meta=meta, **signals)


def nothing(monkeypatch) -> SimpleNamespace:
    """Let nothing be simulated: `calls` lists what would have been, `falls` has runs that fall."""
    done = SimpleNamespace(calls=[], falls=set())

    def simulate(robot, scenario, seed, *, duration=None):
        task = dataset.Task(robot, scenario_of(scenario).name, seed)
        done.calls.append(task)
        if task in done.falls:
            raise scenarios.SimulationError(1.25, "it fell")
        return stub(task.robot, task.scenario, seed, duration)

    monkeypatch.setattr(dataset, "simulate", simulate)
    monkeypatch.setattr(scenarios, "simulate", simulate)
    return done
