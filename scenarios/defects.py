"""What can be wrong with a robot or its world: settings, from which a seed draws faults.

A defect acts in one of five places: ground, encoder, planned motion, force sensor, gains.
"""

from dataclasses import dataclass
from functools import partial
from typing import Protocol, TypeAlias

import numpy as np

from noisemodel.types import Array
from scenarios.events import Event
from scenarios.faults import Faults, pulses, ramps, sines
from scenarios.picking import Plan
from scenarios.shapes import Box

Range: TypeAlias = tuple[float, float]


class Defect(Protocol):
    """Settings from which faults are drawn."""

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw the faults of one run."""
        ...


@dataclass(frozen=True)
class NoDefect:
    """A robot as good as robots are."""

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw no faults."""
        return Faults()


@dataclass(frozen=True)
class Plates:
    """Plates on the table, unknown to the controller, where the tool comes down.

    Attributes:
        height: How high a plate is, in [m]; the tool slows down 0.01 m above the table.
        half: Half of its edge length, in [m].
        share: How many of the places have one; the first one always has.
    """

    height: Range = (0.014, 0.025)
    half: float = 0.05
    share: float = 0.7

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Put plates at some of the planned contacts."""
        heights = rng.uniform(*self.height, len(plan.touches))
        there = rng.uniform(size=len(plan.touches)) < self.share
        there[:1] = True
        boxes = tuple(
            Box((touch.place[0], touch.place[1], touch.place[2] + height / 2),
                (self.half, self.half, height / 2))
            for touch, height, here in zip(plan.touches, heights.tolist(), there, strict=True)
            if here
        )  # fmt: skip
        return Faults(boxes=boxes, facts={"plate_tops": [box.top for box in boxes]})


@dataclass(frozen=True)
class Decalibration:
    """An encoder that is off, so that the tool is lower than the controller thinks.

    Attributes:
        joint: Index of the joint.
        angle: What the encoder reads too much, in [rad].
    """

    joint: int = 1
    angle: Range = (-0.05, -0.03)

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw the angle."""
        angle = float(rng.uniform(*self.angle))
        return Faults(
            decalibration={self.joint: angle}, facts={"joint": self.joint, "angle": angle}
        )


@dataclass(frozen=True)
class ReferenceJumps:
    """Jumps of the planned motion: away and back again.

    Attributes:
        every: Mean time between two jumps, in [s].
        distance: How far a jump goes, in [m].
        speed: How fast: the velocity jumps to it and back to where it was, in [m/s].
    """

    every: float = 1.4
    distance: Range = (0.001, 0.004)
    speed: Range = (0.1, 2.0)

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw times, directions, distances and speeds."""
        count = max(1, round(plan.duration / self.every))
        starts = (np.arange(count) + rng.uniform(0.25, 0.75, count)) * plan.duration / count
        directions = rng.normal(size=(count, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        distances = rng.uniform(*self.distance, count)
        distances[1::2], directions[1::2] = distances[:-1:2], -directions[:-1:2]  # and back
        rises = distances / _log_uniform(rng, self.speed, count)
        events = tuple(
            Event("highaccelerations", "jump of the planned motion", start, start + rise,
                  {"distance": distance, "speed": distance / rise})
            for start, rise, distance in zip(
                starts.tolist(), rises.tolist(), distances.tolist(), strict=True)
        )  # fmt: skip
        moves = directions * distances[:, None]
        return Faults(shift=partial(ramps, starts=starts, rises=rises, moves=moves), events=events)


@dataclass(frozen=True)
class ForceJumps:
    """Jumps of the force sensor's signal while the tool presses.

    Attributes:
        force: Size of a jump, either way, in [N].
        hold: How long it lasts, in [s].
        after: When the jumps of one contact begin, after the start of pressing, in [s].
    """

    force: Range = (80.0, 160.0)
    hold: Range = (0.02, 0.06)
    after: tuple[Range, ...] = ((0.35, 0.42), (0.52, 0.6))

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw times, durations, sizes and signs."""
        starts = np.array(
            [touch.start + rng.uniform(*span) for touch in plan.touches for span in self.after]
        )
        stops = starts + rng.uniform(*self.hold, len(starts))
        sizes = rng.uniform(*self.force, len(starts)) * rng.choice((-1.0, 1.0), len(starts))
        events = tuple(
            Event("highaccelerations", "jump of the force signal", start, stop, {"force": size})
            for start, stop, size in zip(
                starts.tolist(), stops.tolist(), sizes.tolist(), strict=True)
            if start < plan.duration
        )  # fmt: skip
        return Faults(force=partial(pulses, starts=starts, stops=stops, sizes=sizes), events=events)


@dataclass(frozen=True)
class ForceGain:
    """A gain of the force control that is too high: pressing becomes a limit cycle.

    Attributes:
        factor: What the gain is multiplied by.
    """

    factor: Range = (5.0, 9.0)

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw the factor."""
        factor = float(rng.uniform(*self.factor))
        events = tuple(
            Event("oscillations", "force control with too high a gain", touch.start,
                  min(touch.lift, plan.duration), {"factor": factor})
            for touch in plan.touches
        )  # fmt: skip
        return Faults(force_gain=factor, events=events, facts={"factor": factor})


@dataclass(frozen=True)
class Multisine:
    """Oscillations superposed on the tool's height: one sine per hertz of a band.

    Attributes:
        bands: The bands to choose from, in [Hz].
        amplitude: Of the one sine that would carry as much power, in [m].
        fastest: Speed that lowers the amplitude of high bands, in [m/s]: the paper's 2 mm at
            900 Hz would be 11 m/s, which no drive follows and nobody overlooks.
        start: When it sets in, as a share of the run.
        stop: When it ends, as a share of the run.
    """

    bands: tuple[Range, ...] = (
        (20, 30), (30, 40), (40, 50), (50, 60), (60, 100), (100, 150), (150, 250), (250, 350),
        (900, 1000),
    )  # fmt: skip
    amplitude: Range = (0.0001, 0.002)
    fastest: float = 1.0
    start: Range = (0.15, 0.4)
    stop: Range = (0.7, 0.95)

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw band, amplitude, phases and times."""
        low, high = self.bands[int(rng.integers(len(self.bands)))]
        frequencies = np.arange(low, high + 1.0)
        amplitude = min(
            float(_log_uniform(rng, self.amplitude, 1)[0]), self.fastest / (2 * np.pi * high)
        )
        phases = rng.uniform(0, 2 * np.pi, len(frequencies))
        start, stop = (
            float(rng.uniform(*span)) * plan.duration for span in (self.start, self.stop)
        )
        facts = {"band": [low, high], "amplitude": amplitude}
        return Faults(
            overlay=partial(
                sines,
                rates=2 * np.pi * frequencies,
                phases=phases,
                amplitude=amplitude,
                start=start,
                stop=stop,
            ),
            events=(Event("oscillations", "multi-sine on the reference", start, stop, facts),),
            facts=facts,
        )


def _log_uniform(rng: np.random.Generator, span: Range, count: int) -> Array:
    return np.exp(rng.uniform(np.log(span[0]), np.log(span[1]), count))
