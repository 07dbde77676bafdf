"""Arms that reach in joint space, or pick from a table: plans, controllers, and their scene."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from noiseclassifier.scenarios.faults import Faults, Imperfections
from noiseclassifier.scenarios.loop import Reference, Scene, force
from noiseclassifier.scenarios.motions import (
    TICK,
    Box,
    Contact,
    Payload,
    Picks,
    Plan,
    Reach,
    Rng,
    ScenarioError,
    Tip,
    Units,
    minimum_jerk,
    times,
)
from noiseclassifier.scenarios.robots import Arm
from noiseclassifier.scenarios.world import box_changes, configuration, real_world, reduced_model
from noisemodel import Robot
from noisemodel.types import Array

# Limit of the feed-forward acceleration at jumps of the reference, in [rad/s²].
HIGHEST_ACCELERATION = 30.0
MARGIN = 0.1  # distance from the joints' limits, in [rad]
OVER = 0.08  # how far splines and waves may reach into that margin, in [rad]
SHORTEST = 0.2  # shortest movement, in [s]
TURN = np.pi  # furthest position of a joint without nearer limits, in [rad]
SHARE = 0.7  # share of the drives' torque that a plan may need, and of the URDF's speed
SLOWER = 1.25  # factor on the duration of a movement that needs too much torque
LONG_PAUSES = 0.15  # share of the pauses that are long
LONG = (1.0, 3.0)  # A long pause, in [s]
BRAKING = (0.05, 0.2)  # time in which an emergency stop brakes, in [s]
HALTED = (0.3, 1.0)  # time between an emergency stop and going on, in [s]
RESUMING = 0.4  # time in which the motion gets back to its speed, in [s]
CARRYING = (0.5, 2.5)  # time between picking up and putting down, and until the next time, in [s]
GRASPING = (0.06, 0.15)  # time in which the tool takes over a weight, in [s]
SINES = (0.05, 1.5)  # frequencies of sines, in [Hz]
HAND = (0.4, 1.5)  # bandwidth of the hand that teleoperates, in [Hz]
SENDING = (20.0, 60.0)  # rate at which a teleoperation device sends positions, in [Hz]


class Tool:
    """The tip of an arm's tool: kinematics, and torques of the arm."""

    def __init__(self, arm: Arm) -> None:
        self.model = reduced_model(arm)
        self._data = self.model.createData()
        self._frame, self._point = self.model.getFrameId(arm.tool.frame), np.array(arm.tool.point)

    def pose(self, joints: Array) -> Any:
        """Placement of the tool's frame."""
        pin.framesForwardKinematics(self.model, self._data, configuration(self.model, joints))
        return self._data.oMf[self._frame]

    def place(self, joints: Array) -> Array:
        """Position of the tip, shape (3,), in [m]."""
        return np.asarray(self.pose(joints).act(self._point))

    def jacobian(self, joints: Array) -> tuple[Array, Array, Array, Array]:
        """Frame's position, way from there to the tip, rotation, and Jacobian of the tip."""
        model, data = self.model, self._data
        pin.computeJointJacobians(model, data, configuration(model, joints))
        placement = pin.updateFramePlacement(model, data, self._frame)
        lever = placement.rotation @ self._point
        jacobian = pin.getFrameJacobian(model, data, self._frame, pin.LOCAL_WORLD_ALIGNED)
        jacobian[:3] -= pin.skew(lever) @ jacobian[3:]  # of the tip, not of the frame
        return placement.translation, lever, placement.rotation, jacobian

    def torque(self, joints: Array, velocity: Array, acceleration: Array) -> Array:
        """Torques of a motion, without the inertia of drives, shape (joints,), in [N m]."""
        q = configuration(self.model, joints)
        return np.asarray(pin.rnea(self.model, self._data, q, velocity, acceleration))


@dataclass(frozen=True, eq=False, kw_only=True)
class ReachPlan(Plan):
    """Plan of the motion of an arm's joints."""

    joints: Array  # positions, shape (ticks, joints), in [rad]
    stops: tuple[float, ...] = ()  # times of emergency stops, in [s]
    foreseen: bool = True


