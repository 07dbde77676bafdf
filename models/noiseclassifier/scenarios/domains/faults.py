"""Faults of drives and commands, for robots of every family."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from noiseclassifier.scenarios.clock import TICK
from noiseclassifier.scenarios.drivetrain import Drivetrain
from noiseclassifier.scenarios.events import Event
from noiseclassifier.scenarios.paths import minimum_jerk
from noisemodel.types import Array

Command: TypeAlias = Callable[[Array, Array, Array], tuple[Array, Array]]
"""From times, shape (samples,), targets and rates, shape (samples, joints), to both."""

MARGIN = 0.8
"""Time without faults at the begin and at the end of a run, in [s]."""


@dataclass(frozen=True, kw_only=True)
class DriveFault:
    """A fault of drives or commands; by default none.

    Attributes:
        stiffness: Factor of the position gains meanwhile, shape (joints,).
        damping: Factor of the velocity gains meanwhile, shape (joints,).
        delay: Further delay meanwhile, in [s].
        offset: Error of the encoders from the start of the event on, shape (joints,), in [rad].
        torque: Torque added meanwhile: from times since the start, shape (samples,), in [s], to
            shape (samples, joints), in [N m].
    """

    event: Event | None = None
    stiffness: Array | float = 1.0
    damping: Array | float = 1.0
    delay: float = 0.0
    power: float = 1.0
    offset: Array | float = 0.0
    torque: Callable[[Array], Array] | None = None
    outside: bool = False
    command: Command | None = None

    @property
    def facts(self) -> Mapping[str, Any]:
        """The drawn values, for the metadata of the run."""
        return dict(self.event.facts) if self.event else {}


NONE = DriveFault()


@dataclass(frozen=True)
class Held:
    """Targets that stay as they are for a while."""

    start: float
    stop: float
    kept: dict[str, Array] = field(default_factory=dict)

    def __call__(self, time: Array, targets: Array, rates: Array) -> tuple[Array, Array]:
        """Targets and rates of one tick."""
        if not self.start <= time[0] < self.stop:
            return targets, rates
        kept = self.kept.setdefault("targets", targets[0].copy())
        return np.tile(kept, (len(targets), 1)), np.zeros_like(rates)


@dataclass(frozen=True)
class Lost:
    """Targets that are lost at random ticks, at which the drives keep the last ones."""

    start: float
    stop: float
    share: float
    seed: int
    kept: dict[str, Array] = field(default_factory=dict)

    def __call__(self, time: Array, targets: Array, rates: Array) -> tuple[Array, Array]:
        """Targets and rates of one tick."""
        tick = round(time[0] / TICK)
        inside = self.start <= time[0] < self.stop
        # Several ticks are lost together: a packet holds ten.
        lost = inside and np.random.default_rng((self.seed, tick // 10)).uniform() < self.share
        if not lost or "targets" not in self.kept:
            self.kept["targets"] = targets[-1].copy()
            return targets, rates
        return np.tile(self.kept["targets"], (len(targets), 1)), np.zeros_like(rates)


@dataclass(frozen=True)
class Step:
    """Targets that jump, and return smoothly."""

    start: float
    stop: float
    size: Array
    back: float = 0.6

    def __call__(self, time: Array, targets: Array, rates: Array) -> tuple[Array, Array]:
        """Targets and rates of one tick."""
        if time[-1] < self.start or time[0] > self.stop + self.back:
            return targets, rates
        left = 1 - minimum_jerk(np.clip((time - self.stop) / self.back, 0, 1))
        share = np.where(time < self.start, 0.0, left)
        return targets + share[:, None] * self.size, rates


def _when(rng: np.random.Generator, duration: float, length: float) -> tuple[float, float]:
    latest = max(MARGIN, duration - MARGIN - length)
    start = float(rng.uniform(MARGIN, latest))
    return start, min(start + length, duration)


def _log(rng: np.random.Generator, least: float, most: float) -> float:
    return float(np.exp(rng.uniform(np.log(least), np.log(most))))


def _some(rng: np.random.Generator, joints: int) -> Array:
    """One joint, or a few, or all."""
    count = int(rng.choice([1, 1, 2, joints]))
    chosen = np.zeros(joints)
    chosen[rng.choice(joints, min(count, joints), replace=False)] = 1.0
    return chosen


def latency(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw a delay that grows for a while."""
    delay = _log(rng, 2e-3, 30e-3)
    start, stop = _when(rng, duration, float(rng.uniform(0.4, 2.0)))
    facts = {"delay": delay}
    return DriveFault(event=Event("oscillations", "latency", start, stop, facts), delay=delay)


