"""Arrays in archives: what is read of them, from any place, and what is refused."""

import io
import json
import os
import re
import struct
import zipfile
from contextlib import nullcontext, suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.lib import format as npy

from noisemodel import Block, Run, RunFileError, runfile
from noisemodel.runfile import ArchiveError, OnDemand, pieces, rows_at_once

TIME = np.arange(40) / 1000
VELOCITY = np.ones((40, 2))
BASE = {"time": TIME, "velocity": VELOCITY}
TURNED = "expected (40, 2); samples come first, is it transposed?"
KNOWN = (
    "a run file has time, and velocity or position, and of time, velocity, position,"
    " velocity_desired, position_desired, effort, valid, joint_names, desired_joint_names,"
    " base_pose, base_velocity, robot, block_start, block_stop, block_label, format, meta and"
    " stage_<name> what there is; anything else belongs into meta"
)
NEEDED = "expected 'time', and 'velocity' or 'position'"
OBJECT = "meta: expected a JSON object, and one as differentiated"
NAMES = st.text(st.characters(categories=("L", "M", "N", "P", "S")), min_size=1, max_size=8)
IN_PLACE = settings(
    deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)


@st.composite
def runs(draw):
    """Small runs with any of the optional arrays."""
    samples, joints, desired = (draw(st.integers(n, 6)) for n in (2, 1, 1))

    def signal(width):
        kind = draw(st.sampled_from([np.float32, np.float64]))
        numbers = st.floats(-1e6, 1e6, width=32)
        return draw(arrays(kind, (samples, width), elements=numbers))

    def perhaps(make):
        return make() if draw(st.booleans()) else None

    def names(count):
        return tuple(draw(st.lists(NAMES, min_size=count, max_size=count, unique=True)))

    step = draw(st.sampled_from([1e-4, 1e-3, 0.02]))
    start = draw(st.floats(-100, 100))
    time = start + step * np.arange(samples)
    valid = draw(arrays(bool, samples))
    valid[0] = True
    return Run(
        time=time,
        velocity=signal(joints),
        joint_names=names(joints),
        position=perhaps(lambda: signal(joints)),
        velocity_desired=perhaps(lambda: signal(desired)),
        position_desired=perhaps(lambda: signal(desired)),
        desired_joint_names=names(desired),
        stages={name: signal(joints) for name in draw(st.lists(NAMES, max_size=2, unique=True))},
        effort=perhaps(lambda: signal(joints)),
        valid=perhaps(lambda: valid),
        base_pose=perhaps(lambda: np.tile([1, 2, 3, 0.6, 0, 0, 0.8], (samples, 1))),
        base_velocity=perhaps(lambda: signal(6)),
        robot=draw(st.none() | st.sampled_from(["talos", "a robot of ours"])),
        blocks=perhaps(lambda: (Block(time[0], time[-1], draw(NAMES)),)) or (),
        meta=draw(
            st.dictionaries(
                st.text(st.characters(exclude_categories=("Cs",)), max_size=5),
                st.none() | st.booleans() | st.integers() | st.text(max_size=5) | st.floats(0, 9),
                max_size=3,
            )
        ),
    )


@settings(IN_PLACE, max_examples=25)
@given(run=runs())
def test_what_is_saved_is_loaded_bit_for_bit(tmp_path, run):
    run.save(tmp_path / "run.npz", overwrite=True)
    again = Run.load(tmp_path / "run.npz")
    signals = {"time": run.time} | {name: signal for name, signal, _ in run._signals()}
    loaded = {"time": again.time} | {name: signal for name, signal, _ in again._signals()}
    for name in again.meta.get("differentiated", ()):
        loaded.pop(name)
    assert loaded.keys() == signals.keys()
    for name, signal in signals.items():
        assert loaded[name].dtype == signal.dtype
        assert loaded[name].tobytes() == signal.tobytes()
    assert np.array_equal(again.mask, run.mask)
    for name in ("joint_names", "desired_joint_names", "robot", "blocks"):
        assert getattr(again, name) == getattr(run, name)
    assert {k: v for k, v in again.meta.items() if k != "differentiated"} == dict(run.meta)


