"""Peak memory and CPU time of commands on long runs.

    python benchmarks/memory.py FOLDER [--rate 1000] [--joints 60] [--seconds 600 3600] [--type f8]
        [--robot NAME] [--packed] [--commands classify report] [--trees BEFORE .]

Runs of so many seconds are written to FOLDER piece by piece, and deleted at the end: sinusoidal
motion of every joint with noise, and a vibration of 120 Hz that decays, once a minute; of a robot,
all of its joints. Each command runs in a process of its own, in each of the source trees. Peak is
the largest resident set of that process; CPU is user and system time together.
"""

import argparse
import os
import resource
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.lib import format as npy

SIGNALS = ("velocity", "velocity_desired", "position")
PIECE = 50_000  # samples that are made at once


def motion(name: str, samples: np.ndarray, rate: float, joints: int) -> np.ndarray:
    """Some samples of a signal, shape (samples, joints), in [rad] or [rad/s]."""
    time, places = samples[:, None] / rate, np.arange(joints)
    turn = 2.0 * np.pi * (0.3 + 0.02 * (places % 10))
    if name == "position":
        return np.asarray(0.2 * np.sin(turn * time + places))
    found = 0.2 * turn * np.cos(turn * time + places)
    if name == "velocity":
        found += 1e-3 * np.random.default_rng(int(samples[0])).standard_normal(found.shape)
        since = (time[:, 0] - 30.0) % 60.0
        blow = 3.0 * np.exp(-since / 0.05) * np.sin(2.0 * np.pi * 120.0 * since)
        found[:, 3 % joints] += np.where(since < 0.5, blow, 0.0)
    return np.asarray(found)


def pieces(name: str, count: int, rate: float, joints: int) -> Iterator[np.ndarray]:
    """All samples of a signal."""
    for first in range(0, count, PIECE):
        yield motion(name, np.arange(first, min(count, first + PIECE)), rate, joints)


def write(path: Path, seconds: float, options: argparse.Namespace) -> None:
    """Write a run file in little memory."""
    names = [f"j{number}" for number in range(options.joints)]
    if options.robot:
        from noisemodel import Robot

        names = list(Robot.load(options.robot).joint_names)
    count = round(seconds * options.rate)
    with zipfile.ZipFile(path, "w", compresslevel=1) as archive:

        def put(name: str, array: np.ndarray | str) -> None:
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                npy.write_array(member, np.asanyarray(array))

        put("format", "noise-run/1")
        put("joint_names", np.array(names))
        put("time", np.arange(count) / options.rate)
        if options.robot:
            put("robot", options.robot)
        archive.compression = zipfile.ZIP_DEFLATED if options.packed else zipfile.ZIP_STORED
        kind = np.dtype(options.type)
        header = {"descr": npy.dtype_to_descr(kind), "fortran_order": False}
        for name in SIGNALS:
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                npy.write_array_header_1_0(member, header | {"shape": (count, len(names))})
                for piece in pieces(name, count, options.rate, len(names)):
                    member.write(piece.astype(kind).tobytes())


def commands(run: Path) -> dict[str, list[str]]:
    """What is measured, by name."""
    folder, file = run.parent, str(run)
    return {
        "classify": ["classify", "--no-reference", file],
        "audit": ["audit", file],
        "report": ["view", file, "-o", str(folder / "run.html"), "--overwrite"],
        "view": ["view", file, "--save", str(folder / "run.rrd"), "--overwrite"],
        "noise": ["noise", file],
        "diff": ["diff", file, file],
        "accept": ["accept", file, "--reason", "good", "-o", str(folder / "reference")],
    }


MEASURE = """
import resource, subprocess, sys
done = subprocess.run([sys.executable, "-m", "inspector", *sys.argv[1:]], capture_output=True)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
last = done.stderr.decode().strip().splitlines()[-1:]
print(used.ru_maxrss * 1024, used.ru_utime + used.ru_stime, done.returncode, *last)
"""


def measured(command: list[str], tree: Path, limit: float) -> str:
    """Peak in [MB] and CPU time in [s] of a command, as text."""

    def bounded() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (int(limit * 1e9), int(limit * 1e9)))

    done = subprocess.run(
        [sys.executable, "-c", MEASURE, *command],
        cwd=tree,
        env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
        stdout=subprocess.PIPE,
        preexec_fn=bounded,
        check=True,
    )
    peak, cpu, status, *rest = done.stdout.decode().split(maxsplit=3)
    failed = "" if status in "014" else f" ended with {status}: {' '.join(rest)[:60]}"
    return f"{float(peak) / 1e6:,.0f} MB, {float(cpu):.0f} s{failed}"


def main() -> None:
    """Measure and print a table."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--rate", type=float, default=1000.0)
    arguments.add_argument("--joints", type=int, default=60)
    arguments.add_argument("--seconds", type=float, nargs="+", default=[600.0, 3600.0])
    arguments.add_argument("--type", choices=["f4", "f8"], default="f8")
    arguments.add_argument("--robot", default="", help="Name of a listed robot.")
    arguments.add_argument("--packed", action="store_true", help="Compress the signals.")
    arguments.add_argument("--commands", nargs="+", default=["classify", "report"])
    arguments.add_argument("--trees", type=Path, nargs="+", default=[Path()])
    arguments.add_argument("--limit", type=float, default=14.0, help="Address space in [GB].")
    options = arguments.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    kept = set(options.folder.iterdir())
    try:
        print("| command | run | data |", " | ".join(map(str, options.trees)), "|")
        print("|---|---|---|" + "---|" * len(options.trees))
        for seconds in options.seconds:
            run = options.folder.resolve() / "run.npz"
            write(run, seconds, options)
            shown = f"{seconds:g} s at {options.rate:g} Hz"
            size = f"{run.stat().st_size / 1e9:.2f} GB"
            for name in options.commands:
                command = commands(run)[name]
                cells = [measured(command, tree, options.limit) for tree in options.trees]
                print(f"| {name} | {shown} | {size} |", " | ".join(cells), "|", flush=True)
    finally:
        for path in set(options.folder.iterdir()) - kept:
            path.unlink()


if __name__ == "__main__":
    main()
