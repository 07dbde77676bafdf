from itertools import pairwise

import numpy as np
import pytest
from recordings import entities, read
from recordings import motion as moved
from rerun.chunk import RrdReader

import inspector
import noisemodel as nm
from inspector.analysis import analyse
from inspector.library import label_run, load_library
from inspector.live import LiveError
from inspector.live.drawing import Sink
from inspector.live.session import BATCH
from inspector.recording import views
from inspector.report import spoken
from noisemodel import UnknownJointError

RATE = 1000.0
PANDA = tuple(f"panda_joint{i}" for i in range(1, 8))


@pytest.fixture(scope="module")
def library():
    """The model that ships."""
    return load_library()


def motion(seconds, joints=3, hum=(1.0, 2.0)):
    """Joints that swing, and hum at 90 Hz for a while."""
    time = np.arange(round(seconds * RATE)) / RATE
    random = np.random.default_rng(0)
    phase = 2 * np.pi * (0.2 + 0.1 * np.arange(joints)) * time[:, None]
    hums = (time >= hum[0]) & (time < hum[1])
    desired = 0.5 * np.cos(phase)
    velocity = desired + 1e-3 * random.standard_normal(desired.shape)
    velocity += 0.1 * (hums * np.sin(2 * np.pi * 90 * time))[:, None]
    position = 0.3 * np.sin(phase)
    return {
        "time": time, "velocity": velocity, "velocity_desired": desired, "position": position,
    }  # fmt: skip


def part(signals, piece):
    return {name: values[piece] for name, values in signals.items()}


def shown(tmp_path, signals, cuts=(), rate=RATE, **options):
    """Push a motion in pieces; the recording, the warnings, and the summary."""
    path, warned = tmp_path / "live.rrd", []
    session = inspector.LiveSession(
        rate, save=path, on_warning=warned.append, overwrite=True, **options
    )
    edges = [0, *sorted(cuts), len(signals["time"])]
    with session:
        for first, stop in pairwise(edges):
            session.push(**part(signals, slice(first, stop)))
    return path, warned, session.summary


ROWS = ("impact", "highaccelerations", "oscillations", "unknown", "ok")


def classes(path):
    """Start, stop and class of each stretch that is drawn, frames that touch as one."""
    time, values = read(path, "/class/found", "Measurements:values")
    found = []
    for now, row in zip(time, np.array(values)[:, :: views.COPIES], strict=True):
        for state in np.array(ROWS)[np.isfinite(row)]:
            if not found or found[-1][2] != state or now > found[-1][1] + 0.11:
                found.append([now, now, state])
            found[-1][1] = now
    return found


@pytest.fixture(scope="module")
def panda(tmp_path_factory, library):
    """Recording, warnings and summary of a Panda that hums for a second."""
    folder, signals = tmp_path_factory.mktemp("panda"), motion(3.0, 7)
    return shown(folder, signals, robot="panda", joint_names=PANDA, library=library)


def test_a_session_shows_everything(panda):
    path, warned, summary = panda
    assert warned == []
    plots = {"/noise/simplified", "/spectrogram/bands", "/class/found", "/score", "/events"}
    joints = {f"/joints/{each}" for each in ("velocity/0", "velocity/0_desired", "position/0")}
    assert plots | joints | {"/robot/motion", "/robot/panda_link3"} <= entities(path)
    assert len(RrdReader(path).blueprints()) == 1
    assert summary.samples == 3000
    assert summary.model == "general"
    assert sum(summary.labels.values()) == 27
    assert summary.warnings == {}


def test_findings_are_listed_as_they_come_and_are_those_of_the_summary(tmp_path, library):
    path, _, summary = shown(tmp_path, motion(4.0), library=library)
    assert summary.findings
    time, words = read(path, "/verdict/words", "Points2D:labels")
    assert words[0] == ["PASS so far"]
    (label,) = {spoken(event.label) for event in summary.findings}
    assert words[-1] == [f"FAIL   {len(summary.findings)} {label}"]
    assert summary.findings[0].start < time[1] < summary.findings[0].stop + 1.0
    listed, lines = read(path, "/events", "TextLog:text")
    for kind in ("start", "stop"):
        begins = "found: " if kind == "start" else "over: "
        own = [(at, line) for at, (line,) in zip(listed, lines, strict=True) if begins in line]
        expected = [getattr(event, kind) for event in summary.findings]
        np.testing.assert_allclose([at for at, _ in own], expected)
        for event, (_, line) in zip(summary.findings, own, strict=True):
            span = f", {event.start:.2f} s to {event.stop:.2f} s, score {event.score:.2f}"
            assert line == begins + label + {
                "start": f" from {event.start:.2f} s", "stop": span,
            }[kind]  # fmt: skip


