"""Files with random damage: an error of one line, or a run, but never a traceback."""

import random

import csvlogs
import h5py
import numpy as np
import pytest
from samplelogs import JOINTS, TIMES, Talk, joint_states, motion, numbers, write_bag, write_lerobot

from inspector import read_logs
from inspector.errors import InspectorError
from noisemodel import NoiseModelError

TRIES = 25


def ros2(folder, **how):
    talk = Talk()
    states = joint_states(talk, position=numbers() / 10, velocity=numbers(seed=1))
    path = write_bag(folder / "bag", talk, {"/joint_states": states}, **how)
    return next(each for each in path.iterdir() if each.name != "metadata.yaml")


def ros1(folder, **how):
    talk = Talk(ros1=True)
    states = joint_states(talk, position=numbers() / 10)
    return write_bag(folder / "log.bag", talk, {"/joint_states": states}, **how)


def hdf5(folder):
    with h5py.File(folder / "log.hdf5", "w") as file:
        file["data/demo_0/time"] = (TIMES - TIMES[0]) * 1e-9
        file["data/demo_0/obs/joint_pos"] = numbers()
    return folder / "log.hdf5"


def npz(folder):
    np.savez_compressed(folder / "log.npz", time=np.arange(400) / 100, joint_vel=numbers())
    return folder / "log.npz"


def lerobot(folder):
    write_lerobot(folder / "set", [motion(np.arange(90) / 30)[0]], names=list(JOINTS))
    return folder / "set" / "data" / "chunk-000" / "file-000.parquet"


SAMPLES = {
    "mcap": lambda folder: ros2(folder, storage="mcap"),
    "mcap, zstd": lambda folder: ros2(folder, storage="mcap", compression="storage"),
    "sqlite3": lambda folder: ros2(folder, storage="sqlite3"),
    "ros1": ros1,
    "ros1, bz2": lambda folder: ros1(folder, compression="bz2"),
    "hdf5": hdf5,
    "npz": npz,
    "lerobot": lerobot,
    "csv": csvlogs.log,
}


def complaint(path):
    """Read the first run of a log; the text of an expected error, or nothing."""
    try:
        next(read_logs(path), None)
    except (InspectorError, NoiseModelError) as error:
        return str(error)
    return ""


@pytest.mark.parametrize("kind", SAMPLES)
def test_damage_gives_an_error_of_one_line_or_a_run(tmp_path, kind):
    path = SAMPLES[kind](tmp_path)
    whole = path.read_bytes()
    chance = random.Random(0)
    for _ in range(TRIES):
        data = bytearray(whole)
        if chance.random() < 0.3:
            del data[chance.randrange(len(data)) :]
        for _ in range(chance.choice([0, 1, 3, 30])):
            if data:
                data[chance.randrange(min(len(data), chance.choice([64, 2000, 10**9])))] = (
                    chance.randrange(256)
                )
        path.write_bytes(data)
        assert "\n" not in complaint(path)
