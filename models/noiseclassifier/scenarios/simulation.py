"""Labelled runs, from a robot, a scenario or a fault of wide domains, and a seed."""

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np

from noiseclassifier.scenarios.domains import LIMITS, MOTIONS, Domain
from noiseclassifier.scenarios.drives import LOAD_SHARE, DomainDrives, Drives
from noiseclassifier.scenarios.errors import DivergedError, ScenarioError, SimulationError, unknown
from noiseclassifier.scenarios.faults import Defect, Faults, Imperfections, no_defect
from noiseclassifier.scenarios.labels import RULE, annotate, unplanned
from noiseclassifier.scenarios.motions import RATE, STEP, STEPS, Event, Plan, multiplied, times
from noiseclassifier.scenarios.robots import ROBOTS, WIDE, Simulated
from noiseclassifier.scenarios.table import FAULTS, SCENARIOS, THROUGHOUT, Scenario, suited
from noisemodel import Run, decimated
from noisemodel.types import Array

if TYPE_CHECKING:
    from noiseclassifier.scenarios.loop import Motion, Scene

RECIPE, WIDE_RECIPE, FIRST_WIDE_RECIPE = 3, 3, 2
"""Versions of the simulations; they increase whenever a seed gives another run than before.

The third of wide domains only adds faults of whole runs: others are as in the second.
"""
SHORTEST = 3.0  # least duration of a scenario, in which every defect can act, in [s]
GOOD = "good"
"""Name of a run of wide domains without a fault, the twin of all others of its robot and seed."""
FIRST = 10_000  # least seed of wide domains: names of their runs differ from those of the scenarios
DURATION = 6.0  # of a run of wide domains, in [s]
SLOW = 2000.0  # rate at which most of these runs are kept, in [Hz]
FAST_SHARE = 0.15  # share of the seeds whose runs are kept at 10 kHz
LAG = 0.6  # most phase that delay and filters take from a velocity loop at its crossover, in [rad]
LOOP_MARGIN = 0.5  # most of the damping that they take from a position loop
SOFT = 0.5  # scale of the position gains below which a robot moves as one with soft drives
SAME = 0.1  # contacts of a run and of its twin are the same if they start so close together, in [s]
RATTLE = 0.15
"""Share of a fault-free motion above ``FAST`` from which on its drives rattle: no good run."""
FAST, AUDIBLE = 40.0, 0.3  # lowest frequency of rattling, in [Hz], and its least level, in [rad/s]


@dataclass(frozen=True)
class Start:
    """What runs with the same twin share: robot, seed, and motion; in wide domains it is drawn."""

    robot: str
    seed: int
    motion: Any = None

    @property
    def nominal(self) -> Simulated:
        """The robot, before a domain changes it."""
        return ROBOTS.get(self.robot) or WIDE[self.robot]


@dataclass(frozen=True, eq=False)
class Setup:
    """What a seed draws before the plan; each kind of randomness has a stream of its own."""

    robot: Simulated
    motion: Any
    domain: Domain | None
    planned: np.random.Generator
    body: np.random.Generator
    sensors: np.random.Generator
    faulty: np.random.Generator
    gears: np.random.Generator


@dataclass(frozen=True, eq=False)
class Trial:
    """One simulated run without labels."""

    motion: "Motion"
    events: tuple[Event, ...]
    contacts: tuple[Event, ...]
    faults: Faults
    imperfections: Imperfections
    setup: Setup


def simulate(
    robot: str, scenario: str | int, seed: int, *, duration: float | None = None, wide: bool = False
) -> Run:
    """Labelled run of a robot in a scenario, simulated at 10 kHz.

    The run without the fault and with the same seed, its twin, is simulated too; labels follow from
    the difference by the rule in `scenarios.labels`. Runs with the same motion share their twin.

    Args:
        robot: One of `ROBOTS`; in wide domains one of more robots.
        scenario: Name or number of one of `SCENARIOS`; in wide domains "good" or a fault.
        seed: Draws motion, robot, sensors and fault, and in wide domains the domain.
        duration: Duration of the run, in [s]; by default the motion's.
        wide: Whether to draw body, drives, control and motion as domains.toml says. Such a run is
            kept at 2 kHz or at 10 kHz; ``effort`` is the torque of the drives after gears, limits
            and delays, before the friction of the joints, in [N m].

    Returns:
        The run, as the drives report it; stage ``planned`` is the velocity of the plan. ``meta``
        has the recipe, the drawn fault and all events.

    Raises:
        ScenarioError: If the names or numbers are unknown, or MuJoCo is not installed.
        SimulationError: If the run diverges, or the robot falls.
    """
    find = _in_wide_domains if wide else _in_scenarios
    start, name, defect, duration = find(robot, str(scenario), seed, duration)
    versions = software()
    try:
        twin = _twin(start, duration)
        trial = twin if defect is no_defect else _trial(start, defect, duration)
    except DivergedError as error:
        raise SimulationError(robot, name, seed, error.time, error.problem) from error
    events = (*trial.events, *trial.contacts)
    if wide:  # soft legs scuff
        events = () if trial is twin else (*trial.events, *_further(trial, twin))
    blocks, traces = annotate(trial.motion.velocity, twin.motion.velocity, events, rate=RATE)
    meta = {
        "source": "simulation",
        "scenario": name,
        "seed": int(seed),
        "duration": float(duration),
        "versions": versions,
        "defect": dict(trial.faults.facts),
        "events": [trace.record() for trace in traces],
        "labelling": asdict(RULE),
        **(_facts_of_domain if wide else _facts_of_scenario)(start, name, trial),
    }
    facts = {"robot": robot, "blocks": blocks, "meta": meta}
    if not wide:
        return _whole(trial.motion, start.nominal, **facts)
    rate = RATE if np.random.default_rng((seed, 1)).uniform() < FAST_SHARE else SLOW
    return kept(trial.motion, rate, joint_names=start.nominal.drives.joints, **facts)


