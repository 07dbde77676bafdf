"""How much louder a run is than its reference, when, in which joint and octave, and what follows.

By moment, the first evidence that there is decides:

1. *repetitions*: other runs of this motion, aligned by the desired positions;
2. *other motions* of this robot, at moments of about the same speeds;
3. the *general* model alone.

A cell is a joint's velocity or tracking error in an octave. Its exceedance is its level over the
loudest of the references within 0.15 s, both above a floor. The score of a frame is the mean of its
two largest exceedances, or a neighbour's score if this is lower: one frame alone is no evidence.

Repetitions are aligned by dynamic time warping of positions. The path may begin and end anywhere
(open ends), and runs at half to twice the repetition's speed: its frame advances by 0, 1 or 2 with
each frame of the run, never twice by 0 in a row but before the repetition's start and after its
end, where a longer run may stay. So each row of costs follows from the row before, for all
repetitions at once.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from enum import StrEnum
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inspector.reference.levels import HIGHEST, HOP, SIGNALS, Levels, Octaves
from inspector.text import counted
from inspector.verdict import Evidence, Finding
from noiseclassifier import Event
from noisemodel.types import Array

PAD = 20  # frames for which a repetition is held before its start and after its end: delays
# Cost of a frame that is skipped or held, in squared standard deviations of the motion.
STEP_COST = 1e-3
# Largest cost of a frame before the start or after the end, in squared standard deviations.
OUTSIDE = 0.36
# Frames by which a path advances, by the code in `came`: odd codes come from a frame that was held;
# the last one waits at an end.
STEPS = np.array([1, 1, 2, 2, 0])
# Cells of a matrix of costs. Of longer runs every second frame is aligned, and so on; then so many
# frames at once, near the path of these.
LARGEST, BLOCK = 4_000_000, 200
# Added to the standard deviation of each joint's positions, in [rad]: what is no motion.
STILL = 0.05
SLOPE = (0.85, 1.18)  # speeds of a repetition within which levels are comparable
REACH = 10  # frames to each side over which that speed is taken
# Difference of positions up to which two moments are of one motion, in standard deviations.
RESIDUAL = 0.6
NEIGHBOURS = 3  # frames to each side among which a reference may be loudest
# Root mean square below which nothing is compared, in [rad/s]: less is hardly ever detectable.
FLOOR = 3e-3
# The same as a share of the loudest level of the joint's octave in the references, and beside other
# motions, whose contacts are at other speeds.
FLOOR_SHARE, OTHERS_FLOOR = 0.1, 0.3
CELLS = 2  # largest cells whose mean is the score of a frame
# Difference of speeds up to which moments of other motions count, in standard deviations; how many
# of them are the reference.
NEAR, NEAREST = 1.0, 60
APART = 1.0  # time from which moments of one motion stand for moments of another, in [s]
ROWS = 256  # frames that are compared at once
POOL = 12_000  # most frames of other motions that are looked at
ASSUMED_DB = 6.0  # margin where repeatability is not known: one repetition alone
LEAST_DB = 4.0  # least margin: levels of half a step and alignments of half a frame are not exact
RATE = 0.01  # share of good runs that the extrapolated margin lets exceed it
# Exceedances this close together are one finding, in [s]: after an impact the motion differs.
GAP = 1.0
# Share of a run that has to lie on a scenario's motion to be of it, and the same if it has its
# name and the motion of no other: a fault may end the motion early.
SAME_MOTION, SAME_NAME = 0.8, 0.2
# Time and share of its scenario by which a run may be longer or shorter without a word.
LONGER, SHARE_LONGER = 0.5, 0.1
CUT = 0.02  # relative difference of upper edges up to which two octaves are one: within 0.3 dB
WHOLE = 0.9  # share of a run's band that is compared, from which on nothing is said
ALIKE = 0.9  # share of the best one's from which another scenario is of the same motion, too
Real32 = NDArray[np.float32]


class Kind(StrEnum):
    """Kinds of evidence, the best first."""

    REPETITIONS = "repetitions"
    OTHER_MOTIONS = "other motions"
    GENERAL = "general"


@dataclass(frozen=True)
class Expected:
    """A finding that a scenario wants, or waives until a day; what is not stated is any."""

    label: str = ""
    start: float = float("-inf")  # earliest onset, in [s]
    stop: float = float("inf")  # latest end, in [s]
    joints: tuple[str, ...] = ()  # one of which is the loudest
    loudest_db: float | None = None  # highest level of a cell, in [dB re 1 rad/s]
    required: bool = False
    reason: str = ""
    until: date | None = None  # last day of a waiver

    def covers(self, event: Event, begin: float = 0.0) -> bool:
        """Whether it is about a finding in a run that begins at a time, in [s]."""
        inside = self.start <= event.start - begin and event.stop - begin <= self.stop
        return self.label in ("", event.label) and inside


@dataclass(frozen=True, eq=False)
class Scenario:
    """A motion with its accepted repetitions, the newest last; one at least."""

    name: str
    repetitions: tuple[Levels, ...]
    scores_db: tuple[float, ...] = ()  # leave-one-out
    elsewhere_db: tuple[float, ...] = ()  # by other moments: how well other motions predict
    required: bool = True
    at_least: int = 1  # logs that must exist if it is required
    wanted: tuple[Expected, ...] = ()
    waive: tuple[Expected, ...] = ()
    accepted: date | None = None
    by: str = ""
    reason: str = ""

    @property
    def duration(self) -> tuple[float, float]:
        """Shortest and longest repetition, in [s]."""
        every = [each.duration for each in self.repetitions]
        return min(every), max(every)


@dataclass(frozen=True)
class Margin:
    """From how many decibels over the reference on a moment is a finding."""

    db: float
    assumed: bool = False  # as repeatability is not known

    def __str__(self) -> str:
        return f"margin {self.db:.1f} dB{' assumed' if self.assumed else ''}"


def margin_of(scores: Sequence[float]) -> Margin:
    """The margin by the leave-one-out scores of fault-free runs, in [dB]."""
    found = np.sort([score for score in scores if np.isfinite(score)])
    if len(found) < 2:
        return Margin(ASSUMED_DB, assumed=True)
    low = float(np.median(found))
    excess = max(1.0, float(np.mean(found[found >= low] - low)))
    # Exponential tail: half of the scores exceed the median.
    db = low + excess * np.log(0.5 / RATE)
    return Margin(max(LEAST_DB, float(db)))


class Exceedance(NamedTuple):
    """A stretch that is louder than its reference, in [s], and its loudest exceedance."""

    start: float
    stop: float
    evidence: Evidence


def _place(octave: tuple[float, float], run: Levels) -> int:
    """Place of an octave in a run whose rate may be a little different; -1 without."""
    low, high = octave
    fits = (o[0] == low and abs(o[1] / high - 1) <= CUT for o in run.octaves)
    return next((place for place, fit in enumerate(fits) if fit), -1)


@dataclass(frozen=True)
class Cells:
    """Joints and octaves that are compared."""

    joints: tuple[str, ...]
    octaves: Octaves

    @classmethod
    def shared(
        cls, run: Levels, others: Sequence[Levels], by: Callable[[Iterable[bool]], bool] = all
    ) -> "Cells":
        """Those of a run that all others have, or any."""
        joints = tuple(j for j in run.joints if by(j in each.joints for each in others))
        bands = tuple(o for o in run.octaves if by(_place(o, each) >= 0 for each in others))
        return cls(joints, bands)

    def of(self, run: Levels) -> Real32:
        """Levels of a run, shape (frames, joints, 2, octaves); NaN of those that it lacks."""
        if (self.joints, self.octaves) == (run.joints, run.octaves):
            return run.level
        joints = [run.joints.index(each) if each in run.joints else -1 for each in self.joints]
        octaves = [_place(octave, run) for octave in self.octaves]
        # What it lacks is taken from one more joint or octave, at the end.
        padded = np.pad(run.level, ((0, 0), (0, 1), (0, 0), (0, 1)), constant_values=np.nan)
        return np.asarray(padded[:, joints][..., octaves])

    def noise(self, run: Levels) -> Array:
        """Level of a run's velocities, all joints and octaves, shape (frames,); NaN without any."""
        power = np.nansum(10.0 ** (self.of(run)[:, :, 0] / 10), axis=(1, 2), dtype=np.float64)
        return np.asarray(10 * np.log10(np.where(power > 0.0, power, np.nan)))


