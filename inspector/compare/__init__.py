"""Two runs, before and after a change, on one time axis: what changed, and both as a recording.

All that is compared is first brought to the same samples, so that a run and itself differ by
exactly nothing. What is laid over each other is the envelope of the motion, the speed of all joints
together: it is there in every run, and does not need joints of the same names.
"""

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from pathlib import Path

import numpy as np
import rerun as rr

from inspector import colors
from inspector.analysis import Analysis, analyse, robot_known, with_links, worst_joint, worst_signal
from inspector.errors import InspectorError, Status
from inspector.levels import FLOOR_DB, SPECTRUM, STEP, Spectrogram, spectrogram
from inspector.library import Library
from inspector.logs.read import Opened, open_run
from inspector.recording import panels, robot, views
from inspector.recording.panels import CHANGE, HIGH_DB, LOW_DB, Plotted, found_stretches
from inspector.recording.run import log_report, writing
from inspector.recording.views import Label, Panel, Part, Timed
from inspector.report import classes_of, spoken
from noiseclassifier import Event
from noiseclassifier.matching import spans_of, union
from noisemodel import Block, Robot, Run, decimated
from noisemodel import robot as robots
from noisemodel.noise import LinkNoise, decibel, simplified, vibrating
from noisemodel.run import part
from noisemodel.types import Array, Mask

CORRELATION = 0.6  # correlation of the envelopes below which an alignment is refused
RIVAL = 0.95  # share of it that the next best lag may reach: steps and strokes resemble each other
STILL = 1e-9  # share of its size by which a motion has to change, to be more than rounding
SHARE = 0.5  # share of the shorter run that has to lie within the longer one


class Align(StrEnum):
    """How a run is laid beside another."""

    AUTO = "auto"
    START = "start"
    NONE = "none"


@dataclass(frozen=True)
class Alignment:
    """Where the run after starts on the time axis of the run before."""

    how: Align  # what was done, which is START where the motions determine no lag
    lag: int  # samples that the run after starts later; negative if it starts earlier
    seconds: float  # the same
    correlation: float = float("nan")  # of the envelopes of their motions; NaN if not computed
    rival: float = float("nan")  # that at the next best lag

    @property
    def refused(self) -> bool:
        """Whether the motions determine no lag."""
        return self.how is Align.START and not np.isnan(self.correlation)

    def __str__(self) -> str:
        measured = f"correlation {self.correlation:.2f}, next best {self.rival:.2f}"
        if self.refused:
            return f"from the start: the motions do not determine the lag ({measured})"
        if self.how is Align.AUTO:
            return f"by the motion: after starts {self.seconds:+.4f} s from before ({measured})"
        if self.how is Align.START:
            return "from the start, as requested"
        return f"by the clocks, as requested: after starts {self.seconds:+.4f} s from before"


def align(before: Run, after: Run, how: Align = Align.AUTO) -> Alignment:
    """Find where a run lies on the time axis of another at the same rate, with the same signals."""
    rate = before.rate
    if how is Align.START:
        return Alignment(how, 0, 0.0)
    if how is Align.NONE:
        lag = round(float(after.time[0] - before.time[0]) * rate)
        return Alignment(how, lag, lag / rate)
    lag, correlation, rival = _search(before, after)
    if correlation < CORRELATION or rival > RIVAL * correlation:
        return Alignment(Align.START, 0, 0.0, correlation, rival)
    return Alignment(how, lag, lag / rate, correlation, rival)


