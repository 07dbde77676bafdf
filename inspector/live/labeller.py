"""Labels of motion while it arrives, by the model that fits its rate."""

from collections.abc import Callable, Mapping, Sequence
from math import ceil

import numpy as np

import noiseclassifier as nc
import noisemodel as nm
from inspector.library import Library
from inspector.live.decimator import Decimator
from noiseclassifier.profile import NOMINAL, TOLERANCE
from noiseclassifier.signals import EFFORT, JOINTS, MOTION, NOISE
from noisemodel.decimation import EDGE
from noisemodel.types import Array, Mask

NOISY = ("base_velocity", "velocity", "velocity_desired", "effort")
"""The signals that models take: where one of them is unknown there is no label."""


class NoiseSignals:
    """Noise signals of motion in columns: `noisemodel.norms` and `by_joint`, without a run.

    Args:
        widths: Columns of each signal that arrives.

    Attributes:
        columns: How many columns make noise: those of ``NOISY``, in that order.
        names: Noise signals that there are.
        joints: How many joints there are.
    """

    def __init__(self, widths: Mapping[str, int]) -> None:
        base, joints, desired, efforts = (widths.get(name, 0) for name in NOISY)
        self.columns, self.joints = base + joints + desired + efforts, joints
        moved = base + joints
        end = moved + desired
        of_desired, of_measured, of_error = MOTION
        desired_joints, measured_joints, error_joints = JOINTS
        self._ways: dict[str, Callable[[Array], Array]] = {
            NOISE: lambda motion: nm.simplified(motion[:, :end]),
            of_measured: lambda motion: nm.simplified(motion[:, :moved]),
            measured_joints: lambda motion: motion[:, base:moved].T,
        }
        if desired:
            self._ways |= {
                of_desired: lambda motion: nm.simplified(motion[:, moved:end]),
                of_error: lambda motion: nm.simplified(
                    motion[:, moved:end] - motion[:, base:moved]
                ),
                desired_joints: lambda motion: motion[:, moved:end].T,
                error_joints: lambda motion: (motion[:, moved:end] - motion[:, base:moved]).T,
            }
        if efforts:
            self._ways[EFFORT] = lambda motion: motion[:, end:].T
        self.names = tuple(self._ways)

    def of(self, motion: Array, names: Sequence[str]) -> dict[str, Array]:
        """Compute noise signals.

        Args:
            motion: Velocities, shape (samples, columns), in [rad/s] and [m/s].
            names: Which.

        Returns:
            Signals by name, norms of shape (samples,), joints of (joints, samples), in [rad/s].
        """
        return {name: self._ways[name](motion) for name in names}


class Labeller:
    """Labels frames as they become complete, or gives the reason why it does not.

    Args:
        library: Models to choose from.
        rate: Samples per second, in [Hz].
        widths: Columns of each signal that arrives.

    Attributes:
        model: Name of the model that labels; empty without one.
        remark: Why there are no labels, or at which other rate; empty if neither.
    """

    def __init__(self, library: Library, rate: float, widths: Mapping[str, int]) -> None:
        self.rate, self.remark, self.model = rate, "", ""
        self._stream: nc.Stream | None = None
        self._decimator: Decimator | None = None
        self._signals, self._names = NoiseSignals(widths), tuple[str, ...]()
        self._ratio, self._samples = 1, 0
        try:
            self.model, chosen = nc.nearest(library, rate, self._signals.names)
        except nc.ModelsError as error:
            self.remark = f"No labels: {error}."
            return
        ratio = round(rate / chosen.rate)
        if rate > chosen.rate and isinstance(model := library[self.model], nc.General):
            ratio = ceil(rate / chosen.rate * (1.0 - TOLERANCE))
            chosen = model.at(rate / ratio, self._signals.names)
        if abs(rate / ratio / chosen.rate - 1.0) > NOMINAL:
            self.remark = (
                f"No labels: {rate:g} Hz is no multiple of the {chosen.rate:g} Hz of the nearest"
                " model, as is needed while samples come in."
            )
            return
        self._ratio, self._names = ratio, chosen.profile.signals
        self._stream = nc.Stream(chosen, rate=rate / ratio, joints=self._signals.joints)
        if ratio > 1:
            self._decimator = Decimator(ratio, self._signals.columns)
            self.remark = f"Labelled at {rate / ratio:g} Hz, the rate of model {self.model}."

    @property
    def length(self) -> float:
        """Duration of a frame, in [s]."""
        return 0.0 if self._stream is None else self._stream.classifier.profile.duration

    @property
    def hop(self) -> float:
        """Time from one frame to the next, in [s]."""
        if self._stream is None:
            return 0.0
        return self._stream.classifier.profile.hop / self.rate * self._ratio

    @property
    def classes(self) -> tuple[str, ...]:
        """What can be predicted; nothing without a model."""
        return () if self._stream is None else self._stream.classifier.classes

    @property
    def elapsed(self) -> float:
        """Time since the first sample, lost ones counted, in [s]: the clock of the labels."""
        return self._samples / self.rate

    def push(self, motion: Array, valid: Mask) -> nc.Labels | None:
        """Take samples.

        Args:
            motion: All velocities that the noise is made of, shape (samples, columns).
            valid: False where there is none, shape (samples,).

        Returns:
            Labels that are complete now, on the clock that starts with the first sample; None
            without a model.
        """
        self._samples += len(motion)
        if self._stream is None:
            return None
        if self._decimator is not None:
            motion, valid = self._decimator.push(motion, valid)
        return self._stream.push(self._signals.of(motion, self._names), valid)

    def skip(self, samples: int) -> None:
        """Pass over samples that were lost."""
        self._samples += samples
        if self._stream is None:
            return
        if self._decimator is None:
            self._stream.skip(samples)
            return
        # Samples in a gap are all alike: enough of them to fill the filter are processed.
        whole = max(samples - 4 * self._ratio * EDGE, 0) // self._ratio
        self._stream.skip(whole)
        rest = samples - whole * self._ratio
        lower, valid = self._decimator.push(
            np.zeros((rest, self._decimator.columns)), np.zeros(rest, dtype=bool)
        )
        self._stream.push(self._signals.of(lower, self._names), valid)
