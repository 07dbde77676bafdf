"""Recordings of `inspector view`: CPU time, size, and points of lines that are open at first.

    python -m benchmarks.recordings [--repeats 3]

The runs: 10 s at 10 kHz of TALOS, 32 joints; 150 s at 1 kHz of 60 joints without a robot; both
float32, with positions, velocities measured and desired, and a vibration in the middle. Times are
CPU times of processes, medians after a warm-up, in [s]. Open at first are the plots that no tab
hides; `--web` serves the same file.
"""

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from rerun.chunk import RrdReader

from benchmarks.commands import moving
from noisemodel import Robot

OPEN = ("/class/", "/noise/", "/level/", "/probability/", "/spectrogram/", "/strips/joints/")
OPEN += ("/detail/0/velocity",)
"""Where the lines lie that no tab hides."""
VALUES = ("Scalars:scalars", "Measurements:values")
CASES = {"10 s, 10 kHz, 32 joints": (3.0, 20.0), "150 s, 1 kHz, 60 joints": (5.0, 20.0)}
"""Most CPU time, in [s], and most MB."""
MOST_POINTS = 300_000


def used(command: list[str], repeats: int) -> float:
    """Median CPU time of a command, in [s]; the first call compiles modules and fills caches."""
    times, environment = [], os.environ | {"PYTHONDONTWRITEBYTECODE": ""}
    for _ in range(repeats + 1):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(command, check=False, capture_output=True, text=True, env=environment)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode:
            raise SystemExit(f"{' '.join(command)} failed:\n{done.stderr[-2000:]}")
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return statistics.median(times[1:])


def points(recording: Path) -> int:
    """Points of the lines that are open at first."""
    count = 0
    for chunk in RrdReader(recording).store().stream():
        if f"{chunk.entity_path}/".startswith(OPEN):
            batch = chunk.to_record_batch()
            for name in set(VALUES) & set(batch.schema.names):
                count += len(batch.column(name).flatten())
    return count


def main() -> None:
    """Measure, and print a table in Markdown."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--repeats", type=int, default=3)
    repeats = arguments.parse_args().repeats
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        runs = (
            moving(10_000, 10.0, Robot.load("talos").joint_names, "talos"),
            moving(1000, 150.0, tuple(f"joint_{number}" for number in range(60)), None),
        )
        print("| view of | CPU time | size | points open at first |\n|---|---|---|---|")
        for run, (title, (seconds, size)) in zip(runs, CASES.items(), strict=True):
            run.save(folder / "run.npz", overwrite=True)
            out = folder / "run.rrd"
            command = [sys.executable, "-m", "inspector", "view", str(folder / "run.npz")]
            taken = used([*command, "--overwrite", "--save", str(out)], repeats)
            print(
                f"| {title} | {taken:.2f} s (\u2264 {seconds:g} s)"
                f" | {out.stat().st_size / 1e6:.1f} MB (\u2264 {size:g} MB)"
                f" | {points(out)} (\u2264 {MOST_POINTS}) |",
                flush=True,
            )
    load = ", ".join(f"{each:.1f}" for each in os.getloadavg())
    print(f"\n{os.cpu_count()} cores, load {load}")


if __name__ == "__main__":
    main()
