"""Logs in the manner of 38 public ones: read right as they are, or by the first hint, or refused.

``KINDS`` is a table of docs/log-formats.md: `python docs/generate.py` writes it.
"""

import re
import shlex
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from commandline import call

from inspector import read_log
from inspector.errors import InspectorError
from inspector.logs.mapping import read_options
from inspector.logs.motion import contradictions

DEG = 180 / np.pi
SAMPLES = 1200


def motion(joints, rate):
    """Time, positions and velocities of joints that swing, and targets ahead of them."""
    random, time = np.random.default_rng(0), np.arange(SAMPLES) / rate
    speed = min(2.0, rate / 60) * random.uniform(0.5, 1.0, joints)
    phase, size = random.uniform(0, 6, joints), random.uniform(0.4, 1.2, joints)
    angle = 2 * np.pi * speed * time[:, None] + phase
    return time, size * np.sin(angle), size * 2 * np.pi * speed * np.cos(angle)


def csv(path, header, *columns, mark=","):
    """Columns, each of shape (samples,) or (samples, several), under a header, if there is one."""
    table = np.column_stack(columns)
    integers = [np.all(each == np.rint(each)) for each in table.T]
    rows = [
        mark.join(
            str(int(cell)) if whole else repr(float(cell))
            for cell, whole in zip(row, integers, strict=True)
        )
        for row in table
    ]
    path.write_text("\n".join([*([header] if header else []), *rows]) + "\n")
    return path


def names(pattern, joints, first=1):
    return ",".join(pattern.replace("#", str(number)) for number in range(first, first + joints))


def interleaved(columns, joints):
    return ",".join(each.replace("#", str(number)) for number in range(joints) for each in columns)


T7, Q7, V7 = motion(7, 1000.0)
T12, Q12, V12 = motion(12, 500.0)
T6, Q6, V6 = motion(6, 125.0)
T1, Q1, V1 = motion(1, 500.0)


def gen3(folder, runaway=False):
    commanded = Q7 + 0.01
    if runaway:
        commanded[-20:, 1] = -(10.0 ** np.linspace(2, 235, 20))
    header = ",".join(
        ("Time", *(names(f"{each}#", 7) for each in ("Position", "Velocity", "Torque", "TorqueSm")))
    )
    header += "," + names("PositionCmptd#", 7) + "," + names("VelocityCmptd#", 7)
    parts = (np.arange(SAMPLES) + 1, Q7, V7, Q7, Q7, commanded, V7)
    return csv(folder / "gen3.csv", header, *parts)


def go1_tracking(folder):
    target = np.repeat(Q12[::10], 10, axis=0) * DEG
    table = np.stack((target, Q12 * DEG, target - Q12 * DEG), axis=2).reshape(SAMPLES, -1)
    legs = [f"{leg}_{n}" for leg in ("FR", "FL", "RR", "RL") for n in range(3)]
    header = "timestamp,real_time," + ",".join(
        f"{leg}_{each}" for leg in legs for each in ("target", "actual", "error")
    )
    return csv(folder / "go1.csv", header, T12, 1.7e9 + T12, table)


def go1_policy(folder):
    legs = ",".join(f"{leg}_{n}" for leg in ("FR", "FL", "RR", "RL") for n in range(3))
    return csv(folder / "policy.csv", f"timestamp,{legs}", 1101 + np.arange(SAMPLES), Q12)


