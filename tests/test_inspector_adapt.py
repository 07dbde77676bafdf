"""`inspector adapt`: from good runs and a general model to a model of one robot."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from commandline import call

import noiseclassifier as nc
from inspector.library import for_robot, load_library
from inspector.training.recordings import of_run
from noiseclassifier.novelty.faults import LEVELS, fault
from noisemodel import Block, Run

RATE = 250.0
NAMES = ("shoulder", "elbow", "wrist")


def run_of(seed, *, noise=0.03, seconds=12.0, rate=RATE, robot=None, names=NAMES, desired=True):
    """Joints that swing, with noisy measurements."""
    generator = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate)) / rate
    wanted = np.sin(2 * np.pi * 0.5 * np.outer(time, [0.6, 0.8, 1.0]) + seed)
    velocity = wanted + noise * generator.normal(size=wanted.shape)
    given = wanted if desired else None
    return Run(time=time, velocity=velocity, velocity_desired=given, joint_names=names, robot=robot)


def faulty(seed, level=1.0, **how):
    """The same with a tone of 60 Hz in the elbow from 5 s to 6 s, annotated."""
    run = run_of(seed, **how)
    velocity = run.velocity.copy()
    velocity[:, 1] += level * fault(run.time, "tone", 60.0, seed, start=5.0)
    blocks = (Block(0.0, 4.5, "ok"), Block(5.0, 6.0, "oscillations"), Block(7.0, 12.0, "ok"))
    return replace(run, velocity=velocity, blocks=blocks)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A small general model, good runs of a noisier robot, and the model adapted to it."""
    folder = tmp_path_factory.mktemp("adapt")
    recordings = []
    for seed in range(9):
        run = faulty(seed, LEVELS[seed % 3], noise=0.005 * 2 ** (seed % 4))
        run.save(folder / "run.npz", overwrite=True)
        recordings.append(replace(of_run(folder / "run.npz", run, RATE), name=f"run{seed}"))
    recipe = replace(nc.ANY, rounds=20)
    frames = nc.Frames.joined(nc.frames_of(recordings, recipe))
    small = nc.General.train(frames, recipe)
    replace(small, versions={**small.versions, "mujoco": "4.0.0"}).save(folder / "small.npz")
    (folder / "good").mkdir()
    for seed in range(20, 26):
        blocks = (Block(0.0, 12.0, "ok"),) if seed == 25 else ()
        run = replace(run_of(seed), blocks=blocks, meta={"versions": {"mujoco": "4.1.0"}})
        run.save(folder / "good" / f"good{seed}.npz")
    status, out, err = call(
        "adapt", folder / "good", "-o", folder / "robot.npz", "--alarms", 5,
        "--model", folder / "small.npz",
    )  # fmt: skip
    assert (status, err) == (0, "")
    (folder / "out.txt").write_text(out)
    return folder


def test_it_says_what_it_learnt_from_what_that_can_show_and_what_it_finds(folder):
    out = (folder / "out.txt").read_text()
    assert "learnt from 0.02 h of good motion in 6 runs" in out
    assert "log odds of a failure, for 5 false alarms per hour" in out
    assert "can show no fewer than 150 alarms per hour: the limit is extrapolated" in out
    assert re.search(r"found of 36 faults put into this motion +no fault +0.1 rad/s", out)
    assert re.search(r"\n  small( +\d+){4}\n  adapted( +\d+){4}\n", out)
    assert "robot.npz: written, for 250 Hz and desired, measured, error, desired_joints" in out


def test_an_adapted_model_names_the_simulators_of_the_general_one_and_its_own(folder):
    assert nc.load(folder / "robot.npz").versions["mujoco"] == "4.0.0, 4.1.0"


def test_classify_finds_failures_of_the_robot_by_the_adapted_model_and_names_them(folder, tmp_path):
    faulty(30, 3.0).save(tmp_path / "bad.npz")
    run_of(31).save(tmp_path / "fine.npz")
    runs = [tmp_path / "bad.npz", tmp_path / "fine.npz"]
    status, out, _ = call("classify", *runs, "--model", folder / "robot.npz", "--format", "json")
    bad, fine = json.loads(out)["runs"]
    assert status == 1
    event = max(bad["events"], key=lambda event: event["stop"] - event["start"])
    assert event["label"] == "oscillations"
    assert event["start"] == pytest.approx(5.0, abs=0.25)
    assert event["stop"] == pytest.approx(6.0, abs=0.25)
    assert (fine["status"], fine["model"]) == ("ok", "robot")


def test_evaluate_takes_it_and_refuses_the_good_runs_that_it_learnt_from(folder, tmp_path):
    faulty(30, 3.0).save(tmp_path / "bad.npz")
    status, out, _ = call("evaluate", folder / "robot.npz", tmp_path / "bad.npz", "--json")
    assert status == 0
    assert json.loads(out)["events"]["all_found"]["value"] == 1.0
    status, _, err = call("evaluate", folder / "robot.npz", folder / "good" / "good25.npz")
    assert status == 3
    assert "good25: the model was trained on" in err


