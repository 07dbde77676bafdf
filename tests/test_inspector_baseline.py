"""`inspector baseline`: from good runs to a model that finds anomalies against them."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from commandline import call

import noiseclassifier as nc
from inspector.errors import InspectorError
from inspector.library import label_run, load_library
from inspector.training.baseline import train
from noisemodel import Block, Run

RATE = 1000.0
NAMES = ("shoulder", "elbow", "wrist")


def run_of(seed, *, rattle=0.0, seconds=6.0, rate=RATE, robot=None, names=NAMES, desired=True):
    """Joints that swing; a rattle of 120 Hz from 3 s to 4 s in the elbow."""
    generator = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate)) / rate
    wanted = np.sin(2 * np.pi * 0.5 * np.outer(time, [0.6, 0.8, 1.0]) + seed)
    velocity = wanted + 0.01 * generator.normal(size=wanted.shape)
    shaken = (time >= 3.0) & (time < 4.0)
    velocity[shaken, 1] += rattle * np.sin(2 * np.pi * 120 * time[shaken])
    given = wanted if desired else None
    return Run(time=time, velocity=velocity, velocity_desired=given, joint_names=names, robot=robot)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three good runs, a baseline of them, and a run that rattles."""
    folder = tmp_path_factory.mktemp("baseline")
    for seed in range(3):
        made_by = {"versions": {"mujoco": f"4.0.{seed}"}}
        replace(run_of(seed), meta=made_by).save(folder / f"good{seed}.npz")
    blocks = (Block(0.0, 2.5, "ok"), Block(3.0, 4.0, "oscillations"), Block(4.5, 6.0, "ok"))
    (folder / "test").mkdir()
    replace(run_of(7, rattle=0.5), blocks=blocks).save(folder / "test" / "bad.npz")
    run_of(8).save(folder / "test" / "fine.npz")
    goods = [folder / f"good{seed}.npz" for seed in range(3)]
    status, out, err = call("baseline", *goods, "-o", folder / "robot.npz", "--alarms", 5)
    assert (status, err) == (0, "")
    assert "learnt from 0.005 h of good motion in 3 runs" in out
    assert "for 5 false alarms per hour" in out
    assert "can show no fewer than 600 alarms per hour: the limit is extrapolated" in out
    return folder


def test_an_anomaly_against_good_runs_is_a_finding(folder):
    tested = [folder / "test" / "bad.npz", folder / "test" / "fine.npz"]
    status, out, _ = call("classify", *tested, "--model", folder / "robot.npz", "--format", "json")
    bad, fine = json.loads(out)["runs"]
    assert status == 1
    (event,) = bad["events"]
    assert event["label"] == "anomaly"
    assert event["start"] == pytest.approx(2.8, abs=0.25)
    assert event["stop"] == pytest.approx(4.2, abs=0.25)
    assert (fine["status"], fine["model"]) == ("ok", "robot")


def test_a_baseline_names_the_simulators_of_its_runs(folder):
    assert nc.load(folder / "robot.npz").versions["mujoco"] == "4.0.0, 4.0.1, 4.0.2"


def test_findings_go_into_label_files(folder, tmp_path):
    call(
        "classify", folder / "test" / "bad.npz", "--model", folder / "robot.npz",
        "--labels-to", tmp_path, "--labels-format", "csv",
    )  # fmt: skip
    (written,) = tmp_path.iterdir()
    assert "anomaly" in written.read_text()


def test_a_baseline_is_measured_by_failures_of_any_name(folder):
    status, out, _ = call("evaluate", folder / "robot.npz", folder / "test" / "bad.npz", "--json")
    measured = json.loads(out)
    assert status == 0
    assert measured["events"]["all_found"]["value"] == 1.0
    assert measured["events"]["false_alarms"] == 0
    assert measured["classes"] == ["ok", "anomaly"]


def test_only_blocks_annotated_ok_are_trained_on(folder, tmp_path):
    inputs = [folder / "good0.npz", folder / "test" / "bad.npz"]
    trained = train(inputs, tmp_path / "model.npz")
    assert "of 1 run with annotations, the part annotated `ok` alone" in str(trained)
    assert trained.limit.hours * 3600 == pytest.approx(6.0 + 2.5 + 1.5, abs=0.2)


def test_runs_without_desired_motion_have_the_scalar_profile(tmp_path):
    for seed in range(2):
        run_of(seed, desired=False).save(tmp_path / f"run{seed}.npz")
    trained = train([tmp_path], tmp_path / "model.npz")
    assert trained.classifier.profile.signals == (nc.NOISE,)


