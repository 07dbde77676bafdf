import json
import os
import re
from dataclasses import replace

import numpy as np
import pytest
from commandline import call

from inspector.library import load_library
from inspector.logs.read import open_run
from inspector.regression import measure as measuring
from inspector.regression.difference import Verdict, difference
from inspector.regression.measure import Measured, measure_file
from inspector.regression.pairing import Pairing, PairingError, Scenario, files_in, paired
from inspector.regression.statistic import ALPHA
from noisemodel import Run, parallel
from noisemodel.limits import joint_limits

RATE, SECONDS = 1000.0, 4.0
JOINTS = ("elbow", "wrist")


def run(seed, *, tone=0.0, scenario="", joints=JOINTS, robot=None, rate=RATE, shift=0.0):
    """A slow motion with noise by the seed, and a tone at 80 Hz on the wrist from 1 s to 3 s."""
    random = np.random.default_rng(seed)
    time = np.arange(round(rate * SECONDS)) / rate
    slow = np.exp(-(((time - 1.5 - shift) / 0.4) ** 2)) + 0.5 * np.exp(-((time - 3.0 - shift) ** 2))
    level = 10 ** (random.normal(size=len(joints)) / 20)
    noise = 0.002 * level * random.normal(size=(len(time), len(joints)))
    velocity = slow[:, None] + noise
    inside = (time > 1.0) & (time < 3.0)
    velocity[:, -1] += tone * np.sin(2 * np.pi * 80 * time) * inside
    meta = {"scenario": scenario, "seed": seed} if scenario else {}
    return Run(time=time, velocity=velocity, joint_names=joints, robot=robot, meta=meta)


def folder(path, seeds, name="walk-{}", **changes):
    path.mkdir(exist_ok=True)
    for number, seed in enumerate(seeds):
        run(seed, **changes).save(path / f"{name.format(number)}.npz")
    return path


def diff(before, after, *more):
    return call("diff", before, after, *more)


@pytest.fixture(scope="module")
def library():
    return load_library()


@pytest.fixture(scope="module")
def sides(tmp_path_factory):
    """Five runs, five more of the same code, and five with a tone."""
    root = tmp_path_factory.mktemp("sides")
    folder(root / "reference", range(5))
    folder(root / "same", range(5, 10))
    folder(root / "worse", range(10, 15), tone=0.03)
    return root


def test_repetitions_with_a_tone_are_worse_in_its_joint_and_octave(sides):
    status, out, _ = diff(sides / "reference", sides / "worse", "--format", "json")
    found = json.loads(out)
    (row,) = found["scenarios"]
    assert status == 1
    assert found["format"] == "noise-diff/1"
    assert (found["verdict"], row["verdict"], row["name"]) == ("worse", "worse", "walk")
    top = row["changes"][0]
    assert (top["joint"], top["band_hz"]) == ("wrist", [45.255, 90.51])
    assert top["p_louder"] == pytest.approx(1 / 252, abs=1e-6)
    assert 0 < top["low"] < top["change"] < top["high"]


def test_a_deviation_of_one_joint_from_its_desired_motion_is_a_tracking_error(tmp_path, library):
    """What the motion itself masks, as the seeds differ in it, shows beside the desired motion."""

    def moved(seed, tone):
        time = np.arange(4000) / RATE
        random = np.random.default_rng(seed)
        desired = np.cos(2 * np.pi * 80 * time)[:, None] * 10 ** random.normal(size=2)
        noise = 0.002 * random.normal(size=desired.shape)
        error = np.stack((tone * np.sin(2 * np.pi * 70 * time), np.zeros(4000)), axis=1)
        brief = (time > 1.0) & (time < 1.2)
        velocity = desired + noise + error * brief[:, None]
        return Run(time=time, velocity=velocity, velocity_desired=desired, joint_names=JOINTS)

    for name, first, tone in (("before", 0, 0.0), ("after", 5, 0.1)):
        (tmp_path / name).mkdir()
        for number in range(5):
            moved(first + number, tone).save(tmp_path / name / f"walk-{number}.npz")
    status, out, _ = diff(tmp_path / "before", tmp_path / "after", "--format", "json")
    assert status == 1
    (walk,) = json.loads(out)["scenarios"]
    clear = [each for each in walk["changes"] if each["p_louder"] <= ALPHA]
    assert {each["kind"] for each in clear} == {"tracking error", "peak of tracking error"}
    assert walk["reason"].startswith("peak of tracking error, 45 to 91 Hz +")