def window(path):
    """What plots over time show, in each layout that was sent: start and end, with their kinds."""
    reader, found = RrdReader(path), []
    for blueprint in reader.blueprints():
        for chunk in reader.store(store=blueprint).stream():
            batch = chunk.to_record_batch()
            if "TimeAxis:view_range" in batch.schema.names:
                found += [row[0] for row in batch.column("TimeAxis:view_range").to_pylist() if row]
    return found


@pytest.mark.parametrize("start", [0.0, 1.7e9])
def test_plots_show_ten_seconds_and_nothing_lies_before_the_start(tmp_path, library, start):
    signals = motion(0.5)
    signals["time"] = signals["time"] + start
    path, _, _ = shown(tmp_path, signals, library=library)
    ranges = window(path)
    assert ranges
    assert all((each["start"], each["end"]) == (-10_000_000_000, 0) for each in ranges)
    for entity in entities(path):
        for component in ("Scalars:scalars", "Measurements:values", "TextLog:text"):
            time, _ = read(path, entity, component)
            assert time is None or time.min() >= start


@pytest.mark.parametrize("size", [1, 7, 1301])
def test_labels_are_those_of_the_whole_run_however_samples_come(tmp_path, library, size):
    signals = motion(2.5)
    path, _, _ = shown(tmp_path, signals, range(size, 2500, size), library=library)
    batch = label_run(nm.Run(joint_names=("a", "b", "c"), **signals), library).labels
    time, scores = read(path, "/score", "Scalars:scalars")
    np.testing.assert_allclose(time, (batch.start + batch.stop) / 2, atol=1e-6)
    np.testing.assert_allclose(scores, batch.scores, atol=1e-6)
    assert "oscillations" in batch.label
    raw = batch.raw
    changes = [label for i, label in enumerate(raw) if i == 0 or label != raw[i - 1]]
    assert [state for _, _, state in classes(path)] == changes


def test_no_peak_of_a_joint_is_lost(tmp_path, library):
    signals = motion(2.0)
    signals["velocity"][1234] += 3.0
    path, _, _ = shown(tmp_path, signals, library=library)
    _, velocity = read(path, "/joints/velocity/0", "Scalars:scalars")
    assert len(velocity) <= 2.0 * 400
    assert np.max(velocity) == pytest.approx(signals["velocity"].max())


@pytest.mark.parametrize(("watched", "messages"), [(True, 10), (False, 1)])
@pytest.mark.parametrize("seconds", [1.0, 0.97])
def test_a_viewer_gets_lines_every_tenth_of_a_second_and_a_file_all_at_once(
    tmp_path, library, seconds, watched, messages, monkeypatch
):
    monkeypatch.setattr(Sink, "watched", watched)
    signals = motion(seconds)
    path, _, _ = shown(tmp_path, signals, cuts=[7, 500, 501], library=library)
    time, values = read(path, "/noise/simplified", "Scalars:scalars")
    noise = nm.simplified(signals["velocity"], signals["velocity_desired"])
    assert time == pytest.approx(signals["time"], abs=1e-9)
    assert np.ravel(values) == pytest.approx(noise, rel=1e-12)
    chunks = RrdReader(path).store().stream().filter(content="/joints/velocity/0").to_chunks()
    assert sum(not chunk.is_static for chunk in chunks) == messages


def test_the_robot_has_the_pose_of_its_joints(panda):
    (path, _, _), signals = panda, motion(3.0, 7)
    time, poses = moved(path, "robot/panda_link1")
    assert len(time) == round(3.0 / BATCH)
    angle = np.interp(time, signals["time"], signals["position"][:, 0])
    np.testing.assert_allclose(poses[:, 5], np.sin(angle / 2), atol=1e-5)