@dataclass(frozen=True, eq=False)
class Comparison:
    """A run beside its reference, in the joints and octaves that are compared."""

    run: Levels
    joints: tuple[str, ...]
    octaves: Octaves  # [Hz]
    scenarios: tuple[str, ...]  # whose motion it is
    repetitions: int  # of these that are compared
    kind: NDArray[np.object_]  # evidence of each frame, a `Kind`, shape (frames,)
    # Exceedance of each cell, shape (frames, joints, 2, octaves), in [dB]; NaN without reference.
    over: Real32
    score: Array  # of each frame, in [dB]; NaN without reference
    margins: Mapping[Kind, Margin]
    quieter: float  # than each repetition, in [dB]; 0 if it is not
    # Level of the noise of the quietest and of the loudest repetition at each frame, shape
    # (frames, 2), in [dB re 1 rad/s]; NaN without.
    band: Array
    remarks: tuple[str, ...]  # what is not compared, and why, a sentence each

    @property
    def empty(self) -> bool:
        """Whether nothing can be compared."""
        return not len(self.time) or not self.joints or not self.octaves

    @property
    def noise(self) -> Array:
        """Level of the run's noise in the joints and octaves that are compared, as in the band."""
        return Cells(self.joints, self.octaves).noise(self.run)

    @property
    def time(self) -> Array:
        """Middle of each frame, shape (frames,), in [s]."""
        return self.run.time

    @property
    def by_joint(self) -> Real32:
        """Loudest exceedance of each joint, shape (frames, joints), in [dB]; NaN without any."""
        return np.asarray(np.fmax.reduce(self.over, axis=(2, 3), initial=np.nan))

    @property
    def peaks(self) -> Array:
        """Loudest exceedance of each joint, shape (joints,), in [dB]; minus infinity without."""
        over = np.nan_to_num(self.by_joint, nan=-np.inf)
        pairs = np.minimum(over[:-1], over[1:])  # one frame alone is no evidence
        return np.asarray(pairs.max(axis=0, initial=-np.inf), dtype=np.float64)

    def loudest(self, count: int) -> list[int]:
        """Places of the joints that are most over the reference, in their order."""
        return sorted(np.argsort(-self.peaks, kind="stable")[:count].tolist())

    @cached_property
    def exceedances(self) -> tuple[Exceedance, ...]:
        """Stretches that are over the margin, in order of time."""
        run, cells = self.run, Cells(self.joints, self.octaves)
        limits = {kind: margin.db for kind, margin in self.margins.items()}
        limit = np.array([limits.get(kind, np.inf) for kind in self.kind])
        loud = np.flatnonzero(np.nan_to_num(self.score, nan=-np.inf) > limit)
        if not len(loud):
            return ()
        time, level, found = run.time, cells.of(run), list[Exceedance]()
        for group in np.split(loud, np.flatnonzero(np.diff(loud) * HOP > GAP) + 1):
            exceeded = np.nan_to_num(self.over[group], nan=-np.inf)
            place = np.unravel_index(exceeded.argmax(), exceeded.shape)
            frame, joint, signal, octave = map(int, place)
            row = group[frame]
            cell = self.joints[joint], SIGNALS[signal], self.octaves[octave]
            over, peak = round(float(exceeded.max()), 2), round(float(time[row]), 4)
            level_db = round(float(level[row, joint, signal, octave]), 2)
            evidence = Evidence(str(self.kind[row]), over, peak, *cell, level_db)
            # A frame reaches 0.1 s to each side; what is loud in it begins about its middle.
            start = max(run.start, time[group[0]] - HOP)
            stop = min(run.start + run.duration, time[group[-1]] + HOP)
            found.append(Exceedance(float(start), float(stop), evidence))
        return tuple(found)

    @property
    def worst(self) -> float:
        """The largest score, in [dB]; NaN without any reference."""
        return _top(self.score)

    def share(self, kind: Kind) -> float:
        """Share of the frames that have an evidence."""
        return float(np.mean(self.kind == kind)) if len(self.kind) else 0.0

    def covered(self, event: Finding) -> bool:
        """Whether a reference covers all frames of a finding, in its joint and up to its band.

        The frames are those whose middle lies in it, or the nearest.
        """
        inside = (self.time >= event.start) & (self.time <= event.stop)
        if not inside.any() and len(inside):
            inside[np.abs(self.time - (event.start + event.stop) / 2).argmin()] = True
        known, cells = event.localisation, Cells(self.joints, self.octaves)
        if known is None and (self.joints, self.octaves) != (self.run.joints, self.run.octaves):
            return False
        joint = known.joints[0][0] if known is not None and known.joints else None
        low = known.band[0] if known is not None and known.band else 0.0
        joints = [joint in (None, each) for each in self.joints]
        octaves = [high > low for _, high in self.octaves]
        parts = (of[inside][:, joints][..., octaves] for of in (cells.of(self.run), self.over))
        own, over = (np.any(np.isfinite(part), axis=3) for part in parts)
        # The reference has to have tracking errors if the run has.
        whole = np.any(over, axis=(1, 2)) & np.all(over[:, :, 1] >= own[:, :, 1], axis=1)
        return bool(inside.any() and (whole & np.isfinite(self.score[inside])).all())

    def __str__(self) -> str:
        number, names = counted(self.repetitions, "repetition"), " and ".join(self.scenarios)
        words = {
            Kind.REPETITIONS: f"{number} of {names}",
            Kind.OTHER_MOTIONS: "other motions of this robot",
            Kind.GENERAL: "the general model alone",
        }
        shown = [kind for kind in Kind if self.share(kind)]
        by = {kind: f" ({self.margins[kind]})" if kind in self.margins else "" for kind in shown}
        return "; ".join(f"{self.share(kind):.0%} by {words[kind]}{by[kind]}" for kind in shown)


