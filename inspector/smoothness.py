"""How smooth the motion of episodes is: measures, scores, ranking and table.

`sparc` and `log_dimensionless_jerk` are dimensionless, at most 0, and higher the smoother, as their
authors have them; all others are 0 for the smoothest motion, and higher the rougher. A measure that
a signal does not define (it is too short, stands still, or its rate is too low) is None.

Sources:
    Hogan and Sternad, "Sensitivity of smoothness measures to movement duration, amplitude, and
    arrests", Journal of Motor Behavior 41, 2009.
    Balasubramanian, Melendez-Calderon, Roby-Brami and Burdet, "On the analysis of movement
    smoothness", Journal of NeuroEngineering and Rehabilitation 12, 2015.
"""

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path

import numpy as np

from inspector.errors import without_path
from inspector.logs.clocks import without_hold
from inspector.logs.read import Reading, Source, open_source, sources
from inspector.text import counted, progress
from inspector.verdict import EXPECTED
from noisemodel import Run
from noisemodel.hold import hold_length, updates
from noisemodel.noise import in_both
from noisemodel.run import derived, stretches
from noisemodel.types import Array, Real

FORMAT = "noise-smoothness/2"
FAST = 10.0  # lowest frequency of the level, in [Hz]
STANDING = 0.01  # highest speed of an episode without motion: half a degree a second, in [rad/s]
# Of SPARC: highest frequency in [Hz], least amplitude, powers of two of zero padding (2015).
CUTOFF, THRESHOLD, PADDING = 10.0, 0.05, 4
# Of the high-pass, applied forward and backward: its order, the least duration of a signal in
# periods of its frequency, the least ratio of the Nyquist frequency to its frequency.
ORDER, PERIODS, BAND = 4, 3, 1.2


# --- measures


def level_above(signal: Real, rate: float, frequency: float) -> float | None:
    """Root mean square of a signal above a frequency in [Hz], the squares summed over joints.

    Of velocities above 10 Hz it is our own measure, the noise of the joints where motion is over.
    The high-pass has the gain 1/2 at its frequency. None if the rate is below 2.4 times the
    frequency, or the signal shorter than three of its periods.
    """
    padding = round(PERIODS * rate / frequency)
    if rate < 2 * BAND * frequency or len(signal) <= padding:
        return None
    from scipy.signal import butter, sosfiltfilt

    sections = butter(ORDER, frequency, "highpass", fs=rate, output="sos")
    fast = sosfiltfilt(sections, np.asarray(signal, dtype=np.float64), axis=0, padlen=padding)
    return float(np.sqrt(np.square(fast).sum(axis=1).mean()))


def sparc(speed: Real, rate: float, *, cutoff: float = CUTOFF) -> float | None:
    """Spectral arc length of a speed profile (Balasubramanian et al., 2015).

    The negative length of the curve that the amplitude spectrum of the speed makes, from 0 to the
    last frequency below the cut-off at which it is 5 % of its largest value. Frequencies are
    divided by that last one, amplitudes by the largest one, so that neither the amplitude nor the
    duration of the motion counts. It is blind above the cut-off, and made for movements of a few
    seconds: a longer episode has a more negative one, however smooth it is. None if there are
    fewer than two samples, or no motion.

    Args:
        speed: Norm of a velocity, shape (samples,), in any unit.
    """
    if len(speed) < 2 or not np.any(speed):
        return None
    size = 2 ** (int(np.ceil(np.log2(len(speed)))) + PADDING)
    amplitude = np.abs(np.fft.rfft(speed, size))
    frequency = np.fft.rfftfreq(size, 1.0 / rate)
    inside = frequency <= cutoff
    amplitude, frequency = amplitude[inside] / amplitude.max(), frequency[inside]
    last = int(np.flatnonzero(amplitude >= THRESHOLD)[-1])
    if last == 0:
        return None
    # omega_c = min(cutoff, min(omega: V(r) < threshold for all r > omega)), Eq. 8 of 2015.
    steps = np.diff(frequency[: last + 1]) / frequency[last]
    return -float(np.sqrt(steps**2 + np.diff(amplitude[: last + 1]) ** 2).sum())


