"""Limits of joints as a URDF states them."""

from math import inf

import pytest

from noisemodel.robot import Limits, joint_limits


def limits(folder, attributes, kind="revolute"):
    """The limits of a joint of this kind with these attributes of its <limit>."""
    (folder / "arm.urdf").write_text(
        f"<robot name='arm'><link name='a'/><link name='b'/><joint name='j' type='{kind}'>"
        f"<parent link='a'/><child link='b'/><axis xyz='0 0 1'/><limit effort='1' {attributes}/>"
        "</joint></robot>"
    )
    return joint_limits(folder / "arm.urdf")["j"]


def test_the_limits_of_a_panda_are_those_of_its_data_sheet():
    found = joint_limits("panda")
    assert found["panda_joint1"] == Limits(-2.8973, 2.8973, 2.175, turns=True)
    assert found["panda_joint4"] == Limits(-3.0718, -0.0698, 2.175, turns=True)
    assert found["panda_joint7"] == Limits(-2.8973, 2.8973, 2.61, turns=True)
    assert found["panda_finger_joint1"] == Limits(0.0, 0.04, 0.2, turns=False)


@pytest.mark.parametrize(
    ("attributes", "lower", "upper"),
    [
        ("lower='-1' upper='2' velocity='3'", -1.0, 2.0),
        ("upper='2' velocity='3'", 0.0, 2.0),  # of the URDF's specification: 0 by default
        ("lower='-2' velocity='3'", -2.0, 0.0),
        ("lower='1' upper='1' velocity='3'", -inf, inf),
        ("lower='-1' upper='2e6' velocity='3'", -inf, inf),
    ],
)
def test_a_range_is_as_it_is_written_and_none_if_it_is_empty_or_without_end(
    tmp_path, attributes, lower, upper
):
    assert limits(tmp_path, attributes) == Limits(lower, upper, 3.0, turns=True)


@pytest.mark.parametrize(
    ("written", "speed"), [("0.5", 0.5), ("0", inf), ("-1", inf), ("1e6", inf), ("fast", inf)]
)
def test_a_speed_is_as_it_is_written_and_none_if_no_joint_moves_so(tmp_path, written, speed):
    assert limits(tmp_path, f"lower='-1' upper='1' velocity='{written}'").velocity == speed


def test_a_joint_that_turns_for_ever_has_a_speed_and_no_range(tmp_path):
    found = limits(tmp_path, "lower='-1' upper='1' velocity='3'", kind="continuous")
    assert found == Limits(-inf, inf, 3.0, turns=True)


def test_limits_of_which_nothing_is_stated_are_none():
    nothing = Limits()
    assert (nothing.lower, nothing.upper, nothing.velocity) == (-inf, inf, inf)
