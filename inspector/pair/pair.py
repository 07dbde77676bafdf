"""Two runs with what was found in each, sample beside sample."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import noisemodel as nm
from inspector.analysis.analyse import Analysis, analyse, robot_known, with_links
from inspector.library import Library
from inspector.logs.opening import Opened, open_run
from inspector.pair.alignment import Align, Alignment, align
from inspector.pair.common import alike, together
from noisemodel import robot as robots
from noisemodel.links import LinkNoise, vibrating
from noisemodel.types import Array, Mask

SIDES = ("before", "after")
TIMED = (
    "Findings at the same time are matched; `inspector diff` matches those of different motions by"
    " their class, at any time."
)


@dataclass(frozen=True, eq=False)
class Pair:
    """Two runs over the stretch of time that both cover.

    Attributes:
        before: The run before the change; its times are those of both.
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
    """Two runs, aligned and analysed.

    Args:
        before: A run, or the path of a run file or a log.
        after: Another.
        library: Models to choose from by rate.
        how: How they are aligned.
        robot: Whether to compare the robot's links, if both runs are of one that is known.
        kind: Kind of the extended noise, see ``noisemodel.extended``.

    Returns:
        The pair; both runs lie on the time axis of the first.

    Raises:
        RunFileError: If a file is damaged, or holds a run that is wrong.
        RobotError: If the robot cannot be read, or lacks one of the joints.
        InspectorError: If the robot's shape cannot be had, or the runs share no time.
    """
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
