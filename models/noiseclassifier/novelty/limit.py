"""The limit: how far a frame may lie from good motion so that false alarms keep to a budget.

Conventions: an *alarm* is a stretch of frames beyond the limit that overlap or touch, as everywhere
in this package. Alarms are rare and good motion is short, so that the limit often lies beyond all
distances of the training set: the tail of the distances is then assumed exponential. From a level
that few alarms exceed, by `mean` on average, alarms become e times rarer with each further `mean`
(peaks over a threshold; J. Pickands, *Statistical Inference Using Extreme Order Statistics*, 1975,
with the shape 0).
"""

from dataclasses import dataclass

import numpy as np

from noiseclassifier.novelty.frames import GoodMotion
from noiseclassifier.types import Array

HOUR = 3600.0
TAIL = 0.1
"""Share of the frames that is a tail at most."""
PEAKS = 30
"""Alarms by which an exponential tail is fitted at most."""
LEVELS = 200
"""Levels at which alarms are counted, at most."""
LEAST = 0.1
"""Least limit, in deviations: copies of one run have distances near 0."""
RULE_OF_THREE = 3.0
"""Upper bound of the mean number of alarms where there was none (Poisson, 95 %)."""


@dataclass(frozen=True)
class Limit:
    """The limit, and what it follows from.

    Attributes:
        distance: The limit, in ``unit``.
        budget: False-alarm budget, per hour of good motion.
        hours: Good motion that there was, in [h].
        alarms: Alarms at the limit in that, by cross-validation.
        level: The level beyond which the tail is assumed exponential, in ``unit``.
        peaks: Alarms at that level.
        unit: What distances are in: deviations, or log odds.
    """

    distance: float
    budget: float
    hours: float
    alarms: int
    level: float
    peaks: int
    unit: str = "deviations"

    @property
    def shown(self) -> float:
        """Least bound on false alarms per hour that so much good motion can show."""
        return RULE_OF_THREE / self.hours

    @property
    def extrapolated(self) -> bool:
        """Whether there was too little good motion to check the budget."""
        return self.shown > self.budget

    def __str__(self) -> str:
        lines = [
            f"limit {self.distance:.2f} {self.unit}, for {self.budget:g} false alarms per hour;"
            f" {self.alarms} in {self.hours:.3g} h, each part classified without learning from it"
        ]
        if self.extrapolated:
            lines.append(
                f"{self.hours:.3g} h of good motion can show no fewer than {self.shown:.3g} alarms"
                f" per hour: the limit is extrapolated from {self.peaks} alarms beyond"
                f" {self.level:.2f} {self.unit}, assuming an exponential tail"
            )
        return "\n".join(lines)


def limit(
    distance: Array,
    good: GoodMotion,
    budget: float,
    *,
    least: float = LEAST,
    fitted: int = PEAKS,
    expected: float | None = None,
    unit: str = "deviations",
) -> Limit:
    """Limit for a false-alarm budget.

    Args:
        distance: Of each frame from good motion, by a model that was trained without it, shape
            (frames,), in ``unit``.
        good: The frames.
        budget: False alarms in an hour.
        least: Least limit, in ``unit``.
        fitted: Alarms by which the tail is fitted at most.
        expected: Mean by which alarms of other robots exceed such a level, in ``unit``, as much
            evidence as ``PEAKS`` alarms; None if it is not known.
        unit: What distances are in.
    """
    hours = good.seconds / HOUR
    allowed = max(fitted, int(budget * hours))
    level = counted(distance, good, allowed)
    peaks = alarm_peaks(distance, good, level)
    # N(t) = N(u) exp(-(t - u) / mean) = budget hours
    prior = 0 if expected is None else PEAKS  # mean of the posterior, of a gamma prior of 1 / mean
    excess = float((peaks - level).sum()) + prior * (expected or 0.0)
    mean = excess / max(len(peaks) + prior, 1)
    found = level + mean * np.log(max(len(peaks) / (budget * hours), 1.0))
    found = max(float(found), least)
    alarms = len(alarm_peaks(distance, good, found))
    return Limit(found, budget, hours, alarms, level, len(peaks), unit)


def alarm_peaks(distance: Array, good: GoodMotion, level: float) -> Array:
    """Largest distance in each alarm at a level.

    Args:
        distance: Of each frame, shape (frames,).
        good: The frames.
        level: What frames have to exceed.

    Returns:
        Shape (alarms,).
    """
    own = np.flatnonzero(distance > level)
    if not len(own):
        return np.zeros(0)
    before, after = own[:-1], own[1:]
    slack = 1e-6 * (good.stop[0] - good.start[0])
    apart = good.start[after] > good.stop[before] + slack
    first = np.append(0, np.flatnonzero(apart | (good.runs[after] != good.runs[before])) + 1)
    peaks: Array = np.maximum.reduceat(distance[own], first)
    return peaks


def counted(distance: Array, good: GoodMotion, allowed: int) -> float:
    """Lowest level in the tail above which there are never more alarms than allowed.

    Args:
        distance: Of each frame, shape (frames,).
        good: The frames.
        allowed: How many alarms.
    """
    falling = np.sort(distance)[::-1]
    last = max(round(TAIL * len(falling)), 1)
    ranks = np.unique(np.geomspace(1, last, LEVELS).round().astype(np.intp)) - 1
    levels = falling[ranks]
    counts = [len(alarm_peaks(distance, good, float(level))) for level in levels]
    affordable = np.maximum.accumulate(counts) <= allowed
    return float(levels[affordable][-1])
