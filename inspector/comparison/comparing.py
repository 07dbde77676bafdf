"""Comparing noise models, on recorded runs or on robots that make a motion of our own."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeAlias

import numpy as np

import noisemodel as nm
from inspector.comparison.compared import Compared, Failed
from inspector.errors import InspectorError
from inspector.parallel import each
from noisemodel.compare import COMPARED, SIMPLIFIED
from noisemodel.differentiate import stretches
from noisemodel.excitation import made_up
from noisemodel.geometry import GEOMETRIES
from noisemodel.links import vibrating
from noisemodel.noise import decibel
from noisemodel.types import Array

EXPECTED = (InspectorError, nm.NoiseModelError)

Source: TypeAlias = Path | str
"""A run file, or a robot: a listed name or the path of a URDF."""


@dataclass(frozen=True)
class Settings:
    """What is compared, and how.

    Attributes:
        kinds: "simplified", or kinds of ``noisemodel.surface_speed``.
        geometry: "visual", "collision", "hull" or "auto".
        seed: Of the motion that robots make.

    Raises:
        UnknownKindError: If there is no such kind.
        InspectorError: If fewer than two kinds are named, or one twice.
        GeometryError: If there is no such geometry.
    """

    kinds: tuple[str, ...] = COMPARED
    geometry: str = "auto"
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what is not known before long work is done."""
        known = (SIMPLIFIED, *nm.KINDS)
        for kind in self.kinds:
            if kind not in known:
                raise nm.UnknownKindError(kind, known)
        if len(set(self.kinds)) < max(2, len(self.kinds)):
            raise InspectorError(
                f"kinds to compare are {', '.join(self.kinds)}; expected two different ones or more"
            )
        if self.geometry not in GEOMETRIES:
            raise nm.GeometryError(
                f"geometry {self.geometry!r} is not known, expected one of {', '.join(GEOMETRIES)}"
            )


def sources_of(runs: Sequence[Path], robots: str) -> list[Source]:
    """List what is named on the command line.

    Args:
        runs: Run files.
        robots: Robots with commas between them, or "all" that are listed; may be empty.

    Returns:
        The runs, then the robots, each once.
    """
    names = list(nm.ROBOTS) if robots == "all" else [name.strip() for name in robots.split(",")]
    return list(dict.fromkeys([*runs, *filter(None, names)]))


def compare_all(
    sources: Sequence[Source], settings: Settings, *, jobs: int = 1
) -> Iterator[Compared | Failed]:
    """Compare the noise models on many motions; one that cannot be had never stops the rest.

    Args:
        sources: Run files and robots.
        settings: What is compared.
        jobs: How many to work on at once.

    Returns:
        A result per source, in their order.
    """
    return each(partial(_attempt, settings=settings), sources, jobs=jobs)


def sorted_out(results: Iterable[Compared | Failed]) -> tuple[list[Compared], list[Failed]]:
    """Tell what could be compared from what could not."""
    found: list[Compared] = []
    failed: list[Failed] = []
    for result in results:
        if isinstance(result, Compared):
            found.append(result)
        else:
            failed.append(result)
    return found, failed


def compare_run(path: Path, settings: Settings) -> Compared:
    """Compare the noise models on a recorded run.

    Args:
        path: A run file that names its robot and has positions.
        settings: What is compared.

    Returns:
        The comparison of the measured motion in the longest stretch without gaps.

    Raises:
        RunFileError: If the file is no run file.
        InspectorError: If the run names no robot, or no link of it has a surface.
        NoiseModelError: If the robot cannot be had, or the run does not suffice.
    """
    run = nm.Run.load(path)
    if run.robot is None:
        raise InspectorError("the run names no robot; `inspector import --robot` adds one")
    if run.position is None:
        raise InspectorError("the run has no positions, which the extended noise needs")
    floating = run.base_pose is not None or run.base_velocity is not None
    robot = nm.Robot.load(run.robot, floating_base=True if floating else None)
    remarks = []
    if not run.mask.all():
        run = _longest(run)
        remarks.append(f"The run has gaps: compared from {run.time[0]:.2f} s on.")
    resting = [name for name in robot.joint_names if name not in run.joint_names]
    if resting:
        remarks.append(f"The run does not name {', '.join(resting)}: they rest.")
    return _compare(str(path), robot, run, settings, remarks)


