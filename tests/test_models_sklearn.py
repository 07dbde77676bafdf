import doctest
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.utils.estimator_checks import parametrize_with_checks

import noiseclassifier as nc
import noiseclassifier.sklearn
from noiseclassifier.sklearn import NoiseClassifier, NoiseFeatures

RATE = 1000.0
QUICK = {"networks": 2, "units": 4, "epochs": 3}
"""Settings for short training, where the result does not matter."""


@parametrize_with_checks([NoiseFeatures(), NoiseClassifier(settings=QUICK)])
def test_estimators_pass_the_checks_of_scikit_learn(estimator, check):
    check(estimator)


@pytest.mark.slow
@parametrize_with_checks(
    [
        NoiseClassifier(settings={"estimator": "trees", "rounds": 2}),
        NoiseClassifier(settings={"estimator": "svm"}),
    ]
)
def test_classifiers_of_other_kinds_pass_them_too(estimator, check):
    check(estimator)


def frames(groups=4, each=15):
    """Frames of good motion and of oscillations, of some groups of runs."""
    random = np.random.default_rng(0)
    count = groups * each
    noise = 1.0 + 0.01 * random.standard_normal((count, 400))
    labels = np.tile(["ok", "oscillations", "impact"], count // 3)
    noise[labels == "oscillations"] += 0.1 * np.sin(2 * np.pi * 90 * np.arange(400) / RATE)
    noise[labels == "impact", 200:220] += 0.5 * random.standard_normal(20)
    return noise, labels, np.repeat([f"run {number}" for number in range(groups)], each)


def test_the_example_of_the_documentation_runs():
    assert doctest.testmod(noiseclassifier.sklearn).failed == 0


def test_the_example_of_the_page_runs():
    page = (Path(__file__).parents[1] / "docs" / "classifier.md").read_text(encoding="utf-8")
    (code,) = re.findall("```python\n(.*?)```", page, re.DOTALL)
    noise, labels, groups = frames()
    last = code.strip().replace("\ncross_val_score", "\nscores = cross_val_score")
    names = {"frames": noise, "labels": labels, "groups": groups}
    exec(last, names)
    assert names["scores"].mean() > 0.9


def test_features_are_those_of_the_profile():
    noise, _, _ = frames()
    profile = nc.SCALAR.at(RATE)
    expected = nc.features(noise, profile)
    transformer = NoiseFeatures(rate=RATE).fit(noise)
    assert transformer.profile_ == profile
    np.testing.assert_array_equal(transformer.transform(noise), expected)
    np.testing.assert_array_equal(NoiseFeatures(profile).fit_transform(noise), expected)
    assert len(transformer.get_feature_names_out()) == expected.shape[1]


def test_several_signals_are_one_after_the_other_in_a_row():
    random = np.random.default_rng(1)
    signals = random.standard_normal((5, 3, 400))
    found = NoiseFeatures("general").fit_transform(signals.reshape(5, -1))
    np.testing.assert_array_equal(found, nc.features(signals, nc.GENERAL.at(RATE)))


@pytest.mark.parametrize("estimator", ["networks", "trees", "svm"])
def test_scores_are_those_of_a_classifier_of_models(estimator):
    noise, labels, groups = frames()
    noise, labels, groups = (each[labels != "impact"] for each in (noise, labels, groups))
    settings = {"estimator": estimator, "rounds": 10, "epochs": 10}
    profile = replace(nc.SCALAR.at(RATE), classes=("ok", "oscillations"), **settings)
    ours = nc.Classifier.train(nc.Dataset(noise, labels, groups, {}), profile)
    theirs = NoiseClassifier(settings=settings).fit(noise, labels, groups)
    scores = ours.scores(noise)
    if estimator == "svm":
        difference = scores[:, 1] - scores[:, 0]
        np.testing.assert_array_equal(theirs.decision_function(noise), difference)
    else:
        np.testing.assert_array_equal(theirs.predict_proba(noise), scores)


def test_probabilities_are_there_for_estimators_that_have_them():
    noise, labels, groups = frames()
    trees = NoiseClassifier(settings={"estimator": "trees", "rounds": 5})
    probabilities = trees.fit(noise, labels, groups).predict_proba(noise)
    np.testing.assert_allclose(probabilities.sum(axis=1), 1.0)
    np.testing.assert_allclose(np.log(probabilities), trees.decision_function(noise))
    assert not hasattr(NoiseClassifier(settings={"estimator": "svm"}), "predict_proba")


def test_groups_calibrate():
    noise, labels, groups = frames()
    classifier = NoiseClassifier(settings={"estimator": "trees", "rounds": 5})
    alone = clone(classifier).fit(noise, labels).estimator_
    assert alone.calibration.tolist() == [1.0, 0.0, 0.0, 0.0]
    grouped = clone(classifier).fit(noise, labels, groups=groups).estimator_
    assert grouped.calibration.tolist() != alone.calibration.tolist()


@pytest.mark.parametrize(
    ("estimator", "width", "error", "reason"),
    [
        (
            NoiseFeatures("loud"),
            400,
            nc.ProfileError,
            "no profile 'loud'; there are scalar",
        ),
        (NoiseFeatures("general"), 400, nc.SignalError, "rows of 400 numbers, expected frames"),
        (NoiseFeatures(rate=50.0), 400, nc.ProfileError, "take a rate of 70 Hz at least"),
        (
            NoiseFeatures(settings={"colour": 1}),
            400,
            nc.ProfileError,
            "setting 'colour' is",
        ),
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
    noise = np.random.default_rng(0).normal(size=(4, length))
    found = NoiseFeatures(rate=RATE).fit(noise).profile_
    assert (found.window, found.length, found.quick_window) == (length, length, 0)
    assert len(found.edges) == bins + 1 == len(np.fft.rfftfreq(length)) + 1
    assert (found.edges[0], found.edges[-1]) == (0.0, 500.0)
    np.testing.assert_allclose(np.diff(found.edges), 500.0 / bins)
    assert NoiseFeatures(rate=RATE).fit_transform(noise).shape[0] == 4


def test_the_class_of_a_frame_is_that_of_the_highest_score():
    noise, labels, groups = frames()
    classifier = NoiseClassifier(settings={"estimator": "trees", "rounds": 5, "leaves": 4})
    classifier.fit(noise, labels, groups)
    scores = classifier.decision_function(noise)
    assert scores.shape == (60, 3)
    assert classifier.predict(noise).tolist() == [
        ("impact", "ok", "oscillations")[place] for place in scores.argmax(axis=1)
    ]
    with pytest.raises(ValueError, match=r"^training requires 2 classes or more; y has 1 class$"):
        NoiseClassifier().fit(noise, np.full(60, "ok"))
