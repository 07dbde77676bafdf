import csv
import json
import sys
from itertools import islice

import numpy as np
import pyarrow.parquet
import pytest
from commandline import call
from mcap.reader import make_reader

from inspector.analysis.level import estimate
from inspector.assets import demo_run, model_files
from inspector.export import collect, export
from inspector.library import load_library
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
    assert table.schema.field("simplified").metadata == {b"unit": b"rad/s"}
    assert table.schema.metadata[b"model"] == b"general"


def test_the_frames_can_be_read_from_the_table(exported):
    folder, content = exported
    table = pyarrow.parquet.read_table(folder / "demo.parquet").to_pylist()
    frames = {row["frame_start"]: row for row in table if row["frame_start"] is not None}
    assert list(frames) == content.analysis.labels.start.tolist()
    rows = list(frames.values())
    assert [row["frame_stop"] for row in rows] == content.analysis.labels.stop.tolist()
    assert [row["label"] for row in rows] == content.analysis.labels.label.tolist()
    scores = [[row[f"score_{name}"] for name in content.analysis.labels.classes] for row in rows]
    np.testing.assert_array_equal(scores, content.analysis.labels.scores)


def test_a_sample_has_the_frame_whose_middle_is_nearest(exported):
    folder, _ = exported
    for row in pyarrow.parquet.read_table(folder / "demo.parquet").to_pylist()[::97]:
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
    for name in ("label", "annotated"):
        assert [row[name] or None for row in rows] == table[name].to_pylist()


def test_annotated_samples_are_those_inside_of_a_block(exported, demo):
    folder, _ = exported
    table = pyarrow.parquet.read_table(folder / "demo.parquet")
    labels = np.array(table["annotated"].to_pylist(), dtype=object)
    for block in demo.blocks:
        inside = (demo.time >= block.start) & (demo.time < block.stop)
        assert set(labels[inside]) == {block.label}
        labels[inside] = None
    assert set(labels) == {None}


def test_gaps_are_left_out(tmp_path):
    valid = np.ones(2000, dtype=bool)
    valid[1500:1510] = False
    run = plain_run(valid=valid)
    run = Run(
        time=run.time, velocity=run.velocity * valid[:, None], joint_names=("a",), valid=valid
    )
    export(run, tmp_path / "run.parquet", LIBRARY)
    table = pyarrow.parquet.read_table(tmp_path / "run.parquet")
    np.testing.assert_array_equal(table["time"].to_numpy(), run.time[valid])
    export(run, tmp_path / "run.mcap", LIBRARY)
    assert len(messages(tmp_path / "run.mcap", "/noise")) == 1990


def test_the_columns_of_csv_have_plain_names(tmp_path):
    export(plain_run(), tmp_path / "run.csv", LIBRARY)
    assert (tmp_path / "run.csv").read_text().startswith("time,simplified,frame_start,")


# --- MCAP


def test_mcap_has_a_summary_schemas_and_all_messages(exported, demo):
    folder, content = exported
    with (folder / "demo.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary.statistics.message_count == (
        len(demo.time)
        + len(content.analysis.labels)
        + len(content.analysis.findings)
        + len(demo.blocks)
    )
    assert {channel.message_encoding for channel in summary.channels.values()} == {"json"}
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]  # PlotJuggler takes no channel without
        assert schema.encoding == "jsonschema"
        assert json.loads(schema.data)["type"] == "object"


def test_mcap_holds_the_noise_to_the_bit(exported, demo):
    folder, content = exported
    stamps, noise = zip(*messages(folder / "demo.mcap", "/noise"), strict=True)
    assert [each["time"] for each in noise] == demo.time.tolist()
    assert [each["simplified"] for each in noise] == content.simplified.tolist()
    assert [each["extended"] for each in noise] == content.extended.tolist()
    np.testing.assert_allclose(np.array(stamps) * 1e-9, demo.time, atol=1e-9)