@dataclass(frozen=True, eq=False)
class Ability:
    """What an arm can do, by its URDF and its drives."""

    tool: Tool
    rest: Array  # joint positions around which it moves, shape (joints,), in [rad]
    low: Array  # lowest positions, shape (joints,), in [rad]
    high: Array  # highest positions, shape (joints,), in [rad]
    speed: Array  # largest speeds, shape (joints,), in [rad/s]
    torque: Array  # largest torques, shape (joints,), in [N m]
    armature: Array  # inertia of the drives, shape (joints,), in [kg m²]

    @classmethod
    def of(cls, arm: Arm) -> "Ability":
        """What an arm can do."""
        model, rest = Robot.load(arm.name, floating_base=False).model, np.array(arm.rest)
        joints = [model.joints[model.getJointId(name)] for name in arm.drives.joints]
        low, high = rest - TURN, rest + TURN
        for index, joint in enumerate(joints):
            if joint.nq == 1:  # a continuous joint has no limits
                low[index] = max(low[index], model.lowerPositionLimit[joint.idx_q] + MARGIN)
                high[index] = min(high[index], model.upperPositionLimit[joint.idx_q] - MARGIN)
        speed = np.array([model.velocityLimit[joint.idx_v] for joint in joints])
        return cls(
            Tool(arm),
            rest,
            low=np.minimum(low, rest),
            high=np.maximum(high, rest),
            speed=SHARE * np.where(speed > 0, speed, np.inf),
            torque=SHARE * np.array(arm.drives.torque),
            armature=np.array(arm.drives.armature),
        )

    def feasible(self, positions: Array, fastest: float, ticks: int) -> bool:
        """Whether drives can follow positions of each tick, accelerating in [rad/s²] at most."""
        coarse = positions[::ticks]
        if len(coarse) < 3:
            return True
        velocity = np.gradient(coarse, ticks * TICK, axis=0)
        acceleration = np.gradient(velocity, ticks * TICK, axis=0)
        if np.abs(acceleration).max() > fastest or (np.abs(velocity) > self.speed).any():
            return False
        return all(
            (np.abs(self.tool.torque(q, v, a) + self.armature * a) <= self.torque).all()
            for q, v, a in zip(coarse, velocity, acceleration, strict=True)
        )


# From a duration, in [s], to positions at its ticks, shape (ticks, joints), in [rad].
Movement: TypeAlias = Callable[[float], Array]
Made: TypeAlias = tuple[Movement, float]  # with its highest speed times its duration, in [rad]


def reach(arm: Arm, motion: Reach, rng: Rng, duration: float) -> ReachPlan:
    """Plan of movements, one after the other."""
    ability = Ability.of(arm)
    moving, stopping, loading = rng.spawn(3)
    parts = [np.tile(ability.rest, (round(motion.stand / TICK), 1))]
    ticks = round(duration / TICK)
    while sum(map(len, parts)) < ticks:
        parts += [_movement(motion, moving, ability, parts[-1][-1])]
        pause = moving.uniform(*(LONG if moving.uniform() < LONG_PAUSES else motion.pause))
        parts += [np.tile(parts[-1][-1], (round(pause / TICK), 1))]
    joints, stops = _stopped(motion, stopping, np.concatenate(parts), ticks)
    return ReachPlan(
        joints=joints,
        places=np.array([[ability.tool.place(position)] for position in joints]),
        effectors=arm.effectors,
        torques=arm.drives.torque,
        payloads=_payloads(motion, loading, arm.tool, arm.units, duration),
        units=arm.units,
        stops=stops,
        foreseen=motion.kind != "teleoperation",
    )


