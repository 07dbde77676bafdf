"""A quadruped: gaits, steps, paths and poses; estimate, foot placement, controller and scene."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import asin, atan2, cos, sin
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.faults import Faults, Imperfections
from noiseclassifier.scenarios.loop import Reference, Scene
from noiseclassifier.scenarios.motions import (
    TICK,
    Box,
    Contact,
    Plan,
    Rng,
    Trot,
    Units,
    minimum_jerk,
    times,
)
from noiseclassifier.scenarios.robots import Quadruped
from noiseclassifier.scenarios.world import (
    GRAVITY,
    WholeBody,
    box_changes,
    centre_of_mass,
    real_world,
    reduced_model,
    sensors_of,
)
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
STAND = "stand"  # name of the gait without steps
# By name: "walk" is the lateral sequence, one foot at a time: rear left, front left, rear right,
# front right; a "pace" is by sides.
GAITS = {
    "trot": TROT,
    "walk": Gait((1, 3, 0, 2), 0.8, period=1.8),
    "pace": Gait((0, 1, 0, 1), 0.62, period=0.9),
    STAND: TROT,  # without a step
}


@dataclass(frozen=True)
class Beat:
    """One swing of one group of feet."""

    group: int
    begin: float  # when the weight starts to shift to the other feet, in [s]
    lift: float  # when the feet leave the ground, in [s]
    touch: float  # when they touch it again, in [s]


def beats(
    rng: Rng,
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


# X and y of a foot, in [m], and the direction of the body, in [rad].
Foothold: TypeAlias = tuple[float, float, float]
TOP = 0.4  # share of a swing after which the foot is highest
ACROSS = 0.8  # share of a swing after which the foot is over its next foothold
NEAR = 0.8  # share of a swing after which a contact is planned


def progress_of(share: Array) -> Array:
    """Completed share of the path of a foot after a share of its swing."""
    return minimum_jerk(np.minimum(1, share / ACROSS))


def height_of(share: Array, landing: float) -> Array:
    """Height of a foot after a share of its swing, 1 at the top; it lands at a speed.

    The speed is in heights of the swing per time of the descent.
    """
    up = minimum_jerk(np.minimum(1, share / TOP))
    left = np.clip((1 - share) / (1 - TOP), 0, 1)
    # From rest to the ground at the landing speed, without acceleration at either end.
    down = minimum_jerk(left) + landing * left * (1 - left) ** 3 * (1 + 3 * left)
    return np.where(share < TOP, up, down)


def footholds(
    beats: Sequence[Beat], hip: Array, *, way: Array, yaw: Array, stop: float
) -> list[Foothold]:
    """Under the hip in the middle of each stance (Raibert 1986, neutral point)."""
    ends = [*(beat.lift for beat in beats), np.inf][1:]
    middles = [(beat.touch + end) / 2 for beat, end in zip(beats, ends, strict=True)]
    ticks = [0, *(round(min(stop, middle) / TICK) for middle in middles)]
    out = []
    for (x, y), turn in zip(way[ticks].tolist(), yaw[ticks].tolist(), strict=True):
        cosine, sine = np.cos(turn), np.sin(turn)
        hip_x = float(x + cosine * hip[0] - sine * hip[1])
        out.append((hip_x, float(y + sine * hip[0] + cosine * hip[1]), turn))
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
        Contact(start, lift, stop, (x, y, 0.0), foot, yaw, approach)
        for start, lift, stop, approach, (x, y, yaw) in zip(
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
    rng: Rng,
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


def _command(way: str, robot: Quadruped, rng: Rng) -> Array:
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
# Largest shift ahead, to the left and up, as a share of the height of the centre of mass.
SHIFT = (0.08, 0.06, 0.08)
FREQUENCY = (0.2, 1.5)  # frequencies of the sines, in [Hz]
SINES = 3  # sines per axis
POSE_FADE = 0.8  # time of fading in and out, in [s]


def poses(time: Array, rng: Rng, share: float, *, size: float) -> tuple[Array, Array]:
    """Roll and pitch, and the shift of the body, by random sines from and to the neutral pose."""
    if not share:
        return np.zeros((len(time), 2)), np.zeros((len(time), 3))
    largest = share * np.array((*TILT, *(size * shift for shift in SHIFT)))
    lowest, highest = FREQUENCY
    spread = (highest / lowest) ** rng.uniform(size=(SINES, len(largest)))
    rates = 2 * np.pi * lowest * spread
    phases = rng.uniform(0, 2 * np.pi, rates.shape)
    weights = rng.dirichlet(np.ones(SINES), len(largest)).T / (rates / rates.min(axis=0))
    inside = np.clip(np.minimum(time - time[0], time[-1] - time) / POSE_FADE, 0, 1)
    angles = time[:, None, None] * rates + phases
    waves = minimum_jerk(inside)[:, None] * (weights * np.sin(angles)).sum(axis=1) * largest
    return waves[:, :2], waves[:, 2:]


@dataclass(frozen=True, eq=False)
class Standing:
    """A robot that stands on the ground, its centre of mass over the middle of its feet."""

    configuration: Array  # as Pinocchio has it, shape (nq,)
    feet: Array  # their centres, the middle between them in the origin, shape (feet, 3), in [m]
    height: float  # of its centre of mass, in [m]
    weight: float  # in [N]


def stand(robot: Quadruped) -> Standing:
    """Standing posture with the joints near their rest positions."""
    model, feet = reduced_model(robot), robot.effectors
    configuration = pin.neutral(model)
    configuration[7:] = robot.rest
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
CYCLES = 2.5  # least time from one pause to the next, in periods; a short run has fewer pauses


@dataclass(frozen=True, eq=False, kw_only=True)
class GaitPlan(Plan):
    """Plan of the motion of a quadruped; its places are the centres of the feet."""

    centre: Array  # centre of mass, shape (ticks, 3), in [m]
    yaw: Array  # direction of the body, shape (ticks,), in [rad]
    tilt: Array  # roll and pitch of the body, shape (ticks, 2), in [rad]
    push: Array  # planned horizontal force of a foot per vertical force on it, shape (ticks, 2)
    swing: Mask  # whether each foot is in the air, shape (ticks, feet)
    progress: Array  # completed share of the path of each foot; 1 in stance, shape (ticks, feet)
    load: Array  # planned share of the weight on each foot, shape (ticks, feet)
    blind: bool  # whether the control knows no contact forces


def plan(robot: Quadruped, motion: Trot, rng: Rng, duration: float) -> GaitPlan:
    """Plan of a gait from rest to rest."""
    standing = stand(robot)
    shapes, steering, bending = rng.spawn(3)
    gait = GAITS[motion.gait]
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
    feet = np.zeros((len(time), len(robot.effectors), 3))
    feet[..., 2] = standing.feet[:, 2] + height * height_of(share, motion.landing)
    contacts = []
    for foot, group in enumerate(gait.groups):
        own = [beat for beat in timing if beat.group == group]
        places = footholds(own, standing.feet[foot, :2], way=way, yaw=yaw, stop=stop)
        feet[:, foot, :2] = foot_path(time, own, places, progress[:, foot])
        contacts += contacts_of(foot, own, places)
    load, push = loads(time, timing, gait), np.zeros((len(time), 2))
    size, weight = standing.height, standing.weight
    if not gait.level and timing:
        zmp = np.einsum("tf,tfa->ta", load, feet[..., :2])
        way = centre_of_mass(zmp, float(np.sqrt(GRAVITY / size)))
        push = (way - zmp) / size
    bend = float(bending.uniform(*motion.posing))
    tilt, shift = poses(time, bending, bend, size=size)
    if bend:
        load = load * (1 + _acceleration(shift[:, 2:]) / GRAVITY)
        aside = turned(yaw, shift[:, :2])
        way, push = way + aside, push + _acceleration(aside) / GRAVITY
    return GaitPlan(
        centre=np.column_stack((way, size + shift[:, 2])),
        yaw=yaw,
        tilt=tilt,
        push=push,
        places=feet,
        swing=share < 1,
        progress=progress,
        load=load,
        blind=motion.blind,
        contacts=tuple(sorted(contacts, key=lambda contact: contact.start)),
        effectors=robot.effectors,
        torques=robot.drives.torque,
        ground=(Box(centre=(0.0, 0.0, -0.5), half=(20.0, 20.0, 0.5)),),
        units=Units(length=size, force=weight, torque=size * weight),
    )


def _bouts(rng: Rng, motion: Trot, duration: float, period: float) -> list[tuple[float, float]]:
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


POSITION_GAIN = 1.0  # rate of the correction per distance from the planned path, in [1/s]
VELOCITY_FILTER = 0.05  # time constant of the low-pass on the measured velocity, in [s]
# Share of its height below which, and tilt above which, in [rad], the robot has fallen.
LOWEST, STEEPEST = 0.5, 0.7


class StateEstimate:
    """State estimate, updated once per tick: all low-passed.

    Roll, pitch and slip, the velocity of the centre of mass, are less the planned ones;
    corrections of path and direction lead towards the plan.
    """

    def __init__(self, robot: Quadruped, sensors: dict[str, slice]) -> None:
        self._where = sensors
        filters = (robot.attitude_filter, robot.force_filter, VELOCITY_FILTER)
        self._tilt_share, self._force_share, self._slip_share = (
            TICK / (time_constant + TICK) for time_constant in filters
        )
        self.roll = self.pitch = self.yaw_correction = 0.0
        self.slip, self.position_correction = np.zeros(2), np.zeros(2)
        self.force = np.zeros(len(robot.effectors))

    def update(
        self, sensors: Array, *, place: Array, velocity: Array, yaw: float, tilt: Array
    ) -> None:
        """Update the estimate with the sensors of one tick."""
        rolled, pitched = tilt.tolist()
        w, x, y, z = sensors[self._where["base.turn"]].tolist()
        roll = atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        pitch = asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
        off = yaw - atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        self.roll += self._tilt_share * (roll - rolled - self.roll)
        self.pitch += self._tilt_share * (pitch - pitched - self.pitch)
        self.yaw_correction += TICK * POSITION_GAIN * atan2(sin(off), cos(off))
        self.position_correction += (
            TICK * POSITION_GAIN * (place - sensors[self._where["centre.place"]][:2])
        )
        slip = sensors[self._where["centre.velocity"]][:2] - velocity
        self.slip += self._slip_share * (slip - self.slip)
        self.force += self._force_share * (sensors[: len(self.force)] - self.force)


BALANCE = 0.7  # gain of the foot placement on the offset of the capture point
# Largest distance of feet from their planned place, as a share of the robot's height.
FURTHEST = 0.3
FIXED = 0.8  # share of its path after which the place of a foot is fixed
DESCENDING = 0.5  # share of its path after which a foot may touch down early
CONTACT = 0.15  # force above which a foot is in contact, as a share of the weight
LEVELLING = 50.0  # rate at which a foot in the air compensates the tilt of the body, in [1/s]
LEAK = 4.0  # rate at which the compliance of a foot decays, in [1/s]
SMOOTHING = 0.008  # time constant of the low-pass on the vertical speed of feet, in [s]
HIGHEST = 0.16  # largest vertical correction of feet, as a share of the robot's height


class Feet:
    """Places of the feet, corrected by feedback."""

    def __init__(self, robot: Quadruped, standing: Standing, plan: GaitPlan, gain: Array) -> None:
        feet = len(robot.effectors)
        self._plan, self._lever = plan, standing.feet
        self._lean = 1 + robot.attitude_gain  # from the commanded tilt to the measured one
        self._gain = robot.force_gain * gain * (not plan.blind)
        self._load = plan.units.force * plan.load
        # A body at velocity v stops over a foot that stands v sqrt(h/g) ahead: the capture point.
        self._balance = BALANCE * np.sqrt(plan.units.length / GRAVITY)
        self._left, self._right = np.zeros((feet, 2)), np.zeros((feet, 2))
        self._rise, self._speed = np.zeros(feet), np.zeros(feet)
        self._early = np.zeros(feet, dtype=bool)

    def places(self, number: int, estimate: StateEstimate) -> Array:
        """Places of the feet."""
        places: Array = self._plan.places[number].copy()
        places[:, :2] += self._placement(number, estimate)
        places[:, 2] += self._compliance(number, estimate)
        return places

    def _placement(self, number: int, estimate: StateEstimate) -> Array:
        """Horizontal correction of the feet in the air: with the robot, its slip and its tilt."""
        plan = self._plan
        swing, progress = plan.swing[number], plan.progress[number]
        begins = swing & ~plan.swing[number - 1]
        self._left[begins] = self._right[begins]
        furthest = FURTHEST * plan.units.length
        balance = np.minimum(np.maximum(self._balance * estimate.slip, -furthest), furthest)
        lever = plan.places[number, :, :2] - plan.centre[number, :2]
        turned = estimate.yaw_correction * lever[:, ::-1] * (-1.0, 1.0)  # of a small angle
        upright = self._lean * plan.units.length * np.array((estimate.pitch, -estimate.roll))
        adjustable = swing & (progress < FIXED)
        target = estimate.position_correction + balance + turned + upright
        self._right[adjustable] = target[adjustable]
        return np.asarray(self._left + progress[:, None] * (self._right - self._left))

    def _compliance(self, number: int, estimate: StateEstimate) -> Array:
        """Vertical correction of the feet, shape (feet,), in [m].

        Feet in the air stay level to the ground. Feet on the ground comply with deviations from the
        planned force, as does a foot from an early touch-down on.
        """
        plan, swing = self._plan, self._plan.swing[number]
        in_contact = (plan.progress[number] > DESCENDING) & (
            estimate.force > CONTACT * plan.units.force
        )
        in_contact &= not plan.blind
        self._early = swing & (self._early | in_contact)
        tilt = estimate.pitch * self._lever[:, 0] - estimate.roll * self._lever[:, 1]
        levelling = LEVELLING * (self._lean * tilt - self._rise)
        compliant = self._gain[number] * (estimate.force - self._load[number]) - LEAK * self._rise
        desired = np.where(swing & ~self._early, levelling, compliant)
        self._speed += TICK / (SMOOTHING + TICK) * (desired - self._speed)
        rise = self._rise + TICK * self._speed
        rise += self._early * (plan.places[number - 1, :, 2] - plan.places[number, :, 2])
        highest = HIGHEST * plan.units.length
        self._rise = np.minimum(np.maximum(rise, -highest), highest)
        return self._rise


# Limit of the feed-forward acceleration at jumps of the reference, in [rad/s²] and [m/s²].
HIGHEST_ACCELERATION = 1500.0


class TrotControl:
    """Controller with attitude feedback of the base and foot placement."""

    def __init__(
        self,
        robot: Quadruped,
        model: Any,
        standing: Standing,
        plan: GaitPlan,
        *,
        sensors: dict[str, slice],
        gain: Array,
    ) -> None:
        self._model = model.copy()
        self._model.armature = np.array([*[0.0] * 6, *robot.drives.armature])
        self._data = self._model.createData()
        self._body = WholeBody(model, robot.effectors, standing.configuration)
        self._where, self._estimate = sensors, StateEstimate(robot, sensors)
        self._feet = Feet(robot, standing, plan, gain)
        self._plan, self._rates = plan, _rates(plan)
        self._lean = robot.attitude_gain
        self._configurations = [standing.configuration] * 3  # of the last three ticks
        self._velocity = np.zeros(model.nv)

    def tick(self, number: int, sensors: Array) -> Reference:
        """Advance by one tick."""
        before, here, after = self._configurations = [
            *self._configurations[1:],
            self._configuration(number, sensors),
        ]
        velocity = pin.difference(self._model, before, after) / (2 * TICK)
        reference = Reference(
            position=here[7:],
            velocity=velocity[6:],
            planned=(self._body.inverse @ self._rates[number])[6:],
            torque=self._torque(number, here, velocity),
            lift=self._body.lift,
        )
        self._velocity = velocity
        return reference

    def fallen(self, sensors: Array) -> bool:
        """Whether the robot is too low or too much tilted."""
        _, x, y, _ = sensors[self._where["base.turn"]].tolist()
        height = float(sensors[self._where["centre.place"]][2])
        low = height < LOWEST * self._plan.units.length
        return low or 1 - 2 * (x * x + y * y) < cos(STEEPEST)

    def _configuration(self, number: int, sensors: Array) -> Array:
        """Configuration by plan and feedback."""
        plan, estimate = self._plan, self._estimate
        centre, yaw = plan.centre[number].copy(), float(plan.yaw[number])
        velocity = self._rates[number, _CENTRE]
        tilt = plan.tilt[number]
        estimate.update(sensors, place=centre[:2], velocity=velocity, yaw=yaw, tilt=tilt)
        centre[:2] += estimate.position_correction
        lean = -self._lean
        base = pin.rpy.rpyToMatrix(
            tilt[0] + lean * estimate.roll,
            tilt[1] + lean * estimate.pitch,
            yaw + estimate.yaw_correction,
        )
        return self._body.follow(self._feet.places(number, estimate), (), centre, base)

    def _torque(self, number: int, configuration: Array, velocity: Array) -> Array:
        """Feed-forward torque for a motion under the planned loads of the feet."""
        highest = HIGHEST_ACCELERATION
        acceleration = (velocity - self._velocity) / TICK
        acceleration = np.minimum(np.maximum(acceleration, -highest), highest)
        torque = pin.rnea(self._model, self._data, configuration, velocity, acceleration)
        load = self._plan.units.force * self._plan.load[number]
        push = np.outer(load, self._plan.push[number]).ravel()
        return np.asarray((torque - load @ self._body.heights - push @ self._body.planes)[6:])


# Slice of the horizontal velocity of the centre of mass in the planned rates.
_CENTRE = slice(-6, -4)


def _rates(plan: GaitPlan) -> Array:
    """Planned rates of the whole body's equations: feet, centre of mass, turn of the base."""
    feet = plan.places.reshape(len(plan.yaw), -1)
    rates = np.gradient(np.column_stack((feet, plan.centre, plan.tilt, plan.yaw)), TICK, axis=0)
    rates[:, -3:-1] = turned(plan.yaw, rates[:, -3:-1])  # of small tilts
    return np.asarray(rates)


