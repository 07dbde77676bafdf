"""Kinds of noise estimates side by side, on one robot or many."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TypeAlias, overload

import numpy as np

from noisemodel.comparison import Comparison, RobotComparison
from noisemodel.comparisons import Comparisons, LeftOut
from noisemodel.errors import GeometryError, MotionError, NoiseModelError, UnknownKindError
from noisemodel.estimates import SIMPLIFIED, check_length, estimates
from noisemodel.links import vibrating
from noisemodel.motions import EXCITATION, Motions, Moving, Source, Task, tasks
from noisemodel.noise import check_positive, check_stretches, decibel
from noisemodel.parallel import DIED, Jobs, in_order
from noisemodel.robot import Robot
from noisemodel.speed import KINDS, check_motion
from noisemodel.surface import GEOMETRIES, Surface, check_surface
from noisemodel.types import Array, Real

COMPARED = (SIMPLIFIED, "C", "paper", "mean", "rms", "normal")
"""The kinds that are compared unless others are named."""

Progress: TypeAlias = Callable[..., Iterable[RobotComparison | LeftOut]]
"""Takes an iterable and its length (``total``), and passes the items on, as tqdm does."""


@overload
def compare(
    robots: Robot,
    q: Real,
    v: Real,
    kinds: Sequence[str] = ...,
    *,
    rate: float,
    surface: Surface | str | None = ...,
    events: Sequence[tuple[int, int]] = ...,
) -> Comparison: ...


@overload
def compare(
    robots: Source | Iterable[Source],
    *,
    motion: Motions | None = ...,
    kinds: Sequence[str] = ...,
    rate: float | None = ...,
    surface: Surface | str | None = ...,
    seed: int = ...,
    jobs: Jobs = ...,
    progress: Progress | None = ...,
) -> Comparisons: ...


def compare(
    robots: Source | Iterable[Source],
    q: Real | None = None,
    v: Real | None = None,
    kinds: Sequence[str] = COMPARED,
    *,
    motion: Motions | None = None,
    rate: float | None = None,
    surface: Surface | str | None = None,
    events: Sequence[tuple[int, int]] = (),
    seed: int = 0,
    jobs: Jobs = 1,
    progress: Progress | None = None,
) -> Comparison | Comparisons:
    """Comparison of kinds of noise estimates, on the motions of one robot or many.

    All estimates are compared as pressures, whose scale is arbitrary: a factor between two kinds
    changes neither their correlation nor their distance. Each kind is evaluated once. The kinds
    are those of F. Sygulla and D. Rixen, "Learning the Noise of Failure", Sec. II-A, and of
    ``surface_speed``.

    ``compare(robot, q, v, kinds, rate=rate)`` compares on one motion of one ``Robot``.
    ``compare(robots, motion=..., kinds=...)`` compares on one robot or many. It leaves out robots
    that cannot be read or have no surface, and runs that do not suffice, and lists them with the
    reason.

    Args:
        robots: One or many: a ``Robot``, a name, or the path of a URDF or an MJCF; or a
            ``Run``, or the path of a run file (a ``Path``, or text that ends in ``.npz``), for the
            robot that it names and the motion that it holds. Of a run with gaps the longest stretch
            without one is compared.
        q: Configurations as Pinocchio has them, shape (samples, nq), in [rad] and [m].
        v: Velocities as Pinocchio has them, shape (samples, nv), in [rad/s] and [m/s].
        kinds: "simplified", or kinds of ``surface_speed``.
        motion: A ``Run``, a pair ``(q, v)``, or the name of a built-in motion: "excitation", the
            default, see ``noisemodel.excitation``. One for all robots, a list with one for each, or
            a mapping from each robot's name to its motion. Robots that are named are read as
            ``Robot.load(name)`` does; for built-in motions their mimic joints are coupled.
        rate: Sample rate of ``q`` and ``v``, or of built-in motions, where it is 4000 Hz unless
            given, in [Hz]. A run has its own.
        surface: The surface of the robot, or the geometry that surfaces are taken from: "visual",
            "collision", "hull" or "auto". Unless given, "visual" with ``q`` and ``v``, else "auto".
        events: With ``q`` and ``v``: first sample and the one after the last of what should stand
            out. The events of a run are its blocks that are not "ok".
        seed: Random seed of built-in motions.
        jobs: How many robots to compare at once, or the address of a Dask scheduler.
        progress: Shows the progress; takes an iterable and its length ``total``, and passes the
            items on, as ``tqdm`` does.

    Returns:
        With ``q`` and ``v`` one ``Comparison``; else ``Comparisons``, in the order of the robots.

    Raises:
        UnknownKindError: If a kind does not exist.
        UnknownMotionError: If a built-in motion does not exist.
        MotionError: If ``q`` or ``v`` are of another shape than the robot's, or not finite.
        GeometryError: If a geometry does not exist, or one surface is given for many robots; with
            ``q`` and ``v`` also if the surface cannot be read or is that of another robot.
        NoiseModelError: If fewer than two kinds are given or one repeats, the motions are not one
            for each robot, or a rate is missing or superfluous; with ``q`` and ``v`` also if the
            motion is shorter than one spectrum, 0.1024 s.
    """
    kinds = (kinds,) if isinstance(kinds, str) else tuple(kinds)
    known = (SIMPLIFIED, *KINDS)
    for kind in kinds:
        if kind not in known:
            raise UnknownKindError(kind, known)
    if rate is not None:
        check_positive("rate", rate, "Hz")
    if q is not None or v is not None:
        if not kinds:
            raise NoiseModelError(f"no kinds to compare, expected some of {', '.join(known)}")
        if q is None or v is None or rate is None or motion is not None:
            raise NoiseModelError("expected q, v and their rate, and no other motion")
        if not isinstance(robots, Robot):
            raise NoiseModelError("q and v are given; expected one Robot, or motion=(q, v)")
        check_motion(robots, q, v)
        check_stretches(events, len(q))
        check_length(len(q), rate)
        geometry = "visual" if surface is None else surface
        return estimates(robots, _of(robots, geometry), q, v, kinds).compared(rate, events)
    if len(set(kinds)) < max(2, len(kinds)):
        raise NoiseModelError(
            f"kinds to compare are {', '.join(kinds)}; expected two different ones or more"
        )
    if len(events):
        raise NoiseModelError("events are samples of q and v; those of a run are its blocks")
    if isinstance(jobs, int) and jobs < 1:
        raise NoiseModelError(f"jobs is {jobs}, expected 1 or more")
    todo = tasks(robots, EXCITATION if motion is None else motion, rate=rate, seed=seed)
    geometry = "auto" if surface is None else surface
    _check_geometry(geometry, len(todo))
    results: Iterable[RobotComparison | LeftOut]
    one = partial(_attempt, kinds=kinds, surface=geometry)
    results = in_order(one, todo, jobs=jobs, died=_died)
    return Comparisons.of(results if progress is None else progress(results, total=len(todo)))


def _check_geometry(surface: Surface | str, robots: int) -> None:
    if isinstance(surface, Surface):
        if robots > 1:
            raise GeometryError(f"one surface for {robots} robots, expected a geometry's name")
    elif surface not in GEOMETRIES:
        raise GeometryError(
            f"geometry {surface!r} is not known, expected one of {', '.join(GEOMETRIES)}"
        )


def _attempt(task: Task, kinds: Sequence[str], surface: Surface | str) -> RobotComparison | LeftOut:
    try:
        return _compare(task.name, task.moving(), kinds, surface)
    except MotionError as error:  # of a pair, which the caller made
        raise MotionError(f"{task.name}: {error}") from error
    except NoiseModelError as error:
        return LeftOut(task.name, str(error).removeprefix(f"{task.name}: "))


def _died(task: Task) -> LeftOut:
    return LeftOut(task.name, DIED)


def _compare(
    name: str, moving: Moving, kinds: Sequence[str], surface: Surface | str
) -> RobotComparison:
    robot, rate = moving.robot, moving.rate
    check_length(len(moving.q), rate)
    surface, geometry = _of(robot, surface), surface
    if not surface.area.any():
        raise GeometryError(f"no link has a surface by geometry {geometry!r}")
    found = estimates(robot, surface, moving.q, moving.v, kinds)
    rms = np.sqrt(np.mean(found.pressure**2, axis=1, keepdims=True))
    return RobotComparison(
        name=name,
        floating_base=robot.floating_base,
        joints=moving.joints,
        time=moving.time,
        rate=rate,
        events=moving.events,
        comparison=found.compared(rate),
        pressure=found.pressure / np.where(rms > 0.0, rms, 1.0),
        contrast=_contrasts(found.pressure, moving),
        links_with_surface=len(surface.names) - len(surface.without_geometry),
        remarks=moving.remarks,
    )


def _of(robot: Robot, surface: Surface | str) -> Surface:
    if isinstance(surface, str):
        return Surface.of(robot, surface)
    check_surface(surface, robot)
    return surface


def _contrasts(pressure: Array, moving: Moving) -> Array:
    """Compare the events to the rest above 10 Hz, shape (kinds, events), in [dB].

    The slow motion is left out: its power masks vibrations in any estimate.
    """
    time = moving.time
    power = vibrating(pressure.T, np.ones(len(time), dtype=bool), moving.rate).T ** 2
    inside = [(time >= event.start) & (time < event.stop) for event in moving.events]
    rest = ~np.any([np.zeros(len(time), dtype=bool), *inside], axis=0)
    if not inside or not rest.any():
        return np.full((len(power), len(inside)), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        energy = np.array([power[:, event].sum(axis=1) / event.sum() for event in inside]).T
        return decibel(energy / power[:, rest].mean(axis=1, keepdims=True))