def _movement(motion: Reach, rng: Rng, ability: Ability, start: Array) -> Array:
    """A movement at the drawn speed, or as fast as the drives can follow."""
    speed = float(np.exp(rng.uniform(np.log(motion.speed[0]), np.log(motion.speed[1]))))
    movement, extent = KINDS[motion.kind](motion, rng, ability, start)
    duration = max(extent / speed, SHORTEST)
    average = 60 if motion.kind == "teleoperation" else 20  # longer than what is sent is apart
    for _ in range(40):
        positions = movement(duration)
        velocity = np.abs(np.diff(positions, axis=0)).max(initial=0.0) / TICK
        if velocity <= 1.05 * speed and ability.feasible(positions, motion.acceleration, average):
            return positions
        duration *= max(SLOWER if velocity <= 1.05 * speed else velocity / speed, 1.05)
    raise ScenarioError("no drive is strong enough for the motion, however slow it is")


def _goal(motion: Reach, rng: Rng, ability: Ability) -> Array:
    """Positions around those at rest, within limits; some joints stay there."""
    count = len(ability.rest)
    away = rng.uniform(-motion.spread, motion.spread, count) * (rng.uniform(size=count) < 0.8)
    return np.asarray(np.clip(ability.rest + away, ability.low, ability.high))


def _straight(motion: Reach, rng: Rng, ability: Ability, start: Array) -> Made:
    goal = _goal(motion, rng, ability)

    def movement(duration: float) -> Array:
        share = minimum_jerk(_shares(duration))
        return start + share[:, None] * (goal - start)

    return movement, 1.875 * float(np.abs(goal - start).max())


def _trapezoid(motion: Reach, rng: Rng, ability: Ability, start: Array) -> Made:
    """Constant acceleration, speed, and deceleration: jerk is not finite."""
    goal, ramp = _goal(motion, rng, ability), float(rng.uniform(0.1, 0.4))

    def movement(duration: float) -> Array:
        share, top = _shares(duration), 1 / (1 - ramp)
        up = top * share**2 / (2 * ramp)
        down = 1 - top * (1 - share) ** 2 / (2 * ramp)
        middle = top * (share - ramp / 2)
        path = np.where(share < ramp, up, np.where(share > 1 - ramp, down, middle))
        return start + path[:, None] * (goal - start)

    return movement, float(np.abs(goal - start).max()) / (1 - ramp)


def _spline(motion: Reach, rng: Rng, ability: Ability, start: Array) -> Made:
    """Through way points without a stop."""
    points = np.array([start, *(_goal(motion, rng, ability) for _ in range(rng.integers(3, 6)))])
    lengths = np.abs(np.diff(points, axis=0)).max(axis=1) + 0.05
    knots = np.concatenate(([0.0], np.cumsum(lengths))) / lengths.sum()
    for shrink in (1.0, 0.7, 0.4, 0.1):  # splines overshoot; into the margin they may
        path = CubicSpline(knots, start + shrink * (points - start), bc_type="clamped")
        fine = path(np.linspace(0, 1, 500))
        if (fine >= ability.low - OVER).all() and (fine <= ability.high + OVER).all():
            break

    def movement(duration: float) -> Array:
        return np.asarray(path(_shares(duration)))

    return movement, float(np.abs(path(np.linspace(0, 1, 500), 1)).max())


def _sines(motion: Reach, rng: Rng, ability: Ability, start: Array) -> Made:
    """Sums of sines, faded in and out; slower ones are larger."""
    count = len(start)
    rates = 2 * np.pi * np.exp(rng.uniform(np.log(SINES[0]), np.log(SINES[1]), (3, count)))
    phases = rng.uniform(0, 2 * np.pi, (3, count))
    seconds = float(rng.uniform(3.0, 6.0))
    sizes = motion.spread / 3 * np.minimum(1, 2 / rates) * (rng.uniform(size=count) < 0.8)

    def movement(duration: float) -> Array:
        moments = seconds * _shares(duration)[:, None, None]
        waves = (sizes * (np.sin(rates * moments + phases))).sum(axis=1)
        envelope = minimum_jerk(np.clip(np.minimum(moments, seconds - moments)[:, 0], 0, 1))
        return _bounded(start + envelope * waves, start, ability)

    return movement, seconds * float((sizes * rates).sum(axis=0).max()) * 0.7


