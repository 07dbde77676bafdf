import json
import os
import re
import zipfile
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from noisemodel import Block, OutputError, Run, RunFileError, archive, runfile
from noisemodel.ondemand import OnDemand

TIME = np.arange(40) / 1000
VELOCITY = np.ones((40, 2))
BASE = {"time": TIME, "velocity": VELOCITY}
TURNED = "expected (40, 2); samples come first, is it transposed?"
NAMES = st.text(st.characters(categories=("L", "M", "N", "P", "S")), min_size=1, max_size=8)
IN_PLACE = settings(
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
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


@settings(IN_PLACE, max_examples=50)
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


def test_any_simulator_writes_a_run_with_one_savez(tmp_path):
    np.savez(tmp_path / "run.npz", time=TIME, velocity=VELOCITY)
    run = Run.load(tmp_path / "run.npz")
    assert np.array_equal(run.velocity, VELOCITY)
    assert run.joint_names == ("joint1", "joint2")
    assert run.robot is None


def test_integers_are_loaded_as_floating_point(tmp_path):
    np.savez(tmp_path / "run.npz", time=np.arange(40), velocity=np.ones((40, 2), dtype=int))
    assert Run.load(tmp_path / "run.npz").velocity.dtype == np.float64


def test_a_saved_run_is_plain_arrays_in_a_zip(tmp_path):
    run = Run(time=TIME, velocity=VELOCITY, joint_names=("a", "b"), meta={"seed": 3})
    run.save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz", allow_pickle=False) as plain:
        assert set(plain.files) == {"format", "time", "velocity", "joint_names", "meta"}
        assert str(plain["format"]) == "noise-run/1"
        assert json.loads(str(plain["meta"])) == {"seed": 3}


def test_noise_is_kept_as_it_is_and_the_rest_is_compressed(tmp_path):
    samples = 100_000
    run = Run(
        time=np.arange(samples) / 1000,
        velocity=np.random.default_rng(0).normal(size=(samples, 2)),
        position=np.zeros((samples, 2)),
        joint_names=("a", "b"),
    )
    run.save(tmp_path / "run.npz")
    with zipfile.ZipFile(tmp_path / "run.npz") as archive:
        kinds = {member.filename: member.compress_type for member in archive.infolist()}
    assert kinds["velocity.npy"] == zipfile.ZIP_STORED
    assert kinds["position.npy"] == kinds["time.npy"] == zipfile.ZIP_DEFLATED
    assert (Run.load(tmp_path / "run.npz").velocity == run.velocity).all()


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


def test_a_listed_robot_is_kept_by_its_name(tmp_path):
    np.savez(tmp_path / "run.npz", time=TIME, velocity=VELOCITY, robot="talos")
    assert Run.load(tmp_path / "run.npz").robot == "talos"


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"velocity": VELOCITY}, "array 'time' is missing; the file has velocity"),
        ({"time": TIME}, "array 'velocity' is missing, and 'position' to differentiate too"),
        ({"time": TIME, "velocty": VELOCITY}, r"'velocty' \(did you mean 'velocity'\?\)"),
        (
            BASE | {"camera": TIME},
            "'camera'; a run file has time, ",
        ),
        ({"time": TIME, "velocity": VELOCITY[:9]}, r"velocity: shape \(9, 2\)"),
        ({"time": TIME, "velocity": TIME}, r"velocity has shape \(40,\), expected \(samples, joi"),
        ({"time": TIME, "velocity": 3.0}, r"velocity has shape \(\), expected \(samples, joints"),
        ({"time": TIME, "position": 3.0}, r"position has shape \(\), expected \(samples, joints"),
        ({"time": 3.0, "velocity": VELOCITY}, r"time has shape \(\), expected \(samples"),
        ({"time": TIME, "velocity": VELOCITY.astype(str)}, "holds <U32, expected numbers"),
        ({"time": TIME, "velocity": VELOCITY * 1j}, "holds complex128, expected numbers"),
        (BASE | {"valid": TIME}, "holds float64, expected booleans"),
        (BASE | {"joint_names": [1, 2]}, "holds int64, expected text"),
        (BASE | {"joint_names": ["a"]}, r"velocity: shape \(40, 2\)"),
        (BASE | {"robot": ["talos"]}, r"robot has shape \(1,\)"),
        ({"time": TIME, "velocity": VELOCITY * np.nan}, "velocity: nan in row 0, column 0"),
        ({"time": TIME[::-1], "velocity": VELOCITY}, "time: runs backwards in row 1"),
        (BASE | {"format": "noise-run/9"}, "expected 'noise-run/1'"),
        (BASE | {"meta": "{"}, "meta: not JSON"),
        (BASE | {"meta": "[" * 10**5}, "meta: not JSON"),
        (BASE | {"meta": "[]"}, "meta: expected a JSON object"),
        (
            BASE | {"block_start": [0.0], "block_stop": [1.0, 2.0]},
            r"block_start, block_stop and block_label have shapes \(1,\), \(2,\), \(0,\)",
        ),
        (
            BASE | {"block_start": [0.02], "block_stop": [0.01], "block_label": ["ok"]},
            "block 'ok': starts at 0.02 s, stops at 0.01 s",
        ),
    ],
)
def test_a_file_with_wrong_arrays_is_refused_in_one_line(tmp_path, arrays, message):
    path = tmp_path / "run.npz"
    np.savez(path, **arrays)
    with pytest.raises(RunFileError, match=message) as caught:
        Run.load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
    assert caught.value.path == path


