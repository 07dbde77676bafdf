"""Runs beside accepted repetitions: what is found, and what the store keeps."""

import hashlib
import io
import json
import os
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commandline import call

import inspector
from inspector.reference import judging, store
from inspector.reference.levels import decoded, encoded, levels, octaves
from inspector.reference.store import Reference

EXAMPLE = Path(__file__).parents[1] / "examples" / "accept"


@pytest.fixture(scope="module")
def simulate():
    sys.path.insert(0, str(EXAMPLE))
    try:
        import simulate

        yield simulate
    finally:
        sys.path.remove(str(EXAMPLE))


@pytest.fixture(scope="module")
def project(tmp_path_factory, simulate):
    """A folder with accepted runs."""
    folder = tmp_path_factory.mktemp("project")
    simulate.write(folder / "runs")
    status, out, err = call("accept", folder / "runs", "--reason", "first release")
    assert status == 0, err
    assert "pick: new, 3 repetitions" in out
    return folder


@pytest.fixture
def own(project, tmp_path):
    """A copy of it."""
    return Path(shutil.copytree(project, tmp_path / "own"))


def classified(folder, *options):
    status, out, err = call("classify", folder, "--format", "json", *options)
    return status, {Path(each["run"]).stem: each for each in json.loads(out)["runs"]}, err


def test_a_harmless_change_has_no_finding(own, simulate):
    simulate.write(own / "now", "harmless")
    status, runs, _ = classified(own / "now")
    assert status == 0
    assert len(runs) == 9
    assert all(run["reference"]["scenarios"] == [name[:-2]] for name, run in runs.items())
    assert all(run["reference"]["shares"]["repetitions"] > 0.95 for run in runs.values())


def test_a_chatter_is_found_where_it_is_and_nowhere_else(own, simulate):
    simulate.write(own / "now", "chatter")
    status, runs, _ = classified(own / "now")
    assert status == 1
    for name, run in runs.items():
        assert bool(run["events"]) == name.startswith("pick"), name
        for event in run["events"]:
            assert event["evidence"]["kind"] == "repetitions"
            assert event["evidence"]["joint"] == "elbow"
            assert event["evidence"]["band_hz"] == [32.0, 64.0]
            assert 10 < event["evidence"]["over_db"] < 25


def test_an_impact_is_one_finding_that_starts_where_it_begins(own, simulate):
    simulate.write(own / "now", "impact")
    _, runs, _ = classified(own / "now")
    (event,) = runs["place-1"]["events"]
    assert event["label"] == "impact"
    assert event["start"] == pytest.approx(2.5, abs=0.1)
    assert event["evidence"]["joint"] == "upperarm"


def test_the_band_of_repetitions_holds_each_of_them_and_a_chatter_is_above_it(project, simulate):
    reference = Reference.load(project / "reference")
    own = reference.compare(simulate.run("pick", 2))
    low, high = own.band.T
    assert (low - 0.5 <= own.noise).all()  # the store has steps of half a decibel
    assert (own.noise <= high + 0.5).all()
    loud = reference.compare(simulate.run("pick", 4, "chatter"))
    assert (loud.noise > loud.band[:, 1]).mean() > 0.9


def test_pictures_beside_a_reference_show_what_it_finds(own, simulate, monkeypatch):
    index = pytest.importorskip("inspector.report.html")
    drawn = {}
    monkeypatch.setattr(
        "inspector.report.picture.picture",
        lambda analysis, beside: drawn.setdefault(analysis.status, (analysis, beside)) and b"",
    )
    simulate.write(own / "now", "chatter")
    call("classify", own / "now", "--report", own / "page")
    analysis, beside = drawn["findings"]
    assert [event.label for event in analysis.findings]
    assert beside.scenarios == ("pick",)
    assert drawn["ok"][0].findings == ()
    assert list((own / "page" / index.PICTURES).iterdir())


def test_an_improvement_is_told_and_does_not_fail(own, simulate):
    simulate.write(own / "now", "improvement")
    status, runs, _ = classified(own / "now")
    assert status == 0
    assert all(run["reference"]["quieter_db"] > 4 for run in runs.values())