def _teleoperated(motion: Reach, rng: Rng, ability: Ability, start: Array) -> Made:
    """A hand that wanders and hesitates, sent at a low rate and interpolated linearly."""
    count = len(start)
    seconds, rate = float(rng.uniform(2.0, 5.0)), float(rng.uniform(*SENDING))
    fine = round(seconds / TICK)
    bandwidth, mind = (1 / (2 * np.pi * f * TICK) for f in (float(rng.uniform(*HAND)), 0.5))
    wander = _wander(rng, (fine, count), bandwidth) * (rng.uniform(size=count) < 0.8)
    pace = np.clip(0.8 + _wander(rng, (fine, 1), mind)[:, 0], 0.02, 1.0)  # 0.02: it hesitates
    ticks, moved = np.arange(fine), np.cumsum(pace)
    wander = np.column_stack([np.interp(moved, ticks, way) for way in wander.T])
    away = minimum_jerk(np.clip(np.minimum(ticks, fine - 1 - ticks) * TICK / 0.7, 0, 1))
    wander *= away[:, None] * motion.spread / 2

    def movement(duration: float) -> Array:
        sent = np.append(np.arange(0, 1, 1 / (rate * duration)), 1.0)
        hand = [np.interp(sent * (fine - 1), ticks, way) for way in wander.T]
        path = np.column_stack([np.interp(_shares(duration), sent, way) for way in hand])
        return _bounded(start + path, start, ability)

    return movement, float(np.abs(np.diff(wander, axis=0)).max()) * fine


# Movements by the kind of motion: each with the product of its highest speed and duration.
KINDS = {
    "minimum-jerk": _straight,
    "trapezoid": _trapezoid,
    "spline": _spline,
    "sines": _sines,
    "teleoperation": _teleoperated,
}


def _shares(duration: float) -> Array:
    """Time from 0 to 1 at the ticks of a movement, its last tick at 1."""
    ticks = max(round(duration / TICK), 2)
    return np.arange(1, ticks + 1) / ticks


def _bounded(path: Array, start: Array, ability: Ability) -> Array:
    """Path around its start, drawn together where it would exceed a limit."""
    away = path - start
    room = np.where(away > 0, ability.high - start, start - ability.low) + OVER
    excess = np.abs(away).max(axis=0) / room.min(axis=0)
    return np.asarray(start + away / np.maximum(excess, 1.0))


def _wander(rng: Rng, shape: tuple[int, int], deviation: float) -> Array:
    """Low-passed white noise of about unit amplitude; deviation of the filter in ticks."""
    smooth = gaussian_filter1d(rng.normal(size=shape), deviation, axis=0, mode="wrap")
    return np.asarray(smooth * np.sqrt(2 * np.sqrt(np.pi) * deviation))


def _stopped(motion: Reach, rng: Rng, joints: Array, ticks: int) -> tuple[Array, tuple[float, ...]]:
    """The plan with emergency stops: its pace drops to 0 and comes back."""
    pace, stops, now = np.ones(ticks), [], 0.0
    while motion.stops:
        now += float(rng.exponential(1 / motion.stops)) + 0.5
        braking, halted = float(rng.uniform(*BRAKING)), float(rng.uniform(*HALTED))
        if now >= ticks * TICK:
            break
        stops.append(now)
        time = times(ticks, TICK) - now
        now += braking + halted + RESUMING
        resumed = minimum_jerk(np.clip((time - braking - halted) / RESUMING, 0, 1))
        pace *= np.where(time < braking, 1 - np.clip(time / braking, 0, 1), resumed)
    if not stops:
        return joints[:ticks], ()
    moments = np.cumsum(pace) - pace[0]
    return np.asarray(CubicSpline(np.arange(len(joints)), joints)(moments)), tuple(stops)


def _payloads(
    motion: Reach, rng: Rng, tool: Tip, units: Units, duration: float
) -> tuple[Payload, ...]:
    """What the tool carries from time to time."""
    payloads, now = [], float(rng.uniform(*CARRYING))
    while motion.payload[1] and now < duration:
        mass = units.force * float(rng.uniform(*motion.payload))
        stop, rise = now + float(rng.uniform(*CARRYING)), float(rng.uniform(*GRASPING))
        payloads.append(Payload(frame=tool.frame, start=now, stop=stop, mass=mass, rise=rise))
        now = stop + rise + float(rng.uniform(*CARRYING))
    return tuple(payloads)


