"""The tables of the benchmarks."""

import importlib
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from noiseclassifier.scenarios.robots import ROBOTS, limbs
from noisemodel import Block, Run

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


def run(robot, scenario, seed):
    """A run of good motion, and of obvious failures."""
    random = np.random.default_rng([seed, len(scenario), len(robot)])
    time = np.arange(40_000) / RATE
    part = (time // 1.0).astype(int)
    loud = {1: 5.0 * (time % 0.4 < 0.02), 2: time % 0.2, 3: np.sin(1900.0 * time)}
    failure = np.select([part == label for label in loud], list(loud.values()))
    joints = ROBOTS[robot].drives.joints
    speed = 2.0 + 0.01 * random.normal(size=(len(time), len(joints))) + failure[:, None]
    return Run(
        time=time,
        joint_names=joints,
        velocity=speed.astype(np.float32),
        velocity_desired=np.zeros((len(time), len(joints)), dtype=np.float32),
        robot=robot,
        blocks=tuple(Block(float(t), t + 1.0, label) for t, label in enumerate(CLASSES)),
        meta={"scenario": scenario, "seed": seed, "duration": 4.0},
    )


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Runs of three robots and ten seeds, some of which are held out."""
    folder = tmp_path_factory.mktemp("data")
    for robot in ("go2", "panda", "talos"):
        (folder / robot).mkdir()
        for seed in range(10):
            run(robot, "straight", seed).save(folder / robot / f"straight-{seed:03d}.npz")
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
    whole = Run.load(path)
    mine = [
        whole.joint_names.index(j) for foot in ("FL_foot", "RR_foot") for j in limbs("go2")[foot]
    ]
    wanted = np.linalg.norm(whole.velocity[:, mine], axis=1)
    np.testing.assert_allclose(recording.signal["error"], wanted, rtol=1e-5)
    assert recording.name == "go2/straight-000"


def test_profiles_are_trained_on_the_first_seeds_of_the_training_part(paper, data):
    known = paper.first_seeds(paper.files([data], "training"), 3)
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
    run("panda", "straight", 1000).save(good / "straight-1000.npz")
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


def test_a_model_of_other_runs_is_refused(paper, data, tmp_path):
    paths = paper.files([data], "training")
    paper.trained("paper-linear", paths[:2], tmp_path)
    with pytest.raises(SystemExit, match="trained on other runs; remove it"):
        paper.trained("paper-linear", paths[:3], tmp_path)


@pytest.mark.slow
def test_our_side_is_timed_without_the_original(lola, bench):
    found = bench("noisytest").race({"ours": sys.executable}, lola, 1)["ours"]
    assert found["train"][0]["answer"] == pytest.approx(0.8743, abs=1e-4)  # the original's, golden
    assert all(each["cpu"] > 0.0 for task in found.values() for each in task)


def test_a_python_without_the_original_is_refused(lola):
    command = [sys.executable, "-m", "benchmarks", "noisytest", "--noisytest", lola]
    done = subprocess.run(
        [*command, "--original", sys.executable], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 1
    assert "ended:" in done.stderr
    assert "No module named" in done.stderr


@pytest.fixture(scope="module")
def bench():
    """Imports a module of the benchmarks by name."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT)
        patch.setenv("OMP_NUM_THREADS", "1")
        patch.setenv("OPENBLAS_NUM_THREADS", "1")
        yield lambda name: importlib.import_module(f"benchmarks.{name}")


def test_a_row_has_both_medians_and_the_ratio_of_the_other_to_ours(bench):
    row = bench("table").Row("labels", 0.05, "real time", 10.0, wanted=100.0)
    assert str(row) == "| labels | real time | 50 ms | 10 s | 200 | ≥ 100 |"


@pytest.mark.parametrize(
    ("limits", "text"),
    [
        ({"other": 10.0, "wanted": 4.0}, "| 10 s | 5 | ≥ 4 |"),
        ({"other": 10.0, "wanted": 6.0}, "| 10 s | 5 | ≥ 6 (missed) |"),
        ({"most": 2.0}, "| – | – | ≤ 2 s |"),  # noqa: RUF001
        ({"most": 0.5}, "| – | – | ≤ 500 ms (missed) |"),  # noqa: RUF001
        ({"wanted": 6.0}, "| – | – | ≥ 6 |"),  # noqa: RUF001
    ],
)
def test_a_row_says_what_was_wanted_and_whether_it_was_missed(bench, limits, text):
    assert str(bench("table").Row("labels", 2.0, **limits)).endswith(f"2 s {text}")


def test_sides_take_turns_and_the_median_counts(bench):
    calls, times = [], {"ours": iter([9.0, 1.0, 5.0, 3.0]), "other": iter([9.0, 2.0, 2.0, 8.0])}

    def side(name):
        return lambda: calls.append(name) or next(times[name])

    found = bench("table").in_turns({name: side(name) for name in times}, 3, warm=1)
    assert calls == ["ours", "other"] * 4
    assert found == {"ours": 3.0, "other": 2.0}


def test_an_unknown_benchmark_is_refused_and_one_without_its_data_left_out(bench, monkeypatch):
    call = partial(subprocess.run, cwd=ROOT, capture_output=True, text=True)
    done = call([sys.executable, "-m", "benchmarks", "nothing"])
    assert done.returncode == 2
    assert "no benchmark nothing; there are twists, extended" in done.stderr
    table, noisytest = bench("table"), bench("noisytest")
    monkeypatch.setattr(noisytest, "standin", lambda _: None)
    with pytest.raises(table.LeftOutError, match="--noisytest FOLDER"):
        next(noisytest.rows(table.Given()))


def test_our_twists_are_those_of_the_loops_that_they_are_timed_with(bench):
    import noisemodel as nm

    twists, robot = bench("twists"), nm.Robot.load("talos")
    motion = twists.states(robot, 3)
    for loop in (twists.loop_by_twist, twists.loop_by_sample):
        np.testing.assert_allclose(loop(robot, *motion), nm.link_twists(robot, *motion), atol=1e-12)
