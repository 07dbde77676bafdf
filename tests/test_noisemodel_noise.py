"""The norms of a run are the parts of its simplified noise."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import noisemodel as nm
from noisemodel import NoiseModelError, Run, simplified

VELOCITIES = arrays(
    np.float64, st.tuples(st.integers(1, 20), st.integers(0, 5)), elements=st.floats(-100, 100)
)


def test_measured_and_desired_motion_add_as_powers_and_one_joint_is_its_speed():
    assert simplified(np.array([[3.0, 0.0]]), np.array([[4.0]])) == [5.0]
    assert np.array_equal(simplified(np.array([[3.0], [-4.0], [0.0]])), [3.0, 4.0, 0.0])


@given(VELOCITIES, st.floats(0, 10))
def test_noise_grows_with_the_speed_whatever_the_signs_and_the_order_of_joints(velocity, factor):
    once, faster = (simplified(way * velocity, way * velocity) for way in (1.0, factor))
    assert np.allclose(faster, factor * once, rtol=1e-12, atol=1e-12)
    assert np.allclose(simplified(velocity), simplified(-velocity[:, ::-1]), rtol=1e-14)


def test_a_floating_base_counts_with_its_six_velocities():
    run = Run(
        time=np.arange(4) / 1000,
        velocity=np.ones((4, 2)),
        joint_names=("a", "b"),
        base_velocity=np.full((4, 6), 2.0),
    )
    assert run.motion.shape == (4, 8)
    assert np.allclose(simplified(run.motion), np.sqrt(2 + 24), rtol=1e-15)


def test_single_precision_is_summed_in_double():
    velocity = np.full((1, 40), 0.1, dtype=np.float32)
    noise = simplified(velocity)
    assert noise.dtype == np.float64
    assert noise[0] == pytest.approx(float(np.float32(0.1)) * np.sqrt(40), rel=1e-15)


def test_velocities_of_another_length_or_without_a_joint_axis_are_refused():
    with pytest.raises(NoiseModelError, match="velocity has 3 samples, velocity_desired 4"):
        simplified(np.zeros((3, 2)), np.zeros((4, 2)))
    with pytest.raises(NoiseModelError, match=r"shape \(3,\), expected \(samples, joints\)"):
        simplified(np.zeros(3))


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


def test_errors_are_between_joints_of_one_name():
    swapped = nm.norms(run(velocity_desired=velocity[:, ::-1], desired_joint_names=("c", "b", "a")))
    assert not swapped["error"].any()
    fewer = nm.norms(run(velocity_desired=desired[:, :1], desired_joint_names=("b",)))
    np.testing.assert_allclose(fewer["error"], np.abs(desired[:, 0] - velocity[:, 1]), rtol=1e-12)


def test_what_a_run_does_not_have_makes_no_norm_and_nothing_joint_by_joint():
    alone, others = run(), run(velocity_desired=desired[:, :1], desired_joint_names=("tool",))
    assert nm.norms(alone).keys() == {"noise", "measured"}
    assert nm.norms(others).keys() == {"noise", "measured", "desired"}
    assert nm.by_joint(alone).keys() == {"measured_joints"}
    np.testing.assert_array_equal(nm.by_joint(alone)["measured_joints"], velocity.T)
    assert nm.by_joint(others) == {}


def test_joints_are_those_that_are_desired_as_well_as_measured():
    both = nm.by_joint(run(velocity_desired=desired[:, :2], desired_joint_names=("c", "a")))
    np.testing.assert_array_equal(both["measured_joints"], velocity[:, [0, 2]].T)
    np.testing.assert_array_equal(both["desired_joints"], desired[:, [1, 0]].T)
    np.testing.assert_array_equal(
        both["error_joints"], both["desired_joints"] - both["measured_joints"]
    )


def test_joints_have_the_norms_of_their_run():
    moved = run(velocity_desired=desired)
    norms = nm.norms(moved)
    for name in ("measured", "desired", "error"):
        own = np.linalg.norm(nm.by_joint(moved)[f"{name}_joints"], axis=0)
        np.testing.assert_allclose(own, norms[name], rtol=1e-12)
