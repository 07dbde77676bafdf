"""Confidence intervals of measures, by bootstrap over groups of recordings.

Frames of a recording and recordings of a group (`splitting.group_of`) resemble each other, so that
only groups are drawn: of 2000 sets of as many groups, drawn with replacement, the bounds hold the
middle 95 % (percentile bootstrap). With few errors the sets hardly differ, and bounds that follow
from counting take over:

- *shares*: n recordings without an error are consistent with a share of 0.025^(1/n), so that no
  interval ends closer to 1, nor closer to 0 than 1 - 0.025^(1/n) (Clopper and Pearson, 1934);
- *events in a time*: the exact bounds of Garwood (1936), if they are wider; for 0 events the upper
  one is 3.7 over the time, and 3.0 with 95 % on this one side (the "rule of three").

A mean over robots weighs each alike, whatever time or runs it has; that of rates has the bounds of
Fay and Feuer (Confidence intervals for directly standardized rates, Statistics in Medicine 16,
1997), if they are wider.

With fewer than five groups, shares have no interval.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan, nan
from typing import Self

import numpy as np

from noiseclassifier.confusion import ratio
from noiseclassifier.types import Array, Index, Mask

RESAMPLES = 2000
SEED = 0
TAIL = 0.025
"""Probability beyond each bound."""
LEAST_GROUPS = 5


@dataclass(frozen=True)
class Estimate:
    """A measure, its bounds, and the size of its sample; NaN where undefined."""

    value: float
    """The measure."""
    low: float
    """Lower bound with 95 %."""
    high: float
    """Upper bound with 95 %."""
    runs: int
    """Recordings in the sample."""
    groups: int
    """Groups of recordings that share their motion, in the sample."""

    def as_dict(self) -> dict[str, float | int | None]:
        """All fields for JSON, None where undefined."""
        bounds = {"value": self.value, "low": self.low, "high": self.high}
        plain = {name: None if isnan(each) else float(each) for name, each in bounds.items()}
        return {**plain, "runs": self.runs, "groups": self.groups}


@dataclass(frozen=True, eq=False)
class Resampling:
    """Sets of groups, drawn once for all measures.

    Attributes:
        group: Group of each recording, as a number, shape (runs,).
        weights: How often each set has each recording, shape (resamples, runs).
    """

    group: Index
    weights: Array

    @classmethod
    def of(cls, groups: Sequence[str]) -> Self:
        """Draw the sets."""
        names, group = np.unique(np.asarray(groups, dtype=str), return_inverse=True)
        random = np.random.default_rng(SEED)
        drawn = random.multinomial(len(names), np.full(len(names), 1 / len(names)), RESAMPLES)
        return cls(group, drawn[:, group].astype(np.float64))

    def share(self, part: Array, whole: Array) -> Estimate:
        """Estimate a share."""
        drawn = ratio(self.weights @ part, self.weights @ whole)
        return self.bounded(float(ratio(part.sum(), whole.sum())), drawn, [whole > 0])

    def rate(self, events: Array, time: Array) -> Estimate:
        """Estimate the rate of events."""
        value = float(ratio(events.sum(), time.sum()))
        runs, groups = self._behind(time > 0)
        low, high = garwood(float(events.sum()))
        low, high = (float(ratio(bound, time.sum())) for bound in (low, high))
        if groups >= LEAST_GROUPS:
            drawn = _middle(ratio(self.weights @ events, self.weights @ time))
            low, high = min(low, drawn[0]), max(high, drawn[1])
        return Estimate(value, low, high, runs, groups)

    def mean_share(self, part: Array, whole: Array, of: Sequence[Mask]) -> Estimate:
        """Estimate the unweighted mean of the shares of several sets of recordings."""
        behind = [own & (whole > 0) for own in of if (whole * own).sum() > 0]
        if not behind:
            return Estimate(nan, nan, nan, 0, 0)
        value, drawn = self._mean(part, whole, behind)
        return self.bounded(value, drawn, behind)

    def mean_rate(self, events: Array, time: Array, of: Sequence[Mask]) -> Estimate:
        """Estimate the unweighted mean of the rates of several sets of recordings."""
        behind = [own & (time > 0) for own in of if (time * own).sum() > 0]
        if not behind:
            return Estimate(nan, nan, nan, 0, 0)
        value, drawn = self._mean(events, time, behind)
        weights = np.array([1.0 / (len(behind) * time[own].sum()) for own in behind])
        low, high = fay_feuer(np.array([events[own].sum() for own in behind]), weights)
        runs, groups = self._behind(np.any(behind, axis=0))
        if groups >= LEAST_GROUPS:
            middle = _middle(drawn)
            low, high = min(low, middle[0]), max(high, middle[1])
        return Estimate(value, low, high, runs, groups)

    def _mean(self, part: Array, whole: Array, of: Sequence[Mask]) -> tuple[float, Array]:
        """Mean ratio of sets of recordings, and that of each resample, shape (resamples,)."""
        value = np.mean([part[own].sum() / whole[own].sum() for own in of])
        shares = [ratio(self.weights @ (part * own), self.weights @ (whole * own)) for own in of]
        each = np.array(shares)
        known = ~np.isnan(each)
        return float(value), ratio(np.where(known, each, 0.0).sum(axis=0), known.sum(axis=0))

    def bounded(self, value: float, drawn: Array, behind: Sequence[Mask]) -> Estimate:
        """Bounds of a mean of shares of runs, computed for all sets, shape (resamples,)."""
        runs = int(np.any(behind, axis=0).sum())
        groups = min(self._behind(mask)[1] for mask in behind)
        if groups < LEAST_GROUPS:
            return Estimate(value, nan, nan, runs, groups)
        # The mean of the shares' own bounds lies further out than the bound of their mean.
        room = float(np.mean([TAIL ** (1.0 / mask.sum()) for mask in behind]))
        low, high = _middle(drawn)
        return Estimate(value, min(low, room), max(high, 1.0 - room), runs, groups)

    def plain(self, value: float, drawn: Array, behind: Mask) -> Estimate:
        """Bounds of any other measure computed for all sets, shape (resamples,), of some runs."""
        runs, groups = self._behind(behind)
        low, high = _middle(drawn) if groups >= LEAST_GROUPS else (nan, nan)
        return Estimate(value, low, high, runs, groups)

    def quantile(self, values: Array, owner: Index, share: float) -> Estimate:
        """Estimate a quantile of values, shape (values,), that belong to recordings."""
        ascending = np.argsort(values, kind="stable")
        values, owner = values[ascending], owner[ascending]
        behind = np.bincount(owner, minlength=self.weights.shape[1]) > 0

        def of_sets(weights: Array) -> Array:
            total = np.cumsum(weights[:, owner], axis=1)
            if not len(values):
                return np.full(len(weights), np.nan)
            place = (total < share * total[:, -1:]).sum(axis=1)
            return np.where(total[:, -1] > 0, values[np.minimum(place, len(values) - 1)], np.nan)

        once = np.ones((1, len(behind)))
        return self.plain(float(of_sets(once)[0]), of_sets(self.weights), behind)

    def _behind(self, mask: Mask) -> tuple[int, int]:
        return int(mask.sum()), len(np.unique(self.group[mask]))


def garwood(events: float) -> tuple[float, float]:
    """Exact bounds of the mean of a Poisson distribution."""
    from scipy.special import gammaincinv

    # F. Garwood, Fiducial limits for the Poisson distribution, Biometrika 28 (1936)
    low = float(gammaincinv(events, TAIL)) if events else 0.0
    return low, float(gammaincinv(events + 1.0, 1.0 - TAIL))


def fay_feuer(events: Array, weights: Array) -> tuple[float, float]:
    """Bounds of a weighted sum of the means of Poisson distributions."""
    from scipy.special import gammaincinv

    total, variance, most = weights @ events, weights**2 @ events, weights.max()
    low = variance / total * gammaincinv(total**2 / variance, TAIL) if total else 0.0
    total, variance = total + most, variance + most**2
    high = variance / total * gammaincinv(total**2 / variance, 1.0 - TAIL)
    return float(low), float(high)


def _middle(drawn: Array) -> tuple[float, float]:
    known = drawn[~np.isnan(drawn)]
    if not len(known):
        return nan, nan
    low, high = np.quantile(known, (TAIL, 1.0 - TAIL)).tolist()
    return low, high