def test_a_missing_scenario_fails_by_name(own, simulate):
    simulate.write(own / "now", "missing")
    status, out, _ = call("classify", own / "now")
    assert status == 1
    assert re.search(r"wave +MISSING +no log; it had \d\n", out)


def test_a_change_is_accepted_after_review_for_what_was_run_alone(own, simulate):
    simulate.write(own / "now", "chatter")
    before = (own / "reference" / "wave.npz").read_bytes()
    status, out, _ = call("accept", own / "now", "--only", "pick", "--reason", "new gripper")
    assert status == 0
    assert "pick: 3 repetitions replace the accepted, +" in out
    assert "2 other scenarios stay as they were" in out
    assert (own / "reference" / "wave.npz").read_bytes() == before
    assert call("classify", own / "now")[0] == 0
    text = (own / "reference" / "reference.toml").read_text()
    assert 'reason = "new gripper"' in text
    assert 'reason = "first release"' in text


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


def test_accept_writes_nothing_in_ci(own, monkeypatch):
    monkeypatch.setenv("CI", "true")
    before = {path: path.stat().st_mtime_ns for path in (own / "reference").iterdir()}
    status, _, err = call("accept", own / "runs", "--reason", "x")
    assert status == 2
    assert "CI=true: a person accepts runs" in err
    assert {path: path.stat().st_mtime_ns for path in (own / "reference").iterdir()} == before
    assert call("accept", own / "runs", "--reason", "x", "--in-ci")[0] == 0


def test_a_folder_of_good_runs_is_a_reference_as_it_is(own, simulate):
    simulate.write(own / "now", "chatter")
    shutil.rmtree(own / "reference")
    assert call("classify", own / "now" / "wave-1.npz", "--reference", own / "runs")[0] == 0
    assert call("classify", own / "now" / "pick-1.npz", "--reference", own / "runs")[0] == 1
    assert call("classify", own / "now" / "pick-1.npz", "--no-reference")[0] == 0


def test_a_run_that_is_cut_or_frozen_fails_and_says_so(own, simulate):
    run = simulate.run("pick", 9)
    run.cut(0.0, 2.0).save(own / "runs" / "pick-4.npz")
    out = call("classify", own / "runs" / "pick-4.npz")[1]
    assert "missing: end of the run (required: 2.0 of 6.0 s)" in out
    assert "Nothing stands out" not in out
    still = np.repeat(run.position[:1], len(run.time), axis=0)
    frozen = replace(run, position=still, velocity=0 * run.velocity)
    frozen.save(own / "runs" / "pick-5.npz")
    status, out, _ = call("classify", own / "runs" / "pick-5.npz")
    assert status == 1
    assert "missing: motion from 0." in out


def test_a_run_shorter_than_a_frame_is_cut_and_nothing_else_is_noted(own, simulate):
    simulate.run("pick", 9).cut(0.0, 0.15).save(own / "runs" / "pick-4.npz")
    status, out, err = call("classify", own / "runs" / "pick-4.npz")
    assert (status, err) == (1, "")
    assert "missing: end of the run (required: 0.1 of 6.0 s)" in out
    assert [line for line in out.splitlines() if line.startswith("note:")] == [
        "note:    a signal of 150 samples is too short: a frame takes 400"
    ]


def test_a_run_longer_than_its_scenario_is_compared_with_it_as_far_as_it_goes(own, simulate):
    parts = simulate.run("pick", 9), simulate.run("wave", 9)
    long = {
        name: np.concatenate([getattr(each, name) for each in parts])
        for name in ("position", "velocity", "position_desired", "velocity_desired")
    }
    time = np.arange(len(long["velocity"])) / simulate.RATE
    run = replace(parts[0], time=time, valid=None, **long)
    found = Reference.load(own / "reference").compare(replace(run, meta={"scenario": "pick"}))
    assert found.share(judging.Kind.REPETITIONS) == pytest.approx(0.5, abs=0.02)
    assert not found.exceedances
    assert "longer than its scenario, 12.0 of 6.0 s" in found.remarks[0]
    run.save(own / "runs" / "pick-9.npz")
    assert call("classify", own / "runs" / "pick-9.npz")[0] == 0