def chatter(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw gains that are too high for a while, for a delay that is a little longer, too."""
    joints = _some(rng, len(drives.joints))
    factor, delay = _log(rng, 4.0, 60.0), _log(rng, 0.5e-3, 4e-3)
    start, stop = _when(rng, duration, float(rng.uniform(0.4, 2.0)))
    facts = {"factor": factor, "delay": delay, "joints": joints.tolist()}
    gains = np.where(joints > 0, factor, 1.0)
    soft = rng.uniform() < 0.3
    return DriveFault(
        event=Event("oscillations", "too high gains", start, stop, facts),
        stiffness=gains,
        damping=1.0 if soft else gains,
        delay=delay,
    )


def held(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw targets that stand still for a while."""
    start, stop = _when(rng, duration, _log(rng, 0.015, 0.25))
    event = Event("highaccelerations", "held command", start, stop + 0.02, {})
    return DriveFault(event=event, command=Held(start, stop))


def lost(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw targets of which some are lost."""
    share = float(rng.uniform(0.1, 0.7))
    start, stop = _when(rng, duration, float(rng.uniform(0.3, 1.5)))
    event = Event("highaccelerations", "lost commands", start, stop, {"share": share})
    return DriveFault(event=event, command=Lost(start, stop, share, seed=int(rng.integers(2**31))))


def step(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw targets that jump."""
    joints = _some(rng, len(drives.joints))
    size = _log(rng, 2e-3, 0.1)
    start, stop = _when(rng, duration, float(rng.uniform(0.2, 1.0)))
    facts = {"size": size, "joints": joints.tolist()}
    event = Event("highaccelerations", "jump of the target", start, start + 0.02, facts)
    signs = rng.choice((-1.0, 1.0), len(joints))
    return DriveFault(event=event, command=Step(start, stop, size * signs * joints))


def tone(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw an oscillation of the torque at one frequency."""
    joints = _some(rng, len(drives.joints))
    frequency = _log(rng, 15.0, 400.0)
    share = _log(rng, 0.01, 0.6)
    start, stop = _when(rng, duration, float(rng.uniform(0.3, 2.5)))
    facts = {"frequency": frequency, "share": share, "joints": joints.tolist()}
    size = share * np.array(drives.torque) * joints

    def torque(since: Array) -> Array:
        fade = np.minimum(1, np.minimum(since, stop - start - since) / 0.05)
        return np.outer(fade * np.sin(2 * np.pi * frequency * since), size)

    event = Event("oscillations", "oscillation of the torque", start, stop, facts)
    return DriveFault(event=event, torque=torque)


def knock(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw a blow on the joints, a half sine of torque."""
    joints = _some(rng, len(drives.joints))
    length, share = _log(rng, 2e-3, 30e-3), _log(rng, 0.05, 2.0)
    start, stop = _when(rng, duration, length)
    facts = {"share": share, "joints": joints.tolist()}
    size = share * np.array(drives.torque) * joints * rng.choice((-1.0, 1.0), len(joints))

    def torque(since: Array) -> Array:
        return np.outer(np.sin(np.pi * np.clip(since / length, 0, 1)), size)

    event = Event("impact", "blow", start, stop, facts)
    return DriveFault(event=event, torque=torque, outside=True)


def dropout(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw drives without torque for a moment."""
    start, stop = _when(rng, duration, _log(rng, 3e-3, 80e-3))
    event = Event("highaccelerations", "drives without torque", start, stop + 0.02, {})
    return DriveFault(event=event, power=0.0)


def slip(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw an encoder that slips, and stays off."""
    joints = np.zeros(len(drives.joints))
    joints[rng.integers(len(joints))] = 1.0
    size = _log(rng, 2e-3, 0.06) * float(rng.choice((-1.0, 1.0)))
    start, stop = _when(rng, duration, 0.02)
    facts = {"offset": size, "joints": joints.tolist()}
    event = Event("highaccelerations", "encoder slip", start, stop, facts)
    return DriveFault(event=event, offset=size * joints)


FAULTS: Mapping[str, Callable[[np.random.Generator, Drivetrain, float], DriveFault]] = (
    MappingProxyType(
        {
            "latency": latency,
            "chatter": chatter,
            "held-command": held,
            "lost-commands": lost,
            "target-jump": step,
            "tone": tone,
            "blow": knock,
            "torque-dropout": dropout,
            "encoder-slip": slip,
        }
    )
)
"""Draws of the faults, by name: from random numbers, drives and the run's duration in [s]."""
