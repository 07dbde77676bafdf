"""Two runs, before and after a change, on one time axis, sample beside sample.

All that is compared is first brought to the same samples, so that a run and itself differ by
exactly nothing. What is laid over each other is the envelope of the motion, the speed of all joints
together: it is there in every run, and does not need joints of the same names.
"""

from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import noisemodel as nm
from inspector.analysis import Analysis, analyse, robot_known, with_links
from inspector.errors import InspectorError
from inspector.library import Library
from inspector.logs.read import Opened, open_run
from noisemodel import Block, Run, decimated
from noisemodel import robot as robots
from noisemodel.noise import LinkNoise, vibrating
from noisemodel.run import part
from noisemodel.runfile import pieces
from noisemodel.types import Array, Mask, Real

CORRELATION = 0.6
"""Correlation of the envelopes below which an alignment is refused."""
ALIKE = 0.9
"""Correlation of envelopes from which two runs are of one motion: less is a motion like it."""
RIVAL = 0.95
"""Share of it that the next best lag may reach: steps and strokes resemble each other."""
STILL = 1e-9
"""Share of its size by which a motion has to change, to be more than rounding."""
SHARE = 0.5
"""Share of the shorter run that has to lie within the longer one."""


class Align(StrEnum):
    """How a run is laid beside another."""

    AUTO = "auto"
    START = "start"
    NONE = "none"


@dataclass(frozen=True)
class Alignment:
    """Where the run after starts on the time axis of the run before.

    Attributes:
        how: "auto" where their motions were laid over each other, "start" where their starts were,
            "none" where their clocks were taken as they are.
        lag: Samples that the run after starts later; negative if it starts earlier.
        seconds: The same in [s].
        correlation: Of the envelopes of their motions, at most 1; NaN where it was not computed.
        rival: That at the next best lag.
        refused: Whether "auto" was requested, and its correlation is too low or ambiguous.
    """

    how: Align
    lag: int
    seconds: float
    correlation: float = float("nan")
    rival: float = float("nan")
    refused: bool = False

    @property
    def alike(self) -> bool:
        """Whether both runs are known to be of one motion."""
        return self.how is Align.AUTO and self.correlation >= ALIKE

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
    """Find where a run lies on the time axis of another.

    Args:
        after: Another at the same rate; both have desired velocities, or none has.
        how: By their motion, from their starts, or by their clocks.
    """
    rate = before.rate
    if how is Align.START:
        return Alignment(how, 0, 0.0)
    if how is Align.NONE:
        lag = round(float(after.time[0] - before.time[0]) * rate)
        return Alignment(how, lag, lag / rate)
    lag, correlation, rival = _search(before, after)
    if correlation < CORRELATION or rival > RIVAL * correlation:
        return Alignment(Align.START, 0, 0.0, correlation, rival, refused=True)
    return Alignment(how, lag, lag / rate, correlation, rival)


def envelope(run: Run) -> Array:
    """Norm of the joint velocities, desired ones if there are any, shape (samples,).

    The desired motion is the better guide: a defect changes what is measured.
    """
    velocity = run.velocity if run.velocity_desired is None else run.velocity_desired
    power = np.empty(len(velocity))
    for rows in pieces(velocity):
        part = velocity[rows]
        power[rows] = np.einsum("ij,ij->i", part, part, dtype=np.float64)
    return np.sqrt(power)


