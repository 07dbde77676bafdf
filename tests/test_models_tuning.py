"""Tuning: the grid, and the measures of points."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import noiseclassifier as nc
from noiseclassifier import tuning
from noiseclassifier.recording import Block, Recording, folds
from noiseclassifier.tuning import MOST, Grid, Measures, Trial, measure, rank, validate

RBF = nc.Profile.noisytest("rbf")


def test_the_papers_grid_is_noisytests_to_the_bit():
    grid = Grid.paper()
    assert len(grid) == 24_300
    assert {name: len(values) for name, values in grid.axes.items()} == {
        "stride": 81,
        "gamma": 15,
        "regularization": 20,
    }
    # NoisyTest adds 0.1 and 1e-5 to floats; their errors add up, and keep the last values out.
    assert grid.axes["regularization"][6] == 1.0999999999999999
    assert grid.axes["regularization"][-1] == 2.400000000000001
    assert grid.axes["gamma"][-1] == pytest.approx(5.9e-4)
    assert (grid.axes["stride"][0], grid.axes["stride"][-1]) == (224, 1024)


def test_points_come_in_noisytests_order_however_the_grid_is_written():
    grid = Grid.of(["C=1,2", "gamma=0.1,0.2", "stride=224,324"])
    points = [tuple(point.values()) for point in grid.points()]
    assert list(grid.axes) == ["stride", "gamma", "regularization"]
    assert points[:3] == [(224, 0.1, 1.0), (224, 0.1, 2.0), (224, 0.2, 1.0)]
    assert len(points) == len(grid) == 8


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("stride=224:424:100", (224, 324, 424)),
        ("stride=224:423:100", (224, 324)),
        ("C=0.5:0.9:0.1", (0.5, 0.6, 0.7, 0.8, 0.9)),
        ("C=0.1:1000:x10", (0.1, 1.0, 10.0, 100.0, 1000.0)),
        ("gamma=4.5e-4:6e-4:5e-5", (4.5e-4, 5e-4, 5.5e-4, 6e-4)),
        ("gamma=1e-3, 1e-4", (1e-3, 1e-4)),
        ("bands=comb,adjacent", ("comb", "adjacent")),
        ("floor=1e-6", (1e-6,)),
    ],
)
def test_values_are_ranges_with_both_ends_or_lists(text, values):
    ((_, found),) = Grid.of([text]).axes.items()
    assert found == values
    assert {type(value) for value in found} == {type(value) for value in values}


@pytest.mark.parametrize(
    ("texts", "reason"),
    [
        ([], "grid of 0 points, expected 1 to 1000000"),
        (["C="], "grid of regularization needs one or more values, each once"),
        (["C=2.5:0.5:0.1"], "grid of regularization needs one or more values"),
        (["C=1,1.0"], "grid of regularization needs one or more values, each once"),
        (["C"], "grid 'C', expected paper or NAME=VALUES"),
        (["hop=1"], "no setting 'hop' to tune; there are window, stride"),
        *(
            ([f"C={values}"], f"regularization is '{values}', expected finite numbers: values with")
            for values in ("0:1", "0:1:0", "0:1:x10", "1:10:x1", "a", "1,inf", "nan", "0:1e9:1")
        ),
        (["C=-1e308:1e308:1e-300"], "first:last:step, or first:last:xfactor, at most 1000000"),
        (["C=1:inf:1"], "expected finite numbers"),
        (["stride=224.5"], "stride is '224.5', expected whole samples"),
        (["C=0:1e4:1", "gamma=0:1e4:1"], f"grid of 100020001 points, expected 1 to {MOST}"),
    ],
)
def test_what_is_wrong_with_a_grid_is_named(texts, reason):
    with pytest.raises(nc.ProfileError, match=reason):
        Grid.of(texts)


@pytest.mark.parametrize(
    ("text", "profile", "reason"),
    [
        ("stride=4001", RBF, "stride of 4001 samples is longer than a frame of 4000"),
        ("gamma=1", nc.Profile.noisytest("linear"), "gamma does nothing with the linear"),
        ("leaves=8", RBF, "no setting 'leaves' to tune; there are window, stride, bands"),
        ("C=0", RBF, "regularization is 0.0, expected more than 0"),
        ("bands=comb,third", RBF, "bands is 'third', expected one of adjacent, comb, log"),
        ("window=512", RBF, "expected a multiple of three"),
    ],
)
def test_a_grid_that_makes_no_sense_with_a_profile_is_refused(text, profile, reason):
    with pytest.raises(nc.ModelsError, match=reason):
        Grid.of([text]).profiles(profile)


SMALL = {"rate": 1000.0, "length": 400, "hop": 100, "window": 256, "stride": 48}
PROFILES = {
    "noisytest": replace(nc.Profile.noisytest(), **SMALL),
    "noisytest-linear": replace(nc.Profile.noisytest("linear"), **SMALL),
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
        return nc.Classifier.train(known, profile).predict(fresh.features)


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
    return np.array((*validation.classes, "unknown"))[validation.chosen[point]]


def assert_equal_to_training(points, sets):
    validation = validate(points, sets.trial)
    for index, point in enumerate(points):
        assert np.array_equal(names(validation, index), sets.called(point))


@pytest.mark.parametrize("name", PROFILES)
def test_a_point_predicts_what_a_classifier_with_its_profile_predicts(name):
    profile = PROFILES[name]
    assert_equal_to_training(some_points(profile), sets())


def test_too_many_frames_for_a_kernel_matrix_change_no_decision(monkeypatch):
    points, trial = some_points(PROFILES["paper"]), sets().trial
    kept = validate(points, trial)
    monkeypatch.setattr(tuning, "LARGEST", 0)
    without = validate(points, trial)
    assert np.array_equal(kept.chosen, without.chosen)


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
    assert 0.3 < report.measures["balanced_accuracy"] < 1.0
    for name in ("balanced_accuracy", "failure_recall", "false_alarm_rate", "subset_accuracy"):
        assert getattr(found, name) == pytest.approx(report.measures[name], abs=1e-9)


def test_frames_that_are_out_of_distribution_are_never_ok():
    profile = replace(PROFILES["logbands"], estimator="trees", rounds=3)
    given = sets(learn=range(12), check=range(12, 14))
    strange = [replace(each, signal=1e6 * each.signal) for each in given.check]
    validation = validate([profile], Trial.against(given.learn, strange))
    assert "ok" not in set(names(validation))
    (found,) = validation.measures()
    assert (found.failure_recall, found.false_alarm_rate) == (1.0, 1.0)


def test_the_other_accuracy_breaks_ties():
    better, worse = Measures(0.9, 1.0, 0.0, 0.9), Measures(0.9, 1.0, 0.0, 0.8)
    other = Measures(0.8, 1.0, 0.0, 0.9)
    assert sorted((other, worse, better), key=rank) == [better, worse, other]


LACKS = "no frame of highaccelerations to learn from where those of walk-{} are checked"


@pytest.mark.parametrize(
    ("learn", "check", "reason"),
    [
        ([], 1, "no annotated frame in 1 recordings; annotate"),
        (["ok", "impact"], 1, LACKS.format(1)),
        (["ok"], 0, "all frames are ok; tuning takes two classes"),
    ],
)
def test_a_class_without_training_frames_is_named(learn, check, reason):
    fresh = recording(1, nc.CLASSES if check else ("ok",))
    trial = Trial.against([recording(0, tuple(learn))], [fresh])
    with pytest.raises(nc.DatasetError, match=reason):
        measure([PROFILES["paper"]], trial)


def test_a_class_of_a_single_recording_cannot_be_folded():
    recordings = [recording(n, nc.CLASSES if n == 2 else ("ok", "impact")) for n in range(4)]
    trial = Trial(recordings, folds([each.name for each in recordings], 2))
    with pytest.raises(nc.DatasetError, match=f"{LACKS.format(2)}; give more recordings of it"):
        measure([PROFILES["paper"]], trial)
