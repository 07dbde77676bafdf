import subprocess
import sys

import numpy as np
import pytest
from csvlogs import TIME, log, write

from inspector import read_log
from inspector.errors import InspectorError, LogError
from inspector.logs.mapping import parse_mapping


@pytest.mark.parametrize(
    ("column", "signal", "joint"),
    [
        ("left.elbow.velocity", "velocity", "left.elbow"), ("elbow/velocity", "velocity", "elbow"),
        ("/joint_states/velocity[0]", "velocity", "joint_0"), ("x.velocity", "velocity", "x"),
        ("/controller/state/actual/velocities[2]", "velocity", "joint_2"),
        ("/joint_states/position.3", "position", "joint_3"),
        ("observation.state.j0.pos", "position", "j0"), ("action.j0.pos", "position_desired", "j0"),
        ("wrist.position_desired", "position_desired", "wrist"),
        ("/state/desired/velocities[0]", "velocity_desired", "joint_0"),
        ("/state/reference/positions[0]", "position_desired", "joint_0"),
        ("joint1_cmd.position", "position_desired", "joint1"),
        ("joints[0].target.position", "position_desired", "joints[0]"),
        ("J1_cmd [rad]", "position_desired", "J1"),
    ],
)  # fmt: skip
def test_a_column_is_recognised_by_its_name(tmp_path, column, signal, joint):
    ones = np.ones(len(TIME))
    more = {"q7": ones} if signal.endswith("_desired") else {}
    run = read_log(write(tmp_path / "log.csv", {"time": TIME, column: ones, **more})).run
    assert (run.desired_joint_names if more else run.joint_names) == (joint,)
    assert np.array_equal(getattr(run, signal)[:, 0], ones)


def test_errors_and_outputs_of_a_controller_are_no_motion(tmp_path):
    ones = np.ones(len(TIME))
    state = "/arm/controller_state"
    columns = {
        f"{state}/{part}/velocities[0]": size * ones
        for size, part in enumerate(("feedback", "reference", "error", "output"), start=1)
    }
    imported = read_log(write(tmp_path / "log.csv", {"time": TIME, **columns, "j0_err_vel": ones}))
    assert np.array_equal(imported.run.velocity, ones[:, None])
    assert np.array_equal(imported.run.velocity_desired, 2 * ones[:, None])
    assert imported.remarks == (
        f"log.csv: 3 columns not read: {state}/error/velocities[0], {state}/output/velocities[0],"
        " j0_err_vel",
    )


def test_a_mapping_gives_the_signal_of_other_columns(tmp_path):
    columns = {"clock": TIME, "dq2": TIME, "cmd = 2": -TIME}
    mapping = ["time=clock", "velocity.left.elbow=dq2", "velocity_desired.left.elbow=cmd = 2"]
    run = read_log(write(tmp_path / "log.csv", columns), mapping=mapping).run
    assert run.joint_names == ("left.elbow",)
    assert np.array_equal(run.velocity[:, 0], TIME)
    assert np.array_equal(run.velocity_desired[:, 0], -TIME)


def test_a_mapping_takes_precedence_over_a_name(tmp_path):
    path = log(tmp_path, better=TIME)
    imported = read_log(path, mapping=["velocity.elbow=better"])
    assert np.array_equal(imported.run.velocity[:, 0], TIME)
    assert imported.remarks == ("log.csv: 1 column not read: elbow.velocity",)


@pytest.mark.parametrize("entry", ["velocity.a", "speed.a=b", "velocity.=b", "velocity.a=", ""])
def test_a_mapping_of_another_form_is_refused(entry):
    with pytest.raises(InspectorError, match=r"expected SIGNAL.JOINT=COLUMN, such as velocity"):
        parse_mapping([entry])


def test_a_column_that_is_mapped_twice_or_not_there_is_named(tmp_path):
    with pytest.raises(InspectorError, match="'x' is mapped twice"):
        read_log(log(tmp_path), mapping=["velocity.a=x", "velocity.b=x"])
    with pytest.raises(LogError, match="there is no column 'x' to map; it has elbow.pos"):
        read_log(log(tmp_path), mapping=["velocity.a=x"])


HANGS = """
import resource
resource.setrlimit(resource.RLIMIT_CPU, (60, 60))
from inspector.logs.names import Naming
for word in ("r", "rr", "l_", "1", "shoulder", "1shoulder", "joint", "q", "_", "[(", "error"):
    for end in ("", "!", "1x"):
        Naming.of([(word * 300)[:297] + end, "wrist"])
"""


def test_names_that_can_be_read_in_many_ways_do_not_hold_up_the_reader():
    subprocess.run([sys.executable, "-c", HANGS], check=True)
