"""An arm that picks from a table: what it does, what is imperfect about it, what is wrong."""

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from noisemodel import Robot
from noisemodel.types import Array
from scenarios.clock import STEP, STEPS, times
from scenarios.control import ToolControl
from scenarios.drives import Drives
from scenarios.events import Event
from scenarios.faults import Faults
from scenarios.imperfections import Imperfections, real_model
from scenarios.loop import Motion, record
from scenarios.mujoco_model import Physics, build
from scenarios.picking import Plan, pick
from scenarios.robots import Arm
from scenarios.shapes import Box

SETTLING = 300
"""Ticks before the recording, in which the arm comes to rest under its unknown load."""
APART = 0.05
"""Contacts with a shorter pause between them are one, in [s]."""
BLOW = 0.02
"""Time over which the impulse of a contact is taken, in [s]."""


def plan(arm: Arm, rng: np.random.Generator, duration: float) -> Plan:
    """Plan the motion of one run.

    Args:
        arm: The arm.
        rng: Source of chance.
        duration: How long the run shall last, in [s].

    Returns:
        The plan.
    """
    model = reduced_model(arm)
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.array(arm.rest))
    start = data.oMf[model.getFrameId(arm.tool.frame)].act(_tip(arm))
    return pick(rng, start=start, table=arm.table, reach=arm.reach, duration=duration)


def move(
    arm: Arm, plan: Plan, faults: Faults, imperfections: Imperfections, rng: np.random.Generator
) -> Motion:
    """Simulate one run; it begins when the arm has come to rest.

    Args:
        arm: The arm.
        plan: What it is to do.
        faults: What is wrong.
        imperfections: What is imperfect about it anyway.
        rng: Source of the sensors' noise.

    Returns:
        What was recorded.

    Raises:
        DivergedError: If the simulation leaves the realm of robots.
    """
    rest = np.array(arm.rest)
    offset = np.zeros(len(rest))
    for joint, angle in faults.decalibration.items():
        offset[joint] = angle
    start = rest - offset  # the encoders read the rest position
    drives = Drives(
        start,
        stiffness=np.array(arm.stiffness) * imperfections.stiffness,
        damping=np.array(arm.damping) * imperfections.damping,
        limit=np.array(arm.torque),
        offset=offset,
        imperfections=imperfections,
        step=STEP,
    )
    control = ToolControl(
        reduced_model(arm),
        arm.tool.frame,
        _tip(arm),
        rest,
        replace(plan, position=plan.position + faults.shift(plan.time)).after(SETTLING),
        gain=arm.force_gain * imperfections.force_gain * faults.force_gain,
        time_constant=arm.force_filter,
    )
    ticks = SETTLING + len(plan.time)
    sensor_error = imperfections.force_noise * rng.standard_normal((ticks, 1))
    sensor_error[SETTLING:, 0] += faults.force(plan.time)
    overlay = np.zeros((ticks * STEPS, 2))
    overlay[SETTLING * STEPS :] = faults.overlay(times(len(plan.time) * STEPS, STEP))
    noise = rng.standard_normal((ticks * STEPS, len(rest)))
    return record(
        _world(arm, faults, imperfections),
        start,
        drives,
        control,
        encoder_noise=imperfections.encoder_noise * noise,
        sensor_error=sensor_error,
        overlay=overlay,
        settling=SETTLING,
    )


def unplanned_contacts(motion: Motion, plan: Plan) -> tuple[Event, ...]:
    """Find where the tool touched what it was not to touch.

    Args:
        motion: What was recorded.
        plan: What was planned.

    Returns:
        One event per contact that begins outside of the planned ones, with its impulse in [N s]
        and its largest force in [N].
    """
    force = motion.sensors[:, 0]
    touching = np.flatnonzero(force > 0)
    if not touching.size:
        return ()
    pauses = np.flatnonzero(np.diff(touching) > APART / STEP)
    firsts = touching[np.concatenate(([0], pauses + 1))]
    lasts = touching[np.concatenate((pauses, [-1]))]
    events = []
    for first, last in zip(firsts.tolist(), lasts.tolist(), strict=True):
        onset = first * STEP
        if any(touch.start <= onset < touch.stop for touch in plan.touches):
            continue
        blow = force[first : first + round(BLOW / STEP)]
        facts = {"impulse": float(blow.sum() * STEP), "force": float(blow.max())}
        # The blow is the cause; leaning on the obstacle afterwards is none.
        stop = min(last * STEP, onset + BLOW)
        events.append(Event("impact", "unplanned contact", onset, max(stop, onset + STEP), facts))
    return tuple(events)


def reduced_model(arm: Arm) -> Any:
    """Read an arm's Pinocchio model, all joints locked that it does not move."""
    model = Robot.load(arm.name).model
    locked = [model.getJointId(name) for name in model.names[1:] if name not in arm.joints]
    return pin.buildReducedModel(model, locked, pin.neutral(model))


def _tip(arm: Arm) -> Array:
    return np.array([0.0, 0.0, arm.tool.length])


def _world(arm: Arm, faults: Faults, imperfections: Imperfections) -> Any:
    """Build the robot as it really is, its table and what lies on it."""
    real = real_model(reduced_model(arm), arm.tool.frame, _tip(arm), imperfections)
    physics = Physics(
        timestep=STEP,
        armature=np.array(arm.armature),
        damping=np.array(arm.viscous) * imperfections.viscous,
        friction=np.array(arm.friction) * imperfections.friction,
        contact=arm.contact,
    )
    table = Box(centre=(0.5, 0.0, arm.table - 0.05), half=(0.6, 1.0, 0.05))
    return build(real, physics, rods=(arm.tool,), boxes=(table, *faults.boxes))
