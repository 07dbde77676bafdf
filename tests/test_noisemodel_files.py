import fcntl
import hashlib
import io
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from noisemodel import OutputError, files
from noisemodel.files import (
    _machine,
    _sweep,
    cache_folder,
    cached,
    refuse_existing,
    replacing,
)

ROOT = Path(__file__).parents[1]


def write(path, text, **options):
    with replacing(path, **options) as temporary:
        temporary.write_text(text)


def test_a_file_appears_with_its_contents_and_nothing_else(tmp_path):
    write(tmp_path / "out.txt", "whole")
    assert (tmp_path / "out.txt").read_text() == "whole"
    assert os.listdir(tmp_path) == ["out.txt"]


def test_nothing_exists_under_the_name_before_the_end(tmp_path):
    with replacing(tmp_path / "out.txt") as temporary:
        temporary.write_text("half")
        assert not (tmp_path / "out.txt").exists()


@pytest.mark.parametrize("mask", [0o022, 0o027, 0o077])
def test_the_file_has_the_permissions_of_any_new_file(tmp_path, mask):
    before = os.umask(mask)
    try:
        write(tmp_path / "out.txt", "")
        (tmp_path / "other.txt").touch()
    finally:
        os.umask(before)
    assert (tmp_path / "out.txt").stat().st_mode == (tmp_path / "other.txt").stat().st_mode


def test_an_interrupted_overwrite_leaves_the_old_file(tmp_path):
    write(tmp_path / "out.txt", "old")

    def interrupted():
        with replacing(tmp_path / "out.txt", overwrite=True) as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert (tmp_path / "out.txt").read_text() == "old"
    assert os.listdir(tmp_path) == ["out.txt"]


def test_a_file_that_exists_is_not_replaced_unasked(tmp_path):
    write(tmp_path / "out.txt", "old")
    with pytest.raises(OutputError, match="exists already; choose another name, or overwrite it"):
        write(tmp_path / "out.txt", "new")
    assert (tmp_path / "out.txt").read_text() == "old"
    write(tmp_path / "out.txt", "new", overwrite=True)
    assert (tmp_path / "out.txt").read_text() == "new"


def test_a_folder_is_not_replaced(tmp_path):
    with pytest.raises(OutputError, match="is a folder; name a file"):
        write(tmp_path, "", overwrite=True)


def test_a_link_stays_and_what_it_leads_to_is_written(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "target")
    write(tmp_path / "link", "first")
    with pytest.raises(OutputError, match="link: exists already"):
        write(tmp_path / "link", "second")
    write(tmp_path / "link", "second", overwrite=True)
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_text() == "second"


def test_a_link_to_itself_is_one_error_or_replaced(tmp_path):
    (tmp_path / "link").symlink_to("link")
    with pytest.raises(ValueError, match="link: exists already"):
        write(tmp_path / "link", "")
    write(tmp_path / "link", "whole", overwrite=True)
    assert (tmp_path / "link").is_file()


def test_a_pipe_is_not_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ValueError, match="pipe: is no regular file; name one"):
        write(tmp_path / "pipe", "", overwrite=True)
    assert (tmp_path / "pipe").is_fifo()


def test_what_is_read_is_not_replaced(tmp_path):
    (tmp_path / "log.csv").write_text("log")
    (tmp_path / "link").symlink_to("log.csv")
    with (
        files.reading([tmp_path / "link", tmp_path / "gone.csv"]),
        pytest.raises(OutputError, match="log.csv: is read, too; choose another name"),
    ):
        refuse_existing(tmp_path / "log.csv", overwrite=True)
    refuse_existing(tmp_path / "log.csv", overwrite=True)


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(OutputError, match=r"gone/out.txt: cannot be written \(No such file"):
        write(tmp_path / "gone" / "out.txt", "")


def test_a_full_disk_is_one_error_and_leaves_nothing(tmp_path):
    def full():
        with replacing(tmp_path / "out.txt"):
            raise OSError(28, "No space left on device")

    with pytest.raises(OutputError, match=r"out.txt: cannot be written \(No space left on device"):
        full()
    assert os.listdir(tmp_path) == []


def write_late(path):
    """Write a file that somebody else has written by the end."""
    with replacing(path) as late:
        write(path, "first")
        late.write_text("second")


def without_links(*_):
    raise PermissionError(1, "Operation not permitted")


@pytest.mark.parametrize("links", [True, False])
def test_of_two_that_write_one_file_at_once_the_second_fails(tmp_path, monkeypatch, links):
    if not links:
        monkeypatch.setattr(os, "link", without_links)
    with pytest.raises(OutputError, match=r"out\.txt: exists already"):
        write_late(tmp_path / "out.txt")
    assert (tmp_path / "out.txt").read_text() == "first"
    assert os.listdir(tmp_path) == ["out.txt"]


