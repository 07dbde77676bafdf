"""One analysis decides: its status, findings and remarks are those of every output."""

import hashlib
import json
from dataclasses import replace
from itertools import pairwise
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from generalmodel import fixed
from hypothesis import given, settings
from hypothesis import strategies as st
from test_models_labels import labels as by_letters

from inspector import report
from inspector.analysis import (
    LOUDEST,
    SHOWN,
    Analysis,
    Estimate,
    analyse,
    analyse_file,
    chosen,
    default_kinds,
    estimate,
    extents,
    gaps,
    noise_level,
    with_links,
    worst,
    worst_joint,
    write_csv,
)
from inspector.audit import audit
from inspector.audit.signals import without_placeholder
from inspector.errors import InspectorError, Status, Unknown
from inspector.levels import STEP
from inspector.library import Labelled, demo_run, load_library, model_files
from inspector.localisation import Localisation
from inspector.logs.read import Source
from inspector.report import WORDS, html
from inspector.report.formats import FORMATS
from inspector.verdict import Verdict, classify_file, exit_status, work_of
from noiseclassifier import Event
from noisemodel import Block, NoiseModelError, Robot, Run
from noisemodel.run import METHOD, joint_velocity

LIBRARY = load_library(model_files())
RATE = 1000.0


def moving(*, desired=True, seconds=5.0, rate=RATE, tone=0.0, **changes):
    """Two joints that move, and measured noise."""
    time = np.arange(round(seconds * rate)) / rate
    generator = np.random.default_rng(0)
    wanted = np.stack([0.5 * np.sin(2 * np.pi * f * time) for f in (0.3, 0.4)], axis=1)
    velocity = wanted + 1e-4 * generator.normal(size=wanted.shape)
    velocity[:, 0] += tone * np.sin(2 * np.pi * 60 * time) * ((time >= 2.0) & (time < 3.0))
    fields = {"time": time, "velocity": velocity, "joint_names": ("a", "b")}
    return Run(**(fields | ({"velocity_desired": wanted} if desired else {}) | changes))


def analysed(text, **changes):
    """An analysis with labels by their first letters, upper case above the threshold."""
    labels = by_letters(text)
    spans = labels.events()
    status = Status.FINDINGS if spans else Status.OK
    fields = {"labels": labels, "spans": spans, "findings": spans, "status": status}
    run = changes.get("run", moving())
    return Analysis(**({"name": "run", "run": run, "audit": audit(run, {})} | fields | changes))


def test_the_status_is_the_same_in_every_output(tmp_path):
    for run in (moving(), moving(tone=1.0), moving(rate=50.0)):
        found = analyse(run, LIBRARY)
        status = found.status.value
        verdict = Verdict.of(tmp_path / "run.npz", found)
        assert json.loads(FORMATS["json"]([verdict]))["runs"][0]["status"] == status
        assert f"run.npz   {WORDS[found.status]}" in FORMATS["text"]([verdict])
        outcome = {"ok": None, "findings": "failure", "cannot-tell": "skipped"}[status]
        case = ET.fromstring(FORMATS["junit"]([verdict])).find(".//testcase")
        tags = {child.tag for child in case} - {"system-out"}
        assert tags == ({outcome} if outcome else set())
        github = FORMATS["github"]([verdict])
        counted = github.startswith("::notice title=noise-inspector::1 run: 1 ok")
        assert (f"{status}: " in github) if outcome else counted
        assert report.report(found).startswith(f"### {status}")
        assert f"<title>run: {status}" in html.page(found)
        assert exit_status([verdict]) == {"ok": 0, "findings": 1, "cannot-tell": 4}[status]


def test_a_run_without_a_fitting_model_has_the_status_cannot_tell_and_a_reason():
    steps = 1e-3 * np.random.default_rng(1).normal(size=(50, 2))
    held = moving(velocity=np.repeat(steps, 100, axis=0), desired=False)
    for run, reason in (
        (held, "measured values are held: logged at 10 Hz"),
        (moving(rate=50.0), "logged at 50 Hz"),
    ):
        found = analyse(run, LIBRARY)
        assert (found.status, found.labels, found.findings) == (Status.CANNOT_TELL, None, ())
        assert found.reason.startswith(reason)
        assert found.headline == f"cannot-tell: {found.reason}"
        assert found.reason == found.message
        assert any(remark.startswith(f"No labels: {reason}") for remark in found.remarks)


