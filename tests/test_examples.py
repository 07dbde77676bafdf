"""The examples run, on logs that are written here."""

import os
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from commandline import python
from samplelogs import JOINTS, TIMES, Talk, motion, write_bag, write_lerobot

from noisemodel import Run

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
PANDA = tuple(f"panda_joint{number}" for number in range(1, 8))


def example(name, folder, *arguments):
    """What an example prints, run in a folder."""
    env = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    return python(EXAMPLES / name, *arguments, cwd=folder, env=env, status=0).stdout


def test_a_mujoco_loop_is_recorded(tmp_path):
    example("mujoco_loop.py", tmp_path)
    run = Run.load(tmp_path / "elbow.npz")
    assert (run.rate, run.joint_names) == (500.0, ("elbow",))
    assert np.abs(run.position - run.position_desired)[500:].max() < 0.3


def test_a_pybullet_loop_is_recorded(tmp_path):
    pytest.importorskip("pybullet", reason="needs the extra elsewhere")
    example("pybullet_loop.py", tmp_path)
    run = Run.load(tmp_path / "panda.npz")
    assert (run.rate, run.robot, run.joint_names) == (240.0, "panda", PANDA)
    assert np.abs(run.position - run.position_desired)[240:].max() < 0.1


def test_a_ros_2_bag_is_classified(tmp_path):
    talk = Talk()
    position, velocity = motion((TIMES - TIMES[0]) * 1e-9, 7)
    states = [
        (stamp, talk.joint_state(stamp, PANDA, position[row], velocity[row]))
        for row, stamp in enumerate(TIMES)
    ]
    write_bag(tmp_path / "recording", talk, {"/joint_states": states})
    told = example("ros2_bag.py", tmp_path, "recording", "panda").splitlines()
    assert told[0] == "Run(panda, 7 joints, 400 samples at 100 Hz, 4 s, 0 blocks)"
    assert np.array_equal(Run.load(tmp_path / "bag.npz").position, position)


def test_a_lerobot_data_set_is_read_episode_by_episode(tmp_path):
    states = [factor * motion(np.arange(90) / 30)[0] for factor in (1, 2)]
    write_lerobot(tmp_path / "set", states, names=list(JOINTS))
    told = example("lerobot_dataset.py", tmp_path, "set").splitlines()
    assert [line.partition(",")[0] for line in told] == [
        "set-0: 3.0 s at 30 Hz",
        "set-1: 3.0 s at 30 Hz",
    ]


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.name)
def test_an_example_is_short(path):
    assert len(path.read_text().splitlines()) < 25


def test_the_page_quotes_the_mujoco_example():
    code = (EXAMPLES / "mujoco_loop.py").read_text(encoding="utf-8")
    page = (ROOT / "docs" / "record.md").read_text("utf-8")
    quoted = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert code.partition("\n\n")[2] in quoted
