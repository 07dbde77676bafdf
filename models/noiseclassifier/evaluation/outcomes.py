"""Outcome of one run: its findings beside the faults that were injected.

A finding and a fault *meet* if they overlap, or are no more than a collar of 0.2 s apart. A fault
is *found* if a finding of any class meets it. Findings and faults are also matched *one to one*, as
many as can be, so that two findings on one fault are one found and one false, and one finding on
two faults finds one of them (collar and matching as in sed_eval: Mesaros, Heittola and Virtanen,
Metrics for polyphonic sound event detection, Applied Sciences 6, 2016).

A finding that meets no fault and touches no failure block is a *false alarm* if half of it or more
lies in `ok` time, and an *alarm in unlabelled time* otherwise: that which follows a fault often
ends in `ok` time. What it flags there counts in the share of ok time that is flagged.

The level of *chance* is what the same findings score where they mean nothing: shifted circularly
within their run, all by the same random time.
"""

import hashlib
from dataclasses import dataclass

import numpy as np

from noiseclassifier.evaluation.matching import OK
from noiseclassifier.evaluation.predictions import Predictions
from noiseclassifier.evaluation.ranking import run_score
from noiseclassifier.evaluation.spans import common, duration, overlap, spans_of, union
from noiseclassifier.labels import CONFIRM, UNKNOWN, Event, Labels
from noiseclassifier.recording import Fault
from noiseclassifier.types import Array, Index, Mask, Words