def test_any_simulator_writes_a_run_with_one_savez_of_any_numbers(tmp_path):
    velocity = np.ones((40, 2), dtype=int)
    np.savez(tmp_path / "run.npz", time=np.arange(40), velocity=velocity, robot="talos")
    run = Run.load(tmp_path / "run.npz")
    assert np.array_equal(run.velocity, VELOCITY)
    assert run.velocity.dtype == np.float64
    assert run.joint_names == ("joint_0", "joint_1")
    assert run.robot == "talos"


def test_a_saved_run_is_plain_arrays_in_a_zip(tmp_path):
    run = Run(time=TIME, velocity=VELOCITY, joint_names=("a", "b"), meta={"seed": 3})
    run.save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz", allow_pickle=False) as plain:
        assert set(plain.files) == {"format", "time", "velocity", "joint_names", "meta"}
        assert str(plain["format"]) == "noise-run/1"
        assert json.loads(str(plain["meta"])) == {"seed": 3}


def test_a_urdf_is_found_from_the_file_wherever_that_is_read_or_copied(tmp_path, monkeypatch):
    (tmp_path / "a" / "robots").mkdir(parents=True)
    (tmp_path / "b").mkdir()
    urdf = tmp_path / "a" / "robots" / "arm.urdf"
    urdf.touch()
    np.savez(tmp_path / "a" / "run.npz", time=TIME, velocity=VELOCITY, robot="robots/arm.urdf")
    assert Run.load(tmp_path / "a" / "run.npz").robot == str(urdf)
    monkeypatch.chdir(tmp_path)
    Run.load("a/run.npz").save("b/copy.npz")
    with np.load("b/copy.npz", allow_pickle=False) as copy:
        assert str(copy["robot"]) == "../a/robots/arm.urdf"
    assert urdf.samefile(Run.load("b/copy.npz").robot)


def test_object_arrays_are_never_unpickled(tmp_path):
    ran = []

    class Trap:
        def __reduce__(self):
            return (ran.append, (1,))

    velocity = np.array([Trap()], dtype=object)
    np.savez(tmp_path / "run.npz", time=TIME, velocity=velocity)
    with pytest.raises(RunFileError, match="velocity holds a Python object"):
        Run.load(tmp_path / "run.npz")
    assert ran == []


def saved(tmp_path):
    path = tmp_path / "run.npz"
    Run(time=TIME, velocity=VELOCITY, joint_names=("a", "b")).save(path)
    return path


def test_a_truncated_file_is_refused(tmp_path):
    path = saved(tmp_path)
    whole = path.read_bytes()
    for length in range(1, len(whole), 97):
        path.write_bytes(whole[:length])
        with pytest.raises(RunFileError, match=r"run.npz: (not a run file|damaged): "):
            Run.load(path)


@settings(IN_PLACE, max_examples=200)
@given(data=st.data())
def test_a_damaged_file_is_a_run_or_one_error(tmp_path, data):
    path = tmp_path / "run.npz"
    if not path.exists():
        saved(tmp_path)
    damaged = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    (tmp_path / "damaged.npz").write_bytes(damaged)
    with suppress(RunFileError):
        Run.load(tmp_path / "damaged.npz")


def test_a_folder_and_a_missing_file_are_named(tmp_path):
    with pytest.raises(RunFileError, match=r"cannot be read \(Is a directory\)"):
        Run.load(tmp_path)
    with pytest.raises(RunFileError, match=r"gone.npz: cannot be read \(No such file"):
        Run.load(tmp_path / "gone.npz")


def test_the_same_run_is_the_same_file(tmp_path):
    one, other = saved(tmp_path), tmp_path / "other.npz"
    Run.load(one).save(other)
    assert other.read_bytes() == one.read_bytes()


