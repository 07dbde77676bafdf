import doctest

import numpy as np
import pytest
from sklearn.utils.estimator_checks import parametrize_with_checks

import noiseclassifier as nc
import noiseclassifier.sklearn
from noiseclassifier.sklearn import NoiseFeatures

RATE = 1000.0
NOISE = np.random.default_rng(0).normal(1.0, 0.1, (6, 400))


@parametrize_with_checks([NoiseFeatures()])
def test_features_pass_the_checks_of_scikit_learn(estimator, check):
    check(estimator)


def test_the_example_of_the_documentation_runs():
    assert doctest.testmod(noiseclassifier.sklearn).failed == 0


def test_features_are_those_of_the_profile():
    profile = nc.LogBands().at(RATE)
    expected = nc.features(NOISE, profile)
    transformer = NoiseFeatures(rate=RATE).fit(NOISE)
    assert transformer.profile_ == profile
    np.testing.assert_array_equal(transformer.transform(NOISE), expected)
    np.testing.assert_array_equal(NoiseFeatures(profile).fit_transform(NOISE), expected)
    assert len(transformer.get_feature_names_out()) == expected.shape[1]


def test_several_signals_are_one_after_the_other_in_a_row():
    recipe = nc.LogBands(signals=("measured", "error"))
    found = NoiseFeatures(recipe).fit_transform(NOISE.reshape(3, 800))
    np.testing.assert_array_equal(found, nc.features(NOISE.reshape(3, 2, 400), recipe.at(RATE)))


@pytest.mark.parametrize(
    ("estimator", "width", "error", "reason"),
    [
        (
            NoiseFeatures(nc.LogBands(signals=("measured", "error"))),
            401,
            nc.SignalError,
            "rows of 401 numbers, expected frames of 2 samples or more of measured, error",
        ),
        (NoiseFeatures(rate=50.0), 400, nc.ProfileError, "take a rate of 70 Hz at least"),
        (NoiseFeatures(), 1, ValueError, r"1 feature\(s\) .* while a minimum of 2 is required"),
        (
            NoiseFeatures(nc.Profile.paper()).fit(np.ones((1, 4000))),
            400,
            ValueError,
            "X has 400 features, but NoiseFeatures is expecting 4000",
        ),
    ],
)
def test_what_does_not_fit_is_refused(estimator, width, error, reason):
    noise = np.ones((3, width))
    with pytest.raises(error, match=reason):
        estimator.transform(noise) if hasattr(estimator, "profile_") else estimator.fit(noise)


@pytest.mark.parametrize(("length", "bins"), [(2, 2), (19, 10), (60, 31), (99, 50)])
def test_a_frame_shorter_than_a_window_has_the_bins_of_its_own_transform(length, bins):
    found = NoiseFeatures(nc.LogBands(quick=0.02), rate=RATE).fit(NOISE[:, :length]).profile_
    assert (found.window, found.length, found.quick_window) == (length, length, 0)
    assert len(found.edges) == bins + 1 == len(np.fft.rfftfreq(length)) + 1
    assert (found.edges[0], found.edges[-1]) == (0.0, 500.0)
    np.testing.assert_allclose(np.diff(found.edges), 500.0 / bins)
    assert NoiseFeatures(rate=RATE).fit_transform(NOISE[:, :length]).shape[0] == 6
