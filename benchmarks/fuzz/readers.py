"""Every reader of users' files: a small whole file of each, the call and the command that read it.

`fuzz.malformed` damages these files for the commands, `fuzz.run` and the tests for the calls.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import date
from functools import cache
from io import BytesIO
from itertools import chain
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np

import noiseclassifier as nc
import noisemodel as nm
from inspector import training, verdict
from inspector.analysis import analyse
from inspector.errors import InspectorError
from inspector.export import read_labels
from inspector.library import load_library, model_files
from inspector.live import pipe
from inspector.live.session import Clock, Warnings
from inspector.logs.clocks import ordered, stamps_of
from inspector.logs.mapping import ReadOptions, Track, parse_mapping
from inspector.logs.names import (
    Naming,
    array_signal,
    column_signal,
    rank_of,
    time_column,
)
from inspector.logs.read import listing, read_logs
from inspector.reference.judging import Expected
from inspector.reference.levels import levels
from inspector.reference.store import Reference, of_runs, save
from noiseclassifier import noisytest
from noiseclassifier.scenarios import ScenarioError
from noiseclassifier.scenarios.dataset import Folder
from noiseclassifier.scenarios.simulation import SHORTEST
from noisemodel import meshes, mjcf, runfile
from noisemodel.surface import triangles
from noisemodel.types import Array

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests"))

# Errors that end a command in one line.
EXPECTED = (InspectorError, nm.NoiseModelError, nc.ModelsError, ScenarioError)
JOINTS = ("a", "b")
TIME = np.arange(200) / 100
POSITION = np.stack((np.sin(6.0 * TIME), np.cos(5.0 * TIME)), axis=1)
VELOCITY = np.stack((6.0 * np.cos(6.0 * TIME), -5.0 * np.sin(5.0 * TIME)), axis=1)

LIMIT = '<limit lower="-9" upper="9" effort="9" velocity="9"/>'
URDF = f"""<robot name="r"><link name="l0"/>
<link name="l1"><inertial><mass value="1.0"/><origin xyz="0 0 0.1" rpy="0 0 0"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<visual><origin xyz="0 0 0.5"/><geometry><box size="0.1 0.1 1.0"/></geometry></visual></link>
<link name="l2"><visual><geometry><MESH/></geometry></visual></link>
<joint name="a" type="revolute"><parent link="l0"/><child link="l1"/>
<axis xyz="0 1 0"/>{LIMIT}</joint>
<joint name="b" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0 0 1"/>
<axis xyz="0 1 0"/>{LIMIT}</joint></robot>
"""
CYLINDER = '<cylinder radius="0.05" length="1.0"/>'
# An MJCF with attributes that multiply: counts, grids, replicas, keys and meshes of numbers.
ATTRIBUTES = """<mujoco model="r"><compiler angle="radian" boundmass="0.1"/>
<option timestep="0.001"/><size nkey="2" nuser_body="1" nuser_geom="1"/>
<default><geom rgba="1 0 0 1"/></default><asset><hfield name="h"
 nrow="3" ncol="3" size="1 1 1 1" elevation="0 1 0 1 0 1 0 1 0"/>
<texture name="t" type="2d" builtin="flat" width="8" height="8"/><material name="m" texture="t"/>
<mesh name="n" builtin="sphere" params="1"/><mesh name="v" maxhullvert="8" scale="1 1 1"
 refpos="0 0 0" refquat="1 0 0 0" vertex="0 0 0 1 0 0 0 1 0 0 0 1"
 face="0 2 1 0 1 3 0 3 2 1 2 3"/></asset>
<worldbody><geom type="hfield" hfield="h"/><body name="l1" mocap="false" user="1">
<joint name="a" axis="0 1 0" range="-9 9" ref="0.1" stiffness="1"/>
<geom type="mesh" mesh="v" user="1"/><geom type="mesh" mesh="n"/><geom type="box" mesh="v"/>
<replicate count="3" offset="0 0 0.1" euler="0 0 0.1"><geom size="0.1"/></replicate>
<body name="l2" pos="0 0 1"><joint name="b" axis="0 1 0" range="-9 9"/>
<geom type="capsule" size="0.05 0.4"/></body></body>
<body name="f"><flexcomp name="x" type="grid"
 count="3 3 1" spacing="0.1 0.1 0.1" radius="0.01" mass="1"/></body>