def log_dimensionless_jerk(velocity: Real, rate: float) -> float | None:
    """Log dimensionless jerk of a motion (Hogan and Sternad, 2009; Balasubramanian et al., 2015).

    -ln(T³ / v_peak² ∫ |d²v/dt²|² dt), with the norms over joints. A minimum-jerk movement from rest
    to rest has -ln(204.8) = -5.32. Jerk grows with the third power of frequency: noise counts as
    far up as the rate goes, so only logs of one rate and one kind of sensor can be compared. None
    if there are fewer than three samples, no motion, or no jerk.
    """
    if len(velocity) < 3:
        return None
    peak = np.square(velocity).sum(axis=1).max()
    jerk = np.diff(np.asarray(velocity, dtype=np.float64), n=2, axis=0) * rate**2
    mean = np.square(jerk).sum(axis=1).mean()  # times T: the integral
    if not peak or not mean:
        return None
    duration = (len(velocity) - 1) / rate
    return -float(np.log(duration**4 / peak * mean))


def squared_difference(action: Real, *, order: int = 1) -> float | None:
    """Mean square of the differences of successive actions, summed over joints.

    The first difference is the "action rate" that policies are penalised by in reinforcement
    learning; the second one passes constant rates. Both are per action, not per second. None if
    there are no more than ``order`` actions.
    """
    if len(action) <= order:
        return None
    differences = np.diff(np.asarray(action, dtype=np.float64), n=order, axis=0)
    return float(np.square(differences).sum(axis=1).mean())


def speed_of(velocity: Real) -> Array:
    """Norm of a velocity over joints, shape (samples,), of one of shape (samples, joints)."""
    return np.asarray(np.linalg.norm(np.asarray(velocity, dtype=np.float64), axis=1))


# --- scores of an episode


@dataclass(frozen=True)
class Score:
    """A column of the table."""

    name: str  # in CSV, JSON and ``--by``
    title: str  # head of its column
    unit: str
    meaning: str  # what it is, in a few words
    smooth: int = -1  # 1 if higher is smoother, -1 if higher is rougher


_SCORES = (
    Score("level", f">{FAST:g} Hz", "rad/s", f"level of the velocities above {FAST:g} Hz"),
    Score("sparc", "SPARC", "", f"spectral arc length of the speed up to {CUTOFF:g} Hz", 1),
    Score("ldlj", "LDLJ", "", "log dimensionless jerk", 1),
    Score("action_rate", "action rate", "rad²", "mean square difference of successive actions"),
    Score("action_curvature", "2nd diff.", "rad²", "mean square second difference of actions"),
)
# All scores by name, in the order of the columns.
SCORES: Mapping[str, Score] = {score.name: score for score in _SCORES}
# Scores by how well they separate chattering from clean rollouts (docs/metrics.md).
ORDERS = ("action_curvature", "level", "ldlj", "action_rate", "sparc")


@dataclass(frozen=True)
class Episode:
    """An episode and its scores."""

    log: str  # path of its log
    episode: str  # its name within a data set, empty in a log of its own
    duration: float  # of what was scored, in [s]
    rate: float  # of what was scored, in [Hz]
    scores: Mapping[str, float | None]  # in the order of ``SCORES``
    reasons: Mapping[str, str] = field(default_factory=dict)  # why a score is missing
    remarks: tuple[str, ...] = ()  # what was decided, a sentence each

    @property
    def name(self) -> str:
        """The log, and the episode within it."""
        return f"{self.log} episode {self.episode}" if self.episode else self.log


