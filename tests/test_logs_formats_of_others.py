"""Logs as robots and tools write them, each of which is imported untouched.

``FORMATS`` is a table of docs/log-formats.md: `python docs/generate.py` writes it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from commandline import printed

from inspector import read_log
from inspector.errors import LogError
from inspector.logs.names import column_signal

TIME = np.arange(21) / 100
EPOCH = 1_700_000_000  # where absolute stamps start, in [s] since 1970
METHOD = "differentiated from positions (Savitzky-Golay, window 7, order 3)"
FOUND = "look like degrees: converted to radians (if they are not, --units radians)"


def motion(time=TIME):
    """Signals of two joints that swing, by name, each of shape (samples, 2)."""
    phase = 2 * np.pi * time[:, None] * [5.0, 4.0] + [0.0, 1.0]
    position = [0.8, 0.5] * np.sin(phase)
    velocity = [0.8, 0.5] * np.cos(phase) * 2 * np.pi * [5.0, 4.0]
    signals = {"position": position, "velocity": velocity, "effort": 10 * position}
    desired = {f"{name}_desired": 0.9 * signals[name] for name in ("position", "velocity")}
    return signals | desired


MOTION = motion()
P, V, PD, VD, E = "position", "velocity", "position_desired", "velocity_desired", "effort"


@dataclass(frozen=True)
class Format:
    """A log that others write, and the run that it becomes."""

    title: str  # what writes it, or what is peculiar to it
    shown: str  # its header
    text: str  # the file
    signals: tuple[str, ...]  # of the run, which are those of the motion
    joints: tuple[str, ...] = ("joint_1", "joint_2")
    said: tuple[str, ...] = ()  # the remarks, without the name of the file
    gaps: tuple[int, ...] = ()  # samples in gaps

    @property
    def row(self) -> str:
        """Its line in the table of the page."""
        said = "; ".join(self.said).replace("|", "\\|") or "nothing"
        joints = ", ".join(self.joints)
        return (
            f"| {self.title} | `{self.shown}` | nothing"
            f" | {said} | {', '.join(self.signals)} of {joints} |"
        )


def table(
    header: str,
    signals: Sequence[str],
    *,
    mark: str = ",",
    stamp: Callable[[float], object] | None = repr,
    scale: dict[str, float] | None = None,
    cells: Sequence[str] = (),
    end: str = "",
    number: Callable[[float], str] = repr,
) -> str:
    """A header, and a row per sample: its stamp, other cells, both joints of each signal."""
    values = np.hstack([(scale or {}).get(each, 1.0) * MOTION[each] for each in signals])
    rows = [header] if header else []
    for time, sample in zip(TIME.tolist(), values.tolist(), strict=True):
        stamped = [] if stamp is None else [str(stamp(time))]
        rows.append(mark.join([*stamped, *cells, *map(number, sample)]) + end)
    return "\n".join(rows) + "\n"


def names(pattern: str, first: int = 1) -> str:
    """A column's name for both joints, such as "q1,q2"."""
    return ",".join(pattern.replace("#", str(number)) for number in (first, first + 1))


def comma(number: float) -> str:
    """A number with a decimal comma."""
    return repr(number).replace(".", ",")


def ticks(unit: float, since: int = EPOCH) -> Callable[[float], str]:
    """Stamps in whole units of so many to the second."""
    return lambda time: str(since * round(unit) + round(time * unit))


def damaged(text: str) -> str:
    """The same with a cell that is nan in line 7, and one that is empty in line 12."""
    lines = text.split("\n")
    for line, cell in ((6, "nan"), (11, "")):
        lines[line] = ",".join([*lines[line].split(",")[:-1], cell])
    return "\n".join(lines)


def each_of(*patterns: str, first: int = 0, mark: str = ",") -> str:
    """The names of both joints' columns, by several patterns."""
    return ",".join(names(each, first) for each in patterns).replace(",", mark)


