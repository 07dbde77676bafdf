"""Names that would write to a terminal, a CI's log or a spreadsheet."""

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from commandline import call, complaint, refused
from hypothesis import given, settings
from hypothesis import strategies as st

from inspector.library import demo_run
from inspector.text import cell, uncell
from noisemodel import Block, Run

HOSTILE = "a\n::error::b\x1b[31m\r"
SHOWN = r"a\n::error::b\x1b[31m\r"


@pytest.mark.parametrize("form", ["text", "json", "github", "junit", "markdown", "sarif"])
def test_a_file_whose_name_has_control_characters_is_bad_input_and_named_without_them(
    tmp_path, form
):
    shutil.copy(demo_run(), tmp_path / f"{HOSTILE}.npz")
    shutil.copy(demo_run(), tmp_path / "demo.npz")
    (tmp_path / f"{HOSTILE}.txt").write_text("left out")
    status, out, err = call("classify", tmp_path, "--format", form)
    assert status == 3
    assert f"{SHOWN}.npz: its name has control characters; rename it" in err
    assert "1.78" in out  # the other run has its finding
    for text in (out, err):
        assert not set(text) & set("\x1b\r")
        assert not any(line.startswith("::error::b") for line in text.splitlines())


def test_a_file_whose_name_is_no_utf_8_is_named_by_its_bytes_in_all_outputs(tmp_path):
    runs = tmp_path / "runs"
    runs.mkdir()
    shutil.copy(demo_run(), runs / "a\udcff.npz")
    outputs = [tmp_path / form for form in ("text", "json", "github", "junit", "markdown", "sarif")]
    page = tmp_path / "page"
    writes = [f"--write={path.name}={path}" for path in outputs]
    status, _, err = call("classify", runs, *writes, "--report", page)
    assert (status, err) == (1, "")
    assert all(r"a\udcff.npz" in path.read_text() for path in outputs[:3])
    assert "a%FF.npz" in outputs[5].read_text()
    assert len(list((page / "pictures").iterdir())) == 1
    assert call("merge", outputs[1], "--report", page, "--overwrite")[0] == 1
    err = refused("accept", runs, "--reason", "good")
    assert err.endswith(".npz: its name is no text in UTF-8; rename it\n")


@pytest.mark.parametrize("suffix", ["rrd", "html"])
def test_a_run_whose_name_is_no_utf_8_is_shown(tmp_path, suffix):
    shutil.copy(demo_run(), tmp_path / "a\udcff.npz")
    output = tmp_path / f"out.{suffix}"
    assert call("view", tmp_path / "a\udcff.npz", "-o", output)[0] == 0
    assert rb"a\udcff" in output.read_bytes()


def test_a_typed_name_with_control_characters_is_wrong_usage(tmp_path):
    for arguments in (["classify", tmp_path / HOSTILE], ["noise", demo_run(), "--csv", HOSTILE]):
        assert refused(*arguments, status=2).endswith(f"{SHOWN}: has control characters\n")


def test_joints_cannot_be_named_by_control_characters_and_are_listed_without(tmp_path):
    (tmp_path / "log.csv").write_text("time,b\x1b[31m.velocity\n0,1\n0.1,2\n")
    status, out, _ = call("import", tmp_path / "log.csv", "--list")
    assert (status, "\x1b" in out) == (0, False)
    assert r"b\x1b[31m.velocity" in out
    assert "\x1b" not in complaint("classify", tmp_path / "log.csv")
    with pytest.raises(ValueError, match="it is empty or cannot be printed"):
        Run(time=np.arange(9) / 9, velocity=np.zeros((9, 1)), joint_names=("a\nb",))


@pytest.mark.parametrize("name", ["demo_\n::error::b", "demo_\x1b[31m", "demo_\u202eb"])
@pytest.mark.parametrize("command", ["import", "smoothness", "classify"])
def test_episodes_cannot_be_named_by_control_characters(tmp_path, command, name):
    time = np.arange(1000) / 100
    with h5py.File(tmp_path / "log.hdf5", "w") as file:
        for each in ("demo_0", name):
            file[f"data/{each}/obs/joint_vel"] = np.sin(time)[:, None]
            file[f"data/{each}/obs/joint_pos"] = -np.cos(time)[:, None]
    output = ("-o", tmp_path / "out") if command == "import" else ()
    status, out, err = call(command, tmp_path / "log.hdf5", "--rate", 100, *output)
    assert (status, not (tmp_path / "out").exists()) == (3, True)
    assert "an episode is called demo_\\" in out + err
    assert not set(out + err) & set("\x1b\u202e")
    assert not any(line.startswith("::error::") for line in (out + err).splitlines())


@pytest.mark.parametrize("start", ["=", "+", "-", "@"])
def test_a_table_has_no_cell_that_a_spreadsheet_would_compute(tmp_path, monkeypatch, start):
    monkeypatch.chdir(tmp_path)
    time = np.arange(2000) / 1000
    name = f"{start}HYPERLINK(1)"
    block = Block(0.5, 1.0, name)
    run = Run(time=time, velocity=np.sin(time)[:, None], joint_names=("a",), blocks=(block,))
    run.save("run.npz")
    assert call("export", "run.npz", "-o", "run.csv")[0] == 0
    assert call("export", "run.npz", "--labels", "annotated", "-o", "labels.csv")[0] == 0
    assert call("export", "run.npz", "--annotate", "labels.csv", "-o", "back.npz")[0] == 0
    for text in (Path("run.csv").read_text(), Path("labels.csv").read_text()):
        cells = {cell.strip('"') for line in text.splitlines() for cell in line.split(",")}
        assert {each for each in cells if name in each} == {f"'{name}"}
    assert Run.load("back.npz").blocks == (block,)


@given(st.text())
@settings(max_examples=200, derandomize=True, deadline=None)
def test_a_cell_is_no_formula_and_gives_its_text_back(given_text):
    assert not cell(given_text).startswith(("=", "+", "-", "@"))
    assert uncell(cell(given_text)) == given_text
