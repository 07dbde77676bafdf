import numpy as np
import pytest

import noiseclassifier as nc
from noiseclassifier.recording import check_apart, folds, group_of, held_out, robot_of, seen

RUNS = [
    f"{robot}/{scenario}-{seed:03d}"
    for robot in ("go2", "panda", "talos")
    for seed in range(7)
    for scenario in ("straight", "obstacle-toe", "multisine-20-30")[: 2 + seed % 2]
]
GROUPS = [group_of(run) for run in RUNS]


def test_runs_of_one_robot_and_seed_are_one_group():
    assert group_of("talos/obstacle-toe-007") == group_of("talos/straight-007") == "talos-007"
    assert group_of("talos/multisine-20-30-012") == "talos-012"
    assert len({group_of(f"{robot}/straight-007") for robot in ("talos", "go2")}) == 2


@pytest.mark.parametrize("name", ["earlycontacttoe", "multisine60_100", "run-007", "a/b", ""])
def test_any_other_recording_is_a_group_of_its_own(name):
    assert group_of(name) == name
    assert robot_of(name) == ""


def test_no_group_is_on_both_sides_and_each_item_is_measured_once():
    split = folds(GROUPS, 4)
    measured = np.concatenate([test for _, test in split])
    assert sorted(measured.tolist()) == list(range(len(GROUPS)))
    for train, test in split:
        assert not {GROUPS[i] for i in train} & {GROUPS[i] for i in test}
        assert sorted([*train, *test]) == list(range(len(GROUPS)))


def test_folds_are_of_even_sizes_and_have_each_robot():
    for count in (2, 3, 5, 7):
        split = folds(GROUPS, count)
        sizes = [len(test) for _, test in split]
        assert max(sizes) - min(sizes) <= 4
        for _, test in split:
            assert {GROUPS[i].split("-")[0] for i in test} == {"go2", "panda", "talos"}


def test_folds_do_not_depend_on_the_order_of_the_items():
    shuffled = np.random.default_rng(3).permutation(len(GROUPS))

    def sides(order):
        return {
            frozenset(GROUPS[order[i]] for i in test)
            for _, test in folds([GROUPS[i] for i in order], 3)
        }

    assert sides(range(len(GROUPS))) == sides(shuffled)


def test_every_fold_has_something_to_measure_even_if_each_group_is_a_robots_only_one():
    split = folds(["a-1", "b-1", "c-1", "c-1"], 3)
    assert sorted(len(test) for _, test in split) == [1, 1, 2]


@pytest.mark.parametrize("count", [1, 0, 22])
def test_folds_that_cannot_be_are_refused(count):
    with pytest.raises(nc.DatasetError, match=f"{count} folds of 21 groups, expected two"):
        folds(GROUPS, count)


def test_the_test_set_is_fixed_by_names_alone():
    held = [seed for seed in range(20) if held_out(f"talos-{seed:03d}")]
    assert held == [4, 7, 9, 12, 15, 17]  # for good: results refer to it
    share = np.mean([held_out(f"robot-{seed}") for seed in range(10_000)])
    assert share == pytest.approx(0.25, abs=0.015)


TRAIN = {"talos/straight-001": "aa", "run7": "bb", "standin": ""}


def test_what_is_apart_passes_and_what_is_not_is_counted():
    names = {f"talos/curve-001-{copy}": "" for copy in range(3)} | {"other": "aa", "run8": "bb"}
    with pytest.raises(nc.DatasetError, match=r"\(and 1 more of 5\); measure it on other runs$"):
        check_apart(TRAIN, names)
    check_apart(TRAIN, {"talos/straight-002": "cc", "go2/straight-001": "dd", "run8": ""})
    check_apart(TRAIN, {"run7": "cc"})  # another file of that name
    assert seen(TRAIN, {"talos/straight-002": "cc"}) == {}


@pytest.mark.parametrize(
    ("test", "text"),
    [
        ({"renamed": "aa"}, "renamed: the model was trained on the same recording as 'talos/str"),
        ({"standin": "cc"}, "standin: the model was trained on a recording of this name"),
        ({"run7": ""}, "run7: the model was trained on a recording of this name"),
        (
            {"talos/curve-001": "cc"},
            "the model was trained on 'talos/straight-001', which shares its motion",
        ),
    ],
)
def test_a_run_a_group_or_a_content_on_both_sides_is_refused(test, text):
    with pytest.raises(nc.DatasetError, match=text) as caught:
        check_apart(TRAIN, {"fresh": "ee", **test})
    assert str(caught.value).endswith("; measure it on other runs")
    assert not any(each in str(caught.value) for each in ("\n", "more of"))
