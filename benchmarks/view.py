"""Time `inspector view --save` and other commands, each as a process of its own.

    python benchmarks/view.py [--repeats 5]

The runs: 10 s at 10 kHz of TALOS, 32 joints; 150 s at 1 kHz of 60 joints without a robot; both
float32, with positions, velocities measured and desired. The log: 10 s of a noise in NoisyTest's
two columns. Modules are compiled beforehand. Printed are least and median CPU times, the size of
each recording, and the number of points of its lines in the views that are open at first, and at
most for any choice of tabs.
"""

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from rerun.chunk import RrdReader

from noisemodel import Robot, Run, simplified

ROWS = {
    "noise": ["/noise/**", "/power/total", "/power/terms/**"],
    "spectrogram": ["/spectrogram/bands/**"],
    "links": ["/power/links/**"],
    "joints": ["/score/**", "/joints/*", "/detail/*"],
}
"""Rows of the layout; the first existing tab of each is in front."""


def moving(rate: float, seconds: float, names: tuple[str, ...], robot: str | None) -> Run:
    """Run with a smooth motion of every joint, and a vibration in the middle."""
    generator = np.random.default_rng(0)
    instants = np.arange(round(rate * seconds)) / rate
    phase = 2 * np.pi * generator.uniform(0.1, 0.6, len(names)) * instants[:, None]
    desired = 0.5 * np.cos(phase)
    rattle = np.sin(2 * np.pi * 140 * instants) * np.exp(-((instants - seconds / 2) ** 2) / 0.1)
    measured = desired + 0.01 * generator.normal(size=desired.shape) + 0.1 * rattle[:, None]
    return Run(
        time=instants,
        velocity=measured.astype(np.float32),
        velocity_desired=desired.astype(np.float32),
        position=(0.3 * np.sin(phase)).astype(np.float32),
        joint_names=names,
        robot=robot,
    )


def measure(command: list[str], repeats: int) -> tuple[float, float, float]:
    """Least and median CPU time and median wall time of a command, in [s]."""
    cpu, wall = [], []
    environment = os.environ | {"PYTHONDONTWRITEBYTECODE": ""}
    for _ in range(repeats + 1):
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run(command, check=False, capture_output=True, env=environment)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        wall.append(time.perf_counter() - start)
    # The first repeat compiles modules.
    return min(cpu[1:]), statistics.median(cpu[1:]), statistics.median(wall[1:])


def points(recording: Path) -> tuple[int, int]:
    """Number of points of lines in the views that are open at first, and at most."""
    count: dict[str, int] = {}
    for chunk in RrdReader(recording).store().stream():
        batch = chunk.to_record_batch()
        if "Scalars:scalars" in batch.schema.names:
            values = len(batch.column("Scalars:scalars").flatten())
            count[chunk.entity_path] = count.get(chunk.entity_path, 0) + values
    first = most = 0
    for tabs in ROWS.values():
        totals = [total for tab in tabs for total in _totals(count, tab)] or [0]
        first, most = first + totals[0], most + max(totals)
    return first, most


def _totals(count: dict[str, int], tab: str) -> list[int]:
    """Points of a tab, or of each one that matches a star: the signal of a limb, a moment."""
    stem = tab.rstrip("*")
    paths = [path for path in count if path == tab or (stem != tab and path.startswith(stem))]
    if not paths or not tab.endswith("/*"):
        return [sum(count[path] for path in paths)] if paths else []
    groups = {path.replace("_desired/", "/") for path in paths}
    return [
        sum(count[path] for path in paths if path.replace("_desired/", "/") == group)
        for group in sorted(groups)
    ]


def main() -> None:
    """Measure and print."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--repeats", type=int, default=5)
    repeats = arguments.parse_args().repeats
    inspector = [sys.executable, "-m", "inspector"]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run = moving(10_000, 10.0, Robot.load("talos").joint_names, "talos")
        run.save(folder / "talos.npz")
        many = tuple(f"joint_{i}" for i in range(60))
        moving(1000, 150.0, many, None).save(folder / "long.npz")
        noise = simplified(run.motion, run.velocity_desired)
        np.savetxt(folder / "noise.log", np.column_stack((run.time, noise)), fmt="%.12f %.15e")
        short, long = folder / "talos.rrd", folder / "long.rrd"
        save = ["--overwrite", "--save"]
        commands = {
            "--help": ["--help"],
            "view, 10 s, 32 joints": ["view", str(folder / "talos.npz"), *save, str(short)],
            "view, 150 s, 60 joints": ["view", str(folder / "long.npz"), *save, str(long)],
            "classify run.npz": ["classify", str(folder / "talos.npz")],
            "classify noise.log": ["classify", str(folder / "noise.log")],
        }
        print(f"{'command':24} {'CPU, least':>10} {'median [s]':>10} {'wall [s]':>9}")
        for what, command in commands.items():
            least, cpu, wall = measure(inspector + command, repeats)
            print(f"{what:24} {least:10.2f} {cpu:10.2f} {wall:9.2f}")
        print(f"{'recording':24} {'MB':>10} {'points':>10} {'at most':>9}")
        for recording in (short, long):
            first, most = points(recording)
            size = recording.stat().st_size / 1e6
            print(f"{recording.name:24} {size:10.1f} {first:10} {most:9}")
        peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
        print(f"largest process: {peak / 1024:.0f} MiB")


if __name__ == "__main__":
    main()
