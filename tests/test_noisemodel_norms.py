"""The norms of a run are the parts of its simplified noise."""

import numpy as np
import pytest

import noisemodel as nm

SAMPLES = 40
generator = np.random.default_rng(5)
velocity, desired, base = (generator.normal(size=(SAMPLES, width)) for width in (3, 3, 6))


def run(**signals):
    names = {"joint_names": ("a", "b", "c"), **signals}
    return nm.Run(time=np.arange(SAMPLES) / 1000, velocity=velocity, **names)


def test_measured_and_desired_norms_make_the_noise():
    norms = nm.norms(run(velocity_desired=desired, base_velocity=base))
    np.testing.assert_allclose(
        norms["noise"], np.hypot(norms["measured"], norms["desired"]), rtol=1e-12
    )
    whole = np.hstack((base, velocity))
    np.testing.assert_allclose(norms["measured"], np.linalg.norm(whole, axis=1), rtol=1e-12)


def test_a_run_that_follows_perfectly_has_no_error():
    norms = nm.norms(run(velocity_desired=velocity))
    assert not norms["error"].any()
    assert norms["desired"].any()


def test_errors_are_between_joints_of_one_name():
    swapped = nm.norms(run(velocity_desired=velocity[:, ::-1], desired_joint_names=("c", "b", "a")))
    assert not swapped["error"].any()
    fewer = nm.norms(run(velocity_desired=desired[:, :1], desired_joint_names=("b",)))
    np.testing.assert_allclose(fewer["error"], np.abs(desired[:, 0] - velocity[:, 1]), rtol=1e-12)


@pytest.mark.parametrize(
    ("signals", "names"),
    [
        ({}, {"noise", "measured"}),
        (
            {"velocity_desired": desired[:, :1], "desired_joint_names": ("tool",)},
            {"noise", "measured", "desired"},
        ),
    ],
)
def test_what_a_run_does_not_have_makes_no_norm(signals, names):
    assert nm.norms(run(**signals)).keys() == names


def test_joints_are_those_that_are_desired_as_well_as_measured():
    both = nm.by_joint(run(velocity_desired=desired[:, :2], desired_joint_names=("c", "a")))
    np.testing.assert_array_equal(both["measured_joints"], velocity[:, [0, 2]].T)
    np.testing.assert_array_equal(both["desired_joints"], desired[:, [1, 0]].T)
    np.testing.assert_array_equal(
        both["error_joints"], both["desired_joints"] - both["measured_joints"]
    )


def test_a_run_without_desired_velocities_has_all_measured_joints():
    alone = nm.by_joint(run())
    assert alone.keys() == {"measured_joints"}
    np.testing.assert_array_equal(alone["measured_joints"], velocity.T)


def test_a_run_of_which_no_desired_joint_is_measured_has_nothing_joint_by_joint():
    others = run(velocity_desired=desired[:, :1], desired_joint_names=("tool",))
    assert nm.by_joint(others) == {}


def test_joints_have_the_norms_of_their_run():
    moved = run(velocity_desired=desired)
    norms = nm.norms(moved)
    for name in ("measured", "desired", "error"):
        own = np.linalg.norm(nm.by_joint(moved)[f"{name}_joints"], axis=0)
        np.testing.assert_allclose(own, norms[name], rtol=1e-12)
