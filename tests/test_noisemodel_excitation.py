from types import SimpleNamespace

import numpy as np
import pytest
from chains import chain

from noisemodel import NoiseModelError, Robot
from noisemodel.compare import RATE, SHAKES, ends, excitation
from noisemodel.extended import vibrating
from noisemodel.robot import limits_of

ODD = (
    "panda",  # prismatic, mimic
    "tiago",  # continuous, prismatic, slow
    "baxter",  # mimic, little room
    "double_pendulum",  # no room and no speed
    "iris_rotors",  # limits of 1e16
    "hector",  # nothing but a base
    "talos",
)


@pytest.fixture(scope="module", params=ODD)
def robot(request):
    return Robot.load(request.param, mimic=True)


def limits(robot):
    found = limits_of(robot)
    each = [found[name] for name in robot.joint_names]
    return SimpleNamespace(
        centre=np.array([one.centre for one in each]),
        range=np.array([one.upper - one.lower for one in each]),
        speed=np.array([one.velocity for one in each]),
    )


def test_positions_stay_within_the_limits(robot):
    run, bounds = excitation(robot), limits(robot)
    assert (np.abs(run.position - bounds.centre) <= bounds.range / 2).all()
    assert np.isfinite(run.position).all()


def test_every_joint_moves_and_the_base_sways_if_it_can(robot):
    run = excitation(robot)
    assert (np.ptp(run.velocity, axis=0) > 0.0).all()
    assert (run.base_velocity is not None) == robot.floating_base
    if robot.floating_base:
        assert 0.0 < np.sqrt(np.mean(run.base_velocity**2)) < 0.3


def test_velocities_are_the_slopes_of_positions(robot):
    run = excitation(robot)
    slope = np.diff(run.position, axis=0) * RATE
    np.testing.assert_allclose(slope, run.velocity[1:], atol=1e-7)