def _search(before: Run, after: Run) -> tuple[int, float, float]:
    """Find the lag of the highest correlation, that, and the next best."""
    from scipy.signal import correlate

    first, second = _powers(before), _powers(after)

    def crossed(power: int, other: int) -> Array:
        """Sum after[k]**other before[k + lag]**power over the k that both have, at each lag."""
        return np.asarray(correlate(first[power], second[other], method="fft"))

    count = np.maximum(np.round(crossed(0, 0)), 1.0)
    totals, energies = (crossed(1, 0), crossed(0, 1)), (crossed(2, 0), crossed(0, 2))
    spread, other_spread = (
        np.maximum(energy - total**2 / count, STILL * float(energy.max()))
        for total, energy in zip(totals, energies, strict=True)
    )
    # Pearson's correlation over what both have at each lag, gaps left out (Padfield, CVPR 2010).
    product = crossed(1, 1) - totals[0] * totals[1] / count
    scale = np.maximum(np.sqrt(spread * other_spread), np.finfo(np.float64).tiny)
    known = min(int(run.mask.sum()) for run in (before, after))
    enough = count >= min(SHARE * known, count.max())
    lags = np.arange(1 - len(after.time), len(before.time))[enough]
    correlation = (product / scale)[enough]
    best = int(np.argmax(correlation))
    below = np.flatnonzero(correlation < 0.5 * correlation[best])
    left = below[below < best].max(initial=-1)
    right = below[below > best].min(initial=len(correlation))
    beyond = np.concatenate((correlation[: left + 1], correlation[right:]))
    # A peak without an end is as high elsewhere: a motion that only speeds up determines no lag.
    rival = beyond.max(initial=-1.0) if len(beyond) else correlation[best]
    return int(lags[best]), float(correlation[best]), float(rival)


def _powers(run: Run) -> tuple[Array, Array, Array]:
    """What is known of a run, its envelope less its mean, and the square of that.

    The envelope is the norm of the joint velocities, desired ones if there are any: they are the
    better guide, as a defect changes what is measured.
    """
    velocity = run.velocity if run.velocity_desired is None else run.velocity_desired
    speed, mask = simplified(velocity), run.mask
    level = (speed - speed[mask].mean()) * mask
    size = np.sqrt(np.mean(speed[mask] ** 2))
    level[np.abs(level) < STILL * size] = 0.0  # rounding is no motion
    return mask.astype(np.float64), level, level**2


SIDES = ("before", "after")
SAME_RATE = 1e-3  # rates that differ by less are one
REMARKED = 0.005  # time from which on a stretch that is left out is remarked on, in [s]


def alike(before: Run, after: Run) -> tuple[Run, Run, tuple[str, ...]]:
    """Two runs with the signals and the rate that both have."""
    sides, remarks = [before, after], []
    for field, name in (
        ("velocity_desired", "desired velocities"),
        ("base_velocity", "a base velocity"),
    ):
        having = [getattr(run, field) is not None for run in sides]
        if sum(having) == 1:
            which, nothing = SIDES[having.index(True)], {field: None}
            remarks.append(f"Only the run {which} has {name}: they are left out of both.")
            sides = [replace(run, **nothing) for run in sides]  # type: ignore[arg-type]
    rate = min(before.rate, after.rate)
    for place, run in enumerate(sides):
        if run.rate > rate * (1 + SAME_RATE):
            rates = f"from {run.rate:g} Hz to the {rate:g} Hz of the other"
            without = "without its positions and efforts"
            remarks.append(f"The run {SIDES[place]} is decimated {rates}, {without}.")
            sides[place] = decimated(run, rate)
    return sides[0], sides[1], tuple(remarks)


def together(before: Run, after: Run, alignment: Alignment) -> tuple[Run, Run, tuple[str, ...]]:
    """Cut two runs to the stretch that both cover, on the time axis of the first."""
    first = max(0, alignment.lag)
    stop = min(len(before.time), len(after.time) + alignment.lag)
    if stop - first < 2:
        apart = f"before lasts {before.duration:.2f} s, and after starts {alignment.seconds:+.2f} s"
        advice = "`--align start` lays their starts beside each other"
        raise InspectorError(f"{apart} from it: they share no time; {advice}")
    time, lag = before.time[first:stop], alignment.lag
    cut = _cut(before, first, stop, time), _cut(after, first - lag, stop - lag, time)
    remarks = tuple(
        f"The run {which} has {more:.2f} s that the other one has not: they are not compared."
        for which, run, own in zip(SIDES, (before, after), cut, strict=True)
        if (more := run.duration - own.duration) >= REMARKED
    )
    return *cut, remarks


def _cut(run: Run, first: int, stop: int, time: Array) -> Run:
    """A part of a run, with other times; blocks are moved and cut with it."""
    shift, begin, end = float(time[0] - run.time[first]), float(time[0]), float(time[-1])
    moved = [(max(b.start + shift, begin), min(b.stop + shift, end), b.label) for b in run.blocks]
    blocks = tuple(Block(*each) for each in moved if each[0] < each[1])
    return part(run, first, stop, time=time, blocks=blocks)