def test_a_robot_that_is_none_is_named(tmp_path):
    np.savez(tmp_path / "run.npz", **BASE, robot=None)
    with pytest.raises(RunFileError, match="robot holds a Python object, such as None; .* text"):
        Run.load(tmp_path / "run.npz")


def test_object_arrays_are_never_unpickled(tmp_path):
    ran = []

    class Trap:
        def __reduce__(self):
            return (ran.append, (1,))

    velocity = np.array([Trap()], dtype=object)
    np.savez(tmp_path / "run.npz", time=TIME, velocity=velocity)
    with pytest.raises(
        RunFileError, match="not a run file: velocity holds a Python object, .* save numbers"
    ):
        Run.load(tmp_path / "run.npz")
    assert ran == []


def saved(tmp_path):
    path = tmp_path / "run.npz"
    Run(time=TIME, velocity=VELOCITY, joint_names=("a", "b")).save(path)
    return path


@pytest.mark.parametrize(
    ("contents", "message"),
    [
        (b"", "not a run file: File is not a zip file"),
        (b"time,a.velocity\n0,1\n", "not a run file: File is not a zip file"),
        (b"PK\x03\x04 and no more", "not a run file: File is not a zip file"),
    ],
)
def test_a_file_of_another_kind_is_refused(tmp_path, contents, message):
    (tmp_path / "run.npz").write_bytes(contents)
    with pytest.raises(RunFileError, match=message):
        Run.load(tmp_path / "run.npz")


def test_a_truncated_file_is_refused(tmp_path):
    path = saved(tmp_path)
    whole = path.read_bytes()
    for length in range(0, len(whole), 97):
        path.write_bytes(whole[:length])
        with pytest.raises(RunFileError, match=r"run.npz: (not a run file|damaged): "):
            Run.load(path)


@settings(IN_PLACE, max_examples=300)
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


def test_a_zip_of_other_things_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "run.npz", "w") as archive:
        archive.writestr("time.npy", "not an array")
    with pytest.raises(RunFileError, match="not a run file: time is no array"):
        Run.load(tmp_path / "run.npz")


def test_an_archive_that_unpacks_to_too_much_is_not_unpacked(tmp_path, monkeypatch):
    path = tmp_path / "bomb.npz"
    np.savez_compressed(path, time=TIME, velocity=np.zeros((40, 1000)))
    assert path.stat().st_size < 10_000
    monkeypatch.setattr(archive, "UNPACKED", 10**5)
    with pytest.raises(
        RunFileError, match=r"unpacks to 0.000321 GB from 0.00\d+ MB, the limit is 0.0001 GB; --max"
    ):
        Run.load(path)
    monkeypatch.setenv("NOISE_MAX_UNPACKED", "400000")
    assert Run.load(path).velocity.shape == (40, 1000)


