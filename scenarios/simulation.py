"""From a robot, a scenario and a seed to a labelled run."""

from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from noisemodel import Run
from noisemodel.types import Array
from scenarios.case import Case
from scenarios.clock import RATE, STEP, STEPS, times
from scenarios.contacts import unplanned
from scenarios.defects import Plan
from scenarios.errors import (
    DivergedError,
    MissingSimulatorError,
    ScenarioError,
    SimulationError,
    UnknownScenarioError,
    UnsimulatedRobotError,
    UnsuitedScenarioError,
)
from scenarios.events import Event
from scenarios.faults import Faults
from scenarios.imperfections import Imperfections
from scenarios.labels import RULE, annotate
from scenarios.robots import ROBOTS, Simulated
from scenarios.table import SCENARIOS, Scenario

if TYPE_CHECKING:
    from scenarios.loop import Motion, Scene

RECIPE = 2
"""Version of all that makes a run; one more whenever a seed gives another run than before."""
SHORTEST = 3.0
"""Time in which every defect can act, in [s]."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One run as it was simulated, not yet labelled."""

    motion: "Motion"
    events: tuple[Event, ...]
    faults: Faults
    imperfections: Imperfections


def simulate(robot: str, scenario: str | int, seed: int, *, duration: float | None = None) -> Run:
    """Simulate a robot at 10 kHz in a scenario, and label what can be felt.

    The run without the defect and with the same seed, its twin, is simulated too; labels follow
    from the difference by the rule in `scenarios.labels`. The twin is a run in which the robot
    does the same with nothing wrong; scenarios in which it does the same share it.

    Args:
        robot: A name in ``scenarios.ROBOTS``.
        scenario: A name in ``scenarios.SCENARIOS``, or its number.
        seed: Draws the motion, what is imperfect about the robot, and the defect; at least 0.
        duration: How long the run shall last, in [s]; the motion's own unless given.

    Returns:
        The run; the same call gives the same run, bit for bit. Stages ``planned`` and
        ``commanded`` are the velocities before and after feedback; ``meta`` tells what was
        drawn, and what each event left in the motion.

    Raises:
        ScenarioError: If the robot or the scenario is not known, one has no meaning on the
            other, the seed is negative, or the duration too short.
        MissingSimulatorError: If MuJoCo is not installed.
        SimulationError: If the simulation diverged, or the robot fell.
    """
    line, machine = look_up(robot, scenario)
    case = line.cases[machine.family]
    duration = case.motion.duration if duration is None else duration
    if seed < 0:
        raise ScenarioError(f"seed {seed}: expected an integer of at least 0")
    if not SHORTEST <= duration < np.inf:
        raise ScenarioError(f"duration {duration:g} s: expected at least {SHORTEST:g} s")
    try:
        import mujoco
    except ImportError as error:
        raise MissingSimulatorError from error
    import pinocchio

    try:
        twin = _twin(robot, Case(case.motion), seed, duration)
        trial = twin if line.healthy else _try(machine, case, seed, duration)
    except DivergedError as error:
        raise SimulationError(robot, line.name, seed, error.time, error.problem) from error
    blocks, traces = annotate(trial.motion.velocity, twin.motion.velocity, trial.events, rate=RATE)
    motion = trial.motion
    held = [joint for joint, angle in machine.held.items() if angle]
    still = np.zeros((len(motion.velocity), len(held)))
    posture = still + [machine.held[joint] for joint in held]

    def whole(signal: Array, others: Array = still) -> Any:
        return np.hstack((signal, others)).astype(np.float32)

    return Run(
        time=times(len(motion.velocity), STEP),
        joint_names=(*machine.drives.joints, *held),
        velocity=whole(motion.velocity),
        position=whole(motion.position, posture),
        velocity_desired=whole(motion.velocity_desired),
        position_desired=whole(motion.position_desired, posture),
        stages={"planned": whole(motion.planned), "commanded": whole(motion.commanded)},
        effort=whole(motion.torque),
        **_base(motion),
        robot=robot,
        blocks=blocks,
        meta={
            "source": "simulation",
            "scenario": line.name,
            "number": line.number,
            "seed": int(seed),
            "duration": float(duration),
            "recipe": RECIPE,
            "versions": {
                "mujoco": mujoco.__version__,
                "pinocchio": pinocchio.__version__,
                "numpy": np.__version__,
            },
            "motion": asdict(case.motion),
            "imperfections": asdict(trial.imperfections),
            "defect": dict(trial.faults.facts),
            "events": [trace.record() for trace in traces],
            "labelling": asdict(RULE),
        },
    )


