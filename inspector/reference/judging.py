"""How much louder a run is than its reference, when, in which joint and octave, and what follows.

By moment, the first evidence that there is decides:

1. *repetitions*: other runs of this motion, aligned by the desired positions;
2. *other motions* of this robot, at moments of about the same speeds;
3. the *general* model alone.

A cell is a joint's velocity or tracking error in an octave. Its exceedance is its level over the
loudest of the references within 0.15 s, both above a floor. The score of a frame is the mean of its
two largest exceedances, or a neighbour's score if this is lower: one frame alone is no evidence.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from enum import StrEnum
from math import prod

import numpy as np
from numpy.typing import NDArray

from inspector.reference.alignment import Aligned, align
from inspector.reference.levels import HOP, SIGNALS, Levels
from noisemodel.types import Array

NEIGHBOURS = 3
"""Frames to each side among which a reference may be loudest."""
FLOOR = 3e-3
"""Root mean square below which nothing is compared, in [rad/s]: less is hardly ever detectable."""
FLOOR_SHARE = 0.1
"""The same as a share of the loudest level of the joint's octave in the references."""
CELLS = 2
"""Largest cells whose mean is the score of a frame."""
RESIDUAL = 0.6
"""Difference of positions up to which two moments are of one motion, in standard deviations."""
NEAR, NEAREST = 1.0, 60
"""Difference of speeds up to which moments of other motions count, in standard deviations; how
many of them are the reference."""
OTHERS_FLOOR = 0.3
"""`FLOOR_SHARE` beside other motions, whose contacts are at other speeds."""
APART = 1.0
"""Time from which moments of one motion stand for moments of another, in [s]."""
ROWS, LEVELS = 256, 8192
"""Frames that are compared at once, and frames times joints."""
POOL = 12_000
"""Most frames of other motions that are looked at."""
ASSUMED_DB = 6.0
"""Margin where repeatability is not known: one repetition alone."""
LEAST_DB = 4.0
"""Least margin: levels of half a step and alignments of half a frame are not exact."""
RATE = 0.01
"""Share of good runs that the extrapolated margin lets exceed it."""
GAP = 1.0
"""Exceedances this close together are one finding, in [s]: after an impact the motion differs."""
SAME_MOTION, SAME_NAME = 0.8, 0.2
"""Share of a run that has to lie on a scenario's motion to be of it, and the same if it has its
name: a fault may end the motion early."""
LONGER, SHARE_LONGER = 0.5, 0.1
"""Time and share of its scenario by which a run may be longer or shorter without a word."""
ALIKE = 0.9
"""Share of the best one's from which another scenario is of the same motion, too."""


class Kind(StrEnum):
    """Kinds of evidence, the best first."""

    REPETITIONS = "repetitions"
    OTHER_MOTIONS = "other motions"
    GENERAL = "general"


KINDS = tuple(Kind)


@dataclass(frozen=True)
class Expected:
    """What is expected of a scenario: a finding that is wanted, or waived until a day.

    Attributes:
        label: Class of the finding; any if empty.
        start: Earliest onset, in [s].
        stop: Latest end, in [s].
        joints: Joints that may be the loudest; any if empty.
        loudest: Highest level of a cell, in [dB re 1 rad/s]; any if None.
        required: Whether the finding has to be there.
        reason: Why.
        until: The last day of a waiver; None of a finding that is wanted.
    """

    label: str = ""
    start: float = float("-inf")
    stop: float = float("inf")
    joints: tuple[str, ...] = ()
    loudest: float | None = None
    required: bool = False
    reason: str = ""
    until: date | None = None

    def covers(self, label: str, start: float, stop: float) -> bool:
        """Whether it is about a finding of a class that lasts from onset to end."""
        return self.label in ("", label) and self.start <= start and stop <= self.stop


