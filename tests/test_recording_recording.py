import dataclasses
import hashlib

import numpy as np
import pytest
from recordings import (
    BAND,
    LABELS,
    LINE,
    MESH,
    MOTION,
    POINTS,
    STRIP,
    check_columns,
    entities,
    layout,
    motion,
    panda,
    properties,
    read,
    settings,
    some_labels,
    stretches,
)
from rerun.chunk import RrdReader

from inspector import colors
from inspector.analysis import Analysis, Status, analyse_file
from inspector.errors import InspectorError
from inspector.levels import velocity_levels
from inspector.recording import run as recordings
from inspector.recording import views
from inspector.recording.panels import HEIGHT, NOISE_POINTS, scaled
from inspector.recording.run import height, write
from inspector.reference.judging import Scenario, compare
from inspector.reference.levels import levels as levels_of
from noiseclassifier import Event
from noisemodel import Block, Run


def panda_run(**changes):
    run = panda(rate=10_000)
    fields = {"velocity_desired": run.velocity, "meta": {"scenario": "made up", "seed": 1}}
    return dataclasses.replace(run, **(fields | changes))


def inspected(run, tmp_path, labels=None, **options) -> Analysis:
    path = tmp_path / "run.npz"
    run.save(path, overwrite=True)
    events = (Event("impact", 0.5, 1.0, 0.9),) if labels else ()
    found = analyse_file(path, {}, **options)
    status = Status.FINDINGS if events else found.status
    known = {"labels": labels, "alarm": None if labels is None else 0.25, "model": "a model"}
    return dataclasses.replace(found, status=status, findings=events, spans=events, **known)


LABELLED = some_labels(slice(5, 8))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    run = panda_run()
    found = inspected(run, folder, LABELLED, kind="paper")
    write(found, folder / "out.rrd")
    return folder / "out.rrd", run


# The components of each entity beside ``EVERY``.
COLUMNS = {
    r"/class/(found|annotated)/(ok|impact|oscillations)": BAND,
    r"/class/mark/impact": POINTS,
    r"/(noise|level|probability)/finding/impact": BAND,
    r"/strips/(joints/0[0-6]|links/0[0-7])": LINE,
    r"/score/(ok|impact|highaccelerations|oscillations)": LINE,
    r"/noise/simplified": LINE,
    r"/level/noise": LINE,
    r"/probability/(failure|alarm)": LINE,
    r"/power/total": LINE,
    r"/joints/(velocity|velocity_desired|position)/0": LINE,
    r"/detail/0/(noise|velocity)": LINE,
    r"/spectrogram/bands/\d\d": LINE,
    r"/axis/(class|noise|level|probability|spectrogram|joints|links)/(left|right)": LABELS,
    r"/axis/key/right": LABELS,
    r"/axis/(spectrogram|joints|links|key)/right/scale": STRIP,
    r"/robot/motion": MOTION,
    r"/robot/(_fixed|panda_.*)": MESH,
}


def test_every_entity_has_its_columns_and_there_is_no_other(whole):
    path, _ = whole
    check_columns(path, COLUMNS)
    (recording,) = RrdReader(path).recordings()
    assert recording.application_id == "inspector"
    assert len(RrdReader(path).blueprints()) == 1


def test_the_noise_is_logged_sample_by_sample_beside_its_level_and_drawn_by_extremes(whole):
    path, run = whole
    time, noise = read(path, "/noise/simplified", "Scalars:scalars")
    expected = np.sqrt(2 * (run.velocity**2).sum(axis=1))
    np.testing.assert_allclose(np.ravel(noise), expected, rtol=1e-12)
    np.testing.assert_allclose(time, run.time, atol=1e-9)
    _, policy = read(path, "/noise/simplified", "SeriesLines:aggregation_policy")
    assert policy == [[5]]  # MinMax: the default would hide vibration
    time, values = read(path, "/level/noise", "Scalars:scalars")
    starts, level = velocity_levels(run.velocity, run.mask, run.rate, together=True)
    np.testing.assert_allclose(time, starts, atol=1e-9)
    np.testing.assert_allclose(values, level, rtol=1e-9)