def compare(run: Levels, scenarios: Sequence[Scenario]) -> Comparison:
    """Compare a run with its reference."""
    known = [each for each in scenarios if robot_fits(run, each)]
    cells, remarks = _common(run, known, scenarios)
    frames, over = len(run.guide), np.full_like(cells.of(run), np.nan)
    kind = np.full(frames, Kind.GENERAL, dtype=object)
    margins: dict[Kind, Margin] = {}
    matched, aligned, told = _matching(run, known)
    remarks += told
    quieter, band = 0.0, np.full((frames, 2), np.nan)
    if aligned:
        quieter = _quieter(run, aligned, cells)
        noise = [np.where(at.same, cells.noise(each)[at.frame], np.nan) for each, at in aligned]
        band = np.stack((np.fmin.reduce(noise), np.fmax.reduce(noise)), axis=1)
        over, covered = _over_repetitions(run, aligned, cells)
        kind[covered & bool(over.size)] = Kind.REPETITIONS
        margins[Kind.REPETITIONS] = margin_of([db for each in known for db in each.scores_db])
        longest = max(each.duration for each, _ in aligned)
        if run.duration > longest + max(LONGER, SHARE_LONGER * longest):
            lasts = f"longer than its scenario, {run.duration:.1f} of {longest:.1f} s"
            remarks.append(f"{lasts}: the rest is compared with other motions")
    left = np.flatnonzero(kind == Kind.GENERAL)
    others = _repetitions([each for each in known if each not in matched] or matched)
    if over.size and len(left) and others:
        found = _over_others(run, left, others, cells)
        covered = np.asarray(np.isfinite(found).any(axis=(1, 2, 3)))
        over[left[covered]] = found[covered]
        kind[left[covered]] = Kind.OTHER_MOTIONS
        margins[Kind.OTHER_MOTIONS] = margin_of([db for each in known for db in each.elsewhere_db])
    return Comparison(
        run,
        cells.joints,
        cells.octaves,
        tuple(each.name for each in matched),
        len(aligned) if over.size else 0,
        kind,
        over,
        scores_of(over),
        margins,
        quieter,
        band,
        tuple(remarks),
    )