@dataclass(frozen=True, eq=False)
class Scenario:
    """A motion with its accepted repetitions.

    Attributes:
        repetitions: Levels of the repetitions, the newest last; one at least.
        scores: Leave-one-out scores, in [dB].
        elsewhere: Scores by other moments, in [dB]: how well other motions predict.
        required: Whether a log must exist.
        at_least: How many logs must exist.
        renamed_from: Names that it had.
        reason: Why it was accepted.
    """

    name: str
    repetitions: tuple[Levels, ...]
    scores: tuple[float, ...] = ()
    elsewhere: tuple[float, ...] = ()
    required: bool = True
    at_least: int = 1
    renamed_from: tuple[str, ...] = ()
    wanted: tuple[Expected, ...] = ()
    waived: tuple[Expected, ...] = ()
    accepted: date | None = None
    by: str = ""
    reason: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Its name, and those that it had."""
        return (self.name, *self.renamed_from)

    @property
    def duration(self) -> tuple[float, float]:
        """Shortest and longest repetition, in [s]."""
        every = [each.duration for each in self.repetitions]
        return min(every), max(every)

    @property
    def robot(self) -> str:
        """The robot of the newest repetition."""
        return self.repetitions[-1].robot


@dataclass(frozen=True)
class Margin:
    """From how many decibels over the reference on a moment is a finding.

    Attributes:
        db: The margin, in [dB].
        scores: Leave-one-out scores that it is from; empty if it is assumed.
        repetitions: Repetitions that the run is compared with.
    """

    db: float
    scores: tuple[float, ...] = ()
    repetitions: int = 0

    def __str__(self) -> str:
        return f"margin {self.db:.1f} dB{'' if self.scores else ' assumed'}"

    @property
    def bound(self) -> str:
        """How often a fault-free run exceeds it, as far as that is known, in a sentence."""
        if not self.scores:
            return f"{self.db:.1f} dB are assumed, not calibrated: nothing repeats."
        told = f"{self.db:.1f} dB are extrapolated from {len(self.scores)} leave-one-out scores."
        if not self.repetitions:
            return told
        return (
            f"{told} A fault-free run recorded like the {self.repetitions} repetitions is louder"
            f" than each of them would be by the others at most once in {self.repetitions + 1}."
        )


def margin_of(scores: Sequence[float], repetitions: int) -> Margin:
    """The margin by the scores of fault-free runs.

    Args:
        scores: Leave-one-out scores, in [dB].
    """
    found = np.sort([score for score in scores if np.isfinite(score)])
    if len(found) < 2:
        return Margin(ASSUMED_DB, (), repetitions)
    low = float(np.median(found))
    excess = max(1.0, float(np.mean(found[found >= low] - low)))
    # Exponential tail: half of the scores exceed the median.
    db = low + excess * np.log(0.5 / RATE)
    return Margin(max(LEAST_DB, float(db)), tuple(found.tolist()), repetitions)


@dataclass(frozen=True)
class Exceedance:
    """A stretch that is louder than its reference.

    Attributes:
        start: When it begins, in [s].
        stop: When it ends, in [s].
        peak: Time of its loudest exceedance, in [s].
        db: That, over the reference, in [dB].
        level: Level of that cell, in [dB re 1 rad/s].
        signal: "velocity" or "tracking error".
        octave: In [Hz].
    """

    start: float
    stop: float
    peak: float
    db: float
    level: float
    joint: str
    signal: str
    octave: tuple[float, float]
    kind: Kind

    def __str__(self) -> str:
        low, high = self.octave
        return (
            f"{self.db:.1f} dB over {self.kind} at {self.peak:.2f} s, {self.joint}, {self.signal},"
            f" {low:.0f} to {high:.0f} Hz"
        )


@dataclass(frozen=True, eq=False)
class Comparison:
    """A run beside its reference.

    Attributes:
        joints: Joints that are compared.
        octaves: Octaves that are compared, in [Hz].
        scenarios: Names of the scenarios whose motion it is.
        repetitions: How many repetitions these have.
        kind: Evidence of each frame, as its place in `KINDS`, shape (frames,).
        over: Exceedance of each cell, shape (frames, joints, 2, octaves), in [dB]; NaN where there
            is no reference.
        score: Of each frame, in [dB]; NaN without reference.
        margins: By kind of evidence.
        exceedances: Stretches that are louder, in order of time.
        quieter: By how much the run is quieter than each repetition, in [dB]; 0 if it is not.
        slope: Speed of the run divided by the repetitions'; NaN without.
        band: Level of the noise of the quietest and of the loudest repetition at each frame, shape
            (frames, 2), in [dB re 1 rad/s]; NaN without.
        remarks: What is not compared, and why, a sentence each.
    """

    run: Levels
    joints: tuple[str, ...]
    octaves: tuple[tuple[float, float], ...]
    scenarios: tuple[str, ...]
    repetitions: int
    kind: NDArray[np.int8]
    over: NDArray[np.float32]
    score: Array
    margins: Mapping[Kind, Margin]
    exceedances: tuple[Exceedance, ...]
    quieter: float = 0.0
    slope: float = float("nan")
    band: Array = field(default_factory=lambda: np.empty((0, 2)))
    remarks: tuple[str, ...] = ()

    @property
    def empty(self) -> bool:
        """Whether nothing can be compared."""
        return not len(self.time) or not self.joints or not self.octaves

    @property
    def noise(self) -> Array:
        """Level of the run's noise in the joints and octaves that are compared, as in the band."""
        return _noise(self.run, self.joints, self.octaves)

    @property
    def time(self) -> Array:
        """Middle of each frame, shape (frames,), in [s]."""
        return self.run.time

    @property
    def by_joint(self) -> NDArray[np.float32]:
        """Loudest exceedance of each joint, shape (frames, joints), in [dB]; NaN without reference.

        A heat map of it shows where the run is louder than its reference.
        """
        return _largest(self.over.reshape(*self.over.shape[:2], prod(self.over.shape[2:])))

    @property
    def peaks(self) -> Array:
        """Loudest exceedance of each joint, shape (joints,), in [dB]; minus infinity without."""
        over = np.nan_to_num(self.by_joint, nan=-np.inf)
        pairs = np.minimum(over[:-1], over[1:])  # one frame alone is no evidence
        return np.asarray(pairs.max(axis=0, initial=-np.inf), dtype=np.float64)

    def loudest(self, count: int) -> list[int]:
        """Places of the joints that are most over the reference, in their order."""
        return sorted(np.argsort(-self.peaks, kind="stable")[:count].tolist())

    @property
    def worst(self) -> float:
        """The largest score, in [dB]; NaN without any reference."""
        return _top(self.score)

    def share(self, kind: Kind) -> float:
        """Share of the frames that have an evidence."""
        return float(np.mean(self.kind == KINDS.index(kind))) if len(self.kind) else 0.0

    def covered(self, start: float, stop: float) -> bool:
        """Whether a reference covers all frames whose middle lies in a stretch, or the nearest."""
        inside = (self.time >= start) & (self.time <= stop)
        if not inside.any() and len(inside):
            inside[np.abs(self.time - (start + stop) / 2).argmin()] = True
        return bool(inside.any() and np.isfinite(self.score[inside]).all())

    def __str__(self) -> str:
        parts = [
            f"{self.share(kind):.0%} by {self._words(kind)}" for kind in KINDS if self.share(kind)
        ]
        return "; ".join(parts)

    def _words(self, kind: Kind) -> str:
        if kind is Kind.GENERAL:
            return "the general model alone"
        if kind is Kind.OTHER_MOTIONS:
            return f"other motions of this robot ({self.margins[kind]})"
        count = f"{self.repetitions} repetition{'s' * (self.repetitions != 1)}"
        return f"{count} of {' and '.join(self.scenarios)} ({self.margins[kind]})"