def test_two_scenarios_with_one_motion_are_told_apart_by_name_or_both_count(own, simulate):
    for number in (1, 2):
        simulate.run("pick", 10 + number, "chatter").save(own / "runs" / f"grab-{number}.npz")
    assert "grab: new, 2 repetitions" in call("accept", own / "runs", "--reason", "louder pick")[1]
    for name, status in (("pick", 1), ("grab", 0), ("other", 0)):
        path = own / "now" / f"{name}-8.npz"
        path.parent.mkdir(exist_ok=True)
        simulate.run("pick", 20, "chatter").save(path)
        found, out, _ = call("classify", path)
        assert found == status, out
        assert ("of grab, pick, and its name is of none: all count" in out) == (name == "other")


def test_a_reference_of_another_robot_is_told_and_the_general_model_decides(own, simulate):
    names = tuple(f"joint{number}" for number in range(4))
    run = replace(simulate.run("pick", 9), joint_names=names, desired_joint_names=names)
    run.save(own / "now.npz")
    status, out, _ = call("classify", own / "now.npz", "--reference", own / "reference")
    assert status == 0
    told = (
        "no reference: it is of joints shoulder, upperarm, elbow, …, and the run of joints joint0"
    )
    assert told in out
    (own / "pick").mkdir()
    run.save(own / "pick" / "pick-1.npz")
    out = call("accept", own / "pick", "--reason", "x", "-o", own / "reference")[1]
    assert "pick: 1 repetition replace the accepted, of a robot with other joints" in out


@pytest.mark.parametrize("command", ["accept", "view", "live", "diff"])
def test_a_store_of_a_later_version_is_one_line_for_every_command(own, command, monkeypatch):
    toml = own / "reference" / "reference.toml"
    toml.write_text(toml.read_text().replace("reference/1", "reference/2"))
    before = {path.name: path.read_bytes() for path in toml.parent.iterdir()}
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
    assert {path.name: path.read_bytes() for path in toml.parent.iterdir()} == before
    assert not out.exists()


def test_a_run_that_cannot_be_read_leaves_the_store_as_it_was(own):
    before = {path.name: path.read_bytes() for path in (own / "reference").iterdir()}
    (own / "runs" / "pick-4.csv").write_text("nothing\n")
    status, _, err = call("accept", own / "runs", "--reason", "x")
    assert (status, len(err.splitlines())) == (3, 1)
    assert "pick-4.csv: " in err
    assert {path.name: path.read_bytes() for path in (own / "reference").iterdir()} == before


def test_a_renamed_scenario_is_found_by_its_motion_and_accepted_as_renamed(own, simulate):
    for number in (1, 2, 3):
        (own / "runs" / f"wave-{number}.npz").rename(own / "runs" / f"greet-{number}.npz")
    status, runs, _ = classified(own / "runs")
    assert status == 0
    assert runs["greet-1"]["reference"]["scenarios"] == ["wave"]
    out = call("accept", own / "runs", "--reason", "a nicer name")[1]
    assert "greet: renamed from wave" in out
    assert "wave" not in [each.name for each in Reference.load(own / "reference").scenarios]
    assert not (own / "reference" / "wave.npz").exists()


def test_a_run_played_slower_and_begun_later_is_aligned(own, simulate):
    run = simulate.run("pick", 7)
    held = int(0.5 * simulate.RATE)
    source = np.arange(0, len(run.time) - 1, 0.97)
    at = np.concatenate((np.zeros(held), source))

    def played(signal, scale=1.0):
        whole = [np.interp(at, np.arange(len(signal)), column) for column in signal.T]
        return scale * np.stack(whole, axis=1)

    slow = replace(
        run,
        time=np.arange(len(at)) / simulate.RATE,
        valid=None,
        position=played(run.position),
        position_desired=played(run.position_desired),
        velocity=played(run.velocity, 0.97),
        velocity_desired=played(run.velocity_desired, 0.97),
    )
    found = Reference.load(own / "reference").compare(slow)
    assert found.share(judging.Kind.REPETITIONS) > 0.9
    assert not found.exceedances
    assert found.slope == pytest.approx(0.97, abs=0.01)


