"""One log with a finding, written in many ways: its signals, and so its findings, stay the same."""

import datetime

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from inspector import analyse, load_library, read_log
from noisemodel import Run

RATE, DEG, EPOCH = 500, 180 / np.pi, 1_700_000_000
TIME = np.arange(3 * RATE) / RATE


def motion():
    """Positions and velocities, measured and desired, of three joints, of which one rattles."""
    angle = 2 * np.pi * TIME[:, None] * [0.5, 0.7, 0.9] + [0.0, 1.0, 2.0]
    desired = [0.6, 0.5, 0.4] * np.sin(angle)
    velocity_desired = [0.6, 0.5, 0.4] * np.cos(angle) * 2 * np.pi * [0.5, 0.7, 0.9]
    rattle = np.zeros_like(desired)
    rattle[(TIME >= 1.2) & (TIME < 2.2), 1] = 2e-3
    phase = 2 * np.pi * 60 * TIME[:, None]
    noise = np.random.default_rng(3).normal(0, 2e-3, desired.shape)
    velocity = velocity_desired + rattle * np.cos(phase) * 2 * np.pi * 60 + noise
    return np.hstack([desired + rattle * np.sin(phase), velocity, desired, velocity_desired])


MOTION = motion()
SIGNALS = {"position": 0, "velocity": 3, "position_desired": 6, "velocity_desired": 9}


def header(*patterns, mark=","):
    """Names of columns: each pattern for all three joints, numbered from 1."""
    return mark.join(each.replace("#", str(n)) for each in patterns for n in (1, 2, 3))


def named(*patterns, stamps="time", mark=","):
    return f"{stamps}{mark}" + header(*patterns, mark=mark)


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
):
    """A writer of a log as CSV."""

    def write(path, values):
        scaled = values * np.repeat(scale, 3)
        cells = [
            [stamp(time), *map(number, row)]
            for time, row in zip(TIME.tolist(), scaled.tolist(), strict=True)
        ]
        rows = [names.split(mark), *cells]
        if order is not None:
            rows = [[row[place] for place in order] for row in rows]
        path = path.with_suffix(".csv")
        path.write_text(before + "\n".join(map(mark.join, rows)) + "\n")
        return path

    return write


def npz(time, *names):
    """A writer of arrays, one for each signal."""

    def write(path, values):
        arrays = dict(zip(names, np.hsplit(values, 4), strict=True))
        np.savez(path.with_suffix(".npz"), **{time: TIME}, **arrays)
        return path.with_suffix(".npz")

    return write


def parquet(names, stamps=TIME, scale=1.0):
    def write(path, values):
        columns = dict(zip(names.split(","), scale * values.T, strict=True))
        pq.write_table(pa.table({"time": stamps, **columns}), path.with_suffix(".parquet"))
        return path.with_suffix(".parquet")

    return write


def comma(value):
    return f"{value:.10g}".replace(".", ",")


def date(pattern):
    def stamp(time):
        start = datetime.datetime.fromtimestamp(EPOCH, datetime.UTC)
        return (start + datetime.timedelta(seconds=time)).strftime(pattern)

    return stamp