def test_rows_of_classes_last_as_long_as_what_was_found_and_annotated(whole):
    path, _ = whole
    np.testing.assert_allclose(stretches(path, "/class/found/impact"), [(0.5, 1.0)], atol=1e-6)
    ok = [(0.0, 0.5), (1.0, 2.9)]
    np.testing.assert_allclose(stretches(path, "/class/found/ok"), ok, atol=1e-6)
    blocks = {"ok": [(0.2, 1.0)], "oscillations": [(1.0, 1.5)]}
    for name, block in blocks.items():
        np.testing.assert_allclose(stretches(path, f"/class/annotated/{name}"), block, atol=1e-9)


@pytest.mark.parametrize("panel", ["noise", "level", "probability"])
def test_findings_are_shaded_from_onset_to_end_over_the_whole_panel(whole, panel):
    path, _ = whole
    entity = f"/{panel}/finding/impact"
    np.testing.assert_allclose(stretches(path, entity), [(0.5, 1.0)], atol=1e-6)
    _, values = read(path, entity, "Measurements:values")
    _, variances = read(path, entity, "Measurements:variances")
    half = np.sqrt(variances[0][0])
    low, high = ranges(path)[f"/{panel}"]
    assert (values[0][0] - half, values[0][0] + half) == (pytest.approx(low), pytest.approx(high))


def over_time(path):
    """Settings of the plots whose time axes are linked, by their origin."""
    views = {}
    for entity, name, value in layout(path):
        if entity.startswith("/view/"):
            views.setdefault(entity.split("/")[2], {})[name] = value
    return {
        view["ViewBlueprint:space_origin"][0]: view
        for view in views.values()
        if view["ViewBlueprint:class_identifier"] == ["TimeSeries"] and view["TimeAxis:link"] == [2]
    }


def ranges(path):
    """Lower and upper ends of the plots' axes that are set, by the plots' origin."""
    known = over_time(path).items()
    return {o: v["ScalarAxis:range"][0] for o, v in known if "ScalarAxis:range" in v}


def test_all_plots_over_time_reach_from_the_start_of_the_run_to_its_end(whole):
    path, run = whole
    time, values = read(path, "/span", "Scalars:scalars")
    np.testing.assert_allclose(time, run.time[[0, -1]], atol=1e-9)
    assert np.isnan(values).all()
    known = over_time(path)
    assert {"/class", "/noise", "/level", "/probability", "/spectrogram"} <= set(known)
    assert {"/strips/joints", "/strips/links", "/score", "/power"} <= set(known)
    assert all("/span" in v["ViewContents:query"] for v in known.values())


def test_left_edges_coincide_since_labels_of_axes_have_one_digit(whole):
    path, _ = whole
    first = ["/class", "/noise", "/level", "/probability", "/spectrogram", "/strips/joints"]
    for origin in first:
        low, high = ranges(path)[origin]
        assert low <= 0.0 <= high  # each has the label 0
        if origin != "/level":  # has no other in a panel of 200 points: it takes 20 to the next
            assert 1.0 <= high - low < 10.0
        else:
            assert 10.0 / (high - low) * 150.0 < 20.0


def test_the_noise_of_a_fast_robot_is_scaled_to_one_digit():
    assert scaled(np.array([0.0, 9.9])) == (1.0, "rad/s")
    assert scaled(np.array([0.0, 30.3, np.nan])) == (10.0, "10 rad/s")
    assert scaled(np.array([0.02])) == (0.01, "0.01 rad/s")
    assert scaled(np.zeros(3)) == (1.0, "rad/s")


def test_the_probability_of_a_failure_stands_beside_the_alarm_threshold(whole):
    path, run = whole
    time, values = read(path, "/probability/failure", "Scalars:scalars")
    np.testing.assert_allclose(time, LABELLED.start + 0.2, atol=1e-9)
    np.testing.assert_allclose(values, 0.3)
    time, values = read(path, "/probability/alarm", "Scalars:scalars")
    np.testing.assert_allclose(time, run.time[[0, -1]], atol=1e-9)
    np.testing.assert_allclose(values, 0.25)
    time, score = read(path, "/score/ok", "Scalars:scalars")
    np.testing.assert_allclose(time, LABELLED.start + 0.2, atol=1e-9)
    assert {value[0] for value in score} == {0.7}
    _, (labels,) = read(path, "/axis/probability/right", "Points2D:labels")
    assert labels == ["alarm 0.25"]


