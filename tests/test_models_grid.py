from dataclasses import fields, replace

import pytest

import noiseclassifier as nc
from noiseclassifier.tuning import MOST, SETTINGS, Grid

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


def test_the_papers_grid_of_the_linear_kernel_has_no_gamma():
    grid = Grid.of(["paper"], "linear")
    assert (len(grid), list(grid.axes)) == (1620, ["stride", "regularization"])


def test_whatever_can_be_tuned_is_a_setting_of_a_profile():
    assert set(SETTINGS) <= {field.name for field in fields(nc.Profile)}


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


def test_a_later_text_replaces_the_values_of_an_earlier_one():
    grid = Grid.of(["paper", "C=1"])
    assert len(grid) == 81 * 15
    assert grid.axes["regularization"] == (1.0,)


def test_a_point_is_the_profile_with_its_values():
    profiles = Grid.of(["stride=401,834", "C=1,2"]).profiles(RBF)
    assert profiles[2] == replace(RBF, stride=834, regularization=1.0)


@pytest.mark.parametrize(
    ("texts", "reason"),
    [
        ([], "grid of 0 points, expected 1 to 1000000"),
        (["C="], "no value for regularization"),
        (["C=2.5:0.5:0.1"], "no value for regularization, expected one or more"),
        (["C=1,1.0"], "a value twice for regularization"),
        (["C"], "grid 'C', expected paper or NAME=VALUES"),
        (["hop=1"], "no setting 'hop' to tune; there are window, stride"),
        (["degree=1"], "no setting 'degree' to tune"),
        (["C=0:1"], "regularization is '0:1', expected first:last:step"),
        (["C=0:1:0"], "expected a step above 0"),
        (["C=0:1:x10"], "from a value above 0 by a factor above 1"),
        (["C=1:10:x1"], "from a value above 0 by a factor above 1"),
        (["C=a"], "regularization is 'a', expected a finite number"),
        (["C=inf"], "regularization is 'inf', expected a finite number"),
        (["stride=224.5"], "stride is 224.5, expected whole samples"),
        (["C=0:1e9:1"], "grid of 1000000001 values of regularization, expected 1 to"),
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
        ("leaves=8", RBF, "leaves does nothing with support vector machines; leave it out"),
        ("C=1", replace(RBF, estimator="trees"), "regularization does nothing with trees"),
        ("C=0", RBF, "regularization is 0.0, expected more than 0"),
        ("bands=comb,third", RBF, "bands is 'third', expected one of adjacent, comb, log"),
        ("window=512", RBF, "expected a multiple of three"),
    ],
)
def test_a_grid_that_makes_no_sense_with_a_profile_is_refused(text, profile, reason):
    with pytest.raises(nc.ModelsError, match=reason):
        Grid.of([text]).profiles(profile)