DEGREES = (DEG,) * 4
IN_DEGREES = ("q#_deg", "dq#_deg_s", "q_d#_deg", "dq_d#_deg_s")
MILLIRADIANS = ("q# [mrad]", "dq# [mrad/s]", "q_d# [mrad]", "dq_d# [mrad/s]")
NANOSECONDS = np.round(TIME * 1e9).astype(np.int64)
WRITINGS = {
    "degrees by name": csv(named(*IN_DEGREES), scale=DEGREES),
    "degrees, found by their size": csv(f"time,{SYMBOLS}", scale=DEGREES),
    "units in parentheses": csv(
        named("q# (rad)", "dq# (rad/s)", "q_d# (rad)", "dq_d# (rad/s)", stamps="time (s)")
    ),
    "speeds alone in deg/s": csv(
        named("q#[rad]", "dq#[deg/s]", "q_d#[rad]", "dq_d#[deg/s]"), scale=(1.0, DEG, 1.0, DEG)
    ),
    "milliradians": csv(named(*MILLIRADIANS), scale=(1e3,) * 4),
    "columns by joint": csv(order=[0, *(3 * s + j for j in (1, 2, 3) for s in range(4))]),
    "desired first, stamps last": csv(order=[*range(7, 13), *range(1, 7), 0]),
    "joints backwards": csv(order=[0, *(s + j for s in (0, 3, 6, 9) for j in (3, 2, 1))]),
    "tabs and decimal commas": csv(
        f"time\t{SYMBOLS}".replace(",", "\t"), mark="\t", number=comma, stamp=comma
    ),
    "commas and blanks": csv(f"time, {SYMBOLS.replace(',', ', ')}", mark=", "),
    "aligned numbers with exponents": csv(
        f"time {SYMBOLS}".replace(",", " "), mark=" ", number=lambda value: f"{value:17.9E}"
    ),
    "ISO dates": csv(f"time,{SYMBOLS}", stamp=date("%Y-%m-%dT%H:%M:%S.%f")),
    "dates with a zone": csv(f"time,{SYMBOLS}", stamp=date("%Y-%m-%d %H:%M:%S.%f+00:00")),
    "dates in UTC": csv(f"time,{SYMBOLS}", stamp=date("%Y-%m-%dT%H:%M:%S.%fZ")),
    "other words before the header": csv(before="Log of an arm\n\n"),
    "names of UR's RTDE": csv(
        named("actual_q_#", "actual_qd_#", "target_q_#", "target_qd_#", stamps="timestamp")
    ),
    "words after the joint": csv(
        named(
            *(f"joint_#_{signal}" for signal in ("position", "velocity")),
            *(f"joint_#_{signal}_desired" for signal in ("position", "velocity")),
        )
    ),
    "words before the joint": csv(named("pos_#", "vel_#", "pos_des_#", "vel_des_#", stamps="t")),
    "commands": csv(named("joint_#_pos", "joint_#_vel", "joint_#_pos_cmd", "joint_#_vel_cmd")),
    "arrays with brackets": csv(named(*(f"{signal}[#]" for signal in SIGNALS))),
    "capitals": csv(named("Q#", "DQ#", "Q_D#", "DQ_D#", stamps="Time")),
    "npz": npz("time", "q", "dq", "q_d", "dq_d"),
    "npz, in words": npz("t", "positions", "velocities", "desired_positions", "desired_velocities"),
    "parquet": parquet(RUN_NAMES),
    "parquet, milliradians by name": parquet(header(*MILLIRADIANS), scale=1e3),
    "parquet, symbols and nanoseconds": parquet(SYMBOLS, NANOSECONDS),
    "parquet, stamps with a type": parquet(
        SYMBOLS, pa.array(EPOCH * 10**9 + NANOSECONDS, pa.timestamp("ns"))
    ),
}


@pytest.mark.parametrize("writing", WRITINGS)
def test_a_log_has_the_same_signals_however_it_is_written(tmp_path, writing):
    run = read_log(WRITINGS[writing](tmp_path / "log", MOTION)).run
    order = np.argsort(run.joint_names)
    assert run.rate == pytest.approx(RATE)
    assert np.allclose(run.time, TIME, rtol=0, atol=1e-6)
    for signal, place in SIGNALS.items():
        values = MOTION[:, place : place + 3]
        assert np.allclose(getattr(run, signal)[:, order], values, rtol=0, atol=1e-7), signal


def findings(run):
    return [(e.label, e.start, e.stop) for e in analyse(run, load_library()).findings]


def test_velocities_are_those_of_positions_alone_if_both_say_the_same(tmp_path):
    signals = {signal: MOTION[:, place : place + 3] for signal, place in SIGNALS.items()}
    whole = findings(Run(time=TIME, joint_names=("a", "b", "c"), **signals))
    assert [each[0] for each in whole] == ["oscillations"]
    header_ = named("q#")
    paths = [tmp_path / "alone.csv", tmp_path / "both.csv"]
    np.savetxt(paths[0], np.column_stack([TIME, MOTION[:, :3]]), delimiter=",", header=header_)
    alone = read_log(paths[0]).run
    both = np.column_stack([TIME, MOTION[:, :3], alone.velocity])
    np.savetxt(paths[1], both, delimiter=",", header=named("q#", "dq#"))
    expected, found = findings(alone), findings(read_log(paths[1]).run)
    assert [each[0] for each in found] == [each[0] for each in expected] == ["oscillations"]
    for one, other in zip(found, expected, strict=True):
        assert np.allclose(one[1:], other[1:], rtol=0, atol=0.02)
