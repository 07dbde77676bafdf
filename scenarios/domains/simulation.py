"""Runs of wide domains, from a robot, a fault and a seed."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np

from noisemodel import Run, decimated
from scenarios.clock import RATE, STEP, TICK, times
from scenarios.contacts import unplanned
from scenarios.domains.distribution import DISTRIBUTION, Distribution
from scenarios.domains.domain import Domain
from scenarios.domains.faults import FAULTS, NONE
from scenarios.drivetrain import Drivetrain
from scenarios.errors import (
    DivergedError,
    ScenarioError,
    SimulationError,
    UnsimulatedRobotError,
    UnsuitedScenarioError,
)
from scenarios.events import Event
from scenarios.faults import Faults
from scenarios.imperfections import Imperfections
from scenarios.labels import RULE, annotate
from scenarios.limits import Limits
from scenarios.robots import WIDE, Simulated
from scenarios.simulation import recorded

if TYPE_CHECKING:
    from scenarios.loop import Motion

RECIPE = 1
"""Version of these simulations; it increases whenever a seed gives another run than before."""
GOOD = "good"
"""Name of a run without a fault, the twin of those of its robot and seed."""
FIRST = 10_000
"""Least seed: names of these runs differ from those of the scenarios at home."""
DURATION = 6.0
"""Of a run, in [s]."""
SLOW = 2000.0
"""Rate at which most runs are kept, in [Hz]."""
FAST_SHARE = 0.15
"""Share of the seeds whose runs are kept at 10 kHz."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One simulated run without labels."""

    motion: "Motion"
    events: tuple[Event, ...]
    facts: Mapping[str, Any]
    domain: Domain
    description: str


def faults_of(robot: str) -> tuple[str, ...]:
    """Names of the faults of a robot: of its drives and commands, and its family's own.

    Args:
        robot: A name in ``scenarios.robots.WIDE``.

    Raises:
        UnsimulatedRobotError: If there is no such robot.
    """
    return (*FAULTS, *_family(_look_up(robot)).DEFECTS)


def simulate(
    robot: str,
    fault: str,
    seed: int,
    *,
    duration: float | None = None,
    distribution: Distribution = DISTRIBUTION,
) -> Run:
    """Labelled run of a robot in a domain that a seed draws.

    Equal robots and seeds share body, drives, control and motion, whatever the fault.

    Args:
        robot: A name in ``scenarios.robots.WIDE``.
        fault: One of `faults_of`, or ``good`` for none.
        seed: Random seed, at least ``FIRST``.
        duration: Duration of the run, in [s].
        distribution: What is drawn from.

    Returns:
        The run, as the drives report it, at ``SLOW`` or at 10 kHz; stage ``planned`` is the
        velocity of the plan. ``meta`` has the domain, the drawn fault and all events.

    Raises:
        ScenarioError: If the robot or the fault is unknown, or the seed is too low.
        SimulationError: If the simulation diverged, or the robot fell.
    """
    entry = _look_up(robot)
    if fault != GOOD and fault not in faults_of(robot):
        raise UnsuitedScenarioError(fault, robot, (GOOD, *faults_of(robot)))
    if seed < FIRST:
        raise ScenarioError(f"seed {seed}: expected at least {FIRST}")
    seconds = DURATION if duration is None else duration
    try:
        twin = _twin(robot, seed, seconds, distribution)
        trial = twin if fault == GOOD else _trial(entry, fault, seed, seconds, distribution)
    except DivergedError as error:
        raise SimulationError(robot, fault, seed, error.time, error.problem) from error
    blocks, traces = annotate(trial.motion.velocity, twin.motion.velocity, trial.events, rate=RATE)
    rate = RATE if np.random.default_rng((seed, 1)).uniform() < FAST_SHARE else SLOW
    return kept(
        trial.motion,
        rate,
        joint_names=entry.drives.joints,
        robot=robot,
        blocks=blocks,
        meta={
            "source": "simulation",
            "simulator": "mujoco",
            "scenario": fault,
            "seed": int(seed),
            "duration": seconds,
            "recipe": f"domains {RECIPE}",
            "domain": trial.domain.as_dict(),
            "motion": trial.description,
            "defect": dict(trial.facts),
            "events": [trace.record() for trace in traces],
            "labelling": asdict(RULE),
        },
    )


def kept(motion: "Motion", rate: float, **facts: Any) -> Run:
    """What is kept of a recording: positions and velocities, single precision, at a rate."""

    def single(signal: Any) -> Any:
        return signal.astype(np.float32)

    run = Run(
        time=times(len(motion.velocity), STEP),
        velocity=single(motion.velocity),
        velocity_desired=single(motion.velocity_desired),
        stages={
            "planned": single(motion.planned),
            "position": single(motion.position),
            "target": single(motion.position_desired),
        },
        **facts,
    )
    run = decimated(run, rate)
    stages = {name: single(stage) for name, stage in run.stages.items()}
    return replace(
        run,
        velocity=single(run.velocity),
        velocity_desired=single(run.velocity_desired),
        position=stages.pop("position"),
        position_desired=stages.pop("target"),
        stages=stages,
    )


