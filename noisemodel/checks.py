"""What makes a run valid."""

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np

from noisemodel.block import Block
from noisemodel.bounds import beyond, limit
from noisemodel.errors import RunError
from noisemodel.ondemand import OnDemand, pieces
from noisemodel.types import Array, Mask, Real

UNIFORM = 1e-3
"""How far a time step may lie from the median step, as a share of it (run file, version 1)."""

SHORTEST, LONGEST = 1e-9, 1e9
"""Steps of time that a run may have, in [s]."""

LARGEST = 1e15
"""Signals are smaller: the squares of much larger ones overflow, and no robot has such."""


class NotUniformError(RunError):
    """A run whose time is not uniform: a log, to be resampled."""


def check_time(time: Array) -> None:
    """Refuse a time that is not finite, not rising or not uniform, naming the row."""
    if time.ndim != 1 or len(time) < 2:
        raise RunError(f"time: shape {time.shape}, expected (samples,) with at least 2 samples")
    finite = np.isfinite(time)
    if not finite.all():
        raise RunError(f"time: {time[~finite][0]} in row {int(np.argmin(finite))}")
    rising = time[1:] > time[:-1]
    if not rising.all():
        row = int(np.argmin(rising)) + 1
        how = "stands still" if time[row] == time[row - 1] else "runs backwards"
        raise RunError(f"time: {how} in row {row} ({time[row - 1]:.9g} s, then {time[row]:.9g} s)")
    step = median_step(time)
    if not SHORTEST <= step <= LONGEST:
        raise RunError(
            f"time: the median step is {step:g} s, expected {SHORTEST:g} s to {LONGEST:g} s"
        )
    # Stamps far from zero cannot be finer than their own spacing.
    tolerance = max(UNIFORM * step, 2 * np.spacing(max(abs(time[0]), abs(time[-1]))))
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


def median_step(time: Array) -> float:
    """Median of the steps of time, in [s]; time has shape (samples,)."""
    return float(np.median(np.diff(time), overwrite_input=True))  # no second copy


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
    twice = sorted(name for name, count in Counter(names).items() if count > 1)
    if twice:
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
        part = signal[rows]
        finite = (part > -largest) & (part < largest)
        if finite.all():
            continue
        row, column = np.argwhere(~finite)[0]
        value, place = part[row, column], f"row {rows.start + row}, column {column}"
        if np.isfinite(value):
            raise RunError(f"{name}: {value:g} in {place}; expected numbers below {LARGEST:g}")
        raise RunError(f"{name}: {value} in {place}; mark gaps with valid = false and zeros")


def check_valid(valid: Mask, samples: int) -> None:
    """Refuse a mask that is not one boolean per sample, or that leaves nothing."""
    if valid.dtype != np.bool_ or valid.shape != (samples,):
        raise RunError(
            f"valid: shape {valid.shape} of {valid.dtype}, expected {(samples,)} of bool"
        )
    if not valid.any():
        raise RunError("valid: false in every sample, no sample is left")


def check_blocks(blocks: Sequence[Block], time: Array) -> None:
    """Refuse blocks that are empty, lie outside of the run or overlap."""
    check_words("block_label", (block.label for block in blocks))
    step = (time[-1] - time[0]) / (len(time) - 1)
    for block in blocks:
        if not block.start < block.stop:
            raise RunError(
                f"block {block.label!r}: starts at {block.start:.6g} s, stops at {block.stop:.6g} s"
            )
        if block.start < time[0] - step or block.stop > time[-1] + 2 * step:
            raise RunError(
                f"block {block.label!r}: {block.start:.6g} s to {block.stop:.6g} s lies outside of"
                f" the run, {time[0]:.6g} s to {time[-1]:.6g} s"
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