@pytest.mark.parametrize("content", [b"", b"time,a\n", b"PK\x03\x04 and no more"])
@pytest.mark.parametrize(
    ("name", "hint"),
    [("run.npz", ""), ("log.csv", "; `inspector import` makes a run of a CSV log")],
)
def test_a_file_of_another_kind_is_refused(tmp_path, name, hint, content):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(RunFileError) as caught:
        Run.load(path)
    assert str(caught.value) == f"{path}: not a run file: File is not a zip file{hint}"


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        (BASE | {"velocity": VELOCITY.T}, f"velocity: shape (2, 40), {TURNED}"),
        (BASE | {"velocity": VELOCITY > 0}, "velocity holds bool, expected numbers"),
        (BASE | {"robot": ["a"]}, "robot has shape (1,), expected (a single text)"),
        (BASE | {"stage_x": TIME}, "stage_x has shape (40,), expected (samples, joints)"),
        (
            BASE | {"block_label": ["ok"]},
            "block_start, block_stop and block_label have shapes (0,), (0,), (1,)",
        ),
        (BASE | {"format": "noise-run/2"}, "format 'noise-run/2', expected 'noise-run/1'"),
        (BASE | {"meta": "3"}, OBJECT),
        (BASE | {"meta": '{"differentiated": 3}'}, OBJECT),
        ({"robot": "a", "velocity": VELOCITY}, f"it has robot, velocity, {NEEDED}"),
        ({}, f"it has nothing, {NEEDED}"),
        (BASE | {"velocty": TIME}, f"unknown array 'velocty' (did you mean 'velocity'?); {KNOWN}"),
        (BASE | {"camera": TIME}, f"unknown array 'camera'; {KNOWN}"),
        (BASE | {"velocity": TIME}, "velocity has shape (40,), expected (samples, joints)"),
        ({"time": TIME, "position": 3.0}, "position has shape (), expected (samples, joints)"),
        (BASE | {"time": 3.0}, "time has shape (), expected (samples)"),
        (BASE | {"velocity": VELOCITY.astype(str)}, "velocity holds <U32, expected numbers"),
        (BASE | {"valid": TIME}, "valid holds float64, expected booleans"),
        (BASE | {"joint_names": [1, 2]}, "joint_names holds int64, expected text"),
        (BASE | {"joint_names": ["a"]}, "velocity: shape (40, 2), expected (40, 1)"),
        (
            BASE | {"block_start": [0.02], "block_stop": [0.01], "block_label": ["ok"]},
            "block 'ok': starts at 0.02 s, stops at 0.01 s",
        ),
    ],
)
def test_a_file_with_wrong_arrays_is_told_in_these_words(tmp_path, arrays, message):
    np.savez(tmp_path / "run.npz", **arrays)
    with pytest.raises(RunFileError) as caught:
        Run.load(tmp_path / "run.npz")
    assert str(caught.value) == f"{tmp_path / 'run.npz'}: {message}"
    assert caught.value.path == tmp_path / "run.npz"


@pytest.mark.parametrize(
    ("meta", "problem"),
    [
        ("{", r"Expecting property name enclosed in double quotes: line 1 column 2 \(char 1\)"),
        ('{"a": "\\ud800"}', "'utf-8' codec can't encode character .*: surrogates not allowed"),
        ("[" * 10**5, "maximum recursion depth exceeded.*"),
        ("1" * 5000, "Exceeds the limit .*"),
    ],
)
def test_a_meta_that_is_no_json_is_one_line(tmp_path, meta, problem):
    np.savez(tmp_path / "run.npz", **BASE, meta=meta)
    with pytest.raises(RunFileError, match=rf"meta: no JSON that can be kept \({problem}\)$"):
        Run.load(tmp_path / "run.npz")


def test_lists_that_are_empty_are_no_names_and_no_blocks(tmp_path):
    empty = {name: [] for name in ("desired_joint_names", "block_start", "block_label")}
    np.savez(tmp_path / "run.npz", **(BASE | empty), block_stop=np.zeros(0, dtype=int))
    run = Run.load(tmp_path / "run.npz")
    assert run.desired_joint_names == ("joint_0", "joint_1")
    assert run.blocks == ()


