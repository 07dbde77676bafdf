"""Scores of an episode: all measures of one run, and why those are missing that it lacks."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from inspector.analysis.analyse import analyse
from inspector.analysis.status import Status
from inspector.audit.placeholder import without_placeholder
from inspector.hold import hold_length, without_hold
from inspector.library import Library
from inspector.smoothness.measures import (
    CUTOFF,
    level_above,
    log_dimensionless_jerk,
    sparc,
    speed_of,
    squared_difference,
)
from noisemodel import Run
from noisemodel.differentiate import stretches
from noisemodel.types import Array

FAST, TRACKED = 10.0, 4.0
"""Lowest frequencies of the level and of the tracking error, in [Hz]."""
STANDING = 0.01
"""Highest speed of an episode without motion: half a degree a second, in [rad/s]."""


@dataclass(frozen=True)
class Score:
    """A column of the table.

    Attributes:
        name: Its name in CSV, JSON and ``--by``.
        title: Head of its column.
        unit: Empty without one.
        meaning: What it is, in a few words.
        smooth: 1 if higher is smoother, -1 if higher is rougher.
    """

    name: str
    title: str
    unit: str
    meaning: str
    smooth: int = -1


_SCORES = (
    Score("level", f">{FAST:g} Hz", "rad/s", f"level of the velocities above {FAST:g} Hz"),
    Score("sparc", "SPARC", "", f"spectral arc length of the speed up to {CUTOFF:g} Hz", 1),
    Score("ldlj", "LDLJ", "", "log dimensionless jerk", 1),
    Score("action_rate", "action rate", "rad²", "mean square difference of successive actions"),
    Score("action_curvature", "2nd diff.", "rad²", "mean square second difference of actions"),
    Score("flagged", "flagged", "", "share of time with a finding of the classifier"),
    Score("tracking", f"error >{TRACKED:g} Hz", "rad", f"tracking error above {TRACKED:g} Hz"),
)
SCORES: Mapping[str, Score] = {score.name: score for score in _SCORES}
"""All scores by name, in the order of the columns."""


@dataclass(frozen=True)
class Episode:
    """An episode and its scores.

    Attributes:
        name: Its name.
        source: The argument of the command that it came from.
        duration: Of what was scored, in [s].
        rate: Of what was scored, in [Hz].
        scores: By name, in the order of ``SCORES``; None where there is none.
        reasons: Why a score is missing, by its name.
        remarks: What was decided, a sentence each.
    """

    name: str
    source: str
    duration: float
    rate: float
    scores: Mapping[str, float | None]
    reasons: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


def scored(run: Run, name: str, *, source: str = "", library: Library | None = None) -> Episode:
    """Scores of a run.

    The longest stretch without a gap is scored, of a log with held values at the rate of its
    values. Velocities that were differentiated and smoothed during the import are replaced by first
    differences of the positions: the smoothing would take the chatter away.

    Args:
        run: The run.
        name: Its name.
        source: The argument of the command that it came from.
        library: Models to choose from; None for no labels.

    Returns:
        The episode; a score that the run does not define is None, with the reason.
    """
    reasons: dict[str, str] = {}
    flagged = None
    if library is None:
        reasons["flagged"] = "not classified (--no-labels)"
    else:
        flagged, reasons["flagged"] = _flagged(run, library)
    run, left_out = without_placeholder(run)
    remarks = [left_out] if left_out else []
    slower = without_hold(run)
    if slower is not run:
        remarks.append(f"Values are held: scored at {slower.rate:g} Hz, their rate.")
    run = slower
    part = max(stretches(run.mask, len(run.time)), key=_length, default=slice(0, 1))
    if _length(part) < run.mask.sum():
        remarks.append("The longest stretch without a gap was scored.")
    velocity, how = _velocity(run, part)
    remarks += [how] if how else []
    rate, duration = run.rate, _length(part) / run.rate
    scores: dict[str, float | None] = dict.fromkeys(SCORES)
    scores["level"] = level_above(velocity, rate, FAST)
    reasons["level"] = _too_little(rate, duration, FAST)
    if len(velocity) and float(speed_of(velocity).max()) >= STANDING:
        scores["sparc"] = sparc(speed_of(velocity), rate)
        scores["ldlj"] = log_dimensionless_jerk(velocity, rate)
        reasons["sparc"] = reasons["ldlj"] = "the motion is too short, or has no jerk"
    else:
        reasons["sparc"] = reasons["ldlj"] = f"no joint is faster than {STANDING:g} rad/s"
    action = _action(run, part)
    if action is None:
        reasons["action_rate"] = reasons["action_curvature"] = "the log has no desired motion"
    else:
        scores["action_rate"] = squared_difference(action)
        scores["action_curvature"] = squared_difference(action, order=2)
        reasons["action_rate"] = reasons["action_curvature"] = "too few actions"
    scores["flagged"] = flagged
    scores["tracking"], reasons["tracking"], quantity = _tracking(run, part)
    remarks += [f"The tracking error is of {quantity}."] if quantity else []
    missing = {name: reasons[name] for name, score in scores.items() if score is None}
    return Episode(name, source, duration, rate, scores, missing, tuple(remarks))


def _length(part: slice) -> int:
    return int(part.stop - part.start)


def _velocity(run: Run, part: slice) -> tuple[Array, str]:
    """Measured velocities, or first differences of positions, shape (samples, joints)."""
    if "velocity" in run.meta.get("differentiated", {}) and run.position is not None:
        angles = np.unwrap(np.asarray(run.position[part], dtype=np.float64), axis=0)
        return np.diff(angles, axis=0) * run.rate, "Velocities are first differences of positions."
    return np.asarray(run.velocity[part], dtype=np.float64), ""


def _action(run: Run, part: slice) -> Array | None:
    """What was commanded, once for each action, shape (actions, joints): positions if there are."""
    if run.position_desired is not None:
        action = np.unwrap(np.asarray(run.position_desired[part], dtype=np.float64), axis=0)
    elif run.velocity_desired is not None:
        action = np.asarray(run.velocity_desired[part], dtype=np.float64)
    else:
        return None
    held = round(hold_length(action, np.ones(len(action), dtype=bool)))
    if held < 2:
        return action
    changes = np.flatnonzero((action[1:] != action[:-1]).any(axis=1)) + 1
    return action[changes[0] % held :: held]


def _tracking(run: Run, part: slice) -> tuple[float | None, str, str]:
    """Tracking error, why there is none, and of what it is: of positions if there are both."""
    joints = [name for name in run.joint_names if name in run.desired_joint_names]
    measured = [run.joint_names.index(name) for name in joints]
    desired = [run.desired_joint_names.index(name) for name in joints]
    pairs = {
        "positions, in rad": (run.position, run.position_desired),
        "velocities, in rad/s": (run.velocity, run.velocity_desired),
    }
    for quantity, (actual, wanted) in pairs.items():
        if actual is None or wanted is None or not joints:
            continue
        error = np.asarray(actual[part][:, measured], dtype=np.float64) - wanted[part][:, desired]
        if actual is run.position:
            error = np.unwrap(error, axis=0)
        reason = _too_little(run.rate, _length(part) / run.rate, TRACKED)
        return level_above(error, run.rate, TRACKED), reason, quantity
    return None, "the log has no desired motion of its joints", ""


def _flagged(run: Run, library: Library) -> tuple[float | None, str]:
    """Share of the labelled time with a finding, and why there is none."""
    found = analyse(run, library)
    if found.status is Status.CANNOT_TELL or found.labels is None:
        return None, found.reason.rstrip(".")
    covered = sum(stop - start for start, stop, _ in found.lane)
    total, end = 0.0, -np.inf
    for event in sorted(found.findings, key=lambda event: event.start):
        total += max(0.0, event.stop - max(event.start, end))
        end = max(end, event.stop)
    return (float(min(total / covered, 1.0)), "") if covered else (None, "no frame has a label")


def _too_little(rate: float, duration: float, frequency: float) -> str:
    """Why a log has no level above a frequency."""
    if rate < 2.4 * frequency:
        return f"a log of {rate:g} Hz has too little above {frequency:g} Hz"
    return f"{duration:.3g} s are too short for {frequency:g} Hz"
