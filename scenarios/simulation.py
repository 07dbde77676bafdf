"""From a robot, a scenario and a seed to a labelled run."""

from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from noisemodel import Run
from noisemodel.types import Array
from scenarios.clock import RATE, STEP, times
from scenarios.defects import NoDefect
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
from scenarios.robots import ROBOTS, Arm
from scenarios.table import SCENARIOS, Scenario

if TYPE_CHECKING:
    from scenarios.loop import Motion

RECIPE = 1
"""Version of all that makes a run; one more whenever a seed gives another run than before."""
DURATION = 7.0
"""How long a run lasts unless told otherwise, in [s]."""
SHORTEST = 3.0
"""Time for one approach and half a second of pressing, so that every defect can act, in [s]."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One run as it was simulated, not yet labelled."""

    motion: "Motion"
    events: tuple[Event, ...]
    faults: Faults
    imperfections: Imperfections


def simulate(robot: str, scenario: str, seed: int, *, duration: float | None = None) -> Run:
    """Simulate a robot at 10 kHz in a scenario, and label what can be felt.

    The run without the defect and with the same seed, its twin, is simulated too; labels follow
    from the difference by the rule in `scenarios.labels`. The twin is the ``ok`` run of the seed.

    Args:
        robot: A name in ``scenarios.ROBOTS``.
        scenario: A name in ``scenarios.SCENARIOS``.
        seed: Draws the motion, what is imperfect about the robot, and the defect; at least 0.
        duration: How long the run shall last, in [s]; 7 unless given.

    Returns:
        The run; the same call gives the same run, bit for bit. Stages ``planned`` and
        ``commanded`` are the velocities before and after force control; ``meta`` tells what was
        drawn, and what each event left in the motion.

    Raises:
        ScenarioError: If the robot or the scenario is not known, one has no meaning on the
            other, the seed is negative, or the duration too short.
        MissingSimulatorError: If MuJoCo is not installed.
        SimulationError: If the simulation diverged.
    """
    line, arm = _look_up(robot, scenario)
    duration = DURATION if duration is None else duration
    if seed < 0:
        raise ScenarioError(f"seed {seed}: expected an integer of at least 0")
    if not SHORTEST <= duration < np.inf:
        raise ScenarioError(f"duration {duration:g} s: expected at least {SHORTEST:g} s")
    try:
        import mujoco
    except ImportError as error:
        raise MissingSimulatorError from error
    twin = _twin(robot, seed, duration)
    healthy = isinstance(line.defect, NoDefect)
    trial = twin if healthy else _try(arm, line, seed, duration)
    blocks, traces = annotate(trial.motion.velocity, twin.motion.velocity, trial.events, rate=RATE)
    motion = trial.motion
    return Run(
        time=times(len(motion.velocity), STEP),
        joint_names=arm.joints,
        velocity=_single(motion.velocity),
        position=_single(motion.position),
        velocity_desired=_single(motion.velocity_desired),
        position_desired=_single(motion.position_desired),
        stages={"planned": _single(motion.planned), "commanded": _single(motion.commanded)},
        effort=_single(motion.torque),
        robot=robot,
        blocks=blocks,
        meta={
            "source": "simulation",
            "scenario": scenario,
            "seed": int(seed),
            "duration": float(duration),
            "recipe": RECIPE,
            "mujoco": mujoco.__version__,
            "imperfections": asdict(trial.imperfections),
            "defect": dict(trial.faults.facts),
            "events": [trace.record() for trace in traces],
            "labelling": asdict(RULE),
        },
    )


def _look_up(robot: str, scenario: str) -> tuple[Scenario, Arm]:
    if robot not in ROBOTS:
        raise UnsimulatedRobotError(robot, ROBOTS)
    if scenario not in SCENARIOS:
        raise UnknownScenarioError(scenario, SCENARIOS)
    arm, line = ROBOTS[robot], SCENARIOS[scenario]
    if arm.family not in line.families:
        suited = [name for name, other in SCENARIOS.items() if arm.family in other.families]
        raise UnsuitedScenarioError(scenario, robot, suited)
    return line, arm


@lru_cache(maxsize=1)
def _twin(robot: str, seed: int, duration: float) -> Trial:
    """Simulate the run without a defect; all scenarios of a seed share it."""
    return _try(ROBOTS[robot], SCENARIOS["ok"], seed, duration)


def _try(arm: Arm, scenario: Scenario, seed: int, duration: float) -> Trial:
    """Simulate one run; each kind of chance has a stream of its own, so twins differ in one."""
    from scenarios import arm as family

    streams = np.random.SeedSequence(seed).spawn(4)
    motion, robot, sensors, defect = (np.random.default_rng(stream) for stream in streams)
    plan = family.plan(arm, motion, duration)
    imperfections = Imperfections.draw(robot, len(arm.joints))
    faults = scenario.defect.draw(defect, plan)
    try:
        moved = family.move(arm, plan, faults, imperfections, sensors)
    except DivergedError as error:
        raise SimulationError(arm.name, scenario.name, seed, error.time, error.problem) from error
    events = faults.events + family.unplanned_contacts(moved, plan)
    return Trial(moved, events, faults, imperfections)


def _single(signal: Array) -> Any:
    return signal.astype(np.float32)
