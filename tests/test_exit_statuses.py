"""What every command ends with: 70 at a bug, 5 if nobody or a full disk takes what it prints."""

import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from commandline import call
from generalmodel import run_at

from inspector import cli
from inspector.errors import Status
from inspector.library import demo_run
from inspector.report.formats import as_json
from inspector.verdict import Verdict
from noisemodel import Block

ROWS = "time,a.velocity\n" + "".join(f"{k / 100},{k % 70 / 70}\n" for k in range(400))
TUNE = ("--profile", "noisytest-linear", "--grid", "C=1", "--folds", "2")
# A call of each command that prints something.
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
    "train": ("annotated", "--profile", "logbands", "--rate", "1000", "-o", "out/model.npz"),
    "tune": ("fast", *TUNE, "-o", "out/t"),
    "evaluate": ("general", "annotated"),
    "simulate": ("run", "panda", "--duration", "3", "-o", "out/simulated.npz"),
}
# Where a bug is put into commands that make no run.
BUGS = {
    "live": "inspector.live.pipe.reader_of",
    "robots": "noisemodel.robot.menagerie_names",
    "merge": "inspector.verdict.from_json",
    "history": "inspector.verdict.from_json",
    "tune": "noiseclassifier.noisytest.parse_annotations",
}


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


def test_each_command_is_tried():
    assert set(cli.MODULES) - {"help"} == set(COMMANDS)


@pytest.fixture
def rows(place, monkeypatch):
    """What standard input holds."""
    with (place / "log.csv").open() as stream:
        monkeypatch.setattr(sys, "stdin", stream)
        yield


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_ends_with_5_if_the_disk_that_takes_its_output_is_full(
    rows, name, monkeypatch, capsys
):
    monkeypatch.setattr(sys, "argv", ["inspector", name, *COMMANDS[name]])
    with Path("/dev/full").open("w") as full:
        for stream in ("stdout", "__stdout__"):
            monkeypatch.setattr(sys, stream, full)
        with pytest.raises(SystemExit) as end:
            cli.main()
    complained = capsys.readouterr().err
    assert end.value.code == 5, complained
    assert re.findall("output lost.*", complained) == [
        "output lost: standard output: cannot be written (No space left on device)"
    ]
    assert "Traceback" not in complained


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_ends_with_70_and_a_traceback_at_a_bug(place, rows, name, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(BUGS.get(name, "noisemodel.run.check_time"), broken)
    status, out, err = call(name, *COMMANDS[name])
    assert status == 70
    assert "ZeroDivisionError: a bug" in out + err
    assert not [each for each in (place / "out").iterdir() if name != "accept"]
