"""What `diff` keeps of a run: findings, levels over time, envelope of the motion."""

import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np

from inspector.analysis.analyse import Analysis, analyse, with_links
from inspector.analysis.status import Status, Unknown
from inspector.errors import without_path
from inspector.library import Library
from inspector.logs.read import open_run
from inspector.pair.alignment import envelope
from inspector.regression.levels import STEP, Levels, levels
from inspector.verdict import EXPECTED, work_of
from noiseclassifier import Event
from noisemodel import Run
from noisemodel.links import LinkNoise, vibrating
from noisemodel.noise import decibel
from noisemodel.ondemand import OnDemand
from noisemodel.parallel import DIED, Jobs, in_order
from noisemodel.types import Array, Real

ENVELOPE = 200.0
"""Rate of the envelope by which runs are aligned, in [Hz]."""
FLOOR_DB = -100.0
"""Least level of a finding, below that of any encoder, in [dB re 1 rad/s]."""


@dataclass(frozen=True)
class Finding:
    """A finding and how loud it is.

    Attributes:
        event: The finding.
        level: Level of the noise above 10 Hz during it, in [dB re 1 rad/s].
    """

    event: Event
    level: float


@dataclass(frozen=True, eq=False)
class Measured:
    """A run, without its samples.

    Attributes:
        path: Its file.
        robot: The robot that it names, may be empty.
        scenario: The scenario that its meta names, may be empty.
        seed: The seed that its meta names, or None.
        rate: In [Hz].
        duration: In [s].
        signals: Signals that its findings depend on.
        status: Outcome of `classify`.
        message: A line that says more, may be empty.
        model: Name of the model that labelled, empty if none could.
        findings: What was found, in order.
        levels: Its levels.
        errors: Levels of measured less desired velocities; None without the latter.
        links: Power of each link's vibration above 10 Hz, in [W], in one band; None without a known
            robot.
        envelope: Envelope of its motion at 200 Hz at most; NaN in gaps, shape (bins,).
        clock: Time of each bin's first sample, shape (bins,), in [s].
    """

    path: Path
    robot: str
    scenario: str
    seed: int | None
    rate: float
    duration: float
    signals: frozenset[str]
    status: Status
    message: str
    model: str
    findings: tuple[Finding, ...]
    levels: Levels
    errors: Levels | None
    links: Levels | None
    envelope: Array
    clock: Array

    @property
    def motion(self) -> Run:
        """The envelope as a run of one joint."""
        valid = np.isfinite(self.envelope)
        return Run(
            time=self.clock,
            velocity=np.where(valid, self.envelope, 0.0)[:, None],
            joint_names=("envelope",),
            valid=valid,
        )


@dataclass(frozen=True)
class Unreadable:
    """A file that is no run, shows a bug, or with which a worker died.

    Attributes:
        path: The file.
        problem: Why, in one line.
        status: Bad input, or an internal error.
        trace: The traceback of a bug; empty without.
    """

    path: Path
    problem: str
    status: Status = Status.BAD_INPUT
    trace: str = ""


def measure_files(
    paths: Sequence[Path],
    library: Library,
    *,
    links: bool = True,
    unknown: Unknown = Unknown.FINDING,
    jobs: Jobs = 1,
) -> Iterator[Measured | Unreadable]:
    """Measure many files; one that cannot be read never stops the rest.

    Args:
        paths: The files.
        library: Models to choose from.
        links: Whether to compute the noise of links where the robot is known.
        unknown: Whether out-of-distribution frames below the alarm threshold are findings.
        jobs: How many to work on at once, or the address of a Dask scheduler. A file with which a
            worker dies is an internal error.

    Returns:
        What was measured of each file, in their order.
    """
    one = partial(measure_file, library=library, links=links, unknown=unknown)
    return in_order(one, paths, jobs=jobs, died=_died, work=work_of(paths))


def _died(path: Path) -> Unreadable:
    return Unreadable(path, DIED, Status.INTERNAL_ERROR)