def test_a_finding_starts_at_its_onset_and_ends_when_the_event_does_in_the_lane_too():
    found = analyse(moving(tone=1.0), LIBRARY)
    first, last = found.findings[0].start, max(event.stop for event in found.findings)
    assert (first, last) == pytest.approx((2.0, 3.0), abs=0.05)
    for span, finding in zip(found.spans, found.findings, strict=True):
        assert span.start <= finding.start < finding.stop <= span.stop
    assert [*found.findings] == sorted(found.findings, key=lambda each: (each.start, each.stop))
    shown = [stretch for stretch in found.lane if stretch[2] != "ok"]
    assert (shown[0][0], shown[-1][1]) == (first, last)


def test_an_unknown_frame_that_is_no_finding_takes_the_hop_around_its_middle_in_the_lane():
    lane = analysed("...u...").lane
    assert [name for *_, name in lane] == ["ok", "unknown", "ok"]
    assert lane[1][:2] == pytest.approx((0.45, 0.55))  # its frame is from 0.3 s to 0.7 s


def test_the_lane_has_no_class_in_a_gap():
    labels = analysed("...oOO....").labels
    late = np.where(np.arange(10) >= 6, 2.0, 0.0)
    apart = replace(labels, start=labels.start + late, stop=labels.stop + late)
    lane = analysed("...", labels=apart, spans=(), findings=()).lane
    assert [name for *_, name in lane] == ["ok", "ok"]
    times = [time for stretch in lane for time in stretch[:2]]
    assert times == pytest.approx([0.0, 0.9, 2.6, 3.3])


def test_runs_are_worse_by_status_then_by_their_findings_then_by_the_best_score(tmp_path):
    def event(score, start=0.0):
        return Event("impact", start, start + 0.5, score)

    def verdict(*findings, status=Status.FINDINGS):
        found = analysed("...", findings=findings, spans=findings, status=status)
        return Verdict.of(tmp_path / "run.npz", found)

    worst_first = [
        verdict(event(0.8), event(0.8, 1.0), event(0.8, 2.0)),
        verdict(event(0.8), event(0.8, 1.0)),
        verdict(event(0.9)),
        verdict(event(0.7)),
        verdict(status=Status.OK),
    ]
    severities = [each.severity for each in worst_first]
    assert severities == sorted(severities)
    assert len(set(severities)) == len(severities)


@given(st.text(alphabet=".iIoOu", min_size=1, max_size=30))
@settings(deadline=None)
def test_a_lane_covers_all_frames_once_and_shows_each_finding(text):
    found = analysed(text)
    lane = found.lane
    assert (lane[0][0], lane[-1][1]) == (0.0, pytest.approx(0.1 * len(text) + 0.3))
    assert all(one[1] == other[0] for one, other in pairwise(lane))
    assert all(one[2] != other[2] for one, other in pairwise(lane))
    assert {name for *_, name in lane} <= {"ok", "unknown", *(e.label for e in found.findings)}
    if found.findings:
        assert found.findings[-1].label in {name for *_, name in lane}


def test_unknown_frames_that_are_ignored_raise_nothing_and_are_a_remark():
    generator = np.random.default_rng(3)
    time, loud = np.arange(5000) / RATE, 1e4 * generator.normal(size=(5000, 1))
    run, library = Run(time=time, velocity=loud, joint_names=("a",)), {"fixed": fixed()}
    found = analyse(run, library)
    assert found.status is Status.FINDINGS
    assert all(event.novel for event in found.findings)
    ignoring = analyse(run, library, unknown=Unknown.IGNORE)
    assert "unknown" not in {event.label for event in ignoring.findings}
    assert "unknown frames are ignored" in ignoring.headline
    assert "Unknown frames are ignored." in ignoring.message


