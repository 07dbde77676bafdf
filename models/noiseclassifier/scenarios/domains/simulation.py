"""Runs of wide domains, from a robot, a fault and a seed."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np

from noiseclassifier.scenarios.clock import RATE, STEP, TICK, times
from noiseclassifier.scenarios.contacts import unplanned
from noiseclassifier.scenarios.domains.distribution import DISTRIBUTION, Distribution
from noiseclassifier.scenarios.domains.domain import Domain
from noiseclassifier.scenarios.domains.faults import FAULTS, NONE
from noiseclassifier.scenarios.drivetrain import Drivetrain
from noiseclassifier.scenarios.errors import (
    DivergedError,
    ScenarioError,
    SimulationError,
    UnsimulatedRobotError,
    UnsuitedScenarioError,
)
from noiseclassifier.scenarios.events import Event
from noiseclassifier.scenarios.faults import Faults
from noiseclassifier.scenarios.imperfections import Imperfections
from noiseclassifier.scenarios.labels import RULE, annotate
from noiseclassifier.scenarios.limits import Limits
from noiseclassifier.scenarios.robots import WIDE, Simulated
from noiseclassifier.scenarios.simulation import recorded, software
from noisemodel import Run, decimated
from noisemodel.types import Array

if TYPE_CHECKING:
    from noiseclassifier.scenarios.loop import Motion

RECIPE = 2
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


LAG = 0.6
"""Most phase that delay and filters take from a velocity loop at its crossover, in [rad]."""
MARGIN = 0.5
"""Most of the damping that they take from a position loop."""
SOFT = 0.5
"""Scale of the position gains below which a robot moves as one with soft drives."""
SAME = 0.1
"""Contacts of a run and of its twin are the same if they start so close together, in [s]."""


RATTLE = 0.15
"""Share of a fault-free motion above ``FAST`` from which on its drives rattle: no good run."""
FAST, AUDIBLE = 40.0, 0.3
"""Lowest frequency of rattling, in [Hz], and its least level, in [rad/s]."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One simulated run without labels."""

    motion: "Motion"
    injected: tuple[Event, ...]
    contacts: tuple[Event, ...]
    facts: Mapping[str, Any]
    domain: Domain
    description: str


def faults_of(robot: str, seed: int | None = None) -> tuple[str, ...]:
    """Names of the faults of a robot: of its drives and commands, and its family's own."""
    entry = _look_up(robot)
    family = _family(entry)
    own = family.DEFECTS if seed is None else family.suited(_draw(entry, seed).motion)
    return (*FAULTS, *own)


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
        duration: Duration of the run, in [s].

    Returns:
        The run, as the drives report it, at ``SLOW`` or at 10 kHz; stage ``planned`` is the
        velocity of the plan. ``effort`` is the torque of the drives after gears, limits and
        delays, before the friction of the joints; ``meta`` has its limit of each joint, in [N m],
        the domain, the drawn fault and all events.
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
    events = () if fault == GOOD else (*trial.injected, *_further(trial, twin))
    blocks, traces = annotate(trial.motion.velocity, twin.motion.velocity, events, rate=RATE)
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
            "versions": software(),
            "domain": trial.domain.as_dict(),
            "motion": trial.description,
            "effort_limit": [trial.domain.torque_limit * one for one in entry.drives.torque],
            "defect": dict(trial.facts),
            "events": [trace.record() for trace in traces],
            "labelling": asdict(RULE),
        },
    )


def kept(motion: "Motion", rate: float, **facts: Any) -> Run:
    """What is kept of a recording: positions, velocities, torques, single precision, at a rate."""

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
            "torque": single(motion.torque),
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
        effort=stages.pop("torque"),
        stages=stages,
    )


def _further(trial: Trial, twin: Trial) -> list[Event]:
    """Unplanned contacts of a run that its twin does not have: soft legs scuff."""
    return [
        contact
        for contact in trial.contacts
        if not any(
            abs(contact.start - other.start) < SAME
            and contact.facts["effector"] == other.facts["effector"]
            for other in twin.contacts
        )
    ]


def _look_up(robot: str) -> Simulated:
    if robot not in WIDE:
        raise UnsimulatedRobotError(robot, WIDE)
    return WIDE[robot]