def test_another_motion_is_judged_by_other_motions_and_says_so(own, simulate):
    simulate.SCENARIOS["sweep"] = 4
    try:
        run = simulate.run("sweep", 1)
    finally:
        del simulate.SCENARIOS["sweep"]
    found = Reference.load(own / "reference").compare(run)
    assert found.share(judging.Kind.REPETITIONS) == 0
    assert found.share(judging.Kind.OTHER_MOTIONS) > 0.5
    assert "other motions of this robot" in str(found)
    assert not found.exceedances


def test_joints_rates_and_robots_that_do_not_fit_are_told(own, simulate):
    reference = Reference.load(own / "reference")
    run = simulate.run("pick", 5)
    more = replace(
        run,
        joint_names=(*run.joint_names[:3], "finger"),
        desired_joint_names=(*run.joint_names[:3], "finger"),
    )
    assert "no reference for joints finger" in reference.compare(more).remarks
    half = replace(
        run,
        time=run.time[::2],
        velocity=run.velocity[::2],
        position=run.position[::2],
        velocity_desired=run.velocity_desired[::2],
        position_desired=run.position_desired[::2],
        valid=None,
    )
    found = reference.compare(half)
    assert any(each.startswith("compared up to 128 Hz") for each in found.remarks)
    assert not found.exceedances
    other = replace(run, joint_names=tuple("abcd"), desired_joint_names=tuple("abcd"))
    assert reference.compare(other).remarks[0].startswith("no reference: it is of")
    blind = replace(run, velocity_desired=None, position_desired=None)
    assert blind.position is not None
    assert reference.compare(blind).run.guided_by == "measured positions"
    assert not reference.compare(blind).exceedances


def test_what_is_wanted_may_be_as_loud_as_stated_and_is_missed(own, simulate):
    toml = own / "reference" / "reference.toml"
    wanted = '[[scenario.wanted]]\nclass = "impact"\ntime_s = [2.3, 3.2]\nloudest_db = 10.0\n'
    head, place, rest = toml.read_text().partition('[[scenario]]\nname = "wave"')
    toml.write_text(f'{head}{wanted}required = true\nreason = "the stop"\n{place}{rest}')
    simulate.write(own / "now", "impact")
    status, runs, _ = classified(own / "now" / "place-1.npz")
    assert status == 0
    assert runs["place-1"]["events"][0]["ruling"] == "allowed"
    assert (
        "missing: impact from 2.30 s to 3.20 s (required: the stop)"
        in (call("classify", own / "runs" / "place-1.npz")[1])
    )
    toml.write_text(toml.read_text().replace("loudest_db = 10.0", "loudest_db = -20.0"))
    assert classified(own / "now" / "place-1.npz")[0] == 1


def test_a_waiver_holds_until_its_day(own, simulate):
    toml = own / "reference" / "reference.toml"
    head, pick, rest = toml.read_text().partition('\n[[scenario]]\nname = "place"')
    waiver = '[[scenario.waive]]\nuntil = 2999-01-01\nreason = "bug 7"\n'
    toml.write_text(f"{head}\n{waiver}{pick}{rest}")
    simulate.write(own / "now", "chatter")
    assert classified(own / "now" / "pick-1.npz")[1]["pick-1"]["events"][0]["ruling"] == "waived"
    toml.write_text(toml.read_text().replace("2999", "2020"))
    status, runs, _ = classified(own / "now" / "pick-1.npz")
    assert (status, runs["pick-1"]["events"][0]["ruling"]) == (1, "waiver-expired")


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda text: text.replace("reference/1", "reference/2"), "of format 'noise-reference/2'"),
        (lambda text: text.replace("robot", "robto", 1), "no 'robto'; there are name"),
        (lambda text: text.replace('levels = "pick', 'levels = "../pick'), "name of an .npz"),
        (lambda text: text.replace("rate_hz = 1000.0", "rate_hz = -1", 1), "expected a rate"),
        (
            lambda text: text.replace("rate_hz = 1000.0", "rate_hz = 10.0", 1),
            "its arrays do not belong to",
        ),
        (lambda text: text.replace("required = true", "required = 1", 1), "true or false"),
        (lambda text: text[:200], "no store of references"),
        (lambda text: text.replace('name = "place"', 'name = "pick"'), "have one name"),
        (lambda text: text + "\n" + "[[scenario.wanted]]\nclass = 3\n", "class = 3"),
    ],
)
def test_a_store_that_is_wrong_is_one_line(own, change, told):
    toml = own / "reference" / "reference.toml"
    toml.write_text(change(toml.read_text()))
    status, out, err = call("classify", own / "runs")
    assert (status, out) == (3, "")
    assert told in err
    assert len(err.splitlines()) == 1


