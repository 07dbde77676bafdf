"""Logs of a real Franka Panda and a real Unitree Go2, from import to verdict."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commandline import printed
from rerun.chunk import RrdReader

import inspector
from inspector.logs.read import read_log
from noisemodel import Run

DATA = Path(__file__).parents[2] / "shared" / "data" / "panda"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="needs ../shared/data/panda")


def test_a_real_robots_log_is_imported_audited_viewed_and_classified(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    logs = [DATA / "measured.csv", "--desired", DATA / "desired.csv"]
    out = printed("import", *logs, "--robot", "panda", "-o", "run.npz")
    assert "resampled to 1000 Hz" in out
    assert "4 gaps" in out
    run = Run.load(tmp_path / "run.npz")
    assert (run.rate, len(run.joint_names), run.robot) == (1000.0, 7, "panda")
    assert run.duration == pytest.approx(21.0, abs=0.01)

    out = printed("audit", "run.npz")
    assert "stamps were off by 0.165 ms rms" in out
    assert "missing: 4 gaps" in out
    assert "impact: observable" in out
    assert "oscillations: partly, 20 to 440 Hz" in out
    assert "warning" not in out

    printed("view", "run.npz", "-o", "run.rrd")
    found = set(RrdReader(tmp_path / "run.rrd").store().schema().entity_paths())
    assert {"/class/found/ok", "/noise/simplified", "/robot/motion"} <= found
    assert {"/joints/velocity_desired/0", "/joints/effort/0", "/spectrogram/bands/00"} <= found

    (verdict,) = json.loads(printed("classify", "run.npz", "--format", "json"))["runs"]
    assert (verdict["status"], verdict["model"]) == ("ok", "general")


def test_legs_in_the_air_are_ok_though_their_desired_positions_come_in_coarse_steps(tmp_path):
    log = DATA.parent / "go2" / "positions.csv"
    printed("import", log, "--robot", "go2", "-o", tmp_path / "run.npz")
    out = printed("classify", tmp_path / "run.npz")
    assert "differentiated from positions in steps of 0.026 rad" in out
    assert "it was left out." in out


@pytest.mark.parametrize("frequency", [25.0, 60.0, 150.0])
@pytest.mark.parametrize("rms", [0.3, 3.0, 100.0])
def test_a_tone_of_half_a_second_in_a_real_log_is_found_however_loud(rms, frequency):
    run = read_log(DATA / "measured.csv").run
    time, velocity = run.time - run.time[0], run.velocity.astype(np.float64)
    during = (time >= 9.0) & (time < 9.5)
    velocity[:, 1] += during * rms * np.sqrt(2) * np.sin(2 * np.pi * frequency * time)
    found = inspector.analyse(replace(run, velocity=velocity)).findings
    begin = float(run.time[0])
    assert [each.label for each in found] == ["oscillations"]
    assert found[0].start == pytest.approx(begin + 9.0, abs=0.2)
    assert found[0].stop == pytest.approx(begin + 9.5, abs=0.2)