def measure_file(
    path: Path, library: Library, *, links: bool = True, unknown: Unknown = Unknown.FINDING
) -> Measured | Unreadable:
    """Measure one file; errors become part of the result."""
    try:
        return measure(open_run(path).run, path, library, links=links, unknown=unknown)
    except EXPECTED as error:
        return Unreadable(path, without_path(error, path))
    except Exception as error:  # a bug that one run shows must not hide the changes of others
        problem = f"{type(error).__name__}: {error}"
        return Unreadable(path, problem, Status.INTERNAL_ERROR, traceback.format_exc())


def measure(
    run: Run,
    path: Path,
    library: Library,
    *,
    links: bool = True,
    unknown: Unknown = Unknown.FINDING,
) -> Measured:
    """Classify a run, and keep what `diff` compares.

    Args:
        run: The run.
        path: Its file, to be named by.
        library: Models to choose from.
        links: Whether to compute the noise of links where the robot is known.
        unknown: Whether out-of-distribution frames below the alarm threshold are findings.

    Returns:
        What is compared; a run that no model can label has levels, and no findings.

    Raises:
        RobotError: If the robot cannot be read, or lacks one of the run's joints.
        InspectorError: If the robot's shape cannot be had.
    """
    analysis = with_links(analyse(run, library, unknown=unknown), "normal" if links else "")
    motion, clock = _envelope(run)
    scenario, seed = run.meta.get("scenario"), run.meta.get("seed")
    return Measured(
        path=path,
        robot=run.robot or "",
        scenario=str(scenario) if scenario is not None else "",
        seed=seed if isinstance(seed, int) else None,
        rate=run.rate,
        duration=run.duration,
        signals=frozenset(
            name
            for name in ("velocity_desired", "effort", "base_velocity")
            if getattr(run, name) is not None
        ),
        status=analysis.status,
        message=analysis.message,
        model=analysis.model,
        findings=_findings(analysis),
        levels=levels(run),
        errors=_errors(run),
        links=None if analysis.links is None else _links(analysis.links),
        envelope=motion,
        clock=clock,
    )


def _errors(run: Run) -> Levels | None:
    measured, desired = run.velocity, run.velocity_desired
    if desired is None:
        return None

    def error(first: int, stop: int) -> Array:
        return measured[first:stop] - desired[first:stop]

    difference = cast(Real, OnDemand(measured.shape, np.float64, error))
    return levels(replace(run, velocity=difference))


def _findings(analysis: Analysis) -> tuple[Finding, ...]:
    if not analysis.findings:
        return ()
    run = analysis.run
    energy = vibrating(analysis.noise[:, None], run.mask, run.rate)[:, 0] ** 2

    def level(event: Event) -> float:
        inside = run.mask & (run.time >= event.start) & (run.time < event.stop)
        power = energy[inside].mean() if inside.any() else 0.0
        return max(float(decibel(np.array(power))), FLOOR_DB)

    return tuple(Finding(event, level(event)) for event in analysis.findings)


def _links(noise: LinkNoise) -> Levels:
    """Take the vibration of links as levels, in steps of 0.1 s."""
    width = float(np.median(np.diff(noise.time)))
    firsts = np.arange(0, len(noise.time), max(1, round(STEP / width)))
    counts = np.diff(np.append(firsts, len(noise.time)))
    power = np.add.reduceat(noise.vibration, firsts, axis=0) / counts[:, None]
    time = np.add.reduceat(noise.time, firsts) / counts
    return Levels(time, noise.links, (0.0,), power[:, :, None])


def _envelope(run: Run) -> tuple[Array, Array]:
    """Means of the envelope of a motion in bins, NaN where one has a gap, and their times."""
    size = max(1, int(run.rate / ENVELOPE))
    bins = len(run.time) // size
    if bins < 2:
        size, bins = 1, len(run.time)
    speed = np.where(run.mask, envelope(run), np.nan)[: bins * size]
    means = np.asarray(speed.reshape(bins, size).mean(axis=1))
    if not np.isfinite(means).any():  # gaps everywhere: no motion to align by
        means = np.zeros(bins)
    return means, run.time[: bins * size : size]
