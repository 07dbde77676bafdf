import hashlib
import re
from dataclasses import replace

import numpy as np
import pytest
import recordings
from commandline import call, printed
from recordings import (
    BAND,
    LABELS,
    LINE,
    MESH,
    MOTION,
    STRIP,
    check_columns,
    entities,
    layout,
    properties,
    read,
    settings,
    some_labels,
    stretches,
)
from rerun.chunk import RrdReader
from test_pair_pair import compared

from inspector import colors
from inspector.compare import write
from inspector.levels import LINKS as LINK_SCALE
from inspector.levels import link_levels
from inspector.recording import panels
from noiseclassifier import Event
from noisemodel import Run


def panda(scale=1.0, **changes):
    run = recordings.panda(scale)
    desired = scale * np.cos(2 * np.pi * np.linspace(0.2, 0.5, 7) * run.time[:, None])
    fields = {"velocity_desired": desired, "effort": run.velocity}
    return replace(run, **(fields | {"stages": {"planned": run.velocity}} | changes))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    pair = compared(folder, panda(), panda(2.0))
    events = (Event("impact", 0.5, 1.0, 0.9),)
    after = replace(
        pair.after, labels=some_labels(slice(5, 8)), findings=events, spans=events, model="a model"
    )
    before = replace(pair.before, labels=some_labels(slice(0)), model="a model")
    pair = replace(pair, before=before, after=after)
    write(pair, folder / "out.rrd")
    return folder / "out.rrd", pair


def scalars(path, entity):
    time, values = read(path, entity, "Scalars:scalars")
    return time, np.array(values)


SIGNALS = "velocity|desired_velocity|position|effort|stage_planned"
# The components of each entity beside ``EVERY``.
COLUMNS = {
    r"/class/(before|after)/(found|annotated)/(impact|oscillations)": BAND,
    r"/(level/change|change/finding)/new": BAND,
    r"/(noise|level)/(before|after)": LINE,
    r"/change/(noise|none)": LINE,
    rf"/joints/({SIGNALS})/(before|after)/0": LINE,
    r"/spectrogram/(before|after|change)/\d\d": LINE,
    r"/robot_(before|after)/motion": MOTION,
    r"/robot_(before|after)/(_fixed|panda_.*)": MESH,
    r"/axis/\w+/(left|right)": LABELS,
    r"/axis/\w+/right/scale": STRIP,
}


def test_every_entity_has_its_columns_and_there_is_no_other(whole):
    path, _ = whole
    check_columns(path, COLUMNS)


def test_both_noises_lie_over_each_other_in_two_colours_and_twice_is_6_db(whole):
    path, pair = whole
    for name, side, color in (
        ("before", pair.before, colors.BEFORE),
        ("after", pair.after, colors.AFTER),
    ):
        time, noise = scalars(path, f"/noise/{name}")
        scale = side.noise[5] / noise[5, 0]
        np.testing.assert_allclose(scale * noise[:, 0], side.noise, rtol=1e-12)
        np.testing.assert_allclose(time, pair.time, atol=1e-9)
        _, drawn = read(path, f"/noise/{name}", "SeriesLines:colors")
        assert drawn == [[int.from_bytes([*color, 255], "big")]]
    time, change = scalars(path, "/change/noise")
    rattling = (time > 0.55) & (time < 0.95)
    np.testing.assert_allclose(change[rattling], 20 * np.log10(2), rtol=1e-9)


def test_joints_of_both_lie_over_each_other(whole):
    path, pair = whole
    _, before = scalars(path, "/joints/velocity/before/0")
    _, after = scalars(path, "/joints/velocity/after/0")
    np.testing.assert_allclose(after, 2 * before, atol=1e-12)
    assert len(after) <= 2000
    _, (names,) = read(path, "/joints/velocity/before/0", "SeriesLines:names")
    assert names == [f"{joint} before" for joint in pair.before.run.joint_names]


