import hashlib
import io
import os
from pathlib import Path

import numpy as np
import pytest

from noisemodel import cache
from noisemodel.cache import cached


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "noise-inspector" / "surfaces"


class Maker:
    """Makes arrays, and counts how often."""

    def __init__(self):
        self.calls = 0

    def __call__(self):
        self.calls += 1
        return {"points": np.arange(6.0).reshape(2, 3), "faces": np.array([[0, 1, 0]], np.int32)}


def assert_made(arrays):
    assert set(arrays) == {"points", "faces"}
    assert np.array_equal(arrays["points"], [[0, 1, 2], [3, 4, 5]])
    assert arrays["faces"].dtype == np.int32


def test_cached_arrays_are_made_once():
    make = Maker()
    assert_made(cached("a-1", make))
    assert_made(cached("a-1", make))
    assert make.calls == 1


def test_another_key_is_another_thing():
    make = Maker()
    cached("a-1", make)
    cached("a-2", make)
    assert make.calls == 2


def test_it_lies_in_the_users_cache_folder(home):
    cached("a-1", Maker())
    assert [path.name for path in home.iterdir()] == ["a-1.npz"]


@pytest.mark.parametrize("value", ["", "relative/folder", None])
def test_without_an_absolute_folder_it_is_the_one_in_the_home_folder(tmp_path, monkeypatch, value):
    monkeypatch.setenv("HOME", str(tmp_path))
    if value is None:
        monkeypatch.delenv("XDG_CACHE_HOME")
    else:
        monkeypatch.setenv("XDG_CACHE_HOME", value)
    assert cache.folder() == tmp_path / ".cache" / "noise-inspector" / "surfaces"


@pytest.mark.parametrize("content", [b"", b"nonsense", b"PK\x05\x06" + b"\0" * 18])
def test_a_damaged_file_is_made_anew(home, content):
    make = Maker()
    cached("a-1", make)
    (home / "a-1.npz").write_bytes(content)
    cached("a-1", make)
    assert_made(cached("a-1", make))
    assert make.calls == 2


def test_a_file_with_one_byte_changed_anywhere_is_made_anew(home):
    make = Maker()
    cached("a-1", make)
    whole = (home / "a-1.npz").read_bytes()
    for position in range(len(whole)):
        damaged = bytearray(whole)
        damaged[position] ^= 0x55
        (home / "a-1.npz").write_bytes(damaged)
        assert_made(cached("a-1", make))
    assert make.calls == 1 + len(whole)


def test_pickles_in_the_folder_are_not_opened(home):
    home.mkdir(parents=True)
    archive = io.BytesIO()
    np.savez(archive, points=np.array([{"a": 1}], dtype=object))
    content = archive.getvalue()
    (home / "a-1.npz").write_bytes(content + hashlib.sha256(content).digest())
    assert_made(cached("a-1", Maker()))


def test_a_folder_that_cannot_be_written_to_is_no_error(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    make = Maker()
    assert_made(cached("a-1", make))
    assert_made(cached("a-1", make))
    assert make.calls == 2


def test_arrays_that_cannot_be_made_are_not_cached(home):
    def fail():
        raise ValueError("no such thing")

    with pytest.raises(ValueError, match="no such thing"):
        cached("a-1", fail)
    assert not home.exists()
    assert_made(cached("a-1", Maker()))


def test_nothing_but_the_archive_is_left_behind(home):
    cached("a-1", Maker())
    assert len(list(home.iterdir())) == 1
    with np.load(home / "a-1.npz", allow_pickle=False) as archive:
        assert_made(dict(archive))


def test_the_secret_is_the_users_alone(home):
    make, secret = Maker(), home.parent / "secret"
    cached("a-1", make)
    assert (secret.stat().st_mode & 0o777, len(secret.read_bytes())) == (0o600, 32)
    for bit in (0o1, 0o2, 0o4, 0o10, 0o20, 0o40):
        secret.chmod(0o600 | bit)
        assert_made(cached("a-1", make))
    assert make.calls == 7
    for mode in (0o400, 0o600, 0o700):
        secret.chmod(mode)
        cached("a-1", make)
    assert make.calls == 7


@pytest.mark.parametrize("difference", [-1, 1])
def test_the_secret_of_another_user_is_not_taken(monkeypatch, difference):
    make, user = Maker(), os.getuid()
    cached("a-1", make)
    monkeypatch.setattr(os, "getuid", lambda: user + difference)
    assert_made(cached("a-1", make))
    assert make.calls == 2


@pytest.mark.parametrize("length", [0, 31, 33])
def test_a_secret_that_is_being_written_is_not_taken(home, length):
    make = Maker()
    cached("a-1", make)
    (home.parent / "secret").write_bytes(bytes(length))
    for calls in (2, 3):
        assert_made(cached("a-1", make))
        assert make.calls == calls


def test_another_secret_or_another_name_is_of_somebody_else(home):
    make = Maker()
    cached("a-1", make)
    (home / "a-2.npz").write_bytes((home / "a-1.npz").read_bytes())
    cached("a-2", make)
    assert make.calls == 2
    (home.parent / "secret").write_bytes(bytes(32))
    cached("a-1", make)
    assert make.calls == 3


def test_without_a_home_folder_nothing_is_kept(monkeypatch):
    def homeless():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(Path, "home", homeless)
    make = Maker()
    for _ in range(2):
        assert_made(cached("a-1", make))
    assert make.calls == 2


def test_pickles_are_neither_opened_nor_kept(home):
    """Not even those that the user has signed."""
    make, file = Maker(), home / "a-1.npz"
    cached("a-1", make)
    archive = io.BytesIO()
    np.savez(archive, points=np.array([{"a": 1}], dtype=object))
    file.write_bytes(archive.getvalue() + cache._digest(file, archive.getvalue()))
    assert_made(cached("a-1", make))
    assert make.calls == 2
    cached("a-2", lambda: {"points": np.array([{"a": 1}], dtype=object)})
    assert [path.name for path in home.iterdir()] == ["a-1.npz"]