def test_a_seed_makes_one_motion_and_another_seed_another():
    robot = Robot.load("panda")
    one, same, other = (excitation(robot, seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.velocity, same.velocity)
    assert not np.allclose(one.velocity, other.velocity)


def test_both_shakes_are_equally_fast(tmp_path):
    robot = chain(tmp_path, "revolute", "revolute", "revolute")
    run = excitation(robot)
    near, far = ends(robot)
    energies, loudest = [], []
    for label, name in zip(SHAKES, (near, far), strict=True):
        (block,) = [block for block in run.blocks if block.label == label]
        inside = (run.time >= block.start) & (run.time < block.stop)
        velocity = run.velocity[inside, robot.joint_names.index(name)]
        spectrum = np.abs(np.fft.rfft(velocity * np.hanning(len(velocity))))
        energies.append(spectrum[30:].max())
        loudest.append((30 + spectrum[30:].argmax()) * run.rate / len(velocity))
    assert energies[0] == pytest.approx(energies[1], rel=0.1)
    assert 40.0 <= loudest[0] == loudest[1] <= 200.0


def test_the_near_joint_carries_most_and_the_far_one_ends_the_chain(tmp_path):
    robot = chain(tmp_path, "prismatic", "revolute", "continuous", "revolute", "prismatic")
    assert ends(robot) == ("joint2", "joint4")
    assert ends(chain(tmp_path, "prismatic")) == ()
    assert ends(chain(tmp_path, "revolute")) == ("joint1",)


def tree(folder, *joints, **options):
    """A robot of links that are named after their joints: name, kind and parent link of each."""
    text = '<robot name="tree"><link name="base"/>'
    for name, kind, parent, *limit in joints:
        lower, upper, speed = limit or (-9, 9, 1)
        follow = f'<mimic joint="{kind}"/>' if kind in [each[0] for each in joints] else ""
        text += f"""<link name="{name}"/>
          <joint name="{name}" type="{"revolute" if follow else kind}">
            <parent link="{parent}"/><child link="{name}"/><axis xyz="0 0 1"/>{follow}
            <limit lower="{lower}" upper="{upper}" effort="1" velocity="{speed}"/></joint>"""
    path = folder / "tree.urdf"
    path.write_text(text + "</robot>")
    return Robot.load(path, mimic=True, **options)


def test_the_ends_of_a_robot_with_branches(tmp_path):
    joints = [
        ("a", "revolute", "base"),  # ends after one joint
        ("b", "prismatic", "base"),
        ("b1", "revolute", "b"),  # carries as many as c, further from the base
        ("b2", "revolute", "b1"),
        ("b3", "prismatic", "b2"),  # so b2 is as deep as d2, and carries more
        ("c", "revolute", "base"),
        ("c1", "prismatic", "c"),
        ("c2", "prismatic", "c"),
        ("d", "prismatic", "base"),
        ("d1", "prismatic", "d"),
        ("d2", "revolute", "d1"),
        ("d3", "d2", "d2"),  # follows d2
    ]
    robot = tree(tmp_path, *joints)
    names = [joint.name for joint in robot.joints]
    assert names.index("b1") < names.index("c")
    assert ends(robot) == ("c", "b2")  # d2 carries the one that follows it
    continuous = [
        (name, kind.replace("revolute", "continuous"), *rest) for name, kind, *rest in joints
    ]
    assert ends(tree(tmp_path, *continuous[:-1])) == ("c", "d2")


def test_each_joint_has_its_own_limits(tmp_path):
    robot = tree(
        tmp_path,
        ("a", "continuous", "base", -1, 1, 4),
        ("b", "b2", "base"),
        ("b2", "revolute", "b", -1, 3, 0),
        ("c", "prismatic", "base", 0.5, 0.6, 0.25),
        ("d", "revolute", "c", 2, 2, 7),
        floating_base=True,
    )
    assert robot.joint_names == ("a", "b2", "c", "d")
    bounds = limits(robot)
    np.testing.assert_allclose(bounds.centre, [0.0, 1.0, 0.55, 0.0])
    np.testing.assert_allclose(bounds.range, [np.inf, 4.0, 0.1, np.inf])
    np.testing.assert_array_equal(bounds.speed, [4.0, np.inf, 0.25, 7.0])


def test_a_joint_uses_nine_tenths_of_its_range_or_of_its_speed(tmp_path):
    robot = tree(
        tmp_path,
        ("near", "revolute", "base", -9, 9, 0),
        ("room", "revolute", "near", -0.1, 0.3, 0),
        ("slide", "prismatic", "room", 0.5, 0.6, 0),
        ("slow", "revolute", "slide", -9, 9, 0.2),
        ("far", "revolute", "slow", 0, 0, 0),
    )
    run = excitation(robot, rate=1000.0)
    assert ends(robot) == ("near", "far")
    motion = {name: run.position[:, column] for column, name in enumerate(run.joint_names)}
    for name, low, high in (("room", -0.1, 0.3), ("slide", 0.5, 0.6)):
        middle, part = (low + high) / 2, 0.9 * (high - low) / 2
        assert motion[name].min() == pytest.approx(middle - part)
        assert motion[name].max() == pytest.approx(middle + part)
    slow = run.velocity[:, run.joint_names.index("slow")]
    assert np.abs(slow).max() == pytest.approx(0.9 * 0.2)


def test_a_shake_is_where_its_block_is_and_has_its_amplitude(tmp_path):
    robot = chain(tmp_path, "revolute", "revolute", "revolute")
    run = excitation(robot)
    assert [(each.label, each.start, each.stop) for each in run.blocks] == [
        ("shake-near", 1.0, 1.8),
        ("shake-far", 2.6, 3.4),
        ("jerk", 4.6, 4.8),
    ]
    spectra = np.abs(np.fft.rfft(run.velocity[:16000], axis=0))
    hertz = np.fft.rfftfreq(16000, 1 / run.rate)[30:]
    assert hertz[spectra[30:, 0].argmax()] == hertz[spectra[30:, 2].argmax()]
    for column, start in ((0, 1.0), (2, 2.6)):
        fast = vibrating(run.velocity, np.ones(len(run.time), dtype=bool), run.rate)[:, column]
        place = (run.time - start) / 0.8
        envelope = 0.2 * np.sin(np.pi * np.clip(place, 0.0, 1.0)) ** 2
        calm = run.time < 4.5
        noise = fast[calm & (envelope == 0.0)]
        for part in range(8):
            inside = (place >= part / 8) & (place < (part + 1) / 8)
            expected = np.sqrt(np.mean(envelope[inside] ** 2) / 2 + np.mean(noise**2))
            assert np.sqrt(np.mean(fast[inside] ** 2)) == pytest.approx(expected, rel=0.2)


def test_the_speed_of_all_joints_jumps_by_half_and_the_jump_decays(tmp_path):
    robot = tree(tmp_path, *((f"j{n}", "revolute", "base", 0, 0, 0) for n in range(6)))
    run = excitation(robot)
    first = round(4.6 * run.rate)
    step = np.diff(run.velocity[first - 1 : first + 1], axis=0)[0]
    np.testing.assert_allclose(np.abs(step), 0.5, atol=0.05)
    assert {-1.0, 1.0} == set(np.sign(step))
    gone = run.velocity[first] - run.velocity[first + round(0.03 * run.rate)]
    np.testing.assert_allclose(gone * np.sign(step), 0.5 * (1 - np.exp(-1)), atol=0.2)


def test_limits_without_a_range_are_none(tmp_path):
    bounds = limits(Robot.load("double_pendulum"))
    assert np.isinf(bounds.range).all()
    assert np.isinf(bounds.speed).all()
    np.testing.assert_array_equal(bounds.centre, 0.0)
    bounds = limits(chain(tmp_path, "revolute", "continuous"))
    np.testing.assert_array_equal(bounds.range, [18.0, np.inf])
    np.testing.assert_array_equal(bounds.speed, [1.0, 1.0])


def test_the_rate_changes_the_samples_and_not_the_events(tmp_path):
    robot = chain(tmp_path, "revolute", "revolute")
    slow, fast = excitation(robot, rate=1000.0), excitation(robot)
    assert (slow.rate, fast.rate) == (1000.0, RATE)
    assert slow.duration == fast.duration
    assert slow.blocks == fast.blocks


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"rate": 400.0},
            "the excitation at 400 Hz, expected above 400 Hz: its shakes have up to 200 Hz$",
        ),
        ({"rate": np.inf}, "the excitation at inf Hz, expected above 400 Hz"),
        ({"rate": np.nan}, "the excitation at nan Hz, expected above 400 Hz"),
        ({"seed": -1}, "seed is -1, expected 0 or more"),
    ],
)
def test_a_rate_or_a_seed_that_cannot_be_is_refused(tmp_path, options, message):
    with pytest.raises(NoiseModelError, match=message):
        excitation(chain(tmp_path, "revolute"), **options)


