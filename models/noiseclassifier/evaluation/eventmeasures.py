"""Events as measures: shares, delays and rates over whole recordings, each with its interval."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from noiseclassifier.evaluation.eventscore import EventScore
from noiseclassifier.evaluation.intervals import Estimate, Resampling
from noiseclassifier.evaluation.matching import OK, UNCLEAR
from noiseclassifier.types import Array, Index, Mask

HOUR = 3600.0
LATE = 0.9
"""The quantile of the delays that is given beside the median."""


@dataclass(frozen=True, eq=False)
class EventMeasures:
    """Measures of a model by events; `eventscore` defines the terms.

    Attributes:
        found: Failures that are found, of each class.
        named: Failures that are named, of each class.
        all_found: Failures that are found, of all.
        all_named: Failures that are named, of all.
        delay: Median delay of those that are found, in [s].
        late_delay: Delay that a tenth of them exceed, in [s].
        false_alarms: How many.
        false_alarms_per_hour: Of `ok` motion that frames cover.
        wrong_stretches: How many.
        wrong_stretches_per_hour: Of `ok` motion that frames cover.
        failure_recall: Failure frames of whole recordings that were predicted as any failure.
        false_alarm_rate: `ok` frames of whole recordings that were predicted as a failure.
        ok_hours: `ok` motion that frames cover, in [h].
        ok_hours_annotated: All `ok` motion, in [h].
    """

    found: dict[str, Estimate]
    named: dict[str, Estimate]
    all_found: Estimate
    all_named: Estimate
    delay: Estimate
    late_delay: Estimate
    false_alarms: int
    false_alarms_per_hour: Estimate
    wrong_stretches: int
    wrong_stretches_per_hour: Estimate
    failure_recall: Estimate
    false_alarm_rate: Estimate
    ok_hours: float
    ok_hours_annotated: float

    def as_dict(self) -> dict[str, Any]:
        """Give all measures as JSON can hold them."""

        def plain(value: Any) -> Any:
            if isinstance(value, dict):
                return {name: plain(each) for name, each in value.items()}
            return value.as_dict() if isinstance(value, Estimate) else value

        return {name: plain(value) for name, value in vars(self).items()}


def measure(score: EventScore, resampling: Resampling, only: Mask | None = None) -> EventMeasures:
    """Shares, delays and rates of events, with intervals.

    Args:
        score: The events.
        resampling: Sets of recordings.
        only: Which recordings count, shape (runs,); all unless given.
    """
    matched = score.matched
    frames, failures = matched.frames, matched.failures
    kept = np.ones(len(matched.names), dtype=bool) if only is None else only

    def count(run: Index) -> Array:
        return matched.by_run(run) * kept

    def share(part: Mask, whole: Mask, run: Index) -> Estimate:
        return resampling.share(count(run[part & whole]), count(run[whole]))

    flagged = frames.flagged
    failing = ~np.isin(frames.truth, (OK, UNCLEAR))
    every = np.ones(len(failures), dtype=bool)
    classes = [name for name in matched.classes if name != OK]
    others = sorted(set(failures.label.tolist()) - set(classes))
    of_class = {name: failures.label == name for name in (*classes, *others)}
    false, wrong = count(score.alarms.run[score.alarms.false]), score.wrong * kept
    hours = kept * matched.ok_covered / HOUR
    counted = score.found & kept[failures.run]
    delay, owner = score.delay[counted], failures.run[counted]
    return EventMeasures(
        found={name: share(score.found, own, failures.run) for name, own in of_class.items()},
        named={name: share(score.named, own, failures.run) for name, own in of_class.items()},
        all_found=share(score.found, every, failures.run),
        all_named=share(score.named, every, failures.run),
        delay=quantile_of(delay, owner, 0.5, resampling),
        late_delay=quantile_of(delay, owner, LATE, resampling),
        false_alarms=int(false.sum()),
        false_alarms_per_hour=resampling.rate(false, hours),
        wrong_stretches=int(wrong.sum()),
        wrong_stretches_per_hour=resampling.rate(wrong, hours),
        failure_recall=share(flagged, failing, frames.run),
        false_alarm_rate=share(flagged, frames.in_ok, frames.run),
        ok_hours=float(hours.sum()),
        ok_hours_annotated=float((kept * matched.ok_annotated).sum() / HOUR),
    )


def quantile_of(values: Array, owner: Index, share: float, resampling: Resampling) -> Estimate:
    """Estimate a quantile of values that belong to recordings."""
    ascending = np.argsort(values, kind="stable")
    values, owner = values[ascending], owner[ascending]
    behind = np.bincount(owner, minlength=resampling.weights.shape[1]) > 0

    def of_sets(weights: Array) -> Array:
        total = np.cumsum(weights[:, owner], axis=1)
        if not len(values):
            return np.full(len(weights), np.nan)
        place = (total < share * total[:, -1:]).sum(axis=1)
        return np.where(total[:, -1] > 0, values[np.minimum(place, len(values) - 1)], np.nan)

    once = np.ones((1, len(behind)))
    return resampling.plain(float(of_sets(once)[0]), of_sets(resampling.weights), behind)
