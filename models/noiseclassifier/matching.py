"""Findings and faults matched in time: spans, the matcher, and the outcome of a run.

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

A frame *is* a failure if it holds an annotated block of it whole, or is filled by it by half or
more (by several: that which fills most); it is `ok` if it lies wholly in `ok` blocks. Any other
frame is unclear, and counts for nothing. Times that differ by a sample or less are the same:
annotations are written with few digits.

Spans are arrays of shape (spans, 2), start and stop of each, in [s].
"""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import inf, nan
from typing import Protocol

import numpy as np

from noiseclassifier.labels import CONFIRM, UNKNOWN, Event, Labels, sides
from noiseclassifier.recording import Block, Fault, Recording, robot_of
from noiseclassifier.signals import Array, Index, Mask, Words

OK, UNCLEAR = "ok", ""
UNNAMED = "unnamed"  # robot or domain of a recording that names none
COLLAR = 0.2  # time between a finding and a fault that still meet, in [s]
CLOSE = 0.2  # largest error of an onset that counts as right, in [s]
SHIFTS = 40  # random shifts of the findings of each run
HOUR = 3600.0
# Kinds of findings: on a fault or failure, in `ok` time, and in unlabelled time.
MET, FALSE, UNLABELLED = "met", "false", "unlabelled"


class Span(Protocol):
    """What has a start and a stop in [s]: a block, an event, a finding, a fault."""

    @property
    def start(self) -> float: ...  # noqa: D102
    @property
    def stop(self) -> float: ...  # noqa: D102


# --- spans


def spans_of(items: Iterable[Span]) -> Array:
    """Spans of blocks, events or findings, as they come."""
    return np.array([(item.start, item.stop) for item in items], dtype=np.float64).reshape(-1, 2)


def union(spans: Array) -> Array:
    """Spans in order, merged where they overlap or touch, so that no time counts twice."""
    if not len(spans):
        return spans
    spans = spans[np.argsort(spans[:, 0], kind="stable")]
    reach = np.maximum.accumulate(spans[:, 1])
    first = np.append(True, spans[1:, 0] > reach[:-1])
    last = np.append(first[1:], True)
    return np.stack((spans[first, 0], reach[last]), axis=1)


def overlap(spans: Array, others: Array) -> Array:
    """Time that each span shares with each of others, shape (spans, others), in [s]."""
    start = np.maximum(spans[:, None, 0], others[None, :, 0])
    stop = np.minimum(spans[:, None, 1], others[None, :, 1])
    return np.asarray(np.maximum(stop - start, 0.0), dtype=np.float64)


def common(spans: Array, others: Array) -> Array:
    """Time that is in both, as spans in order."""
    one, other = union(spans), union(others)
    start = np.maximum(one[:, None, 0], other[None, :, 0])
    stop = np.minimum(one[:, None, 1], other[None, :, 1])
    shared = stop > start
    return union(np.stack((start[shared], stop[shared]), axis=1))


def duration(spans: Array) -> float:
    """Time in any of the spans, in [s]."""
    merged = union(spans)
    return float((merged[:, 1] - merged[:, 0]).sum())


# --- the matcher


def match(
    found: Sequence[Span], wanted: Sequence[Span], *, collar: float = COLLAR
) -> list[tuple[int, int]]:
    """Match findings with faults, or findings of two runs, one to one, up to a collar in [s] apart.

    Returns:
        Indices of ``found`` and of ``wanted``, as many pairs as can be, each index in one at most.
    """
    return pairs(meet(spans_of(found), spans_of(wanted), collar))


def meet(spans: Array, wanted: Array, collar: float = COLLAR) -> Mask:
    """Whether findings, shape (..., findings, 2), meet faults: shape (..., findings, faults)."""
    early = spans[..., :, None, 0] <= wanted[:, 1] + collar
    late = spans[..., :, None, 1] >= wanted[:, 0] - collar
    return np.asarray(early & late)