def motor(folder):
    header = "Time,Position,Velocity,Position Error,Velocity Setpoint,Velocity Error,Target Torque"
    zeros = np.zeros((SAMPLES, 1))
    steps = np.repeat([[0.0], [40.0]], SAMPLES // 2, axis=0)
    parts = (T1, Q1 * DEG, V1 * DEG * 0.1, zeros, steps, zeros, zeros, steps)
    return csv(folder / "motor.csv", f"{header},Target Pos", *parts)


def exoskeleton(folder):
    header = "Timestamp,Output Angle [deg],Angular Velocity [dps],Gravity Torque [Nm],Is Holding"
    return csv(folder / "one.csv", header, T1, Q1 * DEG, V1 * DEG, Q1, np.zeros(SAMPLES))


def ur5(folder, frozen=False):
    table = np.hstack((Q6, V6, 10 * Q6))
    if frozen:
        table[800:] = table[800]
    return csv(folder / "ur5.csv", "", T6, table, mark=" ")


def rtde(folder, doubled=False):
    header = ",".join(names(f"actual_{each}_#", 6, 0) for each in ("q", "qd", "TCP_pose"))
    time, position, velocity = motion(6, 125.0 if doubled else 50.0)
    if not doubled:
        return csv(folder / "rtde.csv", header, position, velocity, Q6)
    twice = names("target_current_#", 6, 0).replace("current_1", "current_0")
    header = f"timestamp,{header},{twice}"
    return csv(folder / "rtde.csv", header, time, position, velocity, Q6, Q6)


def bare(header, joints, rate=100.0, after=0):
    """A writer of positions under names of joints alone, and of columns that are none."""

    def write(folder):
        time, position, _ = motion(joints, rate)
        other = np.random.default_rng(1).normal(size=(SAMPLES, after))
        stamped = [time] if header.lower().startswith("time") else []
        return csv(folder / "bare.csv", header, *stamped, position, other)

    return write


def mat(folder, *, struct=False, seven=False):
    time, position, velocity = motion(6, 250.0)
    variables = {"t": time[:, None], "q": position, "qd": velocity}
    if seven:
        h5py = pytest.importorskip("h5py")
        path = folder / "log.mat"
        with h5py.File(path, "w", userblock_size=512) as file:
            for name, each in variables.items():
                file[f"run/{name}"] = each.T
                file[f"run/{name}"].attrs["MATLAB_class"] = np.bytes_("double")
        with path.open("r+b") as stream:
            stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
        return path
    from scipy.io import savemat

    turned = {name: each.T for name, each in variables.items()}
    savemat(folder / "log.mat", {"run": turned} if struct else variables, do_compression=struct)
    return folder / "log.mat"


def timeseries(folder):
    """A signal logged by Simulink as a structure with time."""
    from scipy.io import savemat

    time, position, _ = motion(6, 250.0)
    signals = {"values": position, "label": "q"}
    savemat(folder / "log.mat", {"q": {"time": time[:, None], "signals": signals}})
    return folder / "log.mat"


@dataclass(frozen=True)
class Kind:
    """A kind of log, and what becomes of it."""

    title: str  # whose log is written so
    header: str  # its columns, or what it holds
    write: Callable[[Path], Path]
    rate: float  # the true rate, in [Hz], which a hint may ask for
    joints: tuple[str, ...] = ()  # none of a log that is refused for good
    signals: str = "position, velocity"  # that are read
    said: str = ""  # part of what is said
    hint: str = ""  # what the first message says to type; empty where nothing has to be
    told: str = ""  # part of what is told of a contradiction
    typed: str = ""  # if the first message is too general to be followed


def numbered(pattern, count, first=1):
    return tuple(names(pattern, count, first).split(","))


LEGS = tuple(f"{leg}_{n}" for leg in ("FR", "FL", "RR", "RL") for n in range(3))
QD = ",".join(("time", names("q#", 6), names("dq#", 6), names("tau#", 6)))
BARE = "names of joints alone, taken for positions"
FITS = "at which positions and velocities fit"
ALL = "position, velocity, effort, position_desired, velocity_desired"
HZ = "--rate HZ"
NO_HEADER = "there is no header"

# The table; rows without joints are refused for good.
KINDS = (
    Kind(
        "Kinova Gen3, a counter as Time",
        "Time,Position1…,Velocity1…,Torque1…,PositionCmptd1…,VelocityCmptd1…",
        gen3, 1000.0, numbered("joint_#", 7), ALL, f"'Time' counts samples: 1000 Hz, {FITS}",
    ),
    Kind(
        "Kinova Gen3 whose command runs away", "PositionCmptd2 of -1e+235",
        lambda folder: gen3(folder, runaway=True), 1000.0, numbered("joint_#", 7), ALL,
        "no position in any unit: 20 samples of position desired left out",
    ),
    Kind(
        "Unitree Go1, targets and errors", "timestamp,real_time,FR_0_target,FR_0_actual,…",
        go1_tracking, 500.0, LEGS, "position, position_desired", BARE, "--units degrees",
    ),
    Kind(
        "Unitree Go1, a policy's counter", "timestamp,FR_0,FR_1…", go1_policy, 50.0, LEGS,
        "position", "counts samples: 50 Hz, as --rate says", HZ,
    ),
    Kind(
        "a motor whose velocity is a tenth of the slope",
        "Time,Position,Velocity,Position Error,Velocity Setpoint,…,Target Pos", motor, 500.0,
        ("joint_0",), "position, velocity, position_desired, velocity_desired",
        hint="--units degrees", told="are 0.1 times the slopes of their positions",
    ),
    Kind(
        "one joint, words and units", "Timestamp,Output Angle [deg],Angular Velocity [dps]…",
        exoskeleton, 500.0, ("joint_0",), said="converted from dps",
    ),
    Kind(
        "UR5, no header", "19 numbers", ur5, 125.0, numbered("joint_#", 6),
        "position, velocity, effort", hint=NO_HEADER, typed=f"--columns {QD}",
    ),
    Kind(
        "UR5 whose logger froze", "the last row for 3.2 s", lambda folder: ur5(folder, frozen=True),
        125.0, numbered("joint_#", 6), "position, velocity, effort", "the log froze",
        hint=NO_HEADER, typed=f"--columns {QD}",
    ),
    Kind(
        "UR by RTDE, no stamps", "actual_q_0…,actual_qd_0…,actual_TCP_pose_0…", rtde, 50.0,
        numbered("joint_#", 6, 0), said=f"there are no stamps: 50 Hz, {FITS}",
    ),
    Kind(
        "UR by RTDE, two columns of one name", "…,target_current_0,target_current_0",
        lambda folder: rtde(folder, doubled=True), 125.0, numbered("joint_#", 6, 0),
    ),
    Kind(
        "KUKA, joints and a pose", "time,joint_0…joint_6,x,y,z,qw…",
        bare(f"time,{names('joint_#', 7, 0)},x,y,z,qw,qx,qy,qz", 7, after=7), 100.0,
        numbered("joint_#", 7, 0), "position", BARE,
    ),
    Kind(
        "Z1, a state machine", "Time(s),FSM_State,Joint1…6,End_X(m)…",
        lambda folder: csv(
            folder / "z1.csv", f"Time(s),FSM_State,{names('Joint#', 6)},End_X(m),End_Y(m)",
            T6, np.full(SAMPLES, 2.0), Q6, Q6[:, :2],
        ),
        125.0, numbered("Joint#", 6), "position", BARE,
    ),
    Kind(
        "UR by words, no stamps", "shoulder,upper_arm,forearm,wrist_1…",
        bare("shoulder,upper_arm,forearm,wrist_1,wrist_2,wrist_3", 6), 100.0,
        ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"), "position", BARE, HZ,
    ),
    Kind(
        "seven axes, joint by joint, no stamps", "joint_0_pos,joint_0_vel,joint_0_torque,…",
        lambda folder: csv(
            folder / "axes.csv",
            interleaved(("joint_#_pos", "joint_#_vel", "joint_#_torque"), 7) + ",contact_force",
            np.stack((*motion(7, 50.0)[1:], Q7), axis=2).reshape(SAMPLES, -1), np.zeros(SAMPLES),
        ),
        50.0, numbered("joint_#", 7, 0), "position, velocity, effort", f"50 Hz, {FITS}",
    ),
    Kind(
        "set points by many words", "time,j1_sp,j1_act,j2_sp,j2_act",
        lambda folder: csv(
            folder / "set.csv", "time,j1_sp,j1_act,j2_sp,j2_act", T6,
            np.repeat(Q6[:, :2], 2, axis=1),
        ),
        125.0, ("j1", "j2"), "position, position_desired", BARE,
    ),
    Kind(
        "encoders by number", "time,enc_1…enc_6,temp_1…",
        lambda folder: csv(
            folder / "enc.csv", f"time,{names('enc_#', 6)},{names('temp_#', 6)}", T6, Q6, 20 + Q6
        ),
        125.0, numbered("joint_#", 6), "position",
        hint="all of one form: --map 'position.{joint}=enc_{joint}'",
        typed="--map 'position.joint_{joint}=enc_{joint}'",
    ),
    Kind("MATLAB 5, variables", "t, q, qd", mat, 250.0, numbered("joint_#", 6, 0)),
    Kind("MATLAB 5, a struct, transposed", "run.t, run.q, run.qd",
         lambda folder: mat(folder, struct=True), 250.0, numbered("joint_#", 6, 0)),
    Kind("MATLAB 7.3, a struct", "run.t, run.q, run.qd", lambda folder: mat(folder, seven=True),
         250.0, numbered("joint_#", 6, 0)),
    Kind("Simulink, a structure with time", "q.time, q.signals.values", timeseries, 250.0,
         numbered("joint_#", 6, 0), "position"),
    Kind("poses alone", "time,x,y,z,a,b,c",
         lambda folder: csv(folder / "rsi.csv", "time,x,y,z,a,b,c", T6, Q6), 125.0,
         hint="no position or velocity of a joint"),
)  # fmt: skip


def followed(message, rate):
    """Options that the first message says to type, taken literally; HZ is the true rate."""
    options = {}
    command = message.replace(HZ, f"--rate {rate:g}").replace("; ", " ").replace(", or ", " ")
    if quoted := re.findall(r"^--map ('[^']*')", command):
        options["mapping"] = [shlex.split(quoted[0])[0]]
    if found := re.search(r"--columns (\S+)", command):
        options["columns"] = tuple(found[1].rstrip(";,").split(","))
    if (found := re.search(r"--rate ([\d.]+)", command)) and "but --rate" not in command:
        options["rate"] = float(found[1])
    if found := re.search(r"--units (\w+)", command):
        options["units"] = found[1]
    return options


def read(kind, folder):
    """The import of a log as it is or by the first hint, and that hint."""
    path = kind.write(folder)
    try:
        return read_log(path), ""
    except InspectorError as error:
        if not kind.joints:
            return None, str(error)
        options = followed(kind.typed or str(error), kind.rate)
        return read_log(path, **options), str(error)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.title)
