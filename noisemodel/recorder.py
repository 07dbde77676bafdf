"""A recorder for your own loop: you push samples one by one, and they become a run."""

from array import array
from collections.abc import Mapping, Sequence
from decimal import Decimal
from itertools import pairwise
from math import inf
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from noisemodel.robot import ROBOTS, Robot
from noisemodel.run import (
    LONGEST,
    SHORTEST,
    UNIFORM,
    Run,
    continuous_quaternions,
    resample,
    unnamed,
    with_velocities,
)
from noisemodel.types import Array, Mask, RunError, UnknownJointError

Values: TypeAlias = ArrayLike | Mapping[str, float]

WIDTHS = {"base_pose": 7, "base_velocity": 6, "time": 1}
GAP = 5.0  # length of a step, in median ones, above which it is a gap
NEAR = 0.05  # share by which the rate of the stamps may differ from the recorder's, to count as it


class Recorder:
    """Samples of a control or simulation loop, which become a run.

    What the first sample has, each has: signals that are not pushed are missing in the run. A
    sample with a value that is not finite is a gap. Missing velocities are differentiated from
    positions.

    Args:
        robot: A robot, a listed name, or the path of its description; None for none.
        rate: Samples per second, in [Hz].
        path: Where ``with`` saves the run when it ends, also if it ends by an error.
        joint_names: The joints whose values are pushed, in order; the robot's unless given.
        desired_joint_names: The joints of desired values; ``joint_names`` unless given.
        meta: What else is known, for the run.

    Example:
        >>> recorder = Recorder(None, 100, joint_names=["elbow"])
        >>> for step in range(200):
        ...     recorder.push(velocity=[np.sin(step / 20)])
        >>> recorder.run()
        Run(no robot, 1 joints, 200 samples at 100 Hz, 2 s, 0 blocks)
    """

    def __init__(
        self,
        robot: Robot | str | Path | None,
        rate: float,
        *,
        path: str | Path | None = None,
        joint_names: Sequence[str] = (),
        desired_joint_names: Sequence[str] = (),
        meta: Mapping[str, Any] | None = None,
    ) -> None:
        low, high = 1 / LONGEST, 1 / SHORTEST
        if not low <= rate <= high:
            raise RunError(f"rate: {rate:g} Hz, expected {low:g} Hz to {high:g} Hz")
        known: tuple[str, ...] = ()
        self._robot: str | None = None
        if robot is not None:
            loaded = robot if isinstance(robot, Robot) else Robot.load(robot)
            known = loaded.joint_names
            self._robot = loaded.name if loaded.name in ROBOTS else str(loaded.path)
            for joint in (*joint_names, *desired_joint_names):
                if joint not in known:
                    raise UnknownJointError(joint, loaded.name, known)
        self._rate, self._path, self._meta = float(rate), path, dict(meta or {})
        self._joints = tuple(joint_names) or known
        self._desired = tuple(desired_joint_names) or self._joints
        self._values: dict[str, array[float]] = {}  # row after row
        self._count = 0

    def __len__(self) -> int:
        """Number of samples."""
        return self._count

    def push(
        self,
        *,
        position: Values | None = None,
        velocity: Values | None = None,
        position_desired: Values | None = None,
        velocity_desired: Values | None = None,
        effort: Values | None = None,
        base_pose: ArrayLike | None = None,
        base_velocity: ArrayLike | None = None,
        time: float | None = None,
    ) -> None:
        """Add a sample; a RunError if it does not fit those before.

        Args:
            position: A number for each joint, or by the joint's name, in [rad] or [m].
            velocity: In [rad/s] or [m/s].
            position_desired: As ``position``, of the desired joints.
            velocity_desired: As ``velocity``, of the desired joints.
            effort: In [N m] or [N].
            base_pose: x, y, z and the quaternion x, y, z, w of a floating base.
            base_velocity: Linear, then angular velocity of the base in its own axes.
            time: Stamp of the sample, in [s]; the samples are at the recorder's rate without.
        """
        given: dict[str, Values | None] = {
            "position": position,
            "velocity": velocity,
            "position_desired": position_desired,
            "velocity_desired": velocity_desired,
            "effort": effort,
            "base_pose": base_pose,
            "base_velocity": base_velocity,
            "time": None if time is None else [time],
        }
        rows = {name: self._row(name, each) for name, each in given.items() if each is not None}
        self._check(rows)
        for name, row in rows.items():
            self._values.setdefault(name, array("d")).frombytes(row.tobytes())
        self._count += 1

    def run(self) -> Run:
        """Run of the samples so far, which are two or more, and not gaps alone.

        Stamps that jitter are resampled to the recorder's rate (to their own, if that is another
        by more than 5 %), with ``valid`` False where samples are missing.
        """
        if self._count < 2:
            raise RunError(f"the recorder has {self._count} samples, a run needs at least 2")
        signals = {
            name: np.array(each).reshape(self._count, -1) for name, each in self._values.items()
        }
        valid = np.logical_and.reduce([np.isfinite(each).all(axis=1) for each in signals.values()])
        if not valid.any():
            raise RunError("every sample of the recorder has a value that is not finite")
        meta = dict(self._meta)
        if "time" in signals:
            stamps = signals.pop("time")[:, 0]
            meta["start"] = f"{Decimal(str(stamps[0])).normalize():f}"
            time, valid, signals = self._uniform(stamps - stamps[0], valid, signals, meta)
        else:
            time = np.arange(self._count) / self._rate
        signals = {name: np.where(valid[:, None], each, 0.0) for name, each in signals.items()}
        if "base_pose" in signals:
            signals["base_pose"][~valid, 6] = 1.0  # a quaternion also in gaps
        filled, differentiated = with_velocities({"time": time, "valid": valid, **signals})
        fields: dict[str, Any] = dict(filled)
        if differentiated:
            meta["differentiated"] = differentiated
        names: dict[str, Any] = {"joint_names": self._joints, "desired_joint_names": self._desired}
        return Run(**fields, **names, robot=self._robot, meta=meta)

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the run of the samples so far, see `Run.save`."""
        self.run().save(path, overwrite=overwrite)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Save the samples so far; an error of the loop hides an error of saving."""
        try:
            if self._path is not None:
                self.save(self._path, overwrite=True)
        except RunError:
            if error is None:
                raise

    def _row(self, name: str, values: Values) -> Array:
        """Values of a sample, checked."""
        known = () if name in WIDTHS else self._joints
        names = known = self._desired if name.endswith("_desired") else known
        if isinstance(values, Mapping):
            names = known or tuple(values)
            if values.keys() != set(names):
                raise RunError(
                    f"{name}: joints {', '.join(values)}, expected {', '.join(names)};"
                    " joint_names=… names others"
                )
            values = [values[joint] for joint in names]
        try:
            row = np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise RunError(f"{name}: {values!r}, expected a number for each joint") from error
        width = WIDTHS.get(name, len(names))
        if row.ndim != 1 or (width and len(row) != width):
            listed = f" ({', '.join(names)}); joint_names=… names others" if names else ""
            raise RunError(f"{name}: shape {row.shape}, expected ({width or 'joints'},){listed}")
        if not known and name not in WIDTHS:
            self._joints = names or unnamed(len(row))
            self._desired = self._desired or self._joints
        return row

    def _check(self, rows: Mapping[str, Array]) -> None:
        """Refuse a sample with other signals than the first one, and time that does not rise."""
        sample = self._count + 1
        if self._count == 0 and not {"position", "velocity"} & set(rows):
            has = ", ".join(rows) or "nothing"
            raise RunError(f"velocity: missing, and position too; the sample has {has}")
        for name in sorted(self._values.keys() ^ rows.keys()) if self._count else ():
            how = "missing" if name in self._values else "new"
            raise RunError(f"{name}: {how} in sample {sample}; push it each time or never")
        if "time" in rows:
            before, now = self._values.get("time", [-inf])[-1], rows["time"][0]
            if not before < now < inf:
                raise RunError(f"time: {now:.9g} s in sample {sample}, after {before:.9g} s")

    def _uniform(
        self, stamps: Array, valid: Mask, signals: dict[str, Array], meta: dict[str, Any]
    ) -> tuple[Array, Mask, dict[str, Array]]:
        """Time base, validity and signals, resampled unless the stamps are uniform."""
        steps = np.diff(stamps)
        step = float(np.median(steps))
        if (np.abs(steps - step) <= UNIFORM * step).all():
            return stamps, valid, signals
        rate = self._rate if abs(self._rate * step - 1) <= NEAR else float(f"{1 / step:.6g}")
        deviations = steps[steps <= GAP * step] - 1 / rate
        rms = float(np.sqrt(np.mean(deviations**2)))
        meta["jitter"] = {"rms": rms, "max": float(np.abs(deviations).max())}
        time = np.arange(int(stamps[-1] * rate + UNIFORM) + 1) / rate
        known = stamps[valid]
        edges = [0, *(np.flatnonzero(np.diff(known) > GAP * step) + 1), len(known)]
        between = [slice(*each) for each in pairwise(edges)]
        found, reached = {}, valid
        for name, each in signals.items():
            values = each[valid]
            for stretch in between:  # angles without turns, quaternions without flips
                if name.startswith("position"):
                    values[stretch] = np.unwrap(values[stretch], axis=0)
                elif name == "base_pose":
                    values[stretch, 3:] = continuous_quaternions(values[stretch, 3:])
            found[name], reached = resample(known, values, time, between=between)
        if "base_pose" in found:
            norm = np.linalg.norm(found["base_pose"][:, 3:], axis=1, keepdims=True)
            found["base_pose"][:, 3:] /= np.where(norm > 0, norm, 1.0)
        return time, reached, found
