import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commandline import call, printed, refused

from inspector import training
from noiseclassifier.recording import group_of
from noisemodel import Run


def run(path, seed, *, label="oscillations"):
    time = np.arange(20_000) / 10_000
    signal = 1 + 0.01 * np.random.default_rng(seed).normal(size=20_000)
    signal[10_000:] += 0.3 * np.sin(2 * np.pi * 200 * time[10_000:])
    blocks = {"block_start": [0.0, 1.0], "block_stop": [1.0, 2.0], "block_label": ["ok", label]}
    np.savez(path, time=time, velocity=signal[:, None], **blocks)
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A model, two runs that it was trained on, and six others."""
    path = tmp_path_factory.mktemp("evaluate")
    known = [run(path / f"known{seed}.npz", seed) for seed in range(2)]
    (path / "test").mkdir()
    for seed in range(2, 8):
        run(path / "test" / f"run{seed}.npz", seed)
    assert (
        call("train", *known, "-o", path / "model.npz", "--rate", 1000, "--profile", "logbands")[0]
        == 0
    )
    return path


def test_the_measures_of_a_model_are_printed(folder):
    command = "evaluate", folder / "model.npz", folder / "test"
    out = printed(*command)
    assert "6 runs in 6 groups" in out
    assert "Faults found, of all injected         100.0%" in out
    assert "False alarms per hour of ok time      0 [0, " in out
    assert "As the paper measures\nFalse negative errors" in out
    status, out, _ = call(*command, "--json")
    report = json.loads(out)
    assert (status, report["model"], report["runs"]) == (0, "model.npz", 6)
    assert np.array(report["frames"]["confusion"]).sum() == 6 * 2 * 7


def test_a_piece_of_a_run_has_no_fault_that_comes_after_it(folder, tmp_path):
    whole = Run.load(folder / "test" / "run3.npz")
    events = [{"label": "oscillations", "start": t, "stop": t + 1.0} for t in (1.0, 2.5)]
    replace(whole, meta={"events": events}).save(tmp_path / "piece.npz")
    out = call("evaluate", folder / "model.npz", tmp_path / "piece.npz")[1]
    assert "1 injected fault (1 detectable)" in out


def test_runs_that_it_was_trained_on_are_refused_in_one_line(folder):
    calls = folder / "model.npz", folder / "test", folder / "known1.npz"
    err = refused("evaluate", *calls)
    assert "known1: the model was trained on the same recording as 'known1'" in err
    assert "(--seen-too)" in err
    out = printed("evaluate", *calls, "--seen-too")
    assert "NOT A TEST: 1 of these runs were trained on" in out
    out = printed("evaluate", *calls, "--seen-too", "--json")
    assert list(json.loads(out)["seen"]) == ["known1"]


def simulated(path, seed, *, robot=None, rate=10_000, **meta):
    """A run that swings from 1 s on, with what is known of it."""
    run(path, seed)
    with np.load(path) as archive:
        arrays = dict(archive)
    step = 10_000 // rate
    arrays |= {name: arrays[name][::step] for name in ("time", "velocity")}
    named = {"robot": robot} if robot else {}
    np.savez(path, **arrays, **named, meta=json.dumps(meta))
    return path


def test_runs_of_several_domains_have_a_row_each_with_all_their_injected_faults(folder, tmp_path):
    events = [
        {"label": "oscillations", "start": 1.0, "stop": 1.9, "labelled": 1.0},
        {"label": "oscillations", "start": 0.1, "stop": 0.3, "labelled": 0.0},
    ]
    known = {"scenario": "swing", "events": events}
    simulated(tmp_path / "a.npz", 20, robot="panda", domain={"name": "soft"}, **known)
    simulated(tmp_path / "b.npz", 21, robot="ur5", simulator="drake", **known)
    simulated(tmp_path / "c.npz", 22, robot="ur5", source="field")
    found = json.loads(printed("evaluate", folder / "model.npz", tmp_path, "--json"))["protocol"]
    assert list(found["by_domain"]) == ["drake", "field", "soft"]
    assert list(found["by_robot"]) == ["panda", "ur5"]
    assert (found["counts"]["faults"], found["counts"]["felt"]) == (5, 3)
    assert found["robots_alike"]["recall_felt"]["value"] == 1.0
    assert found["robots_alike"]["recall_injected"]["value"] == pytest.approx((1 / 2 + 2 / 3) / 2)
    assert found["pooled"]["onset_within"]["value"] == 1.0
    out = printed("evaluate", folder / "model.npz", tmp_path, "--by", "domain")
    assert "of 2 robots (panda, ur5) in 3 domains (drake, field, soft)" in out
    assert "By domain" in out
    assert "By robot" not in out


def test_findings_are_those_that_classify_reports(folder, tmp_path):
    from inspector.analysis import analyse
    from inspector.library import load_library

    path = simulated(tmp_path / "fast.npz", 30, robot="panda")
    report = training.evaluate(folder / "model.npz", [path])
    (outcome,) = report.protocol.outcomes
    expected = analyse(path, load_library([folder / "model.npz"]))
    assert outcome.run.findings == expected.findings
    assert outcome.run.spans == expected.spans
    assert len(expected.findings) == 1


def test_the_first_motion_after_standing_is_no_false_alarm_of_a_file(tmp_path):
    """As for `classify`; the past alone would make it one, since it was silent."""
    from inspector.library import load_library, signals_of
    from noisemodel import Block, Run

    time, rng = np.arange(8000) / 1000, np.random.default_rng(0)
    noise = 0.8 * np.sin(3 * np.pi * time) + 0.05 * rng.standard_normal(8000)
    moving = np.clip((time - 1.5) / 0.05, 0, 1) * noise
    velocity = moving[:, None] + 1e-4 * rng.standard_normal((8000, 3))
    names, blocks = ("a", "b", "c"), (Block(0.0, 8.0, "ok"),)
    walk = Run(time=time, velocity=velocity, joint_names=names, blocks=blocks)
    walk.save(tmp_path / "walk.npz")
    signals = signals_of(walk)
    model = load_library()["general"].at(1000.0, signals)
    assert model.classify(signals, 1000.0).events()
    report = training.evaluate(Path(__file__).parents[1] / "models/general.npz", [tmp_path])
    assert report.protocol.counts["false_alarms"] == 0


def test_runs_below_the_rate_of_the_model_are_listed_as_not_answered(folder, tmp_path):
    slow = simulated(tmp_path / "slow.npz", 40, robot="a1", rate=200)
    both = "evaluate", folder / "model.npz", folder / "test", slow
    assert "not answered: 1 run (rate 200 Hz < 1000 Hz) of 1 robot (a1)" in printed(*both)
    (listed,) = json.loads(call(*both, "--json")[1])["protocol"]["unanswered"]
    assert (listed["run"], listed["robot"]) == ("slow", "a1")
    err = refused("evaluate", folder / "model.npz", slow)
    assert "none of 1 recordings has a verdict; slow: rate 200 Hz < 1000 Hz" in err


def test_runs_of_one_name_in_two_folders_are_told_apart(folder, tmp_path):
    for number, place in enumerate(("one", "two")):
        (tmp_path / place / "panda").mkdir(parents=True)
        simulated(tmp_path / place / "run.npz", 50 + number)
        simulated(tmp_path / place / "panda" / "soft-007.npz", 60 + number, robot="panda")
    inputs = tmp_path / "one", tmp_path / "two"
    report = training.evaluate(folder / "model.npz", inputs)
    names = [outcome.run.name for outcome in report.protocol.outcomes]
    assert names == ["panda/soft-007", "run", "panda/two/soft-007", "run (two)"]
    assert [group_of(name) for name in names] == ["panda-007", "run", "panda-007", "run (two)"]


def test_a_run_with_injected_faults_needs_no_blocks(folder, tmp_path):
    event = {"label": "oscillations", "start": 1.0, "stop": 2.0}
    path = simulated(tmp_path / "bare.npz", 80, events=[event])
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files if "block" not in name}
    np.savez(path, **arrays)
    report = training.evaluate(folder / "model.npz", [path, folder / "test"])
    first = report.protocol.outcomes[0]
    assert (first.found.tolist(), first.faults[0].felt) == ([True], False)
    assert first.counts["ok_hours"] == 0.0


def test_damaged_events_and_unknown_models_are_refused_in_one_line(folder, tmp_path):
    path = simulated(tmp_path / "odd.npz", 70, events=[{"label": "impact"}])
    err = refused("evaluate", folder / "model.npz", path)
    assert "odd.npz: an event of its meta lacks label, start or stop as numbers in s" in err
    err = refused("evaluate", "General", tmp_path)
    assert "General: no such model; name a file, or one that ships: general" in err