def test_a_floating_base_makes_noise_and_moves(tmp_path, library):
    signals = motion(1.0, 1, hum=(9.0, 9.0)) | {
        "base_velocity": np.full((1000, 6), 2.0),
        "base_pose": np.tile([1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0], (1000, 1)),
    }
    names = nm.Robot.load("hyq").joint_names[:1]
    path, _, _ = shown(tmp_path, signals, robot="hyq", joint_names=names, library=library)
    _, noise = read(path, "/noise/simplified", "Scalars:scalars")
    assert min(noise)[0] > np.sqrt(6) * 2.0
    _, places = read(path, "/robot/motion", "Transform3D:translation")
    assert [1.0, 2.0, 3.0] in [place[0] for place in places]


def test_missing_samples_end_the_lane_and_labels_resume_after_them(tmp_path, library):
    signals = motion(4.0, hum=(9.0, 9.0))
    kept = np.ones(4000, dtype=bool)
    kept[1000:2500] = False
    path, warned, summary = shown(tmp_path, part(signals, kept), [777, 1900], library=library)
    assert warned == ["gap at 2.500 s: 1500 samples are missing"]
    assert summary.warnings == {"missing samples": 1500}
    shown_as = classes(path)
    assert [state for _, _, state in shown_as] == ["ok", "ok"]
    times = [time for start, stop, _ in shown_as for time in (start, stop)]
    np.testing.assert_allclose(times, [0.15, 0.85, 2.65, 3.85], atol=0.051)
    whole = {name: signals[name] * kept[:, None] for name in ("velocity", "velocity_desired")}
    valid = nm.Run(time=signals["time"], joint_names=("a", "b", "c"), valid=kept, **whole)
    batch = label_run(valid, library).labels
    time, scores = read(path, "/score", "Scalars:scalars")
    np.testing.assert_allclose(time, (batch.start + batch.stop) / 2, atol=1e-6)
    np.testing.assert_allclose(scores, batch.scores, atol=1e-6)


def as_live(signals, kind):
    """A motion with one thing wrong."""
    time, velocity = signals["time"], signals["velocity"]
    if kind == "a knock":
        velocity[2000:2010] += 0.5
    elif kind == "a chatter from the first sample to the last":
        velocity[:, 1] += 0.05 * np.sin(2 * np.pi * 35.0 * time)
    elif kind == "a hum that lasts to the end":
        late = time >= 2.6
        velocity[late] += 0.1 * np.sin(2 * np.pi * 90.0 * time[late])[:, None]
    return signals


@pytest.mark.parametrize(
    "kind",
    ["nothing", "a knock", "a chatter from the first sample to the last",
     "a hum that lasts to the end"],
)  # fmt: skip
def test_live_finds_what_classify_finds_on_the_same_samples(tmp_path, library, kind):
    """By design, live tells times by whole frames: onset and end are estimated of whole runs."""
    signals = as_live(motion(4.0, hum=(9.0, 9.0)), kind)
    _, _, summary = shown(tmp_path, signals, range(70, 4000, 70), library=library)
    run = nm.Run(joint_names=("a", "b", "c"), **signals)
    whole = analyse(run, library)
    assert bool(whole.findings) == (kind != "nothing")
    assert summary.status == whole.status
    assert [each.label for each in summary.findings] == [each.label for each in whole.findings]
    for live, span, finding in zip(summary.findings, whole.spans, whole.findings, strict=True):
        # The last frame of a whole run is flush with its end, which a stream does not know before.
        assert live.start == pytest.approx(span.start, abs=1e-6)
        assert span.stop - 0.1 - 1e-6 <= live.stop <= span.stop + 1e-6
        assert live.score == pytest.approx(span.score, abs=1e-6)
        assert 0.0 <= finding.start - live.start <= 0.41  # a frame
        assert -0.11 <= live.stop - finding.stop <= 0.41


