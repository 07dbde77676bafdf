import csv
import json
import sys
from dataclasses import replace

import numpy as np
import pyarrow.parquet
import pytest
from commandline import printed, refused
from mcap.reader import make_reader

from inspector.analysis import estimate
from inspector.export import collect, export
from inspector.library import demo_run, load_library, model_files
from noisemodel import Block, Run, simplified

LIBRARY = load_library(model_files())


@pytest.fixture(scope="module")
def demo():
    return Run.load(demo_run())


@pytest.fixture(scope="module")
def exported(demo, tmp_path_factory):
    """The demo in all formats, and what was to be written."""
    folder = tmp_path_factory.mktemp("export")
    for suffix in ("mcap", "csv", "parquet"):
        content = export(demo, folder / f"demo.{suffix}", LIBRARY)
    return folder, content


def plain_run(seconds=2.0, rate=1000.0, start=0.0, **fields):
    time = start + np.arange(round(seconds * rate)) / rate
    velocity = 0.3 * np.cos(time)[:, None]
    return Run(time=time, velocity=velocity, joint_names=("elbow",), **fields)


def messages(path, topic):
    with path.open("rb") as stream:
        found = make_reader(stream, validate_crcs=True).iter_messages(topics=[topic])
        return [(message.log_time, json.loads(message.data)) for _, _, message in found]


# --- what is exported


def test_the_noise_is_that_of_the_other_commands(demo):
    content = collect(demo, LIBRARY, kind="C")
    np.testing.assert_array_equal(
        content.simplified, simplified(demo.motion, demo.velocity_desired)
    )
    np.testing.assert_array_equal(content.extended, estimate(demo, "C").power.sum(axis=1))
    assert content.analysis.model == "general"
    assert {event.label for event in content.analysis.findings} >= {"impact"}
    assert content.remarks == ()


def test_what_is_missing_is_a_remark():
    content = collect(plain_run(rate=50.0), LIBRARY)
    assert content.analysis.labels is None
    assert content.extended is None
    no_labels, no_robot = content.remarks
    assert "50 Hz" in no_labels
    assert "takes a robot and positions" in no_robot
    assert str(content) == "100 samples of noise, 0 frames, 0 findings, 0 annotated blocks"


# --- tables


def test_parquet_holds_every_number_to_the_bit(exported, demo):
    folder, content = exported
    table = pyarrow.parquet.read_table(folder / "demo.parquet")
    np.testing.assert_array_equal(table["time"].to_numpy(), demo.time)
    np.testing.assert_array_equal(table["simplified"].to_numpy(), content.simplified)
    np.testing.assert_array_equal(table["extended"].to_numpy(), content.extended)
    (event,) = content.analysis.findings
    inside = (demo.time >= event.start) & (demo.time < event.stop)
    assert table["finding"].to_pylist() == [event.label if each else None for each in inside]
    assert table.schema.field("simplified").metadata == {b"unit": b"rad/s"}
    assert table.schema.metadata[b"model"] == b"general"


def test_a_sample_has_the_frame_whose_middle_is_nearest(exported):
    folder, content = exported
    labels = content.analysis.labels
    table = pyarrow.parquet.read_table(folder / "demo.parquet").to_pylist()
    frames = {row["frame_start"]: row for row in table if row["frame_start"] is not None}
    assert list(frames) == labels.start.tolist()
    rows = list(frames.values())
    assert [row["frame_stop"] for row in rows] == labels.stop.tolist()
    assert [row["label"] for row in rows] == labels.debounced.tolist()
    scores = [[row[f"score_{name}"] for name in labels.classes] for row in rows]
    np.testing.assert_array_equal(scores, labels.scores)
    for row in table[::97]:
        if row["frame_start"] is None:
            assert not 0.2 <= row["time"] <= 3.8
        else:
            middle = (row["frame_start"] + row["frame_stop"]) / 2
            assert abs(row["time"] - middle) <= 0.05 + 1e-9


def test_csv_has_the_values_of_parquet(exported):
    folder, _ = exported
    table = pyarrow.parquet.read_table(folder / "demo.parquet")
    with (folder / "demo.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == table.column_names
    for name in ("time", "simplified", "extended"):
        assert [float(row[name]) for row in rows] == table[name].to_pylist()
    for name in ("label", "annotated", "finding"):
        assert [row[name] or None for row in rows] == table[name].to_pylist()


def test_gaps_are_left_out(tmp_path):
    valid = np.ones(2000, dtype=bool)
    valid[900:1100] = False
    run = plain_run()
    run = replace(run, velocity=run.velocity * valid[:, None], valid=valid)
    export(run, tmp_path / "run.parquet", LIBRARY)
    table = pyarrow.parquet.read_table(tmp_path / "run.parquet")
    np.testing.assert_array_equal(table["time"].to_numpy(), run.time[valid])
    export(run, tmp_path / "run.mcap", LIBRARY)
    assert len(messages(tmp_path / "run.mcap", "/noise")) == 1800


# --- MCAP


def test_mcap_has_a_summary_schemas_and_all_messages(exported, demo):
    folder, content = exported
    with (folder / "demo.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    count = {
        channel.topic: summary.statistics.channel_message_counts[key]
        for key, channel in summary.channels.items()
    }
    assert count == {
        "/joint_states": len(demo.time),
        "/joint_states/desired": len(demo.time),
        "/noise": len(demo.time),
        "/level": round(demo.duration / 0.05),
        "/labels": len(content.analysis.labels),
        "/findings": len(content.analysis.findings),
        "/annotations": len(demo.blocks),
    }
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]  # PlotJuggler takes no channel without
        if channel.message_encoding == "json":
            assert schema.encoding == "jsonschema"
            assert json.loads(schema.data)["type"] == "object"
        else:
            assert (channel.message_encoding, schema.encoding) == ("cdr", "ros2msg")
            assert schema.name == "sensor_msgs/msg/JointState"