DAMPING = 1e-3  # of the inverse Jacobian, in [m²]


class JointControl:
    """Follows planned joint positions, moved by a shift of the tip, with the model's torque."""

    def __init__(self, tool: Tool, joints: Array, shift: Array, *, fastest: float) -> None:
        self._tool = tool
        self._planned = np.gradient(joints, TICK, axis=0)
        joints = joints.copy()
        for tick in np.flatnonzero(shift.any(axis=1)):
            joints[tick] += self._inverse(joints[tick]) @ shift[tick]
        self._position = joints
        self._velocity = np.gradient(joints, TICK, axis=0)
        self._acceleration = np.clip(np.gradient(self._velocity, TICK, axis=0), -fastest, fastest)

    def tick(self, number: int, sensors: Array) -> Reference:
        """Advance by one tick; the sensors have no effect."""
        here, end = self._position[number], min(number + 1, len(self._position) - 1)
        return Reference(
            position=self._position[end],
            velocity=self._velocity[end],
            planned=self._planned[end],
            torque=self._tool.torque(here, self._velocity[number], self._acceleration[number]),
            lift=self._inverse(here)[None, :, 2],
        )

    def _inverse(self, joints: Array) -> Array:
        """Damped inverse Jacobian of the tip's place, shape (joints, 3), in [rad/m]."""
        *_, jacobian = self._tool.jacobian(joints)
        place = jacobian[:3]
        return np.asarray(place.T @ np.linalg.inv(place @ place.T + DAMPING * np.eye(3)))


NEAR = 0.002  # height over the table at which force control starts, in [m]


@dataclass(frozen=True, eq=False, kw_only=True)
class PickPlan(Plan):
    """Plan of the motion of a tool."""

    yaw: Array  # turn of the tool about the vertical since the start, shape (ticks,), in [rad]
    force: Array  # force to press with; NaN while force control is off, shape (ticks,), in [N]
    keep: Array  # share of the last offset of the force control that remains, shape (ticks,)


@dataclass(frozen=True)
class Segment:
    """One movement from rest to rest, straight or bent."""

    duration: float
    position: tuple[float, float, float]
    yaw: float
    force: float = np.nan
    release: bool = False
    bend: tuple[float, float, float] = (0.0, 0.0, 0.0)


def pick(arm: Arm, motion: Picks, rng: Rng, duration: float) -> PickPlan:
    """Plan of picks, one after the other."""
    table, area = arm.table, arm.reach
    x, y, z = Tool(arm).place(np.array(arm.rest)).tolist()
    segments = [Segment(0.2, (x, y, z), 0.0)]
    contacts = []
    now = segments[0].duration
    spot = _place(rng, area) if motion.way == "spot" else None
    while now < duration:
        one = (
            _one_flight(rng, table, area)
            if motion.way == "directions"
            else _one_pick(motion, rng, table, spot or _place(rng, area))
        )
        for segment in one:
            if not np.isnan(segment.force):
                lift = now + segment.duration
                place = (segment.position[0], segment.position[1], table)
                contacts.append(Contact(now, lift, lift + one[-1].duration, place))
            now += segment.duration
        segments += one
    ticks = round(duration / TICK)
    position, yaw, force, keep = (np.concatenate(part)[:ticks] for part in _sample(segments))
    return PickPlan(
        places=position[:, None],
        yaw=yaw,
        force=force * arm.units.force,
        keep=keep,
        contacts=tuple(contact for contact in contacts if contact.start < duration),
        effectors=arm.effectors,
        torques=arm.drives.torque,
        ground=(Box(centre=(0.5, 0.0, table - 0.05), half=(0.6, 1.0, 0.05)),),
        units=arm.units,
    )


def _place(rng: Rng, area: Any) -> tuple[float, float]:
    """A place in ranges of x and y."""
    return float(rng.uniform(*area[0])), float(rng.uniform(*area[1]))


