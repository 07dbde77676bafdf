"""Noise of motions: the simplified estimate with its parts, sound power and levels."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noisemodel.run import Run
from noisemodel.types import Array, NoiseModelError, Real

DENSITY = 1.204
"""Of air at 20 °C, in [kg/m³]."""

SOUND_SPEED = 343.2
"""In air at 20 °C, in [m/s]."""

REFERENCE_POWER = 1e-12
"""0 dB of sound power, in [W]."""

LOUDEST = 5
"""Links that are printed by name."""

CHUNK = 4096
"""Samples that are worked on at once: few enough for the cache, with little overhead of Python."""


def simplified(velocity: Real, velocity_desired: Real | None = None) -> Array:
    """Estimate a robot's noise pressure from its joint velocities, all constants 1.

    Args:
        velocity: Measured velocities, a floating base's included,
            shape (samples, n), in [rad/s] and [m/s].
        velocity_desired: Desired joint velocities, shape (samples, m); none counts as zero.

    Returns:
        The noise estimate p_hat, shape (samples,), in [rad/s].

    Raises:
        NoiseModelError: If an array is not two-dimensional or the lengths differ.
    """
    power = _squared(velocity)
    if velocity_desired is not None:
        if len(velocity_desired) != len(velocity):
            raise NoiseModelError(
                f"velocity has {len(velocity)} samples, velocity_desired {len(velocity_desired)}"
            )
        power = power + _squared(velocity_desired)
    return np.sqrt(power)  # p_hat = sqrt(|qd|^2 + |qd_desired|^2), Sygulla & Rixen, Sec. II-A


def _squared(velocity: Real) -> Array:
    if velocity.ndim != 2:
        raise NoiseModelError(f"velocities of shape {velocity.shape}, expected (samples, joints)")
    power = np.empty(len(velocity))
    for start in range(0, len(velocity), CHUNK):
        part = slice(start, start + CHUNK)
        exact = velocity[part].astype(np.float64, copy=False)
        np.einsum("sj,sj->s", exact, exact, out=power[part])
    return power


def norms(run: Run) -> dict[str, Array]:
    """Reduce the velocities of a run to a few signals.

    Args:
        run: The run.

    Returns:
        Signals by name, each of shape (samples,), in [rad/s]: ``measured``, a floating base's
        velocities among them, and ``noise``, the simplified estimate; with desired velocities also
        ``desired`` and ``error``, the difference of desired and measured velocities of the joints
        that have both, if there are any.
    """
    motion = run.motion
    signals = {
        "noise": simplified(motion, run.velocity_desired),
        "measured": simplified(motion),
    }
    if (desired := run.velocity_desired) is not None:
        signals["desired"] = simplified(desired)
        if run.desired_joint_names == run.joint_names:
            error: Real = np.asarray(desired - run.velocity)
        else:
            measured, wanted = _both(run)
            error = np.asarray(desired[:, wanted] - run.velocity[:, measured])
        if error.shape[1]:
            signals["error"] = simplified(error)
    return signals


def by_joint(run: Run) -> dict[str, Array]:
    """Take the velocities of those joints that are desired as well as measured.

    Args:
        run: The run.

    Returns:
        ``desired_joints``, ``measured_joints`` and ``error_joints``, their difference, each of
        shape (joints, samples), in [rad/s]; without desired velocities, ``measured_joints`` of all
        joints; with efforts, also ``effort_joints``, in their unit; nothing if no desired joint is
        measured.
    """
    found = {}
    own = list(range(len(run.joint_names)))
    if run.velocity_desired is not None:
        own, wanted = _both(run)
        found["desired_joints"] = _rows(run.velocity_desired, wanted)
    if not own:
        return {}
    found["measured_joints"] = _rows(run.velocity, own)
    if run.velocity_desired is not None:
        found["error_joints"] = found["desired_joints"] - found["measured_joints"]
    if run.effort is not None:
        found["effort_joints"] = _rows(run.effort, own)
    return found


def _both(run: Run) -> tuple[list[int], list[int]]:
    """Columns of the joints that are measured and desired, in both signals."""
    names = [name for name in run.joint_names if name in run.desired_joint_names]
    measured = [run.joint_names.index(name) for name in names]
    return measured, [run.desired_joint_names.index(name) for name in names]


def _rows(signal: Real, columns: list[int]) -> Array:
    return signal[:, columns].T.astype(np.float64, copy=False)


@dataclass(frozen=True, eq=False)
class Noise:
    """The sound that a robot's links radiate.

    Attributes:
        power: Sound power of each link, shape (samples, links), in [W].
        names: The links.
    """

    power: Array
    names: tuple[str, ...]

    @property
    def total(self) -> Array:
        """Sound power of the robot, shape (samples,), in [W]."""
        return np.asarray(self.power.sum(axis=1))

    @property
    def level(self) -> Array:
        """Level of the total power, shape (samples,), in [dB re 1 pW]; -inf in silence."""
        return decibel(self.total / REFERENCE_POWER)

    def pressure(self, distance: float) -> Array:
        """Sound pressure where the robot is a point that radiates evenly.

        Args:
            distance: From the robot, in [m].

        Returns:
            Shape (samples,), in [Pa].

        Raises:
            NoiseModelError: If ``distance`` is not positive.
        """
        check_positive("distance", distance, "m")
        impedance = DENSITY * SOUND_SPEED
        # p = sqrt(P rho c / (4 pi d²)), Sygulla & Rixen, Sec. II-A
        pressure: Array = np.sqrt(self.total * impedance / (4.0 * np.pi * distance**2))
        return pressure

    def shares(self, stretches: Sequence[tuple[int, int]] | None = None) -> Array:
        """Share of each link in the energy that the robot radiates in stretches of time.

        Args:
            stretches: First sample and the one after the last of each; unless given, all samples.

        Returns:
            Shape (stretches, links); each row has the sum 1, or 0 in silence.

        Raises:
            NoiseModelError: If a stretch is empty or outside of the samples.
        """
        stretches = [(0, len(self.power))] if stretches is None else stretches
        for start, stop in stretches:
            if not 0 <= start < stop <= len(self.power):
                raise NoiseModelError(
                    f"a stretch from sample {start} to {stop}, expected one within 0 to"
                    f" {len(self.power)}"
                )
        parts = [self.power[start:stop].sum(axis=0) for start, stop in stretches]
        energy = np.array(parts).reshape(len(stretches), len(self.names))
        whole = energy.sum(axis=1, keepdims=True)
        shares: Array = np.divide(energy, whole, out=np.zeros_like(energy), where=whole > 0.0)
        return shares

    def __str__(self) -> str:
        mean = float(decibel(self.total.mean() / REFERENCE_POWER))
        share = self.shares()[0]
        lines = [f"{len(self.power)} samples, mean sound power {mean:.1f} dB re 1 pW"]
        loudest = [link for link in np.argsort(-share, kind="stable")[:LOUDEST] if share[link]]
        return "\n".join([*lines, *(f"{self.names[i]:28} {share[i]:6.1%}" for i in loudest)])


def sound_power(mean_square: Array, area: Array | float, efficiency: Array | float = 1.0) -> Array:
    """Sound power that surfaces radiate, in [W], of shapes that broadcast.

    ``mean_square`` speeds are in [m²/s²], areas in [m²].
    """
    # P_i = rho c sigma_i S_i v_i², Sygulla & Rixen, Sec. II-A
    return np.asarray(DENSITY * SOUND_SPEED * efficiency * area * mean_square)


def decibel(ratio: Array) -> Array:
    """Express ratios of powers in [dB]; 0 is -inf."""
    with np.errstate(divide="ignore"):
        return np.asarray(10.0 * np.log10(ratio))


def check_positive(name: str, value: float, unit: str) -> None:
    """Refuse a number that is not positive and finite."""
    if not 0.0 < value < np.inf:
        raise NoiseModelError(f"{name} is {value:g} {unit}, expected a positive number")
