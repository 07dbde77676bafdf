import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from commandline import call, complaint, printed, python, refused
from generalmodel import fixed

from inspector.library import demo_run, model_files
from inspector.recording import viewer

ROOT = Path(__file__).parents[1]
HAS_DISPLAY = viewer.has_display


@pytest.fixture(autouse=True)
def headless(monkeypatch):
    monkeypatch.setattr(viewer, "has_display", lambda: False)


def run_without_robot(path: Path, *, rate: float = 10_000.0, seconds: float = 1.0) -> Path:
    time = np.arange(round(seconds * rate)) / rate
    np.savez(path, time=time, velocity=np.cos(time)[:, None])
    return path


def test_the_demo_is_shown_without_a_display(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for _ in range(2):  # the second time it replaces its own recording
        out = printed("view")
    (recording,) = tmp_path.rglob("demo-*.rrd")
    assert f"recording: {recording}" in out
    assert f"rerun {recording}" in out
    assert "inspector view RUN --web" in out


@pytest.fixture
def viewers(monkeypatch, tmp_path):
    """A display, and a viewer that runs, or that has ended with a status; what was started."""
    monkeypatch.setattr(viewer, "listens", lambda *_: True)  # display and viewer respond
    monkeypatch.setattr(viewer, "START_TIMEOUT", 0.0)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(viewer, "has_display", lambda: True)
    started = []

    class Viewer:
        ended = None

        def __init__(self, command, **_):
            started.append(command)

        def wait(self, timeout):
            if self.ended is None:
                raise subprocess.TimeoutExpired("rerun", timeout)
            return self.ended

        def poll(self):
            return self.ended

    monkeypatch.setattr(subprocess, "Popen", Viewer)
    return Viewer, started


def test_the_viewer_is_started_on_loopback_and_not_waited_for(viewers, tmp_path):
    status, out, _ = call("view", run_without_robot(tmp_path / "run.npz"))
    assert (status, "recording:" in out) == (0, False)
    (command,) = viewers[1]
    assert command[command.index("--bind") + 1] == "127.0.0.1"


def test_a_viewer_that_ends_is_reported_and_the_recording_stays(viewers, tmp_path):
    viewers[0].ended = 101
    status, out, err = call("view", run_without_robot(tmp_path / "run.npz"))
    assert (status, "recording:" in out) == (5, True)
    assert err == (
        "inspector: the viewer ended with status 101;"
        " --web shows it in a browser, -o FILE.rrd writes it\n"
    )


def test_a_display_that_cannot_be_opened_ends_with_5_and_what_to_do(monkeypatch, tmp_path):
    monkeypatch.setattr(viewer, "has_display", HAS_DISPLAY)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", ":4099")
    status, out, err = call("view", run_without_robot(tmp_path / "run.npz"))
    assert status == 5
    assert err.count("\n") == 1
    assert "(no window can be opened on this display: Failed to open connection to X server)" in err
    assert "--web shows it in a browser, -o FILE.rrd writes it" in err
    assert "recording:" in out
    assert "open it in the viewer:" in out


def test_a_rate_below_every_model_shows_everything_but_the_lanes(tmp_path):
    run = run_without_robot(tmp_path / "slow.npz", rate=50.0, seconds=20.0)
    out = printed("view", run, "-o", tmp_path / "slow.rrd")
    assert "cannot-tell: logged at 50 Hz" in out
    assert "No labels: logged at 50 Hz" in out
    assert (tmp_path / "slow.rrd").exists()
    assert call("classify", run)[0] == 4


def test_a_run_between_two_rates_is_decimated_never_upsampled(tmp_path):
    run = run_without_robot(tmp_path / "run.npz", rate=4000.0)
    own = []
    for rate in (1000.0, 10_000.0):
        own += ["--model", tmp_path / f"{rate:g}.npz"]
        fixed(rate=rate).save(own[-1])
    status, out, _ = call("classify", run, *own)
    assert status in (0, 1)
    assert "Labelled at 1000 Hz" in out


def test_one_bad_file_never_stops_the_rest(tmp_path):
    (tmp_path / "text.npz").write_text("not an archive")
    good = run_without_robot(tmp_path / "good.npz")
    runs = (good, tmp_path / "text.npz", tmp_path / "gone.npz")
    status, out, err = call("classify", *runs, "-j", "2", "--format", "json")
    assert status == 3
    states = [run["status"] for run in json.loads(out)["runs"]]
    assert states[0] in ("ok", "findings")
    assert states[1:] == ["bad-input", "bad-input"]
    lines = err.splitlines()
    assert len(lines) == 2
    assert "text.npz: not a run file" in lines[0]
    assert "gone.npz: cannot be read (No such file or directory)" in lines[1]


def test_wrong_usage_exits_with_2():
    for wrong in (["classify"], ["classify", "x", "--format", "yaml"], ["fly"], ["view", "--fast"]):
        status, out, _ = call(*wrong)
        assert status == 2
        assert out == ""


def test_a_model_that_is_damaged_is_one_line(tmp_path):
    model = tmp_path / "model.npz"
    model.write_bytes(model_files()[0].read_bytes()[:1000])
    run = run_without_robot(tmp_path / "run.npz")
    assert "model.npz" in refused("classify", run, "--model", model)


def test_long_work_is_not_begun_for_an_output_that_exists(tmp_path):
    (tmp_path / "out.npz").write_text("precious")
    for long in (["simulate", "panda"], ["train", tmp_path / "gone.npz"]):
        assert "exists already" in refused(*long, "-o", tmp_path / "out.npz")


def test_the_noise_is_printed_and_written(tmp_path):
    run = run_without_robot(tmp_path / "run.npz")
    out = printed("noise", run, "--csv", tmp_path / "noise.csv")
    assert "peak 1 rad/s at 0.000 s" in out
    assert "100.0%  joint_0" in out
    lines = (tmp_path / "noise.csv").read_text().splitlines()
    assert lines[0] == "time [s],simplified [rad/s]"
    assert len(lines) == 10_001


def test_simplified_and_extended_noise_are_printed_side_by_side(tmp_path):
    out = printed("noise", demo_run(), "--csv", tmp_path / "noise.csv")
    simplified, _, paper = out.partition("paper: rms")
    assert "simplified: rms" in simplified
    assert "panda_joint2, desired" in simplified
    assert "panda_link3" in paper
    head, first, *_ = (tmp_path / "noise.csv").read_text(encoding="utf-8").splitlines()
    assert head == "time [s],simplified [rad/s],paper [√W]"
    assert len(first.split(",")) == 3
    out = printed("noise", demo_run(), "--kind", "normal", "--kind", "A")
    assert [line.split(":")[0] for line in out.splitlines() if "rms" in line] == ["normal", "A"]


def test_a_kind_that_does_not_exist_or_cannot_be_had_is_one_line(tmp_path):
    err = refused("noise", demo_run(), "--kind", "loud", status=2)
    assert "no kind 'loud' of noise; there are simplified, paper" in err
    err = refused("noise", run_without_robot(tmp_path / "run.npz"), "--kind", "paper")
    assert "kind 'paper' needs a robot, the run names none" in err


def test_a_profile_that_does_not_exist_at_a_rate_is_one_line(tmp_path):
    run = run_without_robot(tmp_path / "run.npz")
    arguments = ["train", run, "-o", tmp_path / "m.npz", "--profile"]
    status, _, err = call(*arguments, "noisytest-rbf", "--rate", 1000)
    assert (status, "exists at 10000 Hz only" in err) == (2, True)
    status, _, err = call(*arguments, "best")
    told = "no profile 'best' of one rate; there are logbands, noisytest-rbf"
    assert (status, told in err) == (2, True)
    status, _, err = call("train", run, "-o", tmp_path / "m.npz")
    assert (status, "left out: 1 run without annotated blocks" in err) == (3, True)


def imported_by(*arguments):
    code = (
        "import sys; from inspector.cli import main\n"
        f"sys.argv = {['inspector', *map(str, arguments)]!r}\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "print('imported:', *sorted(sys.modules))"
    )
    env = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'models'}"}
    said = python("-c", code, env=env, status=0).stdout
    return set(said.rpartition("imported:")[2].split())


def test_help_imports_nothing_heavy():
    heavy = {"numpy", "rerun", "sklearn", "pinocchio", "scipy", "noiseclassifier", "noisemodel"}
    assert not imported_by("--help") & heavy


def test_classifying_imports_no_library_that_takes_long():
    modules = imported_by("classify", demo_run())
    assert "noiseclassifier" in modules
    assert not modules & {"sklearn", "scipy.signal", "rerun", "pinocchio", "mujoco", "pydantic"}


def test_a_score_that_no_finding_can_have_is_refused():
    assert "'--min-score'" in complaint("classify", demo_run(), "--min-score", "1.5", status=2)
    assert call("classify", demo_run(), "--min-score", "0.999")[0] == 0
    assert call("classify", demo_run(), "--min-score", "0.9")[0] == 1