def test_mcap_holds_labels_scores_findings_and_annotations(exported, demo):
    folder, content = exported
    frames = [message for _, message in messages(folder / "demo.mcap", "/labels")]
    assert [frame["label"] for frame in frames] == content.analysis.labels.label.tolist()
    scores = [list(frame["scores"].values()) for frame in frames]
    assert scores == content.analysis.labels.scores.tolist()
    found = [message for _, message in messages(folder / "demo.mcap", "/findings")]
    assert [(e["label"], e["start"], e["stop"], e["score"]) for e in found] == [
        (e.label, e.start, e.stop, e.score) for e in content.analysis.findings
    ]
    annotated = [message for _, message in messages(folder / "demo.mcap", "/annotations")]
    assert [Block(**message) for message in annotated] == list(demo.blocks)


def test_messages_keep_their_schema(exported):
    folder, _ = exported
    with (folder / "demo.mcap").open("rb") as stream:
        for schema, _, message in islice(make_reader(stream).iter_messages(), 0, None, 50):
            assert json.loads(message.data).keys() == json.loads(schema.data)["properties"].keys()


def test_absolute_stamps_are_restored(tmp_path):
    run = plain_run(meta={"start": "1700000000.123456789"})
    export(run, tmp_path / "run.mcap", LIBRARY)
    stamps = [stamp for stamp, _ in messages(tmp_path / "run.mcap", "/noise")]
    assert stamps[:2] == [1_700_000_000_123_456_789, 1_700_000_000_124_456_789]


@pytest.mark.parametrize("start", ["soon", "-5", "nan", "1e400", None])
def test_an_invalid_start_is_ignored(tmp_path, start):
    export(plain_run(meta={"start": start}), tmp_path / "run.mcap", LIBRARY)
    assert messages(tmp_path / "run.mcap", "/noise")[0][0] == 0


def test_a_run_before_time_0_is_shifted(tmp_path):
    export(plain_run(start=-1.0), tmp_path / "run.mcap", LIBRARY)
    (first, noise), *_ = messages(tmp_path / "run.mcap", "/noise")
    assert (first, noise["time"]) == (0, -1.0)


# --- bad input


def test_bad_input_is_an_error_of_one_line_and_exit_3(tmp_path):
    (tmp_path / "there.csv").write_text("mine")
    for arguments, expected in [
        ([demo_run(), "-o", tmp_path / "run.bag"], "there are .mcap, .csv, .parquet"),
        ([demo_run(), "-o", tmp_path / "there.csv"], "exists already"),
        ([demo_run(), "-o", tmp_path / "no" / "run.csv"], "cannot be written"),
        ([demo_run(), "-o", tmp_path / "run.csv", "--kind", "loud"], "no kind 'loud' of noise"),
        ([tmp_path / "none.npz", "-o", tmp_path / "run.csv"], "cannot be read"),
    ]:
        status, out, err = call("export", *arguments)
        assert (status, out) == (3, "")
        assert expected in err
        assert len(err.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["there.csv"]
    assert (tmp_path / "there.csv").read_text() == "mine"


def test_a_missing_extra_is_an_error_and_leaves_no_file(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    plain_run().save(tmp_path / "run.npz")
    status, _, err = call("export", tmp_path / "run.npz", "-o", tmp_path / "run.mcap")
    assert status == 3
    assert "pip install 'noise-inspector[mcap]'" in err
    assert [path.name for path in tmp_path.iterdir()] == ["run.npz"]


def test_the_command_prints_what_it_wrote(tmp_path):
    plain_run().save(tmp_path / "run.npz")
    status, out, err = call("export", tmp_path / "run.npz", "-o", tmp_path / "run.parquet")
    assert (status, err) == (0, "")
    assert "No extended noise: that takes a robot and positions." in out
    assert "run.parquet: 2000 samples of noise, 17 frames" in out