TIMED = "Findings at the same time are matched; for runs of other motions, use `inspector diff`."


@dataclass(frozen=True, eq=False)
class Pair:
    """Two runs over the stretch of time that both cover, and what is not compared and why."""

    before: Analysis
    after: Analysis
    alignment: Alignment
    remarks: tuple[str, ...]

    @property
    def sides(self) -> tuple[tuple[str, Analysis], tuple[str, Analysis]]:
        """Both with what they are called."""
        return (SIDES[0], self.before), (SIDES[1], self.after)

    @property
    def rate(self) -> float:
        """Of both, in [Hz]."""
        return float(self.before.run.rate)

    @property
    def time(self) -> Array:
        """Of both, shape (samples,), in [s]."""
        return self.before.run.time

    @cached_property
    def valid(self) -> Mask:
        """The samples that lie in a gap of neither, shape (samples,)."""
        return self.before.run.mask & self.after.run.mask

    @cached_property
    def vibration(self) -> list[Array]:
        """The motion above 10 Hz of both, each of shape (samples,), in [rad/s]; 0 in gaps."""
        motions = [side.run.motion for _, side in self.sides]
        fast = (vibrating(each, self.valid, self.rate) for each in motions)
        return [np.sqrt(np.square(each).sum(axis=1)) for each in fast]

    @property
    def links(self) -> tuple[LinkNoise, LinkNoise] | None:
        """Noise of the links of both; None unless both are of one robot."""
        before, after = self.before.links, self.after.links
        return None if before is None or after is None else (before, after)


def compare(
    before: Opened | Path,
    after: Opened | Path,
    library: Library,
    *,
    how: Align = Align.AUTO,
    robot: bool = True,
) -> Pair:
    """Two runs, aligned and analysed."""
    opened = [run if isinstance(run, Opened) else open_run(run) for run in (before, after)]
    one, other, remarks = alike(*(each.run for each in opened))
    alignment = align(one, other, how)
    one, other, left_out = together(one, other, alignment)
    missing = _no_links(one, other) if robot else ""
    sides = []
    for each, run in zip(opened, (one, other), strict=True):
        found = analyse(run, library, name=each.source.shown.stem, sha256=each.sha256)
        found = with_links(found, "normal" if robot and not missing else "")
        sides.append(replace(found, missing=(), assumed=each.assumed))
    told: dict[str, str] = {}
    for name, side in zip(("Before", "After"), sides, strict=True):
        told |= {remark: "Both" if remark in told else name for remark in side.remarks}
    timed = alignment.how is not Align.AUTO and any(side.findings for side in sides)
    of_both = *remarks, *left_out, *filter(None, (missing, TIMED if timed else ""))
    own = (f"{who}: {remark}" for remark, who in told.items())
    return Pair(sides[0], sides[1], alignment, remarks=(*of_both, *own))


def _no_links(before: Run, after: Run) -> str:
    """Why the robots of two runs are not shown; empty if they are."""
    for which, run in zip(SIDES, (before, after), strict=True):
        if not robot_known(run) or run.position is None:
            lacking = "positions" if robot_known(run) else "robot that is known"
            return f"The robots are not shown: the run {which} has no {lacking}."
    files = [robots.locate(run.robot).read_bytes() for run in (before, after) if run.robot]
    if before.robot != after.robot and files[0] != files[1]:
        return f"The robots are not shown: {before.robot} and {after.robot} are two robots."
    return ""


@dataclass(frozen=True)
class Level:
    """How loud both runs are, in [dB]; silence is at `FLOOR_DB`."""

    before: float
    after: float

    @property
    def change(self) -> float:
        """By how much it became louder, in [dB]."""
        return self.after - self.before


def spectra(pair: Pair, joint: str = "") -> list[Spectrogram]:
    """Spectrograms of both runs, of a joint above 10 Hz or of the noise; windows without a gap."""
    found = []
    for _, side in pair.sides:
        own = worst_signal(side, side.run.joint_names.index(joint)) if joint else side.noise
        each = spectrogram(own, pair.rate, start=float(pair.time[0]), valid=pair.valid)
        kept, amplitude = each.valid, each.amplitude[:, each.valid]
        found.append(replace(each, time=each.time[kept], amplitude=amplitude, valid=kept[kept]))
    return found