@pytest.mark.slow
def test_an_exported_run_is_imported_again_to_the_bit(exported, demo, tmp_path):
    folder, _ = exported
    out = printed("import", folder / "demo.mcap", "-o", tmp_path / "back.npz", "--robot", "panda")
    assert "damaged" not in out
    back = Run.load(tmp_path / "back.npz")
    assert back.joint_names == demo.joint_names
    for name in ("position", "velocity", "velocity_desired", "mask"):
        np.testing.assert_array_equal(getattr(back, name), getattr(demo, name))


def test_mcap_holds_levels_where_they_are_known(exported, tmp_path):
    folder, content = exported
    path = folder / "demo.mcap"
    stamps, found = zip(*messages(path, "/level"), strict=True)
    start, level = content.analysis.vibration_level
    assert [each["level"] for each in found] == level[:, 0].tolist()
    np.testing.assert_allclose(np.array(stamps) * 1e-9, start, atol=1e-9)
    run = plain_run()
    export(replace(run, valid=run.time > 0.5), tmp_path / "run.mcap", LIBRARY)
    assert min(stamp for stamp, _ in messages(tmp_path / "run.mcap", "/level")) >= 0.5e9


def test_mcap_holds_labels_scores_findings_and_annotations(exported, demo):
    folder, content = exported
    frames = [message for _, message in messages(folder / "demo.mcap", "/labels")]
    assert [frame["label"] for frame in frames] == content.analysis.labels.debounced.tolist()
    assert {frame["alarm"] for frame in frames} == {content.analysis.alarm}
    scores = [list(frame["scores"].values()) for frame in frames]
    assert scores == content.analysis.labels.scores.tolist()
    found = [message for _, message in messages(folder / "demo.mcap", "/findings")]
    assert [(e["label"], e["start"], e["stop"], e["score"]) for e in found] == [
        (e.label, e.start, e.stop, e.score) for e in content.analysis.findings
    ]
    annotated = [message for _, message in messages(folder / "demo.mcap", "/annotations")]
    assert [Block(**message) for message in annotated] == list(demo.blocks)


@pytest.mark.parametrize(
    ("changes", "stamps"),
    [
        ({"meta": {"start": "1700000000.123456789"}}, [1700000000123456789, 1700000000124456789]),
        ({"start": -1.0}, [0, 1_000_000]),
    ],
)
def test_stamps_are_absolute_and_a_run_before_time_0_is_shifted(tmp_path, changes, stamps):
    run = plain_run(**changes)
    export(run, tmp_path / "run.mcap", LIBRARY)
    found = messages(tmp_path / "run.mcap", "/noise")
    assert [stamp for stamp, _ in found[:2]] == stamps
    assert found[0][1]["time"] == run.time[0]


# --- bad input


def test_what_cannot_be_exported_is_an_error_of_one_line(tmp_path):
    (tmp_path / "there.csv").write_text("mine")
    for arguments, expected, code in [
        ([demo_run(), "-o", tmp_path / "run.bag"], "there are .mcap, .csv, .parquet", 2),
        ([demo_run(), "-o", tmp_path / "there.csv"], "exists already", 3),
        ([demo_run(), "-o", tmp_path / "no" / "run.csv"], "cannot be written", 5),
        ([demo_run(), "-o", tmp_path / "run.csv", "--kind", "loud"], "no kind 'loud' of noise", 2),
        ([tmp_path / "none.npz", "-o", tmp_path / "run.csv"], "cannot be read", 3),
    ]:
        assert expected in refused("export", *arguments, status=code)
    assert [path.name for path in tmp_path.iterdir()] == ["there.csv"]
    assert (tmp_path / "there.csv").read_text() == "mine"


def test_a_missing_extra_is_an_error_and_other_formats_are_written(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    plain_run().save(tmp_path / "run.npz")
    err = refused("export", tmp_path / "run.npz", "-o", tmp_path / "run.mcap")
    assert "pip install 'noise-inspector[mcap]'" in err
    assert [path.name for path in tmp_path.iterdir()] == ["run.npz"]
    out = printed("export", tmp_path / "run.npz", "-o", tmp_path / "run.parquet")
    assert "No extended noise: that takes a robot and positions." in out
    assert "run.parquet: 2000 samples of noise, 17 frames" in out
