"""The run: one recording of one robot, checked when it is made."""

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self, cast

import numpy as np
from numpy.typing import NDArray

from noisemodel import checks, differentiate, runfile
from noisemodel.block import Block
from noisemodel.catalog import is_file_name
from noisemodel.errors import RunError, RunFileError
from noisemodel.ondemand import OnDemand, rows_at_once
from noisemodel.types import Array, Mask, Real

SAMPLED = (
    "time",
    "velocity",
    "position",
    "velocity_desired",
    "position_desired",
    "effort",
    "valid",
    "base_pose",
    "base_velocity",
)
"""The fields of a run that hold a row or a value for each sample; ``stages`` hold such fields."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Run:
    """One recording of one robot, in SI units; optional signals are None or empty.

    Attributes:
        time: Uniform to 1e-3 of its step, shape (samples,), in [s].
        velocity: Joint velocities, shape (samples, joints), in [rad/s] or [m/s].
        joint_names: Names of the joints, in any order.
        position: Joint positions, shape (samples, joints), in [rad] or [m].
        velocity_desired: Desired joint velocities, shape (samples, desired).
        position_desired: Desired joint positions, shape (samples, desired).
        desired_joint_names: Names of the desired joints; ``joint_names`` unless given.
        stages: Velocities at named stages of the control flow, each (samples, joints).
        effort: Joint torques or forces, shape (samples, joints), in [N m] or [N]; of some logs
            motor currents, in [A].
        valid: False in gaps, where all values are 0, shape (samples,); all true unless given.
        base_pose: x, y, z and quaternion x, y, z, w of a floating base, shape (samples, 7).
        base_velocity: Linear, then angular velocity of the base in its own axes,
            shape (samples, 6), in [m/s] and [rad/s].
        robot: Name of a listed robot or of one of MuJoCo Menagerie, or path of a URDF or an MJCF.
        blocks: Annotated stretches, sorted, not overlapping.
        meta: What else is known: scenario, seed, software version, source…

    Raises:
        RunError: If shapes do not fit, a value is not finite, time is not uniform,
            names repeat, or blocks overlap.
    """

    time: Array
    velocity: Real
    joint_names: tuple[str, ...]
    position: Real | None = None
    velocity_desired: Real | None = None
    position_desired: Real | None = None
    desired_joint_names: tuple[str, ...] = ()
    stages: Mapping[str, Real] = field(default_factory=dict)
    effort: Real | None = None
    valid: Mask | None = None
    base_pose: Real | None = None
    base_velocity: Real | None = None
    robot: str | None = None
    blocks: tuple[Block, ...] = ()
    meta: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Fill in defaults and check everything once."""
        assign = object.__setattr__
        assign(self, "time", np.asarray(self.time, dtype=np.float64))
        assign(self, "desired_joint_names", self.desired_joint_names or self.joint_names)
        assign(self, "blocks", tuple(sorted(self.blocks)))
        assign(self, "stages", MappingProxyType(dict(self.stages)))
        assign(self, "meta", MappingProxyType(dict(self.meta)))
        checks.check_time(self.time)
        if self.valid is None:
            assign(self, "valid", np.ones(len(self.time), dtype=bool))
        checks.check_valid(self.mask, len(self.time))
        checks.check_names("joint_names", self.joint_names)
        if not self.joint_names and self.base_velocity is None:
            raise RunError("joint_names: there are no joints, and the base does not move")
        checks.check_names("desired_joint_names", self.desired_joint_names)
        checks.check_words("stages", self.stages)
        for name, signal, width in self._signals():
            checks.check_signal(name, signal, (len(self.time), width))
        if self.base_pose is not None:
            checks.check_quaternions(self.base_pose, self.mask)
        checks.check_blocks(self.blocks, self.time)

    def _signals(self) -> list[tuple[str, Real, int]]:
        """List name, array and expected width of each signal that is there."""
        joints, desired = len(self.joint_names), len(self.desired_joint_names)
        signals = [
            ("velocity", self.velocity, joints),
            ("position", self.position, joints),
            ("velocity_desired", self.velocity_desired, desired),
            ("position_desired", self.position_desired, desired),
            *((runfile.STAGE + name, stage, joints) for name, stage in self.stages.items()),
            ("effort", self.effort, joints),
            ("base_pose", self.base_pose, 7),
            ("base_velocity", self.base_velocity, 6),
        ]
        return [(name, signal, width) for name, signal, width in signals if signal is not None]

    def __repr__(self) -> str:
        return (
            f"Run({self.robot or 'no robot'}, {len(self.joint_names)} joints,"
            f" {len(self.time)} samples at {self.rate:g} Hz, {self.duration:g} s,"
            f" {len(self.blocks)} blocks)"
        )

    @property
    def mask(self) -> Mask:
        """The samples that are not in a gap, shape (samples,)."""
        assert self.valid is not None
        return self.valid

    @cached_property
    def rate(self) -> float:
        """Nominal sample rate: the inverse of the median step, in [Hz]."""
        return float(f"{1.0 / checks.median_step(self.time):.9g}")

    @property
    def duration(self) -> float:
        """Time that the samples cover, in [s]."""
        return len(self.time) / self.rate

    @property
    def motion(self) -> Real:
        """All measured velocities, those of a floating base first, shape (samples, n).

        The simplified noise counts the base's six velocities too (paper, Sec. II-A: n = 30).
        """
        base, joints = self.base_velocity, self.velocity
        if base is None:
            return joints
        if not isinstance(joints, OnDemand) and not isinstance(base, OnDemand):
            return np.hstack((base, joints))
        shape = len(joints), base.shape[1] + joints.shape[1]
        both = OnDemand(
            shape,
            np.result_type(base.dtype, joints.dtype),
            lambda first, stop: np.hstack((base[first:stop], joints[first:stop])),
        )
        return cast(Real, both)

    def cut(self, start: float, stop: float) -> "Run":
        """The part of the run with ``start <= time < stop``, and all that belongs to it.

        Args:
            start: Time of the first sample or before it, in [s]; -inf for the beginning.
            stop: Time after the last sample, in [s]; inf for the end.

        Returns:
            A run with the same times and names and the same meta. Blocks that reach out of the part
            are clipped: to its first sample and to ``stop``.

        Raises:
            RunError: If the part has fewer than two samples, or gaps alone.
        """
        first, last = np.searchsorted(self.time, (start, stop)).tolist()
        if last - first < 2:
            raise RunError(
                f"{max(0, last - first)} samples from {start:g} s to {stop:g} s, expected 2 at"
                f" least; the run has {self.time[0]:g} s to {self.time[-1]:g} s"
            )
        clipped = [
            Block(
                float(self.time[first]) if block.start < start else block.start,
                min(block.stop, stop),
                block.label,
            )
            for block in self.blocks
        ]
        blocks = tuple(block for block in clipped if block.start < block.stop)
        return part(self, first, last, blocks=blocks)

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the run as a run file, whole or not at all.

        Args:
            path: The file to write, by convention ``*.npz``.
            overwrite: Whether a file that exists may be replaced.

        Raises:
            OutputError: If the file exists or cannot be written.
        """
        path = Path(path)
        runfile.write(path, _arrays(self, folder=path.parent), overwrite=overwrite)

    @classmethod
    def load(cls, path: str | Path, *, on_demand: bool = False) -> Self:
        """Read a run file; velocities that are missing are differentiated from positions.

        Args:
            path: A ``run.npz``, version 1. A robot that it names by a relative path is
                looked for beside the file.
            on_demand: Whether signals of 64 MB or more stay in the file. Their rows are read where
                they are sliced; whatever else is done with them reads them whole.

        Returns:
            The run; what was differentiated is listed under ``differentiated`` in its ``meta``.

        Raises:
            RunFileError: If the file is no run file, or holds a run that is wrong.
        """
        path = Path(path)
        arrays = runfile.read(path, on_demand=on_demand)
        try:
            return cls(**_fields(arrays, folder=path.parent))
        except RunError as error:
            raise RunFileError(path, str(error)) from error


MOTION = ("velocity", "velocity_desired", "effort", "base_velocity")
"""The fields of a run that a classifier takes signals of."""


def pieces_of(run: Run, *, samples: int | None = None) -> Iterator[Run]:
    """Take the motion of a run piece by piece, each of which fits into memory.

    The pieces are not checked again: one may be a gap alone. They have the rate of the run.

    Args:
        run: The run.
        samples: Of a piece; what is megabytes unless given.

    Yields:
        A piece, with the same names and the fields ``MOTION`` alone.
    """
    whole: dict[str, Any] = {
        **{name: getattr(run, name) for name in ("joint_names", "desired_joint_names")},
        **{name: getattr(run, name) for name in ("robot", "meta", "rate")},
        "stages": MappingProxyType({}),
        "blocks": (),
    }
    motion = {name: getattr(run, name) for name in ("time", *MOTION)} | {"valid": run.mask}
    size = samples or rows_at_once(run.motion)
    for first in range(0, len(run.time), size):
        rows = slice(first, first + size)
        fields = {name: None if each is None else each[rows] for name, each in motion.items()}
        piece: Run = object.__new__(Run)
        vars(piece).update(dict.fromkeys(SAMPLED) | whole | fields)
        yield piece


def part(run: Run, first: int, stop: int, **changes: Any) -> Run:
    """Samples of a run, without its blocks.

    Args:
        run: The run.
        first: Index of the first sample.
        stop: Index after the last one.
        changes: Other fields of the part, as ``dataclasses.replace`` takes them.

    Returns:
        The part, with the same names and meta.

    Raises:
        RunError: If the part has fewer than two samples, or gaps alone.
    """
    samples = slice(first, stop)
    fields: dict[str, Any] = {
        name: None if getattr(run, name) is None else getattr(run, name)[samples]
        for name in SAMPLED
    }
    stages = {name: stage[samples] for name, stage in run.stages.items()}
    return replace(run, **(fields | {"stages": stages, "blocks": ()} | changes))


def _arrays(run: Run, *, folder: Path) -> dict[str, Any]:
    """Turn a run into the arrays of a run file."""
    signals = {name: signal for name, signal, _ in run._signals()}
    arrays = {
        "format": runfile.FORMAT,
        "time": run.time,
        "joint_names": np.array(run.joint_names, dtype=str),
        **signals,
        "meta": json.dumps(dict(run.meta), sort_keys=True),
    }
    if run.desired_joint_names != run.joint_names:
        arrays["desired_joint_names"] = np.array(run.desired_joint_names, dtype=str)
    if not run.mask.all():
        arrays["valid"] = run.mask
    if run.robot is not None:
        arrays["robot"] = _robot_from(folder, run.robot)
    if run.blocks:
        arrays["block_start"] = np.array([block.start for block in run.blocks])
        arrays["block_stop"] = np.array([block.stop for block in run.blocks])
        arrays["block_label"] = np.array([block.label for block in run.blocks])
    return arrays


def _fields(arrays: Mapping[str, NDArray[Any]], *, folder: Path) -> dict[str, Any]:
    """Turn the arrays of a run file into the fields of a run."""
    signals = {
        name: array
        for name, array in arrays.items()
        if "samples" in runfile.ARRAYS.get(name, ("", ()))[1]
    }
    if "time" not in signals:
        raise RunError(f"array 'time' is missing; the file has {', '.join(arrays) or 'nothing'}")
    if "velocity" not in signals and "position" not in signals:
        raise RunError(
            "array 'velocity' is missing, and 'position' to differentiate too;"
            f" the file has {', '.join(arrays)}"
        )
    checks.check_time(signals["time"])
    if "valid" in signals:
        checks.check_valid(signals["valid"], len(signals["time"]))
    signals, differentiated = differentiate.fill_in(signals)
    meta = _meta(arrays)
    if differentiated:
        meta["differentiated"] = differentiated
    velocity = signals["velocity"]
    samples, joints = len(signals["time"]), velocity.shape[-1]
    if velocity.ndim == 2 and len(velocity) != samples and joints == samples:
        joints = len(velocity)  # transposed, which the error states
    return {
        **signals,
        "joint_names": _names(arrays, "joint_names", [f"joint{i + 1}" for i in range(joints)]),
        "desired_joint_names": _names(arrays, "desired_joint_names", []),
        "stages": {
            name.removeprefix(runfile.STAGE): array
            for name, array in arrays.items()
            if name.startswith(runfile.STAGE)
        },
        "robot": _robot(arrays, folder),
        "blocks": _blocks(arrays),
        "meta": meta,
    }


def _names(arrays: Mapping[str, NDArray[Any]], name: str, default: list[str]) -> tuple[str, ...]:
    return tuple(str(joint) for joint in arrays.get(name, default))


def _robot(arrays: Mapping[str, NDArray[Any]], folder: Path) -> str | None:
    robot = str(arrays.get("robot", ""))
    return str(folder / robot) if is_file_name(robot) else robot or None


def _robot_from(folder: Path, robot: str) -> str:
    """Path of a URDF or an MJCF relative to the folder of the run file."""
    moves = is_file_name(robot) and not Path(robot).is_absolute()
    return os.path.relpath(robot, folder) if moves else robot


def _blocks(arrays: Mapping[str, NDArray[Any]]) -> tuple[Block, ...]:
    columns = [arrays.get(f"block_{name}", np.empty(0)) for name in ("start", "stop", "label")]
    if len({column.shape for column in columns}) > 1:
        raise RunError(
            "block_start, block_stop and block_label have shapes "
            + ", ".join(str(column.shape) for column in columns)
        )
    return tuple(
        Block(float(start), float(stop), str(label))
        for start, stop, label in zip(*columns, strict=True)
    )


def _meta(arrays: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    try:
        meta = json.loads(str(arrays.get("meta", "{}")))
    except (ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else error
        raise RunError(f"meta: not JSON ({reason})") from error
    if not isinstance(meta, dict):
        raise RunError("meta: expected a JSON object")
    try:
        json.dumps(meta, ensure_ascii=False).encode()
    except ValueError as error:  # half of a surrogate pair
        raise RunError("meta: holds text that cannot be written as UTF-8") from error
    if not isinstance(meta.get("differentiated", {}), dict):
        raise RunError("meta: expected a JSON object as differentiated")
    return meta