KILLED = """
import os, signal, sys
from noisemodel.files import replacing
with replacing(sys.argv[1]):
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_process_has_left_is_deleted_by_the_next(tmp_path):
    for _ in range(2):
        subprocess.run([sys.executable, "-c", KILLED, tmp_path / "out.txt"], cwd=ROOT, check=False)
    first, second = tmp_path.iterdir()
    machine = first.name[-16:-8]
    other = second.rename(tmp_path / second.name.replace(machine, "0123abcd"))
    fresh = first.with_name(first.name[:-8] + "01234567")
    fresh.touch()
    for each in (first, other):
        os.utime(each, (time.time() - 70,) * 2)
    write(tmp_path / "out.txt", "")
    assert sorted(tmp_path.iterdir()) == sorted([other, fresh, tmp_path / "out.txt"])


def test_the_temporary_file_of_a_process_that_waits_for_days_is_kept(tmp_path):
    with replacing(tmp_path / "out.txt") as temporary:
        temporary.write_text("of last week")
        os.utime(temporary, (time.time() - 600_000,) * 2)
        _sweep.cache_clear()
        write(tmp_path / "other.txt", "of today")
        assert temporary.exists()
    assert (tmp_path / "out.txt").read_text() == "of last week"


@pytest.mark.parametrize(
    ("machine", "age", "kept"),
    [
        ("", 86_000, True),
        ("", 87_000, False),
        ("0123abcd", 86_000, True),
        ("0123abcd", 87_000, False),
        ("own", 50, True),
        ("own", 65, False),
    ],
)
def test_a_file_is_abandoned_after_a_minute_here_and_after_a_day_elsewhere(
    tmp_path, machine, age, kept
):
    machine = _machine() if machine == "own" else machine
    temporary = tmp_path / f".noise-inspector-{machine}4567abcd"
    others = [tmp_path / ".other-4567abcd", tmp_path / "a.txt"]
    for each in (temporary, *others):
        each.touch()
        os.utime(each, (time.time() - age,) * 2)
    write(tmp_path / "out.txt", "")
    assert temporary.exists() == kept
    assert all(each.exists() for each in others)


def test_without_locks_age_alone_decides(tmp_path, monkeypatch):
    def unsupported(*_):
        raise OSError(37, "No locks available")

    old, fresh = (tmp_path / f".noise-inspector-{each}4567abcd" for each in ("", "0123abcd"))
    for temporary in (old, fresh):
        temporary.touch()
    os.utime(old, (time.time() - 90_000,) * 2)
    monkeypatch.setattr(fcntl, "flock", unsupported)
    write(tmp_path / "out.txt", "whole")
    assert sorted(tmp_path.iterdir()) == sorted([fresh, tmp_path / "out.txt"])
    assert (tmp_path / "out.txt").read_text() == "whole"


def test_a_machine_is_known_by_its_start_or_by_its_name(monkeypatch):
    def lacking(path):
        raise FileNotFoundError(path)

    started = Path("/proc/sys/kernel/random/boot_id")
    if started.exists():
        assert _machine() == hashlib.sha256(started.read_bytes()).hexdigest()[:8]
    monkeypatch.setattr(Path, "read_text", lacking)
    monkeypatch.setattr(platform, "node", lambda: "robot")
    assert _machine.__wrapped__() == hashlib.sha256(b"robot").hexdigest()[:8]


def test_a_folder_that_refuses_files_is_one_error(tmp_path, monkeypatch):
    def refusing(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", refusing)
    with pytest.raises(OutputError, match=r"out\.txt: cannot be written \(Permission denied\)$"):
        write(tmp_path / "out.txt", "")


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


@pytest.mark.parametrize("value", ["", "relative/folder", None])
def test_without_an_absolute_folder_it_is_the_one_in_the_home_folder(tmp_path, monkeypatch, value):
    monkeypatch.setenv("HOME", str(tmp_path))
    if value is None:
        monkeypatch.delenv("XDG_CACHE_HOME")
    else:
        monkeypatch.setenv("XDG_CACHE_HOME", value)
    assert cache_folder() == tmp_path / ".cache" / "noise-inspector" / "surfaces"


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
    file.write_bytes(archive.getvalue() + files._digest(file, archive.getvalue()))
    assert_made(cached("a-1", make))
    assert make.calls == 2
    cached("a-2", lambda: {"points": np.array([{"a": 1}], dtype=object)})
    assert [path.name for path in home.iterdir()] == ["a-1.npz"]