def test_levels_that_were_changed_or_are_hostile_are_one_line(own):
    path = own / "reference" / "pick.npz"
    path.write_bytes(path.read_bytes()[:-30])
    assert "was changed, or does not belong to" in call("classify", own / "runs")[2]
    path.unlink()
    os.mkfifo(path)
    assert "no regular one" in call("classify", own / "runs")[2]


@pytest.mark.parametrize("kind", ["pipe", "folder", "loop", "dangling"])
def test_what_is_no_store_but_named_like_one_is_an_error(own, kind):
    toml = own / "reference" / "reference.toml"
    toml.unlink()
    if kind == "pipe":
        os.mkfifo(toml)
    elif kind == "folder":
        toml.mkdir()
    else:
        toml.symlink_to(toml if kind == "loop" else own / "nothing")
    status, _, err = call("classify", own / "runs")
    assert status == 3
    assert "reference.toml: " in err
    assert len(err.splitlines()) == 1


def test_a_read_only_folder_is_one_line_and_loses_nothing(own, monkeypatch):
    before = (own / "reference" / "reference.toml").read_bytes()

    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("noisemodel.files.os.open", refuse)
    (own / "runs" / "wave-3.npz").unlink()
    status, _, err = call("accept", own / "runs" / "wave-1.npz", "--reason", "x")
    assert status == 5
    assert "cannot be written (Permission denied)" in err
    assert (own / "reference" / "reference.toml").read_bytes() == before


@pytest.mark.parametrize("guide", [np.float32(1.0), np.full((1, 4), np.nan, dtype=np.float32)])
def test_levels_that_are_none_are_refused_even_if_their_hash_is_right(own, guide):
    toml, path = own / "reference" / "reference.toml", own / "reference" / "pick.npz"
    with np.load(path) as content:
        arrays = dict(content)
    before = hashlib.sha256(path.read_bytes()).hexdigest()
    np.savez(path, **(arrays | {"guide_0": guide}))
    after = hashlib.sha256(path.read_bytes()).hexdigest()
    toml.write_text(toml.read_text().replace(before, after))
    status, out, err = call("classify", own / "runs" / "pick-1.npz")
    assert status == 3
    assert "its arrays do not belong to reference.toml; accept the runs again" in out + err


def test_a_store_inside_the_runs_is_no_log(own):
    shutil.move(own / "reference", own / "runs" / "reference")
    status, runs, _ = classified(own / "runs")
    assert status == 0
    assert len(runs) == 9
    assert runs["pick-1"]["reference"]["scenarios"] == ["pick"]
    assert inspector.Reference.load(own / "runs" / "reference").named("pick").robot == ""


@pytest.mark.parametrize("name", ["adapt", "baseline", "expect"])
def test_commands_that_accept_replaces_say_so(name):
    status, _, err = call(name, "a.npz", "--output", "b.npz")
    assert status == 2
    assert "is now `inspector accept`" in err