Found = tuple[Start, str, Defect, float]  # start, name of the scenario, defect, duration


def _in_scenarios(robot: str, scenario: str, seed: int, duration: float | None) -> Found:
    entry, simulated = look_up(robot, scenario)
    case = entry.cases[simulated.family]
    duration = case.motion.duration if duration is None else duration
    if seed < 0:
        raise ScenarioError(f"seed {seed}: expected an integer of at least 0")
    if not SHORTEST <= duration < np.inf:
        raise ScenarioError(f"duration {duration:g} s: expected at least {SHORTEST:g} s")
    defect = no_defect if entry.healthy else case.defect
    return Start(robot, seed, case.motion), entry.name, defect, duration


def _in_wide_domains(robot: str, fault: str, seed: int, duration: float | None) -> Found:
    names = (GOOD, *faults_of(robot), *THROUGHOUT)
    if fault not in names:
        raise ScenarioError(
            f"scenario {fault!r} does not exist for {robot!r}; it has {', '.join(names)}"
        )
    if seed < FIRST:
        raise ScenarioError(f"seed {seed}: expected at least {FIRST}")
    defect: Defect = {GOOD: no_defect, **THROUGHOUT, **FAULTS[WIDE[robot].family]}[fault]
    return Start(robot, seed), fault, defect, DURATION if duration is None else duration


def _facts_of_scenario(start: Start, name: str, trial: Trial) -> dict[str, Any]:
    return {
        "number": SCENARIOS[name].number,
        "recipe": RECIPE,
        "motion": asdict(start.motion),
        "imperfections": asdict(trial.imperfections),
    }


def _facts_of_domain(start: Start, name: str, trial: Trial) -> dict[str, Any]:
    domain = trial.setup.domain
    assert domain is not None
    return {
        "simulator": "mujoco",
        "recipe": f"domains {WIDE_RECIPE if name in THROUGHOUT else FIRST_WIDE_RECIPE}",
        "domain": domain.as_dict(),
        "motion": repr(trial.setup.motion),
        "effort_limit": [domain.torque_limit * one for one in start.nominal.drives.torque],
    }


def faults_of(robot: str, seed: int | None = None) -> tuple[str, ...]:
    """Names of the faults of a robot in wide domains; with a seed, of those that can act."""
    if robot not in WIDE:
        raise unknown(f"robot {robot!r} cannot be simulated", robot, WIDE)
    family = WIDE[robot].family
    if seed is None:
        return tuple(FAULTS[family])
    return suited(family, _setup(Start(robot, seed)).motion)


def robot_of(name: str) -> Simulated:
    """A robot of the scenarios."""
    if name not in ROBOTS:
        raise unknown(f"robot {name!r} cannot be simulated", name, ROBOTS)
    return ROBOTS[name]


def scenario_of(name: str) -> Scenario:
    """A scenario by its name or number."""
    numbers = {str(entry.number): entry for entry in SCENARIOS.values()}
    entry = numbers.get(name) or SCENARIOS.get(name)
    if entry is None:
        raise unknown(f"no scenario {name!r}", name, SCENARIOS)
    return entry


def look_up(robot: str, scenario: str | int) -> tuple[Scenario, Simulated]:
    """A scenario and a robot that has it."""
    simulated, entry = robot_of(robot), scenario_of(str(scenario))
    if simulated.family not in entry.cases:
        own = [name for name, other in SCENARIOS.items() if simulated.family in other.cases]
        raise ScenarioError(
            f"scenario {entry.name!r} does not exist for {robot!r}; it has {', '.join(own)}"
        )
    return entry, simulated