</worldbody>
<actuator><motor joint="a" lengthrange="0 1" gear="1"/></actuator>
<keyframe><key time="0"/></keyframe></mujoco>
"""
MJCF = """<mujoco model="r"><compiler angle="radian"/><default><geom rgba="1 0 0 1"/></default>
<worldbody><body name="l1"><joint name="a" axis="0 1 0" range="-9 9"/>
<geom type="box" size="0.05 0.05 0.5" pos="0 0 0.5"/>
<body name="l2" pos="0 0 1"><joint name="b" axis="0 1 0" range="-9 9"/>
<geom type="capsule" size="0.05 0.4"/></body></body></worldbody></mujoco>
"""
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
DAE = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<library_geometries><geometry id="g"><mesh><source id="s"><float_array id="f" count="12">{}
</float_array><technique_common><accessor source="#f" count="4" stride="3"/></technique_common>
</source><vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>{}</p></triangles></mesh>
</geometry></library_geometries><library_visual_scenes><visual_scene id="vs"><node id="n">
<matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#vs"/></scene></COLLADA>
"""
LABELS = ((0.0, 0.5, "ok"), (0.6, 0.9, "impact"))


@dataclass(frozen=True)
class Reader:
    """A reader of files."""

    kind: str
    make: Callable[[Path], Path]
    read: Callable[[Path], object]
    command: tuple[str, ...] = ("import", "{}", "-o", "{folder}/out.npz")
    stdin: bool = False
    before: Callable[[], object] = lambda: None


@cache
def run() -> nm.Run:
    """A run of two joints, two seconds at 100 Hz."""
    return nm.Run(
        time=TIME,
        position=POSITION,
        velocity=VELOCITY,
        velocity_desired=VELOCITY + 0.01,
        joint_names=JOINTS,
        blocks=tuple(nm.Block(*each) for each in LABELS),
        meta={"scenario": "x", "events": [{"label": "impact", "start": 0.6, "stop": 0.9}]},
    )


@cache
def library() -> Any:
    """The shipped model."""
    return load_library(model_files())


def _written(name: str, content: str | bytes) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        run().save(folder / "run.npz", overwrite=True)
        path = folder / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return make


def _run_file(folder: Path) -> Path:
    return _written("other", "")(folder).with_name("run.npz")


COLUMNS = "time,a.position,b.position,a.velocity,b.velocity"


def _jumping(step: float = 100.0) -> Array:
    """Stamps of a clock that is set ahead, back, and to zero."""
    return TIME + np.repeat([0.0, step, -1.0, 1e9, -1.0], 40)


# Names of columns as logs have them.
NAMES = """timestamp;time [s];q1;q_d[2];dq1 [deg/s];Joint1;FR_0_target;FR_0_actual
left_shoulder_pitch;PositionCmptd1;Target Pos;robot0_joint_pos;/state/error/q[0]
elbow.velocity_desired;Angular Velocity [dps];actual_TCP_pose_5;rrrrrrrr;l_arm_joint_1"""


def _rows(separator: str = ",", names: str = COLUMNS, *, jump: float = 0.0) -> str:
    rows = np.column_stack((_jumping(jump) if jump else TIME, POSITION, VELOCITY))
    lines = (separator.join(repr(float(each)) for each in row) for row in rows)
    return "\n".join([names.replace(",", separator), *lines]) + "\n"


def _json_rows() -> str:
    rows = zip(TIME.tolist(), POSITION.tolist(), VELOCITY.tolist(), strict=True)
    return "".join(
        json.dumps({"time": time, "position": position, "velocity": velocity}) + "\n"
        for time, position, velocity in rows
    )


def _arrays(name: str, **arrays: Any) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        np.savez(folder / name, **arrays)
        return folder / name

    return make


def _npy(folder: Path) -> Path:
    np.save(folder / "log.npy", np.column_stack((POSITION, VELOCITY)))
    return folder / "log.npy"


def _parquet(folder: Path) -> Path:
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = {"time": TIME, "position": list(POSITION), "velocity": list(VELOCITY)}
    pq.write_table(pa.table(columns), folder / "log.parquet")
    return folder / "log.parquet"


def _matlab(folder: Path) -> Path:
    from scipy.io import savemat

    savemat(folder / "log.mat", {"t": TIME, "arm": {"q": POSITION, "dq": VELOCITY}})
    return folder / "log.mat"


