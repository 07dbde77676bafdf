"""The sound that a robot radiates: power, pressure, levels, and the share of each link."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noisemodel.errors import NoiseModelError
from noisemodel.types import Array

DENSITY = 1.204
"""Of air at 20 °C, in [kg/m³]."""

SOUND_SPEED = 343.2
"""In air at 20 °C, in [m/s]."""

REFERENCE_POWER = 1e-12
"""0 dB of sound power, in [W]."""

REFERENCE_PRESSURE = 20e-6
"""0 dB of sound pressure, in [Pa]."""

LOUDEST = 5
"""Links that are printed by name."""


@dataclass(frozen=True, eq=False)
class Noise:
    """The sound that a robot's links radiate.

    Attributes:
        power: Sound power of each link, shape (samples, links), in [W].
        names: The links.
        density: Of the air, in [kg/m³].
        sound_speed: In [m/s].
    """

    power: Array
    names: tuple[str, ...]
    density: float = DENSITY
    sound_speed: float = SOUND_SPEED

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
        impedance = self.density * self.sound_speed
        # p = sqrt(P rho c / (4 pi d²)), Sygulla & Rixen, Sec. II-A
        pressure: Array = np.sqrt(self.total * impedance / (4.0 * np.pi * distance**2))
        return pressure

    def pressure_level(self, distance: float) -> Array:
        """Level of the sound pressure, shape (samples,), in [dB re 20 µPa]; -inf in silence.

        Args:
            distance: From the robot, in [m].

        Raises:
            NoiseModelError: If ``distance`` is not positive.
        """
        return 2.0 * decibel(self.pressure(distance) / REFERENCE_PRESSURE)

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
        check_stretches(stretches, len(self.power))
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


def sound_power(
    mean_square: Array,
    area: Array | float,
    *,
    efficiency: Array | float = 1.0,
    density: float = DENSITY,
    sound_speed: float = SOUND_SPEED,
) -> Array:
    """Sound power that surfaces radiate, of shapes that broadcast.

    Args:
        mean_square: Mean-square speed of each surface, in [m²/s²].
        area: Of each surface, in [m²].
        efficiency: Radiation efficiency of each surface.
        density: Of the air, in [kg/m³].
        sound_speed: In [m/s].

    Returns:
        The power, in [W].
    """
    # P_i = rho c sigma_i S_i v_i², Sygulla & Rixen, Sec. II-A
    return np.asarray(density * sound_speed * efficiency * area * mean_square)


def decibel(ratio: Array) -> Array:
    """Express ratios of powers in [dB]; 0 is -inf."""
    with np.errstate(divide="ignore"):
        return np.asarray(10.0 * np.log10(ratio))


def check_stretches(stretches: Sequence[tuple[int, int]], samples: int) -> None:
    """Refuse stretches of time that are empty or outside of the samples.

    Raises:
        NoiseModelError: If there is one.
    """
    for start, stop in stretches:
        if not 0 <= start < stop <= samples:
            raise NoiseModelError(
                f"a stretch from sample {start} to {stop}, expected one within 0 to {samples}"
            )


def check_positive(name: str, value: float, unit: str) -> None:
    """Refuse a number that is not positive and finite.

    Raises:
        NoiseModelError: If it is not.
    """
    if not 0.0 < value < np.inf:
        raise NoiseModelError(f"{name} is {value:g} {unit}, expected a positive number")