def steps(pair: Pair) -> tuple[Array, Array]:
    """Centres of steps of 50 ms in [s], and levels of both noises above 10 Hz, shape (steps, 2)."""
    size = max(1, round(STEP * pair.rate))
    firsts = np.arange(0, len(pair.time), size)
    counts = np.maximum(np.add.reduceat(pair.valid.astype(np.float64), firsts), 1.0)
    lengths = np.diff(np.append(firsts, len(pair.time)))
    power = [np.add.reduceat(fast**2, firsts) / counts for fast in pair.vibration]
    level = np.maximum(decibel(np.stack(power, axis=1)), FLOOR_DB)
    return pair.time[firsts] + (lengths - 1) / 2 / pair.rate, level


def within(pair: Pair, start: float, stop: float) -> Level:
    """The level of both noises, above 10 Hz, in a stretch of time, in [dB re 1 rad/s]."""
    first, last = (max(0, round((each - pair.time[0]) * pair.rate)) for each in (start, stop))
    count = max(int(pair.valid[first:last].sum()), 1)
    power = [np.sum(fast[first:last] ** 2) / count for fast in pair.vibration]
    return Level(*np.maximum(decibel(np.array(power)), FLOOR_DB).tolist())


def whole(pair: Pair) -> Level:
    """The level of both noises, above 10 Hz, in all of the time that they share."""
    return within(pair, float(pair.time[0]), float(pair.time[-1]) + 1 / pair.rate)


# Kinds of changes in the order in which they matter, each in the colour of the run that has it.
SHADES = {
    "new": colors.AFTER,
    "louder": colors.AFTER,
    "resolved": colors.BEFORE,
    "quieter": colors.BEFORE,
    "unchanged": views.INK,
}
KINDS = NEW, LOUDER, RESOLVED, QUIETER, UNCHANGED = tuple(SHADES)
LOUDER_DB = 3.0  # a failure in both runs whose level changed by as much is louder or quieter


@dataclass(frozen=True)
class Change:
    """A failure in either run, or in both at the same time, and how loud both are there."""

    kind: str
    label: str
    start: float
    stop: float
    level: Level

    def __str__(self) -> str:
        when = f"{self.start:.2f} s to {self.stop:.2f} s"
        return f"{self.kind}: {spoken(self.label)}, {when}, {self.level.change:+.1f} dB"


def changes(pair: Pair) -> tuple[Change, ...]:
    """Match the failures of two runs: their findings, or annotated blocks if one has no labels.

    Findings of one class that overlap or touch, whichever run they are of, are one failure. If both
    runs have a part in it, it is louder or quieter by 3 dB or more, or else unchanged; otherwise it
    is new or resolved.
    """
    both: list[list[Event | Block]] = [
        [*side.findings] if labelled(pair) else [b for b in side.run.blocks if b.label != "ok"]
        for _, side in pair.sides
    ]
    found = []
    for label in sorted({each.label for side in both for each in side}):
        own = [spans_of(each for each in side if each.label == label) for side in both]
        for start, stop in union(np.concatenate(own)).tolist():
            level, kind = within(pair, start, stop), UNCHANGED
            before, after = (((side[:, 0] >= start) & (side[:, 1] <= stop)).any() for side in own)
            if not (before and after):
                kind = RESOLVED if before else NEW
            elif abs(level.change) >= LOUDER_DB:
                kind = LOUDER if level.change > 0.0 else QUIETER
            found.append(Change(kind, label, start, stop, level))
    return tuple(sorted(found, key=lambda change: (change.start, change.stop, change.label)))


def largest_change(pair: Pair, found: Sequence[Change]) -> tuple[float, float]:
    """Start and stop of what is to be shown first, in [s].

    The failure whose level changed most, new before louder before resolved before quieter ones; of
    runs without such, the largest change of level.
    """
    changed = [each for each in found if each.kind != UNCHANGED]
    if changed:
        worst = min(changed, key=lambda each: (KINDS.index(each.kind), -abs(each.level.change)))
        return max(worst.start, float(pair.time[0])), min(worst.stop, float(pair.time[-1]))
    time, level = steps(pair)
    place = float(time[np.abs(level[:, 1] - level[:, 0]).argmax()])
    return place - STEP, place + STEP