def test_a_log_is_read_right_as_it_is_or_by_the_first_hint(tmp_path, kind):
    imported, hint = read(kind, tmp_path)
    assert kind.hint in hint
    assert bool(hint) == bool(kind.hint), hint
    if not kind.joints:
        return
    run, said = imported.run, "; ".join(imported.remarks)
    assert run.joint_names == kind.joints
    assert run.rate == pytest.approx(kind.rate, rel=1e-5)
    logged = [
        name
        for name in ALL.split(", ")
        if getattr(run, name) is not None and name not in run.meta.get("differentiated", {})
    ]
    assert ", ".join(logged) == kind.signals
    frozen = range(801, SAMPLES) if "froze" in kind.said else ()
    assert np.flatnonzero(~run.mask).tolist() == [*frozen] or "runs away" in kind.title
    assert kind.said in said
    told = " ".join(contradictions(run))
    assert kind.told in told
    assert bool(told) == bool(kind.told), told


def written(tmp_path, header, *columns):
    return csv(tmp_path / "log.csv", header, *columns)


@pytest.mark.parametrize(
    ("header", "mapping", "message"),
    [
        ("t,a_cmd,b_cmd", "velocity.{joint}={joint}_meas", "fits no column .* columns are a_cmd"),
        ("t,q1,q2", "velocity.{joint}=q", "a pattern has {joint} once on either side"),
        ("t,a_x,b_x", "position.{joint}={joint}_x velocity.{joint}={joint}_x", "mapped twice"),
        (
            "t,a_x,a_y", "position.{joint}={joint}_x position.{joint}={joint}_y",
            "log.csv: 'a_x' and 'a_y' are both mapped to position.a; map one of them",
        ),
        (
            "t,a_x,b_x", "position.{joint}={joint}_x position.a=b_x",
            "log.csv: 'b_x' and 'a_x' are both mapped to position.a; map one of them",
        ),
    ],
)  # fmt: skip
def test_a_pattern_that_does_not_fit_is_one_line(tmp_path, header, mapping, message):
    path = written(tmp_path, header, T6, Q6[:, :2])
    with pytest.raises(InspectorError, match=message) as caught:
        read_log(path, mapping=mapping.split(" "))
    assert "\n" not in str(caught.value)