def _one_pick(motion: Picks, rng: Rng, table: float, place: tuple[float, float]) -> list[Segment]:
    x, y = place
    above = table + float(rng.uniform(0.1, 0.2))
    yaw = float(rng.uniform(-0.5, 0.5))
    pace = float(rng.uniform(0.8, 1.25))
    hover = table + float(rng.uniform(*motion.hover))
    bend = (0.0, 0.0, 0.0)
    if motion.way == "curve":
        bend = (float(rng.uniform(-0.1, 0.05)), float(rng.uniform(-0.1, 0.1)), 0.05)
    near = (x, y, table + NEAR)
    return [
        Segment(1.1 * pace, (x, y, above), yaw, bend=bend),
        Segment(0.5 * pace, (x, y, hover), yaw),
        Segment(float(rng.uniform(0.15, 0.3)), near, yaw),
        Segment(float(rng.uniform(0.7, 1.0)), near, yaw, force=float(rng.uniform(*motion.force))),
        Segment(0.5 * pace, (x, y, above), yaw, release=True),
    ]


def _one_flight(rng: Rng, table: float, area: Any) -> list[Segment]:
    """A movement over the table in any direction."""
    position = (*_place(rng, area), table + float(rng.uniform(0.05, 0.3)))
    pause = Segment(float(rng.uniform(0.02, 0.3)), position, 0.0)
    return [Segment(float(rng.uniform(0.5, 1.3)), position, 0.0), pause]


def _sample(segments: list[Segment]) -> tuple[list[Array], list[Array], list[Array], list[Array]]:
    """Samples of position, yaw, force and keep, segment by segment."""
    positions, yaws, forces, keeps = [], [], [], []
    here, turned = np.array(segments[0].position), 0.0
    for segment in segments:
        ticks = round(segment.duration / TICK)
        share = minimum_jerk(np.arange(ticks) / ticks)
        there = np.array(segment.position)
        path = here + np.outer(share, there - here)
        if any(segment.bend):
            along = np.arange(ticks) / ticks  # away and back, at rest at both ends
            path += np.outer(16 * along**2 * (1 - along) ** 2, segment.bend)
        positions.append(path)
        yaws.append(turned + share * (segment.yaw - turned))
        onset = minimum_jerk(np.clip(np.arange(ticks) * TICK / 0.15, 0, 1))
        forces.append(segment.force * onset)
        keeps.append(1 - share if segment.release else np.zeros(ticks))
        here, turned = there, segment.yaw
    return positions, yaws, forces, keeps


FURTHEST = 0.1  # largest offset of the tool by force control, in [m]
GUARD = 80.0  # contact force beyond which the tool yields while it descends, in [N]
TOUCHING = 5.0  # contact force that no noise of a sensor reaches, in [N]
UNLOADING = 0.4  # time in which force control unloads a tool that touched before it started, in [s]


