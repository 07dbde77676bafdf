"""How loud a run is, when, and which joints and links make it so."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import noisemodel as nm
from inspector.analysis.analyse import robot_known
from inspector.errors import InspectorError
from noisemodel import Run
from noisemodel.files import replacing
from noisemodel.types import Array, Real

KINDS = ("simplified", *nm.KINDS)


@dataclass(frozen=True)
class NoiseLevel:
    """A run's noise in numbers, by one estimate.

    Attributes:
        kind: "simplified", or a kind of the extended noise.
        unit: Of ``rms`` and ``peak``: the square root of the power.
        rms: Root mean square.
        peak: Largest value.
        peak_time: When that is, in [s].
        shares: Share of each joint or link in the power, largest first; they add up to 1.
        remarks: What this estimate leaves out, a sentence each.
    """

    kind: str
    unit: str
    rms: float
    peak: float
    peak_time: float
    shares: tuple[tuple[str, float], ...]
    remarks: tuple[str, ...] = ()

    def __str__(self) -> str:
        """The levels in lines."""
        head = f"{self.kind}: rms {self.rms:.4g} {self.unit}, peak {self.peak:.4g} {self.unit}"
        rows = [f"  {share:6.1%}  {name}" for name, share in self.shares if share >= 0.001]
        remarks = [f"  {remark}" for remark in self.remarks]
        return "\n".join([f"{head} at {self.peak_time:.3f} s", *rows, *remarks])


@dataclass(frozen=True, eq=False)
class Estimate:
    """A noise over time.

    Attributes:
        kind: "simplified", or a kind of the extended noise.
        unit: Of the pressure.
        power: Power of each part, shape (samples, parts), in [unit²].
        parts: Joints or links.
        remarks: What the estimate leaves out, a sentence each.
    """

    kind: str
    unit: str
    power: Array
    parts: tuple[str, ...]
    remarks: tuple[str, ...] = ()

    @property
    def pressure(self) -> Array:
        """Square root of the whole power, shape (samples,), in [unit]."""
        return np.asarray(np.sqrt(self.power.sum(axis=1)))


def default_kinds(run: Run) -> tuple[str, ...]:
    """Take the simplified noise, and the paper's whole sum beside it where the run allows."""
    whole = robot_known(run) and run.position is not None
    return ("simplified", "paper") if whole else ("simplified",)


def estimate(run: Run, kind: str, *, geometry: str = "auto") -> Estimate:
    """Compute a noise over time.

    Args:
        run: The run.
        kind: "simplified", or a kind of the extended noise.
        geometry: "visual", "collision", "hull" or "auto", for the extended noise.

    Returns:
        The power of each joint (simplified) or link (extended).

    Raises:
        NoiseModelError: If there is no such kind, or the run lacks what it takes.
    """
    if kind == "simplified":
        return _simplified(run)
    if kind not in nm.KINDS:
        raise nm.UnknownKindError(kind, KINDS)
    if run.robot is None or not robot_known(run):
        raise nm.RobotError(f"kind {kind!r} needs a robot, the run names {run.robot!r}")
    robot = nm.Robot.load(run.robot, floating_base=True if run.base_pose is not None else None)
    surface = nm.Surface.of(robot, geometry)
    q_desired, v_desired = robot.desired(run) or (None, None)
    noise = nm.extended(
        robot, surface, *robot.configuration(run), kind, q_desired=q_desired, v_desired=v_desired
    )
    without_geometry = (
        (f"links without geometry: {', '.join(surface.without_geometry)}",)
        if surface.without_geometry
        else ()
    )
    return Estimate(kind, "√W", noise.power, noise.names, without_geometry)


def noise_level(run: Run, estimate: Estimate) -> NoiseLevel:
    """Sum an estimate up.

    Args:
        run: The run; gaps do not count.
        estimate: Its noise.

    Returns:
        The measures.

    Raises:
        InspectorError: If the noise is not finite.
    """
    pressure = np.where(run.mask, estimate.pressure, 0.0)
    if not np.isfinite(pressure).all():
        sample = int(np.argmin(np.isfinite(pressure)))
        raise InspectorError(
            f"the {estimate.kind} noise is {pressure[sample]:g} at {run.time[sample]:.6g} s: the"
            " run's motion or the size of the robot is no robot's"
        )
    energy = estimate.power[run.mask].sum(axis=0)
    shares = energy / (energy.sum() or 1.0)
    order = np.argsort(-shares, kind="stable")
    return NoiseLevel(
        kind=estimate.kind,
        unit=estimate.unit,
        rms=float(np.sqrt(np.mean(pressure[run.mask] ** 2))),
        peak=float(pressure.max()),
        peak_time=float(run.time[pressure.argmax()]),
        shares=tuple((estimate.parts[i], float(shares[i])) for i in order),
        remarks=estimate.remarks,
    )


def write_csv(
    run: Run, estimates: tuple[Estimate, ...], path: Path, *, overwrite: bool = False
) -> None:
    """Write time and noises as CSV.

    Args:
        run: The run; its gaps are left out.
        estimates: Its noises.
        path: The file to write.
        overwrite: Whether a file that exists may be replaced.

    Raises:
        OutputError: If the file exists or cannot be written.
    """
    columns = np.column_stack((run.time, *(estimate.pressure for estimate in estimates)))
    names = ["time [s]", *(f"{estimate.kind} [{estimate.unit}]" for estimate in estimates)]
    with replacing(path, overwrite=overwrite) as temporary:
        np.savetxt(
            temporary,
            columns[run.mask],
            fmt="%.9g",
            delimiter=",",
            header=",".join(names),
            comments="",
            encoding="utf-8",
        )


def _simplified(run: Run) -> Estimate:
    def power(signal: Real) -> Array:
        return np.square(signal.astype(np.float64))

    parts, powers = list(run.joint_names), [power(run.velocity)]
    if run.velocity_desired is not None:
        parts += [f"{name}, desired" for name in run.desired_joint_names]
        powers.append(power(run.velocity_desired))
    if run.base_velocity is not None:
        parts.append("base")
        powers.append(power(run.base_velocity).sum(axis=1, keepdims=True))
    return Estimate("simplified", "rad/s", np.hstack(powers), tuple(parts))
