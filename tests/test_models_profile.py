import json
import re
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from addedfaults import with_fault

import noiseclassifier as nc
from noiseclassifier.profile import HIGHEST, INPUTS, LOWEST, columns
from noiseclassifier.signals import JOINTS, MOTION

GENERAL = Path(__file__).parents[1] / "models" / "general.npz"
FAST = nc.LogBands(quick=0.02, speed=True)
LOG = {"bands": "log", "edges": (15.0, 30.0), "reference": True}
AT_THE_END = "effort_joints at the end a reference"
QUICK = {"quick_window": 200, "quick_stride": 9, "quick_edges": (75.0, 150.0)}


@pytest.mark.parametrize("recipe", [nc.Profile.noisytest, nc.Profile.paper])
@pytest.mark.parametrize(("kernel", "transforms"), [("rbf", 4), ("linear", 8)])
def test_hyper_parameters_are_of_the_papers_table(recipe, kernel, transforms):
    profile = recipe(kernel)
    assert profile.transforms == transforms
    assert profile.regularization == {"rbf": 1.1, "linear": 1.0}[kernel]
    assert profile.gamma == 5.7e-4
    assert profile.duration == 0.4


def test_noisytest_differs_from_the_paper_by_named_settings():
    ours, theirs = nc.Profile.noisytest().as_dict(), nc.Profile.paper().as_dict()
    assert {name for name in ours if ours[name] != theirs[name]} == {"bands", "multiclass"}


@pytest.mark.parametrize("profile", [nc.Profile.noisytest("linear"), nc.LogBands().at(1234.5)])
def test_a_profile_is_equal_after_json(profile):
    assert nc.Profile.of(json.loads(json.dumps(profile.as_dict()))) == profile


@pytest.mark.parametrize("rate", [250.0, 333.0, 1000.0, 10_000.0, 48_000.0])
def test_band_edges_do_not_depend_on_the_rate(rate):
    profile = nc.LogBands().at(rate)
    lengths = (profile.length, profile.hop, profile.window, profile.stride)
    assert lengths == pytest.approx([part * rate for part in (0.4, 0.1, 0.1, 0.025)], abs=0.75)
    assert profile.window >= 0.1 * rate
    low, high = profile.edges, nc.LogBands().at(96_000.0).edges
    assert low == high[: len(low)]
    assert low[-1] <= rate / 2
    assert len(low) == len(high) or high[len(low)] > rate / 2
    assert np.diff(low).min() >= 10.0 - 1e-9


def test_quick_bands_begin_with_the_speed_and_drop_out_where_it_does_not_fit():
    edges = FAST.at(1000.0).quick_edges
    assert edges == pytest.approx((0.0, 75.0, 75.0 * 2 ** (4 / 3), 75.0 * 2 ** (8 / 3)))
    assert edges == FAST.at(10_000.0).quick_edges[:4]
    assert (FAST.at(1000.0).quick_window, FAST.at(1000.0).quick_stride) == (20, 10)
    assert FAST.at(140.0).quick_window == 0
    plain = replace(FAST, speed=False)
    assert plain.at(1000.0).quick_edges == edges[1:]
    assert FAST.at(150.0).quick_edges == (0.0, 75.0)  # a band and a half fit, and no less
    assert FAST.at(149.9).quick_edges == plain.at(150.0).quick_edges == ()


def test_the_model_that_ships_has_the_settings_of_the_code():
    with np.load(GENERAL, allow_pickle=False) as members:
        manifest = json.loads(str(members["manifest"]))
    model = nc.load(GENERAL)
    assert model.recipe == nc.ANY
    assert model.estimator.alarm == nc.ANY.alarm
    assert manifest["classes"] == list(nc.ANY.classes)
    # As docs/classifier.md has it: 300 rounds against `ok`, a third of them for each failure.
    with np.load(GENERAL, allow_pickle=False) as members:
        leaves = members["leaf"].reshape(nc.ANY.rounds, len(nc.CLASSES), -1)
    grown = leaves.any(axis=2)
    assert grown[:, 0].all()
    assert grown[:100, 1:].all()
    assert not grown[100:, 1:].any()


def test_the_kernel_parameter_goes_with_the_number_of_features():
    for rate in (250.0, 1000.0):
        profile = nc.LogBands().at(rate)
        count = nc.features(np.zeros((1, profile.length)), profile).shape[1]
        assert profile.gamma * count == pytest.approx(0.5)


def test_features_that_rise_with_a_fault_never_fall_as_it_gets_louder():
    profile = nc.ANY.at(1000.0, (*MOTION, *JOINTS))
    time = np.arange(profile.length) / profile.rate
    joints = np.stack([0.5 * np.cos(2 * np.pi * f * time) for f in (0.3, 0.7)])
    measured = joints + 1e-3 * np.random.default_rng(0).normal(size=joints.shape)
    rows = dict(zip(JOINTS, (joints, measured, joints - measured), strict=True))
    signals = {name: np.linalg.norm(rows[f"{name}_joints"], axis=0) for name in MOTION} | rows
    found = []
    for level in (1.0, 4.0):
        louder = with_fault(signals, 1, level * np.sin(2 * np.pi * 140.0 * time))
        frame = np.vstack([louder[name] for name in profile.signals])
        found.append(nc.features(frame[None], profile)[0])
    change = found[1] - found[0]
    rising = nc.ANY.rising[nc.ANY.places(profile)].astype(bool)
    names = np.array(columns(profile))
    assert change[rising].min() > -1e-3
    # All others are free: desired motion, the speed itself, and differences that may fall.
    fixed = re.compile(r"(relative )?(desired|error less|error_joints less)|.* 0$")
    assert [bool(fixed.match(name)) for name in names] == (~rising).tolist()


