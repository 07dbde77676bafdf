"""Noise signals of motion that comes in columns: `noisemodel.norms` and joints, without a run."""

from collections.abc import Callable, Mapping, Sequence

import noisemodel as nm
from noisemodel.types import Array

NOISY = ("base_velocity", "velocity", "velocity_desired")
"""The signals that make noise: where one of them is unknown there is none."""


class Norms:
    """Says which columns make which signal.

    Args:
        widths: Columns of each signal that comes in.

    Attributes:
        columns: How many columns make noise: those of ``NOISY``, in that order.
        names: Signals that there are.
        joints: How many joints there are.
    """

    def __init__(self, widths: Mapping[str, int]) -> None:
        base, joints, desired = (widths.get(name, 0) for name in NOISY)
        self.columns, self.joints = base + joints + desired, joints
        moved = base + joints
        self._ways: dict[str, Callable[[Array], Array]] = {
            "noise": nm.simplified,  # of measured and desired velocities side by side
            "measured": lambda motion: nm.simplified(motion[:, :moved]),
        }
        if desired:
            self._ways |= {
                "desired": lambda motion: nm.simplified(motion[:, moved:]),
                "error": lambda motion: nm.simplified(motion[:, moved:] - motion[:, base:moved]),
                "desired_joints": lambda motion: motion[:, moved:].T,
                "measured_joints": lambda motion: motion[:, base:moved].T,
                "error_joints": lambda motion: (motion[:, moved:] - motion[:, base:moved]).T,
            }
        self.names = tuple(self._ways)

    def of(self, motion: Array, names: Sequence[str]) -> dict[str, Array]:
        """Compute signals.

        Args:
            motion: Velocities, shape (samples, columns), in [rad/s] and [m/s].
            names: Which.

        Returns:
            Signals by name, norms of shape (samples,), joints of (joints, samples), in [rad/s].
        """
        return {name: self._ways[name](motion) for name in names}
