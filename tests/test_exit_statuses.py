"""What every command ends with: 70 at a bug, 5 if nobody or a full disk takes what it prints."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from commandline import call
from generalmodel import run_at

from inspector import cli
from inspector.assets import demo_run
from inspector.report.formats import as_json
from inspector.status import Status
from inspector.verdict import Verdict
from noisemodel import Block

ROOT = Path(__file__).parents[1]
ROWS = "time,a.velocity\n" + "".join(f"{k / 100},{k % 70 / 70}\n" for k in range(400))
COMMANDS = {
    "view": ("run.npz", "-o", "out/run.rrd"),
    "live": ("--rate", "100", "--save", "out/live.rrd"),
    "noise": ("run.npz",),
    "listen": ("run.npz", "-o", "out/run.wav"),
    "robots": (),
    "classify": ("run.npz",),
    "accept": ("run.npz", "--reason", "good", "-o", "out/reference"),
    "diff": ("good", "good"),
    "merge": ("results/1-first.json",),
    "history": ("results",),
    "audit": ("run.npz",),
    "smoothness": ("good",),
    "import": ("log.csv", "-o", "out/run.npz"),
    "export": ("run.npz", "-o", "out/run.csv"),
    "train": ("annotated", "-o", "out/model.npz"),
    "tune": (
        "fast",
        "--profile",
        "noisytest-linear",
        "--grid",
        "C=1",
        "--folds",
        "2",
        "-o",
        "out/t",
    ),
    "evaluate": ("general", "annotated"),
    "simulate": ("run", "panda", "--duration", "3", "-o", "out/simulated.npz"),
}
"""A call of each command that prints something."""

SILENT_BUGS = {
    "live": "inspector.live.input.reader_of",
    "robots": "noisemodel.robot.menagerie_names",
    "merge": "inspector.verdict.from_json",
    "history": "inspector.verdict.from_json",
}
"""Where a bug is put into commands that read no run."""


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inputs")
    for name in ("good", "annotated", "fast", "out"):
        (folder / name).mkdir()
    blocks = (Block(0.0, 2.0, "ok"), Block(2.5, 4.0, "impact"))
    run_at(125.0, blocks=blocks).save(folder / "run.npz")
    for seed in range(2):
        run_at(125.0, seed=seed, seconds=60.0).save(folder / "good" / f"{seed}.npz")
        for label in ("ok", "impact", "oscillations"):
            run = run_at(1000.0, label, seed, blocks=(Block(0.0, 4.9, label),))
            run.save(folder / "annotated" / f"{label}-{seed:03d}.npz")
        time = np.arange(8000) / 10_000
        noise = np.random.default_rng(seed).normal(size=8000)
        np.savetxt(folder / "fast" / f"{seed}.log", np.column_stack((time, noise)), fmt="%.4f")
        ranges = "chunk_ranges = [[0.0, 0.4], [0.4, 0.8]]\nchunk_labels = ['ok', 'impact']\n"
        (folder / "fast" / f"{seed}.toml").write_text(f"[data]\n{ranges}")
    shutil.copy(demo_run(), folder / "demo.npz")
    (folder / "log.csv").write_text(ROWS)
    (folder / "results").mkdir()
    (folder / "results" / "1-first.json").write_text(as_json([Verdict(Path("a.npz"), Status.OK)]))
    return folder


@pytest.fixture
def place(inputs, tmp_path, monkeypatch):
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def start(place, name, **settings):
    rows = place / "rows"
    rows.write_text(ROWS)
    with rows.open() as stream:
        return subprocess.run(
            [sys.executable, "-m", "inspector", name, *COMMANDS[name]],
            cwd=place,
            env=os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'models'}"},
            check=False,
            stdin=stream,
            stderr=subprocess.PIPE,
            text=True,
            **settings,
        )


def test_each_command_is_tried():
    assert set(cli.COMMANDS) - {"help", "config"} == set(COMMANDS)


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_ends_with_5_if_the_disk_that_takes_its_output_is_full(place, name):
    if not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    with Path("/dev/full").open("w") as full:
        done = start(place, name, stdout=full)
    assert done.returncode == 5, done.stderr
    assert re.findall("output lost.*", done.stderr) == [
        "output lost: standard output: cannot be written (No space left on device)"
    ]
    assert "Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_ends_with_70_and_a_traceback_at_a_bug(place, name, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("a bug")

    if name in SILENT_BUGS:
        monkeypatch.setattr(SILENT_BUGS[name], broken)
        with (place / "log.csv").open() as rows:
            monkeypatch.setattr(sys, "stdin", rows)
            status, out, err = call(name, *COMMANDS[name])
    elif name == "tune":
        monkeypatch.setattr("noiseclassifier.noisytest.parse_annotations", broken)
        status, out, err = call(name, *COMMANDS[name])
    else:
        monkeypatch.setattr("noisemodel.run.check_time", broken)
        status, out, err = call(name, *COMMANDS[name])
    assert status == 70
    assert "ZeroDivisionError: a bug" in out + err
    assert not [each for each in (place / "out").iterdir() if name != "accept"]