def compare(run: Levels, scenarios: Sequence[Scenario]) -> Comparison:
    """Compare a run with its reference."""
    known = [each for each in scenarios if robot_fits(run, each)]
    joints, octaves, remarks = _common(run, known, scenarios)
    frames = len(run.guide)
    over = _unknown(frames, joints, octaves)
    kind = np.full(frames, KINDS.index(Kind.GENERAL), dtype=np.int8)
    score = np.full(frames, np.nan)
    margins: dict[Kind, Margin] = {}
    matched: list[Scenario] = []
    quieter, slope, count, band = 0.0, float("nan"), 0, np.full((frames, 2), np.nan)
    if frames and joints and octaves:
        matched, aligned, told = _matching(run, known, joints)
        remarks += told
        references = _repetitions(matched)
        count = len(references)
        if references:
            quieter = _quieter(run, references, aligned, joints, octaves)
            band = _band(references, aligned, joints, octaves)
            over, covered = _over_repetitions(run, references, aligned, joints, octaves)
            kind[covered] = KINDS.index(Kind.REPETITIONS)
            scores = [score for scenario in known for score in scenario.scores]
            margins[Kind.REPETITIONS] = margin_of(scores, count)
            slope = float(np.nanmedian([each.slope for each in aligned]))
            longest = max(each.duration for each in references)
            if run.duration > longest + max(LONGER, SHARE_LONGER * longest):
                remarks.append(
                    f"longer than its scenario, {run.duration:.1f} of {longest:.1f} s: the rest is"
                    " compared with other motions"
                )
        left = np.flatnonzero(kind == KINDS.index(Kind.GENERAL))
        others = _repetitions([each for each in known if each not in matched])
        if len(left) and (others or references):
            found = _over_others(run, left, others or references, joints, octaves)
            covered = np.isfinite(_largest(found.reshape(len(left), -1)))
            over[left[covered]] = found[covered]
            kind[left[covered]] = KINDS.index(Kind.OTHER_MOTIONS)
            scores = [score for scenario in known for score in scenario.elsewhere]
            margins[Kind.OTHER_MOTIONS] = margin_of(scores, 0)
        score = scores_of(over)
    return Comparison(
        run,
        joints,
        octaves,
        tuple(each.name for each in matched),
        count,
        kind,
        over,
        score,
        margins,
        _exceedances(run, joints, octaves, over, score, kind, margins),
        quieter,
        slope,
        band,
        tuple(remarks),
    )


