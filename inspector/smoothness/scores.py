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
    BAND,
    CUTOFF,
    level_above,
    log_dimensionless_jerk,
    sparc,
    speed_of,
    squared_difference,
)
from noisemodel import Run
from noisemodel.differentiate import stretches
from noisemodel.types import Array, Real

FAST, TRACKED = 10.0, 4.0
"""Lowest frequencies of the level and of the tracking error, in [Hz]."""
POSITIONS, VELOCITIES = "positions", "velocities"
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
        log: Path of its log.
        episode: Its name within the log, empty if that holds one only.
        source: The argument of the command that it came from.
        duration: Of what was scored, in [s].
        rate: Of what was scored, in [Hz].
        scores: By name, in the order of ``SCORES``; None where there is none.
        reasons: Why a score is missing, by its name.
        quantities: What the scores of actions and of tracking are of, positions or velocities, by
            their names.
        remarks: What was decided, a sentence each.
    """

    log: str
    episode: str
    source: str
    duration: float
    rate: float
    scores: Mapping[str, float | None]
    reasons: Mapping[str, str] = field(default_factory=dict)
    quantities: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The log, and the episode within it."""
        return f"{self.log} episode {self.episode}" if self.episode else self.log


def scored(
    run: Run, log: str, *, episode: str = "", source: str = "", library: Library | None = None
) -> Episode:
    """Scores of a run.

    The longest stretch without a gap is scored, of a log with held values at the rate of its
    values. Velocities that were differentiated and smoothed during the import are replaced by first
    differences of the positions: the smoothing would take the chatter away.

    Args:
        run: The run.
        log: Path of its log.
        episode: Its name within the log, empty if that holds one only.
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
    quantities: dict[str, str] = {}
    action, quantity = _action(run, part)
    if action is None:
        reasons["action_rate"] = reasons["action_curvature"] = "the log has no desired motion"
    else:
        scores["action_rate"] = squared_difference(action)
        scores["action_curvature"] = squared_difference(action, order=2)
        reasons["action_rate"] = reasons["action_curvature"] = "too few actions"
        quantities |= {"action_rate": quantity, "action_curvature": quantity}
    scores["flagged"] = flagged
    error, quantity = _error(run, part)
    if error is None:
        reasons["tracking"] = "the log has no desired motion of its joints"
    else:
        scores["tracking"] = level_above(error, rate, TRACKED)
        reasons["tracking"] = _too_little(rate, duration, TRACKED)
        quantities["tracking"] = quantity
    missing = {name: reasons[name] for name, score in scores.items() if score is None}
    return Episode(
        log, episode, source, duration, rate, scores, missing, quantities, tuple(remarks)
    )


def _length(part: slice) -> int:
    return int(part.stop - part.start)


def _velocity(run: Run, part: slice) -> tuple[Array, str]:
    """Measured velocities, or first differences of positions, shape (samples, joints)."""
    if "velocity" not in run.meta.get("differentiated", {}) or run.position is None:
        return np.asarray(run.velocity[part], dtype=np.float64), ""
    velocity = np.diff(_angles(run.position[part]), axis=0) * run.rate
    return velocity, "Velocities are first differences of positions."


def _action(run: Run, part: slice) -> tuple[Array | None, str]:
    """What was commanded, once for each action, shape (actions, joints), and of what it is."""
    if run.position_desired is not None:
        action, quantity = _angles(run.position_desired[part]), POSITIONS
    elif run.velocity_desired is not None:
        action = np.asarray(run.velocity_desired[part], dtype=np.float64)
        quantity = VELOCITIES
    else:
        return None, ""
    held = round(hold_length(action, np.ones(len(action), dtype=bool)))
    if held < 2:
        return action, quantity
    changes = np.flatnonzero((action[1:] != action[:-1]).any(axis=1)) + 1
    return action[changes[0] % held :: held], quantity


def _error(run: Run, part: slice) -> tuple[Array | None, str]:
    """Tracking error of the joints that have a desired motion, and of what it is."""
    joints = [name for name in run.joint_names if name in run.desired_joint_names]
    measured = [run.joint_names.index(name) for name in joints]
    desired = [run.desired_joint_names.index(name) for name in joints]
    pairs = {
        POSITIONS: (run.position, run.position_desired),
        VELOCITIES: (run.velocity, run.velocity_desired),
    }
    for quantity, (actual, wanted) in pairs.items():
        if actual is not None and wanted is not None and joints:
            error = np.asarray(actual[part][:, measured] - wanted[part][:, desired], np.float64)
            return (_angles(error) if quantity == POSITIONS else error), quantity
    return None, ""


def _angles(position: Real) -> Array:
    """Positions without the jumps of angles that wrap, shape (samples, joints)."""
    return np.unwrap(np.asarray(position, dtype=np.float64), axis=0)


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
    if rate < 2 * BAND * frequency:
        return f"a log of {rate:g} Hz has too little above {frequency:g} Hz"
    return f"{duration:.3g} s are too short for {frequency:g} Hz"
