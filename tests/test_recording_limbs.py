from types import SimpleNamespace

from inspector.recording.panels import limbs
from noisemodel import Robot


def robot(*pairs):
    """A robot of joints, each with the one that carries it."""
    names = ["root", *(name for _, name in pairs)]
    return SimpleNamespace(
        joints=[SimpleNamespace(name=name, parent=names.index(above)) for above, name in pairs]
    )


def test_talos_has_two_legs_a_torso_two_arms_and_a_head():
    names = [
        name
        for name in Robot.load("talos").joint_names
        if name.startswith(("leg", "arm", "torso", "head")) or name == "gripper_left_joint"
    ]
    found = limbs(names, Robot.load("talos"))
    counts = {limb: len(joints) for limb, joints in found.items()}
    legs, arms = {"leg_left": 6, "leg_right": 6}, {"arm_left": 8, "arm_right": 7}
    assert counts == legs | arms | {"torso": 2, "head": 2}
    assert found["arm_left"][-1] == "gripper_left_joint"


def test_fingers_belong_to_their_arm_wheels_together_and_unnamed_joints_are_passed_over():
    hand = robot(("root", "a1"), ("a1", "a2"), ("a2", "left"), ("a2", "right"))
    assert limbs(["a1", "a2", "left", "right"], hand) == {"joints": ("a1", "a2", "left", "right")}
    car = robot(*(("root", f"wheel{i}") for i in range(4)), ("root", "arm1"), ("arm1", "arm2"))
    found = limbs(["wheel0", "wheel1", "wheel2", "wheel3", "arm1", "arm2"], car)
    assert found["wheel"] == ("wheel0", "wheel1", "wheel2", "wheel3")
    assert found["arm"] == ("arm1", "arm2")
    chain = robot(("root", "a1"), ("a1", "fixed"), ("fixed", "a2"), ("root", "b1"), ("b1", "b2"))
    assert list(limbs(["a1", "a2", "b1", "b2"], chain).values()) == [("a1", "a2"), ("b1", "b2")]


def test_without_a_robot_eight_neighbours_make_a_limb():
    names = [f"joint{i}" for i in range(20)]
    found = limbs(names, None)
    assert [len(joints) for joints in found.values()] == [8, 8, 4]
    assert [joint for joints in found.values() for joint in joints] == names
    assert next(iter(found)) == "joint0 … joint7"


def test_every_joint_is_in_one_limb_whatever_the_robot():
    for name in ("go2", "panda", "icub", "anymal"):
        names = Robot.load(name).joint_names
        found = limbs(names, Robot.load(name))
        assert sorted(joint for joints in found.values() for joint in joints) == sorted(names)
        assert max(map(len, found.values())) <= 10