def _lerobot(folder: Path) -> Path:
    from samplelogs import write_lerobot

    return write_lerobot(folder / "set", [POSITION, POSITION], names=list(JOINTS), fps=100)


def _hdf5(folder: Path) -> Path:
    import h5py

    with h5py.File(folder / "log.hdf5", "w") as file:
        file["data/demo_0/time"] = TIME
        file["data/demo_0/obs/joint_pos"] = POSITION
        file["data/demo_0/obs/joint_vel"] = VELOCITY
        file["data/demo_0"].attrs["dt"] = 0.01
    return folder / "log.hdf5"


def _bag(*, ros1: bool = False, **how: Any) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        from samplelogs import Talk, joint_states, numbers, write_bag

        talk = Talk(ros1=ros1)
        states = joint_states(talk, position=numbers() / 10, velocity=numbers(seed=1))[:200]
        path = write_bag(folder / "bag", talk, {"/joint_states": states}, **how)
        if path.is_file():
            return path.rename(folder / "log.bag")
        return next(each for each in path.iterdir() if each.name != "metadata.yaml")

    return lambda folder: make(folder)


def _bag_metadata(folder: Path) -> Path:
    return _bag(storage="sqlite3")(folder).with_name("metadata.yaml")


def _model(folder: Path) -> Path:
    _run_file(folder)
    return _copied(model_files()[0], folder / "model.npz")


def _small_model(folder: Path) -> Path:
    from generalmodel import fixed

    _run_file(folder)
    fixed(rate=100.0).save(folder / "model.npz", overwrite=True)
    return folder / "model.npz"


def _copied(source: Path, target: Path) -> Path:
    target.write_bytes(source.read_bytes())
    return target


def _fast(folder: Path) -> None:
    """Two recordings at 10 kHz, as `inspector tune` wants them."""
    folder.mkdir()
    for number in range(2):
        noise = np.random.default_rng(number).normal(size=8000)
        time = np.arange(8000) / 10_000
        np.savetxt(folder / f"{number}.log", np.column_stack((time, noise)), fmt=("%.4f", "%.3f"))
        text = "chunk_ranges = [[0.0, 0.4], [0.4, 0.8]]\nchunk_labels = ['ok', 'impact']\n"
        (folder / f"{number}.toml").write_text(f"[data]\n{text}")


def _by_command(name: str, *arguments: str) -> Callable[[Path], Path]:
    """A file that a command writes."""

    def make(folder: Path) -> Path:
        _noisytest(folder)
        _run_file(folder)
        _fast(folder / "fast")
        long = np.arange(4000) / 100
        wave = np.sin(np.outer(long, [6.0, 5.0])) + 0.01 * np.sin(np.outer(long, [70.0, 90.0]))
        nm.Run(time=long, velocity=wave, velocity_desired=0.99 * wave, joint_names=JOINTS).save(
            folder / "good.npz"
        )
        place = {"folder": folder, "out": folder / name}
        done = subprocess.run(
            [sys.executable, "-m", "inspector", *(each.format(**place) for each in arguments)],
            capture_output=True,
            check=False,
            cwd=ROOT,
            text=True,
        )
        if not (folder / name).exists():
            raise RuntimeError(f"{arguments}: {done.stderr}")
        return folder / name

    return make


def _noisytest(folder: Path) -> Path:
    (folder / "data").mkdir()
    rows = np.column_stack((TIME, np.hypot(*VELOCITY.T)))
    np.savetxt(folder / "data" / "a.log", rows)
    text = "[data]\nchunk_ranges = [[0.0, 0.5], [0.6, -1.0]]\nchunk_labels = ['ok', 'impact']\n"
    (folder / "data" / "a.toml").write_text(text)
    return folder / "data" / "a.toml"


def _noisytest_log(folder: Path) -> Path:
    return _noisytest(folder).with_suffix(".log")


def _dataset(folder: Path) -> Path:
    return Folder.opened(folder / "set", duration=SHORTEST).path / "dataset.json"


def _mesh(name: str, content: str | bytes) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        mesh = f'<mesh filename="{name}"/>'
        _written("robot.urdf", URDF.replace("<MESH/>", mesh))(folder)
        return _written(name, content)(folder)

    return make


def _stl() -> bytes:
    facets = np.zeros(4, dtype=[("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")])
    facets["c"] = CORNERS[FACES]
    return bytes(80) + (4).to_bytes(4, "little") + facets.tobytes()


