"""Faults: what a seed draws, and what of it acts in one run."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Protocol, Self, TypeAlias, runtime_checkable

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from noiseclassifier.scenarios.motions import (
    PUSH,
    TICK,
    Box,
    Collision,
    Contact,
    Event,
    JointStop,
    Load,
    Plan,
    Push,
    Range,
    minimum_jerk,
)
from noiseclassifier.scenarios.robots import Drivetrain
from noisemodel.types import Array

Integers: TypeAlias = NDArray[np.int64]
Signal: TypeAlias = Callable[[Array], Array]
"""From times, shape (times,), in [s], to values, their first axis the times."""


Command: TypeAlias = Callable[[Array, Array, Array], tuple[Array, Array]]
"""From times, shape (samples,), targets and rates, shape (samples, joints), to both."""
MARGIN = 0.8  # time without faults at the begin and at the end of a run, in [s]
LEAD = 0.25  # how long before the first sample a fault of a whole run begins to act, in [s]


@dataclass(frozen=True, kw_only=True)
class DriveFault:
    """A fault of drives or commands; by default none.

    Attributes:
        offset: Error of the encoders from the start of the event on, shape (joints,), in [rad].
        torque: Torque added meanwhile: from times since the start, shape (samples,), in [s], to
            shape (samples, joints), in [N m].
    """

    event: Event | None = None
    stiffness: Array | float = 1.0  # factor of the position gains meanwhile, shape (joints,)
    damping: Array | float = 1.0  # factor of the velocity gains meanwhile, shape (joints,)
    delay: float = 0.0  # further delay meanwhile, in [s]
    power: float = 1.0
    offset: Array | float = 0.0
    torque: Callable[[Array], Array] | None = None
    outside: bool = False
    command: Command | None = None
    lead: float = 0.0  # how long before its event it begins to act, in [s]
    bandwidth: float = 0.0  # of the velocities in the loop meanwhile, in [Hz]; 0: as they are
    wear: Array | float = 0.0  # torque locked to the angle meanwhile, by the limit, shape (joints,)
    backlash: float = 0.0  # further free play of elastic gears meanwhile, in [rad]

    @property
    def facts(self) -> Mapping[str, Any]:
        """The drawn values, for the metadata of the run."""
        return dict(self.event.facts) if self.event else {}


NO_DRIVE_FAULT = DriveFault()


@dataclass(frozen=True, kw_only=True)
class Faults:
    """The faults to inject into one run; by default none.

    Attributes:
        decalibration: Offsets of encoders by the index of the joint, in [rad].
        shift: Added to the planned places of the effectors: time to shape
            (ticks, effectors, 3), in [m].
        overlay: Heights and their rates, added to the reference of the drives: time to shape
            (samples, effectors, 2), in [m] and [m/s].
        sensors: Added to the values of sensors, by name: time to shape (ticks, values).
    """

    boxes: tuple[Box, ...] = ()
    ground: tuple[Box, ...] | None = None
    decalibration: Mapping[int, float] = field(default_factory=dict)
    shift: Signal | None = None
    overlay: Signal | None = None
    sensors: Mapping[str, Signal] = field(default_factory=dict)
    gain: Signal = np.ones_like  # scale of the force control's gains: time to shape (ticks,)
    loads: tuple[Load, ...] = ()
    drive: DriveFault = NO_DRIVE_FAULT
    events: tuple[Event, ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)

    def boxes_on(self, plan: Plan) -> tuple[Box, ...]:
        """The ground of a plan, or what it has become, and what lies on it."""
        return (*(plan.ground if self.ground is None else self.ground), *self.boxes)

    def offsets(self, joints: int) -> Array:
        """Offsets of a number of encoders, shape (joints,), in [rad]."""
        return np.array([self.decalibration.get(joint, 0.0) for joint in range(joints)])


def ramps(
    time: Array, *, starts: Array, rises: Array, moves: Array, effectors: Integers, count: int
) -> Array:
    """Sum of movements at constant speed, each of one effector, shape (times, count, 3)."""
    share = np.clip((time[:, None] - starts) / rises, 0, 1)
    out = np.zeros((len(time), count, 3))
    for effector in range(count):
        mine = effectors == effector
        out[:, effector] = share[:, mine] @ moves[mine]
    return out


def pulses(time: Array, *, starts: Array, stops: Array, sizes: Array) -> Array:
    """Sum of rectangular pulses of sizes (pulses, values), shape (times, values)."""
    return ((starts <= time[:, None]) & (time[:, None] < stops)) @ sizes


def step(time: Array, *, start: float, factor: float) -> Array:
    """Step from 1 to a factor, shape (times,)."""
    return np.where(time < start, 1.0, factor)


def sines(
    time: Array,
    *,
    rates: Array,
    phases: Array,
    amplitude: float,
    start: float,
    stop: float,
    shares: Array,
) -> Array:
    """Sum of sines that fades in and out over 0.1 s, and its rate."""
    out = np.zeros((len(time), len(shares), 2))
    inside = (start < time) & (time < stop)
    now = time[inside]
    envelope = np.minimum(1, np.minimum(now - start, stop - now) / 0.1)
    angles = np.outer(now, rates) + phases
    scale = amplitude / np.sqrt(len(rates)) * envelope
    wave = np.stack((scale * np.sin(angles).sum(axis=1), scale * (np.cos(angles) @ rates)), axis=1)
    out[inside] = shares[:, None] * wave[:, None]
    return out


@dataclass(frozen=True, kw_only=True)
class Imperfections:
    """Deviations of one robot from its model; scales multiply the nominal values."""

    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    force_gain: float
    mass: tuple[float, ...]
    payload: float  # mass unknown to the controller, in [kg]
    friction: tuple[float, ...]
    viscous: tuple[float, ...]
    encoder_bits: int
    encoder_noise: float  # standard deviation of the encoders' noise, in [rad]
    encoder_bandwidth: float  # natural frequency of the filter that reports velocities, in [Hz]
    force_noise: float  # standard deviation of the force sensors' noise per millisecond, in [N]
    torque_delay: int

    @classmethod
    def draw(
        cls, rng: np.random.Generator, joints: int, *, bodies: int, payload: float, force: float
    ) -> Self:
        """Draw the imperfections of one robot."""

        def scales(spread: float, count: int = joints) -> tuple[float, ...]:
            return tuple(rng.uniform(1 - spread, 1 + spread, count).tolist())

        return cls(
            stiffness=scales(0.05),
            damping=scales(0.05),
            force_gain=float(rng.uniform(0.95, 1.05)),
            mass=scales(0.05, bodies),
            payload=float(rng.uniform(0.0, payload)),
            friction=scales(0.5),
            viscous=scales(0.5),
            encoder_bits=int(rng.integers(21, 24)),
            encoder_noise=float(rng.uniform(0.2e-6, 1e-6)),
            encoder_bandwidth=float(rng.uniform(400, 700)),
            force_noise=float(rng.uniform(force / 4, force)),
            torque_delay=int(rng.integers(2, 7)),
        )

    @property
    def encoder_step(self) -> float:
        """Resolution of an encoder, in [rad]."""
        return float(2 * np.pi / 2**self.encoder_bits)


@dataclass(frozen=True)
class Decalibration:
    """An encoder with an offset."""

    joints: tuple[int, ...]
    angle: Range  # the offset, in [rad]
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
    """Jumps of the planned motion: away and back again."""

    every: float = 1.4  # mean time between two jumps, in [s]
    distance: Range = (0.001, 0.004)  # distance of a jump, in [m]
    speed: Range = (0.1, 2.0)  # speed during a jump, in [m/s]

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
        after: When the jumps of one contact begin, after its start, in [s].
    """

    size: Range  # size of a jump, either way, in [N], [N m] or [rad]
    sensor: str = "touch"
    axes: tuple[bool, ...] = (True,)
    hold: Range = (0.02, 0.06)  # duration of a jump, in [s]
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
        fastest: Upper limit of the speed, which reduces the amplitude in high bands, in [m/s]: the
            2 mm of the paper at 900 Hz would be 11 m/s, which no drive follows.
    """

    bands: tuple[Range, ...]  # the bands to choose from, in [Hz]
    amplitude: Range  # of one sine of equal power, in [m]
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


@dataclass(frozen=True)
class Obstacles:
    """Boxes on the ground, unknown to the controller, where effectors touch down."""

    height: Range  # height of a box, in [m]
    half: Range  # half of its edge lengths along and across the effector, in [m]
    offset: Range = (0.0, 0.0)
    effectors: tuple[int, ...] = ()
    share: float = 1.0
    most: int | None = None

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Put boxes at some of the planned contacts."""
        places = begun(plan, self.effectors)
        if self.most is not None and len(places) > self.most:
            places = places[: max(self.most, len(places) - 1)]
            chosen = np.sort(rng.choice(len(places), self.most, replace=False))
            places = [places[index] for index in chosen.tolist()]
        heights = rng.uniform(*self.height, len(places))
        there = rng.uniform(size=len(places)) < self.share
        there[:1] = True
        boxes = tuple(
            self._box(contact, height, plan)
            for contact, height, here in zip(places, heights.tolist(), there, strict=True)
            if here
        )
        return Faults(boxes=boxes, facts={"tops": [box.top for box in boxes]})

    def _box(self, contact: Contact, height: float, plan: Plan) -> Box:
        patch = plan.effectors[contact.effector].patch
        along, across = (share * half for share, half in zip(self.offset, patch, strict=True))
        cosine, sine = np.cos(contact.yaw), np.sin(contact.yaw)
        x, y, z = contact.place
        return Box(
            (
                float(x + cosine * along - sine * across),
                float(y + sine * along + cosine * across),
                z + height / 2,
            ),
            (*self.half, height / 2),
            yaw=contact.yaw,
            since=contact.approach,
            until=contact.stop if contact.approach > 0 else np.inf,
        )


