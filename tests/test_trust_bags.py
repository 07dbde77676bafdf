"""Bags that unpack to more than is read, or whose rows are no messages."""

import os
import sqlite3
from contextlib import closing, suppress

import numpy as np
import pytest
from checks import memory_below, one_line
from mcap.writer import CompressionType
from samplelogs import TIMES, Talk, cut, joint_states, numbers, write_bag, write_mcap

from inspector import read_log
from inspector.errors import LogError

TALK, OLD = Talk(), Talk(ros1=True)
STATE = "sensor_msgs/msg/JointState"
WAYS = {
    "mcap, zstd": (TALK, {"storage": "mcap", "compression": "storage"}),
    "each message": (TALK, {"storage": "sqlite3", "compression": "message"}),
    "the file": (TALK, {"storage": "sqlite3", "compression": "file"}),
    "ros1, lz4": (OLD, {"compression": "lz4"}),
    "ros1, bz2": (OLD, {"compression": "bz2"}),
}


def states(talk, **how):
    return joint_states(talk, position=numbers(), velocity=numbers(seed=1), **how)


@pytest.fixture
def limit(monkeypatch):
    monkeypatch.setenv("NOISE_MAX_UNPACKED", "4000000")


@pytest.mark.parametrize("way", WAYS)
def test_a_bag_that_unpacks_to_too_much_is_refused_and_one_that_does_not_is_read(
    tmp_path, limit, way
):
    talk, how = WAYS[way]
    topics = {"/joint_states": states(talk)}
    small = write_bag(tmp_path / ("small.bag" if talk.ros1 else "small"), talk, topics, **how)
    assert np.array_equal(read_log(small).run.position, numbers())
    names = ["a" * 20_000_000, "b", "c"]
    topics["/joint_states"] = states(talk, times=TIMES[:3], names=names)
    large = write_bag(tmp_path / ("large.bag" if talk.ros1 else "large"), talk, topics, **how)
    with pytest.raises(LogError, match=r"unpacks to .* GB from .* MB, the limit is .*--max-unpack"):
        read_log(large)


@pytest.mark.parametrize("how", [CompressionType.ZSTD, CompressionType.LZ4])
def test_a_chunk_of_zeros_is_not_unpacked(tmp_path, limit, how):
    zeros = {"text": "string[] name", "chunk_size": 2**25, "compression": how}
    path = write_mcap(tmp_path / "a.mcap", [(1, bytes(2**25))], **zeros)
    with pytest.raises(LogError, match="unpacks to"):
        read_log(path)


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE messages SET data = NULL WHERE id % 2",
        "UPDATE messages SET data = 'text' WHERE id % 2",
        "UPDATE messages SET timestamp = 9223372036854775807 WHERE id % 2",
        "UPDATE topics SET name = NULL",
        "UPDATE topics SET name = x'ff'",
        "UPDATE topics SET type = NULL",
    ],
)
@pytest.mark.parametrize("damaged", [False, True])
def test_rows_that_are_no_messages_are_left_out_or_one_line(tmp_path, change, damaged):
    topics = {"/joint_states": states(TALK)}
    folder = write_bag(tmp_path / "bag", TALK, topics, storage="sqlite3")
    file = next(folder.glob("*.db3"))
    with closing(sqlite3.connect(file)) as database:
        database.execute("PRAGMA writable_schema = ON")
        database.execute("UPDATE sqlite_master SET sql = replace(sql, 'NOT NULL', '')")
        database.commit()
    with closing(sqlite3.connect(file)) as database:
        database.execute(change)
        database.commit()
    path = cut(file, 0.9) if damaged else folder
    with suppress(LogError):
        assert np.isfinite(read_log(path).run.position).all()


def test_a_schema_that_is_no_text_is_one_line(tmp_path):
    topics = {"/joint_states": states(TALK)}
    path = next(write_bag(tmp_path / "bag", TALK, topics, storage="sqlite3").glob("*.db3"))
    path.write_bytes(path.read_bytes().replace(b"CREATE TABLE topics", b"CREATE TABL\xa9 topics"))
    with pytest.raises(LogError, match="no topic of the bag can be read: the bag is damaged"):
        read_log(path)


@pytest.mark.parametrize("stamp", [2**63, 2**64 - 1])
def test_stamps_of_64_bits_are_left_out_and_said(tmp_path, stamp):
    text = TALK.store.generate_msgdef(STATE)[0]
    messages = [(at, TALK.raw(message)) for at, message in states(TALK)]
    path = write_mcap(tmp_path / "a.mcap", [*messages, (stamp, messages[-1][1])], text=text)
    imported = read_log(path)
    assert len(imported.run.time) == len(TIMES)
    assert any("1 messages without data, or with stamps after 2116" in r for r in imported.remarks)


@pytest.mark.parametrize("size", [0, 3 * 10**9])
def test_the_metadata_of_a_bag_are_not_believed(tmp_path, size):
    folder = write_bag(tmp_path / "bag", TALK, {"/joint_states": states(TALK)}, storage="sqlite3")
    os.truncate(folder / "metadata.yaml", size)
    with memory_below(200e6):
        imported = read_log(folder)
    assert len(imported.run.time) == len(TIMES)
    assert not any("damaged" in remark for remark in imported.remarks)


def test_a_folder_with_two_kinds_of_bags_is_refused(tmp_path):
    topics = {"/joint_states": states(TALK)}
    folder = write_bag(tmp_path / "bag", TALK, topics, storage="sqlite3")
    other = write_bag(tmp_path / "other", TALK, topics, storage="mcap")
    next(other.glob("*.mcap")).rename(folder / "copy.mcap")
    with pytest.raises(LogError, match="holds files of several kinds of bags; name one of them"):
        read_log(folder)


DEFINITIONS = {
    "empty messages without end": "std_msgs/Empty[] bombs\nfloat64[] position",
    "nested arrays": "float64[1000000000] position",
    "50,000 fields": "\n".join(f"float64 a{n}" for n in range(50_000)),
}


@pytest.mark.parametrize("text", DEFINITIONS.values(), ids=DEFINITIONS)
@pytest.mark.parametrize("kind", [STATE, "control_msgs/msg/JointTrajectoryControllerState"])
def test_a_definition_in_a_bag_is_not_run(tmp_path, kind, text):
    data = b"\0\1\0\0" + b"\xff" * 4000
    messages = [(at, data) for at in range(3)]
    path = write_mcap(tmp_path / "a.mcap", messages, kind=kind, text=text)
    with memory_below(100e6), one_line(LogError):
        read_log(path)