def _text_stl() -> str:
    facets = "".join(
        "facet normal 0 0 1\nouter loop\n"
        + "".join(f"vertex {x} {y} {z}\n" for x, y, z in corners)
        + "endloop\nendfacet\n"
        for corners in CORNERS[FACES]
    )
    return f"solid a\n{facets}endsolid a\n"


def _obj() -> str:
    points = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
    return points + "".join(f"f {x + 1}/1 {y + 1} {z + 1}\n" for x, y, z in FACES)


def _dae() -> str:
    return DAE.format(" ".join(map(str, CORNERS.ravel())), " ".join(map(str, FACES.ravel())))


def _read_log(path: Path) -> None:
    listing(path, ReadOptions())
    for _ in read_logs(path):
        pass


def _read_folder(path: Path) -> None:
    for _ in noisytest.read_folder(path.parent):
        pass


def _read_robot(path: Path) -> None:
    triangles(nm.Robot.load(path))


def _read_mesh(path: Path) -> None:
    meshes.read(path)


def _read_rows(path: Path) -> None:
    """Read rows as `inspector live` does, without a viewer."""
    head, _, rest = path.read_bytes().partition(b"\n")
    reader, is_header = pipe.reader_of(head, ())
    for chunk, number in pipe.chunks(BytesIO(rest if is_header else head + b"\n" + rest)):
        times = [
            rows["time"]
            for rows in reader.read(chunk, number, lambda kind, line, count=1: None)
            if "time" in rows
        ]
        _check_clock(iter(times))


def _check_clock(batches: Iterator[Array]) -> None:
    """Give stamps to the clock of `inspector live`: the times that it takes always increase."""
    clock, waiting, last = Clock(100.0, Warnings(lambda line: None)), np.empty(0), -np.inf
    for batch in chain(batches, [None]):
        stamps = waiting if batch is None else np.concatenate((waiting, batch))
        kept, _, time = clock.take(stamps, ended=batch is None)
        waiting = stamps[len(kept) :]
        if not (np.diff(time, prepend=last) > 0).all():
            raise AssertionError("times do not increase")
        last = time[-1] if len(time) else last


