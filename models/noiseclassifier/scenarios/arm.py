"""An arm that picks from a table: plan, controller, and the scene of any arm."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.arm_reaching import (
    HIGHEST_ACCELERATION,
    MARGIN,
    SHARE,
    TURN,
    Ability,
    JointControl,
    ReachPlan,
    reach,
)
from noiseclassifier.scenarios.errors import ScenarioError
from noiseclassifier.scenarios.faults import Faults, Imperfections
from noiseclassifier.scenarios.loop import Control, Reference, Scene, forces
from noiseclassifier.scenarios.motions import (
    TICK,
    Box,
    Contact,
    Effector,
    Payload,
    Picks,
    Reach,
    Rod,
    Units,
    bump,
    minimum_jerk,
    times,
)
from noiseclassifier.scenarios.robots import Arm
from noiseclassifier.scenarios.world import (
    box_changes,
    configuration,
    real_world,
    reduced_model,
)
from noisemodel import Robot
from noisemodel.types import Array

NEAR = 0.002  # height over the table at which force control starts, in [m]
METRIC = Units()  # metres and newtons


@dataclass(frozen=True, eq=False)
class Plan:
    """Plan of the motion of a tool, at every tick."""

    position: Array  # of the tool's tip, shape (ticks, 3), in [m]
    yaw: Array  # turn of the tool about the vertical since the start, shape (ticks,), in [rad]
    force: Array  # force to press with; NaN while force control is off, shape (ticks,), in [N]
    keep: Array  # share of the last offset of the force control that remains, shape (ticks,)
    contacts: tuple[Contact, ...]
    effectors: tuple[Effector, ...]
    ground: tuple[Box, ...]
    units: Units = METRIC

    @property
    def time(self) -> Array:
        """Time of each tick, shape (ticks,), in [s]."""
        return times(len(self.yaw), TICK)

    @property
    def payloads(self) -> tuple[Payload, ...]:
        """None."""
        return ()

    @property
    def duration(self) -> float:
        """Duration, in [s]."""
        return len(self.yaw) * TICK

    def after(self, ticks: int) -> "Plan":
        """The plan after some ticks of rest."""
        return replace(
            self,
            position=np.pad(self.position, ((ticks, 0), (0, 0)), "edge"),
            yaw=np.pad(self.yaw, (ticks, 0), "edge"),
            force=np.pad(self.force, (ticks, 0), constant_values=np.nan),
            keep=np.pad(self.keep, (ticks, 0)),
            contacts=tuple(contact.later(ticks * TICK) for contact in self.contacts),
        )


@dataclass(frozen=True)
class Segment:
    """One movement from rest to rest, straight or bent."""

    duration: float
    position: tuple[float, float, float]
    yaw: float
    force: float = np.nan
    release: bool = False
    bend: tuple[float, float, float] = (0.0, 0.0, 0.0)


def pick(
    motion: Picks,
    rng: np.random.Generator,
    *,
    start: Array,
    tool: Rod,
    table: float,
    reach: tuple[tuple[float, float], tuple[float, float]],
    duration: float,
    units: Units = METRIC,
) -> Plan:
    """Plan of picks, one after the other."""
    segments = [Segment(0.2, (float(start[0]), float(start[1]), float(start[2])), 0.0)]
    contacts = []
    now = segments[0].duration
    spot = _place(rng, reach) if motion.way == "spot" else None
    while now < duration:
        one = (
            _one_flight(rng, table, reach)
            if motion.way == "directions"
            else _one_pick(motion, rng, table, spot or _place(rng, reach))
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
    return Plan(
        position,
        yaw,
        force * units.force,
        keep,
        contacts=tuple(contact for contact in contacts if contact.start < duration),
        effectors=(tool,),
        ground=(Box(centre=(0.5, 0.0, table - 0.05), half=(0.6, 1.0, 0.05)),),
        units=units,
    )


def _place(
    rng: np.random.Generator, reach: tuple[tuple[float, float], tuple[float, float]]
) -> tuple[float, float]:
    return float(rng.uniform(*reach[0])), float(rng.uniform(*reach[1]))


def _one_pick(
    motion: Picks, rng: np.random.Generator, table: float, place: tuple[float, float]
) -> list[Segment]:
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


def _one_flight(
    rng: np.random.Generator, table: float, reach: tuple[tuple[float, float], tuple[float, float]]
) -> list[Segment]:
    """A movement over the table in any direction."""
    position = (*_place(rng, reach), table + float(rng.uniform(0.05, 0.3)))
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
            path += np.outer(bump(np.arange(ticks) / ticks), segment.bend)
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
        self,
        model: Any,
        frame: str,
        point: Array,
        rest: Array,
        plan: Plan,
        *,
        gain: Array,
        time_constant: float,
    ) -> None:
        self._model, self._data = model, model.createData()
        self._frame, self._point = model.getFrameId(frame), point
        pin.framesForwardKinematics(model, self._data, configuration(model, rest))
        self._upright = self._data.oMf[self._frame].rotation.copy()
        self._plan, self._gain = plan, gain
        self._share = TICK / (time_constant + TICK)
        self._force = self._offset = self._left = self._excess = 0.0
        self._pressing = 0  # ticks of force control so far
        self._joints = [rest] * 3  # of the last three ticks
        self._velocity = self._planned = np.zeros(len(rest))
        self._velocities = np.gradient(plan.position, TICK, axis=0)
        self._turning = np.gradient(plan.yaw, TICK)

    def tick(self, number: int, sensors: Array) -> Reference:
        """Advance by one tick."""
        tip = self._plan.position[number] + (0.0, 0.0, self._press(number, float(sensors[0])))
        joints, inverse = self._solve(tip, self._plan.yaw[number])
        before, here, after = self._joints = [*self._joints[1:], joints]
        velocity = (after - before) / (2 * TICK)
        acceleration = (after - 2 * here + before) / TICK**2
        planned = inverse @ (*self._velocities[number], 0, 0, self._turning[number])
        reference = Reference(
            position=np.stack((before, here)),
            velocity=np.stack((self._velocity, velocity)),
            planned=np.stack((self._planned, planned)),
            torque=pin.rnea(
                self._model,
                self._data,
                configuration(self._model, here),
                velocity,
                np.clip(acceleration, -HIGHEST_ACCELERATION, HIGHEST_ACCELERATION),
            ),
            lift=inverse[None, :, 2],
        )
        self._velocity, self._planned = velocity, planned
        return reference

    def fallen(self, sensors: Array) -> bool:
        """False: an arm does not fall."""
        return False

    def _press(self, number: int, force: float) -> float:
        """Height offset of the tool: the integral of the error of the contact force, in [m]."""
        self._force += self._share * (force - self._force)
        desired = self._plan.force[number]
        if np.isnan(desired):
            self._pressing = 0
            self._offset = self._left * self._plan.keep[number] or self._guarded(number)
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

    def _guarded(self, number: int) -> float:
        """Height offset of a tool that descends: it yields to an unplanned contact, in [m]."""
        rise = TICK * float(self._gain[number]) * (self._force - GUARD)
        return min(max(self._offset + rise, 0.0), FURTHEST)

    def _solve(self, tip: Array, yaw: float) -> tuple[Array, Array]:
        """Joints after a Newton step towards a pose of the tool, and the inverse Jacobian.

        One step per tick is enough: the tool moves by a millimetre in that time.
        """
        joints = self._joints[-1]
        pin.computeJointJacobians(self._model, self._data, configuration(self._model, joints))
        placement = pin.updateFramePlacement(self._model, self._data, self._frame)
        lever = placement.rotation @ self._point
        jacobian = pin.getFrameJacobian(
            self._model, self._data, self._frame, pin.LOCAL_WORLD_ALIGNED
        )
        jacobian[:3] -= pin.skew(lever) @ jacobian[3:]  # of the tip, not of the frame
        turn = placement.rotation.T @ pin.rpy.rpyToMatrix(0.0, 0.0, yaw) @ self._upright
        error = np.concatenate(
            (tip - placement.translation - lever, placement.rotation @ pin.log3(turn))
        )
        damped = jacobian @ jacobian.T + 1e-8 * np.eye(6)
        inverse = jacobian.T @ np.linalg.inv(damped)
        joints = joints + inverse @ error
        return joints, inverse


SETTLING = 300
"""Ticks before the recording during which the arm comes to rest under its unknown load."""


def plan(
    arm: Arm, motion: Picks | Reach, rng: np.random.Generator, duration: float
) -> Plan | ReachPlan:
    """Plan of the motion of one run."""
    model = reduced_model(arm)
    if isinstance(motion, Reach):
        ability = _ability(arm)
        return reach(
            motion, rng, ability=ability, tool=arm.tool, units=arm.units, duration=duration
        )
    if arm.reach is None:
        raise ScenarioError(f"{arm.name} has no table to pick from")
    data = model.createData()
    pin.framesForwardKinematics(model, data, configuration(model, np.array(arm.rest)))
    start = data.oMf[model.getFrameId(arm.tool.frame)].act(_tip(arm))
    return pick(
        motion,
        rng,
        start=start,
        tool=arm.tool,
        table=arm.table,
        reach=arm.reach,
        duration=duration,
        units=arm.units,
    )


def scene(arm: Arm, plan: Plan | ReachPlan, faults: Faults, imperfections: Imperfections) -> Scene:
    """Scene of one run."""
    model, rest = reduced_model(arm), np.array(arm.rest)
    boxes = faults.boxes_on(plan)
    world = real_world(
        arm, boxes, imperfections, frame=arm.tool.frame, point=_tip(arm), contact=arm.contact
    )
    return Scene(
        model=world,
        start=rest - faults.offsets(len(rest)),  # the encoders read the rest position
        control=_control(arm, model, plan, faults, imperfections),
        effectors=1,
        settling=SETTLING,
        noise=np.array([imperfections.force_noise]),
        changes=box_changes(world, boxes),
        forces=forces(world, (*plan.payloads, *faults.loads)),
    )


def _control(
    arm: Arm, model: Any, plan: Plan | ReachPlan, faults: Faults, imperfections: Imperfections
) -> Control:
    """Controller of the tool, or of the joints, that rests at first."""
    if isinstance(plan, ReachPlan):
        shift = faults.shift(plan.time)[:, 0] if faults.shift else np.zeros_like(plan.position)
        rest = ((SETTLING, 0), (0, 0))
        return JointControl(
            model,
            arm.tool,
            np.pad(plan.joints, rest, "edge"),
            np.pad(shift, rest),
            fastest=HIGHEST_ACCELERATION if plan.foreseen else 0.0,
        )
    gain = np.pad(faults.gain(plan.time), (SETTLING, 0), "edge")
    return ToolControl(
        model,
        arm.tool.frame,
        _tip(arm),
        np.array(arm.rest),
        _shifted(plan, faults).after(SETTLING),
        gain=arm.force_gain * imperfections.force_gain * gain,
        time_constant=arm.force_filter,
    )


def _ability(arm: Arm) -> Ability:
    """What an arm can do, by its URDF and its drives."""
    model, rest = Robot.load(arm.name, floating_base=False).model, np.array(arm.rest)
    joints = [model.joints[model.getJointId(name)] for name in arm.drives.joints]
    low, high = rest - TURN, rest + TURN
    for index, joint in enumerate(joints):
        if joint.nq == 1:  # a continuous joint has no limits
            low[index] = max(low[index], model.lowerPositionLimit[joint.idx_q] + MARGIN)
            high[index] = min(high[index], model.upperPositionLimit[joint.idx_q] - MARGIN)
    speed = np.array([model.velocityLimit[joint.idx_v] for joint in joints])
    return Ability(
        reduced_model(arm),
        rest,
        low=np.minimum(low, rest),
        high=np.maximum(high, rest),
        speed=SHARE * np.where(speed > 0, speed, np.inf),
        torque=np.array(arm.drives.torque),
        armature=np.array(arm.drives.armature),
    )


def _shifted(plan: Plan, faults: Faults) -> Plan:
    if faults.shift is None:
        return plan
    return replace(plan, position=plan.position + faults.shift(plan.time)[:, 0])


def _tip(arm: Arm) -> Array:
    return np.array(arm.tool.point)