@pytest.mark.parametrize(
    ("noise", "method"), [(0.7, zipfile.ZIP_DEFLATED), (0.9, zipfile.ZIP_STORED)]
)
def test_what_compression_makes_smaller_by_a_fifth_is_compressed(tmp_path, noise, method):
    content = np.random.default_rng(0).integers(0, 256, (400, 1000), dtype=np.uint8)
    content[:, int(1000 * noise) :] = 0
    path = tmp_path / "run.npz"
    runfile.write(path, {"a": content.view("<u8"), "b": np.zeros(10**5)}, overwrite=False)
    with zipfile.ZipFile(path) as file:
        noisy, zeros = file.infolist()
    assert (noisy.compress_type, zeros.compress_type) == (method, zipfile.ZIP_DEFLATED)
    assert zeros.compress_size < zeros.file_size / 100
    share = noisy.compress_size / noisy.file_size
    assert noise < share < 0.8 if method == zipfile.ZIP_DEFLATED else share == 1.0


def test_signals_of_64_megabytes_stay_in_the_file_only_if_that_is_asked(tmp_path):
    path = tmp_path / "run.npz"
    large = {"velocity": np.zeros((2**13, 2**10)), "position": np.zeros((2**13 - 1, 2**10))}
    runfile.write(path, large, overwrite=False)
    with zipfile.ZipFile(path) as file:
        assert [each.compress_type for each in file.infolist()] == [STORED, DEFLATED]
    found = runfile.read(path, on_demand=True)
    assert isinstance(found["velocity"], OnDemand)
    assert isinstance(found["position"], np.ndarray)
    assert isinstance(runfile.read(path)["velocity"], np.ndarray)
    path.unlink()
    with pytest.raises(RunFileError, match=rf"^{path}: cannot be read \(No such file or directory"):
        found["velocity"][3:5]


STORED, DEFLATED = zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED
CUBE = np.cumsum(np.arange(60.0 * 2 * 3)).reshape(60, 2, 3)


def refused(text, error=ArchiveError):
    """Expect an error with this whole text."""
    return pytest.raises(error, match=f"^{re.escape(text)}$")


def content(array, version=(1, 0)):
    stream = io.BytesIO()
    npy.write_array(stream, array, version=version)
    return stream.getvalue()


def headed(text, data=b""):
    """An array's header, as it may be written by anybody, and its bytes."""
    header = text.ljust(117) + "\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(header)) + header.encode() + data


def stated(shape, kind="<f8", data=b""):
    return headed(f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}", data)


def packed(path, method=STORED, **members):
    with zipfile.ZipFile(path, "w", method) as file:
        for name, each in members.items():
            file.writestr(f"{name}.npy", each if isinstance(each, bytes) else content(each))
    return path


@pytest.fixture
def small(monkeypatch):
    """Pieces of some bytes."""
    monkeypatch.setattr(runfile, "PIECE", 50)


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("method", [STORED, DEFLATED])
def test_arrays_are_read_in_pieces_and_larger_ones_on_demand_by_their_rows(
    tmp_path, small, method, order
):
    cube = np.asarray(CUBE, order=order)
    size = len(content(cube))
    path = packed(tmp_path / "a.npz", method, long=np.arange(1000), cube=cube, text=np.array("a"))
    assert runfile.names_in(path) == ("long", "cube", "text")
    assert list(runfile.read_npz(path, ["cube", "other"])) == ["cube"]
    for limit, stays in ((float("inf"), False), (size, False), (size - 1, True), (0, True)):
        found = runfile.read_npz(path, on_demand=limit)
        assert list(found) == ["long", "cube", "text"]
        assert isinstance(found["long"], np.ndarray)
        np.testing.assert_array_equal(found["long"], np.arange(1000))
        assert str(found["text"]) == "a"
        stays = stays and order == "C" and method == STORED
        assert isinstance(found["cube"], OnDemand) == stays
        for first, stop in ((0, 60), (57, 60), (3, 4), (20, 40), (7, 7), (0, 1), (59, 60)):
            np.testing.assert_array_equal(found["cube"][first:stop], CUBE[first:stop])