def _read_stamps(path: Path) -> None:
    """Stamps as they are, 8 bytes each, of a log and of a live stream."""
    stamps = np.frombuffer(path.read_bytes()[: path.stat().st_size // 8 * 8])
    _check_clock(iter(np.array_split(stamps, 1 + len(stamps) // 7)))
    track = Track("position", ("a",), ("x",), stamps_of(path, "x", stamps, None), stamps[:, None])
    ordered(path, [track])


def _read_names(path: Path) -> None:
    """Names of columns, one a line."""
    names = path.read_text(errors="replace").splitlines()[:20]
    naming = Naming.of(names, ("elbow",))
    for name in names:
        column_signal(name, naming), array_signal(name), rank_of(name)
    time_column(names)


def compile_in_fork() -> None:
    """From now on, compile each MJCF in a fork of this process: starting another takes a second."""

    def run(command: list[str], *, cwd: str, **_: object) -> subprocess.CompletedProcess[bytes]:
        if not (child := os.fork()):
            status = 70
            try:
                os.chdir(cwd)
                names = json.loads(command[2].partition("compile_here(")[2][:-1])
                # What this process has already counts against the limit of memory.
                mjcf.MEMORY += int(Path("/proc/self/statm").read_text().split()[0]) * 4096
                mjcf.SECONDS = 2
                with Path("said").open("w") as sys.stdout:
                    mjcf.compile_here(names)
                status = 0
            except SystemExit as end:
                status = int(end.code or 0)
            finally:
                os._exit(status)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        return subprocess.CompletedProcess(command, status, (Path(cwd) / "said").read_bytes(), b"")

    # Of this module alone: others start processes too.
    mjcf.subprocess = SimpleNamespace(run=run, TimeoutExpired=subprocess.TimeoutExpired)


def _read_resume(path: Path) -> None:
    with verdict.kept(path, _header(path)):
        pass


def _read_tuning(path: Path) -> None:
    with training.opened(path, _header(path), [{"regularization": 1.0}, {"regularization": 10.0}]):
        pass


@cache
def _header(path: Path) -> dict[str, Any]:
    """Settings of a state file, from the first time that it is read, when it is whole."""
    header: dict[str, Any] = json.loads(path.read_bytes().partition(b"\n")[0])
    return {name: value for name, value in header.items() if name != "format"}


def _labels(name: str, content: str) -> Reader:
    return Reader(
        "text",
        _written(name, content),
        lambda path: read_labels(path, run()),
        ("export", "{folder}/run.npz", "--annotate", "{}", "-o", "{folder}/out.npz"),
    )


def _robot(name: str, content: str | bytes, kind: str = "text", *, mesh: bool = False) -> Reader:
    robot = "{folder}/robot.urdf" if mesh else "{}"
    return Reader(
        kind,
        _mesh(name, content) if mesh else _written(name, content),
        _read_mesh if mesh else _read_robot,
        ("noise", "{folder}/run.npz", "--kind", "normal", "--robot", robot),
    )


def _read_run(path: Path) -> None:
    analyse(nm.Run.load(path), library())


def _in_pieces() -> Any:
    """Leave each array of a run in its file, as large ones are left."""
    return patch.object(runfile, "LARGE", 0).start()


def _read_pieces(path: Path) -> None:
    with patch.object(runfile, "LARGE", 0):
        analyse(nm.Run.load(path, on_demand=True), library())


def _read_model(path: Path) -> None:
    analyse(run(), load_library([path]))


EVALUATE = ("evaluate", "general", "{parent}", "--seen-too")
NPY = ReadOptions(rate=100.0, entries=parse_mapping(["position=array[:2]"]))
OUT = "{folder}/out.npz"
CLASSIFY = ("classify", "{}", "--no-reference")
WITH_MODEL = ("classify", "{folder}/run.npz", "--no-reference", "--model", "{}")
TUNE = ("tune", "{folder}/fast", "--folds", "2", "--profile", "noisytest-linear")
SIMULATE = ("simulate", "dataset", "--robots", "panda", "--seeds", "1", "--scenarios", "straight")
SIMULATE += ("--duration", "3")
LIVE = ("live", "--rate", "100", "--save", "{folder}/out.rrd")


def _accepted(folder: Path) -> Path:
    """A store of references with a scenario."""
    run = nm.Run(time=TIME, position=POSITION, velocity=VELOCITY, joint_names=JOINTS)
    waived = Expected(reason="later", until=date(2099, 1, 31))
    (pick,) = of_runs([levels(run, name="pick", file="pick-1.npz")])
    save(Reference(folder, (replace(pick, waive=(waived,)),)), folder)
    return folder / "reference.toml"


# By name.
READERS: Mapping[str, Reader] = MappingProxyType(
    {
        "run": Reader("arrays", _run_file, _read_run, CLASSIFY),
        "run, stored noise": Reader("arrays", _run_file, _read_run, ("noise", "{}")),
        "run, in pieces": Reader("arrays", _run_file, _read_pieces, CLASSIFY, before=_in_pieces),
        "model": Reader("bytes", _model, _read_model, WITH_MODEL),
        "model, small": Reader("arrays", _small_model, _read_model, WITH_MODEL),
        "labels, NoisyTest": _labels(
            "labels.toml",
            "[data]\nchunk_ranges = [[0.0, 0.5], [0.6, -1.0]]\nchunk_labels = ['ok', 'impact']\n",
        ),
        "labels, CSV": _labels("labels.csv", "start,stop,label\n0.0,0.5,ok\n0.6,0.9,impact\n"),
        "labels, Audacity": _labels("labels.txt", "0.0\t0.5\tok\n0.6\t0.9\timpact\n"),
        "mapping": Reader(
            "text",
            lambda folder: _written(
                "map.toml",
                'format = "noise-mapping/1"\nrate = 100.0\nunits = "radians"\n\n[map]\n'
                '"velocity.a" = "a.velocity"\n"velocity.b" = "b.velocity"\ntime = "time"\n',
            )(_written("log.csv", _rows())(folder).parent),
            ReadOptions.load,
            ("import", "{folder}/log.csv", "--mapping", "{}", "-o", OUT),
        ),
        "reference.toml": Reader(
            "text", _accepted, Reference.load, ("classify", "{folder}/run.npz", "--reference", "{}")
        ),
        "resume state": Reader(
            "text",
            _by_command("state", "classify", "{folder}/run.npz", "--resume", "{out}"),
            _read_resume,
            ("classify", "{folder}/run.npz", "--resume", "{}"),
        ),
        "tune state": Reader(
            "text",
            _by_command("tuned.jsonl", *TUNE, "--grid", "C=1,10", "-o", "{out}"),
            _read_tuning,
            (*TUNE, "--grid", "C=1,10", "-o", "{}"),
        ),
        "CSV": Reader("text", _written("log.csv", _rows()), _read_log),
        "CSV, semicolons": Reader(
            "text",
            _written("log.csv", "% a\n" + _rows(";", "time [s],q1,q2,dq1 [deg/s],dq2 [deg/s]")),
            _read_log,
        ),
        "npz of arrays": Reader(
            "arrays",
            _arrays("log.npz", t=TIME, dof_pos=POSITION, dof_vel=VELOCITY, dt=np.array(0.01)),
            _read_log,
        ),
        "MuJoCo's npz": Reader(
            "arrays",
            _arrays("log.npz", time=TIME, qpos=POSITION, qvel=VELOCITY, ctrl=POSITION),
            _read_log,
        ),
        "npy": Reader(
            "bytes",
            _npy,
            lambda path: [*read_logs(path, NPY)],
            ("import", "{}", "--rate", "100", "--map", "position=array[:2]", "-o", OUT),
        ),
        "Parquet": Reader("bytes", _parquet, _read_log),
        "HDF5": Reader("bytes", _hdf5, _read_log),
        "MATLAB": Reader("bytes", _matlab, _read_log),
        "LeRobot info": Reader(
            "text",
            lambda folder: _lerobot(folder) / "meta" / "info.json",
            lambda path: _read_log(path.parents[1]),
            ("import", "{folder}/set", "-o", "{folder}/out"),
        ),
        "LeRobot data": Reader(
            "bytes",
            lambda folder: next((_lerobot(folder) / "data").rglob("*.parquet")),
            lambda path: _read_log(path.parents[2]),
            ("import", "{folder}/set", "-o", "{folder}/out"),
        ),
        "MCAP": Reader("bytes", _bag(storage="mcap"), _read_log),
        "MCAP, zstd": Reader("bytes", _bag(storage="mcap", compression="storage"), _read_log),
        "ROS 2, SQLite": Reader("bytes", _bag(storage="sqlite3"), _read_log),
        "ROS 2, metadata.yaml": Reader(
            "text",
            _bag_metadata,
            lambda path: _read_log(path.parent),
            ("import", "{parent}", "-o", OUT),
        ),
        "ROS 1": Reader("bytes", _bag(ros1=True), _read_log),
        "ROS 1, bz2": Reader("bytes", _bag(ros1=True, compression="bz2"), _read_log),
        "ROS 1, lz4": Reader("bytes", _bag(ros1=True, compression="lz4"), _read_log),
        "URDF": _robot("robot.urdf", URDF.replace("<MESH/>", CYLINDER)),
        "MJCF": _robot("robot.xml", MJCF),
        "MJCF, attributes": _robot("robot.xml", ATTRIBUTES),
        "STL": _robot("mesh.stl", _stl(), "bytes", mesh=True),
        "STL, text": _robot("mesh.stl", _text_stl(), mesh=True),
        "OBJ": _robot("mesh.obj", _obj(), mesh=True),
        "DAE": _robot("mesh.dae", _dae(), mesh=True),
        "live rows, CSV": Reader("text", _written("rows", _rows()), _read_rows, LIVE, stdin=True),
        "live rows, JSON": Reader(
            "text", _written("rows", _json_rows()), _read_rows, LIVE, stdin=True
        ),
        "live rows, jumping clock": Reader(
            "text", _written("rows", _rows(jump=100.0)), _read_rows, LIVE, stdin=True
        ),
        "timestamps": Reader(
            "bytes", _written("stamps", np.sort(_jumping())[::5].tobytes()), _read_stamps, ()
        ),
        "names": Reader("text", _written("names", NAMES.replace(";", "\n")), _read_names, ()),
        "NoisyTest log": Reader("text", _noisytest_log, _read_folder, EVALUATE),
        "NoisyTest labels": Reader("text", _noisytest, _read_folder, EVALUATE),
        "NoisyTest, two columns": Reader("text", _noisytest_log, nc.read_log, CLASSIFY),
        "dataset.json": Reader(
            "text",
            _dataset,
            lambda path: Folder.opened(path.parent, duration=SHORTEST),
            (*SIMULATE, "-o", "{parent}"),
        ),
    }
)