def scored(run: Run, log: str, *, episode: str = "") -> Episode:
    """Scores of a run; one that it does not define is None, with the reason.

    The longest stretch without a gap is scored, of a log with held values at the rate of its
    values. Velocities that were differentiated and smoothed during the import are replaced by first
    differences of the positions: the smoothing would take the chatter away.
    """
    remarks = []
    slower = without_hold(run)
    if slower is not run:
        remarks.append(f"Values are held: scored at {slower.rate:g} Hz, their rate.")
    run, rate = slower, slower.rate
    whole = stretches(run.mask, len(run.time))
    part = max(whole, key=lambda each: each.stop - each.start, default=slice(0, 1))
    samples = part.stop - part.start
    if samples < run.mask.sum():
        remarks.append("The longest stretch without a gap was scored.")
    if derived(run, "velocity") and run.position is not None and hold_length(run.position) <= 1:
        position = np.asarray(run.position[part], dtype=np.float64)
        velocity = np.diff(np.unwrap(position, axis=0), axis=0) * rate
        remarks.append("Velocities are first differences of positions.")
    else:
        velocity = np.asarray(run.velocity[part], dtype=np.float64)
    seconds = samples / rate
    found: dict[str, tuple[float | None, str]] = {}
    reason = f"{seconds:.3g} s are too short for {FAST:g} Hz"
    if rate < 2 * BAND * FAST:
        reason = f"a log of {rate:g} Hz has too little above {FAST:g} Hz"
    found["level"] = level_above(velocity, rate, FAST), reason
    speed = speed_of(velocity)
    if speed.max(initial=0.0) >= STANDING:
        reason = "the motion is too short, or has no jerk"
        found["sparc"] = sparc(speed, rate), reason
        found["ldlj"] = log_dimensionless_jerk(velocity, rate), reason
    else:
        found["sparc"] = found["ldlj"] = None, f"no joint is faster than {STANDING:g} rad/s"
    if run.position_desired is None:
        found["action_rate"] = found["action_curvature"] = None, "the log has no desired positions"
    else:
        action = _actions(run, part)
        found["action_rate"] = squared_difference(action), "too few actions"
        found["action_curvature"] = squared_difference(action, order=2), "too few actions"
    scores = {name: found[name][0] for name in SCORES}
    missing = {name: found[name][1] for name, score in scores.items() if score is None}
    return Episode(log, episode, seconds, rate, scores, missing, tuple(remarks))


def _actions(run: Run, part: slice) -> Array:
    """What was commanded, once for each action, shape (actions, joints).

    Commands of a joint whose measured positions jump by half a turn are angles that wrap.
    """
    assert run.position_desired is not None
    commanded = np.asarray(run.position_desired[part], dtype=np.float64)
    hold, places = updates(commanded)
    action = commanded[places.clip(min=0)] if hold > 1 else commanded
    wraps = np.ones(action.shape[1], dtype=bool)
    if run.position is not None:
        measured, desired = in_both(run)
        steps = np.abs(np.diff(run.position[part], axis=0))[:, measured]
        wraps[desired] = (steps > np.pi).any(axis=0)
    return np.where(wraps, np.unwrap(action, axis=0), action)


# --- episodes of logs


def scored_episodes(
    paths: Sequence[Path], reading: Reading
) -> tuple[list[Episode], list[tuple[str, str]]]:
    """Read and score the episodes of logs and folders; one that cannot be read stops no other.

    Also gives the name of each log and episode that cannot be read, and why, in one line.
    """
    found, unread = list[Source](), []
    for path in paths:
        try:
            found += sources([path], reading)[0]
        except EXPECTED as error:
            unread.append((str(path), without_path(error, path)))
    episodes, failed = [], []
    for each in progress(found, "score", total=len(found)):
        log, name = str(each.path), each.episode
        try:
            episodes.append(scored(open_source(each, reading).run, log, episode=name))
        except EXPECTED as error:
            shown = f"{log} episode {name}" if name else log
            failed.append((shown, without_path(error, each.path)))
    return episodes, failed + unread


# --- ranking


@dataclass(frozen=True)
class Ranking:
    """Episodes in order."""

    by: str  # the score that they are ordered by
    episodes: tuple[Episode, ...]  # the smoothest first; those without this score last
    failed: Sequence[tuple[str, str]] = ()  # name of what could not be read, and why

    @property
    def ranks(self) -> tuple[int | None, ...]:
        """Rank of each episode, from 1; equal scores have equal ranks, None without a score."""
        values = [episode.scores[self.by] for episode in self.episodes]
        return tuple(None if value is None else values.index(value) + 1 for value in values)


def default_order(episodes: Sequence[Episode]) -> str:
    """Name of the score that episodes are ordered by.

    Episodes of data sets, which are demonstrations and rollouts of policies, are ordered by their
    actions; logs by their measured velocities, since several often share one desired motion. A
    score is skipped if an episode lacks it, or if all have it equal.
    """
    actions = all(episode.episode for episode in episodes)
    names = ORDERS if actions else sorted(ORDERS, key=lambda name: name.startswith("action"))
    values = {name: {episode.scores[name] for episode in episodes} for name in names}
    known = [name for name in names if None not in values[name]]
    # The first that tells episodes apart, else the first that all have.
    return min(known, key=lambda name: len(values[name]) == 1, default="level")


