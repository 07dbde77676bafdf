"""Time the import of a ROS 2 bag, and measure its memory: 60 joints at 1 kHz with jitter.

Run from the checkout: ``python -m benchmarks.logs [megabytes]``. rosbags writes the bag
first; a process of its own then reads it on one core; CPU time, and peak memory of the process.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"  # before NumPy is there

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

JOINTS = tuple(f"left_joint_number_{number}" for number in range(60))
STORAGES = {"mcap": StoragePlugin.MCAP, "sqlite3": StoragePlugin.SQLITE3}
MESSAGE = 3100
"""Approximate size of a message in a bag, in [bytes]."""


def main() -> None:
    """Print for each storage size, rate and memory of reading, and of the whole command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("megabytes", nargs="?", type=int, default=150, help="size of the bag")
    parser.add_argument("--read", type=Path, help="read this bag, and print CPU time and memory")
    parser.add_argument("--save", action="store_true", help="also write a run file")
    arguments = parser.parse_args()
    if arguments.read:
        read(arguments.read, save=arguments.save)
        return
    for storage, plugin in STORAGES.items():
        with tempfile.TemporaryDirectory() as folder:
            bag = Path(folder) / "bag"
            write(bag, plugin, arguments.megabytes * 1_000_000 // MESSAGE)
            size = sum(file.stat().st_size for file in bag.iterdir()) / 1e6
            for save in ([], ["--save"]):
                command = [sys.executable, "-m", "benchmarks.logs", "--read", str(bag), *save]
                printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
                seconds, memory = map(float, printed.split())
                what = "read and saved" if save else "read"
                print(
                    f"{storage:8} {size:6.0f} MB {what:15} {seconds:6.2f} s CPU"
                    f" {size / seconds:6.1f} MB/s, peak {memory:5.0f} MB"
                )


def write(bag: Path, storage: StoragePlugin, samples: int) -> None:
    """Write a bag of joint states, with a jitter of up to a tenth of a step."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    state = store.types["sensor_msgs/msg/JointState"]
    random = np.random.default_rng(0)
    with Writer(bag, version=9, storage_plugin=storage) as writer:
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


def read(bag: Path, *, save: bool) -> None:
    """Import a bag; print the CPU time in [s] and the process's peak memory in [MB]."""
    from inspector import read_log

    start = time.process_time()
    run = read_log(bag).run
    if save:
        run.save(bag.parent / "run.npz", overwrite=True)
    print(time.process_time() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3)


if __name__ == "__main__":
    main()
