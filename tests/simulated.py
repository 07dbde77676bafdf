"""Simulated runs for tests: each is made once, and kept by the content of what makes it."""

import hashlib
from functools import cache
from pathlib import Path

from noiseclassifier import scenarios
from noiseclassifier.scenarios.simulation import software
from noisemodel import Run

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "build" / "simulated-runs"
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
