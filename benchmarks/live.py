"""Time a live session: CPU per second of motion, of one core.

    python benchmarks/live.py [--seconds 20] [--joints 32] [--rate 10000]

Velocities, desired velocities and positions of TALOS's joints go through `LiveSession`, in chunks
of 20 ms and one by one, and as CSV through `inspector live`, from a file and from a pipe into which
20 ms are written at a time, in real time; into a file, and to a server that receives as a
viewer does. The start-up time is left out: of a pipe by waiting, of a file by the difference to
twice the motion, which has an error of a few percent on a busy machine.
"""

import argparse
import os
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import BinaryIO

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np

import noisemodel as nm
from inspector import LiveSession

ROBOT = "talos"


def motion(seconds: float, rate: float, joints: int) -> dict[str, np.ndarray]:
    """Sinusoidal motion of every joint, with noise."""
    time, random = np.arange(round(seconds * rate)) / rate, np.random.default_rng(0)
    phase = 2 * np.pi * random.uniform(0.1, 0.6, joints) * time[:, None]
    desired = 0.5 * np.cos(phase)
    velocity = desired + 0.01 * random.standard_normal(desired.shape)
    return {
        "time": time,
        "velocity": velocity,
        "velocity_desired": desired,
        "position": 0.3 * np.sin(phase),
    }


def through_session(
    signals: dict[str, np.ndarray], rate: float, names: tuple[str, ...], chunk: int, **sink: str
) -> tuple[float, str]:
    """CPU of one core per second of motion, and the summary of the session."""
    with LiveSession(rate, robot=ROBOT, joint_names=names, **sink) as session:
        first = {name: values[:chunk] for name, values in signals.items()}
        session.push(**first)
        start_time, samples = time.process_time(), len(signals["time"])
        for start in range(chunk, samples, chunk):
            piece = start if chunk == 1 else slice(start, start + chunk)
            session.push(**{name: values[piece] for name, values in signals.items()})
    return (time.process_time() - start_time) / (samples / rate), str(session.summary)


def through_csv(
    signals: dict[str, np.ndarray], rate: float, names: tuple[str, ...], folder: Path, *sink: str
) -> Iterator[tuple[str, float]]:
    """CPU of one core per second of motion, from a file and from a pipe."""
    kinds = [kind for kind in signals if kind != "time"]
    head = ",".join(["time", *(f"{name}.{kind}" for kind in kinds for name in names)])
    command = [sys.executable, "-m", "inspector", "live", "--rate", str(rate)]
    command += ["--robot", ROBOT, *sink]
    path, samples, used = folder / "motion.csv", len(signals["time"]), []
    for rows in (samples // 2, samples):
        table = np.hstack([signals["time"][:rows, None], *(signals[kind][:rows] for kind in kinds)])
        np.savetxt(path, table, fmt="%.7g", delimiter=",", header=head, comments="")
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        with path.open("rb") as stream:
            subprocess.run(command, stdin=stream, check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        used.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    yield "file", (used[1] - used[0]) / (samples / rate / 2)
    with path.open("rb") as stream:
        yield "pipe", feed(command, stream, round(0.02 * rate)) / (samples / rate)


def feed(command: list[str], stream: BinaryIO, rows: int) -> float:
    """Write rows into a command's standard input, 20 ms at a time, in real time.

    Returns:
        CPU time after the start-up of the command, in [s].
    """
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(command, stdin=subprocess.PIPE, **quiet)
    assert process.stdin is not None
    process.stdin.write(b"".join(islice(stream, rows)))
    process.stdin.flush()
    start = when_idle(process.pid)
    due = time.monotonic()
    while lines := b"".join(islice(stream, rows)):
        process.stdin.write(lines)
        process.stdin.flush()
        due += 0.02
        time.sleep(max(0.0, due - time.monotonic()))
    used = when_idle(process.pid) - start
    process.stdin.close()
    assert process.wait() == 0
    return used


def when_idle(process: int) -> float:
    """CPU time of a process once it is idle, in [s]."""
    used = [-1, 0]
    while used[-1] != used[-2] or used[-1] == 0:
        time.sleep(1.0)
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        used.append(int(fields[11]) + int(fields[12]))
    return used[-1] / os.sysconf("SC_CLK_TCK")


@contextmanager
def receiver() -> Iterator[str]:
    """Port of a server that receives recordings as a viewer does, without a window."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "rerun", "--serve-grpc", "--bind", "127.0.0.1"]
    command += ["--port", str(port), "--server-memory-limit", "200MB"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(command, start_new_session=True, **quiet)
    time.sleep(3.0)
    try:
        yield str(port)
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def main() -> None:
    """Measure and print."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--seconds", type=float, default=20.0)
    arguments.add_argument("--joints", type=int, default=32)
    arguments.add_argument("--rate", type=float, default=10_000.0)
    options = arguments.parse_args()
    rate, names = options.rate, nm.Robot.load(ROBOT).joint_names[: options.joints]
    signals = motion(options.seconds, rate, len(names))
    print(f"{len(names)} joints at {rate:g} Hz, {options.seconds:g} s: CPU of one core")
    with tempfile.TemporaryDirectory() as name, receiver() as port:
        file = str(Path(name) / "live.rrd")
        for where, sink in (("file", {"save": file}), ("server", {"connect": port})):
            for chunk in (round(0.02 * rate), 1):
                more = {"overwrite": True} if where == "file" else {}
                share, summary = through_session(signals, rate, names, chunk, **sink, **more)
                print(f"LiveSession, {chunk:4} samples at a time, to a {where:7} {share:6.1%}")
            print(summary)
            flags = ["--overwrite"] if where == "file" else []
            option = [item for key, value in sink.items() for item in (f"--{key}", value)]
            for source, share in through_csv(signals, rate, names, Path(name), *option, *flags):
                print(f"CSV from a {source} through `inspector live`, to a {where:7} {share:6.1%}")


if __name__ == "__main__":
    main()