@pytest.mark.parametrize("real", [955.0, 1045.0])
def test_findings_and_levels_have_their_times_at_any_true_rate(tmp_path, library, real):
    signals = motion(24.0, hum=(22.0, 22.8))
    signals["time"] = signals["time"] * RATE / real
    options = {"library": library, "keep_levels": True}
    _, _, summary = shown(tmp_path, signals, range(50, 24_000, 50), **options)
    (found,), levels = summary.findings, summary.levels
    assert (found.start, found.stop) == pytest.approx((22e3 / real, 22.8e3 / real), abs=0.45)
    hum = levels.time[levels.level[:, :, 1].max(axis=(1, 2)) > -30.0]
    assert (hum[0], hum[-1]) == pytest.approx((22e3 / real, 22.8e3 / real), abs=0.2)
    assert [levels.duration, summary.duration] == pytest.approx([24e3 / real] * 2, abs=2e-3)


def test_samples_that_are_left_out_leave_no_verdict_of_ok(tmp_path, library):
    signals = motion(3.0, hum=(9.0, 9.0))
    signals["time"][2000:] = 2.0  # the clock stands still
    _, _, summary = shown(tmp_path, signals, library=library)
    assert summary.status == "cannot-tell"
    assert summary.reason.startswith("more than 5% of the samples were left out (999 samples out")


def test_unknown_values_make_no_noise_and_no_label(tmp_path, library):
    signals = motion(2.0, hum=(9.0, 9.0))
    signals["velocity"][1000:1003, 1] = np.nan
    signals["velocity"][1500:1502, 0] = np.inf, 2.0**31
    path, warned, summary = shown(tmp_path, signals, library=library)
    assert warned == [
        "velocity or velocity_desired is not known at 1.000 s: such samples make no noise, frames"
        " with one have no label"
    ]
    assert summary.warnings == {"samples without noise": 5}
    _, noise = read(path, "/noise/simplified", "Scalars:scalars")
    assert np.isfinite(noise).all()
    centres, _ = read(path, "/score", "Scalars:scalars")
    np.testing.assert_allclose(centres, [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.3, 1.8], atol=1e-6)


def test_other_signals_than_at_first_are_warned_of_once_counted_and_not_labelled(tmp_path, library):
    whole, warned = motion(3.0), []
    with inspector.LiveSession(
        RATE, save=tmp_path / "live.rrd", library=library, on_warning=warned.append
    ) as session:
        session.push(**part(whole, slice(0, 1000)))
        for first in range(1000, 2000, 100):
            other = part(whole, slice(first, first + 100))
            del other["position"]
            other |= {"velocity": other["velocity"][:, :2], "base_pose": np.zeros((100, 7))}
            session.push(**other)
        session.push(**part(whole, slice(2000, 3000)))
    for name, now, first in (("base_pose", 7, 0), ("position", 0, 3), ("velocity", 2, 3)):
        assert session.summary.warnings[f"samples with another width of {name}"] == 1000
        line = f"{name} has {now} columns from 1.000 s on, and had {first} at first: not shown, and"
        assert sum(told.startswith(line) for told in warned) == 1
    assert session.summary.warnings["samples without noise"] == 1000
    assert sum(session.summary.labels.values()) == 14
    time, _ = read(tmp_path / "live.rrd", "/noise/simplified", "Scalars:scalars")
    assert not ((time >= 1.0) & (time < 2.0)).any()


def test_without_stamps_samples_follow_each_other(tmp_path, library):
    velocity = motion(1.0)["velocity"]
    with inspector.LiveSession(RATE, save=tmp_path / "live.rrd", library=library) as session:
        for row in velocity:
            session.push(velocity=row)
    time, _ = read(tmp_path / "live.rrd", "/noise/simplified", "Scalars:scalars")
    np.testing.assert_allclose(time, np.arange(1000) / RATE, atol=1e-9)


def test_a_rate_without_a_model_shows_noise_and_warns_that_there_are_no_labels(tmp_path, library):
    signals = {"velocity": np.ones((500, 2)), "time": np.arange(500) / 50.0}
    path, warned, summary = shown(tmp_path, signals, rate=50.0, library=library)
    assert warned == ["No labels: logged at 50 Hz, the model needs 80 Hz or more."]
    assert "no labels" in str(summary)
    assert "/noise/simplified" in entities(path)
    assert not any(each.startswith(("/class", "/score")) for each in entities(path))


