"""HDF5 as robomimic and Isaac Lab write it, by h5py."""

import json

import h5py
import numpy as np
import pytest
from samplelogs import numbers

from inspector import read_log
from inspector.errors import LogError

POSITION, VELOCITY = numbers(7), numbers(7, seed=1)
TURN = np.array([np.cos(np.pi / 4), 0.0, 0.0, np.sin(np.pi / 4)])
"""A quarter turn about z, w first."""


def write(path, episodes, env_args=None):
    with h5py.File(path, "w") as file:
        home = file.create_group("data")
        if env_args is not None:
            home.attrs["env_args"] = json.dumps(env_args)
        for episode, arrays in episodes.items():
            for name, values in arrays.items():
                home[f"{episode}/{name}"] = values
    return path


def test_isaac_labs_states_take_precedence_over_observations_and_hold_the_base(tmp_path):
    pose = np.column_stack((numbers(3), np.tile(TURN, (400, 1))))
    twist = np.tile([1.0, 0.0, 0.0, 0.0, 2.0, 3.0], (400, 1))
    home = "states/articulation/robot"
    demo = {
        "obs/joint_pos": POSITION - 1,
        "obs/joint_vel": VELOCITY,
        f"{home}/joint_position": POSITION,
        f"{home}/joint_velocity": VELOCITY,
        f"{home}/root_pose": pose,
        f"{home}/root_velocity": twist,
    }
    args = {"env_name": "Isaac-Velocity", "type": 2, "sim_args": {"dt": 0.005, "decimation": 4}}
    run = read_log(write(tmp_path / "isaac.hdf5", {"demo_0": demo}, args)).run
    assert np.array_equal(run.position, POSITION)
    assert run.rate == pytest.approx(50.0)
    assert np.allclose(run.base_pose[:, 3:], [0, 0, np.sqrt(0.5), np.sqrt(0.5)])
    # The body faces along the world's y: motion along x is to its right.
    assert np.allclose(run.base_velocity, [0.0, -1.0, 0.0, 2.0, 0.0, 3.0])


def test_any_file_is_read_by_mapping(tmp_path):
    with h5py.File(tmp_path / "own.h5", "w") as file:
        file["log/clock"] = np.arange(400) / 250
        file["log/q_arm"] = POSITION
        file["log/other"] = np.zeros((3, 3))
    mapping = ["time=log/clock", "position=log/q_arm[0:6]", "velocity.tool=log/q_arm[6]"]
    run = read_log(tmp_path / "own.h5", mapping=mapping, joints=[*"abcdef"]).run
    assert run.rate == 250.0
    assert np.array_equal(run.velocity[:, run.joint_names.index("tool")], POSITION[:, 6])


def test_what_is_missing_is_an_error_of_one_line(tmp_path):
    path = write(tmp_path / "log.hdf5", {"demo_0": {"obs/joint_pos": POSITION}})
    with pytest.raises(LogError, match="there are no stamps; give the log's rate"):
        read_log(path)
    path = write(tmp_path / "other.hdf5", {"demo_0": {"obs/eef": POSITION}})
    message = "demo_0 holds no known joint positions or velocities; name them, .* obs/eef"
    with pytest.raises(LogError, match=message):
        read_log(path, rate=50)
