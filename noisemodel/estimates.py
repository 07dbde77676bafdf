"""Noise of one motion by several kinds of estimates, each evaluated once, and their comparison."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noisemodel.comparison import TERMS, Comparison
from noisemodel.errors import NoiseModelError
from noisemodel.kinematics import CHUNK
from noisemodel.noise import sound_power
from noisemodel.robot import Robot
from noisemodel.similarity import (
    contrasts,
    correlation,
    envelopes,
    log_spectra,
    spectral_distances,
)
from noisemodel.simplified import simplified
from noisemodel.speed import chunk_speeds
from noisemodel.surface import TINY, Surface
from noisemodel.types import Array, Real

SIMPLIFIED = "simplified"

ENVELOPE = 0.02
"""Stretch of time whose root mean square is one value of the envelope, in [s]."""

WINDOW = 0.1024
"""Length of a spectrum's Hann window, in [s]: the paper's 1024 samples at 10 kHz."""


@dataclass(frozen=True, eq=False)
class Estimates:
    """The noise of one motion by several kinds of estimates.

    Attributes:
        kinds: The kinds.
        names: The links.
        pressure: Pressure over time to some scale, shape (kinds, samples).
        power: Its square, shape (kinds, samples).
        energy: Energy of each link to some scale, shape (kinds, links).
        terms: Share of A, B and C of each link in the energy of "paper", shape (links, 3).
    """

    kinds: tuple[str, ...]
    names: tuple[str, ...]
    pressure: Array
    power: Array
    energy: Array
    terms: Array

    def compared(self, rate: float, events: Sequence[tuple[int, int]] = ()) -> Comparison:
        """How the kinds differ.

        Args:
            rate: Sample rate, in [Hz].
            events: First sample and the one after the last of what should stand out.
        """
        window = _window(rate)
        spectra = [log_spectra(np.sqrt(power), window) for power in self.power]
        squares = spectral_distances(spectra)
        return Comparison(
            kinds=self.kinds,
            names=self.names,
            correlation=correlation(envelopes(self.power, round(ENVELOPE * rate))),
            distance=np.sqrt(squares.mean(axis=2)),
            frequency=np.arange(window // 2 + 1) * rate / window,
            distance_by_frequency=np.sqrt(squares),
            contrast=contrasts(self.power, events),
            shares=self.energy / np.maximum(self.energy.sum(axis=1, keepdims=True), TINY),
            terms=self.terms,
        )


def estimates(robot: Robot, surface: Surface, q: Real, v: Real, kinds: Sequence[str]) -> Estimates:
    """Estimate the noise of one motion by several kinds.

    Args:
        robot: The robot.
        surface: Its surface.
        q: Configurations as Pinocchio has them, shape (samples, nq).
        v: Velocities as Pinocchio has them, shape (samples, nv).
        kinds: "simplified", or kinds of ``surface_speed``.
    """
    pressure, power, energy = {}, {}, {}
    links = len(surface.links)
    for kind in kinds:
        pressure[kind], power[kind], energy[kind] = (
            np.empty(len(q)),
            np.empty(len(q)),
            np.zeros(links),
        )
    if SIMPLIFIED in kinds:
        pressure[SIMPLIFIED] = simplified(v)
        power[SIMPLIFIED] = pressure[SIMPLIFIED] ** 2
        energy[SIMPLIFIED] = _joint_energy(robot, surface, v)
    extended = [kind for kind in power if kind != SIMPLIFIED]
    alone = [kind for kind in extended if kind not in ("paper", *TERMS)]
    terms: Array = np.zeros((links, len(TERMS)))
    for start in range(0, len(q), CHUNK):
        part = slice(start, start + CHUNK)
        speeds = {
            kind: chunk_speeds(robot, surface, q[part], v[part], kind) for kind in (*TERMS, *alone)
        }
        each = np.array([speeds[term] for term in TERMS])
        speeds["paper"] = each.sum(axis=0)  # v = A + B + C, Sec. II-A
        # (A + B + C)² = (A + B + C) A + (A + B + C) B + (A + B + C) C
        terms += np.einsum("l,ls,tls->lt", surface.area, speeds["paper"], each)
        for kind in extended:
            radiated = sound_power(speeds[kind] ** 2, surface.area[:, None]).T
            power[kind][part] = radiated.sum(axis=1)
            energy[kind] += radiated.sum(axis=0)
    for kind in extended:
        pressure[kind] = np.sqrt(power[kind])
    return Estimates(
        kinds=tuple(kinds),
        names=surface.names,
        pressure=np.array([pressure[kind] for kind in kinds]),
        power=np.array([power[kind] for kind in kinds]),
        energy=np.array([energy[kind] for kind in kinds]),
        terms=terms / max(terms.sum(), TINY),
    )


def check_length(samples: int, rate: float) -> None:
    """Refuse a motion that is shorter than one spectrum.

    Raises:
        NoiseModelError: If it is.
    """
    window = _window(rate)
    if window < 4 or samples < window:
        raise NoiseModelError(
            f"{samples} samples at {rate:g} Hz, expected {WINDOW:g} s at least and 40 Hz"
        )


def _window(rate: float) -> int:
    return round(WINDOW * rate)


def _joint_energy(robot: Robot, surface: Surface, v: Real) -> Array:
    """Sum the squared velocities of each link's joint; a joint that follows one has none."""
    squares = np.einsum("sj,sj->j", v, v, dtype=np.float64)
    energy = np.zeros(len(surface.links))
    for link, index in enumerate(surface.joint):
        joint = robot.joints[index - 1]
        if joint.name not in robot.mimics:
            energy[link] = squares[joint.first_v : joint.first_v + joint.nv].sum()
    return energy
