"""Bags that were cut off or damaged: intact messages are read, losses are reported."""

import numpy as np
import pytest
from checks import one_line
from samplelogs import TIMES, Talk, cut, joint_states, numbers, write_bag, write_mcap

from inspector import read_log
from inspector.errors import LogError

TALK, OLD = Talk(), Talk(ros1=True)
LONG = TIMES[0] + 10_000_000 * np.arange(4000)
POSITION, VELOCITY = numbers(samples=4000) / 10, numbers(samples=4000, seed=1)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Bags of a minute in each storage, some megabytes each, so that they have several chunks."""
    folder = tmp_path_factory.mktemp("whole")
    names = [f"a_joint_with_quite_a_long_name_{n}" for n in range(30)]
    wide = {"position": np.tile(POSITION, 10), "velocity": np.tile(VELOCITY, 10)}
    bags = {}
    for kind, talk, how in (
        ("mcap", TALK, {"storage": "mcap"}),
        ("mcap, zstd", TALK, {"storage": "mcap", "compression": "storage"}),
        ("sqlite3", TALK, {"storage": "sqlite3"}),
        ("ros1", OLD, {}),
        ("ros1, lz4", OLD, {"compression": "lz4"}),
    ):
        path = folder / (f"{kind}.bag" if talk.ros1 else kind)
        messages = joint_states(talk, LONG, names, **wide)
        path = write_bag(path, talk, {"/joint_states": messages}, **how)
        bags[kind] = path if talk.ros1 else next(p for p in path.iterdir() if p.suffix != ".yaml")
    return bags


def copied(path, tmp_path):
    copy = tmp_path / path.name
    copy.write_bytes(path.read_bytes())
    return copy


KINDS = ["mcap", "mcap, zstd", "sqlite3", "ros1", "ros1, lz4"]


@pytest.mark.parametrize("kind", KINDS)
def test_the_first_part_of_a_bag_that_was_cut_off_is_read(whole, tmp_path, kind):
    imported = read_log(cut(copied(whole[kind], tmp_path), 0.6))
    run = imported.run
    assert 0.3 * len(LONG) < len(run.time) < 0.7 * len(LONG)
    assert np.array_equal(run.position[:, :3], POSITION[: len(run.time)])
    assert np.array_equal(run.velocity[:, 27:], VELOCITY[: len(run.time)])
    assert any("the bag is damaged or cut off" in remark for remark in imported.remarks)
    assert any(f"{len(run.time)} messages were recovered" in each for each in imported.remarks)


def test_a_damaged_chunk_is_a_gap(whole, tmp_path):
    path = copied(whole["mcap, zstd"], tmp_path)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 200] = bytes(200)
    path.write_bytes(data)
    imported = read_log(path)
    run = imported.run
    assert 0 < np.sum(~run.mask) < 0.2 * len(run.time)
    kept = run.mask.nonzero()[0]
    assert np.allclose(run.position[kept, :3], POSITION[kept], rtol=1e-12, atol=1e-12)
    assert any("damaged and left out" in remark for remark in imported.remarks)


@pytest.mark.parametrize("damaged", [False, True])
def test_a_checksum_of_the_whole_file_is_checked(tmp_path, damaged):
    messages = [(at, TALK.raw(each)) for at, each in joint_states(TALK, position=POSITION[:400])]
    how = {"use_chunking": False, "enable_data_crcs": True}
    path = write_mcap(tmp_path / "log.mcap", messages, **how)
    if damaged:
        number = POSITION[7, 0].tobytes()
        path.write_bytes(path.read_bytes().replace(number, number[:-3] + b"\1" + number[-2:], 1))
    imported = read_log(path)
    assert np.sum(imported.run.position != POSITION[:400]) == damaged
    said = ["log.mcap: some of what was read is damaged (crc" in r for r in imported.remarks]
    assert any(said) == damaged


def test_a_bag_without_metadata_is_read(whole, tmp_path):
    (tmp_path / "bag").mkdir()
    copied(whole["mcap"], tmp_path / "bag")
    imported = read_log(tmp_path / "bag")
    assert np.array_equal(imported.run.position[:, :3], POSITION)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", [0.0, 1e-4, 2e-3])
def test_a_bag_without_intact_messages_is_an_error_of_one_line(whole, tmp_path, kind, share):
    path = cut(copied(whole[kind], tmp_path), share)
    with one_line(LogError, begin=path):
        read_log(path)