def test_desired_velocities_that_one_side_lacks_are_remarked_on(tmp_path):
    for name, desired in (("before", np.zeros((4000, 2))), ("after", None)):
        (tmp_path / name).mkdir()
        replace(run(1), velocity_desired=desired).save(tmp_path / name / "walk.npz")
    _, out, _ = diff(tmp_path / "before", tmp_path / "after")
    lacking = tmp_path / "after" / "walk.npz"
    assert f"Tracking errors are not compared: {lacking} has no desired velocities." in out


def test_the_other_way_round_it_is_better(sides):
    status, out, _ = diff(sides / "worse", sides / "reference")
    assert status == 0
    assert out.startswith("better: 1 scenario (1 better), paired by file name")


def test_repetitions_of_the_same_code_are_not_worse(sides):
    status, out, _ = diff(sides / "reference", sides / "same")
    assert status == 0
    assert out.startswith("same: 1 scenario (1 same), paired by file name")


def test_a_folder_and_itself_are_the_same_whatever_the_number_of_runs(tmp_path):
    before = folder(tmp_path / "one", [1], scenario="walk")
    status, out, _ = diff(before, before)
    assert status == 0
    assert "same" in out.splitlines()[0]


def test_too_few_repetitions_are_inconclusive_and_say_how_many_it_takes(tmp_path):
    before = folder(tmp_path / "before", range(3))
    after = folder(tmp_path / "after", range(3, 6), tone=0.03)
    status, out, _ = diff(before, after)
    assert status == 4
    assert (
        "3 and 3 runs are too few for the verdict worse: it takes 5 runs of the candidate with 5 of"
        " the reference, or 10 with 3 of the reference\n"
    ) in out


def test_a_run_that_kills_its_worker_is_named_and_the_others_are_compared(sides, monkeypatch):
    def die_of_one(path):
        if path == sides / "same" / "walk-1.npz":
            os._exit(137)
        return open_run(path)

    monkeypatch.setattr(measuring, "open_run", die_of_one)
    monkeypatch.setattr(parallel, "_forks", lambda: True)
    monkeypatch.setattr(parallel, "FORKED", 0.0)
    given = sides / "reference", sides / "same", "-j", 2
    status, out, err = diff(*given, "--on-bad-input", "ignore")
    assert status == 70
    assert err.endswith(f"inspector: {sides}/same/walk-1.npz: {parallel.DIED}\n")
    assert err.count(parallel.DIED) == 1
    assert "1 scenario" in out.splitlines()[0]
    assert "files: 1 internal error" in out


def test_new_findings_fail_from_one_run_on_if_they_are_to(tmp_path):
    run(1).save(tmp_path / "before.npz")
    run(2, tone=0.5).save(tmp_path / "after.npz")
    status, out, _ = diff(tmp_path / "before.npz", tmp_path / "after.npz", "--fail-on", "new")
    assert status == 1
    assert "new: oscillations" in out
    shown = f"inspector view {tmp_path / 'before.npz'} {tmp_path / 'after.npz'}"
    assert out.endswith(f"The worst pair: {shown}\n")
    status, out, _ = diff(tmp_path / "after.npz", tmp_path / "before.npz", "--fail-on", "new")
    assert status == 0
    assert "resolved: oscillations" in out


def test_a_finding_that_a_repetition_of_the_reference_has_is_not_new(tmp_path):
    before = folder(tmp_path / "before", range(2))
    run(7, tone=0.5).save(before / "walk-7.npz")
    after = folder(tmp_path / "after", range(3, 5), tone=0.5, shift=0.0)
    status, out, _ = diff(before, after, "--fail-on", "new")
    assert "new: oscillations" not in out
    status, out, _ = diff(before, folder(tmp_path / "louder", [9], tone=2.0), "--fail-on", "new")
    assert status == 1
    assert "louder: oscillations" in out


def test_diff_and_view_say_how_they_match_findings_of_different_motions(tmp_path):
    """Of one motion, both match in time; of another, `diff` at any time."""
    first = run(7, tone=0.5)
    other = first.velocity + 2 * np.sin(2.5 * first.time)[:, None]
    first.save(tmp_path / "first.npz")
    run(8, tone=0.5).save(tmp_path / "alike.npz")
    replace(first, velocity=other).save(tmp_path / "other.npz")
    for name, said in (("alike", False), ("other", True)):
        pair = tmp_path / "first.npz", tmp_path / f"{name}.npz"
        compared = diff(*pair, "--no-robot")[1]
        viewed = call("view", *pair, "--no-robot", "--save", tmp_path / f"{name}.rrd")[1]
        assert ("Findings of different motions are matched by their class" in compared) == said
        assert ("Findings at the same time are matched; `inspector diff`" in viewed) == said