def software() -> dict[str, str]:
    """Versions of the software on which a simulated run depends, by name."""
    try:
        import mujoco
    except ImportError as error:
        raise ScenarioError(
            "simulation needs MuJoCo, which is not installed;"
            " run `pip install 'noise-inspector[sim]'`"
        ) from error
    import pinocchio

    modules = {"mujoco": mujoco, "pinocchio": pinocchio, "numpy": np}
    return {name: str(module.__version__) for name, module in modules.items()}


@lru_cache(maxsize=1)
def _twin(start: Start, duration: float) -> Trial:
    """Run without the fault; all runs of one start share it."""
    twin = _trial(start, no_defect, duration)
    if start.motion is None:
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


def _trial(start: Start, defect: Defect, duration: float) -> Trial:
    """One run; as each kind of randomness has its own stream, twins differ in the fault only."""
    from noiseclassifier.scenarios.world import reduced_model

    family = import_module(f"noiseclassifier.scenarios.{start.nominal.family}")
    setup = _setup(start)
    robot, domain = setup.robot, setup.domain
    plan: Plan = family.plan(robot, setup.motion, setup.planned, duration)
    bodies = reduced_model(robot).njoints - 1
    imperfections = Imperfections.draw(setup.body, robot, bodies=bodies, domain=domain)
    faults = defect(setup.faulty, plan)
    scene: Scene = family.scene(robot, plan, faults, imperfections)
    joints = len(robot.drives.joints)
    at_rest = (scene.start[-joints:], robot.drives, faults.offsets(joints), imperfections)
    if domain is None:
        drives = Drives(*at_rest)
    else:
        drives = DomainDrives(
            *at_rest, domain=domain, fault=faults.drive, settling=scene.settling, rng=setup.gears
        )
    recording = recorded(scene, drives, plan, faults, imperfections, setup.sensors)
    contacts = unplanned(recording.contact, plan.contacts)
    events = (*faults.events, *scene.events)
    return Trial(recording, events, contacts, faults, imperfections, setup)


def _setup(start: Start) -> Setup:
    """What the seed of a run draws before its plan."""
    nominal = start.nominal
    if start.motion is not None:
        seeds = np.random.SeedSequence(start.seed).spawn(5)
        return Setup(nominal, start.motion, None, *map(np.random.default_rng, seeds))
    seeds = np.random.SeedSequence((start.seed, crc32(nominal.name.encode()))).spawn(7)
    domains, motions, planned, body, gears, sensors, faulty = map(np.random.default_rng, seeds)
    robot, domain = _changed(nominal, Domain.draw(domains, LIMITS[nominal.family]))
    soft = domain.stiffness < SOFT or domain.policy_rate > 0
    motion = MOTIONS[nominal.family](motions, domain.wildness, nominal, soft=soft)
    scaled = robot.scaled(domain.length)
    return Setup(scaled, motion, domain, planned, body, sensors, faulty, gears)


def _changed(robot: Simulated, domain: Domain) -> tuple[Simulated, Domain]:
    """The robot with the drives of the domain, its delay no longer than its gains bear.

    A velocity loop of gain d on an inertia J crosses over at d/J, and a delay t takes t k of the
    damping d: whoever builds a robot leaves a margin to both. The rotor alone is the least
    inertia that a loop can have. Where filters of the velocity leave no margin, gains are lower.
    """
    nominal = robot.drives
    inertia = np.array(nominal.armature) * domain.rotor
    lag = STEP + domain.torque_rise / 2 + 1 / (np.pi * domain.encoder_bandwidth)
    damping = np.minimum(domain.damping * np.array(nominal.damping), LAG * inertia / lag)
    stiffness = domain.stiffness * np.array(nominal.stiffness)
    stiffness = np.minimum(stiffness, np.minimum(damping**2 / inertia, LOOP_MARGIN * damping / lag))
    bearable = np.minimum(LAG * inertia / damping, LOOP_MARGIN * damping / stiffness).min() - lag
    domain = replace(domain, delay=float(np.clip(domain.delay, 0.0, max(bearable, 0.0))))
    rotor = domain.rotor * (LOAD_SHARE if domain.flexibility else 1.0)
    drives = replace(
        nominal,
        stiffness=tuple(stiffness.tolist()),
        damping=tuple(damping.tolist()),
        torque=multiplied(nominal.torque, domain.torque_limit),
        armature=multiplied(nominal.armature, rotor),
        friction=multiplied(nominal.friction, domain.friction),
        viscous=multiplied(nominal.viscous, domain.viscous),
    )
    return replace(robot, drives=drives), domain