def test_a_placeholder_of_the_desired_motion_is_left_out_as_classify_does(tmp_path):
    for seed in range(3):
        run = run_of(seed)
        placeholder = replace(run, velocity_desired=np.zeros_like(run.velocity))
        placeholder.save(tmp_path / f"run{seed}.npz")
    trained = train([tmp_path / "run0.npz", tmp_path / "run1.npz"], tmp_path / "model.npz")
    assert trained.classifier.profile.signals == (nc.NOISE,)
    status, _, _ = call("classify", tmp_path / "run2.npz", "--model", tmp_path / "model.npz")
    assert status in (0, 1)


def test_faster_runs_are_decimated_to_a_given_rate(tmp_path):
    run_of(0).save(tmp_path / "slow.npz")
    run_of(1, rate=2000.0).save(tmp_path / "fast.npz")
    trained = train([tmp_path], tmp_path / "model.npz", rate=1000.0)
    assert (trained.classifier.rate, trained.runs) == (1000.0, 2)


def test_runs_of_one_nominal_rate_are_learnt_together_and_labelled_at_their_own(tmp_path):
    run_of(0, rate=90.9).save(tmp_path / "a.npz")
    run_of(1, rate=91.4).save(tmp_path / "b.npz")
    for first, second in (("a.npz", "b.npz"), ("b.npz", "a.npz")):
        trained = train([tmp_path / first, tmp_path / second], tmp_path / f"of-{first}")
        assert trained.runs == 2
        library = load_library([tmp_path / f"of-{first}"])
        for name, rate in (("a.npz", 90.9), ("b.npz", 91.4)):
            labelled = label_run(Run.load(tmp_path / name), library)
            length = labelled.labels.stop[0] - labelled.labels.start[0]
            assert length * rate == pytest.approx(round(length * rate))
            assert "decimated" not in labelled.remark
    run_of(2, rate=93.5).save(tmp_path / "c.npz")
    with pytest.raises(InspectorError, match=r"c.npz: recorded at 93.5 Hz, .* --rate 90.9"):
        train([tmp_path / "a.npz", tmp_path / "c.npz"], tmp_path / "none.npz")


@pytest.mark.parametrize(
    ("odd", "message"),
    [
        (
            run_of(1, rate=2000.0),
            "recorded at 2000 Hz, .*a.npz at 1000 Hz; --rate 1000 decimates the faster ones",
        ),
        (run_of(1, robot="leg"), "a run of leg, but .*a.npz of arm; a baseline is of one robot"),
        (
            run_of(1, names=("hip", "knee", "wrist")),
            r"has other joints than .*a.npz \(elbow, hip, knee\); a baseline is of one robot",
        ),
        (
            run_of(1, desired=False),
            "b: no signal desired, error; there is .*; --profile scalar takes the noise alone",
        ),
    ],
)
def test_runs_of_different_robots_or_rates_are_refused(tmp_path, odd, message):
    run_of(0, robot="arm").save(tmp_path / "a.npz")
    odd.save(tmp_path / "b.npz")
    status, out, err = call("baseline", tmp_path, "-o", tmp_path / "model.npz")
    assert (status, out) == (3, "")
    assert err.startswith("inspector: ")
    assert err.count("\n") == 1
    assert re.search(message, err), err
    assert not (tmp_path / "model.npz").exists()


def test_bad_input_is_one_line(folder, tmp_path):
    good, output = folder / "good0.npz", tmp_path / "model.npz"
    failing = tmp_path / "failing.npz"
    replace(run_of(1), blocks=(Block(0.0, 6.0, "impact"),)).save(failing)
    run_of(2, seconds=3.0).save(tmp_path / "short.npz")
    for arguments, message in [
        ((failing,), "no good frame in 1 recordings"),
        ((tmp_path / "short.npz",), "3 s of good motion are too short to learn from"),
        ((good, "--rate", 2000), "recorded at 1000 Hz, the model needs 2000 Hz"),
        ((good, "--part", "training"), "no run in "),  # its name is held out
        ((good, good), "two recordings are called 'good0'; name them apart"),
        ((tmp_path / "nothing.npz",), "nothing.npz"),
    ]:
        status, out, err = call("baseline", *arguments, "-o", output)
        assert (status, out, err.count("\n")) == (3, "", 1), (arguments, err)
        assert message in err
    for option, value, message in [
        ("--alarms", 0, "0 is not above 0: say, 1"),
        ("--alarms", "nan", "nan is not above 0"),
        ("--profile", "paper-rbf", "a baseline has no profile 'paper-rbf'"),
    ]:
        status, out, err = call("baseline", good, option, value, "-o", output)
        assert (status, out) == (2, "")
        assert message in err
    status, _, err = call("baseline", good, "-o", folder / "robot.npz")
    assert status == 3
    assert "exists" in err