def test_a_run_of_unknown_frames_alone_is_not_ok_when_they_are_ignored(monkeypatch):
    import inspector.analysis as module

    def unknown(run, library, **_):
        labels = analysed("uuuu").labels
        return Labelled(labels, next(iter(library)), "4 of 4 frames are out of distribution.")

    monkeypatch.setattr(module, "label_run", unknown)
    assert module.analyse(moving(), LIBRARY).status is Status.FINDINGS
    found = module.analyse(moving(), LIBRARY, unknown=Unknown.IGNORE)
    assert found.status is Status.CANNOT_TELL
    assert found.message == (
        "every frame is unknown. Unknown frames are ignored. 4 of 4 frames are out of distribution."
    )


def test_the_headline_counts_findings_by_class_and_those_out_of_distribution():
    events = (Event("impact", 1.0, 1.2, 0.9), Event("impact", 2.0, 2.2, 0.9, novel=True))
    found = analysed("....", findings=events, spans=events, status=Status.FINDINGS)
    assert found.headline == "findings: 2 impact; 1 out of distribution"
    assert analysed("....").headline == "ok"


def zeros(run, **changes):
    return replace(run, velocity_desired=np.zeros_like(run.velocity), **changes)


def test_zeros_in_place_of_a_desired_velocity_are_left_out_of_a_run_that_moves():
    run, remark = without_placeholder(zeros(moving()))
    assert run.velocity_desired is None
    assert remark == (
        "The desired velocity is zero throughout while joints move at more than 0.1 rad/s for"
        " seconds: it was left out."
    )
    assert remark in analyse(zeros(moving()), LIBRARY).message
    told = remark.removeprefix("The desired velocity is ").replace("was", "is").rstrip(".")
    assert any(told in warning for warning in audit(zeros(moving()), LIBRARY).warnings)
    for other in (moving(), moving(desired=False)):
        assert without_placeholder(other) == (other, "")
    assert not any("left out" in warning for warning in audit(moving(), LIBRARY).warnings)
    still = 1e-4 * np.random.default_rng(0).normal(size=(5000, 2))
    target = np.linspace(0.0, 0.5, 5000)[:, None] * np.ones(2)
    run, remark = without_placeholder(zeros(moving(), velocity=still, position_desired=target))
    assert run.velocity_desired is None
    assert run.position_desired is not None
    assert "while the desired position changes" in remark


@pytest.mark.parametrize("push", [0.036, 0.5])
def test_a_standing_arm_that_is_pushed_keeps_its_zeros(push):
    time = np.arange(10_000) / RATE
    pushes = push * np.exp(-(((time[:, None] - np.array([2.0, 6.0])) / 0.2) ** 2))
    standing = zeros(
        moving(seconds=10.0), velocity=pushes, position_desired=np.full((10_000, 2), 0.3)
    )
    run, remark = without_placeholder(standing)
    assert run is standing
    assert remark == ""


def stepping(step):
    """A run whose desired positions are rounded to a step, and differentiated."""
    run = moving(desired=False)
    target = step * np.round(np.sin(2 * np.pi * 0.3 * run.time)[:, None] * np.ones(2) / step)
    return replace(
        run,
        position_desired=target,
        velocity_desired=joint_velocity(run.time, target),
        desired_joint_names=run.joint_names,
        meta={"differentiated": {"velocity_desired": METHOD}},
    )


def test_a_desired_velocity_made_of_coarse_positions_is_left_out():
    run, remark = without_placeholder(stepping(0.01))
    assert run.velocity_desired is None
    assert remark == (
        "The desired velocity, differentiated from positions in steps of 0.01 rad, has 1.5 rad/s of"
        " noise: it was left out."
    )
    assert without_placeholder(stepping(1e-4))[1] == ""


