"""Recordings that nobody named: few are kept."""

import os
from pathlib import Path

import pytest

from inspector.recording import viewer


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return viewer.scratch_path(Path("first.npz")).parent


def recorded(folder, count, *, size=1):
    """Write recordings, each younger than the one before."""
    paths = [folder / f"run{number}.rrd" for number in range(count)]
    for age, path in enumerate(reversed(paths)):
        path.write_bytes(bytes(size))
        os.utime(path, (1e9 - age, 1e9 - age))
    return paths


def test_only_the_newest_recordings_stay(folder):
    paths = recorded(folder, 30)
    viewer.scratch_path(Path("next.npz"))
    assert sorted(folder.iterdir()) == sorted(paths[-viewer.KEPT + 1 :])  # and one to come


def test_recordings_take_no_more_than_their_room(folder, monkeypatch):
    monkeypatch.setattr(viewer, "ROOM", 1000)
    paths = recorded(folder, 5, size=400)
    viewer.scratch_path(Path("next.npz"))
    assert sorted(folder.iterdir()) == sorted(paths[-2:])


def test_what_is_no_recording_is_left_alone(folder):
    (folder / "notes.txt").write_text("mine")
    recorded(folder, 30)
    viewer.scratch_path(Path("next.npz"))
    assert (folder / "notes.txt").exists()
