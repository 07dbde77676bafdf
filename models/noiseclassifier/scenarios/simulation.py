"""The scenarios and faults of table.toml, and labelled runs of a robot with one of them."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, partial
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np

from noiseclassifier.scenarios import faults
from noiseclassifier.scenarios.domains import LIMITS, MOTIONS, Domain, steady
from noiseclassifier.scenarios.drives import LOAD_SHARE, DomainDrives, Drives
from noiseclassifier.scenarios.faults import Defect, Faults, Imperfections, no_defect
from noiseclassifier.scenarios.labels import RULE, annotate, unplanned
from noiseclassifier.scenarios.motions import (
    RATE,
    STEP,
    STEPS,
    Event,
    Motion,
    Picks,
    Plan,
    Reach,
    Rng,
    ScenarioError,
    SimulationError,
    Stand,
    Trot,
    Walk,
    multiplied,
    times,
    unknown,
)
from noiseclassifier.scenarios.robots import ROBOTS, WIDE, Simulated, settings
from noisemodel import Run, decimated
from noisemodel.types import Array

if TYPE_CHECKING:
    from noiseclassifier.scenarios.loop import Recording, Scene

# Versions of the simulations; they increase whenever a seed gives another run than before. The
# third of wide domains only added faults of whole runs, the fourth only changed quadrupeds.
RECIPE, WIDE_RECIPE = 3, 4
SHORTEST = 3.0  # least duration of a scenario, in which every defect can act, in [s]
# Name of a run of wide domains without a fault, the twin of all others of its robot and seed.
GOOD = "good"
FIRST = 10_000  # least seed of wide domains: names of their runs differ from those of the scenarios
DURATION = 6.0  # of a run of wide domains, in [s]
SLOW = 2000.0  # rate at which most of these runs are kept, in [Hz]
FAST_SHARE = 0.15  # share of the seeds whose runs are kept at 10 kHz
LAG = 0.6  # most phase that delay and filters take from a velocity loop at its crossover, in [rad]
LOOP_MARGIN = 0.5  # most of the damping that they take from a position loop
SOFT = 0.5  # scale of the position gains below which a robot moves as one with soft drives
SAME = 0.1  # contacts of a run and of its twin are the same if they start so close together, in [s]
# Share of a fault-free motion above ``FAST`` from which on its drives rattle: no good run.
RATTLE = 0.15
FAST, AUDIBLE = 40.0, 0.3  # lowest frequency of rattling, in [Hz], and its least level, in [rad/s]


# The table.

# The paper's bands of oscillation, in [Hz].
BANDS: tuple[tuple[int, int], ...] = (
    (20, 30), (30, 40), (40, 50), (50, 60), (60, 100), (100, 150), (150, 250), (250, 350),
    (900, 1000),
)  # fmt: skip
KINDS = {"humanoid": Walk, "quadruped": Trot, "arm": Picks}  # of motions in scenarios, by family
_EACH = "each-band"


@dataclass(frozen=True)
class Case:
    """A scenario for one family of robots."""

    motion: Motion
    defect: Defect = no_defect


@dataclass(frozen=True)
class Scenario:
    """One line of the table."""

    number: int
    name: str
    description: str
    labels: tuple[str, ...]
    cases: Mapping[str, Case]

    @property
    def healthy(self) -> bool:
        """Whether it has no failure."""
        return self.labels == ("ok",)


def _defect(given: Mapping[str, Any], band: tuple[int, int]) -> Defect:
    """A kind of fault with its settings, of which some are in units of the robot."""
    own = dict(given)
    kind, units = getattr(faults, own.pop("kind")), own.pop("units", {})
    if "bands" in own:
        own["bands"] = BANDS if own["bands"] == "all" else (band,)

    def scaled(rng: Rng, plan: Plan) -> Faults:
        sizes = {
            name: multiplied(own[name], getattr(plan.units, unit)) for name, unit in units.items()
        }
        found: Faults = kind(rng, plan, **own | sizes)
        return found

    return scaled if units else partial(kind, **own)


def _defects(table: Mapping[str, Any]) -> dict[str, Defect]:
    return {own: _defect(each, band) for name, each in table.items() for own, band in _named(name)}


def _named(name: str) -> Iterator[tuple[str, tuple[int, int]]]:
    """A name, or one for each of the paper's bands."""
    for low, high in BANDS if _EACH in name else BANDS[:1]:
        yield name.replace(_EACH, f"{low}-{high}"), (low, high)


def _scenarios(given: Mapping[str, Any]) -> Iterator[Scenario]:
    for number, (name, band) in enumerate(_named(given["name"]), start=given["number"]):
        cases = {
            family: Case(
                KINDS[family](**each.get("motion", {})),
                _defect(each["fault"], band) if "fault" in each else no_defect,
            )
            for family, each in given.items()
            if family in KINDS
        }
        description = given["description"].replace(_EACH, "{} to {}".format(*band))
        labels = ("ok", *given.get("labels", "").split())
        yield Scenario(number, name, description, labels, MappingProxyType(cases))


_TABLE = settings("table.toml")
# All scenarios, by name.
SCENARIOS: Mapping[str, Scenario] = MappingProxyType(
    {line.name: line for given in _TABLE["scenario"] for line in _scenarios(given)}
)
# Faults of drives of every family, for a while and from the first sample to the last, by name.
ON_DRIVES, THROUGHOUT = _defects(_TABLE["drives"]), _defects(_TABLE["throughout"])
# Faults of wide domains by family and name: of drives and commands, and the family's own.
FAULTS: Mapping[str, Mapping[str, Defect]] = MappingProxyType(
    {family: ON_DRIVES | _defects(own) for family, own in _TABLE["wide"].items()}
)


