"""HDF5 files that hold what is not theirs, or claim to hold more than they do."""

import re
import time

import h5py
import numpy as np
import pytest
from checks import memory_below

from inspector.errors import LogError
from inspector.logs.mapping import ReadOptions
from inspector.logs.read import listing, read_log

TIME = np.arange(400) / 100
MOTION = np.sin(TIME)[:, None] * (1.0, 0.5)


def log(path, **further):
    with h5py.File(path, "w") as file:
        file["time"], file["joint_pos"] = TIME, MOTION
        for name, each in further.items():
            file[name] = each
    return path


def external(file, other):
    everything = [(str(other), 0, h5py.h5f.UNLIMITED)]
    file.create_dataset("joint_vel", (400, 2), "<f8", external=everything)


def virtual(file, other):
    layout = h5py.VirtualLayout((400, 2), "<f8")
    layout[:] = h5py.VirtualSource(other, "joint_pos", (400, 2))
    file.create_virtual_dataset("joint_vel", layout)


@pytest.mark.parametrize("stored", [external, virtual])
def test_numbers_of_other_files_are_not_imported(tmp_path, stored):
    other, path = log(tmp_path / "other.h5"), log(tmp_path / "a.h5")
    with h5py.File(path, "a") as file:
        stored(file, other)
    with pytest.raises(LogError, match="'/joint_vel' is stored in other files"):
        read_log(path)


@pytest.mark.parametrize("home", ["data", "terminals"])
def test_links_into_other_files_are_not_followed(tmp_path, home):
    other = tmp_path / "other.h5"
    with h5py.File(other, "w") as file:
        file["data/demo_0/joint_pos"], file["flags"] = MOTION, np.zeros(400)
    path = log(tmp_path / "a.h5")
    with h5py.File(path, "a") as file:
        file[home] = h5py.ExternalLink(other.name, "/data" if home == "data" else "/flags")
    with pytest.raises(LogError, match=rf"lies in another file \(.*{re.escape(other.name)}\)"):
        read_log(path)


def test_a_shape_that_is_not_in_the_file_is_refused_if_it_is_asked_for(tmp_path):
    huge = {"shape": (10**9, 2), "dtype": "<f8", "chunks": (10**4, 2), "compression": "gzip"}
    path = log(tmp_path / "a.h5")
    with h5py.File(path, "a") as file:
        file.create_dataset("pixels", **huge)
    imported = read_log(path)
    np.testing.assert_allclose(imported.run.position, MOTION)
    assert any("pixels" in remark for remark in imported.remarks)
    with h5py.File(path, "a") as file:
        file.create_dataset("joint_vel", **huge)
    expected = "unpacks to 16 GB from .* MB, the limit is .*--max-unpacked"
    with pytest.raises(LogError, match=expected):
        read_log(path)


def test_the_contents_of_a_damaged_file_are_listed_or_one_line(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["data/demo_0/obs/joint_pos"] = np.zeros((40, 2))
    data = path.read_bytes()
    refused = 0
    for place in range(512, len(data) - 8, 40):  # headers of groups and datasets
        path.write_bytes(data[:place] + b"\xff" * 8 + data[place + 8 :])
        try:
            listing(path, ReadOptions())
        except LogError as error:
            refused += "\n" not in str(error)
    assert refused > 10


def test_attributes_of_any_number_and_size_cost_nothing(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w", libver="latest") as file:
        file["data/demo_0/obs/joint_pos"] = np.sin(np.arange(80).reshape(40, 2) / 9)
        attributes = file["data/demo_0"].attrs
        attributes["fps"] = 50.0
        attributes.create("image", np.zeros(4 * 10**6))
        for number in range(2000):
            attributes[f"a{number}"] = number
    begin = time.process_time()
    with memory_below(20e6):
        assert read_log(path).run.rate == 50.0
    assert time.process_time() - begin < 10


def test_many_links_to_one_dataset_are_one(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["time"] = np.arange(1000) / 100
        file["qvel"] = np.ones((1000, 7))
        group = file.create_group("data/demo_0")
        group["time"], group["qvel"] = file["time"], file["qvel"]
        for number in range(1, 400):
            file[f"data/demo_{number}"] = group
            group[f"obs_{number}"] = file["qvel"]
    (line, *rest) = listing(path, ReadOptions())[1:]
    assert line.strip().startswith("1 episode")
    assert len(rest) == 2
    assert read_log(path).run.velocity.shape == (1000, 7)
