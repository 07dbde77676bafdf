"""The general model: one for any rate, and for whatever signals a log has."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from generalmodel import RATES, RECIPE, frames, recording, rewrite, signals, trained

import noiseclassifier as nc
from noiseclassifier.classifier import TAKEN
from noiseclassifier.estimators import Detector
from noiseclassifier.features import frame_features
from noiseclassifier.profile import HIGHEST, INPUTS, LOWEST, columns
from noiseclassifier.signals import JOINTS, MOTION, NOISE

# Signals of logs, by what they have.
GIVEN = {
    "motion and joints": (*MOTION, *JOINTS),
    "motion": MOTION,
    "measured and joints": ("measured", "measured_joints"),
    "measured": ("measured",),
    "noise": (NOISE,),
}


@pytest.fixture
def path(tmp_path):
    trained().save(tmp_path / "model.npz")
    return tmp_path / "model.npz"


@pytest.mark.parametrize("given_", GIVEN)
@pytest.mark.parametrize("rate", RATES)
def test_a_bound_model_decides_as_the_full_one_without_the_missing_features(rate, given_):
    model = trained()
    there = signals(rate, "oscillations", seed=7, names=GIVEN[given_])
    bound = model.at(rate, there)
    assert bound.profile.signals == GIVEN[given_]
    _, features, _ = frame_features(there, bound.profile)
    full = np.full((len(features), len(RECIPE.columns)), np.nan)
    full[:, RECIPE.places(bound.profile)] = features
    expected = model.estimator.decision((full - model.mean) / model.scale)
    np.testing.assert_array_equal(bound.decide(features), expected)


@pytest.mark.parametrize("names", INPUTS, ids=", ".join)
def test_a_feature_has_one_name_at_any_rate(names):
    fewer = ()
    for rate in (LOWEST, 99.7, 125.0, 149.0, 160.0, 250.0, 512.0, 1000.0, 4000.0, HIGHEST):
        profile = RECIPE.at(rate, names)
        found = columns(profile)
        rows = profile.norms + 2 * (len(profile.signals) - profile.norms)
        frame = np.zeros((1, rows, profile.length) if rows > 1 else (1, profile.length))
        assert len(found) == len(set(found)) == nc.features(frame, profile).shape[1]
        assert set(fewer) <= set(found)
        places = RECIPE.places(profile)
        assert (np.diff(places) > 0).all()
        assert tuple(np.array(RECIPE.columns)[places]) == found
        fewer = found


@pytest.mark.parametrize("frequency", [22.0, 30.0])
def test_a_tone_is_in_features_of_one_name_at_any_rate(frequency):
    loudest = set()
    for rate in RATES:
        tone = 0.1 * np.sin(2 * np.pi * frequency * np.arange(round(2 * rate)) / rate)
        profile = RECIPE.at(rate, ("measured",))
        names = columns(profile)
        _, features, _ = frame_features({"measured": tone}, profile)
        means = [n for n, name in enumerate(names) if name.startswith("measured long mean")]
        loudest.add(names[means[features[0, means].argmax()]])
    assert loudest == {f"measured long mean {15 if frequency < 25 else 25}"}


@pytest.mark.parametrize("rate", RATES)
def test_failures_are_found_at_any_rate(rate):
    bound = trained().at(rate, (*MOTION, *JOINTS))
    ok = bound.classify(signals(rate, "ok", seed=11), rate)
    shaken = bound.classify(signals(rate, "oscillations", seed=11), rate)
    assert ok.flagged.mean() < 0.3 < 0.7 < shaken.flagged.mean()
    assert "oscillations" in {event.label for event in shaken.events()}


def test_a_model_takes_the_most_signals_that_a_log_has():
    model = trained()
    for names in GIVEN.values():
        assert model.at(200.0, names).profile.signals == names
    assert model.at(200.0, (*MOTION, "measured_joints")).profile.signals == MOTION
    assert model.at(200.0, ("measured", "desired")).profile.signals == ("measured",)
    assert model.at(200.0).profile.signals == (NOISE,)
    with pytest.raises(nc.MissingSignalError, match="no signal noise; there is desired"):
        model.at(200.0, ("desired",))


def test_a_model_takes_rates_from_the_lowest_to_the_highest():
    model = trained()
    assert model.at(LOWEST).rate == LOWEST
    assert model.at(LOWEST * (1 - 1e-4)).rate == pytest.approx(LOWEST, rel=1e-3)
    assert model.at(333.3).rate == 333.3
    assert model.at(48_000.0).rate == HIGHEST
    with pytest.raises(nc.RateError, match="logged at 79 Hz, the model needs 80 Hz or more"):
        model.at(79.0)


def test_a_general_model_is_nearer_than_one_of_a_lower_rate_and_yields_to_more_signals():
    general = trained()
    slow = replace(general.at(125.0), sha256="slow")
    library = {"general": general, "slow": slow}
    assert nc.nearest(library, 500.0)[0] == "general"
    name, chosen = nc.nearest(library, 125.0, ("measured",))
    assert (name, chosen.profile.signals) == ("general", ("measured",))
    with pytest.raises(nc.RateError, match="logged at 50 Hz, the model needs 80 Hz or more"):
        nc.nearest(library, 50.0)


def test_frames_are_those_that_classifying_cuts_once_for_each_input_that_they_feed():
    one = recording(500.0, "oscillations", 0)
    parts = list(nc.frames_of([one], RECIPE))
    feeding = [names for names in TAKEN if set(names) <= {*one.signal, NOISE}]
    assert len(parts) == len(feeding)
    for names, part in zip(feeding, parts, strict=True):
        profile = RECIPE.at(500.0, names)
        _, features, _ = frame_features(one.signal, profile)
        features = features if names is feeding[0] else features[::2]
        assert part.features.shape == (len(features), len(RECIPE.columns))
        places = RECIPE.places(profile)
        there = ~np.isnan(part.features[:, places])
        np.testing.assert_array_equal(
            part.features[:, places][there], features.astype(np.float32)[there]
        )
        assert np.isnan(np.delete(part.features, places, axis=1)).all()
        assert set(part.labels) == {"oscillations"}
        assert part.hashes == {one.name: one.sha256}


@pytest.mark.parametrize("label", ["ok", "impact", "oscillations"])
def test_frames_are_evaluated_as_the_model_bound_to_their_log_decides_them(label):
    one = recording(500.0, label, 0)
    bound = trained().at(500.0, one.signal)
    _, features, _ = frame_features(one.signal, bound.profile)
    predicted = bound.predict(features.astype(np.float32))
    part = next(nc.frames_of([one], RECIPE))
    expected = nc.Evaluation.of(part.labels, predicted, trained().classes)
    assert trained().evaluate(part).as_dict() == expected.as_dict()


def test_every_so_many_quiet_ok_frames_are_kept_and_all_others():
    ok, bad = recording(500.0, "ok", 0), recording(500.0, "impact", 0)
    for one, share in ((ok, 4), (bad, 1)):
        (whole, *_), (thin, *_) = (
            list(nc.frames_of([one], RECIPE, thin=count)) for count in (1, 4)
        )
        assert len(thin.labels) == len(whole.labels) // share
    bare = next(nc.frames_of([replace(ok, blocks=())], RECIPE))
    assert bare.features.shape == (0, len(RECIPE.columns))


def test_an_ok_frame_that_is_louder_than_its_run_is_always_kept():
    ok = recording(500.0, "ok", 0)
    landing = 1500
    louder = {name: np.array(each) for name, each in ok.signal.items()}
    for each in louder.values():
        each[..., landing : landing + 10] *= 30.0
    (plain, *_), (loud, *_) = (
        list(nc.frames_of([replace(ok, signal=signal)], RECIPE, thin=100))
        for signal in (ok.signal, louder)
    )
    assert len(plain.labels) == 0
    assert len(loud.labels) >= 4  # each instant is in four frames


def test_quiet_ok_frames_count_for_those_that_were_left_out(monkeypatch):
    counted, plain = [], trained()

    def fit(*given):
        counted.append(given[-1])
        return plain.estimator

    monkeypatch.setattr(Detector, "fit", fit)
    some = frames()
    nc.General.train(some, RECIPE, thin=4)
    (weight,) = counted
    assert set(weight[some.labels != "ok"]) == {1.0}
    assert (weight[some.labels == "ok"] == 4.0).mean() > 0.9


def test_features_relative_to_a_reference_are_never_novel():
    relative = np.array([name.startswith("relative") for name in RECIPE.columns])
    known = trained().estimator.known
    assert (known[relative] > 1e6).all()
    assert (known[~relative] < 1e6).any()


def test_training_takes_two_classes():
    alone = nc.Dataset.joined(nc.frames_of([recording(500.0, "ok", 0)], RECIPE))
    with pytest.raises(nc.DatasetError, match="two classes or more of ok, impact, .* are ok"):
        nc.General.train(alone, RECIPE)


def test_a_part_of_the_frames_may_lack_a_feature_that_others_have():
    recordings = [
        recording(rate, label, seed)
        for seed, rate in enumerate((80.0, 125.0, 125.0, 500.0))
        for label in ("ok", "oscillations")
    ]
    model = nc.General.train(nc.Dataset.joined(nc.frames_of(recordings, RECIPE)), RECIPE)
    shaken = signals(500.0, "oscillations", seed=12)
    labels = model.at(500.0, shaken).classify(shaken, 500.0)
    assert "oscillations" in {event.label for event in labels.events()}


def test_a_model_that_was_saved_decides_as_before(path):
    loaded = nc.load(path)
    assert isinstance(loaded, nc.General)
    assert (loaded.recipe, loaded.classes) == (RECIPE, trained().classes)
    assert (loaded.runs, loaded.metrics) == (trained().runs, trained().metrics)
    for rate in RATES:
        for names in GIVEN.values():
            there = signals(rate, "impact", seed=30, names=names)
            ours, theirs = (m.at(rate, there).classify(there, rate) for m in (trained(), loaded))
            np.testing.assert_array_equal(ours.scores, theirs.scores)
            np.testing.assert_array_equal(ours.label, theirs.label)
    assert loaded.at(500.0).sha256 == loaded.sha256 != ""


def test_a_model_saved_twice_has_the_same_bytes(path, tmp_path):
    nc.load(path).save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == path.read_bytes()


@pytest.mark.slow
def test_training_twice_gives_the_same_bytes(path, tmp_path):
    nc.General.train(frames(), RECIPE).save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        (None, "a recipe has alarm, classes, .*, and nothing else"),
        ({"colour": 1}, "a recipe has alarm, classes, .*, and nothing else"),
        *(
            ({name: value}, f"{name} is {value!r}, expected a number from 0 to 10000")
            for name, values in {
                "frame": ("long", -0.4),
                "highest": (10_001.0, True, None),
                "quick": (float("inf"), float("-inf")),
            }.items()
            for value in values
        ),
        ({"per_octave": 0.0}, "a setting of the recipe is wrong"),
        ({"lowest": 30.0}, "a rate of 80 Hz leaves 1 bands"),
        ({"hop": 0.001}, "hop is 0, expected more than 0"),
        ({"classes": ["ok"]}, "classes are ok, expected"),
        ({"rounds": 9}, "array 'feature' has shape"),
        ({"highest": 1000.0}, "array 'known' has shape"),
        ({"estimator": "svm"}, "a recipe for any rate has trees and a reference"),
        ({"reference": False}, "joint by joint takes 'log' and one of both"),
    ],
)
def test_a_wrong_recipe_is_refused(path, changes, reason):
    recipe = [] if changes is None else {**asdict(RECIPE), **changes}
    rewrite(path, {"recipe": recipe})
    with pytest.raises(nc.FileError, match=rf"model.npz: .*{reason}"):
        nc.load(path)


@pytest.mark.parametrize(
    ("name", "change", "reason"),
    [
        ("known", lambda array: array[:-1], "array 'known' has shape"),
        ("missing", lambda array: array + 1.0, "array 'missing' holds values beyond 0 to 1"),
    ],
)
def test_a_damaged_file_is_refused(path, name, change, reason):
    with np.load(path, allow_pickle=False) as members:
        array = members[name]
    rewrite(path, **{name: change(array)})
    with pytest.raises(nc.FileError, match=rf"model.npz: .*{reason}"):
        nc.load(path)
