"""The paper's grid on a data set in NoisyTest's form: CPU and wall time, beside the naive way.

    python benchmarks/tune.py FOLDER [--jobs 2] [--naive 8]

FOLDER holds NoisyTest's `training` and `validation`. The naive way trains and measures each point
by itself, as NoisyTest does; it is timed on a few points drawn at random, and their predictions are
held against those of the grid's way. CPU time counts all processes.
"""

import argparse
import os
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np
from joblib.externals.loky import get_reusable_executor

import models
from inspector.training.tuning import Search, tune
from models.tuning.search import validate


def timed(work: Callable[[], object]) -> tuple[object, float, float]:
    """Result of a call, CPU time of all processes and wall time, in [s]."""
    wall, cpu = time.perf_counter(), used()
    result = work()
    get_reusable_executor().shutdown(wait=True)  # processes are counted when they have ended
    return result, used() - cpu, time.perf_counter() - wall


def used() -> float:
    """CPU time of this process and of its ended children, in [s]."""
    each = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in each)


def alone(point: models.Profile, sets: list[models.Dataset]) -> np.ndarray:
    """Predictions of one point that is trained by itself."""
    return models.Classifier.train(sets[0], point).predict(sets[1].frames)


def main() -> None:
    """Measure and print."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--jobs", type=int, default=2)
    arguments.add_argument("--naive", type=int, default=8)
    given = arguments.parse_args()
    search = Search(training=[given.folder / "training"], validation=[given.folder / "validation"])
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "tuned.jsonl"
        tuned, cpu, wall = timed(lambda: tune(search, output, jobs=given.jobs))
        size = output.stat().st_size
        print(tuned.table("balanced-accuracy", rows=5))
        count = len(tuned.grid)
        print(f"\n{count} points, {given.jobs} jobs: {cpu:.1f} s CPU, {wall:.1f} s wall,")
        print(f"{1e3 * cpu / count:.2f} ms CPU a point; results of {size / 1e6:.1f} MB")
        _, cpu, wall = timed(lambda: tune(search, output, jobs=given.jobs))
        print(f"resumed, with all results present: {cpu:.1f} s CPU, {wall:.1f} s wall")
    base = tuned.untuned
    sets = [
        models.Dataset.read(given.folder / name, base, training=name == "training")
        for name in ("training", "validation")
    ]
    random, same, spent = np.random.default_rng(0), 0, 0.0
    for index in random.integers(len(tuned.profiles), size=given.naive):
        point = tuned.profiles[index]
        predicted, cpu, _ = timed(lambda point=point: alone(point, sets))
        found = validate([point], tuned.trial)
        same += np.array_equal(predicted, np.array(found.classes)[found.decisions[0].chosen])
        spent += cpu
    each = spent / given.naive
    print(f"naively {1e3 * each:.0f} ms CPU a point, {each * count / 60:.0f} min for the grid;")
    print(f"{same} of {given.naive} points drawn at random predict the same on all frames")


if __name__ == "__main__":
    main()