def leave_one_out(repetitions: Sequence[Levels]) -> tuple[float, ...]:
    """Score of each repetition by the others, in [dB], if they cover it."""
    found = []
    for run in repetitions:
        others = [e for e in repetitions if e is not run and set(run.joints) & set(e.joints)]
        cells = Cells.shared(run, others)
        aligned = _aligned(run, others)
        if aligned:
            found.append(_top(scores_of(_over_repetitions(run, aligned, cells)[0])))
    return tuple(score for score in found if np.isfinite(score))


def leave_one_moment_out(repetitions: Sequence[Levels]) -> tuple[float, ...]:
    """Score of each repetition by other moments of all, as if these were other motions, in [dB]."""
    found = []
    for run in repetitions:
        cells, rows = Cells.shared(run, repetitions), np.arange(len(run.guide))
        over = _over_others(run, rows, repetitions, cells, apart=APART)
        found.append(_top(scores_of(over)))
    return tuple(score for score in found if np.isfinite(score))


# --- which runs belong together


def robot_fits(run: Levels, scenario: Scenario) -> bool:
    """Whether a scenario may be of the robot: the same name if both have one, and a joint."""
    newest = scenario.repetitions[-1]
    same = not run.robot or not newest.robot or run.robot == newest.robot
    return same and bool(set(run.joints) & set(newest.joints))


