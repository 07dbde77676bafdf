"""The full run of a sample, reproduced bit for bit."""

from collections.abc import Mapping
from typing import Any

from noiseclassifier.scenarios.errors import ChangedRunError
from noiseclassifier.scenarios.sample import Sample, digest
from noiseclassifier.scenarios.simulation import simulate
from noisemodel import Run


def reproduce(sample: Sample) -> Run:
    """Simulate the run of a sample again."""
    recipe = sample.meta
    run = simulate(sample.robot, recipe["scenario"], recipe["seed"], duration=recipe["duration"])
    if digest(run) != recipe["sha256"]:
        raise ChangedRunError(sample.name, _versions(recipe), _versions(run.meta))
    return run


def _versions(meta: Mapping[str, Any]) -> str:
    versions = ", ".join(f"{name} {number}" for name, number in meta.get("versions", {}).items())
    return f"recipe {meta.get('recipe')} ({versions})"
