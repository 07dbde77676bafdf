from dataclasses import replace
from math import comb

import numpy as np
import pytest
from scipy import stats

from inspector.regression.statistic import (
    ALPHA,
    Sample,
    _rank_sums,
    _signed_ranks,
    attainable,
    p_values,
    shift,
)

SIDES = "reference", "candidate"


def sample(reference, candidate, paired=False):
    """A sample of quantities whose changes below 1 do not matter."""
    return Sample(
        np.array(reference), np.array(candidate), np.ones(len(reference[0])), paired=paired
    )


def drawn(seed, count=5, quantities=20, rise=0.0):
    """Repetitions with heavy tails, the first quantity of the candidate higher by a rise."""
    random = np.random.default_rng(seed)
    sides = random.standard_t(2, (2, count, quantities))
    sides[1, :, 0] += rise
    return sample(*sides)


def test_the_least_p_is_the_share_of_one_exchange():
    (found,), _ = p_values([drawn(0, rise=1000.0)])
    assert found.louder[0] == pytest.approx(1 / comb(10, 5))
    assert found.quieter[0] == 1.0


def test_p_of_a_single_quantity_is_that_of_the_permutation_test():
    sides = np.random.default_rng(3).normal(size=(2, 5, 1))
    (found,), _ = p_values([replace(sample(*sides), scale=np.zeros(1))])

    def difference(x, y, axis):
        return np.mean(x, axis=axis) - np.mean(y, axis=axis)

    known = stats.permutation_test(
        (sides[1], sides[0]), difference, alternative="greater", n_resamples=np.inf
    )
    assert found.louder[0] == pytest.approx(known.pvalue[0])


@pytest.mark.parametrize("count", [5, 9])
def test_without_a_change_few_samples_are_called_louder(count):
    called = [(p_values([drawn(seed, count)])[0][0].louder <= ALPHA).any() for seed in range(100)]
    assert np.mean(called) <= 0.03  # 3 or less of 100, expected 0.5


def test_many_quantities_of_another_family_mask_no_change():
    spread = 0.1 * np.arange(5.0)[:, None]
    few, many = sample(spread, 2.0 + spread), drawn(1, quantities=300)
    sides = (np.hstack((getattr(few, side), getattr(many, side))) for side in SIDES)
    both = sample(*sides)
    (alone,), _ = p_values([few])
    (masked,), _ = p_values([both])
    (apart,), _ = p_values([replace(both, family=(0,) + (1,) * 300)])
    assert masked.louder[0] > ALPHA
    assert apart.louder[0] == alone.louder[0] <= ALPHA
    assert apart.quieter[0] == alone.quieter[0]


def test_each_family_has_a_level_of_its_own():
    families = (0,) * 10 + (1,) * 10
    called = [
        [(found.louder[place] <= ALPHA).any() for place in (slice(10), slice(10, None))]
        for seed in range(200)
        for (found,) in [p_values([replace(drawn(seed), family=families)])[0]]
    ]
    assert (np.mean(called, axis=0) <= 0.02).all()  # 4 or less of 200, expected 0.8


def test_exchanged_sides_have_exchanged_p():
    one = drawn(1, rise=4.0)
    other = replace(one, reference=one.candidate, candidate=one.reference)
    (found,), _ = p_values([one])
    (swapped,), _ = p_values([other])
    np.testing.assert_allclose(found.louder, swapped.quieter)


def test_identical_repetitions_have_p_one_and_no_change():
    values = np.ones((5, 3))
    (found,), _ = p_values([sample(values, values)])
    assert (found.louder == 1.0).all()
    assert (shift(sample(values, values)).change == 0.0).all()


def test_scenarios_together_show_what_none_of_them_can():
    samples = [replace(drawn(seed, count=3, rise=30.0), shared=(0, 1)) for seed in range(4)]
    each, together = p_values(samples)
    assert not any(attainable(one) for one in samples)
    assert min(found.louder.min() for found in each) > ALPHA
    assert together.louder[0] <= ALPHA


def test_pairs_cancel_what_differs_between_repetitions():
    random = np.random.default_rng(0)
    before = random.normal(size=(8, 1)) * 20
    after = before + 3.0 + 0.1 * random.normal(size=(8, 1))
    (found,), _ = p_values([sample(before, after, paired=True)])
    (apart,), _ = p_values([sample(before, after)])
    assert found.louder[0] == pytest.approx(1 / 2**8)
    assert apart.louder[0] > 0.1


def test_five_and_five_repetitions_are_enough_and_four_are_not():
    assert attainable(drawn(0, count=5))
    assert not attainable(drawn(0, count=4))


def test_interval_has_the_confidence_of_mann_and_whitney():
    moved = shift(drawn(0))
    below = 12  # orders of 5 and 5 in which at most 4 of the 25 differences are negative
    assert moved.confidence == pytest.approx(1 - 2 * below / comb(10, 5))


def test_interval_covers_the_true_change_as_often_as_it_says():
    covered = []
    for seed in range(300):
        moved = shift(drawn(seed, quantities=1, rise=2.0))
        covered.append(moved.low[0] <= 2.0 <= moved.high[0])
    assert np.mean(covered) == pytest.approx(moved.confidence, abs=0.05)


def test_three_and_three_repetitions_have_an_interval_of_ninety_percent():
    assert shift(drawn(0, count=3)).confidence == 0.9


def test_one_and_one_repetitions_have_no_interval():
    moved = shift(sample([[1.0]], [[3.0]]))
    assert moved.change[0] == 2.0
    assert np.isnan(moved.low[0])
    assert moved.confidence == 0.0


def test_orders_are_counted_as_mann_and_whitney_and_wilcoxon_do():
    assert _rank_sums(2, 2) == (1, 1, 2, 1, 1)
    assert sum(_rank_sums(5, 7)) == comb(12, 5)
    assert _signed_ranks(3) == (1, 1, 1, 2, 1, 1, 1)