def test_a_pattern_maps_all_columns_of_its_form_and_is_saved(tmp_path):
    path = written(tmp_path, "t,a_x,b_x,a_y,b_y,note_1", T6, Q6[:, :2], V6[:, :2], Q6[:, 0])
    patterns = ["position.{joint}={joint}_x", "velocity.{joint}={joint}_y"]
    run = read_log(path, mapping=patterns).run
    assert run.joint_names == ("a", "b")
    assert np.array_equal(run.velocity, V6[:, :2])
    options = read_options(patterns)
    options.save(tmp_path / "map.toml")
    assert read_options(saved=tmp_path / "map.toml") == options


def test_two_patterns_for_one_column_take_the_more_specific(tmp_path):
    path = written(tmp_path, "t,a,b,a_cmd,b_cmd", T6, Q6[:, :2], Q6[:, :2])
    patterns = ["position.{joint}={joint}", "position_desired.{joint}={joint}_cmd"]
    run = read_log(path, mapping=patterns).run
    assert run.joint_names == run.desired_joint_names == ("a", "b")


def test_a_quaternion_is_no_four_joints(tmp_path):
    turn = np.column_stack([np.cos(T6), np.sin(T6), 0 * T6, 0 * T6])
    path = written(tmp_path, f"t,{names('q#', 4, 0)}", T6, turn)
    message = "q0, q1, q2, q3 hold a quaternion .* name them: --map"
    with pytest.raises(InspectorError, match=message):
        read_log(path)
    assert len(read_log(path, mapping=["position.joint_{joint}=q{joint}"]).run.joint_names) == 4