def test_levels_of_a_tone_are_its_root_mean_square_in_its_octave(simulate):
    run = simulate.run("pick", 1)
    tone = np.sqrt(2) * 0.1 * np.sin(2 * np.pi * 90 * run.time)[:, None] * np.ones((1, 4))
    found = levels(replace(run, velocity=tone, velocity_desired=None, position_desired=None))
    level = np.median(found.level[:, 0, 0], axis=0)
    assert level[octaves(1000.0).index((64.0, 128.0))] == pytest.approx(-20.0, abs=0.6)
    assert level.argmax() == octaves(1000.0).index((64.0, 128.0))
    assert np.isnan(found.level[:, :, 1]).all()


def test_repetitions_of_which_no_joint_is_in_all_are_no_reference_for_each_other(simulate):
    runs = []
    for number, columns in enumerate([[0, 1], [1, 2], [0, 2]], 1):
        run = simulate.run("pick", number)
        named = tuple(run.joint_names[column] for column in columns)
        signals = {
            name: getattr(run, name)[:, columns]
            for name in ("velocity", "velocity_desired", "position_desired")
        }
        part = replace(run, joint_names=named, desired_joint_names=named, position=None, **signals)
        runs.append(levels(part, name="pick"))
    reference = Reference(Path("good"), store.of_runs(runs))
    assert [len(each.repetitions) for each in reference.scenarios] == [3]
    compared = reference.compare(runs[0])
    assert compared.scenarios == ()
    assert compared.share(judging.Kind.GENERAL) == 1.0
    assert compared.exceedances == ()


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
    level = np.array([[-120.0, -99.9, -20.3, 5.0, np.nan, 90.0]], dtype=np.float32)
    kept = decoded(encoded(level))
    np.testing.assert_allclose(kept[0, 1:4], [-100.0, -20.5, 5.0])
    assert np.isnan(kept[0, 4])
    assert kept[0, 0] == -100.0


def test_a_motion_is_aligned_with_itself_delayed():
    motion = np.cumsum(np.random.default_rng(1).normal(size=(200, 3)), axis=0) / 10
    (same,) = judging.align(motion, [motion])
    np.testing.assert_array_equal(same.frame, np.arange(200))
    late = np.concatenate((np.repeat(motion[:1], 8, axis=0), motion))
    (found,) = judging.align(late, [motion])
    np.testing.assert_array_equal(found.frame[8:], np.arange(200))
    assert found.residual.max() == pytest.approx(0.0, abs=1e-6)


def test_margins_follow_from_scores_and_are_assumed_without():
    assert judging.margin_of([], 1).db == judging.ASSUMED_DB
    assert "assumed" in str(judging.margin_of([], 1))
    quiet, loud = judging.margin_of([0.1, 0.2, 0.3], 3), judging.margin_of([4.0, 5.0, 9.0], 3)
    assert quiet.db < loud.db
    assert "at most once in 4" in quiet.bound
    assert store.calibrated(store.Scenario("a", ())).scores == ()


def test_findings_in_what_is_accepted_are_warned_of_and_wanted_from_then_on(own, simulate):
    simulate.write(own / "now", "impact")
    _, _, err = call("accept", own / "now", "--only", "place", "--reason", "it has to hit")
    assert "place-1.npz: impact from 2.50 s to " in err
    assert "is that wanted?" in err
    place = Reference.load(own / "reference").named("place")
    assert [each.label for each in place.wanted] == ["impact"]
    assert place.wanted[0].joints == ("upperarm",)
    assert call("classify", own / "now")[0] == 0


def test_pages_say_the_evidence_of_each_finding_and_the_reference_of_the_run(own, simulate):
    simulate.write(own / "now", "chatter")
    run, page = own / "now" / "pick-1.npz", own / "page.html"
    assert call("classify", run, "--report", own / "report")[0] == 1
    assert call("view", run, "--reference", own / "reference", "-o", page)[0] == 0
    for found in (page, own / "report" / "index.html"):
        words = " ".join(found.read_text().split())
        assert re.search(r"\d\d(\.\d)? dB over (\d )?repetitions", words)
        assert re.search(r"[Rr]eference: \S*reference, 100% by 3 repetitions of pick", words)
