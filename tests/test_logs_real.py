"""Logs of a real Franka Panda and a real Unitree Go2, from import to verdict."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from noisemodel import Run

DATA = Path(__file__).parents[2] / "shared" / "data" / "panda"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="needs ../shared/data/panda")


def inspector(folder, *arguments):
    command = [sys.executable, "-m", "inspector", *map(str, arguments)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


def test_a_real_robots_log_is_imported_viewed_and_classified(tmp_path):
    logs = [DATA / "measured.csv", "--desired", DATA / "desired.csv"]
    imported = inspector(tmp_path, "import", *logs, "--robot", "panda", "-o", "run.npz")
    assert imported.returncode == 0, imported.stderr
    assert "resampled to 1000 Hz" in imported.stdout
    assert "4 gaps" in imported.stdout
    run = Run.load(tmp_path / "run.npz")
    assert (run.rate, len(run.joint_names), run.robot) == (1000.0, 7, "panda")
    assert run.duration == pytest.approx(21.0, abs=0.01)

    viewed = inspector(tmp_path, "view", "run.npz", "--save", "run.rrd")
    assert viewed.returncode == 0, viewed.stderr
    found = set(RrdReader(tmp_path / "run.rrd").store().schema().entity_paths())
    assert {"/class/found/ok", "/noise/simplified", "/robot/motion/panda_joint7"} <= found
    assert {"/joints/velocity_desired/0", "/joints/effort/0", "/spectrogram/bands/00"} <= found

    classified = inspector(tmp_path, "classify", "run.npz", "--format", "json")
    assert classified.returncode == 0, classified.stdout
    (verdict,) = json.loads(classified.stdout)["runs"]
    assert (verdict["status"], verdict["model"]) == ("ok", "general")


def test_legs_in_the_air_are_ok_though_their_desired_positions_come_in_coarse_steps(tmp_path):
    log = DATA.parent / "go2" / "positions.csv"
    imported = inspector(tmp_path, "import", log, "--robot", "go2", "-o", "run.npz")
    assert imported.returncode == 0, imported.stderr
    classified = inspector(tmp_path, "classify", "run.npz")
    assert classified.returncode == 0, classified.stdout
    assert "differentiated from positions in steps of 0.026 rad" in classified.stdout
    assert "it was left out." in classified.stdout
