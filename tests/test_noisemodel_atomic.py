import fcntl
import hashlib
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

import pytest

from noiseclassifier import modelfile
from noisemodel import OutputError
from noisemodel.atomic import TEMPORARY, _machine, _sweep, refuse_existing, replacing

ROOT = Path(__file__).parents[1]


def save_model(path, text, **options):
    modelfile.write(path, {"text": text}, {}, **options)


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


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, ZeroDivisionError])
def test_an_interrupted_write_leaves_nothing_behind(tmp_path, interruption):
    def interrupted():
        with replacing(tmp_path / "out.txt") as temporary:
            temporary.write_text("half")
            raise interruption

    with pytest.raises(interruption):
        interrupted()
    assert os.listdir(tmp_path) == []


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


@pytest.mark.parametrize("save", [write, save_model], ids=["file", "model"])
def test_a_link_to_itself_is_one_error_or_replaced(tmp_path, save):
    (tmp_path / "link").symlink_to("link")
    with pytest.raises(ValueError, match="link: exists already"):
        save(tmp_path / "link", "")
    save(tmp_path / "link", "whole", overwrite=True)
    assert (tmp_path / "link").is_file()


@pytest.mark.parametrize("save", [write, save_model], ids=["file", "model"])
def test_a_pipe_is_not_replaced(tmp_path, save):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ValueError, match="pipe: is no regular file; name one"):
        save(tmp_path / "pipe", "", overwrite=True)
    assert (tmp_path / "pipe").is_fifo()


def test_what_is_read_is_not_replaced(tmp_path):
    (tmp_path / "log.csv").write_text("log")
    (tmp_path / "link").symlink_to("log.csv")
    with pytest.raises(OutputError, match="log.csv: is read, too; choose another name"):
        refuse_existing(tmp_path / "log.csv", overwrite=True, read=[tmp_path / "link"])
    refuse_existing(tmp_path / "log.csv", overwrite=True, read=[tmp_path / "gone.csv"])


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


def test_of_two_that_write_one_file_at_once_the_second_fails_and_changes_nothing(tmp_path):
    with pytest.raises(OutputError, match=r"out\.txt: exists already; choose another name"):
        write_late(tmp_path / "out.txt")
    assert (tmp_path / "out.txt").read_text() == "first"
    assert os.listdir(tmp_path) == ["out.txt"]


def without_links(*_):
    raise PermissionError(1, "Operation not permitted")


def test_without_hard_links_the_second_of_two_writers_fails_as_well(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "link", without_links)
    with pytest.raises(OutputError, match=r"out\.txt: exists already"):
        write_late(tmp_path / "out.txt")
    assert (tmp_path / "out.txt").read_text() == "first"
    assert os.listdir(tmp_path) == ["out.txt"]


def test_temporary_files_of_killed_processes_are_deleted_after_a_day(tmp_path):
    names = [".noise-inspector-0123abcd", ".noise-inspector-4567abcd", ".other-0123abcd", "a.txt"]
    for name in names:
        (tmp_path / name).touch()
        os.utime(tmp_path / name, (time.time() - 90_000,) * 2)
    os.utime(tmp_path / names[1])  # one that is being written
    write(tmp_path / "out.txt", "")
    assert sorted(os.listdir(tmp_path)) == sorted([*names[1:], "out.txt"])


KILLED = """
import os, signal, sys
from noisemodel.atomic import replacing
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
    temporary.touch()
    os.utime(temporary, (time.time() - age,) * 2)
    write(tmp_path / "out.txt", "")
    assert temporary.exists() == kept


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


def test_without_hard_links_a_file_is_written_and_replaced_only_if_asked(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "link", without_links)
    write(tmp_path / "out.txt", "first")
    with pytest.raises(OutputError, match=r"out\.txt: exists already"):
        write(tmp_path / "out.txt", "second")
    assert (tmp_path / "out.txt").read_text() == "first"
    write(tmp_path / "out.txt", "second", overwrite=True)
    assert (tmp_path / "out.txt").read_text() == "second"
    assert os.listdir(tmp_path) == ["out.txt"]


def test_a_temporary_file_is_known_by_its_name(tmp_path):
    with replacing(tmp_path / "out.txt") as temporary:
        assert TEMPORARY.fullmatch(temporary.name)[1] == _machine()


def test_a_folder_that_refuses_files_is_one_error(tmp_path, monkeypatch):
    def refusing(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", refusing)
    with pytest.raises(OutputError, match=r"out\.txt: cannot be written \(Permission denied\)$"):
        write(tmp_path / "out.txt", "")


def test_an_output_that_exists_is_refused_unless_it_may_be_replaced(tmp_path):
    (tmp_path / "out.txt").touch()
    with pytest.raises(OutputError, match=r"out\.txt: exists already"):
        refuse_existing(tmp_path / "out.txt")
    refuse_existing(tmp_path / "out.txt", overwrite=True)
    refuse_existing(tmp_path / "other.txt")
