"""A permutation test of many quantities over few repetitions, and intervals of their changes.

Repetitions are few (5 to 20), quantities many (joints, bands, links), and their distributions have
heavy tails. So nothing is assumed of these: under the hypothesis of no change, the sides of the
repetitions can be exchanged, and the statistic of the observed sides is compared with those of all
others (Fisher; Pitman). Of all quantities in all scenarios the largest statistic is taken in each
exchange, which holds the probability of any false alarm at the level of the test (single-step maxT,
P. Westfall and S. Young, *Resampling-Based Multiple Testing*, 1993). It is at least as sharp as
Holm's bound, and keeps the dependence of quantities. Of several families of quantities, such as the
few of all joints and the many of each joint, each has a largest statistic and a level of its own,
so that the many do not mask the few; their levels add up (Bonferroni). The statistic is the
difference of means by its standard error, plus a constant that keeps quantities of small spread
from ruling (V. Tusher, R. Tibshirani and G. Chu, PNAS 98, 2001). Drawn exchanges count the
observed one (B. Phipson and G. Smyth, SAGMB 9, 2010), so that p is never 0.

The estimate of a change is that of Hodges and Lehmann, its interval that of Moses: without
assumptions on the distribution, and exact (M. Hollander, D. Wolfe and E. Chicken, *Nonparametric
Statistical Methods*, 2014, ch. 3.2 f. and 4.2 f.).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, product
from math import comb, prod
from typing import Any

import numpy as np

from noiseclassifier.types import Index
from noisemodel.types import Array

ALPHA = 0.004
"""Probability that any quantity of a family in any scenario is called louder though nothing
changed; as much for quieter."""
CONFIDENCE = 0.9
"""Of intervals; two one-sided tests at 5 % each (D. Schuirmann, 1987)."""
EXCHANGES = 9999
"""Most exchanges of sides that are computed beside the observed one; more are drawn from."""
FEWEST_PAIRS = 8
"""Pairs from which on exchanges within pairs reach `ALPHA`: 2**8 > 1 / 0.004."""
SEED = 0
ROUNDING = 1e-9
"""By which share statistics of equal exchanges may differ."""


@dataclass(frozen=True, eq=False)
class Sample:
    """Quantities of the repetitions of one scenario.

    Attributes:
        reference: Shape (repetitions, quantities).
        candidate: Shape (repetitions, quantities).
        scale: What is added to each standard error, shape (quantities,): a difference that does
            not matter.
        family: Number of the family of each quantity, shape (quantities,); one unless given.
        shared: Indices of those quantities that scenarios have in common, in one order for all.
        paired: Whether the repetitions are pairs, row by row.
    """

    reference: Array
    candidate: Array
    scale: Array
    family: tuple[int, ...] = ()
    shared: tuple[int, ...] = ()
    paired: bool = False

    @property
    def families(self) -> Index:
        """The family of each quantity."""
        return np.array(self.family or np.zeros(len(self.scale)), dtype=np.intp)

    @property
    def within_pairs(self) -> bool:
        """Whether sides are exchanged within pairs only: where these are enough for the test."""
        return self.paired and len(self.reference) >= FEWEST_PAIRS

    @property
    def exchanges(self) -> int:
        """How many ways there are to assign sides."""
        ours, others = len(self.candidate), len(self.reference)
        return 2**ours if self.within_pairs else comb(ours + others, ours)


@dataclass(frozen=True, eq=False)
class PValues:
    """Adjusted p-values of the quantities of a scenario.

    Attributes:
        louder: That nothing changed, against a rise, shape (quantities,).
        quieter: Against a fall, shape (quantities,).
    """

    louder: Array
    quieter: Array


def p_values(samples: Sequence[Sample]) -> tuple[tuple[PValues, ...], PValues]:
    """Test all quantities of all scenarios at once.

    Args:
        samples: The scenarios; the shared quantities of all are the same.

    Returns:
        The p-values of each scenario, adjusted for all quantities of one family of all; and those
        of the shared quantities over all scenarios together, empty for a single one.
    """
    own: list[Array] = []
    families = [sample.families for sample in samples]
    known = sorted(set(np.concatenate(families).tolist()))
    extremes = _Extremes(dict.fromkeys(known, -np.inf), dict.fromkeys(known, np.inf))
    differences, variances = np.array(0.0), np.array(0.0)
    for sample, family, sides in zip(samples, families, _exchanged(samples), strict=True):
        difference, error = _statistics(sample, sides)
        statistic = difference / (error + sample.scale)
        own.append(statistic[0].copy())
        extremes.add(statistic, family)
        shared = list(sample.shared)
        differences = differences + difference[:, shared]
        variances = variances + error[:, shared] ** 2
    together, common = np.zeros(0), np.zeros(0, dtype=np.intp)
    if len(samples) > 1 and samples[0].shared:
        shared = list(samples[0].shared)
        scale, common = len(samples) * samples[0].scale[shared], families[0][shared]
        statistic = differences / (np.sqrt(variances) + scale)
        together = statistic[0].copy()
        extremes.add(statistic, common)
    return tuple(map(extremes.adjusted, own, families)), extremes.adjusted(together, common)


@dataclass(frozen=True, eq=False)
class _Extremes:
    """The largest and the least statistic of each family in each exchange, shape (exchanges,)."""

    highest: dict[int, Any]
    lowest: dict[int, Any]

    def add(self, statistic: Array, family: Index) -> None:
        """Take in statistics of shape (exchanges, quantities)."""
        for number in set(family.tolist()):
            mine = statistic[:, family == number]
            self.highest[number] = np.maximum(self.highest[number], mine.max(axis=1))
            self.lowest[number] = np.minimum(self.lowest[number], mine.min(axis=1))

    def adjusted(self, observed: Array, family: Index) -> PValues:
        """The p-values of observed statistics."""
        louder, quieter = np.ones(len(observed)), np.ones(len(observed))
        for number in set(family.tolist()):
            mine = family == number
            louder[mine] = _share(np.sort(self.highest[number]), observed[mine])
            quieter[mine] = _share(np.sort(-self.lowest[number]), -observed[mine])
        return PValues(louder, quieter)


def attainable(sample: Sample) -> bool:
    """Whether a scenario has enough repetitions for the test to find a change at all."""
    return sample.exchanges * ALPHA >= 1


@dataclass(frozen=True, eq=False)
class Shift:
    """By how much quantities changed.

    Attributes:
        change: Estimates, shape (quantities,).
        low: Lower ends of the intervals; NaN without.
        high: Upper ends of the intervals; NaN without.
        confidence: Of each interval: at least 0.9, or what so few repetitions allow.
    """

    change: Array
    low: Array
    high: Array
    confidence: float


def shift(sample: Sample) -> Shift:
    """Estimate by how much the quantities of a scenario changed.

    Args:
        sample: The scenario.

    Returns:
        Medians of all differences (of pairs: of the means of any two differences), and the
        intervals between two order statistics of these.
    """
    if sample.paired:
        own = sample.candidate - sample.reference
        first, second = np.triu_indices(len(own))
        differences, ways = (own[first] + own[second]) / 2, _signed_ranks(len(own))
    else:
        all_differences = sample.candidate[:, None] - sample.reference[None]
        differences = all_differences.reshape(-1, all_differences.shape[-1])
        ways = _rank_sums(len(sample.candidate), len(sample.reference))
    ordered = np.sort(differences, axis=0)
    # P(at most so many differences lie below the true one)
    below = np.cumsum(np.array(ways, dtype=np.float64)) / float(sum(ways))
    # The interval between the c-th smallest and the c-th largest has confidence 1 - 2 below[c - 1].
    enough = np.flatnonzero(1 - 2 * below >= CONFIDENCE)
    cut = int(enough[-1]) if len(enough) else 0
    confidence = float(1 - 2 * below[cut])
    low, high = (ordered[cut], ordered[-1 - cut])
    if confidence <= 0:
        low, high, confidence = np.full_like(low, np.nan), np.full_like(low, np.nan), 0.0
    return Shift(np.median(ordered, axis=0), low, high, confidence)


def _share(largest: Array, own: Array) -> Array:
    """Share of sorted values that are as large as others, or larger."""
    least = own - ROUNDING * np.maximum(1.0, np.abs(own))
    return np.asarray(1 - np.searchsorted(largest, least, side="left") / len(largest))


def _exchanged(samples: Sequence[Sample]) -> list[Array]:
    """Sides of the repetitions of each scenario, 1 for the candidate, the observed ones first.

    Returns:
        For each scenario shape (exchanges, repetitions), or (exchanges, pairs) with signs.
    """
    if prod(sample.exchanges for sample in samples) <= EXCHANGES + 1:
        each = [_all(sample) for sample in samples]
        rows = np.array(list(product(*(range(len(sides)) for sides in each))))
        return [sides[rows[:, place]] for place, sides in enumerate(each)]
    random = np.random.default_rng(SEED)
    return [_drawn(sample, random) for sample in samples]


def _all(sample: Sample) -> Array:
    if sample.within_pairs:
        return np.array(list(product((1.0, -1.0), repeat=len(sample.candidate))))
    ours, count = len(sample.candidate), len(sample.candidate) + len(sample.reference)
    sides = np.zeros((sample.exchanges, count))
    for row, chosen in enumerate(combinations(range(count), ours)):
        sides[row, list(chosen)] = 1.0  # candidates come first in `_statistics`
    return sides


def _drawn(sample: Sample, random: "np.random.Generator") -> Array:
    if sample.within_pairs:
        signs = random.choice((1.0, -1.0), size=(EXCHANGES + 1, len(sample.candidate)))
        signs[0] = 1.0
        return signs
    observed = np.repeat((1.0, 0.0), (len(sample.candidate), len(sample.reference)))
    sides = random.permuted(np.tile(observed, (EXCHANGES + 1, 1)), axis=1)
    sides[0] = observed
    return sides


def _statistics(sample: Sample, sides: Array) -> tuple[Array, Array]:
    """Differences of means and their standard errors, each of shape (exchanges, quantities)."""
    if sample.within_pairs:
        own = sample.candidate - sample.reference
        count = len(own)
        mean = sides @ own / count
        rest = np.maximum(np.sum(own**2, axis=0) - count * mean**2, 0.0)
        return mean, np.sqrt(rest / (count - 1) / count)
    every = np.concatenate((sample.candidate, sample.reference))
    every = every - every.mean(axis=0)  # for the sums of squares
    ours, others = len(sample.candidate), len(sample.reference)
    candidate = sides @ every / ours
    reference = -ours * candidate / others
    rest = np.sum(every**2, axis=0) - ours * candidate**2 - others * reference**2
    variance = np.maximum(rest, 0.0) / max(ours + others - 2, 1)
    return candidate - reference, np.sqrt(variance * (1 / ours + 1 / others))


@lru_cache
def _rank_sums(ours: int, others: int) -> tuple[int, ...]:
    """Number of orders of two samples by the count of differences below 0 (Mann and Whitney)."""
    ways = [[[1] for _ in range(others + 1)] for _ in range(ours + 1)]
    for i in range(1, ours + 1):
        for j in range(1, others + 1):
            # The largest is one of ours, above all j others; or one of the others.
            total = np.zeros(i * j + 1, dtype=object)
            total[j:] += np.array(ways[i - 1][j], dtype=object)
            total[: i * (j - 1) + 1] += np.array(ways[i][j - 1], dtype=object)
            ways[i][j] = total.tolist()
    return tuple(ways[ours][others])


@lru_cache
def _signed_ranks(pairs: int) -> tuple[int, ...]:
    """Number of signs of pairs by the sum of the ranks of the positive ones (Wilcoxon)."""
    ways = np.array([1], dtype=object)
    for rank in range(1, pairs + 1):
        longer = np.concatenate((ways, np.zeros(rank, dtype=object)))
        longer[rank:] += ways
        ways = longer
    return tuple(ways.tolist())
