"""Arrays in archives: what is read of them, from any place, and what is refused."""

import io
import os
import re
import struct
import zipfile
from contextlib import nullcontext

import numpy as np
import pytest
from numpy.lib import format as npy

from noisemodel import archive
from noisemodel.archive import ArchiveError
from noisemodel.ondemand import OnDemand

STORED, DEFLATED = zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED
CUBE = np.cumsum(np.arange(60.0 * 2 * 3)).reshape(60, 2, 3)


def refused(text):
    """Expect an error with this whole text."""
    return pytest.raises(ArchiveError, match=f"^{re.escape(text)}$")


def content(array, version=(1, 0)):
    stream = io.BytesIO()
    npy.write_array(stream, array, version=version)
    return stream.getvalue()


def stated(shape, kind="<f8", data=b"", version=b"\x01\x00"):
    """An array's header, as it may be written by anybody, and its bytes."""
    header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY" + version + struct.pack("<H", len(header)) + header.encode() + data


def packed(path, method=STORED, **members):
    with zipfile.ZipFile(path, "w", method) as file:
        for name, each in members.items():
            file.writestr(f"{name}.npy", each if isinstance(each, bytes) else content(each))
    return path


@pytest.fixture
def small(monkeypatch):
    """Pieces of some bytes, and few places from which arrays are unpacked."""
    monkeypatch.setattr(archive, "PIECE", 50)
    monkeypatch.setattr(archive, "MARKS", 7)


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("method", [STORED, DEFLATED])
def test_arrays_are_read_in_pieces_and_larger_ones_on_demand_by_their_rows(
    tmp_path, small, method, order
):
    cube = np.asarray(CUBE, order=order)
    size = len(content(cube))
    path = packed(tmp_path / "a.npz", method, long=np.arange(1000), cube=cube, text=np.array("a"))
    assert archive.names_in(path) == ("long", "cube", "text")
    assert list(archive.read(path, ["cube", "other"])) == ["cube"]
    for limit, stays in ((float("inf"), False), (size, False), (size - 1, True), (0, True)):
        found = archive.read(path, on_demand=limit)
        assert list(found) == ["long", "cube", "text"]
        assert isinstance(found["long"], np.ndarray)
        np.testing.assert_array_equal(found["long"], np.arange(1000))
        assert str(found["text"]) == "a"
        stays = stays and (order == "C" or method == STORED)
        assert isinstance(found["cube"], OnDemand) == stays
        for first, stop in ((0, 60), (57, 60), (3, 4), (20, 40), (7, 7), (0, 1), (59, 60)):
            np.testing.assert_array_equal(found["cube"][first:stop], CUBE[first:stop])


def test_whatever_is_read_of_a_packed_array_has_the_bytes_of_the_whole(tmp_path, small):
    """Marks lie apart, and there are so many at most."""
    random = np.random.default_rng(0)
    whole = np.round(random.normal(size=(200, 3)), 1)
    raw = content(whole)
    path = packed(tmp_path / "a.npz", DEFLATED, other=np.arange(9), a=whole)
    with zipfile.ZipFile(path) as file:
        info = file.getinfo("a.npy")
    member = archive._Member(path, "a", info)
    for start, stop in [(4000, 4900), (0, 10), *random.integers(0, len(raw), (60, 2)).tolist()]:
        assert member.read(start, stop).tobytes() == raw[start:stop]
    marks = [place for place, *_ in member._marks]
    apart = len(raw) // 7
    assert marks[0] == 0
    assert 4 <= len(marks) <= 8
    assert min(np.diff(marks)) >= apart
    assert max(np.diff(marks)) < apart + 50
    with refused("damaged: a is cut off"):
        member.read(len(raw) - 5, len(raw) + 1)


@pytest.mark.parametrize("order", ["C", "F"])
def test_a_wrong_checksum_is_found_when_an_array_was_read_in_order(tmp_path, small, order):
    raw = content(np.asarray(np.tile(CUBE, (9, 1, 1)), order=order))
    path = packed(tmp_path / "a.npz", cube=raw)
    damaged = bytearray(path.read_bytes())
    damaged[damaged.index(raw) + len(raw) - 1] ^= 1  # the last byte of the last row
    path.write_bytes(damaged)
    with refused("Bad CRC-32 for file 'cube.npy'"):
        archive.read(path)
    wrong = refused("damaged: wrong checksum of cube")
    with wrong if order == "F" else nullcontext():
        cube = archive.read(path, on_demand=0)["cube"]
    if order == "C":
        cube[10:540]  # the sum of a part is unknown
        cube[0:20], cube[20:300]
        with wrong:
            cube[300:540]


