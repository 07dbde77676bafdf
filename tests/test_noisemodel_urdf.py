import pytest

from noisemodel import Robot, RobotError
from noisemodel.urdf import Mimic, checked, mimics

LINKS = '<link name="base"/><link name="tip"/>'
JOINT = """
<joint name="elbow" type="revolute">
  <parent link="base"/><child link="tip"/><origin xyz="0 0 1" rpy="0 0 0"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/>
</joint>"""
GOOD = f'<robot name="arm">{LINKS}{JOINT}</robot>'


def chain(joints):
    """A chain of so many joints."""
    links = "".join(f'<link name="l{number}"/>' for number in range(joints + 1))
    return f'<robot name="chain">{links}' + "".join(
        f'<joint name="j{number}" type="fixed">'
        f'<parent link="l{number}"/><child link="l{number + 1}"/></joint>'
        for number in range(joints)
    ) + "</robot>"  # fmt: skip


def test_a_urdf_gives_its_name_and_mimic_joints(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(
        GOOD.replace("<axis", '<mimic joint="wrist" multiplier="-2" offset="0.5"/><axis')
    )
    assert checked(path).get("name") == "arm"
    assert mimics(path, checked(path)) == {"elbow": Mimic("wrist", multiplier=-2.0, offset=0.5)}
    path.write_text(GOOD.replace("<axis", '<mimic joint="wrist"/><axis'))
    assert mimics(path, checked(path)) == {"elbow": Mimic("wrist", multiplier=1.0, offset=0.0)}


def test_fixed_joints_may_have_an_axis_of_length_0(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(GOOD.replace('"revolute"', '"fixed"').replace('xyz="0 0 1"/>', 'xyz="0 0 0"/>'))
    assert Robot.load(path).joint_names == ()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the URDF is empty"),
        (" \n", "the URDF is empty"),
        (GOOD[:200], "not XML"),
        ("solid arm\nfacet normal", "not XML"),
        ("\x00\x01\x02", "not XML"),
        ("<sdf><model/></sdf>", "not a URDF, its root is <sdf>, expected <robot>"),
        ("<robot/>", "its <robot> has no name or no link"),
        ('<robot name="arm"/>', "its <robot> has no name or no link"),
        (GOOD.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>'), "'elbow' has length 0"),
        (GOOD.replace('<axis xyz="0 0 1"/>', "<axis/>"), "'elbow' has length 0"),
        *(
            (
                GOOD.replace('xyz="0 0 1" rpy', f'xyz="{numbers}" rpy'),
                f"xyz of <origin> is '{numbers}', expected 3 finite numbers",
            )
            for numbers in ("0 nan 1", "0 inf 1", "0 1", "a b c", "")
        ),
        (GOOD.replace('"revolute"', '"screw"'), r"Joint \[elbow\] has no known type \[screw\]"),
        (GOOD.replace('"tip"/><origin', '"toe"/><origin'), r"child link \[toe\] of joint"),
        (GOOD.replace(JOINT, JOINT * 2), "joint 'elbow' is not unique"),
        (GOOD.replace(JOINT, ""), "Two root links found"),
    ],
)
def test_a_bad_urdf_is_one_line_that_names_the_file_and_the_problem(tmp_path, capfd, text, message):
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    with pytest.raises(RobotError, match=message) as caught:
        Robot.load(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""  # Pinocchio's parser writes there by itself


def test_the_limit_of_joints_is_how_many_there_may_be(tmp_path, monkeypatch):
    monkeypatch.setenv("NOISE_LIMIT_JOINTS", "3")
    path = tmp_path / "arm.urdf"
    path.write_text(chain(3))
    assert checked(path).get("name") == "chain"
    path.write_text(chain(4))
    with pytest.raises(RobotError, match="4 joints; the limit is 3 .--limit joints=N raises it"):
        checked(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (chain(3).replace("</robot>", "<a ixx='1 2'/></robot>"), "ixx of <a> is '1 2', expected 1"),
        (
            chain(3).replace("</robot>", "<mass value='1 2'/></robot>"),
            "value of <mass> is '1 2', e",
        ),
        (chain(3).replace("</robot>", "<mass/></robot>"), "value of <mass> is '', expected 1 fini"),
        (chain(3).replace('<child link="l3"', '<child link="l1"'), "'l1' go round in a circle"),
    ],
)
def test_numbers_and_trees_that_pinocchio_takes_though_they_are_wrong(tmp_path, text, message):
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    with pytest.raises(RobotError, match=message):
        checked(path)