@dataclass(frozen=True)
class GivingWay:
    """Ground that gives way under an effector: a box that vanishes."""

    depth: Range  # height of the box, in [m]
    half: Range  # half of its edge lengths, in [m]
    after: Range  # when it vanishes, after the start of a contact, in [s]

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Lower the ground, and put boxes where contacts are planned, for some time."""
        depth = float(rng.uniform(*self.depth))
        boxes, events = [], []
        for contact in begun(plan):
            end = contact.start + float(rng.uniform(*self.after))
            x, y, z = contact.place
            boxes.append(Box((x, y, z - depth / 2), (*self.half, depth / 2), until=end))
            events.append(
                Event("highaccelerations", "ground that gives way", end,
                      min(contact.lift, plan.duration), {"depth": depth})
            )  # fmt: skip
        deeper = tuple(
            replace(box, centre=(*box.centre[:2], box.centre[2] - depth)) for box in plan.ground
        )
        events = [event for event in events if event.start < event.stop]
        return Faults(
            ground=deeper, boxes=tuple(boxes), events=tuple(events), facts={"depth": depth}
        )


@dataclass(frozen=True)
class Overhang:
    """An edge of a platform nearer than planned: the last contact on it is partial."""

    share: Range

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Move the edge; a plan on flat ground stays as it is."""
        share = float(rng.uniform(*self.share))
        platform, *floor = plan.ground
        above = [contact for contact in plan.contacts if contact.place[2] == platform.top]
        if not floor or not above:
            return Faults(facts={"overhang": share})
        last = above[-1]
        edge = last.place[0] + (1 - 2 * share) * plan.effectors[last.effector].patch[0]
        nearer = replace(platform, centre=(edge - platform.half[0], *platform.centre[1:]))
        event = Event(
            "highaccelerations", "partial contact at an edge", last.start,
            min(last.lift, plan.duration), {"overhang": share, "effector": last.effector},
        )  # fmt: skip
        return Faults(
            ground=(nearer, *floor), events=(event,), facts={"overhang": share, "edge": edge}
        )


