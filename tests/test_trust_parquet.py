"""Parquet files and LeRobot data sets that are hostile or odd are a run or one line."""

import json
from contextlib import suppress

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from inspector import read_log
from inspector.errors import LogError
from inspector.logs.options import ReadOptions
from inspector.logs.reading import listing

TIME = np.arange(400) / 100
SPEED = np.sin(TIME)
INFO = {"fps": 100, "features": {"observation.state": {"names": ["a", "b"]}}}
STATE = {
    "observation.state": pa.array([[float(each), float(each)] for each in SPEED]),
    "timestamp": TIME.astype(np.float32),
    "frame_index": np.arange(400),
    "episode_index": np.zeros(400, dtype=np.int64),
}


def data_set(folder, text, columns):
    for name in ("meta", "data"):
        (folder / name).mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(text)
    pq.write_table(pa.table(columns), folder / "data" / "a.parquet")
    return folder


def test_a_column_of_one_value_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    monkeypatch.setenv("NOISE_MAX_UNPACKED", "1000000")
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"time": np.zeros(10**6), "a.velocity": np.zeros(10**6)}), path)
    with pytest.raises(LogError, match=r"unpacks to 0.016 GB from 0.00\d+ MB, .*--max-unpacked"):
        read_log(path)


@pytest.mark.parametrize(
    ("index", "problem"),
    [
        (TIME, "'episode_index' holds double, expected whole numbers"),
        (["a"] * 400, "'episode_index' holds string, expected whole numbers"),
        (pa.array([None] * 400, pa.int64()), "'episode_index' has rows without a number"),
    ],
)
def test_episodes_have_whole_numbers(tmp_path, index, problem):
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"time": TIME, "a.velocity": SPEED, "episode_index": index}), path)
    for log in (path, data_set(tmp_path / "d", json.dumps(INFO), STATE | {"episode_index": index})):
        with pytest.raises(LogError, match=problem):
            read_log(log)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[" * 100_000, "cannot be read .nested too deeply"),
        (json.dumps(INFO | {"fps": 10**400}), "an integer of more than 20 digits"),
        (json.dumps(INFO | {"fps": "x"}), "fps is 'x', expected 0.001 to 1e"),
        (json.dumps(INFO | {"fps": [1]}), "fps is .1., expected"),
        (json.dumps(INFO | {"fps": float("nan")}), "fps is nan, expected"),
        (json.dumps(INFO | {"fps": 1e-320}), "fps is 1e-320, expected"),
        (json.dumps(INFO | {"features": {"action": 3}}), "the feature 'action' is no table"),
        (json.dumps(INFO | {"features": []}), "has no features"),
    ],
)
def test_an_info_file_that_is_hostile_is_one_line(tmp_path, text, problem):
    folder = data_set(tmp_path / "d", text, STATE)
    for read in (read_log, lambda path: listing(path, ReadOptions())):
        with pytest.raises(LogError, match=problem) as caught:
            read(folder)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("column", "values", "problem"),
    [
        ("timestamp", ["a"] * 400, "'timestamp' holds string, expected numbers"),
        ("timestamp", TIME * 1e30, "'timestamp' holds a value that is no time"),
        ("timestamp", TIME * np.nan, "'timestamp' holds a value that is no time"),
        ("frame_index", ["a"] * 400, "'frame_index' holds string, expected numbers"),
        ("frame_index", [[1]] * 400, ""),
    ],
)
def test_stamps_that_are_none_are_named(tmp_path, column, values, problem):
    folder = data_set(tmp_path / "d", json.dumps(INFO), STATE | {column: values})
    with suppress(LogError) if not problem else pytest.raises(LogError, match=problem):
        read_log(folder)


def test_a_data_set_without_episodes_is_one_line(tmp_path):
    columns = {name: each for name, each in STATE.items() if name != "episode_index"}
    with pytest.raises(LogError, match="there is no column 'episode_index'; it has observation"):
        read_log(data_set(tmp_path / "d", json.dumps(INFO), columns))


def test_names_of_half_a_surrogate_pair_are_one_line(tmp_path):
    text = '{"fps": 100, "features": {"observation.state": {"names": ["\\ud800", "b"]}}}'
    with pytest.raises(ValueError, match=r"is no name") as caught:
        read_log(data_set(tmp_path / "d", text, STATE))
    assert str(caught.value).isprintable()