def test_a_wrong_checksum_is_found_when_an_array_was_read_in_order(tmp_path, small):
    raw = content(np.tile(CUBE, (9, 1, 1)))
    path = packed(tmp_path / "a.npz", cube=raw)
    damaged = bytearray(path.read_bytes())
    damaged[damaged.index(raw) + len(raw) - 1] ^= 1  # the last byte of the last row
    path.write_bytes(damaged)
    with refused("Bad CRC-32 for file 'cube.npy'"):
        runfile.read_npz(path)
    cube = runfile.read_npz(path, on_demand=0)["cube"]
    cube[10:540]  # the sum of a part is unknown
    cube[0:20], cube[20:300]
    with refused(f"{path}: not a run file: damaged: wrong checksum of cube", RunFileError):
        cube[300:540]


def test_a_file_that_is_cut_later_is_refused(tmp_path, monkeypatch):
    """Where nothing else shows that it was changed."""
    monkeypatch.setattr(runfile, "_identity", lambda file: ())
    table = np.random.default_rng(0).normal(size=(300, 2))
    path = packed(tmp_path / "a.npz", table=table)
    found = runfile.read_npz(path, on_demand=0)["table"]
    path.write_bytes(path.read_bytes()[:2000])
    np.testing.assert_array_equal(found[3:50], table[3:50])
    with refused(f"{path}: not a run file: damaged: table is cut off", RunFileError):
        found[100:300]


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
        runfile.read_npz(path, on_demand=limit)


def test_headers_of_version_one_and_two_are_read_and_no_others(tmp_path):
    for version in ((1, 0), (2, 0)):
        path = packed(tmp_path / "a.npz", a=content(CUBE, version))
        np.testing.assert_array_equal(runfile.read_npz(path)["a"], CUBE)
    with refused("a is no array ((3, 0))"):
        runfile.read_npz(packed(tmp_path / "a.npz", a=content(CUBE, (3, 0))))
    objects = stated("(1,)", "|O", bytes(8))
    text = "a holds a Python object, such as None; leave it out, or save plain numbers or text"
    with pytest.raises(ArchiveError, match=f"^{text}$") as caught:
        runfile.read_npz(packed(tmp_path / "a.npz", a=objects))
    assert isinstance(caught.value, runfile.ObjectArrayError)
    assert caught.value.name == "a"


def test_an_array_that_ends_early_is_cut_off(small):
    raw = content(np.arange(100.0))
    np.testing.assert_array_equal(
        runfile.read_array(io.BytesIO(raw), "a", len(raw)), np.arange(100.0)
    )
    with refused("damaged: a is cut off"):
        runfile.read_array(io.BytesIO(raw[:-1]), "a", len(raw))


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
        runfile.check_unpacked(unpacked, bytes_packed)


def test_another_limit_of_what_is_unpacked_is_a_whole_number(tmp_path, monkeypatch):
    path = packed(tmp_path / "a.npz", DEFLATED, a=np.zeros(5000), b=np.zeros(5000))
    monkeypatch.setenv("NOISE_MAX_UNPACKED", str(2 * (40_000 + 128)))
    assert len(runfile.read_npz(path)) == 2
    monkeypatch.setenv("NOISE_MAX_UNPACKED", str(2 * (40_000 + 128) - 1))
    with pytest.raises(ArchiveError, match=r"unpacks to 8.03e-05 GB from 0.0\d+ MB, the limit is"):
        runfile.read_npz(path)
    monkeypatch.setenv("NOISE_MAX_UNPACKED", "1e9")
    with refused("NOISE_MAX_UNPACKED is '1e9', expected bytes"):
        runfile.read_npz(path)


def test_a_text_is_a_regular_file_in_utf_8_of_some_length(tmp_path, monkeypatch):
    path = tmp_path / "a.urdf"
    path.write_text("nö", encoding="utf-8")
    monkeypatch.setattr(runfile, "TEXT", 3)
    assert runfile.read_text(path) == "nö"
    path.write_bytes(b"no\xf6")
    with refused("not text in UTF-8"):
        runfile.read_text(path)
    path.write_text("four")
    with refused("4 bytes, the limit is 3"):
        runfile.read_text(path)
    os.mkfifo(tmp_path / "pipe")
    with refused("is no regular file; save what it holds to one"):
        runfile.read_text(tmp_path / "pipe")
    runfile.check_regular(tmp_path)