def labelled(pair: Pair) -> bool:
    """Whether both runs could be labelled, so that findings are what is matched."""
    return pair.before.labels is not None and pair.after.labels is not None


def summary(pair: Pair) -> str:
    """The status of both runs and what changed, in a line."""
    found = changes(pair)
    what = "findings" if labelled(pair) else "annotated failures"
    events = f"{what}: {_counts(found)}" if found else "nothing found in either"
    statuses = f"{pair.before.status} → {pair.after.status}"
    return f"{statuses}; {events}; vibration {whole(pair).change:+.1f} dB"


def _counts(found: Sequence[Change]) -> str:
    count = Counter(change.kind for change in found)
    return ", ".join(f"{count[kind]} {kind}" for kind in KINDS if count[kind])


def report(pair: Pair) -> str:
    """The report of two runs, in Markdown."""
    parts = [f"### {pair.before.name} → {pair.after.name}", f"**{summary(pair)}**"]
    title = "finding" if labelled(pair) else "annotated"
    rows = [("", title, "time [s]", "before [dB]", "after [dB]", "change"), ("---",) * 6]
    for each in sorted(changes(pair), key=lambda change: (KINDS.index(change.kind), change.start)):
        when = f"{each.start:.2f} to {each.stop:.2f}"
        before, after = f"{each.level.before:.1f}", f"{each.level.after:.1f}"
        what, change = f"**{each.kind}**", f"{each.level.change:+.1f}"
        rows.append((what, spoken(each.label), when, before, after, change))
    if len(rows) > 2:
        parts.append("\n".join(f"| {' | '.join(cells)} |" for cells in rows))
    time, level = steps(pair)
    louder = level[:, 1] - level[:, 0]
    place = int(np.abs(louder).argmax())
    most = f"Largest change of level: **{louder[place]:+.0f} dB at {time[place]:.2f} s**."
    parts.append(most if louder[place] else "The level is the same at all times.")
    parts.append(f"Aligned {pair.alignment}. Levels above 10 Hz in dB re 1 rad/s.")
    if pair.remarks:
        parts += ["#### Remarks", "\n".join(f"- {remark}" for remark in pair.remarks)]
    return "\n\n".join(parts) + "\n"


# --- the recording

SIDE_COLORS = {"before": colors.BEFORE, "after": colors.AFTER}
NOISE_POINTS = 60_000  # of each run's noise
DETAILS = 184.0  # height of the panels that lie behind each other
LEVEL, CHANGED, NOISE_PANEL = Panel("level", 118.0), Panel("change", 84.0), Panel("noise", DETAILS)
# Change of level at the upper end of its axis, in [dB], or a multiple where it is larger.
SPAN_DB = 24.0


def log_levels(recording: rr.RecordingStream, pair: Pair, found: Sequence[Change]) -> list[Timed]:
    """Log both levels every 50 ms, and their change, with what changed shaded."""
    time, level = steps(pair)
    changed = [(change.kind, change.start, change.stop) for change in found]
    panels.log_shades(recording, "/level/change", changed, SHADES, (LOW_DB, HIGH_DB))
    for place, (name, _) in enumerate(pair.sides):
        own, line = level[:, [place]], {name: SIDE_COLORS[name]}
        views.log_lines(recording, f"/level/{name}", time, own, line)
    views.log_beside(recording, LEVEL, panels.level_axis(), _sides())
    change = level[:, 1] - level[:, 0]
    peak = float(change[np.abs(change).argmax()])
    reach = SPAN_DB * max(float(np.ceil(abs(peak) / SPAN_DB)), 1.0)
    views.log_lines(recording, "/change/noise", time, change[:, None], {"noise": views.INK})
    nothing = {"none": colors.CLASSES["unknown"]}
    views.log_lines(recording, "/change/none", time[[0, -1]], np.zeros((2, 1)), nothing)
    panels.log_shades(recording, "/change/finding", changed, SHADES, (-reach, reach))
    ticks = (-reach / 2, 0.0, reach / 2)
    marks = [Label(0.5 + tick / reach / 2, views.written(tick), 44.0) for tick in ticks]
    signed = f"{peak:+.0f}".replace("-", "\u2212").replace("+0", "0")
    left, right = [Label(0.6, "change\n[dB]", -22.0), *marks], [Label(0.5, f"largest\n{signed}")]
    views.log_beside(recording, CHANGED, left, right)
    return [
        views.timed(LEVEL, title="Level", between=(LOW_DB, HIGH_DB)),
        views.timed(CHANGED, title="Change", between=(-reach, reach)),
    ]