def test_an_array_that_states_more_than_there_is_is_refused(tmp_path):
    path = tmp_path / "run.npz"
    header = "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }".ljust(117)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("time.npy", b"\x93NUMPY\x01\x00\x76\x00" + header.encode() + b"\n")
    with pytest.raises(RunFileError, match=r"damaged: time states shape \(1000000000000,\)"):
        Run.load(path)


@pytest.mark.parametrize("shape", ["(-1,)", "(-1, -1)", "(0, -1)"])
def test_an_array_of_a_negative_size_is_refused(tmp_path, shape):
    path = tmp_path / "run.npz"
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117)
    with zipfile.ZipFile(path, "w") as archive:
        content = b"\x93NUMPY\x01\x00\x76\x00" + header.encode() + b"\n"
        archive.writestr("time.npy", content + bytes(0 if "0" in shape else 8))
    with pytest.raises(RunFileError, match=re.escape(f"damaged: time states shape {shape}")):
        Run.load(path)


def test_a_folder_and_a_missing_file_are_named(tmp_path):
    with pytest.raises(RunFileError, match=r"cannot be read \(Is a directory\)"):
        Run.load(tmp_path)
    with pytest.raises(RunFileError, match=r"gone.npz: cannot be read \(No such file"):
        Run.load(tmp_path / "gone.npz")


def test_an_output_that_exists_is_kept(tmp_path):
    path = saved(tmp_path)
    before, run = path.read_bytes(), Run.load(path)
    with pytest.raises(OutputError, match="exists already; choose another name, or overwrite it"):
        run.save(path)
    assert path.read_bytes() == before
    run.save(path, overwrite=True)
    assert os.listdir(tmp_path) == ["run.npz"]


def test_an_output_that_cannot_be_written_is_named(tmp_path):
    run = Run(time=TIME, velocity=VELOCITY, joint_names=("a", "b"))
    with pytest.raises(OutputError, match=r"gone/run.npz: cannot be written \(No such file"):
        run.save(tmp_path / "gone" / "run.npz")
    with pytest.raises(OutputError, match="is a folder; name a file"):
        run.save(tmp_path)
    assert os.listdir(tmp_path) == []


def test_an_interrupted_save_leaves_nothing_behind(tmp_path, monkeypatch):
    def interrupted(stream, *_, **__):
        stream.write(b"half")
        raise KeyboardInterrupt

    run = Run(time=TIME, velocity=VELOCITY, joint_names=("a", "b"))
    monkeypatch.setattr(np.lib.format, "write_array", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run.save(tmp_path / "run.npz")
    assert os.listdir(tmp_path) == []


def test_the_same_run_is_the_same_file(tmp_path):
    one, other = saved(tmp_path), tmp_path / "other.npz"
    Run.load(one).save(other)
    assert other.read_bytes() == one.read_bytes()


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("run.npz", ""),
        ("run.txt", ""),
        ("log.csv", "; `inspector import` makes a run of a CSV log"),
        ("log.bag", ""),
    ],
)
def test_a_csv_log_is_said_to_need_an_import(tmp_path, name, hint):
    path = tmp_path / name
    path.write_text("time,a\n")
    with pytest.raises(RunFileError) as caught:
        Run.load(path)
    assert str(caught.value) == f"{path}: not a run file: File is not a zip file{hint}"


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        (BASE | {"velocity": VELOCITY.T}, f"velocity: shape (2, 40), {TURNED}"),
        (BASE | {"velocity": VELOCITY[:9]}, "velocity: shape (9, 2), expected (40, 2)"),
        (BASE | {"velocity": VELOCITY > 0}, "velocity holds bool, expected numbers"),
        (BASE | {"robot": ["a"]}, "robot has shape (1,), expected (a single text)"),
        (BASE | {"stage_x": TIME}, "stage_x has shape (40,), expected (samples, joints)"),
        (
            BASE | {"block_label": ["ok"]},
            "block_start, block_stop and block_label have shapes (0,), (0,), (1,)",
        ),
        (BASE | {"format": "noise-run/2"}, "format 'noise-run/2', expected 'noise-run/1'"),
        (BASE | {"meta": "3"}, "meta: expected a JSON object"),
        (
            BASE | {"meta": '{"differentiated": 3}'},
            "meta: expected a JSON object as differentiated",
        ),
        (BASE | {"meta": '"\\ud800"'}, "meta: expected a JSON object"),
        (BASE | {"meta": '{"a": "\\ud800"}'}, "meta: holds text that cannot be written as UTF-8"),
        (BASE | {"meta": "[" * 10**5}, "meta: not JSON (nested too deeply)"),
        (
            {"robot": "a", "velocity": VELOCITY},
            "array 'time' is missing; the file has robot, velocity",
        ),
        ({}, "array 'time' is missing; the file has nothing"),
        (
            {"time": TIME, "effort": VELOCITY},
            "array 'velocity' is missing, and 'position' to differentiate too;"
            " the file has time, effort",
        ),
    ],
)
def test_a_file_with_wrong_arrays_is_told_in_these_words(tmp_path, arrays, message):
    np.savez(tmp_path / "run.npz", **arrays)
    with pytest.raises(RunFileError) as caught:
        Run.load(tmp_path / "run.npz")
    assert str(caught.value) == f"{tmp_path / 'run.npz'}: {message}"