def _look_up(robot: str) -> Simulated:
    if robot not in WIDE:
        raise UnsimulatedRobotError(robot, WIDE)
    return WIDE[robot]


def _family(robot: Simulated) -> Any:
    return import_module(f"scenarios.{robot.family}.domains")


@lru_cache(maxsize=1)
def _twin(robot: str, seed: int, duration: float, distribution: Distribution) -> Trial:
    return _trial(WIDE[robot], GOOD, seed, duration, distribution)


def _trial(
    nominal: Simulated, fault: str, seed: int, duration: float, distribution: Distribution
) -> Trial:
    """One run; each kind of randomness has its own stream, so that twins differ in one only."""
    from scenarios.domains.drives import DomainDrives

    family, module = _family(nominal), import_module(f"scenarios.{nominal.family}.scene")
    streams = np.random.SeedSequence((seed, crc32(nominal.name.encode()))).spawn(7)
    drawn, moving, planned, body, gears, sensors, faulty = map(np.random.default_rng, streams)
    limits: Limits = family.LIMITS
    domain = distribution.domain(drawn, limits, softest=family.FEEDFORWARD)
    robot = _changed(family.scaled(nominal, domain.length), domain)
    motion = family.motion(moving, domain.wildness)
    plan = module.plan(robot, motion, planned, duration)
    imperfections = _imperfections(robot, domain, body, bodies=module.bodies(robot))
    faults, drive = Faults(), NONE
    if fault in FAULTS:
        drive = FAULTS[fault](faulty, robot.drives, duration)
    elif fault != GOOD:
        faults = family.DEFECTS[fault].draw(faulty, plan)
    scene = module.scene(robot, plan, faults, imperfections)
    drives = DomainDrives(
        scene.start[-len(robot.drives.joints) :],
        domain=domain,
        drivetrain=robot.drives,
        imperfections=imperfections,
        fault=drive,
        offset=faults.offsets(len(robot.drives.joints)),
        settling=scene.settling * TICK,
        rng=gears,
    )
    motion_made = recorded(scene, drives, plan, faults, imperfections, sensors)
    events = (*faults.events, *([drive.event] if drive.event else ()))
    return Trial(
        motion_made,
        events + unplanned(motion_made.contact, plan.contacts),
        {**faults.facts, **drive.facts},
        domain,
        repr(motion),
    )


LAG = 0.6
"""Most phase that delay and filters take from a velocity loop at its crossover, in [rad]."""


def _changed(robot: Simulated, domain: Domain) -> Simulated:
    """The robot with the drives of the domain, its gains no higher than its delays allow.

    A velocity loop of gain d on an inertia J crosses over at d/J; whoever tunes a robot lowers its
    gains until the lag there leaves a margin. The rotor alone is the least inertia that a loop
    can have.
    """
    from scenarios.domains.drives import LOAD_SHARE

    def scaled(values: tuple[float, ...], factor: float) -> tuple[float, ...]:
        return tuple(factor * value for value in values)

    nominal = robot.drives
    lag = STEP + domain.delay + domain.torque_rise / 2 + 1 / (np.pi * domain.encoder_bandwidth)
    inertia = np.array(nominal.armature) * domain.rotor
    damping = np.minimum(domain.damping * np.array(nominal.damping), LAG * inertia / lag)
    stiffness = np.minimum(domain.stiffness * np.array(nominal.stiffness), damping**2 / inertia)
    rotor = domain.rotor * (LOAD_SHARE if domain.flexibility else 1.0)
    drives = Drivetrain(
        joints=nominal.joints,
        stiffness=tuple(stiffness.tolist()),
        damping=tuple(damping.tolist()),
        torque=scaled(nominal.torque, domain.torque_limit),
        armature=scaled(nominal.armature, rotor),
        friction=scaled(nominal.friction, domain.friction),
        viscous=scaled(nominal.viscous, domain.viscous),
    )
    return replace(robot, drives=drives)


def _imperfections(
    robot: Simulated, domain: Domain, rng: np.random.Generator, *, bodies: int
) -> Imperfections:
    """What differs from joint to joint and from body to body."""
    joints = len(robot.drives.joints)

    def scales(spread: float, count: int = joints) -> tuple[float, ...]:
        return tuple(rng.uniform(1 - spread, 1 + spread, count).tolist())

    return Imperfections(
        stiffness=scales(0.1),
        damping=scales(0.1),
        force_gain=float(rng.uniform(0.9, 1.1)),
        mass=tuple((domain.mass * np.array(scales(0.05, bodies))).tolist()),
        payload=domain.payload * robot.payload,
        friction=scales(0.3),
        viscous=scales(0.3),
        encoder_bits=domain.encoder_bits,
        encoder_noise=float(0.1 * 2 * np.pi / 2**domain.encoder_bits),
        encoder_bandwidth=domain.encoder_bandwidth,
        force_noise=float(rng.uniform(0.25, 1.0)) * robot.force_noise,
        torque_delay=round(domain.delay * RATE),
    )