def shades(path, entity):
    """Times and colours, shape (times, 3), of the first line of a row."""
    time, colours = read(path, entity, "SeriesLines:colors")
    return time, np.array([[c >> 24, c >> 16 & 255, c >> 8 & 255] for c, *_ in colours])


def brightest(path, entity):
    """Greatest lightness of a row."""
    return (shades(path, entity)[1] @ [0.2126, 0.7152, 0.0722]).max()


def test_the_colours_of_a_row_change_where_the_joint_begins_to_vibrate(tmp_path):
    run = panda_run(robot=None, blocks=())
    velocity = 0 * run.velocity
    during = (run.time >= 1.0) & (run.time < 1.5)
    velocity[during, 4] = np.sin(2 * np.pi * 90.0 * run.time[during])
    write(inspected(dataclasses.replace(run, velocity=velocity), tmp_path), tmp_path / "o")
    time, rgb = shades(tmp_path / "o", "/strips/joints/04")
    loud = time[(rgb != colors.HEAT[0]).any(axis=1)]  # ends of segments
    assert loud.min() == pytest.approx(1.05, abs=0.051)
    assert loud.max() == pytest.approx(1.5, abs=0.051)
    for still in (0, 1, 2, 3, 5, 6):
        _, rgb = shades(tmp_path / "o", f"/strips/joints/{still:02d}")
        assert len(rgb) == 2  # one segment
        assert (rgb == colors.HEAT[0]).all()


def test_a_tone_of_a_joint_is_brightest_at_its_tick(tmp_path):
    """The noise is a norm, in which it has 600 Hz."""
    run = panda_run(robot=None, blocks=())
    velocity = 0.1 * np.sin(2 * np.pi * 300.0 * run.time)[:, None] * np.eye(7)[4]
    found = inspected(dataclasses.replace(run, velocity=velocity), tmp_path)
    write(found, path := tmp_path / "out.rrd")
    light = [brightest(path, f"/spectrogram/bands/{row:02d}") for row in range(48)]
    _, values = read(path, f"/spectrogram/bands/{np.argmax(light):02d}", "Scalars:scalars")
    place = values[0][0] / views.TOP
    _, (labels,) = read(path, "/axis/spectrogram/left", "Points2D:labels")
    _, (points,) = read(path, "/axis/spectrogram/left", "Points2D:positions")
    y = points[labels.index("300 Hz")][1]
    panel = views.Panel("spectrogram", HEIGHT)
    assert y == pytest.approx(panel.y(place), abs=0.02)
    assert labels[1:] == ["10 Hz", "30 Hz", "100 Hz", "300 Hz", "1 kHz", "3 kHz"]


def test_where_a_run_is_louder_than_its_reference_has_a_row_for_each_joint(tmp_path):
    run = panda_run(robot=None, blocks=())
    during = (run.time >= 1.0) & (run.time < 1.5)
    velocity = run.velocity.copy()
    velocity[during, 2] += 0.1 * np.sin(2 * np.pi * 35.0 * run.time[during])
    good = Scenario("a", (levels_of(run, name="a"),))
    beside = compare(levels_of(dataclasses.replace(run, velocity=velocity), name="a"), [good])
    write(inspected(run, tmp_path), tmp_path / "o", beside=beside)
    _, (names,) = read(tmp_path / "o", "/axis/over/left", "Points2D:labels")
    assert names == list(run.joint_names)
    time, band = read(tmp_path / "o", "/level/repetitions", "Scalars:scalars")
    _, noise = read(tmp_path / "o", "/level/noise", "Scalars:scalars")
    loud = [now for now, (own,), (_, high) in zip(time, noise, band, strict=True) if own > high + 1]
    assert 0.8 < loud[0] < loud[-1] < 1.8
    for row, name in enumerate(names):
        time, shown = shades(tmp_path / "o", f"/strips/over/{row:02d}")
        louder = {tuple(shade) for shade in shown} - {colors.SAME}
        assert bool(louder) == (name == run.joint_names[2])
        if louder:
            assert colors.AFTER in louder
            last = int(np.flatnonzero((shown == colors.AFTER).all(axis=1))[-1])
            assert 0.8 < time[last - 1] < 1.1  # a row is drawn where its colour changes
            assert 1.3 < time[last] < 1.7