def test_a_file_that_changes_while_it_is_read_is_refused(tmp_path):
    path = packed(tmp_path / "a.npz", cube=CUBE)
    cube = archive.read(path, on_demand=0)["cube"]
    np.testing.assert_array_equal(cube[3:5], CUBE[3:5])
    os.utime(path, ns=(0, 0))
    with refused("was changed while it was read"):
        cube[3:5]


def packed_again(path, raw):
    """The member of a file that was damaged, by what stood in the file before."""
    with zipfile.ZipFile(io.BytesIO(raw)) as file:
        return archive._Member(path, "table", file.getinfo("table.npy"))


@pytest.mark.parametrize("method", [STORED, DEFLATED])
def test_a_file_that_is_cut_or_damaged_later_is_refused(tmp_path, small, monkeypatch, method):
    """Where nothing else shows that it was changed."""
    monkeypatch.setattr(archive, "_identity", lambda file: ())
    table = np.random.default_rng(0).normal(size=(300, 2))
    path = packed(tmp_path / "a.npz", method, table=table)
    raw = path.read_bytes()
    found = archive.read(path, on_demand=0)["table"]
    assert isinstance(found, OnDemand)
    path.write_bytes(raw[:2000])
    np.testing.assert_array_equal(found[3:50], table[3:50])
    with refused("damaged: table is cut off"):
        found[100:300]
    if method == DEFLATED:
        begin = raw.index(b"table.npy") + len("table.npy")
        path.write_bytes(raw[:begin] + b"\xff" * 5000)  # 7: a block of no known type
        found = packed_again(path, raw)
        with pytest.raises(ArchiveError, match=r"^damaged: Error -3 while decompressing data"):
            found.read(0, 10)


@pytest.mark.parametrize(
    ("member", "message"),
    [
        (stated("(2,)", data=bytes(16)), ""),
        (stated("(2,)", data=bytes(15)), "states shape (2,) of float64, but has 15 bytes"),
        (stated("(2,)", data=bytes(17)), "states shape (2,) of float64, but has 17 bytes"),
        (stated("(0,)"), ""),
        (stated("(0, -1)"), "states shape (0, -1) of float64, but has 0 bytes"),
        (stated("(-1, -2)", data=bytes(16)), "states shape (-1, -2) of float64, but has 16 bytes"),
        (stated("(3,)", "|V0"), "states shape (3,) of |V0, but has 0 bytes"),
        (stated("()", data=bytes(8)), ""),
    ],
)
@pytest.mark.parametrize("limit", [0, float("inf")])
def test_an_array_has_the_bytes_that_its_shape_states(tmp_path, member, message, limit):
    path = packed(tmp_path / "a.npz", a=member)
    with refused(f"damaged: a {message}") if message else nullcontext():
        archive.read(path, on_demand=limit)


def test_headers_of_version_one_and_two_are_read_and_no_others(tmp_path):
    for version in ((1, 0), (2, 0)):
        path = packed(tmp_path / "a.npz", a=content(CUBE, version))
        np.testing.assert_array_equal(archive.read(path)["a"], CUBE)
    with refused("a is no array ((3, 0))"):
        archive.read(packed(tmp_path / "a.npz", a=content(CUBE, (3, 0))))
    objects = stated("(1,)", "|O", bytes(8))
    with refused("Object arrays cannot be loaded: a holds Python objects") as caught:
        archive.read(packed(tmp_path / "a.npz", a=objects))
    assert isinstance(caught.value, archive.ObjectArrayError)
    assert caught.value.name == "a"


def test_an_array_that_ends_early_is_cut_off(small):
    raw = content(np.arange(100.0))
    np.testing.assert_array_equal(
        archive.read_array(io.BytesIO(raw), "a", len(raw)), np.arange(100.0)
    )
    with refused("damaged: a is cut off"):
        archive.read_array(io.BytesIO(raw[:-1]), "a", len(raw))


