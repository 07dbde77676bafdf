"""The import of a ROS 2 bag beside rosbags alone: 60 joints at 1 kHz with jitter.

rosbags writes the bag. A process of its own then imports it, or lets rosbags deserialise each
message: CPU time, and peak memory of the import.
"""

import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.table import ROOT, Row, in_turns

JOINTS = tuple(f"left_joint_number_{number}" for number in range(60))
STORAGES = ("MCAP", "SQLITE3")
SIZE, MESSAGE = 60, 3100  # size of a bag, in [MB], and approximately of a message in it, in [bytes]
SPEED, MEMORY = 20.0, 1000.0  # least speed, in [MB/s], and most memory, in [MB]
REPEATS = 3


def rows(_: object) -> Iterator[Row]:
    """Time and memory by storage."""
    for storage in STORAGES:
        with tempfile.TemporaryDirectory() as folder:
            bag, peaks = Path(folder) / "bag", []
            write(bag, storage, SIZE * 1_000_000 // MESSAGE)
            size = sum(file.stat().st_size for file in bag.iterdir()) / 1e6

            def spent(what: str, bag: Path = bag, peaks: list[float] = peaks) -> float:
                code = f"from benchmarks import logs; logs.{what}({str(bag)!r})"
                done = subprocess.run(
                    [sys.executable, "-c", code],
                    cwd=ROOT,
                    check=True,
                    capture_output=True,
                    text=True,
                )
                seconds, memory = map(float, done.stdout.split())
                peaks.append(memory if what == "imported" else 0.0)
                return seconds

            sides = {what: partial(spent, what) for what in ("imported", "deserialised")}
            times = in_turns(sides, REPEATS)
            name = f"import of a ROS 2 bag, {storage.lower()}, {size:.0f} MB"
            ours, other = times["imported"], times["deserialised"]
            yield Row(name, ours, "rosbags alone", other, most=size / SPEED)
            yield Row(f"{name}: memory", max(peaks), most=MEMORY, unit="MB")


def write(bag: Path, storage: str, samples: int) -> None:
    """Write a bag of joint states, with a jitter of up to a tenth of a step."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    state = store.types["sensor_msgs/msg/JointState"]
    random = np.random.default_rng(0)
    with Writer(bag, version=9, storage_plugin=StoragePlugin[storage]) as writer:
        topic = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
        for sample in range(samples):
            at = 1_700_000_000 * 10**9 + sample * 10**6 + int(random.integers(-(10**5), 10**5))
            values = np.sin(1e-3 * sample) + 1e-3 * random.standard_normal((3, len(JOINTS)))
            message = state(
                header=header(stamp=stamp(sec=at // 10**9, nanosec=at % 10**9), frame_id=""),
                name=list(JOINTS),
                position=values[0],
                velocity=values[1],
                effort=values[2],
            )
            writer.write(topic, at + 50_000, store.serialize_cdr(message, state.__msgtype__))


def imported(bag: str) -> None:
    """Import a bag; print the CPU time in [s] and the process's peak memory in [MB]."""
    from inspector import read_log

    start = time.process_time()
    read_log(bag)
    report(start)


def deserialised(bag: str) -> None:
    """Let rosbags deserialise each message; print the same."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    start = time.process_time()
    with AnyReader([Path(bag)], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        for connection, _stamp, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
    report(start)


def report(start: float) -> None:
    """Print what was used since; the peak that `resource` has begins with that of the parent."""
    (peak,) = re.findall(r"VmHWM:\s*(\d+) kB", Path("/proc/self/status").read_text())
    print(time.process_time() - start, int(peak) / 1e3)
