"""One log with a finding and a good one, written in many ways: the findings stay the same."""

import datetime

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from inspector import analyse, load_library, read_log
from noisemodel import Run

RATE, DEG, EPOCH = 500, 180 / np.pi, 1_700_000_000
TIME = np.arange(3 * RATE) / RATE
LIBRARY = load_library()


def motion(rattles):
    """Positions and velocities, measured and desired, of three joints, of which one may rattle."""
    angle = 2 * np.pi * TIME[:, None] * [0.5, 0.7, 0.9] + [0.0, 1.0, 2.0]
    desired = [0.6, 0.5, 0.4] * np.sin(angle)
    velocity_desired = [0.6, 0.5, 0.4] * np.cos(angle) * 2 * np.pi * [0.5, 0.7, 0.9]
    rattle = np.zeros_like(desired)
    during = (TIME >= 1.2) & (TIME < 2.2)
    rattle[during, 1] = 2e-3 * rattles
    phase = 2 * np.pi * 60 * TIME[:, None]
    noise = np.random.default_rng(3).normal(0, 2e-3, desired.shape)
    velocity = velocity_desired + rattle * np.cos(phase) * 2 * np.pi * 60 + noise
    return np.hstack([desired + rattle * np.sin(phase), velocity, desired, velocity_desired])


MOTION = {kind: motion(kind == "rattling") for kind in ("rattling", "good")}
SIGNALS = {"position": 0, "velocity": 3, "position_desired": 6, "velocity_desired": 9}


def header(*patterns, mark=","):
    """Names of columns: each pattern for all three joints, numbered from 1."""
    return mark.join(each.replace("#", str(n)) for each in patterns for n in (1, 2, 3))


RUN_NAMES = header(*(f"joint_#.{signal}" for signal in SIGNALS))
SYMBOLS = header("q#", "dq#", "q_d#", "dq_d#")


def csv(
    names=f"time,{RUN_NAMES}",
    *,
    mark=",",
    scale=(1.0, 1.0, 1.0, 1.0),
    stamp=lambda time: f"{time:.3f}",
    number=lambda value: f"{value:.10g}",
    order=None,
    before="",
    end="\n",
    encoding="utf-8",
    quote="",
):
    """A writer of a log as CSV."""

    def write(path, values):
        scaled = values * np.repeat(scale, 3)
        cells = [
            [stamp(time), *map(number, row)]
            for time, row in zip(TIME.tolist(), scaled.tolist(), strict=True)
        ]
        rows = [names.split(mark), *cells] if names else cells
        if order is not None:
            rows = [[row[place] for place in order] for row in rows]
        lines = [mark.join(f"{quote}{cell}{quote}" for cell in row) for row in rows]
        text = before + "\n".join(lines) + "\n"
        path = path.with_suffix(".csv")
        path.write_bytes(text.replace("\n", end).encode(encoding))
        return path

    return write


def npz(**names):
    """A writer of arrays by name of signal; ``time`` names the stamps."""

    def write(path, values):
        arrays = {
            names[signal]: values[:, first : first + 3]
            for signal, first in SIGNALS.items()
            if signal in names
        }
        np.savez(path.with_suffix(".npz"), **{names["time"]: TIME}, **arrays)
        return path.with_suffix(".npz")

    return write


def parquet(names, stamps=TIME):
    def write(path, values):
        columns = dict(zip(names.split(","), values.T, strict=True))
        pq.write_table(pa.table({"time": stamps, **columns}), path.with_suffix(".parquet"))
        return path.with_suffix(".parquet")

    return write


def comma(value):
    return f"{value:.10g}".replace(".", ",")


def since(unit, first=0):
    return lambda time: str(first * unit + round(time * unit))


def date(pattern):
    def stamp(time):
        start = datetime.datetime.fromtimestamp(EPOCH, datetime.UTC)
        return (start + datetime.timedelta(seconds=time)).strftime(pattern)

    return stamp


DEGREES = (DEG,) * 4
RPM = (1.0, 60 / (2 * np.pi), 1.0, 60 / (2 * np.pi))
SPEEDS_IN_DEGREES = (1.0, DEG, 1.0, DEG)


