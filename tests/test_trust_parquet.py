"""Parquet files and LeRobot data sets that are hostile or odd are a run or one line."""

import json
import os
from contextlib import suppress

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from inspector import read_log
from inspector.errors import InspectorError, LogError
from inspector.logs.mapping import ReadOptions
from inspector.logs.parquet import unpacked_size
from inspector.logs.read import listing

TIME = np.arange(400) / 100
SPEED = np.sin(TIME)
INFO = {"fps": 100, "features": {"observation.state": {"names": ["a", "b"]}}}
STATE = {
    "observation.state": pa.array([[float(each), float(each)] for each in SPEED]),
    "timestamp": TIME.astype(np.float32),
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
        (pa.array([None] * 400, pa.int64()), "'episode_index' holds int64, expected whole numbers"),
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
        ("{", "cannot be read"),
        ("[]", "has no table of features"),
        (json.dumps(INFO | {"fps": 10**400}), "an integer of more than 20 digits"),
        (json.dumps(INFO | {"fps": "x"}), "fps is 'x', expected 0.001 to 1e"),
        (json.dumps(INFO | {"fps": [1]}), "fps is .1., expected"),
        (json.dumps(INFO | {"fps": float("nan")}), "fps is nan, expected"),
        (json.dumps(INFO | {"fps": 1e-320}), "fps is 1e-320, expected"),
        (json.dumps(INFO | {"features": {"action": 3}}), "has no table of features"),
        (json.dumps(INFO | {"features": []}), "has no table of features"),
    ],
)
def test_an_info_file_that_is_hostile_is_one_line(tmp_path, text, problem):
    folder = data_set(tmp_path / "d", text, STATE)
    for read in (read_log, lambda path: listing(path, ReadOptions())):
        with pytest.raises(LogError, match=problem) as caught:
            read(folder)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        (["a"] * 400, "'timestamp' holds object of shape .400,.; expected two stamps or more"),
        ([[1]] * 400, "'timestamp' holds object of shape .400,.; expected two stamps or more"),
        (TIME * 1e30, "the stamps' median step is 1e.19 s, expected"),
        (TIME * np.nan, "column 'timestamp' holds nan .sample 1."),
    ],
)
def test_stamps_that_are_none_are_named(tmp_path, values, problem):
    folder = data_set(tmp_path / "d", json.dumps(INFO), STATE | {"timestamp": values})
    with pytest.raises(InspectorError, match=problem):
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


def varint(number, size=0):
    """A number as Thrift has it, in zigzag; in as many bytes as are asked for."""
    number, found = number << 1, []
    while number > 127 or len(found) < size - 1:
        found.append(number & 127 | 128)
        number >>= 7
    return bytes([*found, number])


@pytest.mark.parametrize("checksum", [False, True])
def test_a_page_that_is_larger_than_the_file_states_is_not_unpacked(
    tmp_path, monkeypatch, checksum
):
    monkeypatch.setenv("NOISE_MAX_UNPACKED", "4000000")
    path, rows = tmp_path / "a.parquet", 1_000_000
    how = {"compression": "ZSTD", "use_dictionary": False, "data_page_size": 2**30}
    more = {"max_rows_per_page": rows, "write_page_checksum": checksum}
    pq.write_table(pa.table({"position": np.zeros(rows)}), path, **how, **more)
    column = pq.read_metadata(path).row_group(0).column(0)
    data = path.read_bytes()
    end = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
    tail = data[end:]
    for true, lie in ((rows, 400), (column.total_uncompressed_size, 3200)):
        there = varint(true)
        tail = tail.replace(there, varint(lie, len(there)))
    path.write_bytes(data[:end] + tail)
    assert pq.read_metadata(path).row_group(0).column(0).num_values == 400
    with pytest.raises(LogError, match=r"unpacks to 0.008 GB from .* MB, the limit is 0.004 GB"):
        read_log(path, rate=100.0)


@pytest.mark.parametrize("compression", ["NONE", "SNAPPY", "ZSTD", "GZIP", "LZ4"])
@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_pages_are_as_large_as_an_honest_file_states(tmp_path, compression, version):
    path, rows = tmp_path / "a.parquet", 50_000
    table = pa.table({"position": np.random.default_rng(0).random(rows), "b": np.arange(rows) % 5})
    how = {"compression": compression, "data_page_version": version, "write_page_checksum": True}
    pq.write_table(table, path, row_group_size=20_000, **how)
    about = pq.read_metadata(path)
    groups = [about.row_group(number) for number in range(about.num_row_groups)]
    parts = [group.column(place) for group in groups for place in range(2)]
    stated = sum(max(part.total_uncompressed_size, 8 * part.num_values) for part in parts)
    assert unpacked_size(path, ["position", "b"])[0] == stated
    assert 0 < unpacked_size(path, ["b"])[0] < stated
    assert unpacked_size(path, ["c"]) == (0, 0)


def test_a_table_of_columns_that_ends_the_process_of_pyarrow_is_damage(tmp_path):
    path = tmp_path / "a.parquet"
    lists = pa.array([[float(each)] for each in SPEED])
    pq.write_table(pa.table({"position": lists, "velocity": lists}), path)
    data = path.read_bytes()
    end = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
    for place in range(end, end + 100):
        path.write_bytes(data[:place] + bytes((data[place] ^ 4,)) + data[place + 1 :])
        with suppress(LogError):
            read_log(path, rate=100.0)


@pytest.mark.parametrize("damage", [b"\0", b"\xff", b"\x1c", b"\x15\x00\x15\x01"])
def test_pages_without_headers_are_damage(tmp_path, damage):
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"position": SPEED}), path)
    data = path.read_bytes()
    start = pq.read_metadata(path).row_group(0).column(0).dictionary_page_offset
    path.write_bytes(data[:start] + damage * (1000 // len(damage)) + data[start + 1000 :])
    with pytest.raises(LogError, match="damaged or cut off"):
        read_log(path, rate=100.0)


def test_a_pipe_among_the_files_of_a_data_set_is_one_line(tmp_path):
    folder = data_set(tmp_path / "d", json.dumps(INFO), STATE)
    os.mkfifo(folder / "data" / "more.parquet")
    with pytest.raises(LogError, match=r"more\.parquet: is no regular file"):
        read_log(folder)


def test_lists_of_more_numbers_than_joints_are_counted_before_they_are_unpacked(tmp_path):
    path = tmp_path / "a.parquet"
    wide = pa.FixedSizeListArray.from_arrays(pa.array(np.zeros(400_000)), 200_000)
    pq.write_table(pa.table({"time": [0.0, 0.01], "position": wide}), path)
    with pytest.raises(LogError, match=r"lists of 20000\d numbers in a row, .*columns"):
        read_log(path)