@pytest.mark.parametrize(
    "header", ["t,x,y,angle", "t,cmd1,cmd2", "t,ref,y", "t,joint1_target,joint2_target", "t,u1,u2"]
)
def test_set_points_and_poses_are_no_measured_joints(tmp_path, header):
    path = written(tmp_path, header, T6, Q6[:, : header.count(",")])
    with pytest.raises(InspectorError, match="no position or velocity of a joint"):
        read_log(path)


def test_units_may_differ_by_column(tmp_path):
    path = written(tmp_path, "t,j1 [deg],j2 [rad]", T6, DEG * Q6[:, 0], Q6[:, 1])
    assert np.allclose(read_log(path).run.position, Q6[:, :2], rtol=1e-12)


def test_a_counter_with_holes_has_gaps(tmp_path):
    kept = np.delete(np.arange(SAMPLES), slice(200, 300))
    path = written(tmp_path, f"step,{names('q#', 2)}", 7 + kept, Q6[kept, :2])
    with pytest.raises(InspectorError, match="there are no stamps; .* --rate HZ, or name their"):
        read_log(path)
    with pytest.raises(InspectorError, match="'step' counts samples; give the log's rate"):
        read_log(path, mapping=["time=step"])
    run = read_log(path, mapping=["time=step"], rate=125).run
    assert np.array_equal(np.flatnonzero(~run.mask), np.arange(200, 300))


@pytest.mark.parametrize(
    "name", ["q2 [Nm]", "q2 [rad/s]", "elbow_torque_deg", "elbow_velocity [deg]"]
)
def test_a_column_whose_unit_contradicts_its_name_is_not_read(tmp_path, name):
    path = written(tmp_path, f"t,q1 [deg],{name}", T6, DEG * Q6[:, 0], Q6[:, 1])
    imported = read_log(path)
    assert imported.run.joint_names == ("joint_1",)
    assert f"log.csv: 1 column not read: {name}" in imported.remarks
    assert len(read_log(path, mapping=[f"position.elbow={name}"]).run.joint_names) == 2


