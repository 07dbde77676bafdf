"""What a command reads is never replaced by what it writes, whatever name the file has."""

import os
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from commandline import call
from generalmodel import run_at

from inspector.cli import MODULES
from inspector.library import model_files
from inspector.report.formats import as_json
from noisemodel import OutputError
from noisemodel.files import also_reading, reading, refuse_read, replacing

RUN = ("run.npz", "--model", "model.npz", "--robot", "arm.urdf")
LOG = ("log.csv", "--mapping", "map.toml", "--desired", "desired.csv")
OF_RUN, OF_LOG = ("run.npz", "model.npz", "arm.urdf"), ("log.csv", "map.toml", "desired.csv")
FOLDERS = ("good", "worse", "--model", "model.npz")
OF_FOLDERS = ("good/0.npz", "worse/0.npz", "model.npz")
# Commands, what they read, an output, and the files that it must not replace.
TABLE = [
    ("view", RUN, "-o {}.rrd", OF_RUN),
    ("view", RUN, "-o {}.html", OF_RUN),
    ("view", RUN, "-o {}.png", OF_RUN),
    ("noise", RUN[:1], "--csv {}", OF_RUN[:1]),
    ("noise", ("--compare", "run.npz"), "--csv {}", OF_RUN[:1]),
    ("listen", RUN[:1], "-o {}.wav", OF_RUN[:1]),
    ("live", ("--rate", "100", "--model", "model.npz"), "--save {}.rrd", ("model.npz",)),
    ("classify", RUN, "--write json={}", OF_RUN),
    ("classify", LOG, "--write json={}", OF_LOG),
    ("classify", ("good",), "--write json={}", ("good/0.npz", "good/1.npz")),
    ("classify", RUN, "--resume {}", OF_RUN),
    ("diff", FOLDERS, "--write json={}", OF_FOLDERS),
    ("merge", ("result.json",), "--write json={}", ("result.json",)),
    ("import", LOG, "-o {}.npz", OF_LOG),
    ("import", (*LOG, "-o", "new.npz"), "--save-mapping {}", OF_LOG),
    ("export", RUN, "-o {}.csv", OF_RUN),
    ("export", (*RUN[:1], "--annotate", "labels.txt"), "-o {}.npz", ("run.npz", "labels.txt")),
    ("train", ("run.npz",), "-o {}.npz", ("run.npz",)),
    ("tune", ("good", "--validation", "run.npz"), "-o {}", ("run.npz",)),
    ("tune", ("good", "--validation", "run.npz", "-o", "new"), "--train {}.npz", ("run.npz",)),
]
# Commands that write nothing, or read nothing, or are tested elsewhere.
WITHOUT = {"robots", "audit", "simulate", "smoothness", "help", "accept", "evaluate", "history"}
STATES = ("--resume {}", "-o {}")  # outputs that a command goes on with, where they are its own
CASES = [(command, read, output, each) for command, read, output, files in TABLE for each in files]


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("good", "worse"):
        (tmp_path / name).mkdir()
        for seed in range(2):
            run_at(125.0, seed=seed).save(tmp_path / name / f"{seed}.npz")
    run_at(125.0).save(tmp_path / "run.npz")
    shutil.copy(model_files()[0], tmp_path / "model.npz")
    time = np.arange(400) / 100
    for name in ("log.csv", "desired.csv"):
        rows = "".join(f"{each:g},{np.sin(each):g}\n" for each in time)
        (tmp_path / name).write_text(f"time,a.velocity\n{rows}")
    (tmp_path / "map.toml").write_text('format = "noise-mapping/1"\n')
    (tmp_path / "result.json").write_text(as_json([]))
    (tmp_path / "labels.txt").write_text("0.5\t1.5\timpact\n")
    (tmp_path / "arm.urdf").write_text('<robot name="arm"><link name="base"/></robot>')
    return tmp_path


@pytest.mark.parametrize(("command", "read", "output", "name"), CASES)
def test_an_output_never_replaces_a_file_that_is_read(
    place, monkeypatch, command, read, output, name
):
    before = (place / name).read_bytes()
    option, _, link = output.partition(" ")
    target = link.partition("=")[2] or link
    os.link(place / name, place / target.format("linked"))
    monkeypatch.setattr(sys.stdin, "isatty", lambda: False)
    status, _, err = call(command, *read, option, link.format("linked"), "--overwrite")
    assert status in (3, 5)  # 5: those of a folder are listed after the work is begun
    assert (place / name).read_bytes() == before
    assert f"{target.format('linked')}: is read, too; choose another name" in err


@pytest.mark.parametrize(
    ("command", "read", "output"), [row[:3] for row in TABLE if row[2] not in STATES]
)
def test_an_output_that_exists_is_kept(place, monkeypatch, command, read, output):
    option, _, link = output.partition(" ")
    target = (link.partition("=")[2] or link).format("there")
    (place / target).write_text("precious")
    with (place / "log.csv").open() as rows:
        monkeypatch.setattr(sys, "stdin", rows)
        status, _, err = call(command, *read, option, link.format("there"))
    assert (status, (place / target).read_text()) == (3, "precious")
    assert f"{target}: exists already" in err


def test_accepting_keeps_runs_in_the_folder_of_the_reference(place):
    good = place / "good"
    for name in ("pick-1", "pick-2", "pick"):
        shutil.copy(good / "0.npz", good / f"{name}.npz")
    before = {each: each.read_bytes() for each in good.iterdir()}
    for name, status in (("run.npz", 0), ("good/0.npz", 3), ("good/pick-1.npz", 3)):
        assert call("accept", name, "--reason", "quiet", "-o", "good")[0] == status
        assert before == {each: each.read_bytes() for each in before}
    assert {each.name for each in set(good.iterdir()) - set(before)} == {
        "reference.toml",
        "run.npz",
    }


def test_each_command_that_reads_and_writes_is_in_the_table():
    assert {command for command, *_ in TABLE} == set(MODULES) - WITHOUT


def test_a_file_that_is_read_is_known_by_links_and_in_folders_that_are_logs(tmp_path):
    run, bag = tmp_path / "run.npz", tmp_path / "bag"
    bag.mkdir()
    for each in (run, bag / "bag.db3", tmp_path / "other"):
        each.touch()
    (tmp_path / "link").symlink_to(run)
    also_reading([run])  # outside of a command: a program may replace what it read
    with replacing(run, overwrite=True) as temporary:
        temporary.touch()
    with reading([run]):
        also_reading([bag])
        for each in (run, tmp_path / "link", bag / "bag.db3"):
            with pytest.raises(OutputError, match="is read, too"):
                refuse_read(each)
            with (
                pytest.raises(OutputError, match="is read, too"),
                replacing(each, overwrite=True) as temporary,
            ):
                temporary.touch()
        for each in (tmp_path / "other", tmp_path / "new", Path("/dev/null")):
            refuse_read(each)
    refuse_read(run)
