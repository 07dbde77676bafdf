"""The domains elsewhere, and their runs: drawn, simulated, sensed and labelled."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, partial
from importlib import metadata
from types import MappingProxyType
from typing import Any

import numpy as np

from benchmarks.elsewhere import bulletarm, bulletlegs, drakearm, faults, references, sensing
from benchmarks.elsewhere.faults import Control, Sizes
from benchmarks.elsewhere.recorded import Recorded
from benchmarks.elsewhere.references import Reference
from noiseclassifier.scenarios.labels import RULE, annotate
from noisemodel import Block, Run
from noisemodel.types import Array

# Least ratio of a fault's power to the sensor's in one octave, for it to have a label (3 dB).
VISIBLE = 2.0


@dataclass(frozen=True, eq=False)
class Scene:
    """A robot with its motion and its settings: all that a seed draws but fault and sensor."""

    reference: Reference
    settings: Any
    controller: str
    sizes: Sizes
    links: tuple[int, ...]
    simulate: Callable[[Control], Recorded]

    def given(self, control: Control) -> Control:
        """The control, without velocities if the controller takes none."""
        if getattr(self.settings, "feedforward", True):
            return control
        return replace(control, velocity=np.zeros_like(control.velocity))


@dataclass(frozen=True)
class Domain:
    """A robot, a simulator and a controller."""

    name: str
    package: str
    robot: str | None
    joints: tuple[str, ...]
    native: float  # the rate of the simulator's own default or examples, in [Hz]
    # Draws a scene, from a random generator, a number, a duration in [s] and a rate in [Hz].
    scene: Callable[[np.random.Generator, int, float, float], Scene]

    @property
    def folder(self) -> str:
        """Folder of its runs."""
        return f"{self.name}/{self.robot or self.name}"


def _bullet_arm(arm: bulletarm.BulletArm) -> Callable[..., Scene]:
    def scene(rng: np.random.Generator, seed: int, duration: float, rate: float) -> Scene:
        kind = references.KINDS[seed % len(references.KINDS)]
        reference = references.draw(
            rng, kind, np.array(arm.home), reach=0.5, duration=duration, rate=rate
        )
        motors = bulletarm.Motors.draw(rng)
        lagging = motors.mode == "velocity"
        sizes = Sizes(
            force=(200.0, 800.0),
            ball=(1.0, 5.0),
            delay=(0.02, 0.06),
            gain=(20.0, 35.0),
            jump=(0.02, 0.1) if lagging else (0.005, 0.05),
            late_commands=not lagging,
        )
        words = "PyBullet's position motors" if not lagging else "loop around velocity motors"
        return Scene(reference, motors, words, sizes, arm.links,
                     lambda control: bulletarm.simulate(arm, motors, control, rate))  # fmt: skip

    return scene


def _bullet_legs(legs: bulletlegs.BulletLegs) -> Callable[..., Scene]:
    def scene(rng: np.random.Generator, seed: int, duration: float, rate: float) -> Scene:
        gait = bulletlegs.Gait.draw(rng, legs, duration)
        sizes = Sizes(
            force=(50.0, 200.0), delay=(0.003, 0.006), slow=False, gain=(8.0, 20.0),
            jump=(0.05, 0.2), hold=(0.05, 0.15), offset=(0.05, 0.15),
        )  # fmt: skip
        return Scene(bulletlegs.reference(legs, gait, duration, rate), gait,
                     "soft joint PD around open-loop foot paths", sizes, legs.links,
                     lambda control: bulletlegs.simulate(legs, gait, control, rate))  # fmt: skip

    return scene


def _drake_arm(arm: drakearm.DrakeArm) -> Callable[..., Scene]:
    def scene(rng: np.random.Generator, seed: int, duration: float, rate: float) -> Scene:
        kind = references.KINDS[(seed + 1) % len(references.KINDS)]
        reference = references.draw(
            rng, kind, np.array(arm.home), reach=0.5, duration=duration, rate=rate
        )
        loop = drakearm.Loop.draw(rng)
        sizes = Sizes(
            force=(80.0, 300.0), ball=None, delay=(0.02, 0.05), jump=(0.05, 0.2), offset=(0.1, 0.25)
        )
        return Scene(reference, loop, f"Drake's {arm.controller}", sizes, arm.links,
                     lambda control: drakearm.simulate(arm, loop, control, rate))  # fmt: skip

    return scene


PANDA = bulletarm.BulletArm(
    "franka_panda/panda.urdf",
    tuple(f"panda_joint{number}" for number in range(1, 8)),
    (87.0,) * 4 + (12.0,) * 3,
    (0.0, -0.4, 0.0, -2.0, 0.0, 1.6, 0.8),
    "panda_hand_joint",
    (3, 5, 6),
)
IIWA = bulletarm.BulletArm(
    "kuka_iiwa/model.urdf",
    tuple(f"lbr_iiwa_joint_{number}" for number in range(1, 8)),
    (320.0, 320.0, 176.0, 176.0, 110.0, 40.0, 40.0),
    (0.0, 0.6, 0.0, -1.2, 0.0, 0.8, 0.0),
    "lbr_iiwa_joint_7",
    (3, 5, 6),
)
NAMES = ("{}_hip_joint", "{}_thigh_joint", "{}_calf_joint")
A1 = bulletlegs.BulletLegs(
    "a1/a1.urdf",
    ("{}_hip_joint", "{}_upper_joint", "{}_lower_joint"),
    NAMES,
    (1.0, 1.0, 1.0, 1.0),
    (0.0, 0.0, 0.0),
    (0.085, 0.2, 0.2),
    0.29,
    ((60.0, 120.0), (1.0, 2.0)),
    33.5,
    (-1, -1, 3, 8, 13, 18),
)
LAIKAGO = bulletlegs.BulletLegs(
    "laikago/laikago_toes_zup.urdf",
    (
        "{}_hip_motor_2_chassis_joint",
        "{}_upper_leg_2_hip_motor_joint",
        "{}_lower_leg_2_upper_leg_joint",
    ),
    NAMES,
    (-1.0, 1.0, -1.0, 1.0),
    (0.0, 0.5989, -0.5111),
    (0.033, 0.252, 0.251),
    0.40,
    ((100.0, 200.0), (1.5, 3.0)),
    55.0,
    (-1, -1, 1, 5, 9, 13),
)
UR5 = drakearm.DrakeArm(
    "ur5",
    (
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    ),
    "InverseDynamicsController",
    (150.0, 150.0, 150.0, 28.0, 28.0, 28.0),
    (0.0, -1.2, 1.4, -1.2, -1.5, 0.0),
    (2, 4, 5),
)
KINOVA = drakearm.DrakeArm(
    "kinova",
    tuple(f"j2s6s200_joint_{number}" for number in range(1, 7)),
    "JointStiffnessController",
    (40.0, 80.0, 40.0, 20.0, 20.0, 20.0),
    (0.0, 3.1, 2.0, 0.0, 3.1, 0.0),
    (2, 4, 5),
)
_LEGS = tuple(name.format(leg) for leg in bulletlegs.LEGS for name in NAMES)
DOMAINS: Mapping[str, Domain] = MappingProxyType(
    {
        domain.name: domain
        for domain in (
            Domain("pybullet-panda", "pybullet", "panda", PANDA.joints, 240.0, _bullet_arm(PANDA)),
            Domain("pybullet-iiwa", "pybullet", None, IIWA.joints, 240.0, _bullet_arm(IIWA)),
            Domain("pybullet-a1", "pybullet", "a1", _LEGS, 500.0, _bullet_legs(A1)),
            Domain("pybullet-laikago", "pybullet", "laikago", _LEGS, 500.0, _bullet_legs(LAIKAGO)),
            Domain("drake-ur5", "drake", "ur5", UR5.joints, 500.0, _drake_arm(UR5)),
            Domain("drake-kinova", "drake", "kinova", KINOVA.joints, 500.0, _drake_arm(KINOVA)),
        )
    }
)


def make(domain: Domain, kind: str, seed: int, *, rate: float = 1000.0, duration: float) -> Run:
    """Labelled run of a domain.

    Args:
        rate: Rate of the control, of the simulation and of the log, in [Hz].
        duration: Duration, in [s].
    """
    scene, twin = _twin(domain.name, seed, rate, duration)
    control, recorded = scene.given(faults.healthy(scene.reference)), twin
    if kind != "good":
        rng = _random(domain, seed, 2 + faults.KINDS.index(kind))
        control = faults.draw(rng, kind, scene.reference, scene.sizes, links=scene.links, rate=rate)
        control = scene.given(control)
        recorded = scene.simulate(control)
    sensor = sensing.SENSORS[(seed + 2 * list(DOMAINS).index(domain.name)) % len(sensing.SENSORS)]
    measure = partial(sensing.sensed, sensor=sensor, rate=rate)
    position, velocity = measure(
        recorded.position + control.offset, recorded.velocity, rng=_random(domain, seed, 1)
    )
    _, healthy = measure(twin.position, twin.velocity, rng=_random(domain, seed, 1))
    events = tuple(sorted(control.events + recorded.events, key=lambda event: event.start))
    blocks, events = annotate(recorded.velocity, twin.velocity, events, rate=rate)
    kept = visible(blocks, recorded.velocity - twin.velocity, healthy - twin.velocity, rate)
    version = metadata.version(domain.package)
    return Run(
        time=np.arange(len(velocity)) / rate,
        joint_names=domain.joints,
        velocity=velocity.astype(np.float32),
        position=position.astype(np.float32),
        velocity_desired=control.velocity.astype(np.float32),
        position_desired=control.position.astype(np.float32),
        effort=recorded.effort.astype(np.float32),
        robot=domain.robot,
        blocks=kept,
        meta={
            "source": "simulation",
            "simulator": f"{domain.package} {version}",
            "controller": scene.controller,
            "scenario": kind,
            "seed": seed,
            "duration": duration,
            "domain": {"name": domain.name, "sensor": sensor, "rate": rate,
                       "motion": scene.reference.kind, **asdict(scene.settings)},
            "versions": {domain.package: version, "numpy": np.__version__},
            "events": [masked(event, blocks, kept) for event in events],
            "masked": len(blocks) - len(kept),
            "labelling": asdict(RULE),
        },
    )  # fmt: skip


@lru_cache(maxsize=1)
def _twin(name: str, seed: int, rate: float, duration: float) -> tuple[Scene, Recorded]:
    """Scene of a seed, and its run without a fault."""
    domain = DOMAINS[name]
    scene = domain.scene(_random(domain, seed, 0), seed, duration, rate)
    return scene, scene.simulate(scene.given(faults.healthy(scene.reference)))


def _random(domain: Domain, seed: int, stream: int) -> np.random.Generator:
    return np.random.default_rng([list(DOMAINS).index(domain.name), seed, stream])


def masked(
    event: dict[str, Any], blocks: tuple[Block, ...], kept: tuple[Block, ...]
) -> dict[str, Any]:
    """The record of an event, without what the sensor masks."""
    start, stop = event["start"], event["stop"] + RULE.tail
    lost = sum(
        block.stop - block.start
        for block in set(blocks) - set(kept)
        if start <= block.start < stop and block.label == event["label"]
    )
    return event | {"masked": lost > 0, "labelled": round(max(0.0, event["labelled"] - lost), 6)}


def visible(
    blocks: tuple[Block, ...], deviation: Array, error: Array, rate: float
) -> tuple[Block, ...]:
    """The blocks without those of faults that the sensor masks in all octaves.

    Args:
        deviation: Velocities less those of the twin, shape (samples, joints), in [rad/s].
        error: Error of the sensor in the twin, same shape, in [rad/s].
        rate: Sample rate, in [Hz].
    """
    return tuple(
        block
        for block in blocks
        if block.label == "ok"
        or _seen(*(each[round(block.start * rate) : round(block.stop * rate)]
                   for each in (deviation, error)), rate)
    )  # fmt: skip


def _seen(deviation: Array, error: Array, rate: float) -> bool:
    window = np.hanning(len(deviation) + 2)[1:-1, None]
    powers = [np.abs(np.fft.rfft(window * each, axis=0)) ** 2 for each in (deviation, error)]
    frequency = np.fft.rfftfreq(len(deviation), 1 / rate)
    edges = RULE.lowest * 2.0 ** np.arange(0, np.log2(rate / 2 / RULE.lowest) + 1)
    bands = [(frequency >= low) & (frequency < 2 * low) for low in edges]
    return any(
        bool((powers[0][band].sum(axis=0) > VISIBLE * powers[1][band].sum(axis=0)).any())
        for band in bands
        if band.any()
    )
