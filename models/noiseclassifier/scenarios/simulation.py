"""Labelled runs, from a robot, a scenario and a seed."""

from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from noiseclassifier.scenarios.case import Case
from noiseclassifier.scenarios.clock import RATE, STEP, STEPS, times
from noiseclassifier.scenarios.contacts import unplanned
from noiseclassifier.scenarios.defects import Plan
from noiseclassifier.scenarios.errors import (
    DivergedError,
    MissingSimulatorError,
    ScenarioError,
    SimulationError,
    UnknownScenarioError,
    UnsimulatedRobotError,
    UnsuitedScenarioError,
)
from noiseclassifier.scenarios.events import Event
from noiseclassifier.scenarios.faults import Faults
from noiseclassifier.scenarios.imperfections import Imperfections
from noiseclassifier.scenarios.labels import RULE, annotate
from noiseclassifier.scenarios.robots import ROBOTS, Simulated
from noiseclassifier.scenarios.table import SCENARIOS, Scenario
from noisemodel import Run
from noisemodel.types import Array

if TYPE_CHECKING:
    from noiseclassifier.scenarios.drives import Drives
    from noiseclassifier.scenarios.loop import Motion, Scene

RECIPE = 3
"""Version of the simulation; it increases whenever a seed gives another run than before."""
SHORTEST = 3.0
"""Least duration, in which every defect can act, in [s]."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One simulated run without labels."""

    motion: "Motion"
    events: tuple[Event, ...]
    faults: Faults
    imperfections: Imperfections


def simulate(robot: str, scenario: str | int, seed: int, *, duration: float | None = None) -> Run:
    """Labelled run of a robot in a scenario, simulated at 10 kHz.

    The run without the defect and with the same seed, its twin, is simulated too; labels follow
    from the difference by the rule in `scenarios.labels`. Scenarios with the same motion share
    their twin.

    Args:
        duration: Duration of the run, in [s]; by default that of the motion.
    """
    entry, simulated = look_up(robot, scenario)
    case = entry.cases[simulated.family]
    duration = case.motion.duration if duration is None else duration
    if seed < 0:
        raise ScenarioError(f"seed {seed}: expected an integer of at least 0")
    if not SHORTEST <= duration < np.inf:
        raise ScenarioError(f"duration {duration:g} s: expected at least {SHORTEST:g} s")
    versions = software()
    try:
        twin = _twin(robot, Case(case.motion), seed, duration)
        trial = twin if entry.healthy else _trial(simulated, case, seed, duration)
    except DivergedError as error:
        raise SimulationError(robot, entry.name, seed, error.time, error.problem) from error
    blocks, traces = annotate(trial.motion.velocity, twin.motion.velocity, trial.events, rate=RATE)
    motion = trial.motion
    held = [joint for joint, angle in simulated.held.items() if angle]
    still = np.zeros((len(motion.velocity), len(held)))
    posture = still + [simulated.held[joint] for joint in held]

    def whole(signal: Array, others: Array = still) -> Any:
        return np.hstack((signal, others)).astype(np.float32)

    return Run(
        time=times(len(motion.velocity), STEP),
        joint_names=(*simulated.drives.joints, *held),
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
            "scenario": entry.name,
            "number": entry.number,
            "seed": int(seed),
            "duration": float(duration),
            "recipe": RECIPE,
            "versions": versions,
            "motion": asdict(case.motion),
            "imperfections": asdict(trial.imperfections),
            "defect": dict(trial.faults.facts),
            "events": [trace.record() for trace in traces],
            "labelling": asdict(RULE),
        },
    )


def software() -> dict[str, str]:
    """Versions of the software on which a simulated run depends, by name."""
    try:
        import mujoco
    except ImportError as error:
        raise MissingSimulatorError from error
    import pinocchio

    modules = {"mujoco": mujoco, "pinocchio": pinocchio, "numpy": np}
    return {name: str(module.__version__) for name, module in modules.items()}