@pytest.mark.parametrize("slope", [np.gradient, lambda held, **_: np.diff(held, prepend=0, axis=0)])
def test_pulses_of_held_targets_are_no_desired_velocity_but_chatter_and_rests_are(slope):
    run = moving()
    target = np.cumsum(run.velocity_desired, axis=0)
    for every, left_out in ((2, False), (20, True)):
        held = target[np.arange(len(target)) // every * every]
        cut, remark = without_placeholder(replace(run, velocity_desired=slope(held, axis=0)))
        assert (cut.velocity_desired is None) == left_out
    assert remark == (
        "The desired velocity is zero between the steps of targets of about 50 Hz: it was left out."
    )
    rests = run.velocity_desired * (np.arange(len(target)) // 20 % 2)[:, None]
    assert without_placeholder(replace(run, velocity_desired=rests))[1] == ""


@given(st.text(alphabet="..iIoOu", min_size=1, max_size=30))
@settings(deadline=None, max_examples=60)
def test_a_finding_lies_within_its_frames(text):
    labels = analysed(text).labels
    spans, findings = extents(moving(), labels)
    assert spans == labels.events()
    assert [finding.label for finding in findings] == [span.label for span in spans]
    for span, finding in zip(spans, findings, strict=True):
        assert span.start - 1e-9 <= finding.start < finding.stop <= span.stop + 1e-9


def test_a_file_is_analysed_by_its_path_with_its_links_unless_told(tmp_path):
    run = moving(tone=1.0)
    run.save(tmp_path / "shaken.npz")
    library, (path,) = load_library(["general"]), model_files(["general"])
    found, sha256 = analyse(tmp_path / "shaken.npz", library), hashlib.sha256(path.read_bytes())
    known = "shaken", "general", sha256.hexdigest()
    assert (found.name, found.model, found.model_sha256) == known
    assert found.findings == analyse(run, library).findings
    found = analyse_file(demo_run(), {})
    assert found.links is not None
    assert found.sha256 == hashlib.sha256(demo_run().read_bytes()).hexdigest()
    assert found.name == demo_run().stem
    bare = analyse_file(demo_run(), {}, links=False)
    assert bare.links is None
    assert bare.missing == found.missing
    assert with_links(replace(bare, run=replace(bare.run, position=None)), "normal").links is None


def test_what_a_run_lacks_and_what_was_computed_in_its_place_is_said():
    still = np.zeros((3, 12))
    meta = {"differentiated": {"velocity": "central"}}
    names = Robot.load("solo12").joint_names
    fields = {"time": np.arange(3) / 1000, "velocity": still, "position": still, "meta": meta}
    pose = np.tile([0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0], (3, 1))
    run = Run(**fields, joint_names=names, velocity_desired=still, robot="solo12")
    made = "The run had no velocity: it was differentiated (central)."
    motion = "The run has no desired velocities: the noise counts the measured motion alone."
    positions, none = "No 3D robot: the run has no positions.", "No 3D robot: the run names none."
    gap = "3 samples lie in gaps; frames that touch one are not labelled."
    neither = "neither a listed robot nor a URDF or MJCF file."
    for each, missing in (
        (run, ("The run has no base pose: the robot is drawn with its base at the origin.", made)),
        (replace(run, base_pose=pose), (made,)),
        (replace(run, position=None), (positions, made)),
        (replace(run, robot="no such robot"), (f"No 3D robot: 'no such robot' is {neither}", made)),
        (moving(desired=False), (none, motion)),
        (moving(valid=np.arange(5000) >= 3), (none, gap)),
    ):
        assert with_links(analysed(".", run=each), "").missing == missing
    desired = replace(run, base_pose=pose, velocity_desired=still + 1.0, position_desired=still)
    assert (estimate(desired, "normal").pressure > 0).all()  # what is desired makes noise, too
    up = np.tile([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (3, 1))  # a base that floats makes noise
    assert (estimate(replace(run, base_pose=pose, base_velocity=up), "normal").pressure > 0).all()


def still_and_fast(**changes):
    """Two joints of constant speed, 3 and 4 rad/s, with a faster sample at 7 ms."""
    velocity = np.tile([3.0, -4.0], (10, 1))
    velocity[7] = [-6.0, 8.0]
    fields = {"time": np.arange(10) / 1000 + 2.0, "velocity": velocity, "joint_names": ("a", "b")}
    return Run(**(fields | changes))


def test_the_level_of_a_run_is_that_of_its_samples_with_parts_of_a_thousandth_and_remarks():
    def level(**changes):
        run = still_and_fast(**changes)
        return noise_level(run, estimate(run, "simplified"))

    rms = np.sqrt((9 * 25.0 + 100.0) / 10)
    shares = "\n   64.0%  b\n   36.0%  a"
    assert level() == f"simplified: rms {rms:.4g} rad/s, peak 10 rad/s at 2.007 s{shares}"
    gap = level(valid=np.arange(10) != 7)
    assert gap == f"simplified: rms 5 rad/s, peak 5 rad/s at 2.000 s{shares}"
    faint = level(velocity=np.full((10, 2), 1e-3), valid=np.arange(10) != 7)
    assert "peak 0.001414 rad/s at 2.000 s" in faint  # no gap is louder
    rest = level(velocity=np.zeros((10, 2)))
    assert rest == "simplified: rms 0 rad/s, peak 0 rad/s at 2.000 s"
    power = np.tile([0.998, 0.001, 0.0009], (10, 1))
    known = Estimate("paper", "√W", power, ("a", "b", "c"), ("links without geometry: d",))
    assert noise_level(still_and_fast(), known).splitlines()[1:] == [
        "   99.8%  a",
        "    0.1%  b",
        "  links without geometry: d",
    ]


def test_the_simplified_noise_has_what_is_measured_what_is_desired_and_the_base(tmp_path):
    base = np.tile([1.0, 2.0, 2.0, 0.0, 4.0, 0.0], (10, 1))
    run = still_and_fast(
        velocity_desired=np.tile([0.5, 0.25], (10, 1)), base_velocity=base, valid=np.arange(10) < 2
    )
    found = estimate(run, "simplified")
    assert found.parts == ("a", "b", "a, desired", "b, desired", "base")
    assert found.power[0] == pytest.approx([9.0, 16.0, 0.25, 0.0625, 25.0])
    write_csv(run, (found, replace(found, kind="other", unit="x")), tmp_path / "noise.csv")
    level = f"{np.sqrt(50.3125):.9g}"
    text = (tmp_path / "noise.csv").read_text(encoding="utf-8")
    assert text.splitlines() == [
        "time [s],simplified [rad/s],other [x]",
        f"2,{level},{level}",
        f"2.001,{level},{level}",
    ]


def test_noise_that_is_not_finite_names_its_time():
    power = np.ones((10, 1))
    power[4:6] = np.inf
    text = "the paper noise is inf at 2.004 s: no robot moves so fast, or is so large"
    with pytest.raises(InspectorError, match=f"^{text}$"):
        noise_level(still_and_fast(), Estimate("paper", "√W", power, ("a",)))
    gap = still_and_fast(valid=~np.isin(np.arange(10), [4, 5]))
    assert ", peak 1 " in noise_level(gap, Estimate("paper", "√W", power, ("a",)))


@pytest.mark.parametrize(
    ("robot", "kind", "text"),
    [
        (None, "loud", "loud"),
        (None, "normal", "kind 'normal' needs a robot, the run names none"),
        ("no robot", "paper", "kind 'paper' needs a robot, the run names 'no robot'"),
    ],
)
def test_a_noise_that_a_run_cannot_have_is_refused(robot, kind, text):
    with pytest.raises(NoiseModelError, match=text):
        estimate(still_and_fast(robot=robot), kind)


def test_samples_take_as_long_as_their_bytes_at_50_mb_a_second(tmp_path):
    (tmp_path / "a.npz").write_bytes(bytes(1_000_000))
    (tmp_path / "b.npz").write_bytes(bytes(500_000))
    found = [tmp_path / "a.npz", tmp_path / "b.npz", tmp_path / "gone.npz", tmp_path]
    assert work_of(list(map(Source, found))) == pytest.approx(0.03, rel=1e-12)


def test_the_papers_sum_is_given_where_a_robot_and_its_positions_are_known():
    whole = replace(moving(), robot="panda", position=np.zeros_like(moving().velocity))
    assert default_kinds(whole) == ("simplified", "paper")
    assert default_kinds(replace(whole, position=None)) == ("simplified",)
    assert default_kinds(replace(whole, robot="no such robot")) == ("simplified",)


def test_a_picture_that_cannot_be_drawn_is_lost_and_the_findings_are_not():
    def draw(*_):
        raise OSError("no space left")

    verdict = classify_file(demo_run(), LIBRARY, draw=draw)
    assert (verdict.status, verdict.lost, verdict.picture) == (
        Status.FINDINGS,
        ("no space left",),
        None,
    )


@pytest.mark.parametrize("rate", [200.0, 1000.0])
def test_samples_cut_from_the_end_move_no_earlier_finding(rate):
    run = moving(rate=rate, tone=1.0)
    whole = analyse(run, LIBRARY).findings
    assert whole
    for cut in (1, 2, 7, round(0.033 * rate), round(0.1 * rate), round(0.25 * rate)):
        found = analyse(run.cut(-np.inf, float(run.time[-cut])), LIBRARY).findings
        assert [event.label for event in found] == [event.label for event in whole]
        for one, other in zip(found, whole, strict=True):
            assert (one.start, one.stop) == pytest.approx((other.start, other.stop), abs=1 / rate)


STEPS = np.arange(100) * STEP


def inspected(tmp_path, *, blocks=(), events=(), **changes):
    """A quiet run with a short knock at 1 s and a loud rattle from 2 s to 3 s."""
    time = np.arange(4000) / 1000
    velocity = 0.2 * np.cos(time) + 1.0 * ((time >= 1.0) & (time < 1.003))
    velocity += 2.0 * np.sin(2 * np.pi * 80 * time) * ((time >= 2.0) & (time < 3.0))
    fields = {"time": time, "velocity": velocity[:, None], "joint_names": ("a",), "blocks": blocks}
    fields |= changes
    path = tmp_path / "run.npz"
    tmp_path.mkdir(exist_ok=True)
    Run(**fields).save(path)
    return replace(analyse_file(path, {}), findings=tuple(events), spans=tuple(events))


KNOCK, RATTLE = Event("impact", 0.9, 1.2, 3.0), Event("oscillations", 2.0, 3.0, 1.0)


def test_the_loudest_three_findings_come_first_whatever_their_scores(tmp_path):
    first, second = worst(inspected(tmp_path, events=(KNOCK, RATTLE)))
    assert (first.label, second.label) == ("oscillations", "impact")
    assert 2.0 <= first.peak <= 3.0
    assert second.peak == pytest.approx(1.0, abs=0.05)
    assert (first.start, first.stop) == (2.0, 3.0)
    many = [Event("impact", start, start + 0.1, 1.0) for start in np.arange(5) * 0.5]
    assert len(worst(inspected(tmp_path / "many", events=many))) == 3


def test_without_findings_annotations_count_and_else_the_loudest_moment(tmp_path):
    blocks = (Block(0.0, 0.5, "ok"), Block(0.9, 1.2, "impact"))
    assert [each.label for each in worst(inspected(tmp_path, blocks=blocks))] == ["impact"]
    (only,) = worst(inspected(tmp_path / "bare"))
    assert only.label == LOUDEST
    assert 2.0 <= only.peak <= 3.0
    assert (only.start, only.stop) == (0.0, 3.999)


def test_the_worst_joint_is_that_of_the_worst_finding_and_else_the_loudest(tmp_path):
    time = np.arange(4000) / 1000
    tone = 0.5 * np.sin(2 * np.pi * 80 * time) * ((time >= 1.0) & (time < 1.3))
    velocity = np.stack((np.sin(2 * np.pi * 15 * time), tone), axis=1)
    event = Event("oscillations", 1.0, 1.3, 1.0)
    found = inspected(tmp_path, events=(event,), velocity=velocity, joint_names=("a", "b"))
    vars(found)["localisations"] = {event: Localisation(joints=(("b", 0.9), ("a", 0.1)))}
    assert 1.0 <= worst(found)[0].peak <= 1.3
    assert worst_joint(found) == 1
    assert worst_joint(replace(found, findings=(), spans=())) == 0


@pytest.mark.parametrize(
    ("lost", "begins"), [(0.3, "Nothing stands out"), (0.8, "gaps leave labels to ")]
)
def test_a_verdict_names_gaps_and_what_its_log_lacked_and_most_gaps_are_not_ok(lost, begins):
    note = {"notes": ["position of finger: left out"]}
    found = analyse(moving(valid=np.arange(5000) >= lost * 5000, meta=note), LIBRARY)
    assert found.message.startswith(begins)
    gap = f"1 gap, {5 * lost:g} s in all, the first at 0 s: not judged."
    assert f"Position of finger: left out. {gap}" in found.message
    assert found.status is (Status.OK if lost < 0.5 else Status.CANNOT_TELL)


def test_gaps_last_from_their_first_sample_to_the_next_valid_one():
    fields = {"time": 5.0 + np.arange(8) / 1000, "velocity": np.ones((8, 1)), "joint_names": ("a",)}
    lost = Run(**fields, valid=~np.isin(np.arange(8), [0, 3, 4, 7]))
    found = [(start - 5.0, stop - 5.0) for start, stop in gaps(lost)]
    assert np.round(1000 * np.array(found), 6).tolist() == [[0.0, 1.0], [3.0, 5.0], [7.0, 7.0]]
    assert gaps(Run(**fields)) == []


def test_a_moment_ends_with_the_run_and_peaks_within_itself(tmp_path):
    late = Event("impact", 3.5, 9.0, 1.0)
    early = Event("oscillations", -1.0, 0.5, 1.0)
    gone = Event("oscillations", 7.0, 8.0, 1.0)
    found = {each.label: each for each in worst(inspected(tmp_path, events=(late, early, gone)))}
    assert set(found) == {"impact", "oscillations"}
    assert (found["impact"].start, found["impact"].stop) == (3.5, 3.999)
    assert (found["oscillations"].start, found["oscillations"].stop) == (0.0, 0.5)
    short = Event("impact", 1.001, 1.002, 1.0)  # within one step of 50 ms, from 1.0 s
    (only,) = worst(inspected(tmp_path / "other", events=(short,)))
    assert 1.001 <= only.peak <= 1.002


def test_rows_are_the_loudest_during_findings_in_the_order_of_the_robot():
    level = np.full((100, 20), -60.0)
    level[10, :10] = 20.0  # loud while nothing is wrong
    level[60, [17, 12]] = -10.0
    found = chosen(analysed("....", findings=(Event("impact", 3.0, 3.1, 0.9),)), STEPS, level)
    assert len(found) == SHOWN == len(set(found))
    assert found == sorted(found)
    assert {12, 17} <= set(found)


def test_steps_that_a_finding_only_touches_do_not_count():
    finding = Event("impact", 3.0, 3.5, 0.9)
    time = np.array([3.0 - STEP, 3.0 - STEP + 1e-6, 3.5 - 1e-6, 3.5])
    level = np.full((4, 12), -60.0)
    level[0, :2] = level[3, 2:4] = 20.0  # loud just before and just after
    level[1, 4:8] = level[2, 8:] = 0.0
    assert chosen(analysed("....", findings=(finding,)), time, level) == list(range(4, 12))
    again = Event("impact", 9.0, 9.5, 0.9)  # in no step: any other finding counts
    assert chosen(analysed("....", findings=(again, finding)), time, level) == list(range(4, 12))


def test_without_findings_rows_are_the_loudest_at_any_time_and_without_a_level_the_quietest():
    level = np.full((100, 20), -60.0)
    level[10, 5:9] = 20.0
    level[20] = np.nan  # a gap
    assert set(range(5, 9)) <= set(chosen(analysed("...."), STEPS, level))
    level = np.full((100, 12), -60.0)
    level[:, :4] = np.nan
    assert chosen(analysed("...."), STEPS, level) == list(range(4, 12))
    assert chosen(analysed("...."), STEPS[:0], level[:0]) == list(range(8))
    assert chosen(analysed("...."), STEPS, np.full((100, 3), -np.inf)) == [0, 1, 2]