def look_up(robot: str, scenario: str | int) -> tuple[Scenario, Simulated]:
    """Find a scenario and a robot that go together.

    Args:
        robot: A name in ``scenarios.ROBOTS``.
        scenario: A name in ``scenarios.SCENARIOS``, or its number.

    Returns:
        Both.

    Raises:
        ScenarioError: If one is not known, or has no meaning on the other.
    """
    if robot not in ROBOTS:
        raise UnsimulatedRobotError(robot, ROBOTS)
    numbers = {str(line.number): name for name, line in SCENARIOS.items()}
    name = numbers.get(str(scenario), str(scenario))
    if name not in SCENARIOS:
        raise UnknownScenarioError(name, SCENARIOS)
    machine, line = ROBOTS[robot], SCENARIOS[name]
    if machine.family not in line.cases:
        suited = [name for name, other in SCENARIOS.items() if machine.family in other.cases]
        raise UnsuitedScenarioError(name, robot, suited)
    return line, machine


@lru_cache(maxsize=1)
def _twin(robot: str, healthy: Case, seed: int, duration: float) -> Trial:
    """Simulate the run without a defect; scenarios of one motion and seed share it."""
    return _try(ROBOTS[robot], healthy, seed, duration)


def _try(robot: Simulated, case: Case, seed: int, duration: float) -> Trial:
    """Simulate one run; each kind of chance has a stream of its own, so twins differ in one."""
    family = import_module(f"scenarios.{robot.family}.scene")
    streams = np.random.SeedSequence(seed).spawn(4)
    motion, machine, sensors, defect = (np.random.default_rng(stream) for stream in streams)
    plan: Plan = family.plan(robot, case.motion, motion, duration)
    imperfections = Imperfections.draw(
        machine,
        len(robot.drives.joints),
        bodies=family.bodies(robot),
        payload=robot.payload,
        force=robot.force_noise,
    )
    faults = case.defect.draw(defect, plan)
    scene = family.scene(robot, plan, faults, imperfections)
    moved = _move(robot, scene, plan, faults, imperfections, sensors)
    return Trial(
        moved, faults.events + unplanned(moved.contact, plan.contacts), faults, imperfections
    )


def _move(
    robot: Simulated,
    scene: "Scene",
    plan: Plan,
    faults: Faults,
    imperfections: Imperfections,
    rng: np.random.Generator,
) -> "Motion":
    """Give the robot its drives and its sensors' errors, and let it move."""
    from scenarios.drives import Drives
    from scenarios.loop import record
    from scenarios.sensing import sensors_of

    given = robot.drives
    joints = len(given.joints)
    drives = Drives(
        scene.start[-joints:],
        stiffness=np.array(given.stiffness) * imperfections.stiffness,
        damping=np.array(given.damping) * imperfections.damping,
        limit=np.array(given.torque),
        offset=faults.offsets(joints),
        imperfections=imperfections,
        step=STEP,
    )
    moving = len(plan.time)
    ticks = scene.settling + moving
    sensor_error = scene.noise * rng.standard_normal((ticks, len(scene.noise)))
    where = sensors_of(scene.model)
    for name, signal in faults.sensors.items():
        sensor_error[scene.settling :, where[name]] += signal(plan.time)
    overlay = None
    if faults.overlay is not None:
        overlay = np.zeros((ticks * STEPS, scene.effectors, 2))
        overlay[scene.settling * STEPS :] = faults.overlay(times(moving * STEPS, STEP))
    noise = rng.standard_normal((ticks * STEPS, joints))
    return record(
        scene,
        drives,
        encoder_error=imperfections.encoder_noise * noise + faults.offsets(joints),
        sensor_error=sensor_error,
        overlay=overlay,
    )


def _base(motion: "Motion") -> dict[str, Any]:
    """Turn a floating base from MuJoCo's conventions to Pinocchio's; nothing if it is fixed."""
    if not motion.base_pose.size:
        return {}
    from scenarios.base import pinocchio_base

    pose, velocity = pinocchio_base(motion.base_pose, motion.base_velocity)
    return {"base_pose": pose.astype(np.float32), "base_velocity": velocity.astype(np.float32)}
