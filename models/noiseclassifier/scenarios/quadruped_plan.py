"""Plans of quadrupeds: gaits, steps, paths and poses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.errors import ScenarioError
from noiseclassifier.scenarios.motions import (
    TICK,
    Ball,
    Box,
    Contact,
    Trot,
    Units,
    minimum_jerk,
    times,
)
from noiseclassifier.scenarios.robots import Quadruped
from noiseclassifier.scenarios.world import GRAVITY, WholeBody, centre_of_mass, reduced_model
from noisemodel.types import Array, Mask

LONGEST = 0.15  # longest time in which a group takes its share of the weight, in [s]


@dataclass(frozen=True)
class Gait:
    """A gait."""

    groups: tuple[int, int, int, int]
    duty: float
    period: float = 1.0
    level: bool = False

    @property
    def count(self) -> int:
        """Number of groups."""
        return max(self.groups) + 1


TROT = Gait((0, 1, 1, 0), 0.62, level=True)  # diagonal pairs
GAITS: Mapping[str, Gait] = MappingProxyType(
    {
        "trot": TROT,
        "walk": Gait((1, 3, 0, 2), 0.8, period=1.8),
        "pace": Gait((0, 1, 0, 1), 0.62, period=0.9),
        "bound": Gait((0, 0, 1, 1), 0.62, period=0.9),
    }
)
"""By name: "walk" is the lateral sequence, one foot at a time: rear left, front left, rear right,
front right; a "pace" is by sides; a "bound" is front and rear in turn."""


@dataclass(frozen=True)
class Beat:
    """One swing of one group of feet."""

    group: int
    begin: float  # when the weight starts to shift to the other feet, in [s]
    lift: float  # when the feet leave the ground, in [s]
    touch: float  # when they touch it again, in [s]


def beats(
    rng: np.random.Generator,
    *,
    begin: float,
    end: float,
    period: float,
    jitter: float,
    gait: Gait = TROT,
) -> tuple[Beat, ...]:
    """Beats of a gait."""
    out: list[Beat] = []
    while True:
        cycle = period * (1 + float(rng.uniform(-jitter, jitter)))
        if begin + cycle > end:
            return tuple(out)
        for group in range(gait.count):
            lift = begin + (gait.duty - (1 - 1 / gait.count)) * cycle
            touch = lift + (1 - gait.duty) * cycle
            out.append(Beat(group, begin, lift, touch))
            begin = touch


def loads(time: Array, timing: Sequence[Beat], gait: Gait = TROT) -> Array:
    """Planned share of the weight on each foot, shape (times, feet); rows add up to 1."""
    knots = [[-1.0] for _ in range(gait.count)]
    bearing = [[1.0] for _ in range(gait.count)]
    ends = [beat.touch + 0.1 for beat in timing]
    ends[:-1] = [min(following.lift, beat.touch + LONGEST) for beat, following in pairwise(timing)]
    for beat, taken in zip(timing, ends, strict=True):
        knots[beat.group].extend((beat.begin, beat.lift, beat.touch, taken))
        bearing[beat.group].extend((1.0, 0.0, 0.0, 1.0))
    groups = np.stack([np.interp(time, *both) for both in zip(knots, bearing, strict=True)], axis=1)
    feet = groups[:, gait.groups]
    return np.asarray(feet / feet.sum(axis=1, keepdims=True))


def swings(time: Array, timing: Sequence[Beat], gait: Gait = TROT) -> Array:
    """Completed share of the swing of each foot, shape (times, feet); 1 on the ground."""
    groups = np.ones((len(time), gait.count))
    for beat in timing:
        now = (beat.lift <= time) & (time < beat.touch)
        groups[now, beat.group] = (time[now] - beat.lift) / (beat.touch - beat.lift)
    return groups[:, gait.groups]


TOP = 0.4  # share of a swing after which the foot is highest
ACROSS = 0.8  # share of a swing after which the foot is over its next foothold
NEAR = 0.8  # share of a swing after which a contact is planned
LANDING = 0.1
"""Speed at which a foot is to touch the ground, in heights of its swing per time of its descent."""


class Foothold(NamedTuple):
    """Place of a foot, in [m], and the direction of the body, in [rad]."""

    x: float
    y: float
    yaw: float


def progress_of(share: Array) -> Array:
    """Completed share of the path of a foot after a share of its swing."""
    return minimum_jerk(np.minimum(1, share / ACROSS))


def height_of(share: Array) -> Array:
    """Height of a foot after a share of its swing, 1 at the top."""
    up = minimum_jerk(np.minimum(1, share / TOP))
    left = np.clip((1 - share) / (1 - TOP), 0, 1)
    # From rest to the ground at the landing speed, without acceleration at either end.
    down = minimum_jerk(left) + LANDING * left * (1 - left) ** 3 * (1 + 3 * left)
    return np.where(share < TOP, up, down)


def footholds(
    beats: Sequence[Beat], hip: Array, *, way: Array, yaw: Array, stop: float
) -> list[Foothold]:
    """Footholds: under the hip in the middle of each stance.

    This is the neutral point of Raibert, Legged Robots That Balance, 1986.
    """
    ends = [*(beat.lift for beat in beats), np.inf][1:]
    middles = [(beat.touch + end) / 2 for beat, end in zip(beats, ends, strict=True)]
    ticks = [0, *(round(min(stop, middle) / TICK) for middle in middles)]
    out = []
    for (x, y), turn in zip(way[ticks].tolist(), yaw[ticks].tolist(), strict=True):
        cosine, sine = np.cos(turn), np.sin(turn)
        hip_x = float(x + cosine * hip[0] - sine * hip[1])
        out.append(Foothold(hip_x, float(y + sine * hip[0] + cosine * hip[1]), turn))
    return out


def foot_path(
    time: Array, beats: Sequence[Beat], places: Sequence[Foothold], progress: Array
) -> Array:
    """Path of a foot from foothold to foothold."""
    stands = np.array(places)[:, :2]
    begun = np.searchsorted([beat.lift for beat in beats], time, side="right")
    before = stands[np.maximum(begun - 1, 0)]
    return np.asarray(before + progress[:, None] * (stands[begun] - before))


def contacts_of(foot: int, beats: Sequence[Beat], places: Sequence[Foothold]) -> list[Contact]:
    """Planned contacts of a foot."""

    def during(share: float) -> list[float]:
        return [beat.lift + share * (beat.touch - beat.lift) for beat in beats]

    return [
        Contact(start, lift, stop, (place.x, place.y, 0.0), foot, place.yaw, approach)
        for start, lift, stop, approach, place in zip(
            [-1.0, *during(NEAR)],
            [*during(0.0), np.inf],
            [*during(TOP), np.inf],
            [0.0, *during(TOP)],
            places,
            strict=True,
        )
    ]


CHANGE = 0.6  # time in which the velocity goes from one command to the next, in [s]
HOLD = (1.5, 3.0)  # time from one command to the next, in [s]


def steer(
    time: Array,
    way: str,
    robot: Quadruped,
    rng: np.random.Generator,
    *,
    bouts: Sequence[tuple[float, float]],
) -> tuple[Array, Array]:
    """Path and direction of the body by random commands, from rest to rest."""
    velocity = np.zeros((len(time), 3))  # ahead, to the left, turning
    for start, stop in bouts:
        now, before = start, np.zeros(3)
        while now < stop - 2 * CHANGE:
            command = _command(way, robot, rng)
            velocity += _onset(time, now) * (command - before)
            now, before = now + float(rng.uniform(*HOLD)), command
        velocity -= _onset(time, stop - CHANGE) * before
    ahead, aside, turning = velocity.T
    yaw = np.cumsum(turning) * TICK
    cosine, sine = np.cos(yaw), np.sin(yaw)
    over = np.stack((cosine * ahead - sine * aside, sine * ahead + cosine * aside), axis=1)
    return np.cumsum(over, axis=0) * TICK, yaw


def _onset(time: Array, start: float) -> Array:
    """Smooth step from 0 to 1, shape (times, 1)."""
    return minimum_jerk(np.clip((time - start) / CHANGE, 0, 1))[:, None]


def _command(way: str, robot: Quadruped, rng: np.random.Generator) -> Array:
    """Velocity ahead, to the left, and of turning, shape (3,)."""
    speed = robot.speed * float(rng.uniform(0.4, 1.0))
    turning = robot.turning * float(rng.uniform(0.3, 1.0)) * float(rng.choice((-1.0, 1.0)))
    if way == "spot":
        return np.array([0.0, 0.0, turning * float(rng.choice((0.0, 1.0)))])
    if way == "curve":
        return np.array([0.8 * speed, 0.0, turning])
    if way == "directions":
        angle = float(rng.uniform(np.pi / 3, 5 * np.pi / 3))
        return 0.7 * speed * np.array([np.cos(angle), np.sin(angle), 0.0])
    return np.array([speed, 0.0, 0.0])


TILT = (0.15, 0.12)  # largest roll and pitch, in [rad]
SHIFT = (0.08, 0.06, 0.08)
"""Largest shift ahead, to the left and up, as a share of the height of the centre of mass."""
FREQUENCY = (0.2, 1.5)  # frequencies of the sines, in [Hz]
SINES = 3  # sines per axis
POSE_FADE = 0.8  # time of fading in and out, in [s]


class Poses(NamedTuple):
    """Pose of the body at every tick."""

    tilt: Array
    """Roll and pitch, shape (ticks, 2), in [rad]."""
    shift: Array
    """Ahead, to the left, up, shape (ticks, 3), in [m]."""


def poses(time: Array, rng: np.random.Generator, share: float, *, size: float) -> Poses:
    """Random poses, from and to the neutral one."""
    if not share:
        return Poses(np.zeros((len(time), 2)), np.zeros((len(time), 3)))
    largest = share * np.array((*TILT, *(size * shift for shift in SHIFT)))
    lowest, highest = FREQUENCY
    spread = (highest / lowest) ** rng.uniform(size=(SINES, len(largest)))
    rates = 2 * np.pi * lowest * spread
    phases = rng.uniform(0, 2 * np.pi, rates.shape)
    weights = rng.dirichlet(np.ones(SINES), len(largest)).T / (rates / rates.min(axis=0))
    inside = np.clip(np.minimum(time - time[0], time[-1] - time) / POSE_FADE, 0, 1)
    angles = time[:, None, None] * rates + phases
    waves = minimum_jerk(inside)[:, None] * (weights * np.sin(angles)).sum(axis=1) * largest
    return Poses(waves[:, :2], waves[:, 2:])


@dataclass(frozen=True, eq=False)
class Standing:
    """A robot that stands on the ground, its centre of mass over the middle of its feet.

    Attributes:
        feet: Centres of its feet, the middle between them in the origin, shape (feet, 3), in [m].
    """

    configuration: Array  # as Pinocchio has it, shape (nq,)
    feet: Array
    height: float  # of its centre of mass, in [m]
    weight: float  # in [N]


def stand(robot: Quadruped) -> Standing:
    """Standing posture with the joints near their rest positions."""
    return _stand(robot.name, robot.rest, robot.feet, reduced_model(robot))


@lru_cache(maxsize=8)
def _stand(name: str, rest: tuple[float, ...], feet: tuple[Ball, ...], model: Any) -> Standing:
    configuration = pin.neutral(model)
    configuration[7:] = rest
    data = model.createData()
    pin.framesForwardKinematics(model, data, configuration)
    places = np.array([data.oMf[model.getFrameId(foot.frame)].translation for foot in feet])
    middle = places.mean(axis=0) - (0.0, 0.0, feet[0].radius)
    places[:, :2] -= middle[:2]
    places[:, 2] = feet[0].radius
    configuration[:3] -= middle
    height = float(pin.centerOfMass(model, data, configuration)[2])
    body = WholeBody(model, feet, configuration)
    standing = body.follow(places, (), np.array([0.0, 0.0, height]), np.eye(3), steps=10)
    weight = float(pin.computeTotalMass(model)) * GRAVITY
    return Standing(standing, places, height, weight)


REST = 0.5  # time of standing before and after the trot, in [s]
STAND = "stand"  # name of the gait without steps
CYCLES = 2.5  # least time from one pause to the next, in periods; a short run has fewer pauses


@dataclass(frozen=True, eq=False)
class Plan:
    """Plan of the motion of a quadruped, at every tick."""

    centre: Array  # centre of mass, shape (ticks, 3), in [m]
    yaw: Array  # direction of the body, shape (ticks,), in [rad]
    tilt: Array  # roll and pitch of the body, shape (ticks, 2), in [rad]
    push: Array  # planned horizontal force of a foot per vertical force on it, shape (ticks, 2)
    feet: Array  # centres of the feet, shape (ticks, feet, 3), in [m]
    swing: Mask  # whether each foot is in the air, shape (ticks, feet)
    progress: Array  # completed share of the path of each foot; 1 in stance, shape (ticks, feet)
    load: Array  # planned share of the weight on each foot, shape (ticks, feet)
    contacts: tuple[Contact, ...]
    effectors: tuple[Ball, ...]
    ground: tuple[Box, ...]
    size: float  # height of the centre of mass, in [m]
    weight: float  # in [N]

    @property
    def time(self) -> Array:
        """Time of each tick, shape (ticks,), in [s]."""
        return times(len(self.yaw), TICK)

    @property
    def units(self) -> Units:
        """The height of the centre of mass, the weight, and their product."""
        return Units(length=self.size, force=self.weight, torque=self.size * self.weight)

    @property
    def duration(self) -> float:
        """Duration, in [s]."""
        return len(self.yaw) * TICK

    def after(self, ticks: int) -> "Plan":
        """The plan after some ticks of rest."""

        def rested(signal: Any) -> Any:
            return np.concatenate((np.repeat(signal[:1], ticks, axis=0), signal))

        return replace(
            self,
            centre=rested(self.centre),
            yaw=rested(self.yaw),
            tilt=rested(self.tilt),
            push=rested(self.push),
            feet=rested(self.feet),
            swing=rested(self.swing),
            progress=rested(self.progress),
            load=rested(self.load),
            contacts=tuple(contact.later(ticks * TICK) for contact in self.contacts),
        )


def trot(
    robot: Quadruped,
    standing: Standing,
    motion: Trot,
    rng: np.random.Generator,
    duration: float,
) -> Plan:
    """Plan of a gait from rest to rest."""
    shapes, steering, bending = rng.spawn(3)
    gait = _gait(motion.gait)
    height = robot.height * float(shapes.uniform(*motion.height))
    period = gait.period * robot.period * float(shapes.uniform(*motion.period))
    bouts = [
        beats(shapes, begin=begin, end=end, period=period, jitter=motion.jitter, gait=gait)
        for begin, end in _bouts(shapes, motion, duration, period)
    ]
    bouts = [bout for bout in bouts if bout]
    timing = tuple(beat for bout in bouts for beat in bout)
    time = times(round(duration / TICK), TICK)
    stop = timing[-1].touch if timing else duration
    speed = motion.speed / gait.period
    driven = replace(robot, speed=speed * robot.speed, turning=speed * robot.turning)
    spans = [(bout[0].begin, bout[-1].touch) for bout in bouts]
    way, yaw = steer(time, motion.way, driven, steering, bouts=spans)
    share = swings(time, timing, gait)
    progress = progress_of(share)
    feet = np.zeros((len(time), len(robot.feet), 3))
    feet[..., 2] = standing.feet[:, 2] + height * height_of(share)
    contacts = []
    for foot, group in enumerate(gait.groups):
        own = [beat for beat in timing if beat.group == group]
        places = footholds(own, standing.feet[foot, :2], way=way, yaw=yaw, stop=stop)
        feet[:, foot, :2] = foot_path(time, own, places, progress[:, foot])
        contacts += contacts_of(foot, own, places)
    load = loads(time, timing, gait)
    push = np.zeros((len(time), 2))
    if not gait.level and timing:
        zmp = np.einsum("tf,tfa->ta", load, feet[..., :2])
        way = centre_of_mass(zmp, float(np.sqrt(GRAVITY / standing.height)))
        push = (way - zmp) / standing.height
    bend = float(bending.uniform(*motion.posing))
    pose = poses(time, bending, bend, size=standing.height)
    if bend:
        load = load * (1 + _acceleration(pose.shift[:, 2:]) / GRAVITY)
        shift = turned(yaw, pose.shift[:, :2])
        way, push = way + shift, push + _acceleration(shift) / GRAVITY
    return Plan(
        np.column_stack((way, standing.height + pose.shift[:, 2])),
        yaw,
        pose.tilt,
        push,
        feet,
        share < 1,
        progress,
        load,
        contacts=tuple(sorted(contacts, key=lambda contact: contact.start)),
        effectors=robot.feet,
        ground=(Box(centre=(0.0, 0.0, -0.5), half=(20.0, 20.0, 0.5)),),
        size=standing.height,
        weight=standing.weight,
    )


def _gait(name: str) -> Gait:
    if name == STAND:
        return TROT
    if name not in GAITS:
        raise ScenarioError(f"no gait {name!r}; there are {', '.join((*GAITS, STAND))}")
    return GAITS[name]


def _bouts(
    rng: np.random.Generator, motion: Trot, duration: float, period: float
) -> list[tuple[float, float]]:
    """Start and end of each time of stepping, in [s]; none if the robot stands."""
    if motion.gait == STAND:
        return []
    pauses = [float(rng.uniform(*motion.pause)) for _ in range(motion.pauses)]
    while True:
        each = (duration - 2 * REST - sum(pauses)) / (1 + len(pauses))
        if not pauses:
            return [(REST, duration - REST)]
        if each > CYCLES * period:
            break
        pauses.pop()
    begins = REST + each * np.arange(1 + len(pauses)) + np.cumsum([0.0, *pauses])
    return [(begin, begin + each) for begin in begins.tolist()]


def _acceleration(path: Array) -> Array:
    """Second derivative along axis 0."""
    return np.asarray(np.gradient(np.gradient(path, TICK, axis=0), TICK, axis=0))


def turned(yaw: Array, plane: Array) -> Array:
    """Vectors of the body's axes in the world's, both of shape (ticks, 2)."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    x, y = plane.T
    return np.stack((cosine * x - sine * y, sine * x + cosine * y), axis=1)