def test_a_rate_that_leaves_no_bands_is_refused():
    for lowest, rate, bands, least in (
        (15.0, 50.0, 1, 70),
        (15.0, 69.9, 1, 70),
        (20.0, 79.0, 1, 80),
        (50.0, 80.0, 0, 143),  # bands of a quarter of an octave are wider than 10 Hz there
    ):
        text = (
            f"a rate of {rate:g} Hz leaves {bands} bands up to {rate / 2:g} Hz, expected 2 or more:"
            f" take a rate of {least} Hz at least"
        )
        recipe = replace(nc.LogBands(), lowest=lowest)
        with pytest.raises(nc.ProfileError, match=f"^{re.escape(text)}$"):
            recipe.at(rate)
        assert len(recipe.at(float(least)).edges) == 3
        with pytest.raises(nc.ProfileError):
            recipe.at(least - 1.0)


def test_a_recipe_is_tried_at_the_lowest_and_at_the_highest_rate():
    assert (LOWEST, HIGHEST) == (80.0, 10_000.0)  # as docs/classifier.md promises
    recipe = nc.ANY.at(LOWEST, INPUTS[0])
    assert recipe.edges[-1] <= LOWEST / 2
    assert nc.ANY.at(HIGHEST, INPUTS[0]).edges[-1] <= 5000.0
    assert nc.LogBands.of(asdict(nc.ANY) | {"highest": HIGHEST}).highest == HIGHEST


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"length": 0}, "length is 0, expected more than 0"),
        ({"length": 4000.0}, "length is 4000.0, expected a value of type int"),
        ({"hop": True}, "hop is True, expected a value of type int"),
        ({"gamma": float("nan")}, "gamma is nan, expected a finite number"),
        ({"leaves": 17}, "leaves is 17, expected 2 to 16"),
        ({"leaves": 1}, "leaves is 1, expected 2 to 16"),
        ({"alarm": 1.0}, "alarm is 1.0, expected a probability below 1"),
        ({"kernel": "poly"}, "kernel is 'poly', expected one of linear, rbf"),
        ({"window": 4096}, "window of 4096 samples is longer than a frame of 4000"),
        ({"window": 512}, "has 257 bins, expected a multiple of three"),
        ({"classes": ("impact", "ok")}, "expected 'ok' and others"),
        ({"classes": ("ok", "ok")}, "expected 'ok' and others"),
        ({"classes": "ok"}, "classes is 'ok', expected a tuple of str"),
        *(
            (
                {"bands": "log", "edges": each},
                rf"edges are {re.escape(str(each))}, expected two or more, ascending",
            )
            for each in ((), (10.0, float("nan")), (-1.0, 100.0), (9.0, 9.0))
        ),
        (
            {"bands": "log", "edges": (10.0, 6000.0)},
            r"\(10.0, 6000.0\), expected two or more, ascending, from 0 to half the rate, 5000 Hz",
        ),
        ({"bands": "log", "edges": (1, 2)}, r"edges is \(1, 2\), expected a tuple of float"),
        (
            {**LOG, **QUICK, "quick_window": 5000},
            "window of 5000 samples is longer than a frame of 4000",
        ),
        ({"quick_window": -1}, "quick_window is -1, expected 0 or more"),
        (
            {"signals": ()},
            "none, expected norms, and after them those that go joint by joint, each once$",
        ),
        (
            {"signals": ("measured_joints", "measured"), **LOG},
            "are measured_joints, measured, expected norms, and after them those that go joint by",
        ),
        *(
            (
                {"signals": tuple(names.split()), "bands": bands, "edges": (15.0, 30.0)}
                | {"relative": relative, "reference": reference},
                f"{names.split()[-1]} with bands '{bands}', relative {relative} and reference"
                f" {reference}: .*{wanted}",
            )
            for names, bands, relative, reference, wanted in (
                ("measured measured_joints", "log", False, False, "joint by joint takes 'log' a"),
                ("measured measured_joints", "adjacent", True, False, "joint by"),
                ("measured effort_joints measured_joints", "log", False, True, AT_THE_END),
                ("measured effort_joints", "log", True, False, AT_THE_END),
                ("noise", "adjacent", False, True, "relative False$"),
                ("noise", "log", True, True, "a reference 'log' and relative"),
            )
        ),
        ({"classes": ("ok",)}, "classes are ok, expected 'ok' and others, each once"),
        ({**LOG, **QUICK, "quick_stride": 0}, "with quick_stride 0 and bands 'log', expected a st"),
        ({**QUICK}, "quick_window is 200 with quick_stride 9 and bands 'adjacent', expected a str"),
    ],
)
def test_settings_that_cannot_be_are_refused(change, text):
    with pytest.raises(nc.ProfileError, match=text):
        replace(nc.Profile.paper(), **change)


def test_settings_that_are_unknown_or_missing_are_named():
    settings = nc.Profile.paper().as_dict()
    with pytest.raises(nc.ProfileError, match="setting 'colour' is unknown"):
        nc.Profile.of(settings | {"colour": "red"})
    del settings["hop"]
    with pytest.raises(nc.ProfileError, match="setting 'hop' is missing"):
        nc.Profile.of(settings)
