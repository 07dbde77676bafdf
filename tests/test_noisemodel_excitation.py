import numpy as np
import pytest
from chains import chain

from noisemodel import NoiseModelError, Robot
from noisemodel.excitation import RATE, SHAKES, ends, excitation, limits

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
        ({"rate": 400.0}, "the excitation at 400 Hz, expected above 400 Hz"),
        ({"seed": -1}, "seed is -1, expected 0 or more"),
    ],
)
def test_a_rate_or_a_seed_that_cannot_be_is_refused(tmp_path, options, message):
    with pytest.raises(NoiseModelError, match=message):
        excitation(chain(tmp_path, "revolute"), **options)


def test_the_motion_of_a_seed_is_that_of_every_version(tmp_path):
    """Published comparisons of robots are of this motion."""
    run = excitation(chain(tmp_path, "revolute", "revolute"), rate=1000.0, seed=3)
    rows = [0, 500, 1400, 2600, 3000, 3900]
    velocity = [
        [-0.07680895, 0.54502649],
        [0.01674567, 0.47425227],
        [-0.43822055, -0.24924171],
        [-0.4288232, 0.09651234],
        [-0.31210099, 0.29743893],
        [-0.67597647, -0.12145249],
    ]
    np.testing.assert_allclose(run.velocity[rows], velocity, atol=1e-7)
