"""Adaptation of a general model to a robot, by good runs of it alone.

Classes and trees stay. Features become relative to the good motion, in place of the signal itself,
unless that has the lower limit: of runs that differ widely, none is a reference for the others.
The logit of `ok` is shifted, which changes the odds of all failures alike, as another prior would
(M. Saerens et al., *Adjusting the Outputs of a Classifier to New a Priori Probabilities*, 2002):
at the alarm threshold, alarms in the good motion keep to a budget. The bounds beyond which a frame
is out of distribution are raised above the good motion. Half of the budget is for failures, half
for `unknown`. Neither limit is so low that more alarms than that were counted.

A finding takes two frames of evidence (`labels`). What counts of a frame is therefore the
lower one of its own score and of the higher one of its neighbours'.
"""

from dataclasses import asdict, replace
from math import inf, log

import numpy as np

from noiseclassifier.classifier import Classifier
from noiseclassifier.errors import ProfileError
from noiseclassifier.estimators.probabilistic import NOVELTY_LIMIT
from noiseclassifier.estimators.trees import TAIL, Trees
from noiseclassifier.general import UNBOUNDED
from noiseclassifier.novelty.frames import GoodMotion, parts
from noiseclassifier.novelty.limit import HOUR, Limit, alarm_peaks, counted, limit
from noiseclassifier.novelty.training import Learnt, check
from noiseclassifier.reference import Reference
from noiseclassifier.types import Array, Index, Mask

LEAST = 30.0
"""Least good motion, in [s]."""
LEAST_PROBABILITY = 0.05
"""Least probability of a failure at the limit: a robot that stands has far lower ones."""
MARGIN = 1e-3
"""Log odds by which the limit lies above scores that equal it: scores of trees have a highest one,
which much of a motion may have, and a probability at the alarm threshold is above it."""
EXCESS = 0.4
"""Mean by which alarms in the good motion of a robot exceed a level, in log odds: that of twelve
simulated robots of the source domains."""
GOOD_RUNS, ITSELF = "good runs", "the signal itself"
"""What features may be relative to."""
FITTED = 10
"""Alarms by which its tail is fitted at most: log odds below fall faster."""


def adapt(general: Classifier, good: GoodMotion, *, alarms: float = 1.0) -> Learnt:
    """Adapt a general model to a robot; its limits follow from cross-validation.

    Args:
        general: A general model at the rate of the good motion, see `General.at`.
        good: Good motion of the robot, cut by the profile of that model.
        alarms: False-alarm budget, per hour of good motion.

    Returns:
        The adapted model, with the same classes; equal input gives an equal one.

    Raises:
        ProfileError: If the alarms are not above 0, or it is no general model.
        DatasetError: If there is too little good motion.
    """
    trees = general.estimator
    if not (isinstance(trees, Trees) and general.profile.reference):
        raise ProfileError("only a general model, whose features take a reference, can be adapted")
    check(good, alarms, LEAST)
    by_others, novel = _unseen(general, good, trees.known < UNBOUNDED)
    by_itself = _confirmed(_failing(general, good.features), good)
    half = alarms / 2
    allowed = int(half * good.seconds / HOUR)

    def limit_of(failing: Array) -> Limit:
        least = max(counted(failing, good, allowed), _log_odds(LEAST_PROBABILITY))
        unit = "log odds of a failure"
        return limit(failing, good, half, least=least, fitted=FITTED, expected=EXCESS, unit=unit)

    scores = {GOOD_RUNS: by_others, ITSELF: by_itself}
    limits = {name: limit_of(failing) for name, failing in scores.items()}
    reference = min(limits, key=lambda name: limits[name].distance)
    odds, failing = limits[reference], scores[reference]
    far = limit(novel, good, half, least=max(counted(novel, good, allowed), NOVELTY_LIMIT))
    beyond = np.maximum(failing - odds.distance, novel - far.distance)
    found = replace(odds, budget=alarms, alarms=len(alarm_peaks(beyond, good, 0.0)))
    groups = len(set(good.groups.tolist()))
    facts = {
        **asdict(found),
        "novelty": far.distance,
        "groups": groups,
        "runs": len(good.hashes),
        "reference": reference,
    }

    everything = np.arange(len(good))
    plain = _plain(good, everything)
    own = slice(plain.shape[1])
    highest = (_highest(plain) - general.mean[own]) / general.scale[own]
    known, calibration = trees.known.copy(), trees.calibration.copy()
    known[own] = np.maximum(known[own], highest + (far.distance - NOVELTY_LIMIT))
    calibration[1] += found.distance + MARGIN - _log_odds(trees.alarm)
    classifier = replace(
        general,
        estimator=replace(trees, known=known, calibration=calibration),
        reference=Reference.of(plain) if reference == GOOD_RUNS else None,
        runs={**general.runs, **good.hashes},
        metrics={**general.metrics, "adapted": facts},
    )
    return Learnt(classifier, found, len(good.hashes), groups, len(good.annotated))


def _unseen(general: Classifier, good: GoodMotion, bounded: Mask) -> tuple[Array, Array]:
    """Scores of frames relative to all other parts of the good motion.

    Args:
        general: The model.
        good: The good motion.
        bounded: Whether a feature has a bound, shape (features,); none relative to a reference has.

    Returns:
        Log odds of any failure, and how far the farthest feature lies above nearly all frames of
        the other parts, in standard deviations of the training set; shape (frames,).
    """
    odds, novelty = np.empty(len(good)), np.empty(len(good))
    for train, test in parts(good):
        others, plain = _plain(good, train), _plain(good, test)
        relative = Reference.of(others).relative(plain)
        odds[test] = _failing(general, np.concatenate((plain, relative), axis=1))
        above = (plain - _highest(others)) / general.scale[: plain.shape[1]]
        novelty[test] = above[:, bounded[: plain.shape[1]]].max(axis=1)
    return _confirmed(odds, good), _confirmed(novelty, good)


def _failing(general: Classifier, features: Array) -> Array:
    """Log odds of any failure, shape (frames,)."""
    ok = general.decide(features)[:, 0]
    odds: Array = np.log1p(-np.exp(ok)) - ok
    return odds


def _plain(good: GoodMotion, frames: Index) -> Array:
    """Features of frames as they are: the first half, shape (frames, features)."""
    plain: Array = good.features[frames, : good.features.shape[1] // 2]
    return plain


def _highest(plain: Array) -> Array:
    """Highest value of each feature in nearly all frames, shape (features,)."""
    highest: Array = np.quantile(plain, 1.0 - TAIL, axis=0)
    return highest


def _confirmed(score: Array, good: GoodMotion) -> Array:
    """What a frame and a neighbour both reach; where one is missing, the frame alone."""
    apart = good.first_of_run[1:] | (good.start[1:] > good.stop[:-1])
    before = np.append(inf, np.where(apart, inf, score[:-1]))
    after = np.append(np.where(apart, inf, score[1:]), inf)
    both: Array = np.minimum(score, np.maximum(before, after))
    return both


def _log_odds(probability: float) -> float:
    return log(probability / (1.0 - probability))
