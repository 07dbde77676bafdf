"""Faults: what a seed draws for one run, from a plan and the settings in table.toml.

Each function that returns `Faults` draws one kind of fault from random numbers, the plan of the
run, and keywords: its settings, in the units that table.toml states. Forces and stiffnesses of
loads are multiplied by the robot's units.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self, TypeAlias

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from noiseclassifier.scenarios.motions import (
    PUSH,
    RATE,
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
    Rng,
    Signal,
    minimum_jerk,
)
from noiseclassifier.scenarios.robots import Simulated
from noisemodel.types import Array

if TYPE_CHECKING:
    from noiseclassifier.scenarios.domains import Domain

Integers: TypeAlias = NDArray[np.int64]
# From times, shape (samples,), targets and rates, shape (samples, joints), to both.
Command: TypeAlias = Callable[[Array, Array, Array], tuple[Array, Array]]


@dataclass(frozen=True, kw_only=True)
class DriveFault:
    """A fault of drives or commands, from a lead before its event to its end; by default none."""

    event: Event | None = None
    lead: float = 0.0  # how long before its event it begins to act, in [s]
    stiffness: Array | float = 1.0  # factor of the position gains, shape (joints,)
    damping: Array | float = 1.0  # factor of the velocity gains, shape (joints,)
    delay: float = 0.0  # further delay, in [s]
    power: float = 1.0  # factor of the torques
    offset: Array | float = 0.0  # error of the encoders, which stays, shape (joints,), in [rad]
    torque: Signal | None = None  # added, from times since it begins, in [N m]
    outside: bool = False  # whether that acts from outside: drives do not measure it
    command: Command | None = None
    bandwidth: float = 0.0  # of the velocities in the loop, in [Hz]; 0: as they are
    wear: Array | float = 0.0  # torque locked to the angle, by the limit, shape (joints,)
    backlash: float = 0.0  # further free play of elastic gears, in [rad]


NO_DRIVE_FAULT = DriveFault()


@dataclass(frozen=True, kw_only=True)
class Faults:
    """The faults to inject into one run; by default none."""

    boxes: tuple[Box, ...] = ()
    ground: tuple[Box, ...] | None = None
    decalibration: Mapping[int, float] = field(default_factory=dict)  # of joints, in [rad]
    shift: Signal | None = None  # of the planned places, shape (ticks, effectors, 3), in [m]
    overlay: Signal | None = None  # heights and rates, shape (samples, effectors, 2), in [m], [m/s]
    sensors: Mapping[str, Signal] = field(default_factory=dict)  # added, shape (ticks, values)
    gain: Signal = np.ones_like  # scale of the force control's gains, shape (ticks,)
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


Defect: TypeAlias = Callable[[Rng, Plan], Faults]  # a kind of fault with its settings


def no_defect(rng: Rng, plan: Plan) -> Faults:
    """No faults: only the imperfections of every robot."""
    return Faults()


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
    torque_delay: int  # in samples

    @classmethod
    def draw(
        cls, rng: Rng, robot: Simulated, *, bodies: int, domain: "Domain | None" = None
    ) -> Self:
        """Draw what differs from robot to robot, from joint to joint and from body to body."""

        def scales(spread: float, count: int = len(robot.drives.joints)) -> tuple[float, ...]:
            return tuple(rng.uniform(1 - spread, 1 + spread, count).tolist())

        gains, losses = (0.05, 0.5) if domain is None else (0.1, 0.3)
        drawn: dict[str, Any] = {
            "stiffness": scales(gains),
            "damping": scales(gains),
            "force_gain": float(rng.uniform(1 - gains, 1 + gains)),
            "mass": scales(0.05, bodies),
        }
        if domain is None:
            return cls(
                **drawn,
                payload=float(rng.uniform(0.0, robot.payload)),
                friction=scales(losses),
                viscous=scales(losses),
                encoder_bits=int(rng.integers(21, 24)),
                encoder_noise=float(rng.uniform(0.2e-6, 1e-6)),
                encoder_bandwidth=float(rng.uniform(400, 700)),
                force_noise=float(rng.uniform(robot.force_noise / 4, robot.force_noise)),
                torque_delay=int(rng.integers(2, 7)),
            )
        drawn["mass"] = tuple(domain.mass * scale for scale in drawn["mass"])
        return cls(
            **drawn,
            payload=domain.payload * robot.payload,
            friction=scales(losses),
            viscous=scales(losses),
            encoder_bits=domain.encoder_bits,
            encoder_noise=float(0.1 * 2 * np.pi / 2**domain.encoder_bits),
            encoder_bandwidth=domain.encoder_bandwidth,
            force_noise=float(rng.uniform(0.25, 1.0)) * robot.force_noise,
            torque_delay=round(domain.delay * RATE),
        )


def _log_uniform(rng: Rng, span: Range, count: int) -> Array:
    return np.exp(rng.uniform(np.log(span[0]), np.log(span[1]), count))


def _log(span: Range, share: Array | float) -> Array:
    """What lies so far between the logarithms of two ends."""
    low, high = np.log(span)
    return np.asarray(np.exp(low + share * (high - low)))


def begun(plan: Plan, effectors: Sequence[int] = ()) -> list[Contact]:
    """Contacts that start during the run, of some effectors or of all."""
    return [
        contact
        for contact in plan.contacts
        if contact.start > 0 and (not effectors or contact.effector in effectors)
    ]


def decalibration(
    rng: Rng, plan: Plan, *, joints: Sequence[int], angle: Range, either: bool = False
) -> Faults:
    """An encoder with an offset, in [rad]."""
    offset = float(rng.uniform(*angle))
    joint = joints[int(rng.integers(len(joints)))]
    if either:
        offset *= float(rng.choice((-1.0, 1.0)))
    return Faults(decalibration={joint: offset}, facts={"joint": joint, "angle": offset})


def reference_jumps(rng: Rng, plan: Plan, *, every: float, distance: Range, speed: Range) -> Faults:
    """Jumps of the planned motion, away and back again: one in so many [s], by [m], at [m/s]."""
    count = max(1, round(plan.duration / every))
    starts = (np.arange(count) + rng.uniform(0.25, 0.75, count)) * plan.duration / count
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    distances = rng.uniform(*distance, count)
    effectors = rng.integers(len(plan.effectors), size=count)
    for signal in (distances, effectors):
        signal[1::2] = signal[: count - 1 : 2]
    directions[1::2] = -directions[: count - 1 : 2]  # and back
    rises = distances / _log_uniform(rng, speed, count)
    moves = directions * distances[:, None]

    def shift(time: Array) -> Array:
        share = np.clip((time[:, None] - starts) / rises, 0, 1)
        out = np.zeros((len(time), len(plan.effectors), 3))
        for effector in range(len(plan.effectors)):
            mine = effectors == effector
            out[:, effector] = share[:, mine] @ moves[mine]
        return out

    events = []
    jumps = (starts, rises, distances, effectors)
    for start, rise, way, effector in zip(*(each.tolist() for each in jumps), strict=True):
        facts = {"distance": way, "speed": way / rise, "effector": effector}
        cause = "jump of the planned motion"
        events.append(Event("highaccelerations", cause, start, start + rise, facts))
    return Faults(shift=shift, events=tuple(events))


def sensor_jumps(
    rng: Rng,
    plan: Plan,
    *,
    size: Range,
    sensor: str = "touch",
    axes: tuple[bool, ...] = (True,),
    hold: Range = (0.02, 0.06),
    after: Sequence[Range] = ((0.35, 0.42), (0.52, 0.6)),
    share: float = 1.0,
) -> Faults:
    """Jumps of the signal of a sensor during contacts."""
    contacts = begun(plan)
    there = rng.uniform(size=len(contacts)) < share
    there[:1] = True
    jumps = [
        (contact.effector, contact.start + float(rng.uniform(*span)))
        for contact, here in zip(contacts, there, strict=True)
        for span in after
        if here
    ]
    jumps = [jump for jump in jumps if jump[1] < plan.duration]
    effectors = np.array([jump[0] for jump in jumps], dtype=int)
    starts = np.array([jump[1] for jump in jumps])
    stops = starts + rng.uniform(*hold, len(starts))
    sizes = rng.uniform(*size, len(starts)) * rng.choice((-1.0, 1.0), len(starts))
    signs = rng.choice((-1.0, 1.0), (len(starts), len(axes))) * axes
    if sum(axes) == 1:
        signs = np.abs(signs)

    def jumping(mine: Any) -> Signal:
        values = signs[mine] * sizes[mine, None]
        return lambda time: (
            ((starts[mine] <= time[:, None]) & (time[:, None] < stops[mine])) @ values
        )

    own = {f"{one.frame}.{sensor}": effectors == e for e, one in enumerate(plan.effectors)}
    if "." in sensor:
        own = {sensor: effectors >= 0}
    events = []
    drawn = (starts, stops, sizes, effectors)
    for start, stop, height, effector in zip(*(each.tolist() for each in drawn), strict=True):
        facts = {"size": height, "effector": effector}
        cause = f"jump of the {sensor} signal"
        events.append(Event("highaccelerations", cause, start, stop, facts))
    return Faults(sensors={name: jumping(mine) for name, mine in own.items()}, events=tuple(events))


def force_gain(
    rng: Rng, plan: Plan, *, factor: Range, start: Range = (0.0, 0.0), contacts: bool = True
) -> Faults:
    """Gains of the force control that are too high, so that it becomes a limit cycle."""
    high = float(rng.uniform(*factor))
    begin = float(rng.uniform(*start)) * plan.duration
    spans = [(contact.start, min(contact.lift, plan.duration)) for contact in begun(plan)]
    if not contacts:
        spans = [(begin, plan.duration)]
    events = tuple(
        Event("oscillations", "force control with too high a gain", *span, {"factor": high})
        for span in spans
        if span[1] > begin
    )
    return Faults(
        gain=lambda time: np.where(time < begin, 1.0, high),
        events=events,
        facts={"factor": high, "start": begin},
    )


def multisine(
    rng: Rng,
    plan: Plan,
    *,
    bands: Sequence[Range],
    amplitude: Range,
    fastest: float = np.inf,
    start: Range = (0.15, 0.4),
    stop: Range = (0.7, 0.95),
) -> Faults:
    """Oscillations of the height of an effector, or of all: one sine per hertz of a band.

    ``fastest`` limits their speed: the 2 mm of the paper at 900 Hz would be 11 m/s, which no drive
    follows. ``amplitude`` is that of one sine of equal power.
    """
    low, high = bands[int(rng.integers(len(bands)))]
    frequencies = np.arange(low, high + 1.0)
    size = min(float(_log_uniform(rng, amplitude, 1)[0]), fastest / (2 * np.pi * high))
    phases = rng.uniform(0, 2 * np.pi, len(frequencies))
    begin, end = (float(rng.uniform(*span)) * plan.duration for span in (start, stop))
    shares = np.ones(len(plan.effectors))
    chosen = int(rng.integers(len(shares) + 1))
    if chosen < len(shares):
        shares = (np.arange(len(shares)) == chosen).astype(float)
    facts = {"band": [low, high], "amplitude": size, "effectors": shares.tolist()}
    rates = 2 * np.pi * frequencies

    def overlay(time: Array) -> Array:
        """The sum of sines, which fades in and out over 0.1 s, and its rate."""
        out = np.zeros((len(time), len(shares), 2))
        inside = (begin < time) & (time < end)
        now = time[inside]
        envelope = np.minimum(1, np.minimum(now - begin, end - now) / 0.1)
        angles = np.outer(now, rates) + phases
        scale = size / np.sqrt(len(rates)) * envelope
        wave = np.stack((scale * np.sin(angles).sum(axis=1), scale * (np.cos(angles) @ rates)), 1)
        out[inside] = shares[:, None] * wave[:, None]
        return out

    event = Event("oscillations", "multi-sine on the reference", begin, end, facts)
    return Faults(overlay=overlay, events=(event,), facts=facts)


def obstacles(
    rng: Rng,
    plan: Plan,
    *,
    height: Range,
    half: Range,
    offset: Range = (0.0, 0.0),
    effectors: Sequence[int] = (),
    share: float = 1.0,
    most: int | None = None,
) -> Faults:
    """Boxes on the ground, unknown to the controller, where effectors touch down.

    They are offset by shares of half of the effector; of at most so many, none is the last.
    """
    places = begun(plan, effectors)
    if most is not None and len(places) > most:
        places = places[: max(most, len(places) - 1)]
        chosen = np.sort(rng.choice(len(places), most, replace=False))
        places = [places[index] for index in chosen.tolist()]
    heights = rng.uniform(*height, len(places))
    there = rng.uniform(size=len(places)) < share
    there[:1] = True
    boxes = []
    for contact, high, here in zip(places, heights.tolist(), there, strict=True):
        if not here:
            continue
        patch = plan.effectors[contact.effector].patch
        along, across = (part * extent for part, extent in zip(offset, patch, strict=True))
        cosine, sine = np.cos(contact.yaw), np.sin(contact.yaw)
        x, y, z = contact.place
        x, y = x + cosine * along - sine * across, y + sine * along + cosine * across
        until = contact.stop if contact.approach > 0 else np.inf
        size = (*half, high / 2)
        boxes.append(
            Box((float(x), float(y), z + high / 2), size, contact.yaw, contact.approach, until)
        )
    return Faults(boxes=tuple(boxes), facts={"tops": [box.top for box in boxes]})


def underfoot(
    rng: Rng,
    plan: Plan,
    *,
    feet: Sequence[int],
    rise: Range = (0.35, 0.65),
    half: float = 0.2,
    share: float = 1.0,
    most: int | None = None,
) -> Faults:
    """Boxes under feet, lower than the feet are lifted; none if no foot is lifted."""
    lift = float(np.ptp(plan.places[..., 2]))
    if not lift:
        return Faults()
    height, edge = (rise[0] * lift, rise[1] * lift), half * plan.units.length
    settings: dict[str, Any] = {"effectors": feet, "share": share, "most": most}
    return obstacles(rng, plan, height=height, half=(edge, edge), **settings)


def giving_way(rng: Rng, plan: Plan, *, depth: Range, half: Range, after: Range) -> Faults:
    """Ground that gives way under an effector: it is lower, but for boxes that vanish."""
    deep = float(rng.uniform(*depth))
    boxes, events = [], []
    for contact in begun(plan):
        end = contact.start + float(rng.uniform(*after))
        x, y, z = contact.place
        boxes.append(Box((x, y, z - deep / 2), (*half, deep / 2), until=end))
        lift = min(contact.lift, plan.duration)
        if end < lift:
            cause = "ground that gives way"
            events.append(Event("highaccelerations", cause, end, lift, {"depth": deep}))
    lower = tuple(
        replace(box, centre=(*box.centre[:2], box.centre[2] - deep)) for box in plan.ground
    )
    return Faults(ground=lower, boxes=tuple(boxes), events=tuple(events), facts={"depth": deep})


def overhang(rng: Rng, plan: Plan, *, share: Range) -> Faults:
    """An edge of a platform nearer than planned: the last contact on it is partial."""
    part = float(rng.uniform(*share))
    platform, *floor = plan.ground
    above = [contact for contact in plan.contacts if contact.place[2] == platform.top]
    if not floor or not above:
        return Faults(facts={"overhang": part})
    last = above[-1]
    edge = last.place[0] + (1 - 2 * part) * plan.effectors[last.effector].patch[0]
    nearer = replace(platform, centre=(edge - platform.half[0], *platform.centre[1:]))
    event = Event(
        "highaccelerations", "partial contact at an edge", last.start,
        min(last.lift, plan.duration), {"overhang": part, "effector": last.effector},
    )  # fmt: skip
    facts = {"overhang": part, "edge": edge}
    return Faults(ground=(nearer, *floor), events=(event,), facts=facts)


ADVANCE = 0.3  # shortest way over which a step down may come, in the robot's unit of length


def step_down(
    rng: Rng, plan: Plan, *, depth: Range, when: Range = (0.3, 0.5), ahead: bool = False
) -> Faults:
    """A step down at an edge across the path, beyond all contacts so far, before the next one."""
    if ahead:
        xs = [contact.place[0] for contact in plan.contacts]
        foremost = max(contact.place[0] for contact in plan.contacts if contact.start <= 0)
        if max(xs) < foremost + ADVANCE * plan.units.length:
            return Faults()
    deep = float(rng.uniform(*depth))
    start = float(rng.uniform(*when)) * plan.duration
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
            replace(box, centre=(x, y, z - deep)),
        ]
    falls: dict[int, Event] = {}
    for contact, way in zip(contacts, ways.tolist(), strict=True):
        stop = min(contact.lift, plan.duration)
        if way > edge and contact.effector not in falls and contact.start < stop:
            facts = {"depth": deep, "effector": contact.effector}
            falls[contact.effector] = Event(
                "highaccelerations", "ground that is not there", contact.start, stop, facts
            )
    facts = {"depth": deep, "edge": edge}
    return Faults(ground=tuple(ground), events=tuple(falls.values()), facts=facts)


MOVING = 0.05  # least speed of an effector that is to collide, in [m/s]
SLOW = 0.05  # highest speed of an effector that moves slowly, in [m/s]
ALONE = 0.6  # time without pushes at the begin and at the end of a run, in [s]


def _speed(plan: Plan) -> Array:
    """Planned speed of a tool at each tick, in [m/s]."""
    return np.asarray(np.linalg.norm(np.gradient(plan.places[:, 0], TICK, axis=0), axis=1))


def collisions(
    rng: Rng, plan: Plan, *, every: float, stiffness: Range, limit: Range, hold: Range
) -> Faults:
    """Obstacles in the air that a tool meets while it moves, one in so many [s]."""
    speed = _speed(plan)
    loads = []
    for span in np.array_split(np.arange(len(speed)), max(1, round(plan.duration / every))):
        middle = span[len(span) // 8 : -(len(span) // 4)]
        moving = middle[speed[middle] > max(MOVING, 0.5 * speed[middle].max())]
        share, hard, strong, long = rng.uniform(size=4).tolist()
        if not moving.size:
            continue
        obstacle = Collision(
            frame=plan.effectors[0].frame,
            start=float(moving[int(share * len(moving))] * TICK),
            hold=hold[0] + long * (hold[1] - hold[0]),
            stiffness=plan.units.force * float(_log(stiffness, hard)),
            limit=plan.units.force * float(_log(limit, strong)),
        )
        loads.append(obstacle)
    return Faults(loads=tuple(loads), facts={"starts": [load.start for load in loads]})


def joint_stops(
    rng: Rng, plan: Plan, *, overshoot: Range, stiffness: Range, least: float
) -> Faults:
    """An end stop nearer than the controller knows; none where joints move little, or are free."""
    joints: Array | None = getattr(plan, "joints", None)
    if joints is None:
        return Faults()
    away = joints - joints[0]
    furthest = np.stack((-away.min(axis=0), away.max(axis=0)))  # down, up
    chosen = np.argwhere(furthest > least)
    index, share, hardness = rng.uniform(size=3).tolist()
    if not len(chosen):
        return Faults()
    side, joint = chosen[int(index * len(chosen))].tolist()
    way = float(furthest[side, joint])
    over = min(overshoot[0] + share * (overshoot[1] - overshoot[0]), 0.7 * way)
    sign = 2 * side - 1
    stop = JointStop(
        joint=joint,
        angle=float(joints[0, joint]) + sign * (way - over),
        side=sign,
        stiffness=plan.units.torque * float(_log(stiffness, hardness)),
    )
    return Faults(loads=(stop,), facts={"joint": joint, "angle": stop.angle})


def pushes(
    rng: Rng, plan: Plan, *, every: float, force: Range, rise: Range, hold: Range, along: Range
) -> Faults:
    """Hands that push links where the tool is slow; at least one, where it is slowest."""
    speed = _speed(plan)
    edge = round(min(ALONE, plan.duration / 4) / TICK)
    count = max(1, round((plan.duration - 2 * ALONE) / every))
    drawn = []
    for span in np.array_split(np.arange(edge, len(speed) - edge), count):
        times = np.append(_log(rise, rng.uniform(size=2)), rng.uniform(*hold))
        times *= min(1.0, 0.9 * len(span) * TICK / times.sum())
        size = plan.units.force * float(_log(force, rng.uniform()))
        way, link, place = rng.normal(size=3), float(rng.uniform(*along)), rng.uniform()
        fastest = sliding_window_view(speed[span], round(times.sum() / TICK)).max(axis=1)
        slow = np.flatnonzero(fastest <= max(SLOW, fastest.min()))
        first = slow[int(place * len(slow))]
        start, (x, y, z) = float(span[first] * TICK), (size * way / np.linalg.norm(way)).tolist()
        (up, down, _), stop = times.tolist(), start + float(times.sum())
        push = Push(along=link, start=start, stop=stop, rise=up, fall=down, force=(x, y, z))
        drawn.append((fastest[first], push))
    slowest = min(one for one, _ in drawn)
    hands = tuple(push for fastest, push in drawn if fastest <= max(SLOW, slowest))
    events = tuple(
        Event("impact", PUSH, push.start, push.stop,
              {"force": float(np.linalg.norm(push.force)), "along": push.along})
        for push in hands
    )  # fmt: skip
    return Faults(loads=hands, events=events, facts={"starts": [push.start for push in hands]})


MARGIN = 0.8  # time without faults at the begin and at the end of a run, in [s]
LEAD = 0.25  # how long before the first sample a fault of a whole run begins to act, in [s]
FADE = 0.05  # time in which torques rise and fall, in [s]


def _one(rng: Rng, span: Range) -> float:
    return float(_log_uniform(rng, span, 1)[0])


def _some(rng: Rng, plan: Plan) -> Array:
    """One joint, or a few, or all: 1 for those, shape (joints,)."""
    joints = len(plan.torques)
    count = int(rng.choice([1, 1, 2, joints]))
    chosen = np.zeros(joints)
    chosen[rng.choice(joints, min(count, joints), replace=False)] = 1.0
    return chosen


def _while(rng: Rng, plan: Plan, lasts: Range | None) -> tuple[float, float]:
    """Begin and end of a fault of drives, in [s]; without a duration it lasts for the whole run."""
    if lasts is None:
        return 0.0, plan.duration
    return _from(rng, plan, float(rng.uniform(*lasts)))


def _from(rng: Rng, plan: Plan, length: float) -> tuple[float, float]:
    start = float(rng.uniform(MARGIN, max(MARGIN, plan.duration - MARGIN - length)))
    return start, min(start + length, plan.duration)


def _on_drives(event: Event, *, whole: bool = False, **acts: Any) -> Faults:
    """A fault of drives or commands, there before the first sample if it is of the whole run."""
    if whole:
        event = replace(event, facts={**event.facts, "throughout": True})
    fault = DriveFault(event=event, lead=LEAD if whole else 0.0, **acts)
    return Faults(drive=fault, events=(event,), facts=event.facts)


def latency(rng: Rng, plan: Plan, *, delay: Range, lasts: Range | None = None) -> Faults:
    """A delay, in [s], that the gains do not bear."""
    late = _one(rng, delay)
    event = Event("oscillations", "latency", *_while(rng, plan, lasts), {"delay": late})
    return _on_drives(event, whole=lasts is None, delay=late)


def high_gains(
    rng: Rng, plan: Plan, *, factor: Range, delay: Range, lasts: Range | None = None
) -> Faults:
    """Gains that are too high, for a delay that is a little longer, too."""
    joints = _some(rng, plan)
    high, late = _one(rng, factor), _one(rng, delay)
    facts = {"factor": high, "delay": late, "joints": joints.tolist()}
    event = Event("oscillations", "too high gains", *_while(rng, plan, lasts), facts)
    gains = np.where(joints > 0, high, 1.0)
    soft = rng.uniform() < 0.3
    damping = 1.0 if soft else gains
    return _on_drives(event, whole=lasts is None, stiffness=gains, damping=damping, delay=late)


def slow_filter(rng: Rng, plan: Plan, *, bandwidth: Range, factor: Range) -> Faults:
    """A filter of the velocities in the loop that is too slow for its damping."""
    slow, high = _one(rng, bandwidth), _one(rng, factor)
    facts = {"bandwidth": slow, "factor": high}
    event = Event("oscillations", "slow filter", 0.0, plan.duration, facts)
    return _on_drives(event, whole=True, bandwidth=slow, damping=high)


def worn(rng: Rng, plan: Plan, *, wear: Range, backlash: Range) -> Faults:
    """Worn gears: they shake joints at their teeth, and have more play."""
    joints = _some(rng, plan)
    shaken, play = _one(rng, wear), _one(rng, backlash)
    facts = {"wear": shaken, "backlash": play, "joints": joints.tolist()}
    event = Event("oscillations", "worn drives", 0.0, plan.duration, facts)
    return _on_drives(event, whole=True, wear=shaken * joints, backlash=play)


def octave(white: Array, frequency: float, step: float) -> Array:
    """White noise without what lies outside an octave around a frequency, in [Hz]."""
    lines, place = np.fft.rfft(white), np.fft.rfftfreq(len(white), step)
    lines[(place < frequency / np.sqrt(2)) | (place > frequency * np.sqrt(2))] = 0.0
    return np.fft.irfft(lines, len(white))


def shaking(
    rng: Rng,
    plan: Plan,
    *,
    frequency: Range,
    share: Range,
    noise: bool = False,
    lasts: Range | None = None,
) -> Faults:
    """A tone of the torque, or an octave of noise, by the limits of the drives."""
    joints = _some(rng, plan)
    middle, part = _one(rng, frequency), _one(rng, share)
    start, stop = _while(rng, plan, lasts)
    seed = int(rng.integers(2**31)) if noise else 0
    size = part * np.array(plan.torques) * joints

    def torque(since: Array) -> Array:
        left = np.inf if lasts is None else stop - start - since
        fade = np.minimum(1, np.minimum(since, left) / FADE)
        if not noise:
            return np.outer(fade * np.sin(2 * np.pi * middle * since), size)
        white = np.random.default_rng(seed).standard_normal(len(since))
        wave = octave(white, middle, since[1] - since[0])
        return np.outer(wave * (fade / np.sqrt(2 * np.mean(wave**2))), size)  # as loud as a tone

    facts = {"frequency": middle, "share": part, "joints": joints.tolist()}
    cause = "noise of the torque" if noise else "oscillation of the torque"
    event = Event("oscillations", cause, start, stop, facts)
    return _on_drives(event, whole=lasts is None, torque=torque)


def held_command(rng: Rng, plan: Plan, *, lasts: Range) -> Faults:
    """Targets that stand still for a while."""
    start, stop = _from(rng, plan, _one(rng, lasts))
    kept: list[Array] = []

    def command(time: Array, targets: Array, rates: Array) -> tuple[Array, Array]:
        if not start <= time[0] < stop:
            return targets, rates
        if not kept:
            kept.append(targets[0].copy())
        return np.tile(kept[0], (len(targets), 1)), np.zeros_like(rates)

    event = Event("highaccelerations", "held command", start, stop + 0.02)
    return _on_drives(event, command=command)


def lost_commands(rng: Rng, plan: Plan, *, share: Range, lasts: Range) -> Faults:
    """Targets of which a share is lost at random ticks; the drives keep the last ones."""
    part = float(rng.uniform(*share))
    start, stop = _while(rng, plan, lasts)
    seed, kept = int(rng.integers(2**31)), list[Array]()

    def command(time: Array, targets: Array, rates: Array) -> tuple[Array, Array]:
        packet = round(time[0] / TICK) // 10  # ten ticks are lost together
        inside = start <= time[0] < stop
        if not (inside and kept and np.random.default_rng((seed, packet)).uniform() < part):
            kept[:] = [targets[-1].copy()]
            return targets, rates
        return np.tile(kept[0], (len(targets), 1)), np.zeros_like(rates)

    event = Event("highaccelerations", "lost commands", start, stop, {"share": part})
    return _on_drives(event, command=command)


def target_jump(rng: Rng, plan: Plan, *, size: Range, lasts: Range, back: float = 0.6) -> Faults:
    """Targets that jump by an angle, in [rad], and return smoothly, in [s]."""
    joints, angle = _some(rng, plan), _one(rng, size)
    start, stop = _while(rng, plan, lasts)
    way = angle * rng.choice((-1.0, 1.0), len(joints)) * joints

    def command(time: Array, targets: Array, rates: Array) -> tuple[Array, Array]:
        if time[-1] < start or time[0] > stop + back:
            return targets, rates
        left = 1 - minimum_jerk(np.clip((time - stop) / back, 0, 1))
        return targets + np.where(time < start, 0.0, left)[:, None] * way, rates

    facts = {"size": angle, "joints": joints.tolist()}
    event = Event("highaccelerations", "jump of the target", start, start + 0.02, facts)
    return _on_drives(event, command=command)


def knock(rng: Rng, plan: Plan, *, share: Range, lasts: Range) -> Faults:
    """A blow on the joints from outside, a half sine of torque, by the limits of the drives."""
    joints = _some(rng, plan)
    length, part = _one(rng, lasts), _one(rng, share)
    start, stop = _from(rng, plan, length)
    size = part * np.array(plan.torques) * joints * rng.choice((-1.0, 1.0), len(joints))

    def torque(since: Array) -> Array:
        return np.outer(np.sin(np.pi * np.clip(since / length, 0, 1)), size)

    event = Event("impact", "blow", start, stop, {"share": part, "joints": joints.tolist()})
    return _on_drives(event, torque=torque, outside=True)


def dropout(rng: Rng, plan: Plan, *, lasts: Range) -> Faults:
    """Drives without torque for a moment."""
    start, stop = _from(rng, plan, _one(rng, lasts))
    event = Event("highaccelerations", "drives without torque", start, stop + 0.02)
    return _on_drives(event, power=0.0)


def slip(rng: Rng, plan: Plan, *, size: Range) -> Faults:
    """An encoder that slips by an angle, in [rad], and stays off."""
    joints = np.zeros(len(plan.torques))
    joints[rng.integers(len(joints))] = 1.0
    offset = _one(rng, size) * float(rng.choice((-1.0, 1.0)))
    facts = {"offset": offset, "joints": joints.tolist()}
    event = Event("highaccelerations", "encoder slip", *_from(rng, plan, 0.02), facts)
    return _on_drives(event, offset=offset * joints)