def pairs(met: Mask) -> list[tuple[int, int]]:
    """Most pairs of findings and faults that meet, by ``met`` (findings, faults)."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import maximum_bipartite_matching

    if not met.any():
        return []
    partner = maximum_bipartite_matching(csr_matrix(met), perm_type="column").tolist()
    return [(finding, fault) for finding, fault in enumerate(partner) if fault >= 0]


def truth_of(start: Array, stop: Array, blocks: Iterable[Block], *, step: float) -> Words:
    """True class of each frame from start to stop in [s], `UNCLEAR` where annotations tell none.

    ``step`` is the time from one sample to the next, in [s].
    """
    blocks = list(blocks)
    frames, slack = np.stack((start, stop), axis=1), 1.5 * step
    ok = union(spans_of(block for block in blocks if block.label == OK))
    in_ok = overlap(frames, ok).sum(axis=1) > stop - start - slack
    bad = [block for block in blocks if block.label != OK]
    if not bad:
        return np.where(in_ok, OK, UNCLEAR)
    spans = spans_of(bad)
    shared = overlap(frames, spans)
    enough = shared > np.minimum(spans[:, 1] - spans[:, 0], (stop - start)[:, None] / 2.0) - slack
    filled = np.where(enough, shared, 0.0)
    names = np.array([block.label for block in bad])
    failure = np.where(filled.any(axis=1), names[filled.argmax(axis=1)], UNCLEAR)
    return np.where(in_ok, OK, failure)


# --- what is matched


@dataclass(frozen=True)
class Unanswered:
    """A recording that a model cannot classify."""

    name: str
    facts: Mapping[str, str] = field(default_factory=dict)  #: its robot, scenario and domain
    reason: str = ""  #: why there is no verdict, in a few words


@dataclass(frozen=True, eq=False)
class Predictions:
    """Annotations of one recording, and predictions of a model."""

    name: str
    group: str  # as `recording.group_of` names it
    step: float  # time from one sample to the next, in [s]
    blocks: tuple[Block, ...]  # in order; each ends with the recording at the latest
    truth: Words  # class of each frame that is cut from a block, shape (frames,)
    predicted: Words  # predicted class of it, shape (frames,)
    labels: Labels  # of the whole recording
    events: tuple[Fault, ...] = ()  # all injected faults; empty where they are not known
    facts: Mapping[str, str] = field(default_factory=dict)
    # Findings by their frames, and from onset to end; None: those of the labels.
    located: tuple[tuple[Event, ...], tuple[Event, ...]] | None = None

    @cached_property
    def spans(self) -> tuple[Event, ...]:
        """Findings by their frames."""
        return self.labels.events() if self.located is None else self.located[0]

    @cached_property
    def findings(self) -> tuple[Event, ...]:
        """The same findings from onset to end, as they are reported."""
        return self.spans if self.located is None else self.located[1]


def origin_of(one: Unanswered | Predictions) -> dict[str, str]:
    """Robot, domain (simulator, drives, sensing and control) and scenario of a recording."""
    robot = one.facts.get("robot") or robot_of(one.name)
    known = {**one.facts, "robot": robot}
    return {key: known.get(key) or UNNAMED for key in ("robot", "domain", "scenario")}


def within(recording: Recording) -> tuple[Block, ...]:
    """Blocks of a recording, in order; each ends with the recording at the latest."""
    end = recording.start + len(recording.time) / recording.rate
    blocks = recording.blocks
    return tuple(sorted(b._replace(stop=end if b.stop == inf else b.stop) for b in blocks))


# --- the outcome of a run


@dataclass(frozen=True, eq=False)
class Outcome:
    """Findings and faults of one run."""

    run: Predictions
    faults: tuple[Fault, ...]  # all injected ones, or failure blocks where those are not known
    kind: Words  # of each finding, shape (findings,)
    found: Mask  # whether each fault is, shape (faults,)
    delay: Array  # from its start until a live listener knows, NaN unless found, in [s]
    counts: dict[str, float]  # numbers, and times in [h]; of matches also by chance
    score: float  # see `run_score`

    @classmethod
    def of(cls, run: Predictions) -> "Outcome":
        """Match findings and faults of a run."""
        labels, findings = run.labels, run.findings
        bad = [block for block in run.blocks if block.label != OK]
        faults = run.events or tuple(Fault(*block) for block in bad)
        spans, wanted = spans_of(findings), spans_of(faults)
        met = meet(spans, wanted)
        close = met & (np.abs(spans[:, None, 0] - wanted[None, :, 0]) <= CLOSE)
        classified = union(np.stack((labels.start, labels.stop), axis=1))
        ok_blocks = union(spans_of(block for block in run.blocks if block.label == OK))
        ok, failing = common(ok_blocks, classified), spans_of(bad)
        known = np.concatenate((ok, failing, wanted))
        half = (spans[:, 1] - spans[:, 0]) / 2.0
        slack = np.minimum(1.5 * run.step, half)
        on_fault = met.any(axis=1) | (overlap(spans, failing) > slack[:, None]).any(axis=1)
        in_ok = overlap(spans, ok_blocks).sum(axis=1) >= half
        kind = np.where(on_fault, MET, np.where(in_ok, FALSE, UNLABELLED))
        label = np.array([finding.label for finding in findings], dtype=str)
        felt = np.array([fault.felt for fault in faults], dtype=bool)
        same = label[:, None] == np.array([fault.label for fault in faults], dtype=str)
        counts = {
            "runs": 1.0,
            "ok_hours": duration(ok) / HOUR,
            "ok_hours_flagged": duration(common(ok, spans)) / HOUR,
            "unlabelled_hours": (duration(classified) - duration(common(classified, known))) / HOUR,
            "findings": len(findings),
            "false_alarms": int((kind == FALSE).sum()),
            "alarms_in_unlabelled": int((kind == UNLABELLED).sum()),
            "faults": len(faults),
            "felt": int(felt.sum()),
            "half_of_both": (len(findings) + len(faults)) / 2.0,
            **_matches(met[None], close[None], felt, same),
        }
        chance = _matches(*_by_chance(run, spans, wanted), felt, same)
        counts |= {f"{name}_by_chance": value for name, value in chance.items()}
        delay = _delays(run, faults, met)
        return cls(run, faults, kind, np.any(met, axis=0), delay, counts, run_score(labels))


def confirmed_at(labels: Labels) -> Index:
    """Frame at which each flagged frame's stretch is confirmed, shape (frames,).

    A live listener knows of a stretch once it has enough frames of evidence, as `labels`
    counts them. What is given for frames that are not flagged has no meaning.
    """
    frames = np.arange(len(labels))
    if labels.above_threshold is None or not len(frames):
        return frames
    begins, weight = sides(labels.flagged, labels.apart)
    evidence = labels.flagged & (labels.above_threshold | (labels.label == UNKNOWN))
    total = np.cumsum(weight * evidence)
    own = np.maximum.accumulate(np.where(begins, frames, 0))
    place: Index = np.searchsorted(total, np.append(0, total)[own] + CONFIRM)
    return np.minimum(place, len(frames) - 1)


def run_score(labels: Labels) -> float:
    """Largest failure score that two neighbouring frames both reach; NaN without a frame.

    The score is 1 - P(ok), or the largest margin of a failure over `ok`. A finding takes two
    frames. A frame without a neighbour on one side stands alone, as in the rule from frames to
    findings.
    """
    if not len(labels):
        return nan
    ok = labels.classes.index(OK)
    if labels.above_threshold is None:
        failures = np.delete(labels.scores, ok, axis=1).max(axis=1)
        return float((failures - labels.scores[:, ok]).max())
    scores, apart = 1.0 - labels.scores[:, ok], labels.apart
    alone = np.append(True, apart) | np.append(apart, True)
    both = np.minimum(scores[1:], scores[:-1])[~apart]
    return float(np.concatenate((scores[alone], both)).max())


def _matches(met: Mask, close: Mask, felt: Mask, same: Mask) -> dict[str, float]:
    """Mean counts of cases: ``met`` and ``close`` have the shape (cases, findings, faults)."""
    found: Mask = np.any(met, axis=1)
    return {
        "found": float(found.sum(axis=1).mean()),
        "found_felt": float(found[:, felt].sum(axis=1).mean()),
        "onset_close": float(np.any(close, axis=1).sum(axis=1).mean()),
        "matched_by_class": float(np.mean([len(pairs(case)) for case in met & same])),
    }


def _by_chance(run: Predictions, spans: Array, wanted: Array) -> tuple[Mask, Mask]:
    """What meets, and with the right onset, of findings shifted at random; the name is the seed."""
    if not len(spans) or not len(run.labels):
        none = np.zeros((1, len(spans), len(wanted)), dtype=bool)
        return none, none
    start, stop = float(run.labels.start[0]), float(run.labels.stop[-1])
    seed = int.from_bytes(hashlib.sha256(run.name.encode()).digest()[:8], "big")
    offset = np.random.default_rng(seed).uniform(0.0, stop - start, SHIFTS)[:, None]
    begin = start + (spans[:, 0] - start + offset) % (stop - start)
    shifted = np.stack((begin, begin + spans[:, 1] - spans[:, 0]), axis=-1)
    end = shifted[..., 1] - (stop - start)  # what is beyond the end comes at the beginning
    over = np.stack((np.where(end > start, start, np.inf), end), axis=-1)
    met = meet(np.minimum(shifted, stop), wanted) | meet(over, wanted)
    return met, met & (np.abs(shifted[..., :, None, 0] - wanted[:, 0]) <= CLOSE)


def _delays(run: Predictions, faults: Sequence[Fault], met: Mask) -> Array:
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
