import json
from dataclasses import replace

import numpy as np
import pytest

import models


@pytest.mark.parametrize("recipe", [models.Profile.noisytest, models.Profile.paper])
@pytest.mark.parametrize(("kernel", "transforms"), [("rbf", 4), ("linear", 8)])
def test_hyper_parameters_are_of_the_papers_table(recipe, kernel, transforms):
    profile = recipe(kernel)
    assert profile.transforms == transforms
    assert profile.regularization == {"rbf": 1.1, "linear": 1.0}[kernel]
    assert profile.gamma == 5.7e-4
    assert profile.duration == 0.4


def test_noisytest_differs_from_the_paper_by_named_settings():
    ours, theirs = models.Profile.noisytest().as_dict(), models.Profile.paper().as_dict()
    assert {name for name in ours if ours[name] != theirs[name]} == {
        "name",
        "bands",
        "multiclass",
        "open_end",
        "single_precision",
        "drop_first_sample",
        "cut_by_time",
        "widen_extra",
        "pad_widened",
    }


@pytest.mark.parametrize(
    "profile", [models.Profile.noisytest("linear"), models.LogBands().at(1234.5)]
)
def test_a_profile_is_equal_after_json(profile):
    assert models.Profile.of(json.loads(json.dumps(profile.as_dict()))) == profile


def test_durations_become_samples_at_any_rate():
    profile = models.LogBands().at(1000.0)
    assert (profile.length, profile.hop, profile.window, profile.stride) == (400, 100, 100, 25)
    assert models.LogBands().at(10_000.0).length == 4000
    assert models.LogBands().at(333.0).length == 133  # 133.2, to the nearest sample


@pytest.mark.parametrize("rate", [250.0, 333.0, 1000.0, 10_000.0, 48_000.0])
def test_band_edges_do_not_depend_on_the_rate(rate):
    low, high = models.LogBands().at(rate).edges, models.LogBands().at(96_000.0).edges
    assert low == high[: len(low)]
    assert low[-1] <= rate / 2
    assert len(low) == len(high) or high[len(low)] > rate / 2
    assert np.diff(low).min() >= 10.0 - 1e-9


def test_quick_bands_begin_with_the_speed_and_drop_out_where_it_does_not_fit():
    edges = models.GENERAL.at(1000.0).quick_edges
    assert edges == pytest.approx((0.0, 75.0, 75.0 * 2 ** (4 / 3), 75.0 * 2 ** (8 / 3)))
    assert edges == models.GENERAL.at(10_000.0).quick_edges[:4]
    assert (models.GENERAL.at(1000.0).quick_window, models.GENERAL.at(1000.0).quick_stride) == (
        20,
        10,
    )
    assert models.GENERAL.at(140.0).quick_window == 0


def test_a_rate_that_leaves_no_bands_is_refused():
    with pytest.raises(models.ProfileError, match="rate of 50 Hz leaves 1 bands up to 25 Hz"):
        models.LogBands().at(50.0)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"length": 0}, "length is 0, expected more than 0"),
        ({"length": 4000.0}, "length is 4000.0, expected a value of type int"),
        ({"hop": True}, "hop is True, expected a value of type int"),
        ({"gamma": float("nan")}, "gamma is nan, expected a finite number"),
        ({"leaves": 17}, "leaves is 17, expected 2 to 16"),
        ({"learning_rate": 0.0}, "learning_rate is 0.0, expected more than 0"),
        ({"alarm": 1.0}, "alarm is 1.0, expected a probability below 1"),
        ({"widen_extra": -1}, "widen_extra is -1, expected 0 or more"),
        ({"kernel": "poly"}, "kernel is 'poly', expected one of linear, rbf"),
        ({"window": 4096}, "window of 4096 samples is longer than a frame of 4000"),
        (
            {"quick_window": 64},
            "quick_window is 64 with quick_stride 0 and bands 'adjacent', expected",
        ),
        (
            {"bands": "log", "edges": (15.0, 30.0), "quick_window": 5000, "quick_stride": 9},
            "window of 5000 samples is longer than a frame of 4000",
        ),
        (
            {"bands": "log", "edges": (15.0, 30.0), "quick_window": 200, "quick_stride": 9},
            r"edges are \(\), expected two or more, ascending",
        ),
        ({"window": 512}, "has 257 bins, expected a multiple of three"),
        ({"classes": ("impact", "ok")}, "expected 'ok' and others"),
        ({"classes": ("ok", "ok")}, "expected 'ok' and others"),
        ({"classes": "ok"}, "classes is 'ok', expected a tuple of str"),
        ({"bands": "log"}, r"edges are \(\), expected two or more, ascending"),
        ({"bands": "log", "edges": (10.0, 6000.0)}, "to 6000 Hz, expected 0 to half the rate"),
        ({"bands": "log", "edges": (-1.0, 100.0)}, "from -1 to 100 Hz, expected 0 to half the"),
    ],
)
def test_settings_that_cannot_be_are_refused(change, text):
    with pytest.raises(models.ProfileError, match=text):
        replace(models.Profile.paper(), **change)


def test_settings_that_are_unknown_or_missing_are_named():
    settings = models.Profile.paper().as_dict()
    with pytest.raises(models.ProfileError, match="setting 'colour' is unknown"):
        models.Profile.of(settings | {"colour": "red"})
    del settings["hop"]
    with pytest.raises(models.ProfileError, match="setting 'hop' is missing"):
        models.Profile.of(settings)