def _family(robot: Simulated) -> Any:
    return import_module(f"noiseclassifier.scenarios.{robot.family}.domains")


@lru_cache(maxsize=1)
def _twin(robot: str, seed: int, duration: float, distribution: Distribution) -> Trial:
    twin = _trial(WIDE[robot], GOOD, seed, duration, distribution)
    _refuse_rattling(twin.motion.velocity)
    return twin


def _refuse_rattling(velocity: Array) -> None:
    """Refuse a run without a fault whose drives rattle all the same."""
    from scipy.signal import butter, sosfilt

    fast = sosfilt(butter(2, FAST, "highpass", fs=RATE, output="sos"), velocity, axis=0)
    level, whole = (
        float(np.sqrt(np.median(np.square(signal).sum(axis=1)))) for signal in (fast, velocity)
    )
    if level > max(AUDIBLE, RATTLE * whole):
        raise DivergedError(0.0, f"it rattles without a fault, at {level:.2g} rad/s")


def _trial(
    nominal: Simulated, fault: str, seed: int, duration: float, distribution: Distribution
) -> Trial:
    """One run; each kind of randomness has its own stream, so that twins differ in one only."""
    from noiseclassifier.scenarios.domains.drives import DomainDrives

    family, module = (
        _family(nominal),
        import_module(f"noiseclassifier.scenarios.{nominal.family}.scene"),
    )
    drawn = _draw(nominal, seed, distribution)
    planned, body, gears, sensors, faulty = drawn.streams
    robot, domain, motion = drawn.robot, drawn.domain, drawn.motion
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
    recording = recorded(scene, drives, plan, faults, imperfections, sensors)
    injected = (*faults.events, *([drive.event] if drive.event else ()), *scene.events)
    return Trial(
        recording,
        injected,
        unplanned(recording.contact, plan.contacts),
        {**faults.facts, **drive.facts},
        domain,
        repr(motion),
    )


@dataclass(frozen=True)
class Drawn:
    """What a seed draws before the plan."""

    robot: Simulated
    domain: Domain
    motion: Any
    streams: tuple[np.random.Generator, ...]


def _draw(nominal: Simulated, seed: int, distribution: Distribution = DISTRIBUTION) -> Drawn:
    family = _family(nominal)
    streams = np.random.SeedSequence((seed, crc32(nominal.name.encode()))).spawn(7)
    domains, motions, *others = map(np.random.default_rng, streams)
    limits: Limits = family.LIMITS
    robot, domain = _changed(nominal, distribution.domain(domains, limits))
    soft = domain.stiffness < SOFT or domain.policy_rate > 0
    motion = family.motion(motions, domain.wildness, nominal, soft=soft)
    return Drawn(family.scaled(robot, domain.length), domain, motion, tuple(others))


def _changed(robot: Simulated, domain: Domain) -> tuple[Simulated, Domain]:
    """The robot with the drives of the domain, its delay no longer than its gains bear.

    A velocity loop of gain d on an inertia J crosses over at d/J, and a delay t takes t k of the
    damping d: whoever builds a robot leaves a margin to both. The rotor alone is the least
    inertia that a loop can have. Where filters of the velocity leave no margin, gains are lower.
    """
    from noiseclassifier.scenarios.domains.drives import LOAD_SHARE

    def scaled(values: tuple[float, ...], factor: float) -> tuple[float, ...]:
        return tuple(factor * value for value in values)

    nominal = robot.drives
    inertia = np.array(nominal.armature) * domain.rotor
    lag = STEP + domain.torque_rise / 2 + 1 / (np.pi * domain.encoder_bandwidth)
    damping = np.minimum(domain.damping * np.array(nominal.damping), LAG * inertia / lag)
    stiffness = domain.stiffness * np.array(nominal.stiffness)
    stiffness = np.minimum(stiffness, np.minimum(damping**2 / inertia, MARGIN * damping / lag))
    bearable = np.minimum(LAG * inertia / damping, MARGIN * damping / stiffness).min() - lag
    domain = replace(domain, delay=float(np.clip(domain.delay, 0.0, max(bearable, 0.0))))
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
    return replace(robot, drives=drives), domain


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