def test_the_verdict_is_said_first_in_its_colour(whole, tmp_path, capfd):
    odd = panda_run(robot=None, blocks=(Block(0.1, 0.2, "my, label #1"),))
    write(inspected(odd, tmp_path), tmp_path / "o")  # without a model
    assert "Unescaped" not in "".join(capfd.readouterr())  # whatever words annotations have
    for path, told, shade in (
        (whole[0], "FAIL   1 impact", "findings"),
        (tmp_path / "o", "CANNOT TELL", "cannot-tell"),
    ):
        assert read(path, "/verdict/words", "Points2D:labels")[1] == [[told]]
        _, ((band,),) = read(path, "/verdict/band", "LineStrips2D:colors")
        assert band.to_bytes(4, "big")[:3] == bytes(colors.VERDICTS[shade])


def test_gaps_are_hatched_and_named_in_every_panel(tmp_path):
    run = panda_run(robot=None, blocks=())
    valid = np.ones(len(run.time), dtype=bool)
    valid[12_000:14_000] = False
    path = tmp_path / "out.rrd"
    write(inspected(dataclasses.replace(run, valid=valid), tmp_path, LABELLED), path)
    time, _ = read(path, "/noise/simplified", "Scalars:scalars")
    assert not ((time > 1.2) & (time < 1.3999)).any()
    for panel in ("class", "noise", "level", "probability", "spectrogram"):
        time, values = read(path, f"/{panel}/gap", "Scalars:scalars")
        strokes = np.ravel(values)[:-1]
        assert (time[0], time[-1]) == (pytest.approx(1.2), pytest.approx(1.4))
        assert len(set(strokes)) == 2  # up and down
        assert (np.diff(strokes) != 0).all()
    _, (names,) = read(path, "/axis/class/left", "Points2D:labels")
    assert names[-1] == "gap: no samples"
    _, (names,) = read(path, "/noise/gap", "SeriesLines:names")
    assert names == ["gap: no samples"]
    time, rgb = shades(path, "/spectrogram/bands/40")
    end = np.flatnonzero((rgb == colors.BACKGROUNDS[0]).all(axis=1))[-1]  # of a segment
    assert time[end] == pytest.approx(1.45, abs=0.03)
    assert time[end - 1] == pytest.approx(1.15, abs=0.03)


def test_details_hold_raw_samples_around_the_worst_moment(whole):
    path, run = whole
    time, noise = read(path, "/detail/0/noise", "Scalars:scalars")
    inside = (run.time >= time[0] - 1e-9) & (run.time <= time[-1] + 1e-9)
    assert 0.5 <= time.mean() <= 1.0  # where it rattles
    assert inside.sum() == len(time) == 5000
    expected = np.sqrt(2 * (run.velocity[inside] ** 2).sum(axis=1))
    np.testing.assert_allclose(np.ravel(noise), expected, rtol=1e-12)
    _, velocity = read(path, "/detail/0/velocity", "Scalars:scalars")
    _, (names,) = read(path, "/detail/0/velocity", "SeriesLines:names")
    columns = [run.joint_names.index(name) for name in names]
    np.testing.assert_allclose(velocity, run.velocity[inside][:, columns], rtol=1e-12)