def named(*patterns, stamps="time", mark=","):
    return f"{stamps}{mark}" + header(*patterns, mark=mark)


WRITINGS = {
    "names as in run files": csv(),
    "degrees by name": csv(named("q#_deg", "dq#_deg_s", "q_d#_deg", "dq_d#_deg_s"), scale=DEGREES),
    "degrees, found by their size": csv(f"time,{SYMBOLS}", scale=DEGREES),
    "units in brackets": csv(
        named("q# [deg]", "dq# [deg/s]", "q_d# [deg]", "dq_d# [deg/s]"), scale=DEGREES
    ),
    "units in parentheses": csv(
        named("q# (rad)", "dq# (rad/s)", "q_d# (rad)", "dq_d# (rad/s)", stamps="time (s)")
    ),
    "units in a row": csv(
        f"time,{SYMBOLS}\ns," + ",".join(["deg"] * 3 + ["deg/s"] * 3 + ["deg"] * 3 + ["deg/s"] * 3),
        scale=DEGREES,
    ),
    "speeds alone in deg/s": csv(
        named("q#[rad]", "dq#[deg/s]", "q_d#[rad]", "dq_d#[deg/s]"), scale=SPEEDS_IN_DEGREES
    ),
    "speeds alone in rpm": csv(
        named("q# [rad]", "dq# [rpm]", "q_d# [rad]", "dq_d# [rpm]"), scale=RPM
    ),
    "milliradians": csv(
        named("q# [mrad]", "dq# [mrad/s]", "q_d# [mrad]", "dq_d# [mrad/s]"), scale=(1e3,) * 4
    ),
    "columns by joint": csv(order=[0, *(3 * s + j for j in (1, 2, 3) for s in range(4))]),
    "desired first": csv(order=[0, *range(7, 13), *range(1, 7)]),
    "stamps last": csv(order=[*range(1, 13), 0]),
    "joints backwards": csv(order=[0, *(s + j for s in (0, 3, 6, 9) for j in (3, 2, 1))]),
    "decimal commas": csv(
        f"time;{SYMBOLS.replace(',', ';')}",
        mark=";",
        number=comma,
        stamp=lambda time: comma(round(time, 3)),
    ),
    "semicolons": csv(f"time;{SYMBOLS.replace(',', ';')}", mark=";"),
    "tabs": csv(f"time\t{SYMBOLS}".replace(",", "\t"), mark="\t"),
    "tabs and decimal commas": csv(
        f"time\t{SYMBOLS}".replace(",", "\t"),
        mark="\t",
        number=comma,
        stamp=lambda time: comma(round(time, 3)),
    ),
    "blanks": csv(f"time {SYMBOLS}".replace(",", " "), mark=" "),
    "commas and blanks": csv(f"time, {SYMBOLS.replace(',', ', ')}", mark=", "),
    "aligned numbers": csv(
        f"time {SYMBOLS}".replace(",", " "), mark=" ", number=lambda value: f"{value:16.9e}"
    ),
    "exponents": csv(number=lambda value: f"{value:.9E}"),
    "milliseconds": csv(f"time_ms,{SYMBOLS}", stamp=since(1000)),
    "milliseconds, not named": csv(f"time,{SYMBOLS}", stamp=since(1000)),
    "microseconds": csv(f"time [us],{SYMBOLS}", stamp=since(1_000_000)),
    "nanoseconds": csv(f"timestamp_ns,{SYMBOLS}", stamp=since(10**9)),
    "seconds since 1970": csv(f"stamp,{SYMBOLS}", stamp=lambda time: f"{EPOCH + time:.3f}"),
    "milliseconds since 1970": csv(f"time,{SYMBOLS}", stamp=since(1000, EPOCH)),
    "microseconds since 1970": csv(f"time,{SYMBOLS}", stamp=since(10**6, EPOCH)),
    "nanoseconds since 1970": csv(f"time,{SYMBOLS}", stamp=since(10**9, EPOCH)),
    "ISO dates": csv(f"time,{SYMBOLS}", stamp=date("%Y-%m-%dT%H:%M:%S.%f")),
    "dates with a blank and a zone": csv(
        f"time,{SYMBOLS}", stamp=date("%Y-%m-%d %H:%M:%S.%f+00:00")
    ),
    "dates in UTC": csv(f"time,{SYMBOLS}", stamp=date("%Y-%m-%dT%H:%M:%S.%fZ")),
    "a byte order mark": csv(encoding="utf-8-sig"),
    "quotes": csv(quote='"'),
    "DOS line ends": csv(end="\r\n"),
    "comments before the header": csv(before="# robot: arm\n# rate: 500 Hz\n"),
    "other words before the header": csv(before="Log of an arm\n\n"),
    "a header that is a comment": csv(f"# time,{SYMBOLS}"),
    "names of UR's RTDE": csv(
        named("actual_q_#", "actual_qd_#", "target_q_#", "target_qd_#", stamps="timestamp")
    ),
    "words after the joint": csv(
        named(
            "joint_#_position",
            "joint_#_velocity",
            "joint_#_position_desired",
            "joint_#_velocity_desired",
        )
    ),
    "words before the joint": csv(named("pos_#", "vel_#", "pos_des_#", "vel_des_#", stamps="t")),
    "commands": csv(named("joint_#_pos", "joint_#_vel", "joint_#_pos_cmd", "joint_#_vel_cmd")),
    "arrays with brackets": csv(
        named("position[#]", "velocity[#]", "position_desired[#]", "velocity_desired[#]")
    ),
    "capitals": csv(named("Q#", "DQ#", "Q_D#", "DQ_D#", stamps="Time")),
    "npz": npz(
        time="time", position="q", velocity="dq", position_desired="q_d", velocity_desired="dq_d"
    ),
    "npz, in words": npz(
        time="t",
        position="positions",
        velocity="velocities",
        position_desired="desired_positions",
        velocity_desired="desired_velocities",
    ),
    "parquet": parquet(RUN_NAMES),
    "parquet, symbols and nanoseconds": parquet(SYMBOLS, np.round(TIME * 1e9).astype(np.int64)),
    "parquet, stamps with a type": parquet(
        SYMBOLS, pa.array(EPOCH * 10**9 + np.round(TIME * 1e9).astype(np.int64), pa.timestamp("ns"))
    ),
}