def suited(family: str, motion: Any) -> tuple[str, ...]:
    """Names of the faults of a family that can act in a motion."""
    idle: tuple[str, ...] = ()
    on_contact = ("obstacle", "giving-way", "force-gain", "force-jump")
    if isinstance(motion, Reach):
        idle = on_contact
    elif isinstance(motion, Picks):
        idle = ("joint-stop", *(on_contact if motion.way == "directions" else ()))
    elif isinstance(motion, Trot):
        steps = ("underfoot", "step_down") if motion.gait == "stand" else ()
        idle = tuple(name for name, own in _TABLE["wide"][family].items() if own["kind"] in steps)
        idle += ("force-jump", "limit-cycle") if motion.blind else ()
    elif isinstance(motion, Stand):
        idle = ("edge", *(name for name in FAULTS[family] if name.startswith("obstacle")))
    elif family == "humanoid" and not motion.walk.drop:
        idle = ("edge",)
    return tuple(name for name in FAULTS[family] if name not in idle)


# One run.


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
    planned: Rng
    body: Rng
    sensors: Rng
    faulty: Rng
    gears: Rng


@dataclass(frozen=True, eq=False)
class Trial:
    """One simulated run without labels."""

    motion: "Recording"
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
    the difference by the rule in `scenarios.labels`.

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
    except SimulationError as error:
        run = f"{robot} in scenario {name!r} with seed {seed}"
        raise SimulationError(error.time, error.problem, run) from error
    events = (*trial.events, *trial.contacts)
    if wide:  # soft legs scuff
        events = () if trial is twin else (*trial.events, *_further(trial, twin))
    blocks, records = annotate(trial.motion.velocity, twin.motion.velocity, events, rate=RATE)
    meta = {
        "source": "simulation",
        "scenario": name,
        "seed": int(seed),
        "duration": float(duration),
        "versions": versions,
        "defect": dict(trial.faults.facts),
        "events": records,
        "labelling": asdict(RULE),
        **_facts(start, name, trial),
    }
    facts = {"robot": robot, "blocks": blocks, "meta": meta}
    if not wide:
        return _whole(trial.motion, start.nominal, **facts)
    rate = RATE if np.random.default_rng((seed, 1)).uniform() < FAST_SHARE else SLOW
    return kept(trial.motion, rate, joint_names=start.nominal.drives.joints, **facts)


Found = tuple[Start, str, Defect, float]  # start, name of the scenario, defect, duration


def _in_scenarios(robot: str, scenario: str, seed: int, duration: float | None) -> Found:
    entry, family = scenario_of(scenario), robot_of(robot).family
    if family not in entry.cases:
        own = [name for name, other in SCENARIOS.items() if family in other.cases]
        raise ScenarioError(
            f"scenario {entry.name!r} does not exist for {robot!r}; it has {', '.join(own)}"
        )
    case = entry.cases[family]
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


def _facts(start: Start, name: str, trial: Trial) -> dict[str, Any]:
    """What differs between the metadata of scenarios and of wide domains."""
    domain = trial.setup.domain
    if domain is None:
        return {
            "number": SCENARIOS[name].number,
            "recipe": RECIPE,
            "motion": asdict(start.motion),
            "imperfections": asdict(trial.imperfections),
        }
    return {
        "simulator": "mujoco",
        "recipe": f"domains {_recipe(start.nominal.family, name)}",
        "domain": domain.as_dict(),
        "motion": repr(trial.setup.motion),
        "effort_limit": [domain.torque_limit * one for one in start.nominal.drives.torque],
    }


def _recipe(family: str, name: str) -> int:
    """The recipe that last changed runs of a family in wide domains."""
    if family == "quadruped":
        return WIDE_RECIPE
    return 3 if name in THROUGHOUT else 2


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
        raise SimulationError(0.0, f"it rattles without a fault, at {level:.2g} rad/s")


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
    motion = MOTIONS[nominal.family](motions, domain.wildness, nominal)
    if isinstance(motion, Trot) and (domain.stiffness < SOFT or domain.policy_rate > 0):
        motion = steady(motion)
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
    rng: Rng,
) -> "Recording":
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


def _whole(motion: "Recording", simulated: Simulated, **facts: Any) -> Run:
    """A recording as a run, with the joints that are held away from 0, in single precision."""
    from noiseclassifier.scenarios.world import pinocchio_base

    held = {joint: angle for joint, angle in simulated.held.items() if angle}
    still = np.zeros((len(motion.velocity), len(held)))
    posture = still + np.array([*held.values()])

    def whole(signal: Array, others: Array = still) -> Any:
        return _single(np.hstack((signal, others)))

    base = {}
    if motion.base_pose.size:
        both = pinocchio_base(motion.base_pose, motion.base_velocity)
        base = dict(zip(("base_pose", "base_velocity"), map(_single, both), strict=True))
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


def kept(motion: "Recording", rate: float, **facts: Any) -> Run:
    """What is kept of a recording: positions, velocities, torques, single precision, at a rate."""
    names = ("velocity", "velocity_desired", "planned", "position", "position_desired")
    signals = {name: _single(getattr(motion, name)) for name in names}
    signals["effort"] = _single(motion.torque)
    # As stages, since only velocities and stages are decimated.
    time, velocity = times(len(motion.velocity), STEP), signals.pop("velocity")
    run = decimated(Run(time=time, velocity=velocity, stages=signals, **facts), rate)
    single = {name: _single(signal) for name, signal in run.stages.items()}
    planned = {"planned": single.pop("planned")}
    return replace(run, velocity=_single(run.velocity), stages=planned, **single)