COLLAR = 0.2
"""Time between a finding and a fault that still meet, in [s]."""
CLOSE = 0.2
"""Largest error of an onset that counts as right, in [s]."""
SHIFTS = 40
"""Random shifts of the findings of each run."""
HOUR = 3600.0
MET, FALSE, UNLABELLED = "met", "false", "unlabelled"
"""Kinds of findings: on a fault or failure, in `ok` time, and in unlabelled time."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """Findings and faults of one run.

    Attributes:
        run: The predictions.
        faults: All injected faults, or failure blocks where those are not known.
        kind: Kind of each finding, shape (findings,).
        found: Whether each fault is found, shape (faults,).
        close: Whether the nearest onset of a finding that meets it is right, shape (faults,).
        delay: Time from its start until a live listener knows, NaN unless found, shape (faults,),
            in [s].
        counts: Numbers and times in [h] of the run, by name; of matches also by chance.
        score: Score of the run.
    """

    run: Predictions
    faults: tuple[Fault, ...]
    kind: Words
    found: Mask
    close: Mask
    delay: Array
    counts: dict[str, float]
    score: float

    @classmethod
    def of(cls, run: Predictions) -> "Outcome":
        """Match findings and faults of a run."""
        labels, findings, faults = run.labels, run.findings, faults_of(run)
        spans, wanted = spans_of(findings), spans_of(faults)
        onsets = np.abs(spans[:, None, 0] - wanted[None, :, 0])
        met = meet(spans, wanted)
        kind = _kind(run, spans, met)
        unknown = np.array([finding.label == UNKNOWN for finding in findings], dtype=bool)
        found: Mask = np.any(met, axis=0)
        close: Mask = np.any(met & (onsets <= CLOSE), axis=0)
        felt = np.array([fault.felt for fault in faults], dtype=bool)
        same = _same(findings, faults)
        bad = [block for block in run.blocks if block.label != OK]
        heard = union(np.stack((labels.start, labels.stop), axis=1))
        ok = common(spans_of([block for block in run.blocks if block.label == OK]), heard)
        known = np.concatenate((ok, spans_of(bad), wanted))
        counts = {
            "runs": 1.0,
            "faulty": float(len(faults) > 0),
            "ok_hours": duration(ok) / HOUR,
            "ok_hours_flagged": duration(common(ok, spans)) / HOUR,
            "unlabelled_hours": (duration(heard) - duration(common(heard, known))) / HOUR,
            "findings": len(findings),
            "false_alarms": int((kind == FALSE).sum()),
            "unknown_false_alarms": int((unknown & (kind == FALSE)).sum()),
            "alarms_in_unlabelled": int((kind == UNLABELLED).sum()),
            "faults": len(faults),
            "felt": int(felt.sum()),
            **_matches(met[None], close[None], felt, same),
        }
        counts |= {f"{name}_by_chance": each for name, each in _by_chance(run, same, felt).items()}
        return cls(
            run, faults, kind, found, close, _delays(run, faults, met), counts, run_score(labels)
        )


def faults_of(run: Predictions) -> tuple[Fault, ...]:
    """All faults that were injected; where those are not known, the annotated failures."""
    return run.events or tuple(Fault(*block) for block in run.blocks if block.label != OK)


def meet(spans: Array, wanted: Array) -> Mask:
    """Whether findings meet faults.

    Args:
        spans: Of the findings, shape (..., findings, 2), in [s].
        wanted: Of the faults, shape (faults, 2), in [s].

    Returns:
        Shape (..., findings, faults).
    """
    early = spans[..., :, None, 0] <= wanted[:, 1] + COLLAR
    late = spans[..., :, None, 1] >= wanted[:, 0] - COLLAR
    met: Mask = early & late
    return met


def one_to_one(met: Mask) -> Array:
    """Largest number of pairs that meet, each finding and each fault in one pair at most.

    Args:
        met: Whether findings meet faults, shape (cases, findings, faults).

    Returns:
        Shape (cases,).
    """
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import maximum_bipartite_matching

    cases, findings, faults = met.shape
    case, row, column = np.nonzero(met)
    if not len(case):
        return np.zeros(cases)
    shape = cases * findings, cases * faults
    pairs = (np.ones(len(case)), (case * findings + row, case * faults + column))
    partner = maximum_bipartite_matching(csr_matrix(pairs, shape=shape), perm_type="column")
    matched: Array = (partner.reshape(cases, findings) >= 0).sum(axis=1).astype(np.float64)
    return matched


def confirmed_at(labels: Labels) -> Index:
    """Frame at which each flagged frame's stretch is confirmed, shape (frames,).

    A live listener knows of a stretch once it has enough frames of evidence, as `labels`
    counts them. What is given for frames that are not flagged has no meaning.
    """
    flagged, frames = labels.flagged, np.arange(len(labels))
    if labels.above_threshold is None:
        return frames
    evidence = flagged & (labels.above_threshold | (labels.label == UNKNOWN))
    apart = labels.start[1:] > labels.stop[:-1]
    first, last = np.append(True, apart)[: len(frames)], np.append(apart, True)[: len(frames)]
    begins = flagged & (first | ~np.append(False, flagged)[: len(frames)])
    total = np.cumsum(np.where(first | last, 2, 1) * evidence)
    own = frames[np.maximum.accumulate(np.where(begins, frames, 0))] if len(frames) else frames
    before = np.append(0, total)[own]
    place: Index = np.searchsorted(total, before + CONFIRM)
    return np.minimum(place, len(frames) - 1)


def _kind(run: Predictions, spans: Array, met: Mask) -> Words:
    slack = np.minimum(1.5 * run.step, (spans[:, 1] - spans[:, 0]) / 2.0)
    bad = spans_of([block for block in run.blocks if block.label != OK])
    ok = union(spans_of([block for block in run.blocks if block.label == OK]))
    on_fault = met.any(axis=1) | (overlap(spans, bad) > slack[:, None]).any(axis=1)
    in_ok = overlap(spans, ok).sum(axis=1) >= (spans[:, 1] - spans[:, 0]) / 2.0
    return np.where(on_fault, MET, np.where(in_ok, FALSE, UNLABELLED))


def _same(findings: tuple[Event, ...], faults: tuple[Fault, ...]) -> Mask:
    """Whether findings and faults are of one class, shape (findings, faults)."""
    pairs = [[finding.label == fault.label for fault in faults] for finding in findings]
    return np.array(pairs, dtype=bool).reshape(len(findings), len(faults))


def _matches(met: Mask, close: Mask, felt: Mask, same: Mask) -> dict[str, float]:
    """Mean counts of cases: ``met`` has the shape (cases, findings, faults)."""
    found: Mask = np.any(met, axis=1)
    return {
        "found": float(found.sum(axis=1).mean()),
        "found_felt": float(found[:, felt].sum(axis=1).mean()),
        "onset_close": float(close.sum(axis=1).mean()),
        "matched_by_class": float(one_to_one(met & same).mean()),
        "matched": float(one_to_one(met).mean()),
    }


def _by_chance(run: Predictions, same: Mask, felt: Mask) -> dict[str, float]:
    """Mean counts of findings that are shifted at random; the name of the run is the seed."""
    spans, wanted = spans_of(run.findings), spans_of(faults_of(run))
    if not len(spans) or not len(run.labels):
        none = np.zeros((1, len(spans), len(wanted)), dtype=bool)
        return _matches(none, np.any(none, axis=1), felt, same)
    start, stop = float(run.labels.start[0]), float(run.labels.stop[-1])
    seed = int.from_bytes(hashlib.sha256(run.name.encode()).digest()[:8], "big")
    offset = np.random.default_rng(seed).uniform(0.0, stop - start, SHIFTS)[:, None]
    begin = start + (spans[:, 0] - start + offset) % (stop - start)
    shifted = np.stack((begin, begin + spans[:, 1] - spans[:, 0]), axis=-1)
    end = shifted[..., 1] - (stop - start)  # what is beyond the end comes at the beginning
    over = np.stack((np.where(end > start, start, np.inf), end), axis=-1)
    met = meet(np.minimum(shifted, stop), wanted) | meet(over, wanted)
    close = met & (np.abs(shifted[..., :, None, 0] - wanted[:, 0]) <= CLOSE)
    return _matches(met, np.any(close, axis=1), felt, same)


def _delays(run: Predictions, faults: tuple[Fault, ...], met: Mask) -> Array:
    """Time from the start of each fault to the end of the frame at which it is known."""
    labels, known = run.labels, confirmed_at(run.labels)
    delay = np.full((len(run.findings), len(faults)), np.nan)
    for row, column in np.argwhere(met):
        span, fault = run.spans[row], faults[column]
        first = int(np.searchsorted(labels.start, span.start - run.step / 2.0))
        own = max(first, int(np.searchsorted(labels.stop, fault.start, side="right")))
        last = int(np.searchsorted(labels.stop, span.stop - run.step / 2.0))
        frame = max(int(known[first]), min(own, last))
        delay[row, column] = max(labels.stop[frame] - fault.start, 0.0)
    soonest: Array = np.fmin.reduce(delay, axis=0, initial=np.nan)
    return soonest
