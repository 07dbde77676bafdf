"""Faults of the domains elsewhere, on the border between a controller and its robot."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from benchmarks.elsewhere.references import Reference
from noiseclassifier.scenarios.motions import Event
from noisemodel.types import Array

Range: TypeAlias = tuple[float, float]
KINDS = ("push", "throw", "latency", "chatter", "jump", "hold", "decalibration")


@dataclass(frozen=True)
class Sizes:
    """Ranges from which a domain draws its faults."""

    force: Range = (30.0, 150.0)  # peak of a push, in [N]
    # Mass of a thrown ball, in [kg]; None where nothing can be thrown.
    ball: Range | None = (0.3, 1.5)
    delay: Range = (0.03, 0.08)  # additional age of measurements or commands, in [s]
    gain: Range = (15.0, 30.0)
    jump: Range = (0.02, 0.1)  # jump of a joint's reference, in [rad]
    hold: Range = (0.06, 0.25)  # duration for which a command is held, in [s]
    offset: Range = (0.02, 0.06)  # offset of an encoder, in [rad]
    late_commands: bool = False
    slow: bool = True


@dataclass(frozen=True)
class Push:
    """A force on a link, half a sine over time: first and last tick, link, peak in [N]."""

    start: int
    stop: int
    link: int
    force: Array

    def at(self, tick: int) -> Array:
        """The force at a tick, shape (3,), in [N]."""
        return self.force * np.sin(np.pi * (tick - self.start + 0.5) / (self.stop - self.start))


@dataclass(frozen=True)
class Throw:
    """A ball thrown at a link: tick, link, velocity in [m/s], mass in [kg], stiffness in [N/m].

    The stiffness is None for a hard ball.
    """

    start: int
    link: int
    velocity: Array
    mass: float
    stiffness: float | None


@dataclass(frozen=True, kw_only=True, eq=False)
class Control:
    """What a controller is given at each tick, and what disturbs it."""

    position: Array  # commanded positions, shape (ticks, joints), in [rad]
    velocity: Array  # commanded velocities, shape (ticks, joints), in [rad/s]
    offset: Array  # error of the encoders, shape (ticks, joints), in [rad]
    delay: Array  # additional age of measurements, shape (ticks,), in ticks
    late: Array  # additional age of commands, shape (ticks,), in ticks
    gain: Array  # factor on the gains, shape (ticks, joints)
    pushes: tuple[Push, ...] = ()
    throws: tuple[Throw, ...] = ()
    events: tuple[Event, ...] = ()


def healthy(reference: Reference) -> Control:
    """The control without any fault."""
    ticks, joints = reference.position.shape
    return Control(
        position=reference.position,
        velocity=reference.velocity,
        offset=np.zeros((ticks, joints)),
        delay=np.zeros(ticks, dtype=int),
        late=np.zeros(ticks, dtype=int),
        gain=np.ones((ticks, joints)),
    )


def draw(
    rng: np.random.Generator,
    kind: str,
    reference: Reference,
    sizes: Sizes,
    *,
    links: tuple[int, ...],
    rate: float,
) -> Control:
    """A control with a few faults of one kind, at times that are at least a second apart.

    Args:
        rate: Ticks per second, in [Hz].
    """
    control = healthy(reference)
    ticks = len(reference.position)
    count = max(1, round((ticks / rate - 1.5) / 2.8))
    slots = np.linspace(1.0, ticks / rate - 0.7, count + 1)
    starts = slots[:-1] + rng.uniform(0.1, 0.5, count) * np.diff(slots)
    for start in starts.tolist():
        control = ADD[kind](control, _Place(rng, round(start * rate), sizes, links, rate))
    return control


@dataclass(frozen=True)
class _Place:
    """Where a fault may act, from which tick on, and what draws its size."""

    rng: np.random.Generator
    tick: int
    sizes: Sizes
    links: tuple[int, ...]
    rate: float


def _push(control: Control, at: _Place) -> Control:
    force = at.rng.uniform(*at.sizes.force) * _direction(at.rng)
    stop = at.tick + max(2, round(at.rng.uniform(0.01, 0.06) * at.rate))
    push = Push(at.tick, stop, int(at.rng.choice(at.links)), force)
    event = _event("impact", "push", at.tick, stop, at.rate, force=float(np.linalg.norm(force)))
    return replace(control, pushes=(*control.pushes, push), events=(*control.events, event))


def _throw(control: Control, at: _Place) -> Control:
    if at.sizes.ball is None:
        return _push(control, at)
    soft = 10 ** at.rng.uniform(3.3, 4.3) if at.rng.random() < 0.5 else None
    velocity = at.rng.uniform(3.0, 5.0) * _direction(at.rng) * (1.0, 1.0, 0.4)
    throw = Throw(
        at.tick, int(at.rng.choice(at.links)), velocity, at.rng.uniform(*at.sizes.ball), soft
    )
    return replace(control, throws=(*control.throws, throw))


def _latency(control: Control, at: _Place) -> Control:
    stop = at.tick + round(at.rng.uniform(0.3, 0.6) * at.rate)
    age = at.rng.uniform(*at.sizes.delay)
    if not at.sizes.late_commands:
        delay = control.delay.copy()
        delay[at.tick : stop] = max(1, round(age * at.rate))
        label = "highaccelerations" if at.sizes.slow else "oscillations"
        event = _event(label, "late measurements", at.tick, stop, at.rate, delay=age)
        return replace(control, delay=delay, events=(*control.events, event))
    late = control.late.copy()
    for first in range(at.tick, stop, round(0.05 * at.rate)):  # each packet has a delay of its own
        late[first : min(first + round(0.05 * at.rate), stop)] = round(
            age * at.rng.uniform() * at.rate
        )
    event = _event("highaccelerations", "late commands", at.tick, stop, at.rate, delay=age)
    return replace(control, late=late, events=(*control.events, event))


def _chatter(control: Control, at: _Place) -> Control:
    stop = at.tick + round(at.rng.uniform(0.25, 0.6) * at.rate)
    joint, factor = int(at.rng.integers(control.gain.shape[1])), at.rng.uniform(*at.sizes.gain)
    gain = control.gain.copy()
    gain[at.tick : stop, joint] = factor
    event = _event("oscillations", "high gains", at.tick, stop, at.rate, joint=joint, factor=factor)
    return replace(control, gain=gain, events=(*control.events, event))


def _jump(control: Control, at: _Place) -> Control:
    joint = int(at.rng.integers(control.gain.shape[1]))
    jump = at.rng.uniform(*at.sizes.jump) * at.rng.choice((-1.0, 1.0))
    shift = np.ones(len(control.position) - at.tick)
    back = round(at.rng.uniform(0.2, 0.5) * at.rate)  # holds, then returns as smoothly as it can
    shift[back:] = 0.5 + 0.5 * np.cos(np.pi * np.clip(np.arange(len(shift) - back) / at.rate, 0, 1))
    position, velocity = control.position.copy(), control.velocity.copy()
    position[at.tick :, joint] += jump * shift
    velocity[at.tick + 1 :, joint] += jump * np.diff(shift) * at.rate
    event = _event("highaccelerations", "reference jump", at.tick, at.tick + 1, at.rate,
                   joint=joint, jump=float(jump))  # fmt: skip
    return replace(control, position=position, velocity=velocity, events=(*control.events, event))


def _hold(control: Control, at: _Place) -> Control:
    stop = at.tick + round(at.rng.uniform(*at.sizes.hold) * at.rate)
    position, velocity = control.position.copy(), control.velocity.copy()
    position[at.tick : stop], velocity[at.tick : stop] = position[at.tick], 0.0
    event = _event("highaccelerations", "held command", at.tick, stop, at.rate)
    return replace(control, position=position, velocity=velocity, events=(*control.events, event))


def _decalibration(control: Control, at: _Place) -> Control:
    joint = int(at.rng.integers(control.gain.shape[1]))
    angle = at.rng.uniform(*at.sizes.offset) * at.rng.choice((-1.0, 1.0))
    slip = max(1, round(0.03 * at.rate))
    offset = control.offset.copy()
    offset[at.tick :, joint] += angle * np.clip(np.arange(len(offset) - at.tick) / slip, 0.0, 1.0)
    event = _event("highaccelerations", "encoder slips for good", at.tick, at.tick + slip,
                   at.rate, joint=joint, angle=float(angle))  # fmt: skip
    return replace(control, offset=offset, events=(*control.events, event))


_ADDING = (_push, _throw, _latency, _chatter, _jump, _hold, _decalibration)
# Function that adds a fault to a control, by kind.
ADD: Mapping[str, Callable[[Control, _Place], Control]] = dict(zip(KINDS, _ADDING, strict=True))


def _event(label: str, cause: str, start: int, stop: int, rate: float, **facts: float) -> Event:
    return Event(label, cause, start / rate, stop / rate, facts)


def _direction(rng: np.random.Generator) -> Array:
    direction = rng.normal(size=3)
    return direction / np.linalg.norm(direction)