VALUES = np.arange(300.0).reshape(100, 3)


@pytest.fixture
def read():
    """The rows that were read, from the first to the one after the last."""
    return []


@pytest.fixture
def array(read, monkeypatch):
    """An array of 100 rows, of which 8 are read at once."""
    monkeypatch.setattr(runfile, "AT_ONCE", 8 * 3 * 8 + 23)

    def rows(first, stop):
        read.append((first, stop))
        return VALUES[first:stop]

    return OnDemand((100, 3), np.float64, rows)


@pytest.mark.parametrize(
    ("key", "parts"),
    [
        (slice(5, 9), [(5, 9)]),
        (slice(None), [(0, 100)]),
        (slice(-3, None), [(97, 100)]),
        (slice(9, 5), [(9, 9)]),
        (slice(20, 40, 3), [(16, 24), (24, 32), (32, 40)]),
        (slice(10, 0, -5), [(0, 8), (8, 16)]),
        (np.array([3, 10, 4, 11, 2, 2, 99]), [(0, 8), (8, 16), (96, 100)]),
        (np.array([-100, 0, -93, -92, -1]), [(0, 8), (8, 16), (96, 100)]),
        (np.array([5, 7], dtype=np.uint8), [(0, 8)]),
        (np.isin(np.arange(100), [0, 50, 57, 58]), [(0, 8), (48, 56), (56, 64)]),
        (np.zeros(0, dtype=int), []),
        ((slice(5, 9), 1), [(5, 9)]),
        ((np.array([5, 9]), slice(1, 3)), [(0, 8), (8, 16)]),
    ],
)
def test_only_rows_that_are_needed_are_read_some_at_once(array, read, key, parts):
    np.testing.assert_array_equal(array[key], VALUES[key])
    assert read == parts


@pytest.mark.parametrize("key", [7, (7, 2), [3, 4], (np.newaxis, 3), VALUES > 40])
def test_whatever_else_is_asked_reads_the_whole_once(array, read, key):
    np.testing.assert_array_equal(array[key], VALUES[key])
    assert float(array.max()) == 299.0
    np.testing.assert_array_equal(array + array[4:5], VALUES + VALUES[4])
    np.testing.assert_array_equal(np.add.reduce(array, axis=1), VALUES.sum(axis=1))
    np.testing.assert_array_equal(array[5:9], VALUES[5:9])
    assert np.asarray(array) is np.asarray(array)
    assert np.asarray(array, dtype=np.float32).dtype == np.float32
    assert np.asarray(array, dtype=np.float64) is np.asarray(array)
    assert read == [(0, 100)]


@pytest.mark.parametrize(
    ("shape", "rows"),
    [((9, 3), 8), ((9, 2, 3), 4), ((9,), 25), ((9, 25), 1), ((9, 26), 1), ((9, 0), 100)],
)
def test_rows_at_once_take_so_many_bytes_and_are_one_at_least(monkeypatch, shape, rows):
    monkeypatch.setattr(runfile, "AT_ONCE", 100)
    assert rows_at_once(np.zeros(shape, dtype=np.float32)) == rows


@pytest.mark.parametrize(
    ("multiple", "parts"),
    [(1, [(0, 9), (9, 18), (18, 20)]), (2, [(0, 8), (8, 16), (16, 20)]), (10, [(0, 10), (10, 20)])],
)
def test_pieces_have_a_multiple_of_rows_and_end_where_the_array_does(monkeypatch, multiple, parts):
    monkeypatch.setattr(runfile, "AT_ONCE", 110)
    array = np.zeros((20, 3), dtype=np.float32)
    assert [(each.start, each.stop) for each in pieces(array, multiple)] == parts
    if multiple == 1:
        assert [(each.start, each.stop) for each in pieces(array)] == parts
        assert list(pieces(array[:0])) == []
        assert list(pieces(array[:9])) == [slice(0, 9)]
