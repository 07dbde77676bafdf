import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from noisemodel import NoiseModelError, Run, simplified

VELOCITIES = arrays(
    np.float64, st.tuples(st.integers(1, 20), st.integers(0, 5)), elements=st.floats(-100, 100)
)


def test_standstill_is_silent():
    assert np.array_equal(simplified(np.zeros((5, 3)), np.zeros((5, 3))), np.zeros(5))


def test_the_noise_of_one_joint_is_its_speed():
    assert np.array_equal(simplified(np.array([[3.0], [-4.0]])), [3.0, 4.0])


def test_measured_and_desired_motion_add_as_powers():
    assert simplified(np.array([[3.0, 0.0]]), np.array([[0.0, 4.0]])) == [5.0]


@given(VELOCITIES, st.floats(0, 10))
def test_noise_grows_with_the_speed(velocity, factor):
    faster = simplified(factor * velocity, factor * velocity)
    assert np.allclose(faster, factor * simplified(velocity, velocity), rtol=1e-12, atol=1e-12)


@given(VELOCITIES)
def test_noise_does_not_depend_on_signs_and_order_of_joints(velocity):
    assert np.allclose(simplified(velocity), simplified(-velocity[:, ::-1]), rtol=1e-14)


def test_the_desired_joints_may_be_fewer_than_the_measured():
    assert np.allclose(simplified(np.ones((4, 30)), np.ones((4, 24))), np.sqrt(54), rtol=1e-15)


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


def test_velocities_of_another_length_are_refused():
    with pytest.raises(NoiseModelError, match="velocity has 3 samples, velocity_desired 4"):
        simplified(np.zeros((3, 2)), np.zeros((4, 2)))


def test_velocities_without_a_joint_axis_are_refused():
    with pytest.raises(NoiseModelError, match=r"shape \(3,\), expected \(samples, joints\)"):
        simplified(np.zeros(3))