def log_spectra(recording: rr.RecordingStream, pair: Pair, joint: str) -> list[Part]:
    """Log the spectrograms of a joint's velocity in both runs, and their difference."""
    both = spectra(pair, joint)
    if not len(both[0].time):
        return []
    time, edges, _ = panels.in_levels(both[0])
    level = [panels.in_levels(each)[2] for each in both]
    scale = SPECTRUM.following(np.stack(level))
    before, after = (np.maximum(each, scale.low) for each in level)
    shown = {"change": (after - before, CHANGE), "before": (before, scale), "after": (after, scale)}
    parts = []
    for what, (values, own) in shown.items():
        panel, axis = Panel(f"spectrum_{what}", DETAILS), f"{joint or 'noise'}\n{what}"
        path, title = f"/spectrogram/{what}", f"Spectrum{', ' if what == 'change' else ' '}{what}"
        panels.log_heat(recording, path, panel, (time, edges, values), own, axis)
        parts.append(views.timed(panel, path, name=title)[0])
    return parts


def _sides(*places: float) -> list[Label]:
    sides = zip(places or (0.75, 0.4), SIDE_COLORS.items(), strict=True)
    return [Label(place, name, color=color) for place, (name, color) in sides]


ROW, LEAST = 26.0, 50.0  # height of a class, and of all of them at least, in points
# From where to where in its row what was found and annotated is drawn, from above.
BETWEEN = {"before": ((0.06, 0.34), (0.37, 0.45)), "after": ((0.52, 0.80), (0.83, 0.91))}


def log_changes(recording: rr.RecordingStream, pair: Pair, found: Sequence[Change]) -> Timed:
    """Log found and annotated classes, and the changes."""
    both = [side for _, side in pair.sides]
    every = dict.fromkeys(name for side in both for name in classes_of(side) if name != "ok")
    there = {block.label for side in both for block in side.run.blocks}
    names = [n for n in every if n in there or any(found_stretches(side, n) for side in both)]
    panel = Panel("class", max(ROW * len(names), LEAST) + views.AXIS)
    for row, name in enumerate(names):
        for side, analysis in pair.sides:
            shades, place = (SIDE_COLORS[side], SIDE_COLORS[side]), (row, len(names))
            panels.log_class(recording, analysis, name, place, shades, BETWEEN[side], side)
    titles = views.row_labels(list(map(spoken, names)))
    told = _sides(0.8, 0.45)
    if any(side.run.blocks for _, side in pair.sides):
        told.append(Label(0.1, "thin: annotated"))
    views.log_beside(recording, panel, titles or [Label(0.5, "no failure\nin either run")], told)
    if found:
        listed = [(change.start, str(change), SHADES[change.kind]) for change in found]
        views.log_events(recording, listed, [change.kind == NEW for change in found])
    return views.timed(panel)


JOINT_POINTS = 2000  # points of a line: there are two for each signal of a joint


def log_joints(
    recording: rr.RecordingStream, pair: Pair, limbs: Mapping[str, tuple[str, ...]]
) -> list[Part]:
    """Log the joints' signals of both runs, paler before: tabs of limbs."""
    plots: dict[str, list[Plotted]] = {}
    for side, each in pair.sides:
        for signal in panels.signals(each.run):
            name = f"{'desired ' * signal.desired}{signal.kind}"
            path = f"/joints/{name.replace(' ', '_')}/{side}"
            drawn = (path, signal, each.run.mask, f" {side}", side == "before")
            plots.setdefault(f"{name} [{signal.unit}]", []).append(drawn)
    return panels.log_plots(recording, pair.time, plots, limbs, JOINT_POINTS)


