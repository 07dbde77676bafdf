import io
import os
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from noisemodel import OutputError, files
from noisemodel.files import cache_folder, cached, refuse_existing, replacing, write_whole


def write(path, text, **options):
    with replacing(path, **options) as temporary:
        temporary.write_text(text)


def test_a_file_appears_at_the_end_with_its_contents_and_nothing_else(tmp_path):
    with replacing(tmp_path / "out.txt") as temporary:
        temporary.write_text("whole")
        assert not (tmp_path / "out.txt").exists()
    assert (tmp_path / "out.txt").read_text() == "whole"
    assert os.listdir(tmp_path) == ["out.txt"]


def test_what_is_written_whole_replaces_nothing_unless_asked(tmp_path):
    path = tmp_path / "out.txt"
    write_whole(path, "first")
    with pytest.raises(OutputError, match="exists already; choose another name, or overwrite it"):
        write_whole(path, "second")
    assert path.read_text() == "first"
    write_whole(path, b"third", overwrite=True)
    assert path.read_text() == "third"


def test_the_file_has_the_permissions_of_any_new_file(tmp_path):
    before = os.umask(0o027)
    try:
        write(tmp_path / "out.txt", "")
    finally:
        os.umask(before)
    assert (tmp_path / "out.txt").stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize(
    ("error", "expected", "text"),
    [
        (KeyboardInterrupt, KeyboardInterrupt, None),
        (OSError(28, "No space left on device"), OutputError, r"out.txt: cannot .*\(No space left"),
    ],
)
def test_an_interrupted_overwrite_leaves_the_old_file(tmp_path, error, expected, text):
    write(tmp_path / "out.txt", "old")

    def interrupted():
        with replacing(tmp_path / "out.txt", overwrite=True) as temporary:
            temporary.write_text("half")
            raise error

    with pytest.raises(expected, match=text):
        interrupted()
    assert (tmp_path / "out.txt").read_text() == "old"
    assert os.listdir(tmp_path) == ["out.txt"]


def test_only_regular_files_are_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OutputError, match="is a folder; name a file"):
        write(tmp_path, "", overwrite=True)
    with pytest.raises(OutputError, match="pipe: is no regular file; name one"):
        write(tmp_path / "pipe", "", overwrite=True)
    with pytest.raises(OutputError, match=r"gone/out.txt: cannot be written \(No such file"):
        write(tmp_path / "gone" / "out.txt", "")
    assert (tmp_path / "pipe").is_fifo()


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


def test_what_is_read_is_not_replaced(tmp_path):
    (tmp_path / "log.csv").write_text("log")
    (tmp_path / "link").symlink_to("log.csv")
    with (
        files.reading([tmp_path / "link", tmp_path / "gone.csv"]),
        pytest.raises(OutputError, match="log.csv: is read, too; choose another name"),
    ):
        refuse_existing(tmp_path / "log.csv", overwrite=True)
    refuse_existing(tmp_path / "log.csv", overwrite=True)


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


def test_a_folder_that_refuses_files_is_one_error(tmp_path, monkeypatch):
    def refusing(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", refusing)
    with pytest.raises(OutputError, match=r"out\.txt: cannot be written \(Permission denied\)$"):
        write(tmp_path / "out.txt", "")


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "noise-inspector" / "geometry"


@pytest.fixture
def make():
    """Makes arrays, and counts how often."""
    points, faces = np.arange(6.0).reshape(2, 3), np.array([[0, 1, 0]], np.int32)
    return Mock(side_effect=lambda: {"points": points, "faces": faces})


def kept(make, key="a-1"):
    """Whether the arrays of a key were not made anew; they are as they are made."""
    before, found, made = make.call_count, cached(key, make), make.side_effect()
    assert set(found) == set(made)
    for name, array in made.items():
        assert found[name].dtype == array.dtype
        assert np.array_equal(found[name], array)
    return make.call_count == before


@pytest.mark.parametrize("value", ["", "relative/folder", None])
def test_without_an_absolute_folder_it_is_the_one_in_the_home_folder(tmp_path, monkeypatch, value):
    monkeypatch.setenv("HOME", str(tmp_path))
    if value is None:
        monkeypatch.delenv("XDG_CACHE_HOME")
    else:
        monkeypatch.setenv("XDG_CACHE_HOME", value)
    assert cache_folder() == tmp_path / ".cache" / "noise-inspector" / "geometry"


def test_arrays_are_made_once_and_anew_if_the_file_is_damaged_or_of_another_key(home, make):
    assert [kept(make), kept(make)] == [False, True]
    whole = (home / "a-1.npz").read_bytes()
    changed = [bytearray(whole) for _ in range(0, len(whole), 13)]
    for number, each in enumerate(changed):
        each[13 * number] ^= 0x55
    for content in (b"", whole[:10], whole[:-1], *changed):
        (home / "a-1.npz").write_bytes(content)
        assert not kept(make)
    (home / "a-1.npz").replace(home / "a-2.npz")
    assert not kept(make, "a-2")


def test_arrays_that_cannot_be_made_are_not_cached(home, make):
    with pytest.raises(ValueError, match="no such thing"):
        cached("a-1", Mock(side_effect=ValueError("no such thing")))
    assert list(home.iterdir()) == []
    assert not kept(make)


def homeless():
    raise RuntimeError("Could not determine home directory.")


def without_home(_, patch):
    patch.delenv("XDG_CACHE_HOME")
    patch.setattr(Path, "home", homeless)


@pytest.mark.parametrize(
    "spoil",
    [
        without_home,
        lambda home, _: home.chmod(0o720),
        lambda home, _: home.chmod(0o702),
        lambda home, patch: patch.setattr(os, "getuid", lambda: home.stat().st_uid - 1),
        lambda home, patch: patch.setattr(os, "getuid", lambda: home.stat().st_uid + 1),
        lambda home, patch: patch.setenv("XDG_CACHE_HOME", str(home / "a-1.npz")),
    ],
    ids=["no home", "of a group", "of all", "of one user", "of another", "a file"],
)
def test_a_folder_that_is_not_there_or_that_others_can_write_to_is_not_used(
    home, make, monkeypatch, spoil
):
    assert not kept(make)
    assert home.stat().st_mode & 0o777 == 0o700
    spoil(home, monkeypatch)
    assert [kept(make), kept(make, "a-2")] == [False, False]
    assert [path.name for path in home.iterdir()] == ["a-1.npz"]


def test_pickles_are_neither_opened_nor_kept(home, make):
    file, archive = home / "a-1.npz", io.BytesIO()
    assert not kept(make)
    np.savez(archive, points=np.array([{"a": 1}], dtype=object))
    file.write_bytes(archive.getvalue() + files._digest(file, archive.getvalue()))
    assert not kept(make)
    cached("a-2", lambda: {"points": np.array([{"a": 1}], dtype=object)})
    assert [path.name for path in home.iterdir()] == ["a-1.npz"]