def ranked(
    episodes: Sequence[Episode], failed: Sequence[tuple[str, str]] = (), *, by: str = ""
) -> Ranking:
    """Order episodes from the smoothest to the roughest, by default as `default_order` has it."""
    by = by or default_order(episodes)

    def roughness(episode: Episode) -> tuple[bool, float]:
        value = episode.scores[by]
        return value is None, 0.0 if value is None else -SCORES[by].smooth * value

    return Ranking(by, tuple(sorted(episodes, key=roughness)), failed)


def as_text(ranking: Ranking) -> str:
    """Write a ranking as a table, with what is missing and why below it."""
    episodes = ranking.episodes
    if not episodes:
        return "0 episodes"
    parts = [Path(episode.name).parts for episode in episodes]
    folders = zip(*(each[:-1] for each in parts), strict=False)
    shared = len(list(takewhile(lambda names: len(set(names)) == 1, folders)))
    rows = [
        ["rank", "episode", "duration", "rate", *(score.title for score in SCORES.values())],
        ["", "", "s", "Hz", *(score.unit for score in SCORES.values())],
    ]
    rows += [
        [
            "" if rank is None else str(rank),
            str(Path(*path[shared:])),
            f"{episode.duration:.2f}",
            f"{episode.rate:g}",
            *(_cell(score, value) for score, value in episode.scores.items()),
        ]
        for rank, path, episode in zip(ranking.ranks, parts, episodes, strict=True)
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [each.rjust(width) for each, width in zip(row, widths, strict=True)]
        cells[1] = row[1].ljust(widths[1])
        lines.append("  ".join(cells).rstrip())
    meaning = SCORES[ranking.by].meaning
    head = f"{counted(len(episodes), 'episode')}, the smoothest first by {meaning}"
    return "\n".join([head, "", *lines, "", *_notes(ranking)])


def as_json(ranking: Ranking) -> str:
    """Write a ranking as JSON; a score that is missing is null, with its reason."""
    document = {
        "format": FORMAT,
        "by": ranking.by,
        "scores": {
            score.name: {
                "meaning": score.meaning,
                "unit": score.unit,
                "smoother": "higher" if score.smooth > 0 else "lower",
            }
            for score in SCORES.values()
        },
        "settings": {
            "level_above_hz": FAST,
            "sparc_cutoff_hz": CUTOFF,
            "sparc_threshold": THRESHOLD,
            "sparc_padding": PADDING,
        },
        "episodes": [
            {
                "rank": rank,
                **{name: getattr(each, name) for name in ("log", "episode", "duration", "rate")},
                **each.scores,
                "missing": dict(each.reasons),
                "remarks": list(each.remarks),
            }
            for rank, each in zip(ranking.ranks, ranking.episodes, strict=True)
        ],
        "failed": dict(ranking.failed),
    }
    return json.dumps(document, indent=2, ensure_ascii=False)


def _notes(ranking: Ranking) -> Iterator[str]:
    """Say what is missing, what was decided, and what to look at, each once."""
    episodes = ranking.episodes
    for score in SCORES.values():
        reasons = [each.reasons[score.name] for each in episodes if score.name in each.reasons]
        if reasons:
            why = "; ".join(dict.fromkeys(reasons))
            yield f"{score.title}: empty for {len(reasons)} of {len(episodes)}, {why}"
    remarks = Counter(remark for episode in episodes for remark in episode.remarks)
    for remark, count in remarks.items():
        yield remark if count == len(episodes) else f"{count} of {len(episodes)}: {remark}"
    rates = sorted({episode.rate for episode in episodes})
    if len(rates) > 1:
        yield f"Rates differ ({rates[0]:g} to {rates[-1]:g} Hz): compare scores of one rate only."
    yield f"SPARC: cut-off {CUTOFF:g} Hz. SPARC and LDLJ: higher is smoother; others: lower."
    # What to look at: the roughest episode, or that all are equal.
    ordered = [each for each in episodes if each.scores[ranking.by] is not None]
    if len(ordered) < 2:
        return
    title, last = SCORES[ranking.by].title, ordered[-1]
    if ordered[0].scores[ranking.by] == last.scores[ranking.by]:
        yield f"All are equal by {title}: `--by` orders them by another score."
        return
    command = f"inspector import {last.log} --episode {last.episode} -o roughest.npz"
    yield f"The roughest by {title}: {command if last.episode else f'inspector view {last.log}'}"


def _cell(name: str, value: float | None) -> str:
    if value is None:
        return ""
    return f"{value:.2f}" if name in ("sparc", "ldlj") else f"{value:.3g}"