@pytest.mark.parametrize(("name", "kind"), [("valid", "booleans"), ("stage_x", "numbers")])
def test_an_array_that_is_none_should_hold_its_own_kind(tmp_path, name, kind):
    np.savez(tmp_path / "run.npz", **BASE, **{name: None})
    text = f"{name} holds a Python object, such as None; leave it out, or save {kind}$"
    with pytest.raises(RunFileError, match=text):
        Run.load(tmp_path / "run.npz")


def test_lists_that_are_empty_are_no_names_and_no_blocks(tmp_path):
    empty = {name: [] for name in ("desired_joint_names", "block_start", "block_label")}
    counts = {"time": np.arange(40, dtype=np.uint16)}
    np.savez(tmp_path / "run.npz", **(BASE | counts | empty), block_stop=np.zeros(0, dtype=int))
    run = Run.load(tmp_path / "run.npz")
    assert run.desired_joint_names == ("joint1", "joint2")
    assert run.blocks == ()
    assert run.rate == 1.0


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
    np.savez(path, velocity=np.zeros((2**13, 2**10)), position=np.zeros((2**12, 2**10)))
    found = runfile.read(path, on_demand=True)
    assert isinstance(found["velocity"], OnDemand)
    assert isinstance(found["position"], np.ndarray)


def test_a_run_is_in_memory_unless_it_is_asked_otherwise(tmp_path, monkeypatch):
    monkeypatch.setattr(runfile, "LARGE", 0)
    path = saved(tmp_path)
    assert isinstance(Run.load(path).velocity, np.ndarray)
    assert isinstance(runfile.read(path)["velocity"], np.ndarray)
    assert isinstance(Run.load(path, on_demand=True).velocity, OnDemand)


def test_a_file_that_is_gone_when_its_rows_are_read_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(runfile, "LARGE", 0)
    path = saved(tmp_path)
    velocity = Run.load(path, on_demand=True).velocity
    path.unlink()
    with pytest.raises(RunFileError, match=rf"^{path}: cannot be read \(No such file or directory"):
        velocity[3:5]


def test_the_order_of_meta_does_not_matter_and_a_robot_is_kept_as_it_is_named(tmp_path):
    files = []
    for name, robot in (("talos", "talos"), ("own", str(tmp_path / "own.urdf"))):
        for meta in ({"seed": 1, "source": "a"}, {"source": "a", "seed": 1}):
            run = Run(time=TIME, velocity=VELOCITY, joint_names=("a", "b"), robot=robot, meta=meta)
            files.append(tmp_path / f"{name}{len(files)}.npz")
            run.save(files[-1])
        assert files[-1].read_bytes() == files[-2].read_bytes()
        assert Run.load(files[-1]).robot == robot
        with np.load(files[-1], allow_pickle=False) as plain:
            assert str(plain["robot"]) == robot
