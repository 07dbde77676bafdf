"""An arm that picks from a table: plan, controller, and the scene of any arm."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from noiseclassifier.scenarios.arm_reaching import (
    HIGHEST_ACCELERATION,
    JointControl,
    ReachPlan,
    Tool,
    reach,
)
from noiseclassifier.scenarios.errors import ScenarioError
from noiseclassifier.scenarios.faults import Faults, Imperfections
from noiseclassifier.scenarios.loop import Control, Reference, Scene, force
from noiseclassifier.scenarios.motions import (
    TICK,
    Box,
    Contact,
    Picks,
    Plan,
    Reach,
    bump,
    minimum_jerk,
)
from noiseclassifier.scenarios.robots import Arm
from noiseclassifier.scenarios.world import box_changes, real_world
from noisemodel.types import Array

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


def pick(arm: Arm, motion: Picks, rng: np.random.Generator, duration: float) -> PickPlan:
    """Plan of picks, one after the other."""
    if arm.reach is None:
        raise ScenarioError(f"{arm.name} has no table to pick from")
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


def _place(rng: np.random.Generator, area: Any) -> tuple[float, float]:
    """A place in ranges of x and y."""
    return float(rng.uniform(*area[0])), float(rng.uniform(*area[1]))


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


def _one_flight(rng: np.random.Generator, table: float, area: Any) -> list[Segment]:
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
        place, lever, rotation, jacobian = self._tool.jacobian(joints)
        turn = rotation.T @ pin.rpy.rpyToMatrix(0.0, 0.0, yaw) @ self._upright
        error = np.concatenate((tip - place - lever, rotation @ pin.log3(turn)))
        damped = jacobian @ jacobian.T + 1e-8 * np.eye(6)
        inverse = jacobian.T @ np.linalg.inv(damped)
        joints = joints + inverse @ error
        return joints, inverse


SETTLING = 300
"""Ticks before the recording during which the arm comes to rest under its unknown load."""


def plan(arm: Arm, motion: Picks | Reach, rng: np.random.Generator, duration: float) -> Plan:
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
        control=_control(arm, plan, faults, imperfections),
        effectors=1,
        settling=SETTLING,
        noise=np.array([imperfections.force_noise]),
        changes=box_changes(world, boxes),
        forces=tuple(force(world, load) for load in (*plan.payloads, *faults.loads)),
    )


def _control(arm: Arm, plan: Plan, faults: Faults, imperfections: Imperfections) -> Control:
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
