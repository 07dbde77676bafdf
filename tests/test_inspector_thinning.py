import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from inspector.levels import extremes


@given(st.integers(1, 5000), st.integers(2, 300), st.integers(0, 2**32 - 1))
def test_no_peak_is_lost_and_points_are_few(samples, points, seed):
    values = np.random.default_rng(seed).normal(size=(samples, 3))
    time = np.arange(samples) / 100
    kept_time, kept = extremes(time, values, points=points)
    assert len(kept) <= max(points, 2)
    assert len(kept_time) == len(kept)
    np.testing.assert_array_equal(kept.max(axis=0), values.max(axis=0))
    np.testing.assert_array_equal(kept.min(axis=0), values.min(axis=0))
    assert (np.diff(kept_time) >= 0).all()


def test_short_signals_are_kept_as_they_are():
    values = np.arange(10.0)[:, None]
    time, kept = extremes(np.arange(10.0), values, points=10)
    np.testing.assert_array_equal(kept, values)
    np.testing.assert_array_equal(time, np.arange(10.0))
