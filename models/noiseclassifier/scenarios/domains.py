"""Wide domains: what one run draws of body, drives, control, logger and motion."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from noiseclassifier.scenarios.motions import (
    REACHES,
    Gesture,
    Picks,
    Range,
    Reach,
    Rng,
    Stand,
    Stroll,
    Trot,
    Walk,
)
from noiseclassifier.scenarios.robots import Simulated, settings

Control: TypeAlias = Literal["pd", "computed-torque", "impedance", "policy"]
Velocity: TypeAlias = Literal["measured", "filtered", "differentiated"]
Desired: TypeAlias = Literal["commanded", "planned", "zero", "missing"]
Effort: TypeAlias = Literal["missing", "torque", "current"]
TARGET_CONTROL: Control = "impedance"  # control that is never trained on
TARGET_BITS = 13  # encoders of so many bits or fewer are never trained on, in any kind of log
TARGET_HOLD = 4  # logs whose samples are held so many times or more are never trained on
RESONANCES = 2  # most resonances of one robot
PRESENT = 0.5  # share of the robots that have a given imperfection of gears at all
CURRENTS = 0.5  # share of the logs with efforts whose efforts are currents
# Rates of loggers, in [Hz], each drawn as often as it is listed.
RATES = (100.0, 125.0, 200.0, 250.0, 500.0, 1000.0, 1000.0, 1000.0, 2000.0, 5000.0, 10_000.0)


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Drives with which a family's robots stay upright in at least four of five runs."""

    stiffness: Range = (0.0, float("inf"))
    damping: Range = (0.0, float("inf"))
    delay: float = float("inf")  # longest time from a reading to its torque, in [s]
    hold: float = float("inf")  # longest time for which targets are held, in [s]
    feedforward: float = 0.0
    flexibility: float = 0.0  # lowest natural frequency of rotors on elastic gears, in [Hz]


@dataclass(frozen=True, kw_only=True)
class Domain:
    """Body, drives and control of one run; scales multiply the robot's nominal values."""

    wildness: float
    length: float
    mass: float
    payload: float
    gear: float
    ripple: float
    flexibility: float  # natural frequency of rotors on elastic gears, in [Hz]; 0 if rigid
    backlash: float  # free play of the gears, in [rad]
    cogging: float
    stiction: float
    friction: float
    viscous: float
    rotor: float
    torque_limit: float
    torque_rise: float  # time from no torque to the limit, in [s]
    delay: float  # from a reading to its torque, in [s]
    control: Control
    stiffness: float
    damping: float
    feedforward: float
    policy_rate: float  # rate of the targets of a policy, held in between, in [Hz]; 0 for none
    encoder_bits: int
    encoder_bandwidth: float  # of the velocities in the loop, in [Hz]

    @property
    def target(self) -> bool:
        """Whether it lies in a part of the distribution that is never trained on."""
        return self.control == TARGET_CONTROL

    def as_dict(self) -> dict[str, Any]:
        """All values, with a name for evaluations: the simulator and the kind of control."""
        return {"name": f"mujoco-{self.control}", **asdict(self)}

    @classmethod
    def draw(cls, rng: Rng, limits: Limits) -> "Domain":
        """Draw the domain of one run."""
        draw = _Draw(rng, float(rng.uniform()))
        control: Control = str(rng.choice(get_args(Control)))  # type: ignore[assignment]
        stiffness = draw("stiffness")
        if control == "impedance":  # soft by definition
            stiffness = min(stiffness, draw.far("stiffness"))
        stiffness = float(np.clip(stiffness, *limits.stiffness))
        damping = float(np.clip(draw("damping") * np.sqrt(stiffness), *limits.damping))
        elastic = draw.present()
        return cls(
            wildness=draw.wildness,
            length=draw.either("length"),
            mass=draw.either("mass"),
            payload=draw("payload"),
            gear=draw.far("gear"),
            ripple=draw("ripple") if elastic else 0.0,
            flexibility=max(draw("flexibility"), limits.flexibility) if elastic else 0.0,
            backlash=draw("backlash") if elastic and draw.present() else 0.0,
            cogging=draw("cogging") if draw.present() else 0.0,
            stiction=draw("stiction") if draw.present() else 1.0,
            friction=draw.either("friction"),
            viscous=draw.either("viscous"),
            rotor=draw.either("rotor"),
            torque_limit=draw("torque_limit"),
            torque_rise=draw("torque_rise"),
            delay=min(draw("delay"), limits.delay),
            control=control,
            stiffness=stiffness,
            damping=damping,
            feedforward=max(draw("feedforward"), limits.feedforward) if control == "pd" else 1.0,
            policy_rate=max(draw("policy_rate"), 1 / limits.hold) if control == "policy" else 0.0,
            encoder_bits=round(draw("loop_bits")),
            encoder_bandwidth=draw("loop_bandwidth"),
        )