def test_events_list_failures_by_time_and_the_worst_is_selected_and_looped(whole):
    path, _ = whole
    panel = settings(path, "TimePanelBlueprint:")
    assert panel["time_selection"] == [{"min": 500_000_000, "max": 1_000_000_000}]
    assert panel["loop_mode"] == [2]  # the selection
    time, text = read(path, "/events", "TextLog:text")
    _, level = read(path, "/events", "TextLog:level")
    assert time.tolist() == [0.5, 1.0]
    assert level == [["WARN"], ["INFO"]]
    assert text[0][0].startswith("found: impact 0.50 s to 1.00 s, panda_joint")
    assert text[1][0].startswith("not found: oscillations 1.00 s to 1.50 s, panda_joint")


def test_properties_name_the_run_and_its_hash(whole):
    path, run = whole
    found = properties(path)
    file = path.with_name("run.npz").read_bytes()
    assert found["input_sha256"] == [hashlib.sha256(file).hexdigest()]
    assert found["duration_s"] == [pytest.approx(run.duration)]
    told = {"robot": ["panda"], "rate_hz": [10_000.0], "joints": [7], "model": ["a model"]}
    assert found == found | told | {"link_noise": ["paper"]}


def test_the_robot_has_the_pose_of_its_joints(whole):
    path, run = whole
    time, poses = motion(path, "robot/panda_link1")
    angles = np.interp(time, run.time, run.position[:, 0])
    quaternion = poses[:, 3:]
    np.testing.assert_allclose(quaternion[:, 2], np.sin(angles / 2), atol=1e-5)
    assert len(time) == 150  # 50 frames per second


def test_a_floating_base_moves_in_the_world_and_links_made_of_boxes_are_coloured(tmp_path):
    run = one_legged(tmp_path)
    path = tmp_path / "out.rrd"
    write(inspected(run, tmp_path), path)
    _, poses = motion(path, "robot/thigh")
    np.testing.assert_allclose(poses[:, 0], 0.1 * run.time[::20], atol=1e-6)
    seconds, colours = read(path, "/robot/thigh", "Asset3D:albedo_factor")
    assert seconds is not None
    assert len({colour[0] for colour in colours}) > 1


