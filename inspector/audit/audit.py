"""Audit of a run: gaps, bandwidth, observable classes, warnings."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import noiseclassifier as nc
from inspector.audit.bandwidth import Bandwidth, bandwidth
from inspector.audit.copies import copies
from inspector.audit.observability import ClassObservability, Observability, observable_classes
from inspector.audit.placeholder import placeholder
from inspector.audit.units import unit_warnings
from inspector.hold import hold_length, without_hold
from inspector.library import for_robot, signals_of
from inspector.text import counted, plain
from inspector.wrongrobot import check_joints, limit_warnings
from noisemodel import Run
from noisemodel.ondemand import pieces
from noisemodel.run import part


@dataclass(frozen=True)
class Gaps:
    """Gaps of a run.

    Attributes:
        count: Number of gaps.
        total: Their total duration, in [s].
        longest: Duration of the longest, in [s].
    """

    count: int = 0
    total: float = 0.0
    longest: float = 0.0

    def __str__(self) -> str:
        """Format as a clause."""
        if not self.count:
            return "no gaps"
        gaps = counted(self.count, "gap")
        return f"{gaps}, {self.total:.3g} s in all, {self.longest:.3g} s the longest"


@dataclass(frozen=True)
class Audit:
    """Rate, gaps, bandwidth and observable classes of a run.

    Attributes:
        rate: Sample rate, in [Hz].
        duration: In [s].
        joints: Number of joints.
        jitter: Deviation of the stamps' steps before they were made uniform, root mean square and
            largest, in [s]; None if the run's ``meta`` has none.
        gaps: Its gaps.
        bandwidth: Its bandwidth.
        warnings: Signs of wrong units, copies, zero-order hold or filters; a clause each.
        notes: Differentiation, quantisation, missing signals; a clause each.
        classes: Observability of each failure class.
    """

    rate: float
    duration: float
    joints: int
    jitter: tuple[float, float] | None
    gaps: Gaps
    bandwidth: Bandwidth
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    classes: tuple[ClassObservability, ...]

    @property
    def observable(self) -> bool:
        """Whether a failure class is observable, at least partly."""
        return any(each.observability is not Observability.CANNOT_TELL for each in self.classes)


def audit(run: Run, library: Mapping[str, nc.Model], *, slower: Run | None = None) -> Audit:
    """Audit a run.

    Gaps are counted in the whole run; signals are examined in an excerpt of it.

    Args:
        run: The run.
        library: Models that might label it; their bands limit what is observable.
        slower: The run at the rate of its values (`hold.without_hold`), if that is known.

    Returns:
        The audit.

    Raises:
        UnknownJointError: If the run names a joint that its robot lacks.
    """
    check_joints(run.joint_names, run.robot)
    check_joints(run.desired_joint_names, run.robot)
    part = excerpt(run)
    reach = bandwidth(part)
    return Audit(
        rate=run.rate,
        duration=run.duration,
        joints=len(run.joint_names),
        jitter=_jitter(run),
        gaps=gaps_of(run),
        bandwidth=reach,
        warnings=(*_warnings(part, reach), *limit_warnings(run)),
        notes=tuple(_notes(part, reach)),
        classes=observable_classes(
            reach,
            run.mask,
            for_robot(library, run.robot),
            signals_of(part),
            rate=(slower or without_hold(run)).rate,
        ),
    )


def _jitter(run: Run) -> tuple[float, float] | None:
    noted = run.meta.get("jitter")
    values = [noted.get(key) for key in ("rms", "max")] if isinstance(noted, Mapping) else []
    match values:
        case [float(rms), float(largest)]:
            return rms, largest
    return None


def _warnings(run: Run, reach: Bandwidth) -> Iterator[str]:
    yield from unit_warnings(run)
    if clause := placeholder(run):
        yield f"{clause}: it is left out"
    for copy in copies(run):
        whose = "all joints" if len(copy.joints) == len(run.joint_names) else ", ".join(copy.joints)
        samples = f"{abs(copy.lag)} sample{'' if abs(copy.lag) == 1 else 's'}"
        when = f", {samples} {'later' if copy.lag > 0 else 'earlier'}" if copy.lag else ""
        yield f"measured {copy.signal} of {whose} is the desired one{when}: one is a copy"
    if reach.hold > 1:
        yield (
            f"measured values have a zero-order hold of {reach.hold:.3g} samples:"
            f" they come at {plain(run.rate / reach.hold, 4)} Hz"
        )
    if reach.corner:
        yield f"velocities look filtered from {plain(reach.corner)} Hz on"


def _notes(run: Run, reach: Bandwidth) -> Iterator[str]:
    if reach.differentiator:
        yield (
            f"velocities are differentiated positions ({reach.differentiator.name}),"
            f" attenuated above {plain(reach.differentiator.corner(run.rate))} Hz"
        )
    if run.velocity_desired is None:
        yield "there is no desired motion"
    elif (hold := hold_length(run.velocity_desired, run.mask)) > 1:
        yield (
            f"desired velocities have a zero-order hold of {hold:.3g} samples"
            f" ({plain(run.rate / hold, 4)} Hz)"
        )
    if reach.floor_from is not None:
        unit = "rad" if reach.differentiator else "rad/s"
        yield (
            f"above {plain(reach.floor_from)} Hz the spectrum is at the quantisation floor"
            f" (step {reach.step:.2g} {unit}), which masks oscillations up to"
            f" {reach.floor_amplitude:.2g} rad/s"
        )
    elif reach.quiet_from is not None:
        yield (
            f"above {plain(reach.quiet_from)} Hz the level is below any encoder's noise: filtered,"
            " or simulated without sensor noise"
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
    """Cut out the part of a run around its fastest motion, which limits the cost of long runs.

    Args:
        run: The run.

    Returns:
        The run itself if it is short; else a part of it with its joints' motion alone.
    """
    if len(run.time) <= LONGEST:
        return run
    fastest, highest = 0, -1.0
    for rows in pieces(run.velocity):
        moving = run.velocity[rows]
        speed = np.where(run.mask[rows], np.einsum("sj,sj->s", moving, moving), -1.0)
        if speed.max() > highest:
            fastest, highest = rows.start + int(speed.argmax()), float(speed.max())
    start = min(max(0, fastest - LONGEST // 2), len(run.time) - LONGEST)
    motion_alone: dict[str, Any] = {
        "effort": None,
        "base_pose": None,
        "base_velocity": None,
        "stages": {},
    }
    return part(run, start, start + LONGEST, **motion_alone)