def _search(before: Run, after: Run) -> tuple[int, float, float]:
    """Find the lag of the highest correlation, that, and the next best."""
    from scipy import fft

    lags = np.arange(1 - len(after.time), len(before.time))
    length = fft.next_fast_len(len(lags), real=True)
    first, second = (_powers(run, length) for run in (before, after))

    def crossed(power: int, other: int) -> Array:
        """Sum after[k]**other before[k + lag]**power over the k that both have, at each lag."""
        return np.asarray(fft.irfft(first[power] * np.conj(second[other]), length)[lags])

    count = np.maximum(np.round(crossed(0, 0)), 1.0)
    energies = [crossed(2, 0), crossed(0, 2)]
    least = [STILL * float(energy.max()) for energy in energies]
    spreads = [
        np.maximum(energy - total**2 / count, floor)
        for energy, total, floor in zip(
            energies, (crossed(1, 0), crossed(0, 1)), least, strict=True
        )
    ]
    # Pearson's correlation over what both have at each lag, gaps left out (Padfield, CVPR 2010).
    product = crossed(1, 1) - crossed(1, 0) * crossed(0, 1) / count
    scale = np.maximum(np.sqrt(spreads[0] * spreads[1]), np.finfo(np.float64).tiny)
    known = min(int(run.mask.sum()) for run in (before, after))
    enough = count >= min(SHARE * known, count.max())
    lags, correlation = lags[enough], (product / scale)[enough]
    best = int(np.argmax(correlation))
    below = np.flatnonzero(correlation < 0.5 * correlation[best])
    left = below[below < best].max(initial=-1)
    right = below[below > best].min(initial=len(correlation))
    beyond = np.concatenate((correlation[: left + 1], correlation[right:]))
    # A peak without an end is as high elsewhere: a motion that only speeds up determines no lag.
    rival = beyond.max(initial=-1.0) if len(beyond) else correlation[best]
    return int(lags[best]), float(correlation[best]), float(rival)


def _powers(run: Run, length: int) -> list[NDArray[np.complex128]]:
    """Transform what is known of a run, its envelope, and the square of that."""
    from scipy import fft

    speed, mask = envelope(run), run.mask
    size = float(np.sqrt(np.mean(speed[mask] ** 2))) if mask.any() else 0.0
    mean = float(speed[mask].mean()) if mask.any() else 0.0
    level = (speed - mean) * mask
    level[np.abs(level) < STILL * size] = 0.0  # rounding is no motion
    return [fft.rfft(signal, length) for signal in (mask.astype(np.float64), level, level**2)]


SAME_RATE = 1e-3
"""Rates that differ by less are one."""
REMARKED = 0.005
"""Time from which on a stretch that is left out is remarked on, in [s]."""


def alike(before: Run, after: Run) -> tuple[Run, Run, tuple[str, ...]]:
    """Two runs with the signals and the rate that both have."""
    remarks = []
    for field, name in (
        ("velocity_desired", "desired velocities"),
        ("base_velocity", "a base velocity"),
    ):
        having = [run for run in (before, after) if getattr(run, field) is not None]
        if len(having) == 1:
            which = "before" if having[0] is before else "after"
            remarks.append(f"Only the run {which} has {name}: they are left out of both.")
            nothing: dict[str, Any] = {field: None}
            before, after = replace(before, **nothing), replace(after, **nothing)
    rate = min(before.rate, after.rate)
    for which, run in (("before", before), ("after", after)):
        if run.rate > rate * (1 + SAME_RATE):
            remarks.append(
                f"The run {which} is decimated from {run.rate:g} Hz to the {rate:g} Hz of the"
                " other, without its efforts."
            )
    before, after = (_at_rate(run, rate) for run in (before, after))
    return before, after, tuple(remarks)


def together(before: Run, after: Run, alignment: Alignment) -> tuple[Run, Run, tuple[str, ...]]:
    """Cut two runs to the stretch that both cover, on the time axis of the first."""
    first = max(0, alignment.lag)
    stop = min(len(before.time), len(after.time) + alignment.lag)
    if stop - first < 2:
        raise PairError(
            f"before lasts {before.duration:.2f} s, and after starts"
            f" {alignment.seconds:+.2f} s from it: they share no time; `--align start` lays their"
            " starts beside each other"
        )
    time = before.time[first:stop]
    cut_before = _cut(before, first, stop, time)
    cut_after = _cut(after, first - alignment.lag, stop - alignment.lag, time)
    remarks = [
        f"The run {which} has {run.duration - cut.duration:.2f} s that the other one has not:"
        " they are not compared."
        for which, run, cut in (("before", before, cut_before), ("after", after, cut_after))
        if run.duration - cut.duration >= REMARKED
    ]
    return cut_before, cut_after, tuple(remarks)


