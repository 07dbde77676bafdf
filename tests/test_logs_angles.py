import numpy as np
import pytest
from csvlogs import TIME, log, write

from inspector import read_log
from inspector.errors import LogError


def test_degrees_are_converted_but_not_of_prismatic_joints(tmp_path):
    columns = {
        "time": TIME,
        "panda_joint1.position": np.full(400, 90.0),
        "panda_joint1.velocity": np.full(400, 180.0),
        "panda_joint1.effort": np.full(400, 10.0),
        "panda_finger_joint1.position": np.full(400, 0.04),
        "panda_finger_joint1.velocity": np.full(400, 0.01),
        "panda_finger_joint1.effort": np.full(400, 1.0),
    }
    path = write(tmp_path / "log.csv", columns)
    run = read_log(path, robot="panda", units="degrees").run
    assert np.allclose(run.position[0], [np.pi / 2, 0.04], rtol=1e-15)
    assert np.allclose(run.velocity[0], [np.pi, 0.01], rtol=1e-15)
    assert np.array_equal(run.effort[0], [10.0, 1.0])
    assert read_log(path, units="degrees").run.position[0, 1] == pytest.approx(np.deg2rad(0.04))


@pytest.mark.parametrize(
    ("column", "value"), [("elbow.position", -90.0), ("elbow.velocity", 120.0)]
)
def test_degrees_in_place_of_radians_are_refused_with_their_row(tmp_path, column, value):
    path = log(tmp_path, **{column: np.where(TIME < 0.05, 0.0, value)})
    message = f"row 7: column '{column}' holds {value:g}, too much for radians; if .* --degrees"
    with pytest.raises(LogError, match=message) as caught:
        read_log(path)
    assert caught.value.row == 7


def test_continuous_and_prismatic_joints_may_exceed_the_limit(tmp_path):
    position = np.linspace(0, 50, 400)
    path = write(
        tmp_path / "log.csv",
        {
            "time": TIME,
            "wheel_left_joint.position": position,
            "torso_lift_joint.position": position,
        },
    )
    assert read_log(path, robot="tiago").run.position.max() == 50.0
