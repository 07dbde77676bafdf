"""The run: one recording of one robot, checked when it is made, and what becomes of its signals."""

import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from noisemodel import runfile
from noisemodel.files import beyond, limit
from noisemodel.hold import joined, moments, updates
from noisemodel.runfile import OnDemand, either_way, one_line, pieces, rows_at_once
from noisemodel.types import Array, Mask, Real, RunError, RunFileError

# The fields of a run that hold a row or a value for each sample; ``stages`` hold such fields.
SAMPLED = (
    *("time", "velocity", "position", "velocity_desired", "position_desired"),
    *("effort", "valid", "base_pose", "base_velocity"),
)

# The fields of a run that a classifier takes signals of.
MOTION = ("velocity", "velocity_desired", "effort", "base_velocity")

ROBOT_FILES = (".urdf", ".xml", ".mjcf")  # how the names of files that describe robots end
# How far a time step may lie from the median step, as a share of it (run file, version 1).
UNIFORM = 1e-3
SHORTEST, LONGEST = 1e-9, 1e9  # steps of time that a run may have, in [s]
LATEST = 9e9  # largest time, in [s]: 285 years, what nanoseconds in 64 bits can count
LARGEST = 1e15  # signals are smaller: squares of much larger ones overflow, and no robot has such

WINDOW, ORDER = 7, 3
METHOD = f"Savitzky-Golay, window {WINDOW}, order {ORDER}"
# The joint velocities and the positions that each can be differentiated from.
SOURCES = {"velocity": "position", "velocity_desired": "position_desired"}

EDGE = 10  # samples at the lower rate that the filter of `decimated` reaches to either side


class NotUniformError(RunError):
    """A run whose time is not uniform: a log, to be resampled."""