def compare_robot(name: str, settings: Settings) -> Compared:
    """Compare the noise models on a robot that makes the motion of ``noisemodel.excitation``.

    Args:
        name: A listed robot, or the path of a URDF.
        settings: What is compared.

    Returns:
        The comparison.

    Raises:
        InspectorError: If no link has a surface.
        NoiseModelError: If the robot cannot be had.
    """
    try:
        robot, remarks = nm.Robot.load(name, mimic=True), []
    except nm.RobotError:
        robot = nm.Robot.load(name)  # a mimic joint may follow one that the URDF does not have
        remarks = ["Its mimic joints cannot follow theirs: they move by themselves."]
    return _compare(name, robot, made_up(robot, seed=settings.seed), settings, remarks)


def _attempt(source: Source, settings: Settings) -> Compared | Failed:
    try:
        if isinstance(source, Path):
            return compare_run(source, settings)
        return compare_robot(source, settings)
    except EXPECTED as error:
        return Failed(str(source), str(error).removeprefix(f"{source}: "))


def _compare(
    name: str, robot: nm.Robot, run: nm.Run, settings: Settings, remarks: Sequence[str]
) -> Compared:
    surface = nm.Surface.of(robot, settings.geometry)
    if not surface.area.any():
        raise InspectorError(f"no link has a surface by geometry {settings.geometry!r}")
    q, v = robot.configuration(run)
    events = tuple(block for block in run.blocks if block.label != "ok")
    pressure = np.array([_pressure(robot, surface, q, v, kind) for kind in settings.kinds])
    loudness = np.sqrt(np.mean(pressure**2, axis=1, keepdims=True))
    return Compared(
        name=name,
        floating_base=robot.floating_base,
        joints=len(run.joint_names),
        time=run.time,
        rate=run.rate,
        events=events,
        found=nm.compare(robot, q, v, settings.kinds, rate=run.rate, surface=surface),
        pressure=pressure / np.where(loudness > 0.0, loudness, 1.0),
        contrast=_contrasts(pressure, run, events),
        with_surface=len(surface.names) - len(surface.bare),
        remarks=tuple(remarks),
    )


def _pressure(robot: nm.Robot, surface: nm.Surface, q: Array, v: Array, kind: str) -> Array:
    """Pressure over time to some scale, shape (samples,)."""
    if kind == SIMPLIFIED:
        return nm.simplified(v)
    chunks = nm.extended_chunks(robot, surface, q, v, kind)
    pressure: Array = np.sqrt(np.concatenate([chunk.total for chunk in chunks]))
    return pressure


def _contrasts(pressure: Array, run: nm.Run, events: Sequence[nm.Block]) -> Array:
    """Hold the events against the rest above 10 Hz, shape (kinds, events), in [dB].

    The slow motion is left out: its power hides whatever vibrates, from any estimate.
    """
    power = vibrating(pressure.T, run.mask, run.rate).T ** 2
    inside = [(run.time >= event.start) & (run.time < event.stop) for event in events]
    rest = ~np.any([np.zeros(len(run.time), dtype=bool), *inside], axis=0)
    if not inside or not rest.any():
        return np.full((len(power), len(inside)), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        energy = np.array([power[:, event].sum(axis=1) / event.sum() for event in inside]).T
        return decibel(energy / power[:, rest].mean(axis=1, keepdims=True))


def _longest(run: nm.Run) -> nm.Run:
    """Cut the longest stretch without a gap out of a run."""
    parts = stretches(run.mask, len(run.time))
    part = max(parts, key=lambda part: part.stop - part.start, default=slice(0, 1))
    time = run.time[part]
    within = [b for b in run.blocks if b.start >= time[0] and b.stop <= time[-1]]
    assert run.position is not None
    return nm.Run(
        time=time,
        velocity=run.velocity[part],
        position=run.position[part],
        joint_names=run.joint_names,
        base_pose=None if run.base_pose is None else run.base_pose[part],
        base_velocity=None if run.base_velocity is None else run.base_velocity[part],
        robot=run.robot,
        blocks=tuple(within),
        meta=run.meta,
    )
