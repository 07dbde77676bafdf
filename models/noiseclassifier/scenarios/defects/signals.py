"""Defects of encoders, sensors, gains and the planned motion."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from noiseclassifier.scenarios.defects.plan import Plan, Range, begun
from noiseclassifier.scenarios.events import Event
from noiseclassifier.scenarios.faults import Faults, pulses, ramps, sines, step
from noisemodel.types import Array


@dataclass(frozen=True)
class Decalibration:
    """An encoder with an offset.

    Attributes:
        angle: The offset, in [rad].
    """

    joints: tuple[int, ...]
    angle: Range
    either: bool = False

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw joint and angle."""
        angle = float(rng.uniform(*self.angle))
        joint = self.joints[int(rng.integers(len(self.joints)))]
        if self.either:
            angle *= float(rng.choice((-1.0, 1.0)))
        return Faults(decalibration={joint: angle}, facts={"joint": joint, "angle": angle})


@dataclass(frozen=True)
class ReferenceJumps:
    """Jumps of the planned motion: away and back again.

    Attributes:
        every: Mean time between two jumps, in [s].
        distance: Distance of a jump, in [m].
        speed: Speed during a jump, in [m/s].
    """

    every: float = 1.4
    distance: Range = (0.001, 0.004)
    speed: Range = (0.1, 2.0)

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw times, effectors, directions, distances and speeds."""
        count = max(1, round(plan.duration / self.every))
        starts = (np.arange(count) + rng.uniform(0.25, 0.75, count)) * plan.duration / count
        directions = rng.normal(size=(count, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        distances = rng.uniform(*self.distance, count)
        effectors = rng.integers(len(plan.effectors), size=count)
        for signal in (distances, effectors):
            signal[1::2] = signal[: count - 1 : 2]
        directions[1::2] = -directions[: count - 1 : 2]  # and back
        rises = distances / _log_uniform(rng, self.speed, count)
        events = tuple(
            Event("highaccelerations", "jump of the planned motion", start, start + rise,
                  {"distance": distance, "speed": distance / rise, "effector": effector})
            for start, rise, distance, effector in zip(
                starts.tolist(), rises.tolist(), distances.tolist(), effectors.tolist(),
                strict=True)
        )  # fmt: skip
        shift = partial(
            ramps,
            starts=starts,
            rises=rises,
            moves=directions * distances[:, None],
            effectors=effectors,
            count=len(plan.effectors),
        )
        return Faults(shift=shift, events=events)


@dataclass(frozen=True)
class SensorJumps:
    """Jumps of the signal of a force sensor during contacts.

    Attributes:
        size: Size of a jump, either way, in [N], [N m] or [rad].
        hold: Duration of a jump, in [s].
        after: When the jumps of one contact begin, after its start, in [s].
    """

    size: Range
    sensor: str = "touch"
    axes: tuple[bool, ...] = (True,)
    hold: Range = (0.02, 0.06)
    after: tuple[Range, ...] = ((0.35, 0.42), (0.52, 0.6))
    share: float = 1.0

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw times, durations, sizes and signs."""
        there = rng.uniform(size=len(begun(plan))) < self.share
        there[:1] = True
        jumps = [
            (contact.effector, contact.start + float(rng.uniform(*span)))
            for contact, here in zip(begun(plan), there, strict=True)
            for span in self.after
            if here
        ]
        jumps = [jump for jump in jumps if jump[1] < plan.duration]
        effectors = np.array([jump[0] for jump in jumps], dtype=int)
        starts = np.array([jump[1] for jump in jumps])
        stops = starts + rng.uniform(*self.hold, len(starts))
        sizes = rng.uniform(*self.size, len(starts)) * rng.choice((-1.0, 1.0), len(starts))
        signs = rng.choice((-1.0, 1.0), (len(starts), len(self.axes))) * self.axes
        if sum(self.axes) == 1:
            signs = np.abs(signs)
        own = {f"{one.frame}.{self.sensor}": effectors == e for e, one in enumerate(plan.effectors)}
        if "." in self.sensor:
            own = {self.sensor: effectors >= 0}
        sensors = {
            name: partial(
                pulses,
                starts=starts[mine],
                stops=stops[mine],
                sizes=signs[mine] * sizes[mine, None],
            )
            for name, mine in own.items()
        }
        events = tuple(
            Event("highaccelerations", f"jump of the {self.sensor} signal", start, stop,
                  {"size": size, "effector": effector})
            for start, stop, size, effector in zip(
                starts.tolist(), stops.tolist(), sizes.tolist(), effectors.tolist(), strict=True)
        )  # fmt: skip
        return Faults(sensors=sensors, events=events)


@dataclass(frozen=True)
class ForceGain:
    """Gains of the force control that are too high, so that it becomes a limit cycle."""

    factor: Range
    start: Range = (0.0, 0.0)
    contacts: bool = True

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw the factor and the time."""
        factor = float(rng.uniform(*self.factor))
        start = float(rng.uniform(*self.start)) * plan.duration
        spans = [(contact.start, min(contact.lift, plan.duration)) for contact in begun(plan)]
        if not self.contacts:
            spans = [(start, plan.duration)]
        events = tuple(
            Event("oscillations", "force control with too high a gain", *span, {"factor": factor})
            for span in spans
            if span[1] > start
        )
        return Faults(
            gain=partial(step, start=start, factor=factor),
            events=events,
            facts={"factor": factor, "start": start},
        )


@dataclass(frozen=True)
class Multisine:
    """Oscillations superposed on the height of an effector: one sine per hertz of a band.

    Attributes:
        bands: The bands to choose from, in [Hz].
        amplitude: Of one sine of equal power, in [m].
        fastest: Upper limit of the speed, which reduces the amplitude in high bands, in [m/s]: the
            2 mm of the paper at 900 Hz would be 11 m/s, which no drive follows.
    """

    bands: tuple[Range, ...]
    amplitude: Range
    fastest: float = np.inf
    start: Range = (0.15, 0.4)
    stop: Range = (0.7, 0.95)

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw band, amplitude, phases, times, and one effector or all of them."""
        low, high = self.bands[int(rng.integers(len(self.bands)))]
        frequencies = np.arange(low, high + 1.0)
        amplitude = min(
            float(_log_uniform(rng, self.amplitude, 1)[0]), self.fastest / (2 * np.pi * high)
        )
        phases = rng.uniform(0, 2 * np.pi, len(frequencies))
        start, stop = (
            float(rng.uniform(*span)) * plan.duration for span in (self.start, self.stop)
        )
        shares = np.ones(len(plan.effectors))
        chosen = int(rng.integers(len(shares) + 1))
        if chosen < len(shares):
            shares = (np.arange(len(shares)) == chosen).astype(float)
        facts = {"band": [low, high], "amplitude": amplitude, "effectors": shares.tolist()}
        return Faults(
            overlay=partial(
                sines,
                rates=2 * np.pi * frequencies,
                phases=phases,
                amplitude=amplitude,
                start=start,
                stop=stop,
                shares=shares,
            ),
            events=(Event("oscillations", "multi-sine on the reference", start, stop, facts),),
            facts=facts,
        )


def _log_uniform(rng: np.random.Generator, span: Range, count: int) -> Array:
    return np.exp(rng.uniform(np.log(span[0]), np.log(span[1]), count))