KEY = Panel("key", 260.0)  # the scale beside the robots
ABOVE = 240.0  # least height of the report and the robots
TITLES = 28.0  # height of a row of tabs
ASPECT = 1.35  # least width of a robot's view by its height


def write(pair: Pair, path: Path, *, overwrite: bool = False) -> None:
    """Write the recording of two runs, whole or not at all.

    The same input makes a recording of the same id: opened again, it replaces itself.
    """
    parts = (pair.before.sha256, pair.after.sha256, str(pair.alignment.lag))
    identity = hashlib.sha256(" ".join(parts).encode()).hexdigest()
    found, time = changes(pair), pair.time
    loop = largest_change(pair, found)
    with writing(path, identity, overwrite=overwrite) as recording:
        views.log_span(recording, float(time[0]), float(time[-1]))
        after, robots = _log_robots(recording, pair)
        over_time = [log_changes(recording, pair, found), *log_levels(recording, pair, found)]
        details = _log_details(recording, pair, after)
        head = views.beside((_log_text(recording, pair, found), 34.0), *robots)
        whole = views.above((head, ABOVE), *over_time, (details, DETAILS + TITLES))
        recording.send_blueprint(views.blueprint(whole, loop))  # instead of an older layout


def _log_robots(recording: rr.RecordingStream, pair: Pair) -> tuple[Robot | None, list[Timed]]:
    """Log both robots, coloured by the levels of their links; the robot after, and the parts."""
    if pair.links is None:
        return None, []
    runs = {side: each.run for side, each in pair.sides}
    drawn, cameras = zip(*robot.log_robots(recording, runs, aspect=ASPECT), strict=True)
    panels.log_robot_levels(recording, list(zip(drawn, pair.links, strict=True)), KEY)
    seen = zip(SIDES, cameras, strict=True)
    shown = [(views.robot(f"Robot {side}", f"/robot_{side}", each), 29.0) for side, each in seen]
    return drawn[1].robot, [*shown, (views.drawing(f"/axis/{KEY.name}/right"), 8.0)]


def _log_details(recording: rr.RecordingStream, pair: Pair, after: Robot | None) -> Part:
    """Log what lies behind each other: spectra, noise, signals of joints."""
    worst = worst_joint(pair.after)
    joint = "" if worst is None else pair.after.run.joint_names[worst]
    parts = log_spectra(recording, pair, joint if joint in pair.before.run.joint_names else "")
    sides, shades = dict(pair.sides), list(SIDE_COLORS.values())
    ends = panels.log_noise(recording, NOISE_PANEL, sides, shades, _sides(), NOISE_POINTS)
    parts.append(views.timed(NOISE_PANEL, title="Noise", name="Noise", between=ends)[0])
    names = dict.fromkeys((*pair.after.run.joint_names, *pair.before.run.joint_names))
    limbs = panels.limbs(tuple(names), after)
    return views.tabs(*parts, *log_joints(recording, pair, limbs))


def _log_text(recording: rr.RecordingStream, pair: Pair, found: Sequence[Change]) -> Part:
    """Log the verdict and the report; they, with the list of changes behind the report."""
    properties = {
        "before_sha256": pair.before.sha256,
        "after_sha256": pair.after.sha256,
        "aligned": str(pair.alignment.how),
        "lag_s": pair.alignment.seconds,
        "rate_hz": pair.rate,
        "duration_s": pair.before.run.duration,
        "vibration_change_db": whole(pair).change,
    }
    log_report(recording, f"{pair.before.name} → {pair.after.name}", report(pair), properties)
    kinds = {change.kind for change in found}
    worse, better = kinds & {NEW, LOUDER}, kinds & {RESOLVED, QUIETER}
    told = f"{'WORSE' if worse else 'BETTER' if better else 'SAME'}   {_counts(found)}".strip()
    status = Status.FINDINGS if worse else Status.OK
    if not found and Status.CANNOT_TELL in (pair.before.status, pair.after.status):
        status, told = Status.CANNOT_TELL, "CANNOT TELL"
    verdict = views.log_verdict(recording, status, told)
    text = views.text("Before \u2192 after")
    if found:
        text = views.tabs(text, views.events("Changes"))
    return views.above(verdict, (text, ABOVE))