@dataclass(frozen=True, kw_only=True)
class Logger:
    """Sensing and logging of one run."""

    rate: float  # sample rate, in [Hz]
    velocity: Velocity
    bits: int
    cutoff: float  # of the low-pass, in [Hz]
    noise: float  # standard deviation of the white noise of velocities, in [rad/s]
    jitter: float
    lost: float
    repeated: float
    hold: int
    ripple: float
    roughness: float
    gear: float
    resonances: tuple[float, ...]  # frequencies that the ripple excites, in [Hz]
    desired: Desired
    effort: Effort = "missing"
    current: float = 0.0  # current of a motor at the torque limit, in [A]; 0 unless it is logged
    effort_noise: float = 0.0
    effort_bits: int = 16

    @property
    def target(self) -> bool:
        """Whether it lies in a part of the distribution that is never trained on."""
        return self.bits <= TARGET_BITS or self.hold >= TARGET_HOLD

    @classmethod
    def draw(cls, rng: Rng, domain: Domain, *, most: float, rate: float | None = None) -> "Logger":
        """Draw the logger of a run with a highest rate, and with a given rate or any, in [Hz]."""
        draw = _Draw(rng, domain.wildness)
        drawn = float(rng.choice([each for each in RATES if each <= most * (1 + 1e-6)]))
        rate = rate or drawn
        held = rng.uniform() < 0.1
        # Of another generator, so that it changes nothing else.
        efforts = _Draw(rng.spawn(1)[0], domain.wildness)
        return cls(
            rate=rate,
            velocity=str(rng.choice(get_args(Velocity))),  # type: ignore[arg-type]
            bits=round(draw("bits")),
            cutoff=min(draw("cutoff"), 0.4 * rate),
            noise=draw("noise"),
            jitter=draw("jitter"),
            lost=draw("lost") if draw.present() else 0.0,
            repeated=draw("repeated") if draw.present() else 0.0,
            hold=max(1, round(draw.far("hold"))) if held else 1,
            ripple=draw.far("log_ripple"),
            roughness=draw("roughness"),
            gear=domain.gear,
            resonances=tuple(draw.far("resonance") for _ in range(rng.integers(RESONANCES + 1))),
            desired=str(  # type: ignore[arg-type]
                rng.choice(get_args(Desired), p=(0.5, 0.35, 0.08, 0.07))
            ),
            **efforts.effort(),
        )


class _Draw:
    """Values of one run."""

    def __init__(self, rng: Rng, wildness: float) -> None:
        self._rng, self.wildness = rng, wildness

    def __call__(self, name: str) -> float:
        """A value between the mild end and the point on the way to the wild one."""
        return self._between(name, self.wildness * float(np.sqrt(self._rng.uniform())))

    def far(self, name: str) -> float:
        """A value between both ends, at any wildness."""
        return self._between(name, float(self._rng.uniform()))

    def either(self, name: str) -> float:
        """A value, or its inverse."""
        value = self(name)
        return value if self._rng.uniform() < 0.5 else 1 / value

    def present(self) -> bool:
        """Whether the robot has an imperfection."""
        return bool(self._rng.uniform() < PRESENT)

    def effort(self) -> dict[str, Any]:
        """What of efforts a logger has."""
        share, kind = self._rng.uniform(size=2).tolist()
        current, noise, bits = (self.far("current"), self("effort_noise"), self("effort_bits"))
        there, measured = share < self("effort_share"), kind >= CURRENTS
        return {
            "effort": ("torque" if measured else "current") if there else "missing",
            "current": 0.0 if measured or not there else current,
            "effort_noise": noise,
            "effort_bits": round(bits),
        }

    def _between(self, name: str, share: float) -> float:
        mild, wild = SETTINGS[name]["ends"]
        if SETTINGS[name].get("log") and mild > 0 and wild > 0:
            return float(mild * (wild / mild) ** share)
        return float(mild + share * (wild - mild))


_TABLE = settings("domains.toml")
SETTINGS: dict[str, Any] = _TABLE["settings"]  # what domains and loggers draw, by name
LIMITS = {family: Limits(**each) for family, each in _TABLE["limits"].items()}
WALKS = {name: Walk(**each) for name, each in (_TABLE["mild"] | _TABLE["wild"]).items()}


PICKS = 0.35  # share of motions that are picks
SLOWEST = 0.05  # lowest peak speed of a joint in a movement, in [rad/s]
FASTEST = (0.5, 2.5)  # highest peak speed, mild and wild, in [rad/s]
STANDS = 0.3  # share of motions in the air that begin with standing for a while
STANDING = (1.5, 4.0)  # how long they stand, in [s]
STANDS_STILL = 0.3  # share of the runs in which a humanoid only stands
BLIND = 0.5  # share of the quadrupeds whose control knows no contact forces
LANDING = (0.1, 2.5)  # speed at which their feet land, see `Trot`; that of a half sine is 2
WAYS = ("straight", "curve", "directions", "spot")


