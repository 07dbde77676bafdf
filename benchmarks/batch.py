"""Speed-up of two processes over one, over a batch of runs.

    python -m benchmarks.batch [--runs 200] [--rate 1000] [--joints 7] [--seconds 10] [--repeats 5]

The batch is a folder of links to eight files of simulated motion: position, velocity and desired
velocity of joints that follow slow sines, with noise and a few impacts.

`inspector classify FOLDER` with one process, with two, and as two commands at the same time
with half of the runs each, which is what two cores can do at best. They take turns after a warm-up.
Given are medians of wall and CPU time, and the median of the ratios of the turns.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median

import numpy as np

from noisemodel import Run

ROOT = Path(__file__).parents[1]
FILES = 8  # number of files that links lead to
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")  # what `benchmarks` sets for its own process
EVERY = 0.2  # time between two samples of memory, in [s]


def motion(seed: int, *, rate: float, joints: int, seconds: float) -> Run:
    """Joints that follow slow sines, with noise and an impact every two seconds."""
    random = np.random.default_rng(seed)
    time = np.arange(round(rate * seconds)) / rate
    hertz, phase = random.uniform(0.1, 0.6, joints), random.uniform(0.0, 6.0, joints)
    angle = 2 * np.pi * hertz * time[:, None] + phase
    desired = 0.5 * np.cos(angle)
    velocity = desired + 0.002 * random.standard_normal(desired.shape)
    for hit in random.uniform(0.0, seconds, max(1, round(seconds / 2))):
        after = np.maximum(time - hit, 0.0)
        ringing = 0.1 * np.exp(-after / 0.02) * np.sin(2 * np.pi * 0.1 * rate * after)
        velocity[:, random.integers(joints)] += ringing
    return Run(
        time=time,
        position=0.25 / (np.pi * hertz) * np.sin(angle),
        velocity=velocity,
        velocity_desired=desired,
        joint_names=tuple(f"joint{number}" for number in range(1, joints + 1)),
    )


def make(
    folder: Path, links: Path, *, runs: int, rate: float, joints: int, seconds: float
) -> tuple[Path, ...]:
    """Write the files, and links to them: a folder of all runs, and two with half of them each."""
    files = []
    for seed in range(FILES):
        path = folder / f"{seed}-{rate:g}-{joints}-{seconds:g}.npz"
        if not path.exists():
            motion(seed, rate=rate, joints=joints, seconds=seconds).save(path)
        files.append(path)
    places = tuple(links / name for name in ("all", "even", "odd"))
    for place in places:
        place.mkdir()
    for number in range(runs):
        for place in (places[0], places[1 + number % 2]):
            (place / f"{number:04d}.npz").symlink_to(files[number % FILES])
    return places


def command(folder: Path, jobs: int) -> "subprocess.Popen[bytes]":
    """Start `inspector classify`, with the bytecode and the threads that a user has."""
    ours = {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPATH": str(ROOT)}
    ours["PYTHONPYCACHEPREFIX"] = str(folder.parents[1] / "bytecode")
    users = {name: value for name, value in os.environ.items() if name not in THREADS}
    return subprocess.Popen(
        [sys.executable, "-m", "inspector", "classify", str(folder), "-j", str(jobs)],
        cwd=ROOT,
        env=users | ours,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def timed(folders: Sequence[Path], jobs: int) -> tuple[float, float]:
    """Wall and CPU time of commands at the same time, in [s]."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    for status in [process.wait() for process in [command(each, jobs) for each in folders]]:
        if status not in (0, 1):
            raise SystemExit(f"inspector classify failed (exit {status})")
    wall = time.perf_counter() - begun
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def speed(places: tuple[Path, ...], repeats: int) -> None:
    """Print times of one process, of two, and of two commands with half of the runs."""
    ways = {
        "one process": (places[:1], 1),
        "two processes": (places[:1], 2),
        "two commands, half of the runs each": (places[1:], 1),
    }
    found: dict[str, list[tuple[float, float]]] = {way: [] for way in ways}
    for repeat in range(repeats + 1):
        for way, (folders, jobs) in ways.items():
            times = timed(folders, jobs)
            if repeat:
                found[way].append(times)
    print("| | wall [s] | CPU [s] | times as fast |\n|---|---|---|---|")
    for way, all_times in found.items():
        wall, cpu = (median(each) for each in zip(*all_times, strict=True))
        pairs = zip(found["one process"], all_times, strict=True)
        ratio = median(one[0] / other[0] for one, other in pairs)
        print(f"| {way} | {wall:.2f} | {cpu:.2f} | {ratio:.2f} |")


def main() -> None:
    """Make the batch, measure and print."""
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("--runs", type=int, default=200)
    arguments.add_argument("--rate", type=float, default=1000.0, help="in [Hz]")
    arguments.add_argument("--joints", type=int, default=7)
    arguments.add_argument("--seconds", type=float, default=10.0, help="of each run")
    arguments.add_argument("--repeats", type=int, default=5)
    arguments.add_argument("--output", type=Path, default=ROOT / "build" / "batch")
    given = arguments.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    size = {"rate": given.rate, "joints": given.joints, "seconds": given.seconds}
    with tempfile.TemporaryDirectory(dir=given.output) as links:
        places = make(given.output, Path(links), runs=given.runs, **size)
        speed(places, given.repeats)


if __name__ == "__main__":
    main()