def leave_one_out(repetitions: Sequence[Levels]) -> tuple[float, ...]:
    """Score of each repetition by the others, in [dB], if they cover it."""
    found = []
    for place, run in enumerate(repetitions):
        others = [each for other, each in enumerate(repetitions) if other != place]
        shared = [each for each in others if set(run.joints) & set(each.joints)]
        if shared:
            joints = tuple(j for j in run.joints if all(j in each.joints for each in shared))
            octaves = tuple(o for o in run.octaves if all(o in each.octaves for each in shared))
            aligned = _aligned(run, shared, joints)
            over, _ = _over_repetitions(run, shared, aligned, joints, octaves)
            found.append(_top(scores_of(over)))
    return tuple(score for score in found if np.isfinite(score))


def leave_one_moment_out(repetitions: Sequence[Levels]) -> tuple[float, ...]:
    """Score of each repetition by other moments of all, as if these were other motions, in [dB]."""
    found = []
    for run in repetitions:
        joints = tuple(j for j in run.joints if all(j in each.joints for each in repetitions))
        octaves = tuple(o for o in run.octaves if all(o in each.octaves for each in repetitions))
        if joints and octaves and len(run.guide):
            rows = np.arange(len(run.guide))
            over = _over_others(run, rows, repetitions, joints, octaves, apart=APART)
            found.append(_top(scores_of(over)))
    return tuple(score for score in found if np.isfinite(score))


