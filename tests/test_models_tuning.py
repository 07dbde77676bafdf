from dataclasses import dataclass, replace

import numpy as np
import pytest

import noiseclassifier as nc
from noiseclassifier import tuning
from noiseclassifier.recording import Block, Recording, folds
from noiseclassifier.tuning import CRITERIA, Grid, Measures, Trial, measure, order, validate

SMALL = {"rate": 1000.0, "length": 400, "hop": 100, "window": 256, "stride": 48}
PROFILES = {
    "noisytest": replace(nc.Profile.noisytest(), **SMALL, open_end=100),
    "noisytest-linear": replace(nc.Profile.noisytest("linear"), **SMALL, open_end=100),
    "paper": replace(nc.Profile.paper(), **SMALL),
    "paper-linear": replace(nc.Profile.paper("linear"), **SMALL),
    "logbands": nc.LogBands().at(1000.0),
}


def recording(number, classes=nc.CLASSES):
    """Ten seconds of noise in which each class has a stretch, hard to separate from the others."""
    random = np.random.default_rng(number)
    signal = random.standard_normal(10_000)
    time = np.arange(len(signal)) / 1000.0
    sounds = {
        "impact": 3.0 * random.standard_normal(len(signal)) * (np.sin(12.0 * time) > 0.97),
        "highaccelerations": np.convolve(random.standard_normal(len(signal)), np.ones(8), "same"),
        "oscillations": 0.5 * np.sin(2.0 * np.pi * random.uniform(40, 90) * time),
    }
    blocks = []
    for start, label in zip(range(0, 8, 2), classes, strict=False):
        blocks.append(Block(start, start + random.uniform(0.3, 1.9), label))
        inside = (time >= blocks[-1].start) & (time < blocks[-1].stop)
        signal += inside * sounds.get(label, 0.0)
    return Recording(f"walk-{number}", signal, 1000.0, tuple(blocks))


@dataclass(frozen=True)
class Sets:
    """Recordings to learn from and to check, as a trial has them and as a classifier takes them."""

    learn: list
    check: list

    @property
    def trial(self):
        return Trial.against(self.learn, self.check)

    def called(self, profile):
        """What a classifier of its own calls the frames to check."""
        known = nc.Dataset.of(self.learn, profile)
        fresh = nc.Dataset.of(self.check, profile, training=False)
        return nc.Classifier.train(known, profile).predict(fresh.frames)


def sets(classes=nc.CLASSES, learn=range(4), check=range(4, 7)):
    return Sets([recording(n, classes) for n in learn], [recording(n, classes) for n in check])


def some_points(profile, count=6):
    """Points of a coarse grid, drawn at random; neighbours share what they can."""
    texts = [f"stride={profile.stride}", "C=0.01:100:x10"]
    texts += ["gamma=1e-5:1e-1:x10"] if profile.kernel == "rbf" else []
    points = Grid.of(texts, profile.kernel).profiles(profile)
    drawn = np.random.default_rng(7).permutation(len(points))[:count]
    return [points[index] for index in sorted(drawn)]


def names(validation, point=0):
    """Names of what a point calls the frames."""
    return np.array((*validation.classes, "unknown"))[validation.decisions[point].chosen]


def assert_equal_to_training(points, sets):
    validation = validate(points, sets.trial)
    for index, point in enumerate(points):
        assert np.array_equal(names(validation, index), sets.called(point))


@pytest.mark.parametrize("name", PROFILES)
def test_a_point_predicts_what_a_classifier_with_its_profile_predicts(name):
    profile = PROFILES[name]
    assert_equal_to_training(some_points(profile), sets())


@pytest.mark.parametrize("name", ["noisytest", "paper"])
def test_two_classes_are_predicted_as_a_classifier_does(name):
    profile = PROFILES[name]
    assert_equal_to_training(some_points(profile), sets(("ok", "oscillations")))


@pytest.mark.parametrize(
    ("estimator", "grid"),
    [("trees", "leaves=4,8"), ("detector", "leaves=4,8"), ("networks", "epochs=1,2")],
)
def test_points_of_other_estimators_predict_what_a_classifier_predicts(estimator, grid):
    profile = replace(PROFILES["logbands"], estimator=estimator, rounds=3, units=4, networks=2)
    points = Grid.of([grid]).profiles(profile)
    assert_equal_to_training(points, sets(learn=range(12), check=range(12, 14)))


def test_too_many_frames_for_a_kernel_matrix_change_no_decision(monkeypatch):
    points, trial = some_points(PROFILES["paper"]), sets().trial
    kept = validate(points, trial).decisions
    monkeypatch.setattr(tuning, "LARGEST", 0)
    for with_matrix, without in zip(kept, validate(points, trial).decisions, strict=True):
        assert np.array_equal(with_matrix.chosen, without.chosen)
        np.testing.assert_allclose(with_matrix.margins, without.margins, atol=1e-6)