def _mixed(span: Range, share: float) -> float:
    return span[0] + share * (span[1] - span[0])


def arm_motion(rng: Rng, wildness: float, arm: Any) -> Picks | Reach:
    """Motion of an arm."""
    picks, kind, way = rng.uniform(size=3).tolist()
    fast, hard, wide, stops, carries, pace, force = rng.uniform(size=7).tolist()
    stands, long = rng.uniform(size=2).tolist()
    if picks < PICKS and arm.reach is not None:
        low = 10.0 + 10.0 * force
        return Picks(
            way=WAYS[int(way * len(WAYS))],
            hover=(0.005, 0.01 + 0.02 * wildness),
            force=(low, low + 20.0),
        )
    fastest = SLOWEST * (_mixed(FASTEST, wildness) / SLOWEST) ** (0.45 + 0.55 * fast)
    return Reach(
        kind=REACHES[int(kind * len(REACHES))],
        speed=(max(SLOWEST, fastest / 3), fastest),
        acceleration=4.0 + hard * (4.0 + 12.0 * wildness),
        spread=0.3 + wide * (0.3 + 0.7 * wildness),
        pause=(0.0, 0.1 + 0.5 * pace),
        stops=0.3 * wildness if stops < 0.5 * wildness else 0.0,
        payload=(0.1, 0.5 + 1.5 * wildness) if carries < 0.2 + 0.4 * wildness else (0.0, 0.0),
        stand=_mixed(STANDING, long) if stands < STANDS else 0.2,
    )


def humanoid_motion(rng: Rng, wildness: float, robot: Simulated) -> Stroll | Stand:
    """Motion of a humanoid."""
    upper = Gesture(
        way=str(rng.choice(("still", "sines", "reaches"))),
        size=(0.0, 0.2 + 0.8 * wildness),
        period=(2.0 - 1.2 * wildness, 3.0 - 1.0 * wildness),
    )
    if rng.uniform() < STANDS_STILL:
        still = rng.uniform() < 1 / 3
        return Stand(
            sway=(0.0, 0.0) if still else (0.1, 0.3 + 0.3 * wildness),
            squat=(0.0, 0.0) if still else (0.01, 0.04 + 0.06 * wildness),
            period=(2.5 - 1.2 * wildness, 4.0),
            upper=upper,
        )
    walk = WALKS[str(rng.choice(list(_TABLE["mild"] if rng.uniform() > wildness else WALKS)))]
    way = walk.way if walk.way == "spot" or walk.drop else str(rng.choice(WAYS))
    walk = replace(walk, way=way, jitter=0.02 + 0.08 * wildness)
    return Stroll(walk=walk, stops=int(rng.integers(3)), pause=(0.8, 2.0), upper=upper)


def quadruped_motion(rng: Rng, wildness: float, robot: Simulated) -> Trot:
    """Motion of a quadruped."""
    gaits = _TABLE["gaits"]
    gait = str(rng.choice(list(gaits), p=[each["share"] for each in gaits.values()]))

    def draw(name: str) -> float:
        mild, wild = (np.array(span) for span in _TABLE["spread"][name])
        return float(rng.uniform(*(mild + wildness * (wild - mild))))

    period, height, posing = draw("period"), draw("height"), draw("posing")
    moves_body = gait == "stand" or float(rng.uniform()) < 0.4 * wildness
    pauses = int(rng.binomial(2, 0.4 * wildness)) if gait != "stand" else 0
    way, speed, jitter = str(rng.choice(WAYS)), draw("speed"), draw("jitter")
    # Controllers differ at any wildness.
    landing = LANDING[0] * (LANDING[1] / LANDING[0]) ** float(rng.uniform())
    blind = bool(rng.uniform() < BLIND)
    return Trot(
        gait=gait,
        way=way,
        period=(period, period),
        height=(height, height),
        speed=speed,
        jitter=jitter,
        landing=landing,
        blind=blind,
        posing=(posing, posing) if moves_body else (0.0, 0.0),
        pauses=pauses,
        duration=5.0 + 1.5 * pauses,
    )


def steady(motion: Trot) -> Trot:
    """The motion on soft drives: quick steps, which catch the body in time; a stand stays."""
    gait = "trot" if motion.gait == "pace" else motion.gait  # feet rattle in a pace
    quick = _TABLE["gaits"][gait].get("quick", float("inf"))
    shortest, longest = (min(period, quick) for period in motion.period)
    return replace(motion, gait=gait, period=(shortest, longest))


# By family: from random numbers, wildness and a robot to a motion.
MOTIONS: Mapping[str, Callable[..., Any]] = {
    "arm": arm_motion,
    "humanoid": humanoid_motion,
    "quadruped": quadruped_motion,
}