@dataclass(frozen=True)
class StepDown:
    """A step down at an edge across the path."""

    depth: Range  # height of the step, in [m]
    when: Range = (0.3, 0.5)

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw depth and place of the edge: beyond all contacts so far, before the next one."""
        depth = float(rng.uniform(*self.depth))
        start = float(rng.uniform(*self.when)) * plan.duration
        contacts = sorted(plan.contacts, key=lambda contact: contact.start)
        yaw = contacts[0].yaw
        heading = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        ways = np.array([contact.place for contact in contacts]) @ heading
        furthest = np.maximum.accumulate(ways)
        over = 1 + np.flatnonzero(np.diff(furthest) > 0)
        late = [index for index in over.tolist() if contacts[index].start >= start]
        first = late[0] if late else int(over[-1])
        reached, next_one = furthest[first - 1], furthest[first]
        between = np.unique(ways[(reached <= ways) & (ways <= next_one)])
        widest = int(np.argmax(np.diff(between)))  # other feet must not meet the edge either
        edge = float(between[widest : widest + 2].mean())
        ground = []
        for box in plan.ground:
            x, y, z = box.centre
            back = (edge - box.half[0]) * heading
            ground += [
                replace(box, centre=(float(back[0]), float(back[1]), z), yaw=yaw),
                replace(box, centre=(x, y, z - depth)),
            ]
        falls: dict[int, Event] = {}
        for contact, way in zip(contacts, ways.tolist(), strict=True):
            stop = min(contact.lift, plan.duration)
            if way > edge and contact.effector not in falls and contact.start < stop:
                falls[contact.effector] = Event(
                    "highaccelerations",
                    "ground that is not there",
                    contact.start,
                    stop,
                    {"depth": depth, "effector": contact.effector},
                )
        return Faults(
            ground=tuple(ground),
            events=tuple(falls.values()),
            facts={"depth": depth, "edge": edge},
        )


MOVING = 0.05  # least speed of an effector that is to collide, in [m/s]
SLOW = 0.05  # highest speed of an effector that moves slowly, in [m/s]
ALONE = 0.6  # time without pushes at the begin and at the end of a run, in [s]


@runtime_checkable
class _Tool(Protocol):
    position: Array


@runtime_checkable
class _Joints(Protocol):
    joints: Array


@dataclass(frozen=True)
class Collisions:
    """Obstacles in the air that a tool meets while it moves, each at another time.

    Attributes:
        limit: Force at which an obstacle breaks loose, in [N], times the robot's unit of force.
    """

    every: float = 2.0  # mean time between two collisions, in [s]
    stiffness: Range = (1e3, 1e5)  # in [N/m], times the robot's unit of force
    limit: Range = (10.0, 150.0)
    hold: Range = (0.1, 0.5)  # time in which its resistance fades, in [s]

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw times at which the tool is to move, and obstacles; none where it does not."""
        if not isinstance(plan, _Tool):
            return Faults()
        speed = np.linalg.norm(np.gradient(plan.position, TICK, axis=0), axis=1)
        count = max(1, round(plan.duration / self.every))
        loads = []
        for span in np.array_split(np.arange(len(speed)), count):
            middle = span[len(span) // 8 : -(len(span) // 4)]
            moving = middle[speed[middle] > max(MOVING, 0.5 * speed[middle].max())]
            share, *values = rng.uniform(size=4).tolist()
            if not moving.size:
                continue
            stiffness, limit = (
                plan.units.force * float(np.exp(_between(np.log(span), value)))
                for span, value in zip((self.stiffness, self.limit), values, strict=False)
            )
            loads.append(
                Collision(
                    frame=plan.effectors[0].frame,
                    start=float(moving[int(share * len(moving))] * TICK),
                    hold=_between(self.hold, values[2]),
                    stiffness=stiffness,
                    limit=limit,
                )
            )
        return Faults(loads=tuple(loads), facts={"starts": [load.start for load in loads]})


@dataclass(frozen=True)
class JointStops:
    """An end stop of a joint that is nearer than the controller knows."""

    overshoot: Range = (0.05, 0.4)  # how far beyond it the plan goes at most, in [rad]
    stiffness: Range = (3e3, 3e4)  # in [N m/rad], times the robot's unit of torque
    least: float = 0.1  # least range of a joint's motion, in [rad]

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw joint, side and angle; none where joints move little, or have no plan."""
        if not isinstance(plan, _Joints):
            return Faults()
        away = plan.joints - plan.joints[0]
        furthest = np.stack((-away.min(axis=0), away.max(axis=0)))  # down, up
        chosen = np.argwhere(furthest > self.least)
        index, share, hardness = rng.uniform(size=3).tolist()
        if not len(chosen):
            return Faults()
        side, joint = chosen[int(index * len(chosen))].tolist()
        way = float(furthest[side, joint])
        over = min(_between(self.overshoot, share), 0.7 * way)
        sign = 2 * side - 1
        stop = JointStop(
            joint=joint,
            angle=float(plan.joints[0, joint]) + sign * (way - over),
            side=sign,
            stiffness=plan.units.torque * float(np.exp(_between(np.log(self.stiffness), hardness))),
        )
        return Faults(loads=(stop,), facts={"joint": joint, "angle": stop.angle})


@dataclass(frozen=True)
class Pushes:
    """Hands that push links while the robot stands or moves slowly, each at another time."""

    every: float = 2.5  # mean time between two pushes, in [s]
    force: Range = (3.0, 40.0)  # largest force, in [N], times the robot's unit of force
    rise: Range = (0.1, 1.0)  # time in which it rises, and time in which it falls, in [s]
    hold: Range = (0.0, 0.4)  # time in between, in [s]
    along: Range = (0.3, 1.0)

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw pushes where the tool is slow; at least one, where it is slowest."""
        if not isinstance(plan, _Tool):
            return Faults()
        speed = np.linalg.norm(np.gradient(plan.position, TICK, axis=0), axis=1)
        edge = round(min(ALONE, plan.duration / 4) / TICK)
        count = max(1, round((plan.duration - 2 * ALONE) / self.every))
        drawn = []
        for span in np.array_split(np.arange(edge, len(speed) - edge), count):
            times = np.append(_log_between(self.rise, rng.uniform(size=2)), rng.uniform(*self.hold))
            times *= min(1.0, 0.9 * len(span) * TICK / times.sum())
            size = plan.units.force * float(_log_between(self.force, rng.uniform()))
            way, along, place = rng.normal(size=3), rng.uniform(*self.along), rng.uniform()
            fastest = sliding_window_view(speed[span], round(times.sum() / TICK)).max(axis=1)
            slow = np.flatnonzero(fastest <= max(SLOW, fastest.min()))
            first = slow[int(place * len(slow))]
            start, (x, y, z) = float(span[first] * TICK), size * way / np.linalg.norm(way)
            push = Push(
                along=float(along),
                start=start,
                stop=start + float(times.sum()),
                rise=float(times[0]),
                fall=float(times[1]),
                force=(float(x), float(y), float(z)),
            )
            drawn.append((fastest[first], push))
        slowest = min(one for one, _ in drawn)
        pushes = [push for fastest, push in drawn if fastest <= max(SLOW, slowest)]
        events = tuple(
            Event("impact", PUSH, push.start, push.stop,
                  {"force": float(np.linalg.norm(push.force)), "along": push.along})
            for push in pushes
        )  # fmt: skip
        return Faults(
            loads=tuple(pushes), events=events, facts={"starts": [push.start for push in pushes]}
        )


def _log_between(span: Range, share: Array | float) -> Array:
    low, high = np.log(span)
    return np.asarray(np.exp(low + share * (high - low)))


def _between(span: Range | Array, share: float) -> float:
    return float(span[0] + share * (span[1] - span[0]))


@dataclass(frozen=True)
class Scaled:
    """A defect with settings in the units of the robot."""

    defect: Any
    units: Mapping[str, str]

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw the faults of one run, their sizes multiplied by the robot's units."""
        settings = {
            name: tuple(getattr(plan.units, unit) * value for value in getattr(self.defect, name))
            for name, unit in self.units.items()
        }
        faults: Faults = replace(self.defect, **settings).draw(rng, plan)
        return faults


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
class TargetJump:
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


def _log_one(rng: np.random.Generator, least: float, most: float) -> float:
    return float(np.exp(rng.uniform(np.log(least), np.log(most))))


def _some(rng: np.random.Generator, joints: int) -> Array:
    """One joint, or a few, or all."""
    count = int(rng.choice([1, 1, 2, joints]))
    chosen = np.zeros(joints)
    chosen[rng.choice(joints, min(count, joints), replace=False)] = 1.0
    return chosen


def latency(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw a delay that grows for a while."""
    delay = _log_one(rng, 2e-3, 30e-3)
    start, stop = _when(rng, duration, float(rng.uniform(0.4, 2.0)))
    facts = {"delay": delay}
    return DriveFault(event=Event("oscillations", "latency", start, stop, facts), delay=delay)


def chatter(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw gains that are too high for a while, for a delay that is a little longer, too."""
    joints = _some(rng, len(drives.joints))
    factor, delay = _log_one(rng, 4.0, 60.0), _log_one(rng, 0.5e-3, 4e-3)
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
    start, stop = _when(rng, duration, _log_one(rng, 0.015, 0.25))
    event = Event("highaccelerations", "held command", start, stop + 0.02, {})
    return DriveFault(event=event, command=Held(start, stop))


def lost(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw targets of which some are lost."""
    share = float(rng.uniform(0.1, 0.7))
    start, stop = _when(rng, duration, float(rng.uniform(0.3, 1.5)))
    event = Event("highaccelerations", "lost commands", start, stop, {"share": share})
    return DriveFault(event=event, command=Lost(start, stop, share, seed=int(rng.integers(2**31))))


def target_jump(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw targets that jump."""
    joints = _some(rng, len(drives.joints))
    size = _log_one(rng, 2e-3, 0.1)
    start, stop = _when(rng, duration, float(rng.uniform(0.2, 1.0)))
    facts = {"size": size, "joints": joints.tolist()}
    event = Event("highaccelerations", "jump of the target", start, start + 0.02, facts)
    signs = rng.choice((-1.0, 1.0), len(joints))
    return DriveFault(event=event, command=TargetJump(start, stop, size * signs * joints))


def tone(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw an oscillation of the torque at one frequency."""
    joints = _some(rng, len(drives.joints))
    frequency = _log_one(rng, 15.0, 400.0)
    share = _log_one(rng, 0.01, 0.6)
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
    length, share = _log_one(rng, 2e-3, 30e-3), _log_one(rng, 0.05, 2.0)
    start, stop = _when(rng, duration, length)
    facts = {"share": share, "joints": joints.tolist()}
    size = share * np.array(drives.torque) * joints * rng.choice((-1.0, 1.0), len(joints))

    def torque(since: Array) -> Array:
        return np.outer(np.sin(np.pi * np.clip(since / length, 0, 1)), size)

    event = Event("impact", "blow", start, stop, facts)
    return DriveFault(event=event, torque=torque, outside=True)


def dropout(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw drives without torque for a moment."""
    start, stop = _when(rng, duration, _log_one(rng, 3e-3, 80e-3))
    event = Event("highaccelerations", "drives without torque", start, stop + 0.02, {})
    return DriveFault(event=event, power=0.0)


def slip(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw an encoder that slips, and stays off."""
    joints = np.zeros(len(drives.joints))
    joints[rng.integers(len(joints))] = 1.0
    size = _log_one(rng, 2e-3, 0.06) * float(rng.choice((-1.0, 1.0)))
    start, stop = _when(rng, duration, 0.02)
    facts = {"offset": size, "joints": joints.tolist()}
    event = Event("highaccelerations", "encoder slip", start, stop, facts)
    return DriveFault(event=event, offset=size * joints)


@dataclass(frozen=True)
class OnDrives:
    """A fault of drives or commands: drawn from random numbers, drives and the run's duration."""

    kind: Callable[[np.random.Generator, Drivetrain, float], DriveFault]

    def draw(self, rng: np.random.Generator, plan: Plan, drives: Drivetrain) -> Faults:
        """Draw the fault of one run."""
        fault = self.kind(rng, drives, plan.duration)
        events = (fault.event,) if fault.event else ()
        return Faults(drive=fault, events=events, facts=fault.facts)


ON_DRIVES: dict[str, OnDrives] = {
    "latency": OnDrives(latency),
    "chatter": OnDrives(chatter),
    "held-command": OnDrives(held),
    "lost-commands": OnDrives(lost),
    "target-jump": OnDrives(target_jump),
    "tone": OnDrives(tone),
    "blow": OnDrives(knock),
    "torque-dropout": OnDrives(dropout),
    "encoder-slip": OnDrives(slip),
}
"""Faults of robots of every family, by name."""


def _throughout(cause: str, duration: float, facts: dict[str, Any], **acts: Any) -> DriveFault:
    """A fault that is there before the first sample, and until the last."""
    event = Event("oscillations", cause, 0.0, duration, {**facts, "throughout": True})
    return DriveFault(event=event, lead=LEAD, **acts)


def high_gains(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw gains that are too high, for a delay that is a little longer, too."""
    joints = _some(rng, len(drives.joints))
    factor, delay = _log_one(rng, 2.0, 60.0), _log_one(rng, 0.2e-3, 4e-3)
    gains = np.where(joints > 0, factor, 1.0)
    soft = rng.uniform() < 0.3
    facts = {"factor": factor, "delay": delay, "joints": joints.tolist()}
    acts = {"stiffness": gains, "damping": 1.0 if soft else gains, "delay": delay}
    return _throughout("too high gains", duration, facts, **acts)


def long_delay(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw a delay that the gains do not bear."""
    delay = _log_one(rng, 2e-3, 30e-3)
    return _throughout("latency", duration, {"delay": delay}, delay=delay)


def slow_filter(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw a filter of the velocities in the loop that is too slow for its damping."""
    bandwidth, factor = _log_one(rng, 2.0, 40.0), _log_one(rng, 1.0, 15.0)
    facts = {"bandwidth": bandwidth, "factor": factor}
    return _throughout("slow filter", duration, facts, bandwidth=bandwidth, damping=factor)


def worn(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw gears that are worn: they shake joints at their teeth, and have more play."""
    joints = _some(rng, len(drives.joints))
    wear, backlash = _log_one(rng, 0.01, 0.5), _log_one(rng, 2e-4, 1e-2)
    facts = {"wear": wear, "backlash": backlash, "joints": joints.tolist()}
    return _throughout("worn drives", duration, facts, wear=wear * joints, backlash=backlash)


def steady_tone(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw an oscillation of the torque at one frequency."""
    joints = _some(rng, len(drives.joints))
    frequency, share = _log_one(rng, 15.0, 300.0), _log_one(rng, 0.01, 0.6)
    size = share * np.array(drives.torque) * joints

    def torque(since: Array) -> Array:
        return np.outer(np.minimum(1, since / 0.05) * np.sin(2 * np.pi * frequency * since), size)

    facts = {"frequency": frequency, "share": share, "joints": joints.tolist()}
    return _throughout("oscillation of the torque", duration, facts, torque=torque)


def steady_noise(rng: np.random.Generator, drives: Drivetrain, duration: float) -> DriveFault:
    """Draw an octave of noise of the torque."""
    joints = _some(rng, len(drives.joints))
    frequency, share = _log_one(rng, 15.0, 300.0), _log_one(rng, 0.01, 0.6)
    seed, size = int(rng.integers(2**31)), share * np.array(drives.torque) * joints

    def torque(since: Array) -> Array:
        white = np.fft.rfft(np.random.default_rng(seed).standard_normal(len(since)))
        place = np.fft.rfftfreq(len(since), since[1] - since[0])
        white[(place < frequency / np.sqrt(2)) | (place > frequency * np.sqrt(2))] = 0.0
        noise = np.fft.irfft(white, len(since))
        noise *= np.minimum(1, since / 0.05) / np.sqrt(2 * np.mean(noise**2))  # as loud as a tone
        return np.outer(noise, size)

    facts = {"frequency": frequency, "share": share, "joints": joints.tolist()}
    return _throughout("noise of the torque", duration, facts, torque=torque)


THROUGHOUT: dict[str, OnDrives] = {
    "throughout-gains": OnDrives(high_gains),
    "throughout-delay": OnDrives(long_delay),
    "throughout-filter": OnDrives(slow_filter),
    "throughout-wear": OnDrives(worn),
    "throughout-tone": OnDrives(steady_tone),
    "throughout-noise": OnDrives(steady_noise),
}
"""Faults of robots of every family that are there from the first sample to the last, by name."""


class OnPlan(Protocol):
    """A fault that depends on the plan only by time, ground, contacts and motion."""

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw the faults of one run."""
        ...


Defect: TypeAlias = OnDrives | OnPlan  # settings from which a seed draws faults


@dataclass(frozen=True)
class NoDefect:
    """No defect: only the imperfections of every robot."""

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw no faults."""
        return Faults()


NO_DEFECT = NoDefect()


def drawn(defect: Defect, rng: np.random.Generator, plan: Plan, drives: Drivetrain) -> Faults:
    """The faults of one run."""
    if isinstance(defect, OnDrives):
        return defect.draw(rng, plan, drives)
    return defect.draw(rng, plan)


def begun(plan: Plan, effectors: Sequence[int] = ()) -> list[Contact]:
    """Contacts that start during the run, of some effectors or of all."""
    return [
        contact
        for contact in plan.contacts
        if contact.start > 0 and (not effectors or contact.effector in effectors)
    ]


ADVANCE = 0.3  # shortest way over which a step down may come, as a share of the height of the robot


@dataclass(frozen=True)
class Underfoot:
    """Boxes under feet, lower than the feet are lifted."""

    feet: tuple[int, ...]
    rise: Range = (0.35, 0.65)
    half: float = 0.2
    share: float = 1.0
    most: int | None = None

    def draw(self, rng: np.random.Generator, plan: Any) -> Faults:
        """Put boxes at some of the planned contacts; none if no foot is lifted."""
        lift = float(np.ptp(plan.feet[..., 2]))
        if not lift:
            return Faults()
        low, high = self.rise
        half = self.half * plan.units.length
        return Obstacles(
            (low * lift, high * lift),
            (half, half),
            effectors=self.feet,
            share=self.share,
            most=self.most,
        ).draw(rng, plan)


@dataclass(frozen=True)
class Ahead:
    """A defect that acts only if the feet get ahead of where they stand at first."""

    defect: OnPlan

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw the faults; none for a plan that does not advance."""
        ways = [contact.place[0] for contact in plan.contacts]
        first = max(contact.place[0] for contact in plan.contacts if contact.start <= 0)
        if max(ways) < first + ADVANCE * plan.units.length:
            return Faults()
        return self.defect.draw(rng, plan)