def test_rows_show_the_classes_of_both_and_plots_what_changed(whole):
    path, _ = whole
    assert stretches(path, "/class/after/found/impact") == [[0.5, 1.0]]
    assert stretches(path, "/class/after/annotated/oscillations") == [[1.0, 1.5]]
    assert stretches(path, "/class/before/annotated/oscillations") == [[1.0, 1.5]]
    assert not [entity for entity in entities(path) if entity.startswith("/class/before/found")]
    assert stretches(path, "/level/change/new") == [[0.5, 1.0]]
    _, (labels,) = read(path, "/axis/class/left", "Points2D:labels")
    assert labels == ["impact", "oscillations"]


def test_changes_are_listed_and_the_new_one_is_looped(whole):
    path, _ = whole
    time, text = read(path, "/events", "TextLog:text")
    assert time.tolist() == [0.5]
    assert text == [["new: impact, 0.50 s to 1.00 s, +6.0 dB"]]
    assert read(path, "/events", "TextLog:level")[1] == [["WARN"]]
    selection = settings(path, "TimePanelBlueprint:")["time_selection"]
    assert selection == [{"min": 500_000_000, "max": 1_000_000_000}]


def test_both_spectrograms_have_one_scale_and_the_difference_its_own(whole):
    path, _ = whole
    _, before = read(path, "/spectrogram/before/28", "SeriesLines:colors")
    _, after = read(path, "/spectrogram/after/28", "SeriesLines:colors")
    assert max(sum(row[0].to_bytes(4, "big")[:3]) for row in after) > max(
        sum(row[0].to_bytes(4, "big")[:3]) for row in before
    )
    shade = panels.CHANGE.colours(np.array(20 * np.log10(2)), shades=25)
    named = {
        read(path, row, "SeriesLines:names")[1][0][0]: row
        for row in entities(path)
        if row.startswith("/spectrogram/change/")
    }
    row = min(named, key=lambda name: abs(float(name.removesuffix(" Hz")) - 120.0))
    _, change = read(path, named[row], "SeriesLines:colors")
    assert bytes(shade) in [each[0].to_bytes(4, "big") for each in change]


def test_both_robots_are_seen_from_one_place_and_coloured_by_one_scale_of_levels(whole):
    path, pair = whole
    eyes = [value for _, name, value in layout(path) if name == "EyeControls3D:position"]
    assert len(eyes) == 2
    assert eyes[0] == eyes[1]
    every = [link_levels(noise)[1] for noise in pair.links]
    scale = LINK_SCALE.following(np.concatenate(every))
    for side, noise in zip(("before", "after"), pair.links, strict=True):
        mesh = f"/robot_{side}/panda_link5"
        time, rgba = read(path, mesh, "Asset3D:albedo_factor")
        steps, level = link_levels(noise)
        column = int(np.searchsorted(steps, 0.7, side="right")) - 1
        wanted = scale.colours(level[column, noise.links.index("panda_link5")], shades=16)
        at = int(np.searchsorted(time, 0.7, side="right")) - 1
        assert rgba[at][0].to_bytes(4, "big") == bytes(wanted)
        base = f"/robot_{side}/_fixed"
        time, (still,) = read(path, base, "Asset3D:albedo_factor")
        assert time is None
        assert still[0].to_bytes(4, "big") == bytes(scale.colours(np.array(-np.inf)))


def test_colours_distinguish_louder_from_quieter_and_grow_with_the_change():
    levels = np.array([-12.0, 0.0, 3.0, 40.0])
    quieter, same, louder, much = panels.CHANGE.colours(levels, shades=25)[:, :3]
    assert tuple(quieter) == colors.BEFORE
    assert tuple(same) == colors.SAME
    assert tuple(much) == colors.AFTER
    assert same[0] < louder[0] < much[0]


def test_the_report_states_what_changed(whole):
    path, _ = whole
    _, (text,) = read(path, "/report", "TextDocument:text")
    assert text[0].startswith("### before → after\n")
    assert "cannot-tell → cannot-tell; findings: 1 new; vibration +6.0 dB" in text[0]
    row = r"\| \*\*new\*\* \| impact \| 0.50 to 1.00 \| -\d+\.\d \| -\d+\.\d \| \+6.0 \|"
    assert re.search(row, text[0])
    assert re.search(r"Largest change of level: \*\*\+6 dB at \d\.\d\d s\*\*\.", text[0])