def findings(run):
    """Class, number of the joint that has most of it if it is known, start and stop of each."""
    analysis, known = analyse(run, LIBRARY), sorted(run.joint_names)
    found = []
    for each in analysis.findings:
        shares = dict(analysis.localisations[each].joints)
        joint = known.index(max(shares, key=shares.get)) if shares else None
        found.append((each.label, joint, each.start, each.stop))
    return found


def same(found, expected):
    """Whether findings are the same but for 20 ms."""
    return len(found) == len(expected) and all(
        one[:2] == other[:2] and np.allclose(one[2:], other[2:], rtol=0, atol=0.02)
        for one, other in zip(found, expected, strict=True)
    )


@pytest.fixture(scope="module", params=MOTION)
def log(request):
    """Values of a log, and the findings of a run that was not written at all."""
    values, first = MOTION[request.param], SIGNALS.items()
    signals = {signal: values[:, place : place + 3] for signal, place in first}
    expected = findings(Run(time=TIME, joint_names=("a", "b", "c"), **signals))
    assert [each[:2] for each in expected] == [("oscillations", 1)] * (request.param != "good")
    return values, expected


@pytest.mark.parametrize("writing", WRITINGS)
def test_a_log_has_the_same_findings_however_it_is_written(tmp_path, log, writing):
    values, expected = log
    run = read_log(WRITINGS[writing](tmp_path / "log", values)).run
    assert run.rate == pytest.approx(RATE)
    assert "differentiated" not in run.meta
    assert same(findings(run), expected)


def test_velocities_are_those_of_positions_alone_if_both_say_the_same(tmp_path, log):
    values, _ = log
    position = csv(named("q#"), scale=(1.0,))(tmp_path / "log", values[:, :3])
    alone = read_log(position).run
    both = csv(named("q#", "dq#"), scale=(1.0, 1.0))
    path = both(tmp_path / "both", np.hstack([values[:, :3], alone.velocity]))
    assert same(findings(read_log(path).run), findings(alone))