# Ticks before the recording during which the robot comes to rest under its unknown load.
SETTLING = 400
ATTITUDE_NOISE = 1e-4  # standard deviation of the measured attitude per tick, in [rad]
VELOCITY_NOISE = 5e-3  # standard deviation of the measured velocity per tick, in [m/s]


def scene(robot: Quadruped, plan: GaitPlan, faults: Faults, imperfections: Imperfections) -> Scene:
    """Scene of one run."""
    model, standing = reduced_model(robot), stand(robot)
    # The encoders read the standing configuration; the lowest foot is on the ground.
    start = standing.configuration.copy()
    start[7:] -= faults.offsets(len(start) - 7)
    data = model.createData()
    pin.framesForwardKinematics(model, data, start)
    feet = [data.oMf[model.getFrameId(foot.frame)].translation[2] for foot in robot.effectors]
    start[2] += robot.effectors[0].radius - min(feet)
    start[3:7] = start[[6, 3, 4, 5]]  # MuJoCo has w first
    boxes = faults.boxes_on(plan)
    world = real_world(robot, boxes, imperfections, frame=model.frames[1].name, point=np.zeros(3))
    sensors = sensors_of(world)
    gain = np.pad(faults.gain(plan.time), (SETTLING, 0), "edge") * imperfections.force_gain
    control = TrotControl(
        robot,
        model,
        standing,
        plan.shifted(faults.shift).after(SETTLING),
        sensors=sensors,
        gain=gain,
    )
    noise = np.zeros(world.nsensordata)
    noise[: len(robot.effectors)] = imperfections.force_noise
    noise[sensors["base.turn"]] = ATTITUDE_NOISE / 2
    noise[sensors["centre.velocity"]] = VELOCITY_NOISE
    return Scene(
        model=world,
        start=start,
        tick=control.tick,
        fallen=control.fallen,
        effectors=len(robot.effectors),
        settling=SETTLING,
        noise=noise,
        changes=box_changes(world, boxes),
    )