def scores_of(over: NDArray[np.float32]) -> Array:
    """Score of each frame, shape (frames,), in [dB]; NaN without reference."""
    flat, own = over.reshape(len(over), -1), np.full(len(over), np.nan)
    if not flat.size:
        return own
    for first in range(0, len(flat), ROWS):
        known = flat[first : first + ROWS]
        known = np.where(np.isnan(known), -np.inf, known)
        top = -np.partition(-known, min(CELLS, known.shape[1]) - 1, axis=1)[:, :CELLS]
        finite = np.isfinite(top).all(axis=1)
        own[first : first + ROWS] = np.where(finite, top.mean(axis=1), np.nan)
    around = np.fmax(np.append(np.nan, own[:-1]), np.append(own[1:], np.nan))
    return np.asarray(np.where(np.isnan(own), np.nan, np.fmin(own, around)))


def _top(score: Array) -> float:
    known = score[np.isfinite(score)]
    return float(known.max()) if len(known) else float("nan")


def _largest(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Largest along the last axis; NaN where all are."""
    lowered = np.where(np.isnan(values), -np.inf, values).max(axis=-1, initial=-np.inf)
    return np.where(np.isfinite(lowered), lowered, np.nan).astype(np.float32)


def robot_fits(run: Levels, scenario: Scenario) -> bool:
    """Whether a scenario may be of the robot: the same name if both have one, and a joint."""
    newest = scenario.repetitions[-1]
    same = not run.robot or not newest.robot or run.robot == newest.robot
    return same and bool(set(run.joints) & set(newest.joints))


def _common(
    run: Levels, known: Sequence[Scenario], accepted: Sequence[Scenario]
) -> tuple[tuple[str, ...], tuple[tuple[float, float], ...], list[str]]:
    """Joints and octaves that can be compared, and what cannot."""
    if not known:
        newest = [each.repetitions[-1] for each in accepted]
        robots = {each.robot for each in newest} - {""}
        if not run.robot or not robots or run.robot in robots:  # then the joints are others
            robots = {_joints(each) for each in newest}
            own = _joints(run)
        else:
            own = run.robot
        there = ", ".join(sorted(robots)) or "nothing"
        return (), (), [f"no reference: it is of {there}, and the run of {own}"]
    every = _repetitions(known)
    joints = tuple(j for j in run.joints if any(j in each.joints for each in every))
    octaves = tuple(o for o in run.octaves if any(o in each.octaves for each in every))
    remarks = []
    if len(joints) < len(run.joints):
        lacking = [joint for joint in run.joints if joint not in joints]
        remarks.append(f"no reference for joints {', '.join(lacking[:5])}")
    if len(octaves) < len(run.octaves):
        rates = sorted({each.rate for each in every})
        shown = ", ".join(f"{rate:g}" for rate in rates[:3])
        remarks.append(
            f"compared up to {octaves[-1][1] if octaves else 0:.0f} Hz: the run has"
            f" {run.rate:g} Hz, the reference {shown} Hz"
        )
    return joints, octaves, remarks


def _joints(run: Levels) -> str:
    return f"joints {', '.join(run.joints[:3])}{', …' * (len(run.joints) > 3)}"


def _view(
    run: Levels, joints: Sequence[str], octaves: Sequence[tuple[float, float]]
) -> NDArray[np.float32]:
    """Levels by some joints and octaves; NaN of those that the run lacks."""
    found = _unknown(len(run.level), joints, octaves)
    places = [(to, run.joints.index(j)) for to, j in enumerate(joints) if j in run.joints]
    bands = [(to, run.octaves.index(o)) for to, o in enumerate(octaves) if o in run.octaves]
    if places and bands:
        to, at = np.array(places).T
        into, of = np.array(bands).T
        found[:, to[:, None], :, into] = run.level[:, at[:, None], :, of]
    return found


def _aligned(run: Levels, others: Sequence[Levels], joints: Sequence[str]) -> list[Aligned]:
    """Where the run lies in each of the others, by the joints that all have; nothing without one.

    Positions count from zero if some are integrated.
    """
    shared = [j for j in joints if all(j in each.joints for each in (run, *others))]
    if not shared:
        return []
    every = [
        np.asarray(each.guide[:, [each.joints.index(j) for j in shared]], dtype=np.float64)
        for each in (run, *others)
    ]
    if any(each.guided_by.endswith("velocities") for each in (run, *others)):
        every = [
            guide - each.first[[each.joints.index(j) for j in shared]]
            for guide, each in zip(every, (run, *others), strict=True)
        ]
    return align(every[0], every[1:])


def _matching(
    run: Levels, known: Sequence[Scenario], joints: Sequence[str]
) -> tuple[list[Scenario], list[Aligned], list[str]]:
    """Scenarios of the run's motion, of several the one with its name; all their repetitions."""
    usable = [each for each in known if len(each.repetitions[-1].guide)]
    named = [each for each in usable if run.name in each.names]
    aligned = _aligned(run, _repetitions(named), joints)
    # A run that lies on the motion of its name needs no other scenario.
    newest = np.cumsum([len(each.repetitions) for each in named], dtype=int) - 1
    if named and aligned and all(_share(aligned[place]) >= SAME_NAME for place in newest):
        return named, aligned, []
    aligned = _aligned(run, [each.repetitions[-1] for each in usable], joints)
    # Nothing is aligned where no joint is shared.
    pairs = [(each, _share(own)) for each, own in zip(usable, aligned, strict=False)]
    best = max((share for _, share in pairs), default=0.0)
    found = [each for each, share in pairs if share >= max(SAME_MOTION, ALIKE * best)]
    named = [each for each, share in pairs if run.name in each.names and share >= SAME_NAME]
    told = []
    if len(found) > 1 and not named:
        names = ", ".join(each.name for each in found)
        told.append(f"its motion is that of {names}, and its name is of none: all count")
    aligned = _aligned(run, _repetitions(named or found), joints)
    return (named or found) if aligned else [], aligned, told


def _repetitions(scenarios: Sequence[Scenario]) -> list[Levels]:
    return [each for scenario in scenarios for each in scenario.repetitions]


def _share(aligned: Aligned) -> float:
    """Share of a run that lies on a motion."""
    return float(np.mean(aligned.residual <= RESIDUAL))


def share_of_motion(run: Levels, other: Levels) -> float:
    """Share of a run that lies on the motion of another."""
    if not len(run.guide) or not len(other.guide) or not set(run.joints) & set(other.joints):
        return 0.0
    return _share(*_aligned(run, [other], run.joints))


def same_motion(run: Levels, other: Levels) -> bool:
    """Whether two runs are one scenario, whatever they are called."""
    return run.robot == other.robot and share_of_motion(run, other) > SAME_MOTION


def floor_of(
    references: Sequence[NDArray[np.float32]], share: float = FLOOR_SHARE
) -> NDArray[np.float32]:
    """Power below which nothing is compared, shape (joints, 2, octaves), in [rad²/s²]."""
    loudest = np.full(references[0].shape[1:], -np.inf)
    for level in references:
        loudest = np.fmax(
            loudest, np.nanmax(level, axis=0, initial=-np.inf, where=~np.isnan(level))
        )
    power = np.where(np.isfinite(loudest), 10 ** (loudest / 10), 0.0)
    return np.maximum(FLOOR**2, share**2 * power).astype(np.float32)


def _raised(level: NDArray[np.float32], floor: NDArray[np.float32]) -> NDArray[np.float32]:
    """Levels with the floor added, in [dB]."""
    return np.asarray(10 * np.log10(10 ** (level / 10) + floor), dtype=np.float32)


def _spread(level: NDArray[np.float32]) -> NDArray[np.float32]:
    """The loudest within some frames to each side; NaN where none is known."""
    loud = level.copy()
    for shift in range(1, NEIGHBOURS + 1):
        loud[shift:] = np.fmax(loud[shift:], level[:-shift])
        loud[:-shift] = np.fmax(loud[:-shift], level[shift:])
    return loud


def _parts(joints: Sequence[str], *runs: Levels) -> list[slice]:
    """Joints that are compared at once: of long runs, all levels take several times the memory."""
    count = max(1, LEVELS // max(1, *(len(each.level) for each in runs)))
    return [slice(first, first + count) for first in range(0, len(joints), count)]


def _unknown(
    frames: int, joints: Sequence[str], octaves: Sequence[tuple[float, float]]
) -> NDArray[np.float32]:
    """Cells of which nothing is known yet."""
    return np.full((frames, len(joints), len(SIGNALS), len(octaves)), np.nan, dtype=np.float32)


def _over_repetitions(
    run: Levels,
    references: Sequence[Levels],
    aligned: Sequence[Aligned],
    joints: Sequence[str],
    octaves: Sequence[tuple[float, float]],
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Exceedance over the loudest repetition, NaN without one, and frames that one covers."""
    over = _unknown(len(run.guide), joints, octaves)
    covered = np.any([path.residual <= RESIDUAL for path in aligned], axis=0)
    for part in _parts(joints, run, *references):
        views = [_view(each, joints[part], octaves) for each in references]
        floor, loudest = floor_of(views), _unknown(len(over), joints[part], octaves)
        for view, path in zip(views, aligned, strict=True):
            loud = _spread(view)[path.frame]
            loud[path.residual > RESIDUAL] = np.nan
            loudest = np.fmax(loudest, loud)
        own = _raised(_view(run, joints[part], octaves), floor) - _raised(loudest, floor)
        over[covered, part] = own[covered]
    return over, covered


def _over_others(
    run: Levels,
    rows: NDArray[np.int64],
    references: Sequence[Levels],
    joints: Sequence[str],
    octaves: Sequence[tuple[float, float]],
    apart: float = 0.0,
) -> NDArray[np.float32]:
    """Exceedance over moments of other motions with about the same speeds; NaN without one.

    Velocities contain the desired motion, which is another one: tracking errors count where they
    are known.
    """
    shared = [j for j in joints if all(j in each.joints for each in references)]
    found = _unknown(len(rows), joints, octaves)
    if not shared:
        return found
    speed = np.concatenate(
        [each.speed[:, [each.joints.index(j) for j in shared]] for each in references]
    )
    time = np.concatenate([each.time - each.start for each in references])
    thin = -(-len(speed) // POOL)
    speed, time = speed[::thin], time[::thin]
    scale = speed.std(axis=0) + 0.05
    wanted = run.speed[rows][:, [run.joints.index(j) for j in shared]] / scale
    speed = speed / scale
    near = np.empty((len(rows), min(NEAREST, len(speed))), dtype=np.int32)
    close = np.empty(near.shape, dtype=bool)
    for first in range(0, len(rows), ROWS):
        own = slice(first, first + ROWS)
        part = wanted[own]
        square = (part**2).mean(1)[:, None] + (speed**2).mean(1) - 2 * part @ speed.T / len(scale)
        if apart:
            when = run.time[rows[own]] - run.start
            square[np.abs(when[:, None] - time) < apart] = np.inf
        near[own] = np.argpartition(square, near.shape[1] - 1, axis=1)[:, :NEAREST]
        close[own] = np.take_along_axis(square, near[own], axis=1) <= NEAR**2
    for place, joint in enumerate(joints):
        views = [_view(each, [joint], octaves) for each in references]
        floor, mine = floor_of(views, OTHERS_FLOOR), _view(run, [joint], octaves)
        level = np.concatenate([_spread(view) for view in views])[::thin, 0]
        level[np.isnan(level)] = -np.inf
        for first in range(0, len(rows), ROWS):
            own = slice(first, first + ROWS)
            known = close[own, :, None, None]
            loudest = np.where(known, level[near[own]], np.float32(-np.inf)).max(axis=1)
            loudest[~np.isfinite(loudest)] = np.nan
            raised = _raised(mine[rows[own]], floor) - _raised(loudest[:, None], floor)
            found[own, place] = raised[:, 0]
    tracked = np.isfinite(found[:, :, 1]).any(axis=(0, 2))
    found[:, tracked, 0] = np.nan
    return found


def _quieter(
    run: Levels,
    references: Sequence[Levels],
    aligned: Sequence[Aligned],
    joints: Sequence[str],
    octaves: Sequence[tuple[float, float]],
) -> float:
    """By how much the run is quieter than each repetition in its loudest joint, in [dB]."""
    parts, margins = _parts(joints, run, *references), []
    floors, own = [], _unknown(len(run.guide), joints, octaves)
    for part in parts:
        floors.append(floor_of([_view(each, joints[part], octaves) for each in references]))
        own[:, part] = _raised(_spread(_view(run, joints[part], octaves)), floors[-1])
    for repetition, path in zip(references, aligned, strict=True):
        over, same = _unknown(len(run.guide), joints, octaves), path.residual <= RESIDUAL
        for part, floor in zip(parts, floors, strict=True):
            level = _raised(_view(repetition, joints[part], octaves)[path.frame], floor)
            over[same, part] = (level - own[:, part])[same]
        margins.append(_top(scores_of(over)))
    known = [each for each in margins if np.isfinite(each)]
    return max(0.0, min(known)) if known else 0.0


def _noise(run: Levels, joints: Sequence[str], octaves: Sequence[tuple[float, float]]) -> Array:
    """Level of the velocities of all joints in all octaves, shape (frames,); NaN where none is."""
    power = np.zeros(len(run.guide))
    for part in _parts(joints, run):
        level = _view(run, joints[part], octaves)[:, :, 0]
        power += np.nansum(10.0 ** (level / 10), axis=(1, 2), dtype=np.float64)
    return np.asarray(10 * np.log10(np.where(power > 0.0, power, np.nan)))


def _band(
    references: Sequence[Levels],
    aligned: Sequence[Aligned],
    joints: Sequence[str],
    octaves: Sequence[tuple[float, float]],
) -> Array:
    """Quietest and loudest repetition at each frame of the run, shape (frames, 2)."""
    low = high = np.full(len(aligned[0].frame), np.nan)
    for each, path in zip(references, aligned, strict=True):
        noise = _noise(each, joints, octaves)[path.frame]
        noise[path.residual > RESIDUAL] = np.nan
        low, high = np.fmin(low, noise), np.fmax(high, noise)
    return np.stack((low, high), axis=1)


def _exceedances(
    run: Levels,
    joints: Sequence[str],
    octaves: Sequence[tuple[float, float]],
    over: NDArray[np.float32],
    score: Array,
    kind: NDArray[np.int8],
    margins: Mapping[Kind, Margin],
) -> tuple[Exceedance, ...]:
    limit = np.array([margins[k].db if k in margins else np.inf for k in KINDS])[kind]
    loud = np.flatnonzero(np.nan_to_num(score, nan=-np.inf) > limit)
    if not len(loud):
        return ()
    groups = np.split(loud, np.flatnonzero(np.diff(loud) * HOP > GAP) + 1)
    time, found = run.time, []
    for group in groups:
        cells = np.nan_to_num(over[group], nan=-np.inf)
        frame, joint, signal, octave = map(int, np.unravel_index(cells.argmax(), cells.shape))
        row = group[frame]
        level = _view(run, joints, octaves)[row, joint, signal, octave]
        found.append(
            Exceedance(
                # A frame reaches 0.1 s to each side; what is loud in it begins about its middle.
                float(max(run.start, time[group[0]] - HOP)),
                float(min(run.start + run.duration, time[group[-1]] + HOP)),
                float(time[row]),
                float(cells.max()),
                float(level),
                joints[joint],
                SIGNALS[signal],
                octaves[octave],
                KINDS[kind[row]],
            )
        )
    return tuple(found)