def test_folds_predict_what_a_classifier_of_the_other_recordings_predicts():
    profile = PROFILES["logbands"]
    recordings = [recording(number) for number in range(5)]
    splits = folds([each.name for each in recordings], 3)
    validation = validate([profile], Trial(recordings, splits))
    for learn, check in splits:
        others = [recordings[index] for index in learn]
        for index in check:
            own = validation.runs == recordings[index].name
            theirs = Sets(others, [recordings[index]]).called(profile)
            assert np.array_equal(names(validation)[own], theirs)


def test_recordings_without_annotations_are_passed_over():
    silent = replace(recording(9), blocks=())
    given = sets()
    (found,) = measure([PROFILES["paper"]], given.trial)
    more = Trial.against([*given.learn, silent], [silent, *given.check])
    assert measure([PROFILES["paper"]], more) == [found]


def test_measures_are_those_of_an_evaluation():
    profile, given = PROFILES["noisytest"], sets()
    (found,) = measure([profile], given.trial)
    truth = nc.Dataset.of(given.check, profile, training=False).labels
    report = nc.Evaluation.of(truth, given.called(profile), nc.CLASSES)
    assert 0.3 < report.balanced_accuracy < 1.0
    for name in ("balanced_accuracy", "failure_recall", "false_alarm_rate", "subset_accuracy"):
        assert getattr(found, name) == pytest.approx(getattr(report, name), abs=1e-9)


def test_frames_that_are_out_of_distribution_are_never_ok():
    profile = replace(PROFILES["logbands"], estimator="trees", rounds=3)
    given = sets(learn=range(12), check=range(12, 14))
    strange = [replace(each, signal=1e6 * each.signal) for each in given.check]
    validation = validate([profile], Trial.against(given.learn, strange))
    assert "ok" not in set(names(validation))
    (found,) = validation.measures()
    assert (found.failure_recall, found.false_alarm_rate) == (1.0, 1.0)


def test_a_measure_of_nothing_is_none_in_json():
    (found,) = measure([PROFILES["paper"]], sets(("impact", "oscillations")).trial)
    assert found.as_dict()["false_alarm_rate"] is None
    assert found.as_dict()["failure_recall"] == 1.0


def test_the_log_loss_breaks_ties():
    above_threshold, worse_calibrated = (
        Measures(0.9, 0.2, 1.0, 0.0, 0.8),
        Measures(0.9, 0.3, 1.0, 0.0, 0.9),
    )
    assert min(worse_calibrated, above_threshold, key=order("balanced-accuracy")) is above_threshold
    assert min(worse_calibrated, above_threshold, key=order("subset-accuracy")) is worse_calibrated
    assert min(worse_calibrated, above_threshold, key=order("log-loss")) is above_threshold


@pytest.mark.parametrize("criterion", CRITERIA)
def test_the_point_that_is_better_in_all_measures_is_the_best(criterion):
    better, worse = Measures(0.9, 0.2, 1.0, 0.0, 0.9), Measures(0.8, 0.3, 0.9, 0.1, 0.8)
    assert min(worse, better, key=order(criterion)) is better


def test_one_class_cannot_be_tuned():
    with pytest.raises(nc.DatasetError, match="all frames are ok; tuning takes two classes"):
        measure([PROFILES["paper"]], sets(("ok",)).trial)


def test_recordings_without_any_annotation_cannot_be_tuned():
    trial = Trial.against([replace(recording(0), blocks=())], [recording(1)])
    with pytest.raises(nc.DatasetError, match="no annotated frame in 1 recordings; annotate"):
        measure([PROFILES["paper"]], trial)


def test_a_test_class_without_training_frames_is_named():
    trial = Trial.against([recording(0, ("ok", "impact"))], [recording(1)])
    reason = "no frame of highaccelerations to learn from where those of walk-1 are checked"
    with pytest.raises(nc.DatasetError, match=reason):
        measure([PROFILES["paper"]], trial)


def test_a_class_of_a_single_recording_cannot_be_folded():
    recordings = [recording(n, nc.CLASSES if n == 2 else ("ok", "impact")) for n in range(4)]
    trial = Trial(recordings, folds([each.name for each in recordings], 2))
    reason = "of walk-2 are checked; give more recordings of it, or take other folds"
    with pytest.raises(nc.DatasetError, match=reason):
        measure([PROFILES["paper"]], trial)


@pytest.fixture(scope="module")
def stand_in(lola):
    """The recordings of the stand-in."""
    each = [list(nc.noisytest.read_folder(lola / name)) for name in ("training", "validation")]
    return Sets(*each)


@pytest.mark.slow
@pytest.mark.parametrize(("kernel", "count"), [("rbf", 8), ("linear", 3)])
def test_points_of_the_papers_grid_predict_what_a_classifier_predicts(stand_in, kernel, count):
    points = Grid.paper(kernel).profiles(nc.Profile.noisytest(kernel))
    for index in np.random.default_rng(11).integers(len(points), size=count):
        assert_equal_to_training([points[index]], stand_in)


def test_the_papers_own_point_is_golden(stand_in, golden):
    arrays, _ = golden
    validation = validate([nc.Profile.noisytest()], stand_in.trial)
    assert validation.classes == nc.CLASSES
    assert np.array_equal(validation.decisions[0].chosen, arrays["rbf_validation_pred"])
