"""What the benchmark against other classifiers chooses, counts and prints."""

import sys
from pathlib import Path

import numpy as np
import pytest

import noiseclassifier as nc
from noiseclassifier.scenarios.sample import Sample
from noiseclassifier.scenarios.signals import WHOLE
from noisemodel import Block

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def rockets():
    """The benchmark as a module; that it limits threads is for its own process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT)
        for library in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
            patch.setenv(f"{library}_NUM_THREADS", "1")
        from benchmarks import rockets

        yield rockets


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Samples of two robots, two seconds of each class; every run but one has a copy."""
    folder, time = tmp_path_factory.mktemp("data"), np.arange(80_000) / 10_000.0
    for robot in ("panda", "talos"):
        (folder / robot).mkdir()
        for seed in range(6):
            random = np.random.default_rng([len(robot), seed])
            part = (time // 2.0).astype(int)
            loud = [0.0 * time, 5.0 * (time % 0.4 < 0.02), time % 0.2, np.sin(600.0 * time)]
            noise = 2.0 + 0.01 * random.normal(size=time.shape) + np.choose(part, loud)
            signals = {name: np.abs(noise).astype(np.float32) for name in WHOLE}
            for scenario in ("straight", "curve"):
                meta = {"scenario": scenario, "seed": seed, "duration": 8.0}
                Sample(
                    robot=robot,
                    rate=10_000.0,
                    signals=signals,
                    decimated={name: signal[::10] for name, signal in signals.items()},
                    blocks=tuple(
                        Block(2.0 * at, 2.0 * at + 2.0, label)
                        for at, label in enumerate(nc.CLASSES)
                    ),
                    meta={**meta, "sha256": f"{robot}-{seed}"},
                ).save(folder / robot / f"{scenario}-{seed:03d}.npz")
    return folder


def scored(count=100):
    """As many good frames as failures, all of one run."""
    labels = np.repeat(["ok", "impact"], count)
    runs = np.repeat("talos/straight-000", 2 * count)
    return nc.Dataset(np.zeros((2 * count, 400)), labels, runs, {})


def test_both_sides_have_every_robot_and_nothing_that_is_held_out(rockets, data):
    sides = [
        {nc.group_of(f"{path.parent.name}/{path.stem}") for path in side}
        for side in rockets.files(data, 4)
    ]
    assert not sides[0] & sides[1]
    assert not any(nc.held_out(group) for group in sides[0] | sides[1])
    for side in sides:
        assert sorted(group.partition("-")[0] for group in side) == ["panda"] * 2 + ["talos"] * 2


def test_a_run_that_equals_another_counts_once(rockets, data):
    paths = sorted(data.rglob("*-001.npz"))
    profile = nc.GENERAL.at(1000.0)
    cut = rockets.framed(paths, profile, training=False)
    assert len(paths) == 4
    assert sorted(set(cut.runs.tolist())) == ["panda/curve-001", "talos/curve-001"]


def test_scores_that_rank_perfectly_find_all_without_a_false_alarm(rockets):
    assert rockets.found(scored(), np.arange(200.0), 0.001).startswith("100.0%")


def test_scores_that_are_all_the_same_find_nothing(rockets):
    assert rockets.found(scored(), np.ones(200), 0.5).startswith("0.0%")


def test_no_more_good_frames_than_the_share_lie_above_the_threshold(rockets):
    scores = np.concatenate([np.arange(100.0), np.full(50, 97.5), np.full(50, 98.5)])
    assert rockets.found(scored(), scores, 0.01).startswith("50.0%")  # one good frame above
    assert rockets.found(scored(), scores, 0.02).startswith("100.0%")  # two


def test_ours_and_a_classifier_of_scikit_learn_get_a_row_for_each_noise(
    rockets, data, monkeypatch, capsys
):
    for name, rows in (("our", 2), ("logistic", 2)):
        given = [data, "--seeds", 4, "--every", 4, "--only", name]
        monkeypatch.setattr(sys, "argv", ["", *map(str, given)])
        rockets.main()
        out = capsys.readouterr().out
        table = [line for line in out.splitlines() if line.startswith("| ")][1:]
        assert len(table) == rows
        assert all(line.count("|") == len(rockets.HEAD) + 1 for line in table)
        assert "measured: 4 runs, panda-" in out


def test_missing_packages_are_named_before_anything_is_read(rockets, monkeypatch):
    monkeypatch.setattr(rockets, "find_spec", lambda name: None)
    monkeypatch.setattr(sys, "argv", ["", "no such folder"])
    with pytest.raises(SystemExit, match="pip install aeon torch"):
        rockets.main()


def test_an_unknown_contender_is_refused_with_the_known_ones(rockets, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["", "no such folder", "--only", "perceptron"])
    with pytest.raises(SystemExit, match="no classifier 'perceptron'; there are our trees"):
        rockets.main()