def test_a_robot_is_not_drawn_without_positions_that_are_known(tmp_path, library):
    signals = {"velocity": np.zeros((100, 7)), "time": np.arange(100) / RATE}
    options = {"robot": "panda", "joint_names": PANDA, "library": library}
    path, warned, _ = shown(tmp_path, signals, **options)
    assert warned == ["no positions: the robot is not drawn"]
    assert "/noise/simplified" in entities(path)
    signals = motion(1.0, 7)
    signals["position"][:] = np.nan
    path, _, summary = shown(tmp_path, signals, **options)
    assert "/robot/motion" not in entities(path)
    assert sum(summary.labels.values()) == 7


def test_joints_are_named_by_the_robot_if_they_are_all_there(tmp_path, library):
    joints = nm.Robot.load("panda").joint_names
    signals = motion(0.2, len(joints))
    path, _, _ = shown(tmp_path, signals, robot="panda", library=library)
    _, (names,) = read(path, "/joints/velocity/0", "SeriesLines:names")
    assert tuple(names) == joints[:8]
    path.unlink()
    reason = "10 velocities, and panda has 9 joints: panda_joint1, .*--na"
    with pytest.raises(LiveError, match=reason):
        shown(tmp_path, motion(0.2, 10), robot="panda", library=library)
    reason = "no joint 'elbow' in robot 'panda'; it has panda_"
    with pytest.raises(UnknownJointError, match=reason):
        shown(tmp_path, motion(0.2, 1), robot="panda", joint_names=["elbow"], library=library)
    assert not list(tmp_path.iterdir())


def test_fingers_that_the_samples_lack_are_assumed_stationary(tmp_path, library):
    _, warned, summary = shown(tmp_path, motion(0.2, 7), robot="panda", library=library)
    (line,) = warned
    assert line.startswith("taken for panda_joint1, panda_joint2")
    assert "assumed stationary: panda_finger_joint1, panda_finger_joint2" in line
    assert summary.warnings == {"joints assumed stationary": 2}


def test_motion_far_beyond_the_limits_of_the_robot_is_said_once(tmp_path, library):
    signals = motion(3.0, 7)
    signals["velocity"] = signals["velocity"] * 0.0 + 40.0  # degrees per second
    options = {"robot": "panda", "joint_names": PANDA, "library": library}
    _, warned, _ = shown(tmp_path, signals, **options)
    assert warned == [
        "panda_joint1 reaches 40 rad/s, far beyond the 2.17 rad/s of panda (6 more joints too):"
        " another robot or unit?"
    ]


@pytest.mark.parametrize(
    ("sample", "reason"),
    [
        ({"velocity": np.zeros((2, 2, 2))}, r"velocity: shape \(2, 2, 2\), expected \(joints,\)"),
        ({"velocity": ["fast"]}, "velocity: holds no numbers"),
        (
            {"velocity": np.zeros((3, 2)), "position": np.zeros((2, 2))},
            "samples differ in number: 3 of velocity, 2 of position",
        ),
        ({"velocity": np.zeros(2), "time": [1.0, 2.0]}, r"time: shape \(2,\), expected \(1,\)"),
        ({"velocity": np.zeros(2), "base_pose": np.zeros(6)}, "base_pose: 6 columns .*expected 7"),
        ({"velocity": np.zeros(2), "position": np.zeros(3)}, "position: 3 columns in the first"),
    ],
)
def test_samples_that_are_none_are_refused(tmp_path, library, sample, reason):
    session = inspector.LiveSession(RATE, save=tmp_path / "live.rrd", library=library)
    with pytest.raises(LiveError, match=reason):
        session.push(**sample)
    session.close()
    assert list(tmp_path.iterdir()) == []


def test_a_session_ends_once_and_takes_nothing_then(tmp_path, library):
    session = inspector.LiveSession(RATE, save=tmp_path / "live.rrd", library=library)
    session.push(velocity=np.zeros((10, 2)))
    assert str(session.close()) == str(session.close())
    with pytest.raises(LiveError, match="the session is closed; begin another one"):
        session.push(velocity=np.zeros(2))
    with pytest.raises(LiveError, match="a rate of 0 Hz; expected 1 to 1000000"):
        inspector.LiveSession(0.0, save=tmp_path / "other.rrd", library=library)
