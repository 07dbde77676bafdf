"""A buffer that samples are collected in: named signals of fixed widths."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from inspector.live.errors import LiveError
from inspector.live.warnings import Warnings
from noisemodel.checks import LARGEST
from noisemodel.types import Array

SIGNALS = ("velocity", "velocity_desired", "position", "base_velocity", "base_pose")
"""What a session takes, besides the time; as the run file names it."""


class SampleBuffer:
    """Room for some samples.

    Args:
        size: Samples that it holds.
        widths: Columns of each signal that there is.
        warnings: Where signals that do not fit are counted.
    """

    def __init__(self, size: int, widths: Mapping[str, int], warnings: Warnings) -> None:
        self._size, self._warnings = size, warnings
        self.signals = {name: np.empty((size, width)) for name, width in widths.items()}
        self.time, self.received = np.empty(size), np.empty(size)
        self.held = 0

    @property
    def full(self) -> bool:
        """Whether no sample fits in."""
        return self.held == self._size

    def put(self, rows: Mapping[str, Array], time: Array, received: float) -> int:
        """Take as many samples as fit in.

        Args:
            rows: Signals, each of shape (samples, columns); those that are missing or of another
                width are unknown in these samples.
            time: Shape (samples,), in [s].
            received: When they were, in [s] on the clock that delays are measured by.

        Returns:
            How many samples were taken.
        """
        count = min(len(time), self._size - self.held)
        place = slice(self.held, self.held + count)
        self.time[place], self.received[place] = time[:count], received
        for name, values in self.signals.items():
            given = rows.get(name)
            fits = given is not None and given.shape[1] == values.shape[1]
            values[place] = given[:count] if given is not None and fits else np.nan
            if not fits:
                self._note(name, given, values.shape[1], time[0], count)
        for name in rows:
            if name not in self.signals:
                line = f"{name} from {time[0]:.3f} s on was not there at first: not shown"
                self._warnings.note(f"samples with a new {name}", line, count)
        self.held += count
        return count

    def take(self) -> tuple[Array, Array, dict[str, Array]]:
        """Take all samples out.

        Returns:
            Their times, when they were received, and the signals; values whose square would
            overflow are unknown. They are overwritten by the samples that are put in next.
        """
        held, self.held = self.held, 0
        signals = {name: values[:held] for name, values in self.signals.items()}
        for values in signals.values():
            values[~(np.abs(values) < LARGEST)] = np.nan
        return self.time[:held], self.received[:held], signals

    def _note(self, name: str, given: Array | None, width: int, time: float, count: int) -> None:
        if given is None:
            line = f"no {name} from {time:.3f} s on: it was there at first"
            self._warnings.note(f"samples without {name}", line, count)
        else:
            line = (
                f"{name} of {given.shape[1]} columns from {time:.3f} s on, where it had {width}:"
                " not shown, and not labelled where it makes noise"
            )
            self._warnings.note(f"samples with another width of {name}", line, count)


def rows_of(given: Mapping[str, ArrayLike]) -> dict[str, Array]:
    """Bring one sample or a chunk of them into rows.

    Args:
        given: Signals by name, the velocity first: of shape (columns,) for one sample, or
            (samples, columns).

    Returns:
        Each of shape (samples, columns).

    Raises:
        LiveError: If shapes do not fit together, or values are no numbers.
    """
    rows: dict[str, Array] = {}
    for name, values in given.items():
        try:
            array = np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise LiveError(f"{name}: holds no numbers ({error})") from error
        rows[name] = array if array.ndim == 2 else array.reshape(1, -1)
        if array.ndim not in (1, 2):
            raise LiveError(
                f"{name}: shape {array.shape}, expected (joints,) for one sample or"
                " (samples, joints)"
            )
        if len(rows[name]) != len(rows["velocity"]):
            listed = ", ".join(f"{len(array)} of {name}" for name, array in rows.items())
            raise LiveError(f"samples differ in number: {listed}")
    return rows


def widths_of(rows: Mapping[str, Array], joint_names: Sequence[str]) -> dict[str, int]:
    """Fix the signals of a session by its first samples.

    Args:
        rows: Signals, each of shape (samples, columns).
        joint_names: Names of the joints, if they are known.

    Raises:
        LiveError: If a signal has a width that it cannot have.
    """
    joints = len(joint_names) or rows["velocity"].shape[1]
    wanted = {"base_velocity": 6, "base_pose": 7}
    for name, array in rows.items():
        width = wanted.get(name, joints)
        if array.shape[1] != width:
            raise LiveError(
                f"{name}: {array.shape[1]} columns in the first sample, expected {width}"
            )
    return {name: array.shape[1] for name, array in rows.items()}
