"""The tables of the benchmarks."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import models
from noisemodel import Block
from scenarios.limbs import limbs
from scenarios.sample import Sample

ROOT = Path(__file__).parents[1]
RATE = 10_000.0
CLASSES = ("ok", "impact", "highaccelerations", "oscillations")


@pytest.fixture(scope="module")
def paper():
    """The benchmark as a module; that it limits threads is for its own process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT)
        patch.setenv("OMP_NUM_THREADS", "1")
        patch.setenv("OPENBLAS_NUM_THREADS", "1")
        from benchmarks import paper

        yield paper


def sample(robot, scenario, seed):
    """A sample of good motion, and of obvious failures."""
    random = np.random.default_rng([seed, len(scenario), len(robot)])
    time = np.arange(40_000) / RATE
    part = (time // 1.0).astype(int)
    loud = {1: 5.0 * (time % 0.4 < 0.02), 2: time % 0.2, 3: np.sin(1900.0 * time)}
    failure = np.select([part == label for label in loud], list(loud.values()))
    names = ["measured", "desired", "error"]
    signals = {
        name: np.abs(2.0 + 0.01 * random.normal(size=time.shape) + failure).astype(np.float32)
        for name in [*names, *(f"{name}_{limb}" for name in names for limb in limbs(robot))]
    }
    meta = {"scenario": scenario, "seed": seed, "duration": 4.0}
    return Sample(
        robot=robot,
        rate=RATE,
        signals=signals,
        decimated={name: signal[::10] for name, signal in signals.items()},
        blocks=tuple(Block(float(t), t + 1.0, label) for t, label in enumerate(CLASSES)),
        meta={**meta, "sha256": f"{robot}{scenario}{seed}"},
    )


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Samples of three robots and ten seeds, some of which are held out."""
    folder = tmp_path_factory.mktemp("data")
    for robot in ("go2", "panda", "talos"):
        (folder / robot).mkdir()
        for seed in range(10):
            sample(robot, "straight", seed).save(folder / robot / f"straight-{seed:03d}.npz")
    return folder


@pytest.mark.parametrize(
    ("title", "recall", "balanced"),
    [("linear", "82.3%", "66.8%"), ("RBF", "93.5%", "63.4%")],
)
def test_the_papers_shares_of_all_frames_become_recalls_of_failures(paper, title, recall, balanced):
    assert f"| {recall} | {balanced} |" in paper.printed(title)


def test_half_of_the_limbs_has_their_norm(paper, data):
    path = data / "go2" / "straight-000.npz"
    (recording,) = paper.halved([path], RATE)
    kept = Sample.load(path).signals
    both = np.hypot(kept["error_FL_foot"], kept["error_RR_foot"])
    np.testing.assert_allclose(recording.signal["error"], both, rtol=1e-6)
    assert recording.name == "go2/straight-000"


def test_profiles_are_trained_on_the_first_seeds_of_the_training_part(paper, data):
    known = paper.first_seeds(paper.files([data], paper.Part.TRAINING), 3)
    names = [paper.name_of(path) for path in known]
    assert names == [
        *("go2/straight-000", "go2/straight-001", "go2/straight-003"),
        *("panda/straight-001", "panda/straight-002", "panda/straight-003"),
        *("talos/straight-000", "talos/straight-001", "talos/straight-002"),
    ]


def test_the_three_tables_are_filled(paper, data, tmp_path, monkeypatch, capsys):
    profiles = ("paper-linear", "noisytest-rbf")
    good = tmp_path / "good" / "panda"
    good.mkdir(parents=True)
    sample("panda", "straight", 1000).save(good / "straight-1000.npz")
    given = ["--training", data, "--test", data, "--from", 5, "--good", tmp_path / "good"]
    given += ["--output", tmp_path, "--seeds", 2]
    monkeypatch.setattr(sys, "argv", ["", *map(str, given), "--models", "--profiles", *profiles])
    paper.main()
    out = capsys.readouterr().out
    assert out.count("### ") == 3
    assert (
        "| noisytest-rbf | 0.0 / 0.0 / 0.0 / 0.0 | 0.0 / 0.0 / 0.0 / 0.0 | 100.0% | 100.0%" in out
    )
    assert "| noisytest-rbf, half of the limbs |" in out
    assert "paper-linear, half" not in out
    assert "of 3 runs in 3 groups; false alarms" in out  # go2's seed 7, talos's 7 and 9
    assert "ok motion of 4 runs in 4 groups." in out
    assert "Runs trained on: paper-linear 6, noisytest-rbf 6." in out


def test_the_robot_that_is_left_out_is_measured_and_not_trained_on(
    paper, data, tmp_path, monkeypatch, capsys
):
    from benchmarks import unseen

    given = [data, "--output", tmp_path, "--profiles", "noisytest-rbf", "--seeds", 2]
    monkeypatch.setattr(sys, "argv", ["", *map(str, given), "--robots", "go2"])
    unseen.main()
    out = capsys.readouterr().out
    assert "| noisytest-rbf | go2 | 4 | 2, 2 | 96.4% | 100.0%" in out  # go2's seeds 2 and 7
    (model,) = tmp_path.glob("*.npz")
    learnt = models.Classifier.load(model).runs
    assert {models.group_of(run).rpartition("-")[0] for run in learnt} == {"panda", "talos"}


def test_a_model_of_other_runs_is_refused(paper, data, tmp_path):
    paths = paper.files([data], paper.Part.TRAINING)
    paper.trained("paper-linear", paths[:2], tmp_path)
    with pytest.raises(SystemExit, match="trained on other runs; remove it"):
        paper.trained("paper-linear", paths[:3], tmp_path)


@pytest.mark.slow
def test_our_side_is_timed_without_the_original(lola, tmp_path):
    report = tmp_path / "times.json"
    command = [sys.executable, ROOT / "benchmarks" / "noisytest.py", lola, "--repeats", "1"]
    done = subprocess.run([*command, "--json", report], capture_output=True, text=True, check=True)
    assert "NoisyTest was not timed: --original takes a Python that has it" in done.stdout
    found = json.loads(report.read_text())["ours"]
    assert found["train"][0]["answer"] == pytest.approx(0.8743, abs=1e-4)  # the original's, golden
    assert all(each["cpu"] > 0.0 for task in found.values() for each in task)


def test_a_python_without_the_original_is_refused(lola):
    command = [sys.executable, ROOT / "benchmarks" / "noisytest.py", lola]
    done = subprocess.run(
        [*command, "--original", sys.executable], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "ended:" in done.stderr
    assert "No module named" in done.stderr