def one_legged(folder, shape='<box size="0.1 0.1 0.4"/>'):
    """A base that moves along x, with a thigh that vibrates from 2 s on."""
    path = folder / "leg.urdf"
    path.write_text(
        f"""<robot name="leg"><link name="base"/><link name="thigh"><visual><geometry>
        {shape}</geometry></visual></link><joint name="HAA" type="revolute">
        <parent link="base"/><child link="thigh"/><axis xyz="1 0 0"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
    )
    time = np.arange(4000) / 1000
    pose = np.zeros((4000, 7))
    pose[:, 0], pose[:, 6] = 0.1 * time, 1.0
    velocity = (np.sin(2 * np.pi * 50 * time) * (time > 2))[:, None]
    base = {"base_pose": pose, "base_velocity": np.zeros((4000, 6))}
    joints = {"joint_names": ("HAA",), "velocity": velocity, "position": np.zeros((4000, 1))}
    return Run(time=time, robot=str(path), **joints, **base)


def test_the_report_states_what_was_found(whole):
    path, _ = whole
    _, (text,) = read(path, "/report", "TextDocument:text")
    assert "### findings: 1 impact" in text[0]
    assert "- **impact**, 0.50 s to 1.00 s, score 0.90: joints panda" in text[0]
    assert "scenario made up" in text[0]
    assert "- **oscillations**, 1.00 s to 1.50 s, not found: joints" in text[0]


def test_time_and_velocity_alone_still_show_noise_and_spectrogram_and_select_nothing(tmp_path):
    path = tmp_path / "out.rrd"
    np.savez(tmp_path / "bare.npz", time=np.arange(300) / 250, velocity=np.ones((300, 2)))
    write(analyse_file(tmp_path / "bare.npz", {}), path)
    found = entities(path)
    assert {"/noise/simplified", "/joints/velocity/0", "/detail/0/noise"} <= found
    assert {f"/spectrogram/bands/{band:02d}" for band in range(48)} <= found
    assert not any(entity.startswith(("/robot", "/class", "/events")) for entity in found)
    assert "time_selection" not in settings(path, "TimePanelBlueprint:")


@pytest.mark.parametrize(("samples", "rate"), [(2, 100), (8, 50_000), (30, 1000)])
def test_a_run_of_few_samples_is_shown_too(tmp_path, samples, rate):
    run = Run(
        time=np.arange(samples) / rate,
        velocity=np.ones((samples, 1)) * np.arange(samples)[:, None],
        joint_names=("a",),
    )
    write(inspected(run, tmp_path), tmp_path / "out.rrd")
    _, noise = read(tmp_path / "out.rrd", "/noise/simplified", "Scalars:scalars")
    unit = 10.0 ** np.floor(np.log10(samples - 1))
    np.testing.assert_allclose(np.ravel(noise) * unit, range(samples))


def test_a_long_run_has_no_more_points_than_a_short_one(tmp_path):
    time = np.arange(250_000) / 1000
    velocity = np.random.default_rng(0).normal(size=(250_000, 1))
    run = Run(time=time, velocity=velocity, joint_names=("a",))
    path = tmp_path / "out.rrd"
    write(inspected(run, tmp_path), path)
    _, values = read(path, "/noise/simplified", "Scalars:scalars")
    assert len(values) <= NOISE_POINTS
    assert max(values)[0] == pytest.approx(np.abs(velocity).max())


def test_the_same_input_makes_the_same_recording_id(whole, tmp_path):
    path, run = whole
    write(inspected(run, tmp_path), tmp_path / "again.rrd")
    ids = {RrdReader(each).recordings()[0].recording_id for each in (path, tmp_path / "again.rrd")}
    assert len(ids) == 1


def test_an_unreadable_mesh_is_named_and_the_run_can_be_shown_without(tmp_path):
    run = one_legged(tmp_path, '<mesh filename="gone.stl"/>')
    with pytest.raises(InspectorError, match="mesh gone.stl: not found.*--robot none"):
        inspected(run, tmp_path)
    write(inspected(run, tmp_path, links=False), tmp_path / "out.rrd")
    assert "/noise/simplified" in entities(tmp_path / "out.rrd")


def test_the_loudest_links_have_rows_and_the_power_is_beside_the_noise(whole):
    path, _ = whole
    assert len([each for each in entities(path) if each.startswith("/strips/links/")]) == 8
    time, level = read(path, "/power/total", "Scalars:scalars")
    assert len(time) == 300  # every 10 ms
    assert 60 < np.median(level) < 160
    # The scale is the same beside the robot and the links.
    _, (robot,) = read(path, "/axis/key/right", "Points2D:labels")
    _, (links,) = read(path, "/axis/links/right", "Points2D:labels")
    assert robot[:-1] == links[:-1]
    assert np.diff([float(tick) for tick in links[:-1]]).tolist() == [20.0, 20.0, 20.0]
    _, (robot,) = read(path, "/axis/key/right/scale", "LineStrips2D:colors")
    _, (links,) = read(path, "/axis/links/right/scale", "LineStrips2D:colors")
    assert robot == links


def test_a_recording_that_fails_halfway_leaves_nothing(tmp_path, monkeypatch):
    def break_off(*_):
        raise InspectorError("broken off")

    found = inspected(panda_run(robot=None), tmp_path)
    monkeypatch.setattr("inspector.recording.views.blueprint", break_off)
    with pytest.raises(InspectorError, match="broken off"):
        write(found, tmp_path / "out.rrd")
    assert {path.name for path in tmp_path.iterdir()} == {"run.npz"}


def test_the_text_is_as_high_as_the_paragraphs_that_fit():
    title, short = "### ok\n\n", "x" * 70
    one, two = height(title + short), height(f"{title}{short}\n\n{short}")
    assert two - one == recordings.PARAGRAPH
    assert height(f"{title}{short}\n{short}") - one == recordings.LINE
    assert height(title + 2 * short) - one == recordings.LINE
    assert height(f"{title}{short}\n\n{short * 30}") == one  # whose end would be below the edge
    assert height(title + f"{short}\n\n" * 20) <= recordings.TALLEST