def test_an_adapted_model_is_for_robots_that_no_general_model_learnt_from(folder):
    library = load_library([folder / "robot.npz"])
    other = replace(library["robot"], runs={"ur5/straight-001": ""})
    assert for_robot({"robot": other}, "panda").keys() == {"robot"}


def test_runs_without_desired_motion_are_taken(folder, tmp_path):
    for seed in range(2):
        replace(run_of(seed, seconds=20.0), velocity_desired=None).save(tmp_path / f"{seed}.npz")
    status, out, err = call(
        "adapt", tmp_path, "-o", folder / "measured.npz", "--model", folder / "small.npz"
    )
    assert (status, err) == (0, "")
    assert "for 250 Hz and measured, measured_joints;" in out


def test_only_blocks_annotated_ok_are_learnt_from(folder, tmp_path):
    for seed in range(4):
        faulty(seed).save(tmp_path / f"{seed}.npz")
    arguments = "adapt", tmp_path, "--model", folder / "small.npz", "-o", folder / "some.npz"
    status, out, _ = call(*arguments)
    assert status == 0
    assert "of 4 runs with annotations, the part annotated `ok` alone" in out


def test_good_runs_of_one_nominal_rate_adapt_a_model_together(folder, tmp_path):
    run_of(30, rate=249.0, seconds=20.0).save(tmp_path / "a.npz")
    run_of(31, rate=252.0, seconds=20.0).save(tmp_path / "b.npz")
    adapted = ("adapt", tmp_path, "-o", tmp_path / "robot.npz", "--model", folder / "small.npz")
    status, out, err = call(*adapted)
    assert (status, err) == (0, "")
    assert "good motion in 2 runs" in out
    status, out, _ = call("classify", tmp_path / "b.npz", "--model", tmp_path / "robot.npz")
    assert status in (0, 1)


@pytest.mark.parametrize(
    ("odd", "message"),
    [
        (
            run_of(1, rate=500.0),
            "recorded at 500 Hz, .*a.npz at 250 Hz; --rate 250 decimates the faster ones",
        ),
        (
            run_of(1, robot="leg"),
            "a run of leg, but .*a.npz of arm; an adapted model is of one robot",
        ),
        (
            run_of(1, names=("hip", "knee", "wrist")),
            r"has other joints than .*a.npz \(elbow, hip, knee\); an adapted model is of one robot",
        ),
        (
            run_of(1, desired=False),
            "b: no signal desired, error, .*; there is .*; a has it: give runs of the same signals",
        ),
    ],
)
def test_runs_of_different_robots_or_rates_are_refused(folder, tmp_path, odd, message):
    run_of(0, robot="arm").save(tmp_path / "a.npz")
    odd.save(tmp_path / "b.npz")
    output = tmp_path / "model.npz"
    status, out, err = call("adapt", tmp_path, "-o", output, "--model", folder / "small.npz")
    assert (status, out, err.count("\n")) == (3, "", 1)
    assert err.startswith("inspector: ")
    assert re.search(message, err), err
    assert not output.exists()


def test_bad_input_is_one_line(folder, tmp_path):
    good, output = folder / "good", tmp_path / "model.npz"
    run_of(1, seconds=29.0).save(tmp_path / "short.npz")
    run_of(1, rate=50.0).save(tmp_path / "slow.npz")
    replace(run_of(1), blocks=(Block(0.0, 12.0, "impact"),)).save(tmp_path / "failing.npz")
    for arguments, message in [
        ((tmp_path / "failing.npz",), "no good frame in 1 recordings"),
        (
            (tmp_path / "short.npz",),
            "29 s of good motion are too short to learn from, expected 30 s or more",
        ),
        ((good, "--rate", 500), "recorded at 250 Hz, the model needs 500 Hz"),
        ((tmp_path / "slow.npz",), "too low for any; log faster"),
        ((tmp_path / "nothing.npz",), "nothing.npz"),
    ]:
        status, out, err = call("adapt", *arguments, "-o", output, "--model", folder / "small.npz")
        assert (status, out, err.count("\n")) == (3, "", 1), (arguments, err)
        assert message in err
    status, _, err = call("adapt", good, "--alarms", 0, "-o", output)
    assert status == 2
    assert "Invalid value for '--alarms': 0 is not above 0: say, 1" in err
    status, _, err = call("adapt", good, "-o", output, "--model", folder / "robot.npz")
    assert status == 3
    assert "robot: of one rate, but only a general model can be adapted" in err
    assert "(inspector train --profile general)" in err
    status, _, err = call(
        "adapt", good, "-o", folder / "robot.npz", "--model", folder / "small.npz"
    )
    assert status == 3
    assert "exists" in err