def test_a_rate_that_does_not_fit_is_refused_unless_forced(tmp_path):
    path = rtde(tmp_path)
    with pytest.raises(InspectorError, match="fit a rate of 50 Hz, not 240 Hz: type --rate 50"):
        read_log(path, rate=240)
    imported = read_log(path, rate=240, force=True)
    assert imported.run.rate == 240
    assert "times the slopes of their positions" in " ".join(contradictions(imported.run))


def test_velocities_without_relation_to_positions_are_told_by_import_and_audit(tmp_path):
    path = written(tmp_path, f"t,{names('q#', 2)},{names('dq#', 2)}", T6, Q6[:, :2], V6[:, 4:])
    expected = "velocities of all joints have no relation to the slopes of their positions"
    _, out, _ = call("import", path, "-o", tmp_path / "run.npz")
    assert expected in out
    assert expected in call("audit", path)[1]


def test_a_robot_that_stands_still_or_is_not_logged_yet_is_not_frozen(tmp_path):
    position, velocity = Q6.copy(), V6.copy()
    position[400:], velocity[400:] = position[400], 0.0
    position[:100], velocity[:100] = np.nan, np.nan
    path = written(tmp_path, f"t,{names('q#', 6)},{names('dq#', 6)}", T6, position, velocity)
    imported = read_log(path)
    assert np.array_equal(imported.run.mask, np.arange(len(T6)) >= 100)
    assert not any("froze" in remark for remark in imported.remarks)


@pytest.mark.parametrize(
    ("variables", "damage", "message"),
    [
        (
            {"ts": np.array([[1.0]])},
            lambda data: data[:144] + b"\x11" + data[145:],  # the class of an object of MATLAB's
            "no known joint .* it has no numbers; .* save ts.Time and ts.Data",
        ),
        (
            {"t": np.arange(300.0)[:, None]},
            lambda data: data[:177] + b"\xff" + data[178:],  # a type that ends the process in SciPy
            "states 300 numbers and holds 2400 bytes",
        ),
        ({"t": np.arange(300.0)}, lambda data: data[:-8], "a variable is shorter than it states"),
    ],
)
def test_a_mat_file_that_holds_no_numbers_is_one_line(tmp_path, variables, damage, message):
    from scipy.io import savemat

    savemat(tmp_path / "a.mat", variables)
    (tmp_path / "a.mat").write_bytes(damage((tmp_path / "a.mat").read_bytes()))
    with pytest.raises(InspectorError, match=message):
        read_log(tmp_path / "a.mat")


@pytest.mark.parametrize("day", ["9999-01-01", "1600-01-01"])
def test_dates_that_no_clock_has_are_one_line(tmp_path, day):
    path = tmp_path / "log.csv"
    path.write_text(f"time,q1\n{day} 00:00:00.0,1\n{day} 00:00:00.1,2\n")
    message = f"row 2: column .time. holds .{day} .*, which is no time"
    with pytest.raises(InspectorError, match=message):
        read_log(path)


def row(kind, folder):
    """A line of the table in the documentation."""
    imported, hint = read(kind, folder)
    command = kind.typed or kind.hint
    typed = f"`{command.replace('|', chr(92) + '|')}`" if kind.joints and hint else "nothing"
    if imported is None:
        return f"| {kind.title} | `{kind.header}` | refused: {kind.hint} | | |"
    remarks = [each.partition(": ")[2] or each for each in imported.remarks]
    said = "; ".join(remarks).replace("|", "\\|") or "nothing"
    return f"| {kind.title} | `{kind.header}` | {typed} | {said} | {kind.signals} |"


def table():
    """The table of kinds in Markdown."""
    with tempfile.TemporaryDirectory() as folder:
        rows = []
        for number, kind in enumerate(KINDS):
            place = Path(folder) / str(number)
            place.mkdir()
            rows.append(row(kind, place))
    return "\n".join(["| log | columns | typed | said | read |", "|---|---|---|---|---|", *rows])