def test_properties_name_both_runs_and_their_hashes(whole):
    path, _ = whole
    found = properties(path)
    for name in ("before", "after"):
        file = path.with_name(f"{name}.npz").read_bytes()
        assert found[f"{name}_sha256"] == [hashlib.sha256(file).hexdigest()]
    assert found["aligned"] == ["auto"]
    assert found["lag_s"] == [0.0]
    assert found["rate_hz"] == [5000.0]
    assert found["duration_s"] == [3.0]
    assert found["vibration_change_db"] == [pytest.approx(20 * np.log10(2))]


def test_a_run_beside_itself_changes_nothing_that_is_drawn(tmp_path):
    write(compared(tmp_path, panda(), panda()), tmp_path / "out.rrd")
    path = tmp_path / "out.rrd"
    assert not scalars(path, "/change/noise")[1].any()
    rgba = read(path, "/spectrogram/change/**", "SeriesLines:colors")[1]
    assert {row[0] for row in rgba} == {int.from_bytes([*colors.SAME, 255], "big")}
    assert [e for e in entities(path) if e.startswith("/level/change/")] == [
        "/level/change/unchanged"
    ]
    _, (text,) = read(path, "/report", "TextDocument:text")
    assert "The level is the same at all times." in text[0]


def test_the_same_two_runs_make_the_same_recording_id_and_others_do_not(tmp_path):
    ids, path = [], tmp_path / "out.rrd"
    for before, after in ((1.0, 2.0), (1.0, 2.0), (2.0, 1.0)):
        pair = compared(tmp_path, panda(before), panda(after), robot=False)
        write(pair, path, overwrite=True)
        ids.append(RrdReader(path).recordings()[0].recording_id)
    assert ids[0] == ids[1] != ids[2]


@pytest.mark.parametrize("samples", [2, 9, 60])
def test_runs_of_few_samples_are_compared_too(tmp_path, samples):
    run = Run(
        time=np.arange(samples) / 1000,
        velocity=np.arange(samples)[:, None] * np.ones((1, 2)),
        joint_names=("a", "b"),
    )
    write(compared(tmp_path, run, run), tmp_path / "out.rrd")
    assert scalars(tmp_path / "out.rrd", "/noise/after")[1].shape == (samples, 1)
    assert read(tmp_path / "out.rrd", "/verdict/words", "Points2D:labels")[1] == [["CANNOT TELL"]]


def test_different_joints_are_shown_each(tmp_path):
    time = np.arange(3000) / 1000
    runs = [
        Run(time=time, velocity=np.sin(9 * time)[:, None] * np.ones(2), joint_names=names)
        for names in (("a", "b"), ("b", "c"))
    ]
    write(compared(tmp_path, *runs), tmp_path / "out.rrd")
    named = {
        what: read(tmp_path / "out.rrd", f"/joints/velocity/{what}/0", "SeriesLines:names")[1][0]
        for what in ("before", "after")
    }
    assert named == {"before": ["b before", "a before"], "after": ["b after", "c after"]}
    assert not any(entity.startswith("/robot") for entity in entities(tmp_path / "out.rrd"))


def test_the_command_shows_two_runs_and_prints_how_they_were_aligned(tmp_path):
    panda(robot=None).save(tmp_path / "a.npz")
    panda(2.0, robot=None).save(tmp_path / "b.npz")
    save = ("-o", tmp_path / "ab.rrd")
    runs = (tmp_path / "a.npz", tmp_path / "b.npz")
    out = printed("view", *runs, *save)
    assert "vibration +6.0 dB" in out
    assert "aligned by the motion: after starts +0.0000 s from before (correlation 1.00" in out
    assert "/class/after/annotated/oscillations" in entities(tmp_path / "ab.rrd")
    status, out, _ = call("view", *runs, *save, "--align", "start", "--overwrite")
    assert (status, "aligned from the start, as requested" in out) == (0, True)