def test_members_have_names_of_their_own_and_numpys_methods(tmp_path):
    path = tmp_path / "a.npz"
    for names, method, message in (
        (("a.npy", "a"), STORED, "has two arrays named 'a'"),
        (("a\tb.npy",), STORED, r"has an array named 'a\tb'"),
        (("a.npy", "b.npy"), zipfile.ZIP_BZIP2, "a is compressed by another method than NumPy's"),
        (("a.npy", "b.npy"), DEFLATED, ""),
    ):
        with zipfile.ZipFile(path, "w", method) as file:
            for name in names:
                file.writestr(name, content(CUBE))
        with refused(message) if message else nullcontext():
            assert archive.names_in(path) == ("a", "b")


@pytest.mark.parametrize(
    ("unpacked", "bytes_packed", "message"),
    [
        (2**29, 1, ""),
        (2**29 + 1, 1, "0.537 GB from 1e-06 MB, the limit is 0.537 GB"),
        (2 * 10**9, 10**8, ""),
        (2 * 10**9 + 1, 10**8, "2 GB from 100 MB, the limit is 2 GB"),
    ],
)
def test_what_unpacks_to_half_a_gigabyte_or_twenty_times_its_size_is_read(
    unpacked, bytes_packed, message
):
    text = f"unpacks to {message}; --max-unpacked GB (or NOISE_MAX_UNPACKED=bytes) raises it"
    with refused(text) if message else nullcontext():
        archive.check_unpacked(unpacked, bytes_packed)


def test_another_limit_of_what_is_unpacked_is_a_whole_number(tmp_path, monkeypatch):
    path = packed(tmp_path / "a.npz", DEFLATED, a=np.zeros(5000), b=np.zeros(5000))
    monkeypatch.setenv("NOISE_MAX_UNPACKED", str(2 * (40_000 + 128)))
    assert len(archive.read(path)) == 2
    monkeypatch.setenv("NOISE_MAX_UNPACKED", str(2 * (40_000 + 128) - 1))
    with pytest.raises(ArchiveError, match=r"unpacks to 8.03e-05 GB from 0.0\d+ MB, the limit is"):
        archive.read(path)
    monkeypatch.setenv("NOISE_MAX_UNPACKED", "1e9")
    with refused("NOISE_MAX_UNPACKED is '1e9', expected bytes"):
        archive.read(path)


def test_a_text_is_a_regular_file_in_utf_8_of_some_length(tmp_path, monkeypatch):
    path = tmp_path / "a.urdf"
    path.write_text("nö", encoding="utf-8")
    monkeypatch.setattr(archive, "TEXT", 3)
    assert archive.read_text(path) == "nö"
    path.write_bytes(b"no\xf6")
    with refused("not text in UTF-8"):
        archive.read_text(path)
    path.write_text("four")
    with refused("4 bytes, the limit is 3"):
        archive.read_text(path)
    os.mkfifo(tmp_path / "pipe")
    with refused("is no regular file; save what it holds to one"):
        archive.read_text(tmp_path / "pipe")
    archive.check_regular(tmp_path)


def test_the_words_of_an_error_are_one_line_and_its_name_if_it_has_none():
    assert archive.one_line(ValueError("a\n  b ")) == "a b"
    assert archive.one_line(EOFError()) == "EOFError"


def test_a_text_has_64_mebibytes_at_most(tmp_path):
    path = tmp_path / "a.urdf"
    path.touch()
    os.truncate(path, 64 * 2**20)
    assert len(archive.read_text(path)) == 64 * 2**20
    os.truncate(path, 64 * 2**20 + 1)
    with refused("67108865 bytes, the limit is 67108864"):
        archive.read_text(path)


@pytest.mark.parametrize("columns", [2**62, 2**64, 10**30])
def test_an_empty_array_of_more_columns_than_can_be_is_refused(tmp_path, columns):
    path = packed(tmp_path / "a.npz", a=stated(f"(0, {columns})"))
    with refused(f"damaged: a states shape (0, {columns})"):
        archive.read(path)
