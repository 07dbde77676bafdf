"""A live session beside real time: CPU time per second of motion, without its start.

Velocities, desired velocities and positions of TALOS's 32 joints at 10 kHz go through `LiveSession`
in chunks of 20 ms and one by one, and as CSV through `inspector live`; into a recording, and to a
server that receives as a viewer does. Of a CSV, the start is left out by the difference to half of
the motion, which has an error of a few percent on a busy machine.
"""

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

import noisemodel as nm
from benchmarks.table import Row, of_process, used
from inspector import LiveSession

ROBOT, RATE, SECONDS = "talos", 10_000.0, 6.0
CHUNK = round(0.02 * RATE)
WANTED = {"LiveSession": 4.0, "CSV": 2.5}  # times real time: 25 % of a core, and 40 %


def rows(_: object) -> Iterator[Row]:
    """Each way in, into a recording and to a server."""
    names = nm.Robot.load(ROBOT).joint_names
    signals = motion(SECONDS, RATE, len(names))
    with tempfile.TemporaryDirectory() as name, receiver() as port:
        folder = Path(name)
        file = str(folder / "live.rrd")
        for where, sink in (("a file", {"save": file}), ("a viewer", {"connect": port})):
            for chunk in (CHUNK, 1):
                more = {"overwrite": True} if where == "a file" else {}
                spent = through_session(signals, names, chunk, **sink, **more)
                how = "chunks of 20 ms" if chunk > 1 else "sample by sample"
                wanted = WANTED["LiveSession"] if chunk > 1 else None
                yield Row(f"`LiveSession`, {how}, to {where}", spent, "real time", 1.0, wanted)
            flags = [item for key, value in sink.items() for item in (f"--{key}", value)]
            flags += ["--overwrite"] if where == "a file" else []
            spent = through_csv(signals, names, folder, *flags)
            yield Row(f"`inspector live`, CSV, to {where}", spent, "real time", 1.0, WANTED["CSV"])


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
    signals: dict[str, np.ndarray], names: tuple[str, ...], chunk: int, **sink: str | bool
) -> float:
    """CPU time per second of motion, in [s]."""
    samples = len(signals["time"])
    with LiveSession(RATE, robot=ROBOT, joint_names=names, **sink) as session:
        session.push(**{name: values[:chunk] for name, values in signals.items()})

        def rest() -> None:
            for start in range(chunk, samples, chunk):
                piece = start if chunk == 1 else slice(start, start + chunk)
                session.push(**{name: values[piece] for name, values in signals.items()})

        return used(rest) / (samples / RATE)


def through_csv(
    signals: dict[str, np.ndarray], names: tuple[str, ...], folder: Path, *sink: str
) -> float:
    """CPU time per second of motion, in [s]."""
    kinds = [kind for kind in signals if kind != "time"]
    head = ",".join(["time", *(f"{name}.{kind}" for kind in kinds for name in names)])
    command = [sys.executable, "-m", "inspector", "live", "--rate", str(RATE)]
    command += ["--robot", ROBOT, *sink]
    path, samples, spent = folder / "motion.csv", len(signals["time"]), []
    for rows in (samples // 2, samples):
        table = np.hstack([signals["time"][:rows, None], *(signals[kind][:rows] for kind in kinds)])
        np.savetxt(path, table, fmt="%.7g", delimiter=",", header=head, comments="")
        spent.append(of_process(command, stdin=path))
    return (spent[1] - spent[0]) / (samples / RATE / 2)


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