def look_up(robot: str, scenario: str | int) -> tuple[Scenario, Simulated]:
    """A scenario and a robot by their names."""
    if robot not in ROBOTS:
        raise UnsimulatedRobotError(robot, ROBOTS)
    numbers = {str(entry.number): name for name, entry in SCENARIOS.items()}
    name = numbers.get(str(scenario), str(scenario))
    if name not in SCENARIOS:
        raise UnknownScenarioError(name, SCENARIOS)
    simulated, entry = ROBOTS[robot], SCENARIOS[name]
    if simulated.family not in entry.cases:
        suited = [name for name, other in SCENARIOS.items() if simulated.family in other.cases]
        raise UnsuitedScenarioError(name, robot, suited)
    return entry, simulated


@lru_cache(maxsize=1)
def _twin(robot: str, healthy: Case, seed: int, duration: float) -> Trial:
    """Run without the defect; scenarios of one motion and seed share it."""
    return _trial(ROBOTS[robot], healthy, seed, duration)


def _trial(robot: Simulated, case: Case, seed: int, duration: float) -> Trial:
    """One run; each kind of randomness has its own stream, so that twins differ in one only."""
    family = import_module(f"noiseclassifier.scenarios.{robot.family}.scene")
    streams = np.random.SeedSequence(seed).spawn(4)
    motion, robot_rng, sensors, defect = (np.random.default_rng(stream) for stream in streams)
    plan: Plan = family.plan(robot, case.motion, motion, duration)
    imperfections = Imperfections.draw(
        robot_rng,
        len(robot.drives.joints),
        bodies=family.bodies(robot),
        payload=robot.payload,
        force=robot.force_noise,
    )
    faults = case.defect.draw(defect, plan)
    scene = family.scene(robot, plan, faults, imperfections)
    recorded = _record(robot, scene, plan, faults, imperfections, sensors)
    events = faults.events + unplanned(recorded.contact, plan.contacts) + scene.events
    return Trial(recorded, events, faults, imperfections)


def _record(
    robot: Simulated,
    scene: "Scene",
    plan: Plan,
    faults: Faults,
    imperfections: Imperfections,
    rng: np.random.Generator,
) -> "Motion":
    """Record the scene with the drives of the robot and the errors of its sensors."""
    from noiseclassifier.scenarios.drives import Drives

    nominal = robot.drives
    joints = len(nominal.joints)
    drives = Drives(
        scene.start[-joints:],
        stiffness=np.array(nominal.stiffness) * imperfections.stiffness,
        damping=np.array(nominal.damping) * imperfections.damping,
        limit=np.array(nominal.torque),
        offset=faults.offsets(joints),
        imperfections=imperfections,
        step=STEP,
    )
    return recorded(scene, drives, plan, faults, imperfections, rng)


def recorded(
    scene: "Scene",
    drives: "Drives",
    plan: Plan,
    faults: Faults,
    imperfections: Imperfections,
    rng: np.random.Generator,
) -> "Motion":
    """Record a scene with given drives."""
    from noiseclassifier.scenarios.loop import record
    from noiseclassifier.scenarios.sensing import sensors_of

    recording, joints = len(plan.time), scene.model.nu
    ticks = scene.settling + recording
    sensor_error = scene.noise * rng.standard_normal((ticks, len(scene.noise)))
    where = sensors_of(scene.model)
    for name, signal in faults.sensors.items():
        sensor_error[scene.settling :, where[name]] += signal(plan.time)
    overlay = None
    if faults.overlay is not None:
        overlay = np.zeros((ticks * STEPS, scene.effectors, 2))
        overlay[scene.settling * STEPS :] = faults.overlay(times(recording * STEPS, STEP))
    noise = rng.standard_normal((ticks * STEPS, joints))
    return record(
        scene,
        drives,
        encoder_error=imperfections.encoder_noise * noise + faults.offsets(joints),
        sensor_error=sensor_error,
        overlay=overlay,
    )


def _base(motion: "Motion") -> dict[str, Any]:
    """Pose and velocity of a floating base in Pinocchio's conventions; empty if it is fixed."""
    if not motion.base_pose.size:
        return {}
    from noiseclassifier.scenarios.floatingbase import pinocchio_base

    pose, velocity = pinocchio_base(motion.base_pose, motion.base_velocity)
    return {"base_pose": pose.astype(np.float32), "base_velocity": velocity.astype(np.float32)}
