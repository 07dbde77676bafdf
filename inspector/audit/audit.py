"""The audit: what a log can show, and what looks wrong with it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import models
from inspector.audit.bandwidth import Bandwidth, bandwidth
from inspector.audit.copies import copies
from inspector.audit.hold import held_for
from inspector.audit.sight import ClassSight, Sight, sights
from inspector.audit.units import unit_doubts
from inspector.library import for_robot, signals_of
from noisemodel import Run
from noisemodel.run import part


@dataclass(frozen=True)
class Gaps:
    """What is missing of a run.

    Attributes:
        count: Gaps.
        total: All of their time, in [s].
        longest: That of the longest, in [s].
    """

    count: int = 0
    total: float = 0.0
    longest: float = 0.0

    def __str__(self) -> str:
        """Say it in a clause."""
        if not self.count:
            return "no gaps"
        plural = "" if self.count == 1 else "s"
        return (
            f"{self.count} gap{plural}, {self.total:.3g} s in all, {self.longest:.3g} s the longest"
        )


@dataclass(frozen=True)
class Audit:
    """What a run can show.

    Attributes:
        rate: Sample rate, in [Hz].
        duration: In [s].
        joints: How many there are.
        jitter: Deviation of the stamps' steps before they were made uniform, root mean square and
            largest, in [s]; None where nobody noted it.
        gaps: What is missing.
        bandwidth: How far up it reaches.
        doubts: What looks wrong: units, copies, held or filtered signals; a clause each.
        notes: What is good to know of the signals; a clause each.
        classes: How well each failure class can be seen.
    """

    rate: float
    duration: float
    joints: int
    jitter: tuple[float, float] | None
    gaps: Gaps
    bandwidth: Bandwidth
    doubts: tuple[str, ...]
    notes: tuple[str, ...]
    classes: tuple[ClassSight, ...]

    @property
    def blind(self) -> bool:
        """Whether no failure class can be seen at all."""
        return all(each.sight is Sight.CANNOT_TELL for each in self.classes)


def audit(run: Run, library: Mapping[str, models.Classifier]) -> Audit:
    """Look at what a run can show.

    Gaps are counted everywhere; signals are looked at in an excerpt of the run.

    Args:
        run: The run.
        library: Models that might label it; what they look at is what can be seen.

    Returns:
        The audit.
    """
    part = excerpt(run)
    reach = bandwidth(part)
    return Audit(
        rate=run.rate,
        duration=run.duration,
        joints=len(run.joint_names),
        jitter=_jitter(run),
        gaps=gaps_of(run),
        bandwidth=reach,
        doubts=tuple(_doubts(part, reach)),
        notes=tuple(_notes(part, reach)),
        classes=sights(reach, run.mask, for_robot(library, run.robot), signals_of(part)),
    )


def _jitter(run: Run) -> tuple[float, float] | None:
    noted = run.meta.get("jitter")
    values = [noted.get(key) for key in ("rms", "max")] if isinstance(noted, Mapping) else []
    match values:
        case [float(rms), float(largest)]:
            return rms, largest
    return None


def _doubts(run: Run, reach: Bandwidth) -> Iterator[str]:
    yield from unit_doubts(run)
    for copy in copies(run):
        whose = "all joints" if len(copy.joints) == len(run.joint_names) else ", ".join(copy.joints)
        samples = f"{abs(copy.lag)} sample{'' if abs(copy.lag) == 1 else 's'}"
        when = f", {samples} {'later' if copy.lag > 0 else 'earlier'}" if copy.lag else ""
        yield f"measured {copy.signal} of {whose} is the desired one{when}: one is a copy"
    if reach.held > 1:
        yield (
            f"measured values are held for {reach.held:.3g} samples:"
            f" the log was {run.rate / reach.held:.4g} Hz once"
        )
    if reach.corner:
        yield f"velocities look filtered from {reach.corner:.3g} Hz on"


def _notes(run: Run, reach: Bandwidth) -> Iterator[str]:
    if reach.slope:
        yield (
            f"velocities are differentiated positions ({reach.slope.name}),"
            f" weak above {reach.slope.corner(run.rate):.3g} Hz"
        )
    if run.velocity_desired is None:
        yield "there is no desired motion"
    elif (held := held_for(run.velocity_desired, run.mask)) > 1:
        yield f"desired velocities are held for {held:.3g} samples ({run.rate / held:.4g} Hz)"
    if reach.drowned is not None:
        unit = "rad" if reach.slope else "rad/s"
        yield (
            f"above {reach.drowned:.3g} Hz there is hardly more than rounding to {reach.step:.2g}"
            f" {unit}, which hides oscillations up to {reach.hidden:.2g} rad/s"
        )
    elif reach.quiet is not None:
        yield (
            f"above {reach.quiet:.3g} Hz it is quieter than any encoder: filtered, or simulated"
            " without sensor noise"
        )


def gaps_of(run: Run) -> Gaps:
    """Count the stretches that a run marks as not valid.

    Args:
        run: The run.
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([True], run.mask, [True]))))
    lengths = np.diff(edges)[::2] / run.rate
    if not len(lengths):
        return Gaps()
    return Gaps(len(lengths), float(lengths.sum()), float(lengths.max()))


LONGEST = 60_000
"""Samples of an excerpt: a minute at 1 kHz."""


def excerpt(run: Run) -> Run:
    """Take the part of a run around its fastest motion, so that an hour costs what minutes do.

    Args:
        run: The run.

    Returns:
        The run itself if it is short; else a part of it with its joints' motion alone.
    """
    if len(run.time) <= LONGEST:
        return run
    speed = np.einsum("sj,sj->s", run.velocity, run.velocity)
    fastest = int(np.argmax(np.where(run.mask, speed, -1.0)))
    start = min(max(0, fastest - LONGEST // 2), len(run.time) - LONGEST)
    motion_alone: dict[str, Any] = {
        "effort": None,
        "base_pose": None,
        "base_velocity": None,
        "stages": {},
    }
    return part(run, start, start + LONGEST, **motion_alone)
