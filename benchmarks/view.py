"""Time `inspector view --save` and `--help`, and classifying, each as a process of its own.

    python benchmarks/view.py [--repeats 5]

The run: 10 s at 10 kHz of TALOS, 32 joints, float32, positions, velocities measured and desired.
The log: 10 s of a noise in NoisyTest's two columns. Medians of CPU and wall time are printed.
"""

import argparse
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from noisemodel import Robot, Run, simplified

RATE, SECONDS = 10_000, 10.0


def talos_run() -> Run:
    """Move every joint of TALOS, with a vibration in the middle."""
    generator = np.random.default_rng(0)
    names = Robot.load("talos").joint_names
    instants = np.arange(int(RATE * SECONDS)) / RATE
    phase = 2 * np.pi * generator.uniform(0.1, 0.6, len(names)) * instants[:, None]
    desired = 0.5 * np.cos(phase)
    rattle = np.sin(2 * np.pi * 140 * instants) * np.exp(-((instants - 5) ** 2) / 0.1)
    measured = desired + 0.01 * generator.normal(size=desired.shape) + 0.1 * rattle[:, None]
    return Run(
        time=instants,
        velocity=measured.astype(np.float32),
        velocity_desired=desired.astype(np.float32),
        position=(0.3 * np.sin(phase)).astype(np.float32),
        joint_names=names,
        robot="talos",
    )


def measure(command: list[str], repeats: int) -> tuple[float, float]:
    """Run a command several times; median CPU and wall time in [s]."""
    cpu, wall = [], []
    for _ in range(repeats + 1):
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run(command, check=False, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        wall.append(time.perf_counter() - start)
    return statistics.median(cpu[1:]), statistics.median(wall[1:])  # the first one warms up


def main() -> None:
    """Measure and print."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--repeats", type=int, default=5)
    repeats = arguments.parse_args().repeats
    inspector = [sys.executable, "-m", "inspector"]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run = talos_run()
        run.save(folder / "talos.npz")
        noise = simplified(run.motion, run.velocity_desired)
        np.savetxt(folder / "noise.log", np.column_stack((run.time, noise)), fmt="%.12f %.15e")
        recording = folder / "talos.rrd"
        commands = {
            "--help": ["--help"],
            "view, 32 joints": [
                "view", str(folder / "talos.npz"), "--save", str(recording), "--overwrite",
            ],
            "classify run.npz": ["classify", str(folder / "talos.npz")],
            "classify noise.log": ["classify", str(folder / "noise.log")],
        }  # fmt: skip
        print(f"{'command':22} {'CPU [s]':>8} {'wall [s]':>9}")
        for what, command in commands.items():
            cpu, wall = measure(inspector + command, repeats)
            print(f"{what:22} {cpu:8.2f} {wall:9.2f}")
        print(f"recording: {recording.stat().st_size / 1e6:.1f} MB")
        peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
        print(f"largest process: {peak / 1024:.0f} MiB")


if __name__ == "__main__":
    main()