def test_runs_are_paired_by_scenario_and_seed_whatever_their_names(tmp_path):
    before = folder(tmp_path / "before", [4, 3], name="a{}", scenario="walk")
    after = folder(tmp_path / "after", [3, 4], name="b{}", scenario="walk")
    library = load_library()
    sides = [[measure_file(path, library) for path in files_in(p)] for p in (before, after)]
    found = paired(*sides, (before, after))
    (scenario,) = found.scenarios
    assert found.by == "scenario and seed"
    assert scenario.paired
    assert [each.seed for each in scenario.reference] == [3, 4]
    assert [each.seed for each in scenario.candidate] == [3, 4]


def test_one_file_is_compared_with_the_repetitions_of_its_name(sides):
    _, out, _ = diff(sides / "reference", sides / "worse" / "walk-3.npz")
    assert "walk      5 + 1  inconclusive" in out


def test_scenarios_of_one_side_are_named_and_left_out(sides, tmp_path):
    after = folder(tmp_path / "after", range(20, 25))
    run(3).save(after / "climb.npz")
    status, out, _ = diff(sides / "reference", after)
    assert status == 0
    assert f"only in the candidate: {after / 'climb.npz'}\n" in out


def test_findings_of_a_run_that_the_reference_lacks_are_new(tmp_path):
    less, more = (folder(tmp_path / name, [1]) for name in ("less", "more"))
    run(2, tone=0.5).save(more / "climb.npz")
    statuses = {on: diff(less, more, "--fail-on", on)[0] for on in ("new", "any", "worse")}
    assert statuses == {"new": 1, "any": 1, "worse": 0}
    out = diff(less, more)[1]
    assert f"only in the candidate: {more / 'climb.npz'}\n  new: " in out
    assert re.match("same: 1 scenario .*; findings: [1-9] new; files: 1 not paired\n", out)
    assert "The worst pair" not in out


def test_a_run_that_the_candidate_lacks_fails_at_any(tmp_path):
    less, more = (folder(tmp_path / name, [1]) for name in ("less", "more"))
    run(2).save(more / "climb.npz")
    statuses = {on: diff(more, less, "--fail-on", on)[0] for on in ("new", "any", "worse")}
    assert statuses == {"new": 0, "any": 1, "worse": 0}
    assert diff(less, more, "--fail-on", "any")[0] == 0  # more than before, without a finding
    assert f"only in the reference: {more / 'climb.npz'}\n" in diff(more, less)[1]


def test_of_many_runs_on_one_side_only_the_first_ten_are_printed(tmp_path):
    less, more = (folder(tmp_path / name, [1]) for name in ("less", "more"))
    for name in "abcdefghijkl":
        run(1).save(more / f"{name}.npz")
    out = diff(more, less)[1]
    assert out.count("only in the reference: ") == 10
    assert "\nand 2 more on one side only (--format json)\n" in out


def test_one_level_of_the_test_holds_for_all_scenarios(library, sides):
    """Three scenarios of the same five runs: a clear change in one is found, no other is."""
    runs = {
        name: [measure_file(path, library) for path in files_in(sides / name)]
        for name in ("reference", "same", "worse")
    }
    scenarios = [
        Scenario(name, tuple(runs["reference"]), tuple(runs[side]), paired=False)
        for name, side in (("pick", "same"), ("place", "worse"), ("rest", "same"))
    ]
    found = difference(Pairing("file name", tuple(scenarios), ()))
    assert found.scenarios[0].name == "place"
    assert [row.verdict for row in found.scenarios].count(Verdict.WORSE) == 1
    assert found.together is not None
    assert found.together.name == "all scenarios"


def test_a_rate_that_differs_is_remarked_on_and_shared_octaves_are_compared(tmp_path):
    before = folder(tmp_path / "before", range(2))
    after = folder(tmp_path / "after", range(2), rate=500.0)
    status, out, _ = diff(before, after, "--format", "json")
    (row,) = json.loads(out)["scenarios"]
    assert status == 4
    assert "Rates differ (500 to 1000 Hz): octaves of all are compared." in row["remarks"]
    assert max(c["band_hz"][1] for c in row["changes"] if c["band_hz"]) < 250