def _common(
    run: Levels, known: Sequence[Scenario], accepted: Sequence[Scenario]
) -> tuple[Cells, list[str]]:
    """Joints and octaves that can be compared, and what cannot."""
    if not known:
        own, *others = (
            f"{each.robot or 'a robot'} with{' joints ' if each.joints else 'out joints'}"
            f"{', '.join(each.joints[:3])}"
            for each in (run, *(scenario.repetitions[-1] for scenario in accepted))
        )
        there = " or ".join(sorted(set(others))) or "nothing"
        return Cells((), ()), [f"no reference: it is of {there}, and the run of {own}"]
    every = _repetitions(known)
    cells, remarks = Cells.shared(run, every, any), []
    lacking = [joint for joint in run.joints if joint not in cells.joints]
    known_errors = {joint for each in every for joint in each.tracked}
    untracked = [j for j in cells.joints if j in run.tracked and j not in known_errors]
    for what, joints in (("joints", lacking), ("tracking errors of", untracked)):
        if joints:
            remarks.append(f"no reference for {what} {', '.join(joints[:5])}")
    top = cells.octaves[-1][1] if cells.octaves else 0.0
    if top < WHOLE * HIGHEST * run.rate:
        told = f"compared up to {top:.0f} Hz" if top else "no octave is compared"
        rates = sorted({each.rate for each in every if abs(each.rate / run.rate - 1) > CUT})
        shown = ", ".join(f"{rate:g}" for rate in rates[:3])
        differ = f": the run has {run.rate:g} Hz, the reference {shown} Hz" if rates else ""
        remarks.append(told + differ)
    return cells, remarks


def _matching(run: Levels, known: Sequence[Scenario]) -> tuple[list[Scenario], "Paths", list[str]]:
    """Scenarios of the run's motion, of several the one with its name; repetitions; a remark."""
    usable = [each for each in known if len(each.repetitions[-1].guide)]
    own: tuple[list[Scenario], Paths] = [], []
    for name in (run.apart, run.name):
        named = [each for each in usable if each.name == name]
        aligned = _aligned(run, _repetitions(named))
        share = aligned[-1][1].share if aligned else 0.0
        # A run that lies on the motion of its name needs no other scenario.
        if share >= SAME_MOTION:
            return named, aligned, []
        if share >= SAME_NAME and not own[0]:
            own = named, aligned
    # Nothing is aligned where no joint is shared.
    shares = [path.share for _, path in _aligned(run, [each.repetitions[-1] for each in usable])]
    least = max(SAME_MOTION, ALIKE * max(shares, default=0.0))
    found = [each for each, share in zip(usable, shares, strict=False) if share >= least]
    aligned = _aligned(run, _repetitions(found))
    if not aligned:
        return *own, []
    told, names = [], ", ".join(each.name for each in found)
    if run.name in [each.name for each in usable]:
        told = [f"its motion is that of {names}, not that of {run.name}"]
    elif len(found) > 1:
        told = [f"its motion is that of {names}, and its name is of none: all count"]
    return found, aligned, told


def _repetitions(scenarios: Sequence[Scenario]) -> list[Levels]:
    return [each for scenario in scenarios for each in scenario.repetitions]


def share_of_motion(run: Levels, other: Levels) -> float:
    """Share of a run that lies on the motion of another."""
    aligned = _aligned(run, [other])
    return aligned[0][1].share if aligned else 0.0


# --- exceedances