def _at_rate(run: Run, rate: float) -> Run:
    """Decimate a run, but keep the positions that its links are placed by."""
    if run.rate <= rate * (1 + SAME_RATE):
        return run
    lower = decimated(run, rate)
    nearest = np.round(np.arange(len(lower.time)) * run.rate / rate).astype(int)
    nearest = np.minimum(nearest, len(run.time) - 1)

    def at(signal: Real | None) -> Real | None:
        return None if signal is None else signal[nearest]

    return replace(
        lower,
        position=at(run.position),
        position_desired=at(run.position_desired),
        base_pose=at(run.base_pose),
    )


def _cut(run: Run, first: int, stop: int, time: Array) -> Run:
    """A part of a run, with other times; blocks are moved and cut with it."""
    shift, begin, end = float(time[0] - run.time[first]), float(time[0]), float(time[-1])
    moved = [
        Block(max(block.start + shift, begin), min(block.stop + shift, end), block.label)
        for block in run.blocks
    ]
    blocks = tuple(block for block in moved if block.start < block.stop)
    return part(run, first, stop, time=time, blocks=blocks)


class PairError(InspectorError):
    """Two runs that cannot be laid beside each other."""


SIDES = ("before", "after")
TIMED = "Findings at the same time are matched; for runs of other motions, use `inspector diff`."


@dataclass(frozen=True, eq=False)
class Pair:
    """Two runs over the stretch of time that both cover.

    Attributes:
        before: The run before the change; both have its times.
        after: The run after the change.
        alignment: How they were laid beside each other.
        remarks: What is not compared and why, a sentence each.
    """

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
    def vibration(self) -> tuple[Array, Array]:
        """The noise above 10 Hz of both, each of shape (samples,), in [rad/s]; 0 in gaps."""
        fast = (
            vibrating(side.noise[:, None], self.valid, self.rate)[:, 0] for _, side in self.sides
        )
        return next(fast), next(fast)

    @property
    def links(self) -> tuple[LinkNoise, LinkNoise] | None:
        """Noise of the links of both; None unless both are of one robot."""
        if self.before.links is None or self.after.links is None:
            return None
        return self.before.links, self.after.links


def compare(
    before: Opened | Path,
    after: Opened | Path,
    library: Library,
    *,
    how: Align = Align.AUTO,
    robot: bool = True,
    kind: str = "normal",
) -> Pair:
    """Two runs, aligned and analysed."""
    opened = [run if isinstance(run, Opened) else open_run(run) for run in (before, after)]
    one, other, remarks = alike(*(each.run for each in opened))
    alignment = align(one, other, how)
    one, other, left_out = together(one, other, alignment)
    missing = _no_links(one, other) if robot else ""
    sides = [
        _analysed(each, run, library, kind=kind if robot and not missing else "")
        for each, run in zip(opened, (one, other), strict=True)
    ]
    remarked = dict.fromkeys(remark for side in sides for remark in side.remarks)
    both = [(remark, [remark in side.remarks for side in sides]) for remark in remarked]
    return Pair(
        before=sides[0],
        after=sides[1],
        alignment=alignment,
        remarks=(
            *remarks,
            *left_out,
            *([missing] if missing else []),
            *([TIMED] if not alignment.alike and any(side.findings for side in sides) else []),
            *(f"{_who(*has)}: {remark}" for remark, has in both),
        ),
    )


def _who(before: bool, after: bool) -> str:
    return "Both" if before and after else "Before" if before else "After"


def _analysed(opened: Opened, run: nm.Run, library: Library, *, kind: str) -> Analysis:
    """Analyse a part of a run; its links too, if a kind of noise is named."""
    found = analyse(run, library, name=opened.source.shown.stem, sha256=opened.sha256)
    return replace(with_links(found, kind), missing=(), assumed=opened.assumed)


def _no_links(before: nm.Run, after: nm.Run) -> str:
    """Why the links of two runs cannot be compared; empty if they can."""
    for which, run in zip(SIDES, (before, after), strict=True):
        if not robot_known(run):
            named = "names no robot" if run.robot is None else f"names {run.robot!r}, not known"
            return f"Links are not compared: the run {which} {named}."
        if run.position is None:
            return f"Links are not compared: the run {which} has no positions."
    assert before.robot is not None
    assert after.robot is not None
    if before.robot != after.robot and (
        robots.locate(before.robot).read_bytes() != robots.locate(after.robot).read_bytes()
    ):
        return f"Links are not compared: {before.robot} and {after.robot} are two robots."
    return ""