def test_a_signal_that_one_side_lacks_keeps_findings_from_being_compared(tmp_path):
    before = folder(tmp_path / "before", range(2))
    after = tmp_path / "after"
    after.mkdir()
    for seed in range(2):
        good = run(seed)
        replace(good, velocity_desired=good.velocity * 0.99).save(after / f"walk-{seed}.npz")
    _, out, _ = diff(before, after)
    assert "Findings are not compared: " in out
    assert "has no velocity desired, others have" in out


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"robot": "ur5", "joints": tuple(joint_limits("ur5"))[:2]}, "is of ur5"),
        ({"joints": ("hip", "knee")}, "has none of the joints of"),
        ({"rate": 40.0}, "has 40 Hz; levels from 11 Hz on require 46 Hz"),
    ],
)
def test_what_cannot_be_compared_is_one_line_and_exit_status_3(tmp_path, changes, message):
    panda = {"robot": "panda", "joints": tuple(joint_limits("panda"))[:2]}
    before = folder(tmp_path / "before", range(2), **(panda if "robot" in changes else {}))
    after = folder(tmp_path / "after", range(2), **changes)
    status, out, err = diff(before, after, "--no-robot")
    assert status == 3
    assert out == "nothing is compared; files: 1 bad input\n"
    (line,) = err.splitlines()
    assert message in line
    assert line.endswith("scenario walk is not compared")


def test_bad_input_is_one_line(tmp_path):
    good, empty = folder(tmp_path / "good", [1]), tmp_path / "empty"
    empty.mkdir()
    status, _, err = diff(good, empty)
    assert status == 3
    assert err.startswith(f"inspector: {empty}: a folder without logs (.bag, .csv, ")
    missing = tmp_path / "missing"
    assert diff(missing, good)[::2] == (3, f"inspector: {missing}: no such file or folder\n")
    other = folder(tmp_path / "other", [1], name="climb")
    status, _, err = diff(good, other)
    assert status == 3
    assert (
        "have no run in common, neither by scenario and seed nor by file name (walk and climb)"
        in err
    )
    bad = folder(tmp_path / "bad", [1, 2])
    (bad / "walk-1.npz").write_bytes(b"nothing")
    status, out, err = diff(good, bad)
    assert status == 3
    assert f"inspector: {bad / 'walk-1.npz'}: " in err
    assert "1 scenario" in out


def test_a_file_that_cannot_be_read_is_named_once(tmp_path):
    """An error of a row names its file before a comma; control characters are written out."""
    good, bad = folder(tmp_path / "good", [1]), tmp_path / "bad"
    bad.mkdir()
    (bad / "row.csv").write_text("time,elbow.velocity\n0,1\n0.01,x\n0.02,3\n")
    (bad / "new\nline.npz").write_bytes(b"nothing")
    for command in (("diff", good), ("classify",)):
        status, _, err = call(*command, bad)
        assert status == 3
        assert f"inspector: {bad}/row.csv: row 3: " in err
        assert err.count("line.npz") == 1
        assert "line.npz: its name has control characters; rename it\n" in err


def test_two_runs_of_one_name_are_refused(tmp_path, library):
    before = folder(tmp_path / "before", [1])
    twice = folder(tmp_path / "twice", [1])
    run(2).save(twice / "walk_0.npz")
    with pytest.raises(
        PairingError, match=r"walk-0\.npz and .*walk_0\.npz are two runs of one name"
    ):
        paired(
            *(
                [m for p in files_in(f) if isinstance(m := measure_file(p, library), Measured)]
                for f in (before, twice)
            ),
            (before, twice),
        )


def test_two_runs_of_one_name_are_one_line(tmp_path):
    before, twice = (folder(tmp_path / name, [1]) for name in ("before", "twice"))
    run(2).save(twice / "walk_0.npz")
    status, out, err = diff(before, twice)
    told = f"{twice / 'walk-0.npz'} and {twice / 'walk_0.npz'} are two runs of one name"
    assert (status, out, err) == (3, "", f"inspector: {told}\n")


def test_the_report_has_recording_picture_and_numbers_of_the_worst_pair(sides, tmp_path):
    given = sides / "reference", sides / "worse", "--report", tmp_path / "report"
    status, out, _ = diff(*given)
    assert status == 1
    assert "worst.rrd, worst.png, diff.json; the worst pair: " in out
    assert (tmp_path / "report" / "worst.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((tmp_path / "report" / "diff.json").read_text())["verdict"] == "worse"
    status, _, err = diff(*given)
    assert status == 3
    assert "exists already" in err


def test_several_jobs_give_the_same_output(sides):
    one = diff(sides / "reference", sides / "worse", "--format", "json")
    two = diff(sides / "reference", sides / "worse", "--format", "json", "-j", 2)
    assert one == two
