"""Signals: the input of a classifier, one noise estimate or several signals by name; array types.

A signal is a norm, shape (samples,), or what the norm is of, joint by joint, shape
(joints, samples), by its name. Stacked, they are rows: norms first, and then all joints of
one signal after the joints of the other.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import DTypeLike, NDArray

from noiseclassifier.errors import MissingSignalError, SignalError

Array: TypeAlias = NDArray[np.float64]
Real: TypeAlias = NDArray[np.floating[Any]]
Mask: TypeAlias = NDArray[np.bool_]
Index: TypeAlias = NDArray[np.intp]
Words: TypeAlias = NDArray[np.str_]

# The one signal of the paper, p_hat = sqrt(|qd|^2 + |qd_desired|^2) (Sec. II-A).
NOISE = "noise"
MOTION = ("desired", "measured", "error")  # norms of the velocities of a run with a desired motion
JOINTS = tuple(f"{name}_joints" for name in MOTION)  # the same, joint by joint
EFFORT = "effort_joints"  # joint torques, forces or motor currents, in any unit
BY_JOINT = (*JOINTS, EFFORT)  # signals that have a row for each joint
# The noise, shape (samples,), or signals by name: norms of that shape, and what goes joint by
# joint, shape (joints, samples).
Signals: TypeAlias = Real | Mapping[str, Real]


def named(signals: Signals) -> Mapping[str, Real]:
    """Signals by name; one alone is the noise."""
    return signals if isinstance(signals, Mapping) else {NOISE: signals}


def without_zero_error(signals: Mapping[str, Real]) -> dict[str, Real]:
    """All signals but the error where it is zero: the log has no desired motion of its own."""
    return {
        name: each for name, each in signals.items() if not name.startswith("error") or np.any(each)
    }


def feeds(there: Collection[str], names: Sequence[str]) -> bool:
    """Whether all that are named are there; the noise can be computed from its two parts."""
    parts = "measured" in there and "desired" in there
    return all(name in there or (name == NOISE and parts) for name in names)


def stacked(signals: Signals, names: Sequence[str]) -> Real:
    """A norm alone, shape (samples,), or several signals, norms first, shape (rows, samples).

    ``noise`` is computed from ``measured`` and ``desired`` where it is missing.
    """
    there = named(signals)
    if lacking := [name for name in names if name not in there]:
        if not feeds(there, names):
            raise MissingSignalError(lacking, there)
        there = {**there, NOISE: np.hypot(there["measured"], there["desired"])}
    chosen = [np.asarray(there[name]) for name in names]
    # All norms have one shape, and all that goes joint by joint has another one.
    count, joints = chosen[0].shape[-1:], chosen[-1].shape[:-1]
    wanted = [joints + count if name in BY_JOINT else count for name in names]
    alike = [each.shape for each in chosen] == wanted and len(count) == 1
    if not alike or len(joints) != (names[-1] in BY_JOINT) or 0 in joints:
        found = ", ".join(f"{name} {s.shape}" for name, s in zip(names, chosen, strict=True))
        more = ", and (joints, samples) joint by joint" * any(name in BY_JOINT for name in names)
        raise SignalError(f"a signal has another shape, {found}, expected (samples,){more}")
    return chosen[0] if len(chosen) == 1 else np.vstack(chosen)


class Tail:
    """The latest samples of a signal that comes in chunks, as one array, shape (..., samples).

    A chunk is copied once, and the rest seldom: there is room for as many samples more.
    """

    def __init__(self, *shape: int, dtype: DTypeLike = np.float64) -> None:
        self._room: NDArray[Any] = np.empty((*shape, 0), dtype)
        self._first = self._stop = 0

    @property
    def samples(self) -> NDArray[Any]:
        """Those that are held; they are written over later."""
        return self._room[..., self._first : self._stop]

    def more(self, count: int) -> NDArray[Any]:
        """Where so many samples that follow are to be written."""
        if self._stop + count > self._room.shape[-1]:
            held = self.samples
            needed = held.shape[-1] + count
            self._room = np.empty((*held.shape[:-1], needed + held.shape[-1]), held.dtype)
            self._room[..., : held.shape[-1]] = held
            self._first, self._stop = 0, held.shape[-1]
        self._stop += count
        return self._room[..., self._stop - count : self._stop]

    def drop(self, count: int) -> None:
        """Drop the oldest samples."""
        self._first += count
        if self._first == self._stop:
            self._first = self._stop = 0
