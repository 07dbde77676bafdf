"""Runs in the file format of NoisyTest are read as they were written."""

import csv
import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest

import noiseclassifier as nc
import noisemodel as nm
from noiseclassifier import scenarios
from noiseclassifier.scenarios import formats, noisytest
from noiseclassifier.scenarios.dataset import make
from noiseclassifier.scenarios.folder import Folder
from noiseclassifier.scenarios.tasks import DatasetSpec, choose
from noisemodel import Block, Run

META = {
    "scenario": "obstacle-toe",
    "seed": 3,
    "duration": 0.5,
    "defect": {'a "quoted" \\ ü': [1.5, None]},
}


@pytest.fixture
def run() -> Run:
    generator = np.random.default_rng(0)
    joints = scenarios.ROBOTS["panda"].drives.joints
    velocity, desired = generator.normal(size=(2, 5000, len(joints))).astype(np.float32)
    return Run(
        time=np.arange(5000) * 1e-4,
        joint_names=joints,
        velocity=velocity,
        velocity_desired=desired,
        robot="panda",
        blocks=(Block(0.0, 0.2, "ok"), Block(0.25, 0.3001, "impact"), Block(0.3001, 0.5, "ok")),
        meta=META,
    )


def test_a_run_is_read_as_it_was_written(run, tmp_path):
    noisytest.write(run, tmp_path / "panda.log")
    (read,) = nc.noisytest.read_folder(tmp_path, rate=noisytest.RATE)
    np.testing.assert_allclose(
        read.signal, nm.simplified(run.motion, run.velocity_desired), rtol=1e-8
    )
    assert read.rate == 10_000.0
    assert read.start == 0.0
    assert [tuple(block) for block in read.blocks] == [
        (block.start, block.stop, block.label) for block in run.blocks
    ]


def test_frames_of_a_folder_are_those_of_its_runs(run, tmp_path):
    noisytest.write(run, tmp_path / "panda.log")
    profile = nc.Profile.noisytest("rbf")
    read = nc.Dataset.read(tmp_path, profile)
    signal = nm.simplified(run.motion, run.velocity_desired)
    blocks = tuple(nc.Block(b.start, b.stop, b.label) for b in run.blocks)
    direct = nc.Dataset.of([nc.Recording("panda", signal, 10_000.0, blocks)], profile)
    assert read.labels.tolist() == direct.labels.tolist()
    np.testing.assert_allclose(read.frames, direct.frames, atol=2e-6)  # in single precision


def test_the_log_follows_the_rules_of_noisytests_reader(run, tmp_path):
    """It skips lines with # and one more, then takes one blank between two numbers."""
    noisytest.write(run, tmp_path / "panda.log")
    with (tmp_path / "panda.log").open(newline="") as file:
        rows = csv.reader(file, delimiter=" ")
        while str(next(rows)[0]).lstrip().startswith("#"):
            pass
        data = np.array(list(rows), np.float32)
    assert data.shape == (4999, 2)
    assert data[0, 0] == np.float32(1e-4)
    assert np.mean(np.diff(data[:, 0])) == pytest.approx(1e-4, rel=1e-3)


def test_times_of_blocks_are_all_floats(run, tmp_path):
    noisytest.write(replace(run, blocks=(Block(0, 0.5, "ok"),)), tmp_path / "panda.log")
    data = tomllib.loads((tmp_path / "panda.toml").read_text())["data"]
    assert all(type(time) is float for span in data["chunk_ranges"] for time in span)


def test_the_recipe_is_kept(run, tmp_path):
    noisytest.write(run, tmp_path / "panda.log")
    recipe = json.loads(
        tomllib.loads((tmp_path / "panda.toml").read_text())["simulation"]["recipe"]
    )
    assert recipe == {**META, "robot": "panda", "sha256": scenarios.sample.digest(run)}
    assert noisytest.read(tmp_path / "panda.log") == (run.blocks, 0.5)


def test_the_configuration_is_noisytests_profile(tmp_path):
    noisytest.write_config(tmp_path)
    profile = nc.noisytest.profile_from_config(tmp_path / "noisytest-config.json")
    wanted = nc.Profile.noisytest("rbf")
    for setting in ("classes", "rate", "length", "hop", "stride", "regularization", "gamma"):
        assert getattr(profile, setting) == getattr(wanted, setting)


def test_one_seed_of_four_is_for_validation(run, tmp_path, monkeypatch):
    def simulate(robot, scenario, seed, *, duration=None):
        return replace(run, meta={**META, "scenario": scenario, "seed": seed})

    monkeypatch.setattr(formats, "simulate", simulate)
    place = Folder.opened(tmp_path, format_name="noisytest")
    tasks = DatasetSpec(choice=choose(["panda"], ["1"]), seeds=8).tasks()
    assert len(list(make(place, tasks))) == 8
    assert list(make(place, tasks)) == []
    parts = {
        part: sorted(path.stem for path in (tmp_path / part).glob("*.log"))
        for part in ("training", "validation")
    }
    assert parts["validation"] == ["panda-straight-003", "panda-straight-007"]
    assert len(parts["training"]) == 6
    assert sorted(place.kept()) == tasks
    assert noisytest.missing_classes(tmp_path) == ("highaccelerations", "oscillations")


def test_another_rate_than_noisytests_is_refused(run, tmp_path):
    with pytest.raises(scenarios.SampleError, match="takes 10000 Hz only, the run has 5000 Hz"):
        noisytest.write(replace(run, time=run.time * 2), tmp_path / "panda.log")
    assert list(tmp_path.iterdir()) == []


def test_a_log_is_never_without_its_annotations(run, tmp_path, monkeypatch):
    monkeypatch.setattr(np, "savetxt", lambda *_, **__: (_ for _ in ()).throw(OSError(28, "full")))
    with pytest.raises(nm.OutputError, match=r"panda\.log: cannot be written \(full\)"):
        noisytest.write(run, tmp_path / "panda.log")
    assert [path.name for path in tmp_path.iterdir()] == ["panda.toml"]


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (None, r"panda\.log: lacks its panda\.toml"),
        ("[data", r"panda\.toml: damaged"),
        (
            "[data]\nchunk_ranges = []\nchunk_labels = []\n",
            r"panda\.toml: damaged \('simulation'\)",
        ),
        (
            '[data]\nchunk_ranges = [[1.0]]\nchunk_labels = ["ok"]\n[simulation]\nrecipe = "{}"',
            "dam",
        ),
    ],
)
def test_annotations_that_cannot_be_read_are_one_line(run, tmp_path, content, problem):
    noisytest.write(run, tmp_path / "panda.log")
    (tmp_path / "panda.toml").unlink()
    if content:
        (tmp_path / "panda.toml").write_text(content)
    with pytest.raises(scenarios.SampleError, match=problem):
        noisytest.read(tmp_path / "panda.log")