class ToolControl:
    """Follows a plan with a tool that points down, and presses with the planned force."""

    def __init__(
        self, tool: Tool, rest: Array, plan: PickPlan, *, gain: Array, time_constant: float
    ) -> None:
        self._tool, self._plan, self._gain = tool, plan, gain
        self._upright = tool.pose(rest).rotation.copy()
        self._share = TICK / (time_constant + TICK)
        self._force = self._offset = self._left = self._excess = 0.0
        self._pressing = 0  # ticks of force control so far
        self._joints = [rest] * 3  # of the last three ticks
        self._path = plan.places[:, 0]
        self._velocities = np.gradient(self._path, TICK, axis=0)
        self._turning = np.gradient(plan.yaw, TICK)

    def tick(self, number: int, sensors: Array) -> Reference:
        """Advance by one tick."""
        tip = self._path[number] + (0.0, 0.0, self._press(number, float(sensors[0])))
        joints, inverse = self._solve(tip, self._plan.yaw[number])
        before, here, after = self._joints = [*self._joints[1:], joints]
        velocity = (after - before) / (2 * TICK)
        acceleration = (after - 2 * here + before) / TICK**2
        planned = inverse @ (*self._velocities[number], 0, 0, self._turning[number])
        return Reference(
            position=here,
            velocity=velocity,
            planned=planned,
            torque=self._tool.torque(
                here, velocity, np.clip(acceleration, -HIGHEST_ACCELERATION, HIGHEST_ACCELERATION)
            ),
            lift=inverse[None, :, 2],
        )

    def _press(self, number: int, force: float) -> float:
        """Height offset of the tool: the integral of the error of the contact force, in [m]."""
        self._force += self._share * (force - self._force)
        desired = self._plan.force[number]
        if np.isnan(desired):
            self._pressing = 0
            # A tool that descends yields to an unplanned contact.
            yielding = self._offset + TICK * float(self._gain[number]) * (self._force - GUARD)
            guarded = min(max(yielding, 0.0), FURTHEST)
            self._offset = self._left * self._plan.keep[number] or guarded
            return self._offset
        if not self._pressing:
            self._excess = self._force if self._force > TOUCHING else 0.0
        if self._excess:  # bumpless transfer: the desired force starts at the measured one
            share = np.array(min(self._pressing * TICK / UNLOADING, 1.0))
            desired += self._excess * (1 - float(minimum_jerk(share)))
        self._pressing += 1
        rise = TICK * float(self._gain[number]) * (self._force - desired)
        self._offset = self._left = min(max(self._offset + rise, -FURTHEST), FURTHEST)
        return self._offset

    def _solve(self, tip: Array, yaw: float) -> tuple[Array, Array]:
        """Joints after a Newton step (the tool moves by a millimetre), and the inverse Jacobian."""
        joints = self._joints[-1]
        place, lever, rotation, jacobian = self._tool.jacobian(joints)
        turn = rotation.T @ pin.rpy.rpyToMatrix(0.0, 0.0, yaw) @ self._upright
        error = np.concatenate((tip - place - lever, rotation @ pin.log3(turn)))
        damped = jacobian @ jacobian.T + 1e-8 * np.eye(6)
        inverse = jacobian.T @ np.linalg.inv(damped)
        joints = joints + inverse @ error
        return joints, inverse


# Ticks before the recording during which the arm comes to rest under its unknown load.
SETTLING = 300


def plan(arm: Arm, motion: Picks | Reach, rng: Rng, duration: float) -> Plan:
    """Plan of the motion of one run."""
    if isinstance(motion, Reach):
        return reach(arm, motion, rng, duration)
    return pick(arm, motion, rng, duration)


def scene(arm: Arm, plan: Plan, faults: Faults, imperfections: Imperfections) -> Scene:
    """Scene of one run."""
    rest, boxes = np.array(arm.rest), faults.boxes_on(plan)
    tip = np.array(arm.tool.point)
    world = real_world(
        arm, boxes, imperfections, frame=arm.tool.frame, point=tip, contact=arm.contact
    )
    return Scene(
        model=world,
        start=rest - faults.offsets(len(rest)),  # the encoders read the rest position
        tick=_control(arm, plan, faults, imperfections).tick,
        effectors=1,
        settling=SETTLING,
        noise=np.array([imperfections.force_noise]),
        changes=box_changes(world, boxes),
        forces=tuple(force(world, load) for load in (*plan.payloads, *faults.loads)),
    )


def _control(
    arm: Arm, plan: Plan, faults: Faults, imperfections: Imperfections
) -> JointControl | ToolControl:
    """Controller of the tool, or of the joints, that rests at first."""
    tool = Tool(arm)
    if isinstance(plan, ReachPlan):
        shift = faults.shift(plan.time)[:, 0] if faults.shift else np.zeros_like(plan.places[:, 0])
        return JointControl(
            tool,
            plan.after(SETTLING).joints,
            np.pad(shift, ((SETTLING, 0), (0, 0))),
            fastest=HIGHEST_ACCELERATION if plan.foreseen else 0.0,
        )
    assert isinstance(plan, PickPlan)
    gain = np.pad(faults.gain(plan.time), (SETTLING, 0), "edge")
    return ToolControl(
        tool,
        np.array(arm.rest),
        plan.shifted(faults.shift).after(SETTLING),
        gain=arm.force_gain * imperfections.force_gain * gain,
        time_constant=arm.force_filter,
    )