def scores_of(over: Real32) -> Array:
    """Score of each frame, shape (frames,), in [dB]; NaN without reference."""
    own = np.full(len(over), np.nan)
    if not over.size:
        return own
    flat = over.reshape(len(over), -1)
    for first in range(0, len(flat), ROWS):
        known = flat[first : first + ROWS]
        known = np.where(np.isnan(known), -np.inf, known)
        top = -np.partition(-known, min(CELLS, known.shape[1]) - 1, axis=1)[:, :CELLS]
        finite = np.isfinite(top).all(axis=1)
        own[first : first + ROWS] = np.where(finite, top.mean(axis=1), np.nan)
    around = np.fmax(np.append(np.nan, own[:-1]), np.append(own[1:], np.nan))
    return np.asarray(np.where(np.isnan(own), np.nan, np.fmin(own, around)))


def _top(score: Array) -> float:
    return float(np.fmax.reduce(score, initial=np.nan))


def _floor(references: Sequence[Levels], cells: Cells, share: float = FLOOR_SHARE) -> Real32:
    """Power below which nothing is compared, shape (joints, 2, octaves), in [rad²/s²]."""
    tops = [np.fmax.reduce(cells.of(each), axis=0, initial=np.nan) for each in references]
    power = 10 ** (np.fmax.reduce(tops, axis=0).astype(np.float64) / 10)
    return np.asarray(np.fmax(FLOOR**2, share**2 * power), dtype=np.float32)


def _raised(level: Real32, floor: Real32) -> Real32:
    """Levels with the floor added, in [dB]."""
    return np.asarray(10 * np.log10(10 ** (level / 10) + floor), dtype=np.float32)


def _spread(level: Real32) -> Real32:
    """The loudest within some frames to each side; NaN where none is known."""
    loud = level.copy()
    for shift in range(1, NEIGHBOURS + 1):
        loud[shift:] = np.fmax(loud[shift:], level[:-shift])
        loud[:-shift] = np.fmax(loud[:-shift], level[shift:])
    return loud


def _over_repetitions(
    run: Levels, aligned: "Paths", cells: Cells
) -> tuple[Real32, NDArray[np.bool_]]:
    """Exceedance over the loudest repetition, NaN without one, and frames that one covers."""
    own = cells.of(run)
    loudest = np.full_like(own, np.nan)
    for each, path in aligned:
        loud = _spread(cells.of(each))[path.frame]
        loud[~path.same] = np.nan
        np.fmax(loudest, loud, out=loudest)
        del loud  # as large as a run
    floor = _floor([each for each, _ in aligned], cells)
    over = _raised(own, floor) - _raised(loudest, floor)
    return over, np.any([path.same for _, path in aligned], axis=0)