def stamped(header: str, *signals: str, **how: Any) -> str:
    """A table whose stamps are named "time"."""
    return table(f"time,{header}", signals, **how)


DEG = 180 / np.pi
QDQ = each_of("q#", "dq#", first=1)
START = f"time starts at 0; the first stamp, {EPOCH} s, is in meta"
ROSTOPIC = (
    "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.name0,field.name1,"
    + each_of(*(f"field.{each}#" for each in (P, V, E)))
)
FRANKA = "time, success_rate, state.theta[0], state.theta[1], " + each_of(
    *(f"state.{each}[#]" for each in ("q", "q_d", "dq", "dq_d", "tau_J")), "cmd.q_d[#]", mark=", "
)
RTDE = each_of("target_q_#", "target_qd_#", "target_moment_#", "actual_q_#", "actual_qd_#")
UNREAD = "{} not read: {}"
ELBOW, FROM_0 = ("shoulder", "elbow"), ("joint_0", "joint_1")

FORMATS = (
    Format(
        "names as in run files", "time,elbow.velocity,elbow.velocity_desired",
        stamped(",".join(f"{j}.{s}" for s in (P, V, VD) for j in ELBOW), P, V, VD),
        (P, V, VD), ELBOW,
    ),
    Format(
        "PlotJuggler, a JointState", "__time,/joint_states/elbow/velocity",
        table("__time," + ",".join(f"/joint_states/{j}/{s}" for s in (P, V) for j in ELBOW), (P, V),
              stamp=lambda time: f"{EPOCH + time:.2f}"),
        (P, V), ELBOW, (START,),
    ),
    Format(
        "PlotJuggler, a controller's state",
        "__time,/arm/state/feedback/velocities[0],/arm/state/reference/velocities[0]",
        table("__time," + each_of(*(f"/arm/state/{each}/velocities[#]"
                                    for each in ("feedback", "reference"))), (V, VD)),
        (V, VD), FROM_0,
    ),
    Format(
        "UR RTDE, record.py", "timestamp actual_q_0 actual_qd_0 target_qd_0",
        table("timestamp " + each_of("actual_q_#", "actual_qd_#", "target_qd_#",
                                     "actual_TCP_speed_#", mark=" "), (P, V, VD, E), mark=" "),
        (P, V, VD), FROM_0, (UNREAD.format("2 columns", "actual_TCP_speed_0, actual_TCP_speed_1"),),
    ),
    Format(
        "ur_rtde, startFileRecording",
        "timestamp,target_q_0,target_qd_0,target_moment_0,actual_q_0,actual_qd_0",
        table(f"timestamp,{RTDE}", (PD, VD, E, P, V)), (P, V, PD, VD), FROM_0,
        (UNREAD.format("2 columns", "target_moment_0, target_moment_1"),),
    ),
    Format(
        "ROS 1, rostopic echo -p", "%time,field.header.seq,…,field.name0,field.velocity0",
        table(ROSTOPIC, (P, V, E), stamp=ticks(1e9),
              cells=("1", f"{EPOCH}000000000", "base", "shoulder", "elbow")),
        (P, V, E), FROM_0,
        ("stamps are in nanoseconds",
         UNREAD.format("5 columns", ", ".join(f"field.{e}" for e in (
             "header.seq", "header.stamp", "header.frame_id", "name0", "name1"))), START),
    ),
    Format(
        "libfranka, logToCSV",
        "time, success_rate, state.q[0], state.dq[0], state.dq_d[0], cmd.q_d[0]",
        table(FRANKA, (E, P, PD, V, VD, E, E), stamp=ticks(1e3, 42), cells=("1.0",)),
        (P, V, PD, VD, E), FROM_0,
        ("stamps are in milliseconds",
         UNREAD.format("5 columns", "success_rate, state.theta[0], state.theta[1], cmd.q_d[0],"
                       " cmd.q_d[1]"),
         "time starts at 0; the first stamp, 42 s, is in meta"),
    ),
    Format(
        "symbols, the desired position as qd", "t,q1,dq1,qd1",
        table(f"t,{QDQ},{names('qd#')}", (P, V, PD)), (P, V, PD),
        said=("qd is the desired position, since dq is the velocity (else --map)",
              f"velocity_desired: {METHOD}"),
    ),
    Format(
        "a joint's name, then words; a comma ends each line", "time,arm_1_joint_velocity,",
        stamped(f"{names('arm_#_joint_position')},{names('arm_#_joint_velocity')},", P, V, end=","),
        (P, V), ("arm_1_joint", "arm_2_joint"),
    ),
    Format(
        "short words", "time,joint1_pos,joint1_vel,joint1_cmd_vel,joint1_eff,joint1_target",
        stamped(each_of(*(f"joint#_{e}" for e in ("pos", "vel", "cmd_vel", "eff", "target")),
                        first=1), P, V, VD, E, P),
        (P, V, VD, E), ("joint1", "joint2"),
        (UNREAD.format("2 columns", "joint1_target, joint2_target"),),
    ),
    Format(
        "two arms", "time,left_q_1,left_dq_1,right_q_1,right_dq_1",
        stamped("left_q_1,right_q_1,left_dq_1,right_dq_1", P, V), (P, V), ("left_1", "right_1"),
    ),
    Format(
        "a legged robot's joints", "t,LF_HAA_q,LF_HAA_dq,LF_HAA_tau",
        table("t,LF_HAA_q,LF_HFE_q,LF_HAA_dq,LF_HFE_dq,LF_HAA_tau,LF_HFE_tau", (P, V, E)),
        (P, V, E), ("LF_HAA", "LF_HFE"),
    ),
    Format(
        "decimal commas, degrees in the header", "Time (ms);Joint 1 speed (deg/s)",
        table("Time (ms);Joint 1 speed (deg/s);Joint 2 speed (deg/s)", (V,), mark=";",
              stamp=lambda time: comma(1e3 * time), scale={V: DEG}, number=comma),
        (V,), ("Joint 1", "Joint 2"),
        ("stamps are in milliseconds",
         "Joint 1 speed (deg/s), Joint 2 speed (deg/s): converted from deg/s, as their names say"),
    ),
    Format(
        "a spreadsheet: tabs, units in a row of their own", "Time\\tJ1\\tJ2",
        table("Time\tJ1\tJ2\n[s]\t[deg]\t[deg]", (P,), mark="\t", scale={P: DEG}),
        (P,), ("J1", "J2"),
        ("J1 [deg], J2 [deg]: converted from deg, as their names say", f"velocity: {METHOD}"),
    ),
    Format(
        "milliradians, as exponents", "time q1[mrad] dq1[mrad/s] q_d1[mrad] dq_d1[mrad/s]",
        table("time " + each_of("q#[mrad]", "dq#[mrad/s]", "q_d#[mrad]", "dq_d#[mrad/s]", first=1,
                                mark=" "), (P, V, PD, VD), mark=" ",
              scale=dict.fromkeys((P, V, PD, VD), 1e3), number=lambda value: f"{value:20.12E}"),
        (P, V, PD, VD), said=(
            "q1[mrad], q2[mrad], q_d1[mrad], q_d2[mrad]: converted from mrad, as their names say",
            "dq1[mrad/s], dq2[mrad/s], dq_d1[mrad/s], dq_d2[mrad/s]: converted from mrad/s, as"
            " their names say"),
    ),
    Format(
        "dates with a zone, desired first", "dq_d1,dq1,Time",
        "dq_d1,dq_d2,dq1,dq2,Time\n" + "".join(
            f"{row.partition(',')[2]},{row.partition(',')[0]}\n" for row in table(
                "", (VD, V), stamp=lambda time: f"2023-11-14 23:13:20.{round(100 * time):02}+01:00"
            ).splitlines()),
        (V, VD), said=("time starts at 0; the first stamp, 1700000000 s, is in meta",),
    ),
    Format(
        "turns per minute", "time,motor1_speed_rpm",
        stamped(names("motor#_speed_rpm"), V, scale={V: 30 / np.pi}), (V,), ("motor1", "motor2"),
        ("motor1_speed_rpm, motor2_speed_rpm: converted from rpm, as their names say",),
    ),
    Format(
        "ROS 2, seconds and nanoseconds",
        "header.stamp.sec,header.stamp.nanosec,position[0],velocity[0]",
        table("header.stamp.sec,header.stamp.nanosec," + each_of("position[#]", "velocity[#]"),
              (P, V), stamp=lambda time: f"{EPOCH},{round(time * 1e9)}"),
        (P, V), FROM_0, (START,),
    ),
    Format(
        "the stamps' unit in their name", "timestamp_ms,q1,dq1",
        table(f"timestamp_ms,{QDQ}", (P, V), stamp=ticks(1e3, 0)), (P, V),
        said=("stamps are in milliseconds",),
    ),
    *(
        Format(
            f"stamps in {unit}, since {when}", "timestamp,q1,dq1",
            table(f"timestamp,{QDQ}", (P, V), stamp=ticks(size, since)), (P, V),
            said=(f"stamps are in {unit}", *((START,) if since else ())),
        )
        for unit, size in (("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9))
        for since, when in ((0, "the start"), (EPOCH, "1970"))
    ),
    Format("a separator at the end of each row alone", "time,q1,dq1",
           stamped(QDQ, P, V, end=","), (P, V)),
    Format("NumPy, savetxt with a header", "# time q1 dq1",
           table(f"# time {QDQ}".replace(",", " "), (P, V), mark=" "), (P, V)),
    Format(
        "lines before the header, and comments", "# robot: arm 7, tool: none",
        "# robot: arm 7, tool: none\nStation 4\n\n" + stamped(QDQ, P, V) + "# end\n",
        (P, V), said=("2 lines before the rows not read",),
    ),
    Format(
        "a byte order mark, quotes, DOS line ends", '"time","q1","dq1"',
        "\ufeff" + stamped(QDQ, P, V).replace("\n", "\r\n").replace(f"time,{QDQ}", ",".join(
            f'"{name}"' for name in f"time,{QDQ}".split(","))),
        (P, V),
    ),
    Format("pandas, with an index", ",time,q1,dq1",
           table(f",time,{QDQ}", (P, V), stamp=lambda time: f"{round(100 * time)},{time!r}"),
           (P, V)),
    Format(
        "cells that are nan or empty", "time,q1,dq1", damaged(stamped(QDQ, P, V)), (P, V),
        said=("2 samples without a number, marked as not valid: dq2, the first at 0.05 s",),
        gaps=(5, 10),
    ),
    Format(
        "degrees that nothing tells", "time,q1,dq1,dq_d1",
        stamped(f"{QDQ},{names('dq_d#')}", P, V, VD, scale=dict.fromkeys((P, V, VD), DEG)),
        (P, V, VD), said=(f"positions and velocities {FOUND}",),
    ),
    Format("desired positions alone", "time,q1,dq1,q_d1",
           stamped(f"{QDQ},{names('q_d#')}", P, V, PD), (P, V, PD),
           said=(f"velocity_desired: {METHOD}",)),
    Format(
        "one joint", "time,position,velocity,target.velocity,temperature",
        "time,position,velocity,target.velocity,temperature\n"
        + "".join(f"{time!r},{p!r},{v!r},{d!r},40\n" for time, p, v, d in zip(
            TIME.tolist(), *(MOTION[each][:, 0].tolist() for each in (P, V, VD)), strict=True)),
        (P, V, VD), ("joint_0",), (UNREAD.format("1 column", "temperature"),),
    ),
)  # fmt: skip


@pytest.mark.parametrize("each", FORMATS, ids=lambda each: each.title)
def test_a_log_of_others_is_imported_untouched_and_says_what_was_assumed(tmp_path, each):
    path = tmp_path / "log.csv"
    path.write_bytes(each.text.encode())
    imported = read_log(path)
    run = imported.run
    remarks = tuple(remark.removeprefix("log.csv: ") for remark in imported.remarks)
    assert (remarks, run.joint_names, run.rate) == (each.said, each.joints, 100.0)
    assert np.allclose(run.time, TIME, rtol=0, atol=1e-9)
    assert tuple(np.flatnonzero(~run.mask)) == each.gaps
    for signal, values in MOTION.items():
        found = getattr(run, signal)
        if signal in each.signals:
            wanted = values[run.mask, : len(each.joints)]
            assert np.allclose(found[run.mask], wanted, rtol=0, atol=1e-9), signal
        elif f"{signal}: {METHOD}" in each.said:
            error = np.abs(found - values)[3:-3]
            assert error.max() < 0.05 * np.abs(values).max()
        else:
            assert found is None, signal


def test_a_listing_tells_what_each_column_is_taken_for(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("Time [ms];q1;elbow_vel [deg/s];qd;ctrl_0;temperature;\n0;1;2;3;4;5;\n")
    _, rows, *columns = map(str.strip, printed("import", path, "--list").splitlines())
    assert (rows, columns[0]) == ("1 rows", "Time [ms]  stamps")
    assert columns[1:3] == ["q1  position of joint 1", "elbow_vel [deg/s]  velocity of elbow"]
    unread = ["qd  not known", "ctrl_0  a column of an array", "temperature  not known"]
    assert columns[3:] == unread


def test_columns_take_the_place_of_a_header_and_leave_columns_out(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(table("a,b,c,d,e", (P, V)))
    imported = read_log(path, columns=("time", "", "", "elbow.velocity", "wrist.velocity"))
    assert imported.run.joint_names == ("elbow", "wrist")
    assert imported.remarks == ("log.csv: 1 line before the rows not read",)
    with pytest.raises(LogError, match="5 cells where --columns names 3 columns"):
        read_log(path, columns=("time", "q1", "q2"))


def test_milliseconds_that_could_be_seconds_are_known_by_positions_and_velocities(tmp_path):
    time = np.arange(4000) / 2000
    rows = np.column_stack((time, np.sin(3 * time), 3 * np.cos(3 * time)))
    lines = [f"{1000 * t:g},{q:.9f},{v:.9f}" for t, q, v in rows]
    (tmp_path / "log.csv").write_text("\n".join(["time,q1,dq1", *lines]))
    found = read_log(tmp_path / "log.csv")
    assert found.run.rate == pytest.approx(2000.0)
    assert any("positions and velocities fit, if stamps are in" in each for each in found.remarks)


def test_dates_a_second_apart_are_no_milliseconds(tmp_path):
    lines = [f"2024-03-01T00:{i // 60:02}:{i % 60:02},{np.sin(i)}" for i in range(200)]
    (tmp_path / "log.csv").write_text("\n".join(["time,q1", *lines]))
    assert read_log(tmp_path / "log.csv").run.rate == 1.0


@pytest.mark.parametrize("word", ["Set", "Demand", "Nominal", "traj", "requested", "tgt"])
def test_a_set_point_is_never_a_measured_signal(word):
    name = f"Axis1.{word}Vel" if word.istitle() else f"Axis1_{word}_vel"
    assert column_signal(name) == ("velocity_desired", "Axis1")
    assert column_signal("Axis1_max_vel") is None


@pytest.mark.parametrize(
    ("stamp", "message"),
    [
        (lambda time: round(100 * time), "'time' counts samples; give the log's rate.* --rate HZ"),
        (ticks(1e4, 0), "100 is milliseconds or microseconds; .* --rate 10 or --rate 10000$"),
        (lambda time: EPOCH + round(100 * time),
         "step of 1 is seconds or milliseconds; .* --rate 1 or --rate 1000$"),
        (ticks(1e3, EPOCH * 10**5), "median step of 10 is none that is known; .* --rate 100$"),
    ],
)  # fmt: skip
def test_stamps_whose_unit_is_open_are_refused_with_the_option_to_type(tmp_path, stamp, message):
    path = tmp_path / "log.csv"
    path.write_text(table("time,q1,q2", (P,), stamp=stamp))
    with pytest.raises(LogError, match=message):
        read_log(path)


@pytest.mark.parametrize(
    ("columns", "joints"),
    [("q0,q1", (1, 2)), ("q1,q2", (1, 2)), ("joint1_pos,joint2_pos", (1, 2)), ("q5,q6", (5, 6)),
     ("J1 [rad],J2 [rad]", (1, 2)), ("joint4_pos,joint7_pos", (4, 7)),
     ("position[1],position[2]", (2, 3))],
)  # fmt: skip
def test_numbered_columns_are_the_robots_joints_in_order(tmp_path, columns, joints):
    path = tmp_path / "log.csv"
    path.write_text(table(f"time,{columns}", (P,)))
    found = read_log(path, robot="panda").run.joint_names
    assert found == tuple(f"panda_joint{number}" for number in joints)


@pytest.mark.parametrize("apart", [False, True])
@pytest.mark.parametrize("desired", ["dq_d#", "dq_d#*", "dq_d#[rad/s]", "dq_d#[deg/s]*"])
@pytest.mark.parametrize(
    ("measured", "found"),
    [("q#,dq#", ""), ("q#*,dq#", "positions"), ("q#*,dq#*", "positions and velocities"),
     ("q#,dq#*", "velocities"), ("q#[deg]*,dq#*", "velocities"), ("q#[deg]*,dq#[deg/s]*", "")],
)  # fmt: skip
def test_each_signal_is_read_in_the_unit_of_its_own(tmp_path, measured, found, desired, apart):
    columns = [*measured.split(","), desired]  # those with a star are in degrees
    scale = {s: DEG if "*" in c else 1.0 for s, c in zip((P, V, VD), columns, strict=True)}
    header = [names(each.rstrip("*")) for each in columns]
    path, other = tmp_path / "log.csv", tmp_path / "desired.csv"
    path.write_text(stamped(",".join(header[: 3 - apart]), *(P, V, VD)[: 3 - apart], scale=scale))
    other.write_text(stamped(header[2].replace("_d", ""), VD, scale=scale))
    imported = read_log(path, desired=other if apart else None)
    for signal in (P, V, VD):
        assert np.allclose(getattr(imported.run, signal), MOTION[signal], rtol=0, atol=1e-6)
    said = " ".join(imported.remarks)
    assert (f"log.csv: {found} {FOUND}" in said, FOUND in said) == (bool(found), bool(found))
    if desired == "dq_d#*" and "velocities" not in found:
        assert "in degrees, as it goes as far as the measured motion" in said


@pytest.mark.parametrize(
    "column",
    ["actual_TCP_speed_0", "base_velocity", "x_velocity", "ee_pos_0", "q_current_0", "ddq1",
     "joint_acc_1", "field.position_covariance0", "speed_scaling", "joint1_target",
     "left_1_target_joint_vel", "position", "imu.velocity", "tcp.velocity", "base.velocity",
     "object.position", "motor_cmd[0].q", "motorCmd[0].q", "axis0.controller.input_pos"],
)  # fmt: skip
def test_what_is_no_joints_motion_is_not_read(tmp_path, column):
    path = tmp_path / "log.csv"
    path.write_text(table(f"time,elbow.velocity,{column}", (V,)))
    assert read_log(path).remarks == (f"log.csv: 1 column not read: {column}",)
