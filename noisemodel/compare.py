"""Noise models side by side: what differs between the simplified and the extended estimates."""

from collections.abc import Sequence

import numpy as np

from noisemodel.comparison import TERMS, Comparison
from noisemodel.errors import NoiseModelError, UnknownKindError
from noisemodel.extended import extended_chunks
from noisemodel.kinematics import CHUNK
from noisemodel.noise import check_positive, check_stretches
from noisemodel.robot import Robot
from noisemodel.similarity import (
    contrasts,
    correlation,
    envelopes,
    log_spectra,
    spectral_distances,
)
from noisemodel.simplified import simplified
from noisemodel.speed import KINDS, check_motion, chunk_speeds
from noisemodel.surface import Surface, check_surface
from noisemodel.turning import TINY
from noisemodel.types import Array, Real

SIMPLIFIED = "simplified"
COMPARED = (SIMPLIFIED, "C", "paper", "mean", "rms", "normal")
"""The kinds that are compared unless others are named."""

ENVELOPE = 0.02
"""Stretch of time whose root mean square is one value of the envelope, in [s]."""

WINDOW = 0.1024
"""Length of a spectrum's Hann window, in [s]: the paper's 1024 samples at 10 kHz."""


def compare(
    robot: Robot,
    q: Real,
    v: Real,
    kinds: Sequence[str] = COMPARED,
    *,
    rate: float,
    surface: Surface | None = None,
    events: Sequence[tuple[int, int]] = (),
) -> Comparison:
    """Compare kinds of noise estimates on one motion.

    All estimates are compared as pressures, whose scale is arbitrary and plays no part: a factor
    between two kinds changes neither their correlation nor their distance.

    Args:
        robot: The robot.
        q: Configurations as Pinocchio has them, shape (samples, nq).
        v: Velocities as Pinocchio has them, shape (samples, nv).
        kinds: "simplified", or kinds of ``surface_speed``.
        rate: Sample rate, in [Hz].
        surface: The robot's surface; that of its visuals unless given.
        events: First sample and the one after the last of what should stand out.

    Returns:
        The comparison.

    Raises:
        UnknownKindError: If there is no such kind.
        GeometryError: If there is no surface to be had, or it is that of another robot.
        NoiseModelError: If the motion cannot be, or is shorter than one spectrum.
    """
    known = (SIMPLIFIED, *KINDS)
    for kind in kinds:
        if kind not in known:
            raise UnknownKindError(kind, known)
    if not kinds:
        raise NoiseModelError(f"no kinds to compare, expected some of {', '.join(known)}")
    check_motion(robot, q, v)
    check_positive("rate", rate, "Hz")
    check_stretches(events, len(q))
    window = round(WINDOW * rate)
    if window < 4 or len(q) < window:
        raise NoiseModelError(
            f"{len(q)} samples at {rate:g} Hz, expected {WINDOW:g} s at least and 40 Hz"
        )
    surface = Surface.of(robot) if surface is None else surface
    check_surface(surface, robot)
    estimates = [_estimate(robot, surface, q, v, kind) for kind in kinds]
    powers = np.array([power for power, _ in estimates])
    energies = np.array([energy for _, energy in estimates])
    spectra = [log_spectra(np.sqrt(power), window) for power in powers]
    squares = spectral_distances(spectra)
    return Comparison(
        kinds=tuple(kinds),
        names=surface.names,
        correlation=correlation(envelopes(powers, max(1, round(ENVELOPE * rate)))),
        distance=np.sqrt(squares.mean(axis=2)),
        frequency=np.arange(window // 2 + 1) * rate / window,
        distance_by_frequency=np.sqrt(squares),
        contrast=contrasts(powers, events),
        shares=energies / np.maximum(energies.sum(axis=1, keepdims=True), TINY),
        terms=_terms(robot, surface, q, v),
    )


def _estimate(robot: Robot, surface: Surface, q: Real, v: Real, kind: str) -> tuple[Array, Array]:
    """Power over time, shape (samples,), and energy of each link, shape (links,), to some scale."""
    if kind == SIMPLIFIED:
        return simplified(v) ** 2, _joint_energy(robot, surface, v)
    power, energy = [], np.zeros(len(surface.links))
    for chunk in extended_chunks(robot, surface, q, v, kind):
        power.append(chunk.total)
        energy += chunk.power.sum(axis=0)
    return np.concatenate(power), energy


def _joint_energy(robot: Robot, surface: Surface, v: Real) -> Array:
    """Sum the squared velocities of each link's joint; a joint that follows one has none."""
    squares = np.einsum("sj,sj->j", v, v, dtype=np.float64)
    energy = np.zeros(len(surface.links))
    for link, index in enumerate(surface.joint):
        joint = robot.joints[index - 1]
        if joint.name not in robot.mimics:
            energy[link] = squares[joint.first_v : joint.first_v + joint.nv].sum()
    return energy


def _terms(robot: Robot, surface: Surface, q: Real, v: Real) -> Array:
    """Split the power of "paper" by (A + B + C)² = (A + B + C) A + (A + B + C) B + ..."""
    energy: Array = np.zeros((len(surface.links), len(TERMS)))
    for start in range(0, len(q), CHUNK):
        part = slice(start, start + CHUNK)
        terms = np.array([chunk_speeds(robot, surface, q[part], v[part], one) for one in TERMS])
        energy += np.einsum("l,ls,tls->lt", surface.area, terms.sum(axis=0), terms)
    shares: Array = energy / max(energy.sum(), TINY)
    return shares