@dataclass(frozen=True, order=True)
class Block:
    """A stretch of time with a label, which is opaque to the noise model."""

    start: float  #: time of its first sample, in [s]
    stop: float  #: time of its end, in [s]
    label: str  #: the class that an annotator or a simulator gave it


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Run:
    """One recording of one robot, in SI units; optional signals are None or empty.

    Raises:
        RunError: If shapes do not fit, a value is not finite, time is not uniform,
            names repeat, or blocks overlap.
    """

    time: Array  #: uniform to 1e-3 of its step, shape (samples,), in [s]
    velocity: Real  #: of the joints, shape (samples, joints), in [rad/s] or [m/s]
    joint_names: tuple[str, ...]  #: in any order
    position: Real | None = None  #: of the joints, shape (samples, joints), in [rad] or [m]
    velocity_desired: Real | None = None  #: shape (samples, desired)
    position_desired: Real | None = None  #: shape (samples, desired)
    desired_joint_names: tuple[str, ...] = ()  #: `joint_names` unless given
    #: Velocities at named stages of the control flow, each (samples, joints).
    stages: Mapping[str, Real] = field(default_factory=dict)
    #: Torques or forces, shape (samples, joints), in [N m] or [N]; of some logs currents, in [A].
    effort: Real | None = None
    #: False in gaps, where all values are 0, shape (samples,); all true unless given.
    valid: Mask | None = None
    #: x, y, z and quaternion x, y, z, w of a floating base, shape (samples, 7).
    base_pose: Real | None = None
    #: Linear, then angular velocity of the base in its own axes, shape (samples, 6).
    base_velocity: Real | None = None
    #: Name of a listed robot or of one of MuJoCo Menagerie, or path of a URDF or an MJCF.
    robot: str | None = None
    blocks: tuple[Block, ...] = ()  #: annotated stretches, sorted, not overlapping
    meta: Mapping[str, Any] = field(default_factory=dict)  #: scenario, seed, software version…

    def __post_init__(self) -> None:
        """Fill in defaults and check everything once."""
        assign = object.__setattr__
        assign(self, "time", np.asarray(self.time, dtype=np.float64))
        assign(self, "desired_joint_names", self.desired_joint_names or self.joint_names)
        assign(self, "blocks", tuple(sorted(self.blocks)))
        assign(self, "stages", MappingProxyType(dict(self.stages)))
        assign(self, "meta", MappingProxyType(dict(self.meta)))
        check_time(self.time)
        if self.valid is None:
            assign(self, "valid", np.ones(len(self.time), dtype=bool))
        check_valid(self.mask, len(self.time))
        check_names("joint_names", self.joint_names)
        if not self.joint_names and self.base_velocity is None:
            raise RunError("joint_names: there are no joints, and the base does not move")
        check_names("desired_joint_names", self.desired_joint_names)
        check_words("stages", self.stages)
        for name, signal, width in self._signals():
            check_signal(name, signal, (len(self.time), width))
        if self.base_pose is not None:
            check_quaternions(self.base_pose, self.mask)
        check_blocks(self.blocks, self.time)

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
        """Nominal sample rate: the inverse of the mean step, in [Hz].

        It has the fewest digits, up to nine, that the precision of the times allows: dates in
        seconds since 1970 have the rate of the same samples from 0 s on.
        """
        first, last = float(self.time[0]), float(self.time[-1])
        rate = (len(self.time) - 1) / (last - first)
        unsure = rate * 2.0 * float(np.spacing(max(abs(first), abs(last)))) / (last - first)
        found = (float(f"{rate:.{digits}g}") for digits in range(1, 10))
        return next((each for each in found if abs(each - rate) <= unsure), float(f"{rate:.9g}"))

    @property
    def duration(self) -> float:
        """Time that the samples cover, in [s]."""
        return len(self.time) / self.rate

    @property
    def motion(self) -> Real:
        """All measured velocities, a floating base's first (paper, Sec. II-A), (samples, n)."""
        base, joints = self.base_velocity, self.velocity
        if base is None:
            return joints
        return either_way(
            (base, joints),
            (len(joints), base.shape[1] + joints.shape[1]),
            lambda first, stop: np.hstack((base[first:stop], joints[first:stop])),
            np.result_type(base.dtype, joints.dtype),
        )

    def cut(self, start: float, stop: float) -> "Run":
        """The part of the run with ``start <= time < stop``, in [s], and all that belongs to it.

        Times, names and meta stay. Blocks that reach out of the part are clipped: to its first
        sample and to ``stop``. A part of fewer than two samples, or of gaps alone, is a RunError.
        """
        first, last = np.searchsorted(self.time, (start, stop)).tolist()
        if last - first < 2:
            raise RunError(
                f"{max(0, last - first)} samples from {start:g} s to {stop:g} s, expected 2 at"
                f" least; the run has {self.time[0]:g} s to {self.time[-1]:g} s"
            )
        begin = float(self.time[first])
        clipped = [
            replace(b, start=begin if b.start < start else b.start, stop=min(b.stop, stop))
            for b in self.blocks
        ]
        return part(self, first, last, blocks=tuple(b for b in clipped if b.start < b.stop))

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the run as a run file, whole or not at all; an OutputError if that fails."""
        path = Path(path)
        arrays: dict[str, Any] = {
            "format": runfile.FORMAT,
            "time": self.time,
            "joint_names": np.array(self.joint_names, dtype=str),
            **{name: signal for name, signal, _ in self._signals()},
            "meta": json.dumps(dict(self.meta), sort_keys=True),
        }
        if self.desired_joint_names != self.joint_names:
            arrays["desired_joint_names"] = np.array(self.desired_joint_names, dtype=str)
        if not self.mask.all():
            arrays["valid"] = self.mask
        if self.robot is not None:
            moves = is_robot_file(self.robot) and not Path(self.robot).is_absolute()
            arrays["robot"] = os.path.relpath(self.robot, path.parent) if moves else self.robot
        if self.blocks:
            for name in ("start", "stop", "label"):
                arrays[f"block_{name}"] = np.array([getattr(each, name) for each in self.blocks])
        runfile.write(path, arrays, overwrite=overwrite)

    @classmethod
    def load(cls, path: str | Path, *, on_demand: bool = False) -> Self:
        """Read a run file; a RunFileError if it is none, or holds a run that is wrong.

        Velocities that are missing are differentiated from positions, and listed under
        ``differentiated`` in ``meta``. A robot by a relative path is looked for beside the file.
        Where ``on_demand``, signals of 64 MB or more stay in the file, unless they are compressed:
        rows are read where they are sliced; whatever else is done with them reads them whole.
        """
        path = Path(path)
        arrays = runfile.read(path, on_demand=on_demand)
        try:
            return cls(**_fields(arrays, folder=path.parent))
        except RunError as error:
            raise RunFileError(path, str(error)) from error


def part(run: Run, first: int, stop: int, **changes: Any) -> Run:
    """Samples of a run from a first one to the one after the last, see `rows_of`."""
    return rows_of(run, slice(first, stop), **changes)


def rows_of(run: Run, rows: slice | NDArray[np.intp], **changes: Any) -> Run:
    """Some samples of a run, without its blocks.

    ``changes`` are other fields of the result, as ``dataclasses.replace`` takes them.
    """
    signals = {name: getattr(run, name) for name in SAMPLED if name not in changes}
    fields: dict[str, Any] = {
        name: None if signal is None else signal[rows] for name, signal in signals.items()
    }
    if "stages" not in changes:
        fields["stages"] = {name: stage[rows] for name, stage in run.stages.items()}
    return replace(run, **({"blocks": ()} | fields | changes))


def unnamed(joints: int) -> tuple[str, ...]:
    """Names of joints that have none: joint_0, joint_1 and so on."""
    return tuple(f"joint_{number}" for number in range(joints))


def pieces_of(run: Run, *, samples: int | None = None) -> Iterator[Run]:
    """The motion of a run, the fields ``MOTION``, in pieces that fit into memory.

    They are not checked again: one may be a gap alone. They have megabytes unless ``samples`` each.
    """
    names = ("joint_names", "desired_joint_names", "robot", "meta", "rate")
    whole = dict.fromkeys(SAMPLED) | {name: getattr(run, name) for name in names}
    whole |= {"stages": MappingProxyType({}), "blocks": ()}
    motion = {name: getattr(run, name) for name in ("time", "valid", *MOTION)}
    size = samples or rows_at_once(run.motion)
    for first in range(0, len(run.time), size):
        rows = slice(first, first + size)
        fields = {name: None if each is None else each[rows] for name, each in motion.items()}
        piece: Run = object.__new__(Run)
        vars(piece).update(whole | fields)
        yield piece


def stretches(valid: Mask | None, samples: int) -> Iterator[slice]:
    """Stretches between gaps that hold two samples or more."""
    if valid is None:
        valid = np.ones(samples, dtype=bool)
    edges = [0, *(np.flatnonzero(np.diff(valid)) + 1), samples]
    for start, stop in pairwise(edges):
        if valid[start] and stop - start > 1:
            yield slice(start, stop)


def is_robot_file(name: str) -> bool:
    """Whether a text is the path of a URDF or an MJCF, by its end."""
    return name.lower().endswith(ROBOT_FILES)


# What a run file and a run have in common.


def _fields(arrays: Mapping[str, NDArray[Any]], *, folder: Path) -> dict[str, Any]:
    """What makes a `Run` of the arrays of a run file in a folder."""
    sampled = (name for name in arrays if "samples" in runfile.ARRAYS.get(name, ("", ()))[1])
    signals = {name: arrays[name] for name in sampled}
    if "time" not in signals or not {"velocity", "position"} & set(signals):
        has = ", ".join(arrays) or "nothing"
        raise RunError(f"it has {has}, expected 'time', and 'velocity' or 'position'")
    check_time(signals["time"])
    if "valid" in signals:
        check_valid(signals["valid"], len(signals["time"]))
    signals, differentiated = with_velocities(signals)
    meta = _meta(str(arrays.get("meta", "{}")))
    if differentiated:
        meta["differentiated"] = differentiated
    velocity = signals["velocity"]
    samples, joints = len(signals["time"]), velocity.shape[-1]
    if velocity.ndim == 2 and len(velocity) != samples and joints == samples:
        joints = len(velocity)  # transposed, which the error states
    robot = str(arrays.get("robot", ""))
    columns = [arrays.get(f"block_{name}", np.empty(0)) for name in ("start", "stop", "label")]
    if len({column.shape for column in columns}) > 1:
        shapes = ", ".join(str(column.shape) for column in columns)
        raise RunError(f"block_start, block_stop and block_label have shapes {shapes}")
    stages = [name for name in arrays if name.startswith(runfile.STAGE)]
    return {
        **signals,
        "joint_names": tuple(map(str, arrays.get("joint_names", unnamed(joints)))),
        "desired_joint_names": tuple(map(str, arrays.get("desired_joint_names", ()))),
        "stages": {name.removeprefix(runfile.STAGE): arrays[name] for name in stages},
        "robot": str(folder / robot) if is_robot_file(robot) else robot or None,
        "blocks": tuple(
            Block(float(a), float(b), str(c)) for a, b, c in zip(*columns, strict=True)
        ),
        "meta": meta,
    }


def _meta(text: str) -> dict[str, Any]:
    """The JSON object that a run file has as meta."""
    try:
        meta = json.loads(text)
        json.dumps(meta, ensure_ascii=False).encode()  # half of a surrogate pair cannot be written
    except (ValueError, RecursionError) as error:
        raise RunError(f"meta: no JSON that can be kept ({one_line(error)})") from error
    if not isinstance(meta, dict) or not isinstance(meta.get("differentiated", {}), dict):
        raise RunError("meta: expected a JSON object, and one as differentiated")
    return meta


# What makes a run valid.


def median_step(time: Array) -> float:
    """Median of the steps of time, in [s]; time has shape (samples,)."""
    return float(np.median(np.diff(time), overwrite_input=True))  # no second copy


def check_time(time: Array) -> None:
    """Refuse a time that is not finite, not rising or not uniform, naming the row."""
    if time.ndim != 1 or len(time) < 2:
        raise RunError(f"time: shape {time.shape}, expected (samples,) with at least 2 samples")
    rising = time[1:] > time[:-1]  # what is no number is not
    if not rising.all():
        row = int(np.argmin(rising)) + 1
        before, after = time[row - 1 : row + 1].tolist()
        raise RunError(f"time: does not rise to row {row} ({before:.9g} s, then {after:.9g} s)")
    step = median_step(time)
    if not SHORTEST <= step <= LONGEST:
        raise RunError(
            f"time: the median step is {step:g} s, expected {SHORTEST:g} s to {LONGEST:g} s"
        )
    if (farthest := max(abs(time[0]), abs(time[-1]))) > LATEST:
        raise RunError(f"time: {farthest:.9g} s, expected seconds, {LATEST:g} at most")
    # Stamps far from zero cannot be finer than their own spacing.
    tolerance = max(UNIFORM * step, 2 * np.spacing(farthest))
    for rows in pieces(time):
        steps = np.diff(time[rows.start : rows.stop + 1])
        uneven = np.abs(steps - step) > tolerance
        if uneven.any():
            row = int(np.argmax(uneven))
            raise NotUniformError(
                f"time: not uniform, the step to row {rows.start + row + 1} is {steps[row]:.6g} s"
                f" where the median is {step:.6g} s; `inspector import` resamples such logs (and"
                " float32 is too coarse)"
            )


def check_words(array: str, words: Iterable[str]) -> None:
    """Refuse words that are empty or hold what cannot be printed on one line."""
    for word in words:
        if not word or not word.isprintable():
            raise RunError(f"{array}: {word!r} is no name; it is empty or cannot be printed")


def check_names(array: str, names: Sequence[str]) -> None:
    """Refuse names that are no words or repeat."""
    check_words(array, names)
    if len(names) > limit("joints"):
        raise RunError(f"{array}: {len(names)} joints, {beyond('joints')}")
    if twice := sorted(name for name, count in Counter(names).items() if count > 1):
        raise RunError(f"{array}: {', '.join(twice)} named twice")


def check_signal(name: str, signal: Real, shape: tuple[int, int]) -> None:
    """Refuse a signal of another kind or shape, or with values that are not finite."""
    if signal.dtype.kind != "f":
        raise RunError(f"{name}: holds {signal.dtype}, expected floating-point numbers")
    if signal.shape != shape:
        turned = signal.ndim == 2 and signal.shape[1] == shape[0] != signal.shape[0]
        hint = "; samples come first, is it transposed?" if turned else ""
        raise RunError(f"{name}: shape {signal.shape}, expected {shape}{hint}")
    if isinstance(signal, OnDemand):
        if signal.checked:
            return
        signal.checked = True
    largest = np.float64(LARGEST)  # no float16
    for rows in pieces(signal):
        values = signal[rows]
        finite = (values > -largest) & (values < largest)
        if finite.all():
            continue
        row, column = np.argwhere(~finite)[0]
        value, place = values[row, column], f"row {rows.start + row}, column {column}"
        if np.isfinite(value):
            raise RunError(f"{name}: {value:g} in {place}; expected numbers below {LARGEST:g}")
        raise RunError(f"{name}: {value} in {place}; mark gaps with valid = false and zeros")


def check_valid(valid: Mask, samples: int) -> None:
    """Refuse a mask that is not one boolean per sample, or that leaves nothing."""
    if valid.dtype != np.bool_ or valid.shape != (samples,):
        given = f"shape {valid.shape} of {valid.dtype}"
        raise RunError(f"valid: {given}, expected {(samples,)} of bool")
    if not valid.any():
        raise RunError("valid: false in every sample, no sample is left")


def check_blocks(blocks: Sequence[Block], time: Array) -> None:
    """Refuse blocks that are empty, lie outside of the run or overlap."""
    check_words("block_label", (block.label for block in blocks))
    step = (time[-1] - time[0]) / (len(time) - 1)
    for start, stop, label in ((each.start, each.stop, each.label) for each in blocks):
        if not start < stop:
            raise RunError(f"block {label!r}: starts at {start:.6g} s, stops at {stop:.6g} s")
        if start < time[0] - step or stop > time[-1] + 2 * step:
            raise RunError(
                f"block {label!r}: {start:.6g} s to {stop:.6g} s lies outside of the run,"
                f" {time[0]:.6g} s to {time[-1]:.6g} s"
            )
    for before, after in pairwise(blocks):
        if after.start < before.stop - step:
            raise RunError(
                f"blocks overlap: {before.label!r} until {before.stop:.6g} s"
                f" and {after.label!r} from {after.start:.6g} s"
            )


def check_quaternions(pose: Real, valid: Mask) -> None:
    """Refuse poses whose quaternions are not of length 1 (in valid samples)."""
    for rows in pieces(pose):
        norm = np.linalg.norm(pose[rows][:, 3:], axis=1)
        wrong = (np.abs(norm - 1) > 0.01) & valid[rows]
        if wrong.any():
            row = int(np.argmax(wrong))
            raise RunError(
                f"base_pose: the quaternion in row {rows.start + row} has norm {norm[row]:.3g},"
                " expected 1 (order x, y, z, w)"
            )


# Velocities from positions, where a log holds none.


def with_velocities(
    signals: Mapping[str, NDArray[Any]],
) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
    """Add the velocities that can be differentiated; and how, by the name of each."""
    time, filled = signals["time"], dict(signals)
    valid = signals.get("valid", np.ones(len(time), dtype=bool))
    for velocity, position in SOURCES.items():
        if velocity not in signals and position in signals:
            source = signals[position]
            check_signal(position, source, (len(time), source.shape[1]))
            filled[velocity] = joint_velocity(time, source, valid)
    if "base_velocity" not in signals and "base_pose" in signals:
        pose = signals["base_pose"]
        check_signal("base_pose", pose, (len(time), 7))
        check_quaternions(pose, valid)
        filled["base_velocity"] = base_velocity(time, pose, valid)
    return filled, {name: METHOD for name in filled if name not in signals}


def derived(run: Run, signal: str) -> str:
    """How a signal of a run was differentiated, as its ``meta`` states; empty if it was logged."""
    differentiated = run.meta.get("differentiated")
    return str(differentiated.get(signal, "")) if isinstance(differentiated, Mapping) else ""


def joint_velocity(time: Array, position: Real, valid: Mask | None = None) -> Array:
    """Velocities of joints, shape (samples, joints), from their positions at uniform times.

    Angles that wrap are made continuous first, and held positions are interpolated between the
    samples that set them. Velocities are 0 in gaps, where ``valid`` is False, and in stretches of a
    single sample.
    """
    step = median_step(time)

    def unwrapped(values: Array) -> Array:
        return np.unwrap(values, axis=0)

    width = position.shape[1]
    return _by_stretch(unwrapped, lambda values: _slope(values, step), position, width, valid)


def base_velocity(time: Array, pose: Real, valid: Mask | None = None) -> Array:
    """Linear, then angular velocity of a floating base in its own axes, shape (samples, 6).

    ``pose`` is x, y, z and quaternion x, y, z, w, shape (samples, 7); gaps and held poses as in
    `joint_velocity`.
    """
    step = median_step(time)

    def continuous(pose: Array) -> Array:
        return np.hstack((pose[:, :3], continuous_quaternions(pose[:, 3:])))

    def twist(pose: Array) -> Array:
        quaternion = pose[:, 3:] / np.linalg.norm(pose[:, 3:], axis=1, keepdims=True)
        vector, scalar = quaternion[:, :3], quaternion[:, 3:]
        rate = _slope(quaternion, step)
        # omega = 2 vec(conj(q) q_dot), v = R(q)^T p_dot
        angular = 2 * (scalar * rate[:, :3] - vector * rate[:, 3:] - np.cross(vector, rate[:, :3]))
        world = _slope(pose[:, :3], step)
        across = 2 * np.cross(-vector, world)
        linear = world + scalar * across + np.cross(-vector, across)
        return np.hstack((linear, angular))

    return _by_stretch(continuous, twist, pose, 6, valid)


def _by_stretch(
    continuous: Callable[[Array], Array],
    derivative: Callable[[Array], Array],
    signal: Real,
    width: int,
    valid: Mask | None,
) -> Array:
    """Derivative of each stretch between gaps, on demand of a signal on demand."""
    hold, places = updates(signal, valid)
    set_at = moments(places) if hold > 1 else places
    # The fit reaches three samples to each side, and a window at the end of a stretch; what is
    # between two samples that set values depends on three more to each side.
    reach = WINDOW + (round(5 * hold) if hold > 1 else 0)

    def rows(first: int, stop: int) -> Array:
        low, high = max(0, first - reach), min(len(signal), stop + reach)
        values, around = signal[low:high], None if valid is None else valid[low:high]
        found = np.zeros((high - low, width))
        for stretch in stretches(around, len(found)):
            some = continuous(values[stretch].astype(np.float64))
            if hold > 1:
                start = low + stretch.start
                some = joined(some, places - start, set_at - start)
            found[stretch] = derivative(some)
        return found[first - low : stop - low]

    return either_way((signal,), (len(signal), width), rows)


def continuous_quaternions(quaternion: Array) -> Array:
    """Quaternions, shape (samples, 4), each with the sign that is nearer to the one before."""
    flips = np.einsum("si,si->s", quaternion[1:], quaternion[:-1]) < 0
    signs = np.concatenate(([1.0], np.cumprod(np.where(flips, -1.0, 1.0))))
    return np.asarray(quaternion * signs[:, None])


def _slope(values: Array, step: float) -> Array:
    """Differentiate by Savitzky and Golay; short stretches by differences."""
    if len(values) < WINDOW:
        return np.asarray(np.gradient(values, step, axis=0))
    from scipy.signal import savgol_filter

    return np.asarray(savgol_filter(values, WINDOW, ORDER, deriv=1, delta=step, axis=0))


# Other rates and instants.


def resample(
    stamps: Array,
    values: Real,
    instants: Array,
    *,
    between: Sequence[slice] | None = None,
    slack: float = 0.0,
) -> tuple[Array, Mask]:
    """Values at other instants: monotone between samples (PCHIP), without overshoot.

    Held values stay held, unless the instants come less than twice as often as they are set: then
    they are interpolated between the samples that set them.

    Stamps and instants rise, in [s]; values, (samples, columns), are continuous, also angles.
    ``between`` has the samples of each stretch between gaps; an instant may lie outside of one by a
    slack, in [s]. Returns values, 0 in gaps, (instants, columns), and which are in no gap.
    """
    from scipy.interpolate import PchipInterpolator

    found = np.zeros((len(instants), values.shape[1]))
    reached = np.zeros(len(instants), dtype=bool)
    hold, places = updates(values)
    if hold > 1 and hold * median_step(stamps) < 2 * np.ptp(instants[:2]):
        hold, values = 1.0, joined(values.astype(np.float64), places, moments(places))
    for stretch in between or [slice(0, len(stamps))]:
        known = stamps[stretch]
        if len(known) < 2:
            continue
        first = int(np.searchsorted(instants, known[0] - slack))
        stop = int(np.searchsorted(instants, known[-1] + slack, side="right"))
        if first < stop:
            some, inside = values[stretch], instants[first:stop]
            nearest = np.searchsorted((known[1:] + known[:-1]) / 2, inside)
            held = hold > 1
            found[first:stop] = some[nearest] if held else PchipInterpolator(known, some)(inside)
            reached[first:stop] = True
    return found, reached


def decimated(run: Run, rate: float) -> Run:
    """The run at a lower rate, in [Hz]: its velocities, low-pass filtered and decimated.

    The noise of a run at a lower rate is computed after this: it is not the decimated noise. The
    result has the velocities alone (measured, desired, base, stages), names, blocks and meta.
    Samples that the filter took partly from a gap are marked as not valid.

    Raises:
        RunError: If ``rate`` is above the run's, or leaves fewer than two samples.
    """
    ratio = Fraction(rate / run.rate).limit_denominator(1000)  # jitter of 0.1 % is none
    samples = int(len(run.time) * ratio)
    if ratio > 1 or samples < 2:
        about = f"a run of {run.duration:.3g} s at {run.rate:g} Hz"
        raise RunError(f"{about} cannot be decimated to {rate:g} Hz")
    if ratio == 1:
        return run

    time = run.time[0] + np.arange(samples) / rate
    valid = np.ones(samples, dtype=bool)
    for gap in np.flatnonzero(~run.mask).tolist():
        center = int(gap * ratio)
        valid[max(0, center - EDGE) : center + EDGE + 1] = False
    # Positions, efforts and poses are left out.
    fields: dict[str, Any] = dict.fromkeys(set(SAMPLED) - {"time", "valid"})
    for name in ("velocity", "velocity_desired", "base_velocity"):
        if (signal := getattr(run, name)) is not None:
            fields[name] = _lower(signal, ratio)
    lower = fields["velocity"]

    def silent_in_gaps(first: int, stop: int) -> Array:
        return np.where(valid[first:stop, None], lower[first:stop], 0.0)

    fields["velocity"] = either_way((lower,), lower.shape, silent_in_gaps)
    fields["stages"] = {name: _lower(stage, ratio) for name, stage in run.stages.items()}
    return replace(run, time=time, valid=valid, **fields)


def _lower(signal: Real, ratio: Fraction) -> Real:
    """A signal at a share of its rate, on demand of one on demand."""
    from scipy.signal import resample_poly

    up, down = ratio.numerator, ratio.denominator
    samples = int(len(signal) * ratio)
    if not isinstance(signal, OnDemand):
        exact = signal.astype(np.float64)
        return np.asarray(resample_poly(exact, up, down, axis=0, padtype="line")[:samples])
    # What "line" means: before and after the signal goes on as from its first to its last sample.
    first, last = (signal[at : at + 1].astype(np.float64) for at in (0, len(signal) - 1))
    slope = (last - first) / (len(signal) - 1)
    reach = EDGE * max(up, down) // (up * down) + 2  # of the filter, in `down` samples

    def block(start: int, stop: int) -> Array:
        low, high = (start // up - reach) * down, (-(-stop // up) + reach) * down
        before = first + slope * np.arange(low, 0)[:, None]
        after = last + slope * np.arange(1, high - len(signal) + 1)[:, None]
        inside = signal[max(0, low) : min(high, len(signal))].astype(np.float64)
        around = np.concatenate((before, inside, after))
        found = resample_poly(around, up, down, axis=0)
        return np.asarray(found[start - low // down * up :][: stop - start])

    def rows(start: int, stop: int) -> Array:
        size = max(1, int(rows_at_once(signal) * ratio))
        edges = [*range(start, stop, size), stop]
        return np.concatenate([block(*each) for each in pairwise(edges)] or [block(start, stop)])

    return either_way((signal,), (samples, signal.shape[1]), rows)