def test_a_run_names_a_listed_robot_and_the_file_of_another(tmp_path):
    assert excitation(Robot.load("ur5"), rate=500.0).robot == "ur5"
    robot = chain(tmp_path, "revolute")
    assert excitation(robot, rate=500.0).robot == str(robot.path)


def test_the_lowest_rate_is_above_twice_that_of_the_shakes(tmp_path):
    robot = chain(tmp_path, "revolute", floating_base=True)
    run = excitation(robot, rate=401.0)
    assert len(run.time) == 2406
    assert run.meta == {"scenario": "excitation", "seed": 0}
    np.testing.assert_array_equal(
        excitation(robot, rate=401.0, seed=0).base_velocity, run.base_velocity
    )
    assert run.base_velocity.shape == (2406, 6)


def test_the_motion_of_a_seed_is_that_of_every_version(tmp_path):
    """Published comparisons of robots are of this motion."""
    run = excitation(chain(tmp_path, "revolute", "revolute"), rate=1000.0, seed=3)
    rows = [0, 500, 1400, 2600, 3000, 3900, 4599, 4600, 4630]
    velocity = [
        [-0.07680895, 0.54502649],
        [0.01674567, 0.47425227],
        [-0.43822055, -0.24924171],
        [-0.4288232, 0.09651234],
        [-0.31210099, 0.29743893],
        [-0.67597647, -0.12145249],
        [0.23916955, -0.84358737],
        [0.04153442, -0.60159598],
        [0.20848983, -0.7720573],
    ]
    np.testing.assert_allclose(run.velocity[rows], velocity, atol=1e-7)
    position = [[0.83873093, 0.10168808], [-0.14746383, 0.29010324], [-0.494962, -0.42117099]]
    np.testing.assert_allclose(run.position[[0, 3000, 5999]], position, atol=1e-7)
    kinds = ("revolute", "prismatic", "continuous")
    run = excitation(chain(tmp_path, *kinds, floating_base=True), rate=1000.0, seed=3)
    position = [[-0.84855862, 0.55368367, 0.23291852], [0.82628143, -0.36440717, 0.07629094]]
    np.testing.assert_allclose(run.position[[0, 3000]], position, atol=1e-7)
    base = [
        [0.08977637, 0.07622201, 0.06053005, 0.01255334, 0.16195811, -0.16350946],
        [0.12727098, -0.03048063, -0.15098178, 0.11352999, -0.09512691, -0.0067453],
    ]
    np.testing.assert_allclose(run.base_velocity[[0, 4600]], base, atol=1e-7)
