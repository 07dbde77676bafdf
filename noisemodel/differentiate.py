"""Velocities from positions, where a log holds none."""

from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from noisemodel import checks
from noisemodel.ondemand import OnDemand
from noisemodel.types import Array, Mask, Real

WINDOW, ORDER = 7, 3
METHOD = f"Savitzky-Golay, window {WINDOW}, order {ORDER}"
SOURCES = {"velocity": "position", "velocity_desired": "position_desired"}
"""The joint velocities and the positions that each can be differentiated from."""


def fill_in(
    signals: Mapping[str, NDArray[Any]],
) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
    """Add the velocities that are missing and can be differentiated.

    Args:
        signals: Arrays of a run file by name, ``time`` among them.

    Returns:
        The signals with velocities added, and by the name of each added one how it was made.

    Raises:
        RunError: If positions do not fit the time, or are not finite.
    """
    time, filled = signals["time"], dict(signals)
    valid = signals.get("valid", np.ones(len(time), dtype=bool))
    for velocity, position in SOURCES.items():
        if velocity not in signals and position in signals:
            source = signals[position]
            checks.check_signal(position, source, (len(time), source.shape[1]))
            filled[velocity] = joint_velocity(time, source, valid)
    if "base_velocity" not in signals and "base_pose" in signals:
        pose = signals["base_pose"]
        checks.check_signal("base_pose", pose, (len(time), 7))
        checks.check_quaternions(pose, valid)
        filled["base_velocity"] = base_velocity(time, pose, valid)
    how = {name: METHOD for name in filled if name not in signals}
    return filled, how


def joint_velocity(time: Array, position: Real, valid: Mask | None = None) -> Array:
    """Differentiate joint positions; angles that wrap are made continuous first.

    Args:
        time: Uniform, shape (samples,), in [s].
        position: Shape (samples, joints), in [rad] or [m].
        valid: False in gaps, shape (samples,).

    Returns:
        Velocities, shape (samples, joints), in [rad/s] or [m/s]; 0 in gaps and in stretches
        of a single sample.
    """
    step = checks.median_step(time)

    def slope(part: Real) -> Array:
        return _slope(np.unwrap(part.astype(np.float64), axis=0), step)

    return _by_stretch(slope, position, position.shape[1], valid)


def base_velocity(time: Array, pose: Real, valid: Mask | None = None) -> Array:
    """Differentiate the pose of a floating base.

    Args:
        time: Uniform, shape (samples,), in [s].
        pose: x, y, z and quaternion x, y, z, w, shape (samples, 7), in [m].
        valid: False in gaps, shape (samples,).

    Returns:
        Linear, then angular velocity in the base's own axes, shape (samples, 6),
        in [m/s] and [rad/s].
    """
    step = checks.median_step(time)
    return _by_stretch(lambda part: _body_twist(part.astype(np.float64), step), pose, 6, valid)


def _by_stretch(
    derivative: Callable[[Real], Array], signal: Real, width: int, valid: Mask | None
) -> Array:
    """Derivative of each stretch between gaps, on demand of a signal on demand."""

    def whole(part: slice) -> Array:
        found = np.zeros((part.stop - part.start, width))
        values = signal[part]
        for stretch in stretches(None if valid is None else valid[part], len(found)):
            found[stretch] = derivative(values[stretch])
        return found

    def rows(first: int, stop: int) -> Array:
        # The fit reaches three samples to each side, and a window at the end of a stretch.
        low, high = max(0, first - WINDOW), min(len(signal), stop + WINDOW)
        return whole(slice(low, high))[first - low : stop - low]

    if isinstance(signal, OnDemand):
        return cast(Array, OnDemand((len(signal), width), np.float64, rows))
    return whole(slice(0, len(signal)))


def stretches(valid: Mask | None, samples: int) -> Iterator[slice]:
    """Go through the stretches between gaps that hold two samples or more."""
    if valid is None:
        valid = np.ones(samples, dtype=bool)
    edges = [0, *(np.flatnonzero(np.diff(valid)) + 1), samples]
    for start, stop in pairwise(edges):
        if valid[start] and stop - start > 1:
            yield slice(start, stop)


def _body_twist(pose: Array, step: float) -> Array:
    quaternion = pose[:, 3:] / np.linalg.norm(pose[:, 3:], axis=1, keepdims=True)
    # q and -q are one rotation: keep the sign that lies nearer to the sample before.
    flips = np.einsum("si,si->s", quaternion[1:], quaternion[:-1]) < 0
    signs = np.concatenate(([1.0], np.cumprod(np.where(flips, -1.0, 1.0))))
    quaternion = quaternion * signs[:, None]
    vector, scalar = quaternion[:, :3], quaternion[:, 3:]
    rate = _slope(quaternion, step)
    # omega = 2 vec(conj(q) q_dot), v = R(q)^T p_dot
    angular = 2 * (scalar * rate[:, :3] - vector * rate[:, 3:] - np.cross(vector, rate[:, :3]))
    world = _slope(pose[:, :3], step)
    across = 2 * np.cross(-vector, world)
    linear = world + scalar * across + np.cross(-vector, across)
    return np.hstack((linear, angular))


def _slope(values: Array, step: float) -> Array:
    """Differentiate by Savitzky and Golay; short stretches by differences."""
    if len(values) < WINDOW:
        return np.asarray(np.gradient(values, step, axis=0))
    from scipy.signal import savgol_filter

    return np.asarray(savgol_filter(values, WINDOW, ORDER, deriv=1, delta=step, axis=0))
