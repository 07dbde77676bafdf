"""Runs beside accepted repetitions, or those before a change: what is found, and what is kept."""

import hashlib
import io
import json
import os
import re
import shutil
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from commandline import call, printed, refused

import inspector
import noisemodel as nm
from inspector.reference import judging, store
from inspector.reference.levels import decoded, encoded, levels, octaves
from inspector.reference.store import Reference

ROOT = Path(__file__).parents[1]
DESIRED = ("position_desired", "velocity_desired")
SIGNALS = ("position", "velocity", *DESIRED)
# Runs that are made after each change.
CHANGED = {
    "harmless": ("pick-1", "place-1", "wave-1"),
    "chatter": ("pick-1", "pick-2", "pick-3", "place-1", "wave-1"),
    "impact": ("place-1", "place-2"),
    "improvement": ("pick-1", "wave-1"),
}


@pytest.fixture(scope="module")
def sweep(simulate):
    """A motion that was not accepted."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(simulate.SCENARIOS, "sweep", 4)
        return simulate.run("sweep", 1)


@pytest.fixture(scope="module")
def project(tmp_path_factory, simulate):
    """A folder with accepted runs, and with runs after changes."""
    folder = tmp_path_factory.mktemp("project")
    simulate.write(folder / "runs")
    out = printed("accept", folder / "runs", "--reason", "first release")
    assert "pick: new, 3 repetitions" in out
    for change, names in CHANGED.items():
        (folder / change).mkdir()
        for name in names:
            scenario, _, number = name.partition("-")
            simulate.run(scenario, int(number), change).save(folder / change / f"{name}.npz")
    return folder


@pytest.fixture
def own(project, tmp_path):
    """A copy of what was accepted, to be changed."""
    for name in ("runs", "reference"):
        shutil.copytree(project / name, tmp_path / name)
    return tmp_path


@pytest.fixture(scope="module")
def reference(project):
    return Reference.load(project / "reference")


def classified(folder, *options):
    status, out, err = call("classify", folder, "--format", "json", *options)
    return status, {Path(each["run"]).stem: each for each in json.loads(out)["runs"]}, err


def accepted(folder):
    """Everything in the store."""
    return {path.name: path.read_bytes() for path in (folder / "reference").iterdir()}


# --- classify


def test_a_harmless_change_passes_an_improvement_is_told_and_a_missing_scenario_fails(project):
    status, runs, _ = classified(project / "harmless")
    assert (status, len(runs)) == (0, 3)
    assert all(run["reference"]["scenarios"] == [name[:-2]] for name, run in runs.items())
    assert all(run["reference"]["shares"]["repetitions"] > 0.95 for run in runs.values())
    for name in CHANGED["improvement"]:
        status, runs, _ = classified(project / "improvement" / f"{name}.npz")
        assert (status, runs[name]["reference"]["quieter_db"] > 4) == (0, True)
    status, out, _ = call("classify", project / "improvement")
    assert (status, bool(re.search(r"place +MISSING +no log; it had 3\n", out))) == (1, True)


def test_a_chatter_is_found_where_it_is_and_nowhere_else_whatever_score_a_model_gives(project):
    status, runs, _ = classified(project / "chatter", "--min-score", "1")
    assert status == 1
    for name, run in runs.items():
        assert bool(run["events"]) == name.startswith("pick"), name
        for event in run["events"]:
            where = {"kind": "repetitions", "joint": "elbow", "band_hz": [32.0, 64.0]}
            assert event["evidence"].items() >= where.items()
            assert 10 < event["evidence"]["over_db"] < 25


def test_an_impact_is_one_finding_that_starts_where_it_begins(project):
    _, runs, _ = classified(project / "impact" / "place-1.npz")
    (event,) = runs["place-1"]["events"]
    assert event["label"] == "impact"
    assert event["start"] == pytest.approx(2.5, abs=0.1)
    assert event["evidence"]["joint"] == "upperarm"


def test_the_band_of_repetitions_holds_each_of_them_and_a_chatter_is_above_it(reference, simulate):
    own = reference.compare(simulate.run("pick", 2))
    low, high = own.band.T
    assert (low - 0.5 <= own.noise).all()  # the store has steps of half a decibel
    assert (own.noise <= high + 0.5).all()
    loud = reference.compare(simulate.run("pick", 4, "chatter"))
    assert (loud.noise > loud.band[:, 1]).mean() > 0.9


def test_pictures_and_pages_beside_a_reference_show_what_it_finds(project, tmp_path, monkeypatch):
    index = pytest.importorskip("inspector.report.html")
    drawn = {}
    monkeypatch.setattr(
        index,
        "picture",
        lambda analysis, beside: drawn.setdefault(analysis.status, (analysis, beside)) and b"",
    )
    call("classify", project / "chatter", "--report", tmp_path / "page")
    analysis, beside = drawn["findings"]
    assert [event.label for event in analysis.findings]
    assert beside.scenarios == ("pick",)
    assert drawn["ok"][0].findings == ()
    assert list((tmp_path / "page" / index.PICTURES).iterdir())
    monkeypatch.undo()
    run, page = project / "chatter" / "pick-1.npz", tmp_path / "page.html"
    assert call("view", run, "--reference", project / "reference", "-o", page)[0] == 0
    for found in (page, tmp_path / "page" / "index.html"):
        words = " ".join(found.read_text().split())
        assert re.search(r"\d\d(\.\d)? dB over (\d )?repetitions", words)
        assert re.search(r"[Rr]eference: \S*reference, 100% by 3 repetitions of pick", words)


def test_a_folder_of_good_runs_is_a_reference_as_it_is(own, project):
    shutil.rmtree(own / "reference")
    chatter = shutil.copytree(project / "chatter", own / "now")
    assert call("classify", chatter / "wave-1.npz", "--reference", own / "runs")[0] == 0
    assert call("classify", chatter / "pick-1.npz", "--reference", own / "runs")[0] == 1
    assert call("classify", chatter / "pick-1.npz", "--no-reference")[0] == 0


def test_a_run_that_is_cut_or_frozen_fails_and_says_so(own, simulate):
    run = simulate.run("pick", 9)
    run.cut(0.0, 2.0).save(own / "runs" / "pick-4.npz")
    out = call("classify", own / "runs" / "pick-4.npz")[1]
    assert "missing: end of the run (required: 2.0 of 6.0 s)" in out
    assert "Nothing stands out" not in out
    run.cut(0.0, 0.15).save(own / "runs" / "pick-6.npz")  # shorter than a frame
    out = printed("classify", own / "runs" / "pick-6.npz", status=1)
    assert "missing: end of the run (required: 0.1 of 6.0 s)" in out
    assert [line for line in out.splitlines() if line.startswith("note:")] == [
        "note:    a signal of 150 samples is too short: a frame takes 400"
    ]
    run.position[:], run.velocity[:] = run.position[0], 0
    run.save(own / "runs" / "pick-5.npz")
    assert "missing: motion from 0." in printed("classify", own / "runs" / "pick-5.npz", status=1)


def test_a_run_too_slow_for_any_octave_makes_its_motion_and_cannot_be_judged(own, simulate):
    path = own / "runs" / "pick-9.npz"
    nm.decimated(simulate.run("pick", 9), 25.0).save(path)
    told = "no octave is compared: the run has 25 Hz, the reference 1000 Hz"
    for command in (("classify", path), ("diff", own / "runs" / "pick-1.npz", path)):
        status, out, _ = call(*command)
        assert (status, told in out, "another motion" in out) == (4, True, False), out
    assert "pick: 1 repetition replace the accepted" in call("accept", path, "--reason", "x")[1]


def test_a_run_longer_than_its_scenario_is_compared_with_it_as_far_as_it_goes(
    own, reference, simulate
):
    parts = simulate.run("pick", 9), simulate.run("wave", 9)
    long = {name: np.concatenate([getattr(each, name) for each in parts]) for name in SIGNALS}
    time = np.arange(len(long["velocity"])) / simulate.RATE
    run = replace(parts[0], time=time, valid=None, **long)
    found = reference.compare(replace(run, meta={"scenario": "pick"}))
    assert found.share(judging.Kind.REPETITIONS) == pytest.approx(0.5, abs=0.02)
    assert not found.exceedances
    assert "longer than its scenario, 12.0 of 6.0 s" in found.remarks[0]
    run.save(own / "runs" / "pick-9.npz")
    assert call("classify", own / "runs" / "pick-9.npz")[0] == 0


def test_a_run_that_no_model_tells_is_ok_only_if_nearly_all_of_it_is_compared(own, simulate):
    (own / "slow").mkdir()
    for number in range(4):
        run = nm.decimated(simulate.run("pick", number), 50.0)
        run.save(own / "slow" / f"pick-{number}.npz")
    shake = 5.0 + 3.0 * np.sin(40 * np.pi * np.arange(1500) / 50)
    velocity, known = np.vstack((run.velocity, shake[:, None] * [0, 0, 1, 0])), run.joint_names
    for count, status in ((300, 0), (1800, 4)):
        now = nm.Run(time=np.arange(count) / 50, joint_names=known, velocity=velocity[:count])
        now.save(own / "now.npz", overwrite=True)
        found, out, _ = call("classify", own / "now.npz", "--reference", own / "slow")
        assert (found, "cannot tell: logged at 50 Hz" in out) == (status, status == 4), out


def test_two_scenarios_with_one_motion_are_told_apart_by_name_or_both_count(own, simulate):
    for number in (1, 2):
        simulate.run("pick", 10 + number, "chatter").save(own / "runs" / f"grab-{number}.npz")
    assert "grab: new, 2 repetitions" in call("accept", own / "runs", "--reason", "louder pick")[1]
    (own / "now").mkdir()
    unknown, wrong = ", and its name is of none: all count", ", not that of place"
    cases = ("pick", 1, ""), ("grab", 0, ""), ("other", 0, unknown), ("place", 0, wrong)
    for name, status, told in cases:
        path = own / "now" / f"{name}-8.npz"
        simulate.run("pick", 20, "chatter").save(path)
        found, out, _ = call("classify", path)
        assert found == status, out
        assert (f"its motion is that of grab, pick{told}" in out) == bool(told)


def test_two_motions_of_one_name_are_two_scenarios_from_then_on(own, simulate):
    simulate.run("place", 9, "impact").save(own / "runs" / "pick-9.npz")
    out = call("accept", own / "runs", "--reason", "another motion")[1]
    assert "pick-9: new, 1 repetition" in out
    known = Reference.load(own / "reference")
    assert (known.named("pick").wanted, len(known.named("pick-9").wanted)) == ((), 1)
    status, runs, err = classified(own / "runs")
    assert (status, runs["pick-9"]["reference"]["scenarios"]) == (0, ["pick-9"]), err
    again = ("accept", own / "runs" / "pick-9.npz", "--only", "pick-9", "--reason", "again")
    assert "pick-9: unchanged" in call(*again)[1]
    assert len(Reference.load(own / "reference").named("pick").repetitions) == 3


@pytest.mark.parametrize(("name", "fails"), [("other", 0), ("pick", 1)])
def test_a_reference_of_another_robot_is_told_and_fails_runs_of_its_scenarios(
    own, simulate, name, fails
):
    path = own / f"{name}-1.npz"
    renamed(simulate.run("pick", 9), "joint-").save(path)
    status, out, _ = call("classify", path, "--reference", own / "reference")
    lacks = "robot of pick (required: the run has its name, and other joints or another robot)"
    assert (status, f"missing: {lacks}" in out) == (fails, bool(fails))
    there, here = "shoulder, upperarm, elbow", "joint-shoulder, joint-upperarm, joint-elbow"
    told = f"no reference: it is of a robot with joints {there}, and the run of a robot with joints"
    assert f"{told} {here}" in out
    pair = own / "runs" / "pick-1.npz", path
    status, out, err = call("diff", *pair, "--report", own / "page")
    assert (status, err, f"{told} {here}" in out) == (4, "", True)
    assert not (own / "page" / "worst.png").exists()
    out = call("accept", path, "--reason", "x", "-o", own / "reference")[1]
    replaced = "pick: 1 repetition replace the accepted, of a robot with other joints"
    assert (replaced if fails else "other: new") in out


def test_a_base_without_joints_and_a_run_of_less_than_a_frame_are_not_accepted(own):
    still, base = np.zeros((3000, 0)), np.random.default_rng(0).normal(size=(3000, 6))
    path, time = own / "base-1.npz", np.arange(3000) / 1000
    nm.Run(time=time, joint_names=(), velocity=still, base_velocity=base).save(path)
    refused = f"inspector: {path}: the run has no joints, and a reference holds levels of joints\n"
    assert call("accept", path, "--reason", "x")[::2] == (3, refused)
    out = call("classify", path, "--reference", own / "reference")[1]
    assert "upperarm, elbow, and the run of a robot without joints" in out
    nm.Run(time=time[:150], joint_names=("a",), velocity=np.zeros((150, 1))).save(own / "b.npz")
    short = f"inspector: {own / 'b.npz'}: 0.15 s is too short, a reference needs 0.2 s\n"
    assert call("accept", own / "b.npz", "--reason", "x")[::2] == (3, short)


def test_two_robots_have_a_scenario_each_of_one_name_whichever_is_accepted_first(own, simulate):
    for robot, number in np.ndindex(2, 5):
        path = own / ("now" if number > 2 else "good") / f"{robot}" / f"pick-{number}.npz"
        path.parent.mkdir(parents=True, exist_ok=True)
        renamed(simulate.run("pick", number), f"{robot}.").save(path)
    both = [own / "good" / "0", own / "good" / "1"]
    for runs in (both, both[1:], both[:1]):
        assert call("accept", *runs, "--reason", "x", "-o", own / "both")[0] == 0
        known = Reference.load(own / "both").scenarios
        assert {each.name: len(each.repetitions) for each in known} == {"pick": 3, "pick-0": 3}
    assert classified(own / "now", "--reference", own / "both")[0] == 0


def renamed(run, prefix):
    names = tuple(f"{prefix}{name}" for name in run.joint_names)
    return replace(run, joint_names=names, desired_joint_names=names)


def test_a_reference_counts_in_the_process_that_writes_it(tmp_path, simulate):
    path, written = tmp_path / "pick-1.npz", tmp_path / "reference"
    simulate.run("pick", 1).save(path)
    assert store.find(path) is None
    assert call("accept", path, "--reason", "first", "-o", written)[::2] == (0, "")
    assert store.find(path) == written


def test_what_no_reference_covers_is_decided_by_the_general_model(own, simulate):
    run = simulate.run("pick", 9)
    burst = 0.5 * np.exp(-(((run.time[:, None] - 3) / 0.3) ** 2))
    tone, shake = (burst * np.sin(2 * np.pi * hz * run.time[:, None]) for hz in (300, 40))
    replace(run, velocity=run.velocity + [0, 0, 0, 1] * tone).save(own / "now.npz")
    replace(run, velocity_desired=run.velocity_desired + shake).save(own / "target.npz")
    for name, now, change in (
        ("fewer", "now", lambda one: of_joints(one, [0, 1, 2])),
        ("slower", "now", lambda one: nm.decimated(one, 250.0)),
        ("untracked", "target", lambda one: replace(one, **dict.fromkeys(DESIRED))),
    ):
        (own / name).mkdir()
        for number in (1, 2, 3):
            change(simulate.run("pick", number)).save(own / name / f"pick-{number}.npz")
        status, runs, _ = classified(own / f"{now}.npz", "--reference", own / name)
        (event,) = runs[now]["events"]
        assert (status, event["evidence"]["kind"], event["fails"]) == (1, "general", True)
    assert "no reference for tracking errors of shoulder" in runs["target"]["reference"]["words"]
    assert classified(own / "now.npz", "--reference", own / "runs")[0] == 1


def of_joints(run, places):
    names = tuple(run.joint_names[place] for place in places)
    kept = {name: getattr(run, name)[:, places] for name in SIGNALS}
    return replace(run, joint_names=names, desired_joint_names=names, **kept)


def test_a_run_played_slower_and_begun_later_is_aligned(reference, simulate):
    run = simulate.run("pick", 7)
    source = np.arange(0, len(run.time) - 1, 0.97)
    at = np.concatenate((np.zeros(int(0.5 * simulate.RATE)), source))

    old = np.arange(len(run.time))
    slow = {
        name: np.stack([np.interp(at, old, each) for each in getattr(run, name).T], axis=1)
        for name in SIGNALS
    }
    slow |= {name: 0.97 * slow[name] for name in SIGNALS if name.startswith("velocity")}
    time = np.arange(len(at)) / simulate.RATE
    found = reference.compare(replace(run, time=time, valid=None, **slow))
    assert found.share(judging.Kind.REPETITIONS) > 0.9
    assert not found.exceedances
    assert found.quieter < 2  # the rest before it is no improvement


def test_another_motion_is_judged_by_other_motions_and_says_so(reference, sweep):
    found = reference.compare(sweep)
    assert found.share(judging.Kind.REPETITIONS) == 0
    assert found.share(judging.Kind.OTHER_MOTIONS) > 0.5
    assert "other motions of this robot" in str(found)
    assert not found.exceedances


@pytest.mark.parametrize("drift", [1e-9, -1e-4, 1e-3])
def test_a_clock_that_drifts_hides_no_tone_in_the_highest_octave(reference, simulate, drift):
    run = simulate.run("pick", 5)
    loud = replace(run, velocity=run.velocity + np.sin(2 * np.pi * 350 * run.time)[:, None])
    exact, found = (reference.compare(replace(loud, time=run.time * k)) for k in (1, 1 + drift))
    assert found.remarks == exact.remarks == ()
    assert found.worst == pytest.approx(exact.worst, abs=0.1)


def test_joints_rates_and_robots_that_do_not_fit_are_told(reference, simulate):
    run = simulate.run("pick", 5)
    names = (*run.joint_names[:3], "finger")
    more = replace(run, joint_names=names, desired_joint_names=names)
    assert "no reference for joints finger" in reference.compare(more).remarks
    half = {name: getattr(run, name)[::2] for name in ("time", *SIGNALS)}
    found = reference.compare(replace(run, valid=None, **half))
    assert any(each.startswith("compared up to 128 Hz") for each in found.remarks)
    assert not found.exceedances
    slow = levels(nm.decimated(run, 200.0))  # from 64 to 90 Hz is no octave
    known = Reference(Path("good"), store.of_runs([slow]))
    assert known.compare(slow).remarks == ("compared up to 64 Hz",)
    own = {name: getattr(run, name)[:, :2] for name in DESIRED}
    part = replace(run, desired_joint_names=run.joint_names[:2], **own)
    assert reference.compare(part).share(judging.Kind.REPETITIONS) > 0.95
    blind = replace(run, **dict.fromkeys(DESIRED))
    assert blind.position is not None
    assert reference.compare(blind).run.guided_by == "measured positions"
    assert not reference.compare(blind).exceedances


# --- accept


def test_a_change_is_accepted_after_review_for_what_was_run_alone(own, project):
    chatter = shutil.copytree(project / "chatter", own / "now")
    before = accepted(own)["wave.npz"]
    out = printed("accept", chatter, "--only", "pick", "--reason", "new gripper")
    assert "pick: 3 repetitions replace the accepted, +" in out
    assert "2 other scenarios stay as they were" in out
    assert accepted(own)["wave.npz"] == before
    assert call("classify", chatter)[0] == 0
    reasons = [each.reason for each in Reference.load(own / "reference").scenarios]
    assert reasons == ["new gripper", "first release", "first release"]


def test_runs_like_the_accepted_ones_join_them_and_the_newest_ten_stay(own, simulate):
    for number in range(4, 13):
        simulate.run("pick", number).save(own / "runs" / f"pick-{number}.npz")
    out = call("accept", own / "runs", "--reason", "more")[1]
    assert "pick: 9 repetitions added" in out
    assert "10 kept" in out
    assert "wave: unchanged" in out
    (pick, *_) = Reference.load(own / "reference").scenarios
    assert [Path(each.run).stem for each in pick.repetitions][-1] == "pick-12"
    assert len(pick.repetitions) == 10


def test_a_file_that_is_read_in_another_way_takes_the_place_of_what_it_was(tmp_path, simulate):
    run = simulate.run("pick", 1)
    for read in (run, replace(run, velocity=2 * run.velocity), renamed(run, "left-")):
        now = levels(read, name="level-1", file="pick-1.csv", sha256="of the file")
        accept = partial(store.accept_into, tmp_path / "reference", [now], reason="x", by="")
        assert "unchanged" not in accept(events={})[1][0][1]
        assert accept(events={})[1] == [("level-1", "unchanged, these runs are accepted already")]
        (kept,) = Reference.load(tmp_path / "reference").scenarios[0].repetitions
        assert kept.joints == now.joints
        np.testing.assert_allclose(kept.level, now.level, atol=0.5)


def test_what_cannot_be_accepted_leaves_the_store_as_it_was(own, monkeypatch):
    before = accepted(own)
    monkeypatch.setenv("CI", "true")
    status, _, err = call("accept", own / "runs", "--reason", "x")
    assert (status, "CI=true: a person accepts runs" in err) == (2, True)
    as_ci = ("--reason", "x", "--in-ci")
    with monkeypatch.context() as patch:
        refuse = Mock(side_effect=PermissionError(13, "Permission denied"))
        patch.setattr("noisemodel.files.os.open", refuse)
        status, _, err = call("accept", own / "runs" / "wave-1.npz", *as_ci)
        assert (status, "cannot be written (Permission denied)" in err) == (5, True)
    (own / "runs" / "pick-4.csv").write_text("nothing\n")
    assert "pick-4.csv: " in refused("accept", own / "runs", *as_ci)
    assert accepted(own) == before
    assert call("accept", own / "runs" / "pick-1.npz", *as_ci)[0] == 0


def test_a_renamed_scenario_is_found_by_its_motion_until_people_rename_it_in_the_store(own):
    for number in (1, 2, 3):
        (own / "runs" / f"wave-{number}.npz").rename(own / "runs" / f"greet-{number}.npz")
    status, runs, _ = classified(own / "runs")
    assert status == 0
    assert runs["greet-1"]["reference"]["scenarios"] == ["wave"]
    toml = own / "reference" / "reference.toml"
    toml.write_text(toml.read_text().replace('name = "wave"', 'name = "greet"'))
    out = call("accept", own / "runs", "--reason", "a nicer name")[1]
    assert "greet: unchanged" in out
    assert "wave" not in [each.name for each in Reference.load(own / "reference").scenarios]
    assert not (own / "reference" / "wave.npz").exists()


@pytest.mark.parametrize("start", [0.0, 100.0])
def test_findings_in_what_is_accepted_are_warned_of_and_wanted_from_then_on(own, simulate, start):
    for number, change in enumerate(("", "impact", "impact")):
        run = simulate.run("place", number, change)
        path = own / ("now" if number else "later") / f"place-{number}.npz"
        path.parent.mkdir(exist_ok=True)
        replace(run, time=run.time + start).save(path)
    _, _, err = call("accept", own / "now", "--only", "place", "--reason", "it has to hit")
    assert f"place-1.npz: impact from {start + 2.5:.2f} s to " in err
    assert "is that wanted?" in err
    place = Reference.load(own / "reference").named("place")
    assert [each.label for each in place.wanted] == ["impact"]
    assert place.wanted[0].joints == ("upperarm",)
    assert place.wanted[0].start == pytest.approx(2.5 - store.TOLERANCE, abs=0.1)
    toml, label = own / "reference" / "reference.toml", 'class = "impact"\n'
    toml.write_text(toml.read_text().replace(label, f"{label}required = true\n"))
    assert call("classify", own / "now" / "place-1.npz")[0] == 0
    assert f"missing: impact from {start + 2.3:.1f}" in call("classify", own / "later")[1]


# --- the store


def test_what_people_want_of_a_scenario_stays_when_its_runs_are_replaced(own, project):
    toml, place = own / "reference" / "reference.toml", '\n[[scenario]]\nname = "place"'
    wanted = '\n[[scenario.wanted]]\nclass = "impact"\ntime_s = [1.0, 2.0]\nrequired = true\n'
    toml.write_text(toml.read_text().replace(place, wanted + place))
    again = project / "chatter" / "pick-1.npz"
    assert "replace" in call("accept", again, "--reason", "louder", "-o", own / "reference")[1]
    (pick, *_) = Reference.load(own / "reference").scenarios
    assert [each.label for each in pick.wanted if each.required] == ["impact"]


def test_what_is_wanted_may_be_as_loud_as_stated_and_is_missed(own, project):
    toml, run = own / "reference" / "reference.toml", project / "impact" / "place-1.npz"
    wanted = '[[scenario.wanted]]\nclass = "impact"\ntime_s = [2.3, 3.2]\nloudest_db = 10.0\n'
    head, place, rest = toml.read_text().partition('[[scenario]]\nname = "wave"')
    toml.write_text(f'{head}{wanted}required = true\nreason = "the stop"\n{place}{rest}')
    status, runs, _ = classified(run, "--reference", own / "reference")
    assert (status, runs["place-1"]["events"][0]["ruling"]) == (0, "allowed")
    told = "missing: impact from 2.30 s to 3.20 s (required: the stop)"
    assert told in call("classify", own / "runs" / "place-1.npz")[1]
    toml.write_text(toml.read_text().replace("loudest_db = 10.0", "loudest_db = -20.0"))
    assert classified(run, "--reference", own / "reference")[0] == 1


def test_a_waiver_holds_until_its_day(own, project):
    toml, run = own / "reference" / "reference.toml", project / "chatter" / "pick-1.npz"
    head, pick, rest = toml.read_text().partition('\n[[scenario]]\nname = "place"')
    waiver = '[[scenario.waive]]\nuntil = 2999-01-01\nreason = "bug 7"\n'
    toml.write_text(f"{head}\n{waiver}{pick}{rest}")
    for year, status, ruling in (("2999", 0, "waived"), ("2020", 1, "waiver-expired")):
        toml.write_text(toml.read_text().replace("2999", year))
        found, runs, _ = classified(run, "--reference", own / "reference")
        assert (found, runs["pick-1"]["events"][0]["ruling"]) == (status, ruling)


@pytest.mark.parametrize("command", ["accept", "view", "live", "diff"])
def test_a_store_of_a_later_version_is_one_line_for_every_command(own, command, monkeypatch):
    toml = own / "reference" / "reference.toml"
    toml.write_text(toml.read_text().replace("reference/1", "reference/2"))
    before = accepted(own)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"time,a.velocity\n")))
    run, out = own / "runs" / "pick-1.npz", own / "out.rrd"
    options = {
        "accept": (run, "--reason", "x"),
        "view": (run, "--reference", toml.parent, "-o", out),
        "live": ("--rate", 100, "--save", out, "--reference", toml.parent),
        "diff": (toml.parent, own / "runs"),
    }
    status, _, err = call(command, *options[command])
    assert (status, len(err.splitlines())) == (3, 1)
    assert "of format 'noise-reference/2'" in err or command == "diff"
    assert accepted(own) == before
    assert not out.exists()


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("robot", "robto", "no 'robto'; there are name"),
        ('levels = "pick', 'levels = "../pick', "name of an .npz"),
        ("rate_hz = 1000.0", "rate_hz = -1", "expected a rate"),
        ("rate_hz = 1000.0", "rate_hz = 10.0", "its arrays do not belong to"),
        ("rate_hz = 1000.0", "rate_hz = nan", "rate_hz = nan, expected a number"),
        ("duration_s = 6.0", "", "[[scenario.repetition]] 1: duration_s is missing"),
        ("scores_db = [", 'scores_db = ["a", ', "expected a list, each of it a number"),
        ("required = true", "required = 1", "required = 1, expected true or false"),
        ("required = true", "required =", "no store of references"),
        ('name = "place"', 'name = "pick"', "have one name"),
        ("", "[[scenario.wanted]]\nclass = 3\n", "class = 3, expected a text"),
        ("", "[[scenario.wanted]]\ntime_s = [3, 1]\n", "time_s = [3, 1], expected [from, to]"),
        ("", '[[scenario.waive]]\nreason = "a"\n', "[[scenario.waive]]: until is missing"),
    ],
)
def test_a_store_that_is_wrong_is_one_line(own, old, new, told):
    toml = own / "reference" / "reference.toml"
    head, mark, rest = toml.read_text().partition(old) if old else (toml.read_text(), "\n", "")
    assert mark
    toml.write_text(f"{head}{new}{rest}")
    assert told in refused("classify", own / "runs" / "pick-1.npz")


@pytest.mark.parametrize("target", [None, "", "reference.toml", "nothing"])
def test_what_is_no_store_but_named_like_one_is_an_error(own, target):
    toml = own / "reference" / "reference.toml"
    toml.unlink()
    make = {None: os.mkfifo, "": os.mkdir}  # the others are links, to themselves or to nothing
    make.get(target, lambda path: path.symlink_to(target))(toml)
    assert "reference.toml: " in refused("classify", own / "runs")


def test_levels_that_were_changed_or_are_hostile_are_one_line(own):
    toml, path = own / "reference" / "reference.toml", own / "reference" / "pick.npz"
    run, whole = own / "runs" / "pick-1.npz", path.read_bytes()
    with np.load(path) as content:
        arrays = dict(content)
    path.write_bytes(whole[:-30])
    assert "was changed, or does not belong to" in call("classify", run)[2]
    before = hashlib.sha256(whole).hexdigest()
    for guide in (np.float32(1.0), np.full((1, 4), np.nan, dtype=np.float32)):
        np.savez(path, **(arrays | {"guide_0": guide}))
        after = hashlib.sha256(path.read_bytes()).hexdigest()
        toml.write_text(toml.read_text().replace(before, after))
        status, _, err = call("classify", run)
        told = "its arrays do not belong to reference.toml; accept the runs again"
        assert (status, told in err) == (3, True)
        before = after
    path.unlink()
    os.mkfifo(path)
    assert "no regular one" in call("classify", run)[2]


def test_a_store_inside_the_runs_is_no_log(own):
    shutil.move(own / "reference", own / "runs" / "reference")
    status, runs, _ = classified(own / "runs")
    assert (status, len(runs)) == (0, 9)
    assert runs["pick-1"]["reference"]["scenarios"] == ["pick"]
    assert (
        inspector.Reference.load(own / "runs" / "reference").named("pick").repetitions[-1].robot
        == ""
    )


# --- levels and margins


def test_levels_of_a_tone_are_its_root_mean_square_in_its_octave(simulate):
    run = simulate.run("pick", 1)
    tone = np.sqrt(2) * 0.1 * np.sin(2 * np.pi * 90 * run.time)[:, None] * np.ones((1, 4))
    found = levels(replace(run, velocity=tone, velocity_desired=None, position_desired=None))
    level = np.median(found.level[:, 0, 0], axis=0)
    assert level[octaves(1000.0).index((64.0, 128.0))] == pytest.approx(-20.0, abs=0.6)
    assert level.argmax() == octaves(1000.0).index((64.0, 128.0))
    assert np.isnan(found.level[:, :, 1]).all()


def test_repetitions_of_which_no_joint_is_in_all_are_no_reference_for_each_other(simulate):
    pairs = enumerate([[0, 1], [1, 2], [0, 2]], 1)
    runs = [levels(of_joints(simulate.run("pick", k), pair), name="pick") for k, pair in pairs]
    reference = Reference(Path("good"), store.of_runs(runs))
    assert [len(each.repetitions) for each in reference.scenarios] == [3]
    compared = reference.compare(runs[0])
    assert compared.scenarios == compared.exceedances == ()
    assert compared.share(judging.Kind.GENERAL) == 1.0
    run = simulate.run("pick", 1)  # what is shorter than a frame covers nothing, either
    reference = Reference(Path("good"), store.of_runs([levels(run.cut(0.0, 0.15), name="wave")]))
    assert reference.compare(run).share(judging.Kind.GENERAL) == 1.0


def test_a_desired_velocity_that_is_a_placeholder_tells_no_error(tmp_path, simulate):
    run = simulate.run("pick", 1)
    zeros = replace(run, velocity_desired=np.zeros_like(run.velocity))
    zeros.save(tmp_path / "pick-1.npz")
    reference = Reference.load(tmp_path)
    (kept,) = reference.scenarios[0].repetitions
    without = levels(replace(run, velocity_desired=None))
    np.testing.assert_array_equal(kept.level, without.level)
    np.testing.assert_array_equal(reference.compare(zeros).run.level, without.level)


def test_levels_are_kept_in_half_decibels():
    level = np.array([[-120.0, -99.9, -20.3, 5.0, np.nan]], dtype=np.float32)
    expected = [[-100.0, -100.0, -20.5, 5.0, np.nan]]
    np.testing.assert_allclose(decoded(encoded(level)), expected)


@pytest.mark.parametrize("largest", [judging.LARGEST, 5000])  # cells: of 5000, the means of 4
def test_a_motion_is_aligned_with_itself_delayed(monkeypatch, largest):
    monkeypatch.setattr(judging, "LARGEST", largest)
    motion = np.cumsum(np.random.default_rng(1).normal(size=(200, 3)), axis=0) / 10
    (same,) = judging.align(motion, [motion])
    np.testing.assert_array_equal(same.frame, np.arange(200))
    late = np.concatenate((np.repeat(motion[:1], 8, axis=0), motion))
    (found,) = judging.align(late, [motion])
    np.testing.assert_array_equal(found.frame[8:], np.arange(200))
    assert found.residual.max() == pytest.approx(0.0, abs=1e-6)


def test_margins_follow_from_scores_and_are_assumed_without():
    assert judging.margin_of([]).db == judging.ASSUMED_DB
    assert str(judging.margin_of([])) == "margin 6.0 dB assumed"
    quiet, loud = judging.margin_of([0.1, 0.2, 0.3]), judging.margin_of([4.0, 5.0, 9.0])
    assert quiet.db < loud.db
    assert "assumed" not in str(quiet)
    assert store.calibrated(store.Scenario("a", ())).scores_db == ()


# --- diff


def compared(before, after, *options):
    status, out, err = call("diff", before, after, "--format", "json", *options)
    assert out, err
    found = json.loads(out)
    return status, found, {row["name"]: row for row in found["scenarios"]}


def some(folder, source, *patterns):
    """A folder with some of the runs of another."""
    folder.mkdir(exist_ok=True)
    for path in [path for pattern in patterns for path in source.glob(pattern)]:
        shutil.copy(path, folder)
    return folder


def test_a_harmless_change_is_the_same_and_an_improvement_is_better(project, tmp_path):
    status, found, rows = compared(project / "runs", project / "harmless")
    assert (status, found["verdict"]) == (0, "same")
    assert all(row["over_db"] < row["margin_db"] for row in rows.values())
    assert found["counts"]["findings"] == {"new": 0, "louder": 0, "resolved": 0}
    before = some(tmp_path / "before", project / "runs", "pick-*", "wave-*")
    status, found, _ = compared(before, project / "improvement")
    assert (status, found["verdict"]) == (0, "better")
    assert found["counts"]["findings"]["new"] == 0


def test_a_chatter_in_one_scenario_is_worse_and_says_where_in_every_output(project, tmp_path):
    jsonschema = pytest.importorskip("jsonschema")
    pytest.importorskip("matplotlib")
    report, forms = tmp_path / "report", ("junit", "github", "markdown", "text")
    write = [option for form in forms for option in ("--write", f"{form}={tmp_path / form}")]
    status, found, rows = compared(
        project / "runs", project / "chatter", "--report", report, *write
    )
    assert (status, found["verdict"]) == (1, "worse")
    assert [row["verdict"] for row in found["scenarios"]] == ["worse", "same", "same"]
    change = rows["pick"]["changes"][0]
    assert (change["joint"], change["band_hz"]) == ("elbow", [32.0, 64.0])
    assert rows["pick"]["margin_db"] < change["low"] <= change["change"] <= change["high"]
    assert {each["kind"] for each in rows["pick"]["findings"]} == {"new"}
    schema = json.loads((ROOT / "docs" / "noise-diff-2.schema.json").read_text())
    jsonschema.validate(found, schema)
    for form in forms:
        text = (tmp_path / form).read_text()
        assert "pick" in text
        assert "elbow" in text
    assert sorted(path.name for path in report.iterdir()) == ["diff.json", "worst.png", "worst.rrd"]
    assert found["picture"] == str(report / "worst.png")
    assert (report / "worst.png").read_bytes().startswith(b"\x89PNG")


def test_a_chatter_in_all_scenarios_is_worse_in_all_in_any_order(project, tmp_path, simulate):
    before, after = tmp_path / "before", tmp_path / "after"
    after.mkdir()
    before.mkdir()
    for name, letter in {"pick": "b", "place": "a"}.items():
        for number in (1, 2, 3):
            new = f"{letter}-{number}.npz"
            shutil.copy(project / "runs" / f"{name}-{number}.npz", before / new)
            simulate.run(name, number + 3, "chatter-all").save(after / new)
    _, _, rows = compared(before, after)
    assert {row["verdict"] for row in rows.values()} == {"worse"}
    pair = (some(tmp_path / f"{side.name} alone", side, "a-*") for side in (before, after))
    _, _, only = compared(*pair)
    for name in ("verdict", "over_db", "margin_db", "changes"):
        assert only["a"][name] == rows["a"][name]
    found, alone = ([each | {"run": ""} for each in side["a"]["findings"]] for side in (rows, only))
    assert found == alone != []


def test_missing_cut_and_frozen_scenarios_fail_by_name_and_new_ones_pass(
    project, tmp_path, simulate
):
    one = some(tmp_path / "one", project / "runs", "pick-1*")
    two = some(tmp_path / "two", project / "runs", "pick-1*", "wave-1*")
    status, found, rows = compared(two, one)
    assert (status, found["verdict"], rows["wave"]["verdict"]) == (1, "missing", "missing")
    status, _, rows = compared(one, two)
    assert (status, rows["wave"]["verdict"]) == (0, "added")
    after = tmp_path / "after"
    after.mkdir()
    shutil.copy(project / "runs" / "wave-1.npz", after / "greet-1.npz")
    simulate.run("pick", 1).cut(0.0, 2.0).save(after / "pick-1.npz")
    run = simulate.run("place", 1)
    run.velocity[:] = 0
    run.position[:] = run.position[0]
    run.save(after / "place-1.npz")
    status, _, rows = compared(project / "runs", after)
    assert status == 1
    assert (rows["wave"]["verdict"], rows["greet"]["verdict"]) == ("missing", "added")
    assert (rows["pick"]["verdict"], rows["place"]["verdict"]) == ("cut", "frozen")
    assert "2.0 of 6.0 s" in rows["pick"]["reason"]


def test_two_runs_are_a_pair_whatever_they_are_called(project):
    run, other = project / "runs" / "pick-1.npz", project / "chatter" / "pick-3.npz"
    status, _, rows = compared(run, other)
    assert (status, rows["pick"]["verdict"]) == (1, "worse")


def test_new_findings_fail_where_they_are_to(project, tmp_path):
    before = some(tmp_path / "before", project / "runs", "place-*")
    after = some(tmp_path / "after", project / "harmless", "place-1*")
    assert call("diff", before, after, "--fail-on", "new")[0] == 0
    shutil.copy(project / "impact" / "place-2.npz", after)
    assert "1 new" in printed("diff", before, after, "--fail-on", "new", status=1).splitlines()[0]


def test_folders_without_a_scenario_in_common_are_one_line(project, tmp_path, sweep):
    before = some(tmp_path / "before", project / "runs", "*-1*")
    (tmp_path / "other").mkdir()
    sweep.save(tmp_path / "other" / "sweep-1.npz")
    err = refused("diff", before, tmp_path / "other")
    assert "have no scenario in common by name (pick, place, wave and" in err


def test_a_file_that_cannot_be_read_fails_unless_it_is_ignored(project, tmp_path):
    before = some(tmp_path / "before", project / "runs", "place-*")
    after = some(tmp_path / "after", project / "runs", "place-1*")
    (after / "pick-2.npz").write_text("no archive")
    status, out, err = call("diff", before, after, "--format", "json")
    assert status == 3
    assert list(json.loads(out)["failed"]) == [str(after / "pick-2.npz")]
    assert "pick-2.npz: not a run file" in err
    assert call("diff", before, after, "--on-bad-input", "ignore")[0] == 0