def _over_others(
    run: Levels,
    rows: NDArray[np.int64],
    references: Sequence[Levels],
    cells: Cells,
    apart: float = 0.0,
) -> Real32:
    """Exceedance over moments of other motions with about the same speeds; NaN without one.

    Velocities contain the desired motion, which is another one: tracking errors count where they
    are known.
    """
    mine = cells.of(run)[rows]
    found = np.full_like(mine, np.nan)
    shared = [j for j in cells.joints if all(j in each.guided for each in (run, *references))]
    frames = sum(len(each.guide) for each in references)
    if not shared or not frames:
        return found
    every = -(-frames // POOL)
    speed = np.concatenate(
        [each.speed[::every, [each.joints.index(j) for j in shared]] for each in references]
    )
    time = np.concatenate([(each.time - each.start)[::every] for each in references])
    level = np.concatenate([_spread(cells.of(each))[::every] for each in references])
    scale = speed.std(axis=0) + 0.05
    wanted = run.speed[rows][:, [run.joints.index(j) for j in shared]] / scale
    speed, when = speed / scale, run.time[rows] - run.start
    floor, count = _floor(references, cells, OTHERS_FLOOR), min(NEAREST, len(speed))
    for first in range(0, len(rows), ROWS):
        own = slice(first, first + ROWS)
        part = wanted[own]
        square = (part**2).mean(1)[:, None] + (speed**2).mean(1) - 2 * part @ speed.T / len(scale)
        if apart:
            square[np.abs(when[own, None] - time) < apart] = np.inf
        near = np.argpartition(square, count - 1, axis=1)[:, :count].copy()  # the rest is large
        close = np.take_along_axis(square, near, axis=1) <= NEAR**2
        loudest = np.full_like(mine[own], np.nan)
        for place in range(count):  # one by one: levels of all of them are large
            loud = level[near[:, place]]
            loud[~close[:, place]] = np.nan
            np.fmax(loudest, loud, out=loudest)
        found[own] = _raised(mine[own], floor) - _raised(loudest, floor)
    tracked = np.isfinite(found[:, :, 1]).any(axis=(0, 2))
    found[:, tracked, 0] = np.nan
    return found


def _quieter(run: Levels, aligned: "Paths", cells: Cells) -> float:
    """By how much the loudest levels of the run are below those of each repetition, in [dB]."""
    floor, margins = _floor([each for each, _ in aligned], cells), []
    own = cells.of(run)
    for repetition, path in aligned:
        both = cells.of(repetition)[path.frame[path.same]], own[path.same]
        tops = [_raised(np.fmax.reduce(of, axis=0, initial=np.nan), floor) for of in both]
        margins.append(_top(scores_of((tops[0] - tops[1])[None])))
    return max(0.0, min((each for each in margins if np.isfinite(each)), default=0.0))


# --- alignment


@dataclass(frozen=True, eq=False)
class Aligned:
    """Where each frame of a run lies in a repetition."""

    frame: NDArray[np.int64]  # of the repetition, shape (frames,)
    # Largest difference of positions in any joint, in standard deviations of the motion, shape
    # (frames,); infinite where the speeds differ too much.
    residual: Array

    @property
    def same(self) -> NDArray[np.bool_]:
        """Whether the frame is of the same motion."""
        return np.asarray(self.residual <= RESIDUAL)

    @property
    def share(self) -> float:
        """Share of the run that lies on the motion."""
        return float(np.mean(self.same))


Paths: TypeAlias = list[tuple[Levels, Aligned]]
Held: TypeAlias = tuple[Array, Array]  # slow positions, and the largest cost of each frame


def _aligned(run: Levels, others: Sequence[Levels]) -> Paths:
    """Where the run lies in each of the others, by joints whose motion all have; or nowhere.

    What is shorter than a frame lies nowhere. Positions count from zero if some are integrated.
    """
    others = [each for each in others if len(each.guide)]
    runs = (run, *others)
    shared = [j for j in run.guided if all(j in each.guided for each in others)]
    if not shared or not len(run.guide):
        return []
    places = [[each.joints.index(j) for j in shared] for each in runs]
    guides = [each.guide[:, at].astype(np.float64) for each, at in zip(runs, places, strict=True)]
    if any(each.guided_by.endswith("velocities") for each in runs):
        firsts = [each.first[at] for each, at in zip(runs, places, strict=True)]
        guides = [guide - first for guide, first in zip(guides, firsts, strict=True)]
    return list(zip(others, align(guides[0], guides[1:]), strict=True))


def align(run: Array, repetitions: Sequence[Array]) -> list[Aligned]:
    """Find the frames of repetitions that belong to each frame of a run.

    Slow positions have shape (frames, joints), with the same joints in all runs.
    """
    if not len(repetitions):
        return []
    scale = np.stack([each.std(axis=0) for each in repetitions]).max(axis=0) + STILL
    run, longest = run / scale, max(map(len, repetitions)) + 2 * PAD
    thin = int(np.ceil(np.sqrt(len(run) * longest / LARGEST)))
    pad = -(-PAD // thin) * thin  # thinned, both have their first frames
    longer = [np.pad(each / scale, ((pad, pad), (0, 0)), mode="edge") for each in repetitions]
    most = [np.pad(np.full(len(e), np.inf), pad, constant_values=OUTSIDE) for e in repetitions]
    held = list(zip(longer, most, strict=True))
    thinned = [(_means(other, thin), costs[::thin]) for other, costs in held]
    paths = _paths(_means(run, thin), thinned, [pad // thin] * len(held))
    if thin > 1:
        at, nodes = np.arange(len(run)), np.arange(0, len(run), thin)
        rough = [np.interp(at, nodes, path * thin).astype(np.int64) for path in paths]
        paths = _refined(run, held, np.stack(rough), 3 * thin)
    frames, found = np.arange(len(run)), []
    low, high = np.maximum(frames - REACH, 0), np.minimum(frames + REACH, len(run) - 1)
    time = high - low
    for path, other, repetition in zip(paths, longer, repetitions, strict=True):
        residual = np.abs(run - other[path]).max(axis=1)
        inside = (path >= pad) & (path < pad + len(repetition))
        # Whether both are about equally fast around each frame; one more or less is rounding.
        advance = path[high] - path[low]
        comparable = (advance >= SLOPE[0] * time - 1) & (advance <= SLOPE[1] * time + 1)
        residual[inside & ~comparable] = np.inf
        found.append(Aligned(np.clip(path - pad, 0, len(repetition) - 1), residual))
    return found


def _means(positions: Array, size: int) -> Array:
    """Means of so many frames at a time: every second one alone would alias."""
    firsts = np.arange(0, len(positions), size)
    sizes = np.diff(np.append(firsts, len(positions)))
    return np.asarray(np.add.reduceat(positions, firsts, axis=0) / sizes[:, None])


def _refined(
    run: Array, held: Sequence[Held], rough: NDArray[np.int64], reach: int
) -> NDArray[np.int64]:
    """Paths of all frames of a run within some frames of rough ones, block by block."""
    found = np.empty_like(rough)
    for first in range(0, len(run), BLOCK):
        rows = slice(max(0, first - reach), first + BLOCK + reach)
        begin, end = rough[:, rows][:, [0, -1]].T
        low = np.maximum(begin - reach, 0)
        near = [
            (other[start:stop], most[start:stop])
            for (other, most), start, stop in zip(held, low, end + reach + 1, strict=True)
        ]
        path = low[:, None] + _paths(run[rows], near, begin - low)
        found[:, first : first + BLOCK] = path[:, first - rows.start :][:, :BLOCK]
    return found


def _paths(
    run: Array, held: Sequence[Held], begin: Sequence[int] | NDArray[np.int64]
) -> NDArray[np.int64]:
    """Frame of each repetition for each frame of a run, by the likely first ones."""
    lengths, rows = [len(other) for other, _ in held], len(run)
    count, width = len(held), max(lengths)
    distance = np.full((rows, count, width), np.inf, dtype=np.float32)
    for place, (other, most) in enumerate(held):
        square = (run**2).mean(axis=1)[:, None] + (other**2).mean(axis=1)
        square -= 2 * run @ other.T / run.shape[1]
        distance[:, place, : len(other)] = np.clip(square, 0.0, most)
    edges = np.array([[0, length - 1] for length in lengths]) + width * np.arange(count)[:, None]
    # moved: the path came from another frame; stayed: from the same one, which it may only once.
    moved = distance[0] + STEP_COST * np.abs(np.arange(width) - np.array(begin)[:, None])
    stayed = np.full((count, width), np.inf)
    came = np.zeros((rows, count, width), dtype=np.uint8)
    # Two columns before the first frame, so that the frames before one are parts of these.
    before = np.full((count, width + 2), np.inf)
    was_held = np.zeros((count, width + 2), dtype=np.uint8)
    for row in range(1, rows):
        np.minimum(moved, stayed, out=before[:, 2:])
        np.less(stayed, moved, out=was_held[:, 2:])
        one, two = before[:, 1:-1], before[:, :-2] + STEP_COST
        came[row] = np.where(two < one, 2 + was_held[:, :-2], was_held[:, 1:-1])
        stayed = distance[row] + moved + STEP_COST
        moved = distance[row] + np.minimum(one, two)
        at_edges, steps = moved.ravel(), came[row].ravel()
        longer = stayed.ravel()[edges] < at_edges[edges]
        at_edges[edges[longer]] = stayed.ravel()[edges[longer]]
        steps[edges[longer]] = len(STEPS) - 1
    stay = stayed.min(axis=1) < moved.min(axis=1)
    at = np.where(stay, stayed.argmin(axis=1), moved.argmin(axis=1))
    path = np.zeros((rows, count), dtype=np.int64)
    for row in range(rows - 1, -1, -1):
        path[row] = at
        if row:
            code = came[row, np.arange(count), at]
            step = np.where(stay, 0, STEPS[code])
            stay = np.where(stay, False, code % 2 == 1)
            at = at - step
    return path.T