def recorded(
    scene: "Scene",
    drives: Drives,
    plan: Plan,
    faults: Faults,
    imperfections: Imperfections,
    rng: np.random.Generator,
) -> "Motion":
    """Record a scene with given drives and the errors of its sensors."""
    from noiseclassifier.scenarios.loop import record
    from noiseclassifier.scenarios.world import sensors_of

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


def _further(trial: Trial, twin: Trial) -> list[Event]:
    """Unplanned contacts of a run that its twin does not have."""
    return [
        contact
        for contact in trial.contacts
        if not any(
            abs(contact.start - other.start) < SAME
            and contact.facts["effector"] == other.facts["effector"]
            for other in twin.contacts
        )
    ]


def _single(signal: Any) -> Any:
    return signal.astype(np.float32)


def _whole(motion: "Motion", simulated: Simulated, **facts: Any) -> Run:
    """A recording as a run, with the joints that are held away from 0, in single precision."""
    held = {joint: angle for joint, angle in simulated.held.items() if angle}
    still = np.zeros((len(motion.velocity), len(held)))
    posture = still + np.array([*held.values()])

    def whole(signal: Array, others: Array = still) -> Any:
        return _single(np.hstack((signal, others)))

    base = {}
    if motion.base_pose.size:
        from noiseclassifier.scenarios.world import pinocchio_base

        pose, velocity = pinocchio_base(motion.base_pose, motion.base_velocity)
        base = {"base_pose": _single(pose), "base_velocity": _single(velocity)}
    return Run(
        time=times(len(motion.velocity), STEP),
        joint_names=(*simulated.drives.joints, *held),
        velocity=whole(motion.velocity),
        position=whole(motion.position, posture),
        velocity_desired=whole(motion.velocity_desired),
        position_desired=whole(motion.position_desired, posture),
        stages={"planned": whole(motion.planned), "commanded": whole(motion.commanded)},
        effort=whole(motion.torque),
        **base,
        **facts,
    )


def kept(motion: "Motion", rate: float, **facts: Any) -> Run:
    """What is kept of a recording: positions, velocities, torques, single precision, at a rate."""
    others = {
        "planned": motion.planned,
        "position": motion.position,
        "position_desired": motion.position_desired,
        "effort": motion.torque,
    }
    run = Run(
        time=times(len(motion.velocity), STEP),
        velocity=_single(motion.velocity),
        velocity_desired=_single(motion.velocity_desired),
        stages={name: _single(signal) for name, signal in others.items()},
        **facts,
    )
    run = decimated(run, rate)
    single = {name: _single(stage) for name, stage in run.stages.items()}
    single |= {name: _single(getattr(run, name)) for name in ("velocity", "velocity_desired")}
    return replace(run, stages={"planned": single.pop("planned")}, **single)


def digest(run: Run) -> str:
    """SHA-256 of the arrays of a run: names, shapes, every bit of every signal, and the blocks."""
    arrays = {
        "time": run.time,
        "velocity": run.velocity,
        "position": run.position,
        "velocity_desired": run.velocity_desired,
        "position_desired": run.position_desired,
        "effort": run.effort,
        "base_pose": run.base_pose,
        "base_velocity": run.base_velocity,
        **run.stages,
        "block_start": np.array([block.start for block in run.blocks], dtype=np.float64),
        "block_stop": np.array([block.stop for block in run.blocks], dtype=np.float64),
        "block_label": np.array([block.label for block in run.blocks], dtype=str),
    }
    hashed = hashlib.sha256(repr((run.joint_names, run.desired_joint_names)).encode())
    for name, array in arrays.items():
        if array is not None:
            hashed.update(f"{name}{array.dtype.str}{array.shape}".encode())
            hashed.update(np.ascontiguousarray(array).tobytes())
    return hashed.hexdigest()


def reproduce(run: Run) -> Run:
    """The full run, at 10 kHz and with all signals, of one that a data set keeps.

    Raises:
        ScenarioError: If the software here does not make it bit for bit.
    """
    recipe = run.meta
    robot, scenario, seed = str(run.robot), str(recipe["scenario"]), int(recipe["seed"])
    again = simulate(robot, scenario, seed, duration=recipe["duration"])
    if digest(again) != recipe["sha256"]:
        raise ScenarioError(
            f"{robot}/{scenario}-{seed:03d} cannot be reproduced: it was made with"
            f" {_versions(recipe)}, here is {_versions(again.meta)};"
            " install the versions that it was made with"
        )
    return again


def _versions(meta: Mapping[str, Any]) -> str:
    versions = ", ".join(f"{name} {number}" for name, number in meta.get("versions", {}).items())
    return f"recipe {meta.get('recipe')} ({versions})"
