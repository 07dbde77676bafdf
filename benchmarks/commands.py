"""Commands, each as a process of its own, beside real time, or beside an older checkout.

The runs: 10 s at 10 kHz of TALOS, 32 joints; 150 s at 1 kHz of 60 joints; both float32, with
positions, velocities measured and desired. The batch: 28 runs of 7 s. The MCAP: 20 s at 1 kHz of 60
joints, by `export`. With an older checkout, each has its own caches, and they take turns after a
warm-up.
"""

import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.checkouts import Checkout
from benchmarks.table import ROOT, Row, in_turns, of_process
from noisemodel import Robot, Run

REPEATS, BATCH = 3, 28
RECORDINGS = {"view of 10 s, 10 kHz, 32 joints": 20.0}  # most that a recording may have, in [MB]


def cases(folder: Path) -> dict[str, tuple[list[str], float, float | None]]:
    """Arguments of each command, the motion that it takes and the most CPU time, in [s]."""
    save = ["--overwrite", "-o", str(folder / "out.rrd")]
    page = ["--overwrite", "-o", str(folder / "out.html")]
    run = ["--overwrite", "-o", str(folder / "out.npz")]
    names = ("short.npz", "long.npz", "batch", "run.mcap")
    short, long, batch, mcap = (str(folder / name) for name in names)
    return {
        "`inspector --help`": (["--help"], 0.0, 0.5),
        "classify 10 s, 10 kHz, 32 joints": (["classify", short], 10.0, None),
        "classify 150 s, 1 kHz, 60 joints": (["classify", long], 150.0, None),
        "classify 28 runs of 7 s, 1 kHz, 18 joints": (["classify", batch], BATCH * 7.0, None),
        "import of an MCAP of 20 s, 1 kHz, 60 joints": (["import", mcap, *run], 20.0, 4.0),
        "view of 10 s, 10 kHz, 32 joints": (["view", short, *save], 10.0, 3.0),
        "view of 150 s, 1 kHz, 60 joints": (["view", long, *save], 150.0, 5.0),
        "report of 10 s, 10 kHz, 32 joints": (["view", short, *page], 10.0, None),
    }


def rows(before: Path | None) -> Iterator[Row]:
    """CPU time of each command, the size of a recording, and what a second process gains."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write(folder)
        ours = Checkout.of(ROOT, folder / "ours")
        sides = {"ours": ours}
        if before:
            sides["before"] = Checkout.of(before, folder / "before")
        for title, (arguments, seconds, most) in cases(folder).items():
            # An older `view` writes to other options.
            which = {"ours": ours} if arguments[0] == "view" else sides
            work = {side: partial(measure, each, arguments) for side, each in which.items()}
            if title == "`inspector --help`" and not before:
                work["empty Python"] = partial(of_process, [sys.executable, "-c", "pass"])
            times = in_turns(work, REPEATS, warm=1)
            against, other = "real time", seconds or None
            if len(times) > 1:
                against, other = list(times.items())[1]
            yield Row(title, times["ours"], against, other, most=most)
            if title in RECORDINGS:
                size = (folder / "out.rrd").stat().st_size / 1e6
                yield Row(f"{title}: recording", size, most=RECORDINGS[title], unit="MB")
        work = {jobs: partial(elapsed, ours, folder / "batch", jobs) for jobs in ("1", "2")}
        times = in_turns(work, REPEATS, warm=1)
        title = f"classify {BATCH} runs of 7 s, 1 kHz, 18 joints: wall time of `-j 2`"
        yield Row(title, times["2"], "`-j 1`", times["1"], wanted=1.8)


def measure(checkout: Checkout, arguments: Sequence[str]) -> float:
    """CPU time of one call of `inspector`, in [s]."""
    command = [checkout.python, "-m", "inspector", *arguments]
    return of_process(command, folder=checkout.folder, environment=checkout.environment)


def elapsed(checkout: Checkout, folder: Path, jobs: str) -> float:
    """Wall time of `classify` of a folder, in [s]."""
    start = time.perf_counter()
    measure(checkout, ["classify", str(folder), "-j", jobs])
    return time.perf_counter() - start


def write(folder: Path) -> None:
    """Write the runs."""
    short = moving(10_000, 10.0, Robot.load("talos").joint_names, "talos")
    short.save(folder / "short.npz")
    many = tuple(f"joint_{number}" for number in range(60))
    moving(1000, 150.0, many, None).save(folder / "long.npz")
    (folder / "batch").mkdir()
    moving(1000, 7.0, many[:18], None).save(folder / "batch" / "0.npz")
    for number in range(1, BATCH):
        (folder / "batch" / f"{number}.npz").symlink_to("0.npz")
    moving(1000, 20.0, many, None).save(folder / "run.npz")
    of_process(
        [sys.executable, "-m", "inspector", "export", folder / "run.npz", "-o", folder / "run.mcap"]
    )


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
