"""The robots that can be simulated: what robots.toml has of them, and what follows from it."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import pi, sqrt
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, TypeAlias

from noiseclassifier.scenarios.motions import Ball, Rod, Sole, Units
from noisemodel import Robot

LEGS = 12  # how many of a humanoid's drives, the first ones, are in its legs
UPPER = {
    "stiffness": 0.2, "damping": 0.2, "torque": 0.25,
    "armature": 0.2, "friction": 0.2, "viscous": 0.2,
}  # fmt: skip
"""Drives of an upper body, relative to those of the legs."""


@dataclass(frozen=True, kw_only=True)
class Drivetrain:
    """One drive per joint, nominal values."""

    joints: tuple[str, ...]
    stiffness: tuple[float, ...]  # position gain of each drive, in [N m/rad]
    damping: tuple[float, ...]  # velocity gain of each drive, in [N m s/rad]
    torque: tuple[float, ...]  # limit of each drive, in [N m]
    armature: tuple[float, ...]  # inertia of each drive at its joint, in [kg m²]
    friction: tuple[float, ...]  # coulomb friction of each joint, in [N m]
    viscous: tuple[float, ...]  # viscous friction of each joint, in [N m s/rad]


@dataclass(frozen=True, kw_only=True)
class Arm:
    """An arm that picks from a table or moves in the air.

    Attributes:
        rest: Joint positions before it moves, in [rad]; the tool points down if it picks.
        reach: Ranges of x and of y of the places on the table, in [m]; None if it cannot pick.
    """

    family: ClassVar[str] = "arm"
    name: str
    drives: Drivetrain
    tool: Rod
    rest: tuple[float, ...]
    table: float = 0.0  # height of the table, in [m]
    reach: tuple[tuple[float, float], tuple[float, float]] | None = None
    contact: float = 0.015  # time constant of the tool's rubber tip, in [s]
    force_gain: float = 1e-3  # speed of the tool per error of the contact force, in [m/(s N)]
    force_filter: float = 0.005  # time constant of the low-pass on the contact force, in [s]
    payload: float = 0.3  # largest mass at the tool that the controller has no model of, in [kg]
    force_noise: float = 0.4  # largest standard deviation of the force sensor's noise, in [N]
    held: dict[str, float] = field(default_factory=dict)
    units: Units = field(default_factory=Units)
    length_scale: float = 1.0

    @property
    def effectors(self) -> tuple[Rod, ...]:
        """The parts that may be in contact with the environment."""
        return (self.tool,)

    def scaled(self, factor: float) -> "Arm":
        """The same arm with all lengths times a factor."""
        reach = self.reach
        if reach is not None:
            (x0, x1), (y0, y1) = reach
            reach = ((x0 * factor, x1 * factor), (y0 * factor, y1 * factor))
        tool = self.tool
        return replace(
            self,
            tool=replace(tool, length=tool.length * factor, radius=tool.radius * factor),
            table=self.table * factor,
            reach=reach,
            length_scale=self.length_scale * factor,
        )


@dataclass(frozen=True, kw_only=True)
class Quadruped:
    """A robot on four legs with round feet."""

    family: ClassVar[str] = "quadruped"
    name: str
    drives: Drivetrain
    feet: tuple[Ball, ...]
    rest: tuple[float, ...]  # joint positions when it stands, in [rad]
    period: float  # nominal time of a cycle, in which each foot steps once, in [s]
    height: float  # nominal height of a swing, in [m]
    speed: float  # highest speed ahead, in [m/s]
    turning: float = 0.5  # highest speed of turning, in [rad/s]
    attitude_gain: float = 0.6
    attitude_filter: float = 0.01  # time constant of the low-pass on the attitude, in [s]
    force_gain: float  # speed of a foot per error of its contact force, in [m/(s N)]
    force_filter: float = 0.01  # time constant of the low-pass on the contact forces, in [s]
    payload: float  # largest mass on its back that the controller has no model of, in [kg]
    force_noise: float  # largest standard deviation of the force sensors' noise, in [N]
    held: dict[str, float] = field(default_factory=dict)
    length_scale: float = 1.0

    @property
    def effectors(self) -> tuple[Ball, ...]:
        """The parts that may be in contact with the environment."""
        return self.feet

    def scaled(self, factor: float) -> "Quadruped":
        """A quadruped of another size, at equal Froude numbers; masses and gains stay."""
        time = sqrt(factor)
        return replace(
            self,
            feet=tuple(Ball(foot.frame, factor * foot.radius) for foot in self.feet),
            period=time * self.period,
            height=factor * self.height,
            speed=time * self.speed,
            turning=self.turning / time,
            length_scale=factor * self.length_scale,
        )


@dataclass(frozen=True, kw_only=True)
class Gains:
    """Gains of a stabilizer.

    Attributes:
        height: Rate of the feet's difference in height per error of the difference of their
            forces, in [m/(s N)].
    """

    capture: float = 2.0
    integral: float = 1.0  # its rate per error, in [1/s]
    tilt: float  # rate of a sole's tilt per error of its torque, in [rad/(s N m)]
    level: float = 0.5  # rate at which soles return to level, in [1/s]
    height: float
    even: float = 1.0  # rate at which that difference decays, in [1/s]
    filter: float = 0.02  # time constant of the low-pass on forces and torques, in [s]


@dataclass(frozen=True, kw_only=True)
class Humanoid:
    """A humanoid that walks on two soles.

    Attributes:
        stride: Longest step forwards and sideways, in [m], and its turn, in [rad].
        reach: Largest deviation of each moving joint of the upper body from its rest, in [rad].
    """

    family: ClassVar[str] = "humanoid"
    name: str
    drives: Drivetrain
    effectors: tuple[Sole, ...]
    rest: tuple[float, ...]  # joint positions near those in which it stands, in [rad]
    centre: float  # height of the centre of mass over the soles, in [m]
    apart: float  # half of the distance between the feet, in [m]
    stride: tuple[float, float, float]
    pace: float = 1.0
    gains: Gains
    carrier: str
    payload: float  # largest mass that the controller has no model of, in [kg]
    force_noise: float  # largest standard deviation of the force sensors' noise, in [N]
    size: float = 1.0
    held: dict[str, float] = field(default_factory=dict)
    reach: tuple[float, ...] = ()
    length_scale: float = 1.0

    def scaled(self, factor: float) -> "Humanoid":
        """The same humanoid with all lengths times a factor."""

        def times(values: Sequence[float]) -> Any:
            return tuple(factor * value for value in values)

        along, across, turn = self.stride
        return replace(
            self,
            effectors=tuple(
                Sole(sole.frame, times(sole.patch), times(sole.point), factor * sole.thickness)
                for sole in self.effectors
            ),
            centre=factor * self.centre,
            apart=factor * self.apart,
            stride=(factor * along, factor * across, turn),
            length_scale=factor * self.length_scale,
        )


Simulated: TypeAlias = Arm | Humanoid | Quadruped  # A robot of any family


def _repeated(values: float | Sequence[float], count: int) -> tuple[float, ...]:
    values = values if isinstance(values, list | tuple) else (values,)
    return tuple(values) * (count // len(values))


def _joints(given: str | Sequence[str]) -> tuple[str, ...]:
    """Names, or prefixes and suffixes of names, each joined by an underscore."""
    if isinstance(given, str):
        return tuple(given.split())
    return tuple(f"{limb}_{part}" for limb in given[0].split() for part in given[1].split())


def _drives(joints: tuple[str, ...], given: Mapping[str, Any]) -> Drivetrain:
    values = {name: _repeated(each, len(joints)) for name, each in given.items()}
    return Drivetrain(joints=joints, **values)


def _nominal(joints: tuple[str, ...], given: Mapping[str, Any]) -> Drivetrain:
    """Nominal drives of an arm of which no better ones are known.

    Inertia and friction of drives grow with their torque, as those of Panda and the UR arms do;
    gains give each joint alone, with all others at rest, a natural frequency of 8 Hz and half the
    critical damping.
    """
    rate, torque = 2 * pi * 8.0, _repeated(given["torque"], len(joints))
    armature = tuple(0.005 * one for one in torque)
    moved = tuple(link + drive for link, drive in zip(given["inertia"], armature, strict=True))
    return Drivetrain(
        joints=joints,
        stiffness=tuple(rate**2 * one for one in moved),
        damping=tuple(rate * one for one in moved),
        torque=torque,
        armature=armature,
        friction=tuple(0.01 * one for one in torque),
        viscous=tuple(0.006 * one for one in torque),
    )


def _arm(given: dict[str, Any], known: Mapping[str, Any]) -> Arm:
    joints = _joints(given.pop("joints"))
    given["tool"], given["rest"] = Rod(**given["tool"]), tuple(given["rest"])
    if "reach" in given:
        x, y = given["reach"]
        given["reach"] = tuple(x), tuple(y)
    if "drives" in given:
        return Arm(drives=_drives(joints, given.pop("drives")), **given)
    drives = _nominal(joints, given.pop("nominal"))
    # Units of force and torque are 1 for Panda, which bears 47 N.
    torque = max(drives.torque) / max(known["panda"].drives.torque)
    units = Units(force=given.pop("capacity") / 47.0, torque=torque)
    given |= {"payload": 0.3 * units.force, "force_noise": 0.4 * units.force, "units": units}
    return Arm(drives=drives, **given)


def _quadruped(given: dict[str, Any], known: Mapping[str, Any]) -> Quadruped:
    """A quadruped; one that is like Go2 is dynamically similar to it, at equal Froude numbers.

    Lengths grow with the leg, forces with the mass, times with the square root of the leg
    (Alexander and Jayes, A dynamic similarity hypothesis for the gaits of quadrupedal mammals, J.
    Zoology 1983); gains, limits and losses follow from their units.
    """
    joints = _joints(given.pop("joints"))
    given["rest"] = _repeated(given["rest"], len(joints))
    mass, leg, feet = given.pop("mass", 0.0), given.pop("leg", 0.0), given.pop("feet").split()
    if "like" not in given:
        radius = given.pop("radius")
        given["drives"] = _drives(joints, given["drives"])
        return Quadruped(feet=tuple(Ball(foot, radius) for foot in feet), **given)
    model, other = known[given.pop("like")], _TABLE["go2"]
    length, force = leg / other["leg"], mass / other["mass"]
    time, moment = sqrt(length), force * length
    nominal = model.drives
    drives = {
        "stiffness": moment * nominal.stiffness[0],
        "damping": moment * time * nominal.damping[0],
        "torque": given.pop("torque", [moment * limit for limit in nominal.torque]),
        "armature": moment * length * nominal.armature[0],
        "friction": moment * nominal.friction[0],
        "viscous": moment * time * nominal.viscous[0],
    }
    return Quadruped(
        drives=_drives(joints, drives),
        feet=tuple(Ball(foot, length * model.feet[0].radius) for foot in feet),
        period=time * model.period,
        height=length * model.height,
        speed=length / time * model.speed,
        turning=model.turning / time,
        force_gain=length / time / force * model.force_gain,
        payload=force * model.payload,
        force_noise=force * model.force_noise,
        **given,
    )


def _humanoid(given: dict[str, Any], known: Mapping[str, Any]) -> Humanoid:
    upper = given.pop("upper", {})
    if "same" in given:
        return _moving(replace(known[given["same"]], name=given["name"]), upper)
    joints, mass = _joints(given.pop("joints")), given.pop("mass", 0.0)
    given |= {"rest": _repeated(given["rest"], len(joints)), "effectors": _soles(given["soles"])}
    del given["soles"]
    if "like" in given:
        model = known[given.pop("like")]
        given |= _similar(model, mass / _TABLE[model.name]["mass"], given["centre"], joints)
    else:
        given |= {"stride": tuple(given["stride"]), "gains": Gains(**given["gains"])}
        given["drives"] = _drives(joints, given["drives"])
    return _moving(Humanoid(**given), upper) if upper else Humanoid(**given)


def _soles(given: dict[str, Any]) -> tuple[Sole, ...]:
    frames, mirrored = given.pop("frames").split(), given.pop("mirrored", False)
    given = {name: tuple(v) if isinstance(v, list) else v for name, v in given.items()}
    left, right = (Sole(frame, **given) for frame in frames)
    if mirrored:
        x, y, z = right.point
        right = replace(right, point=(x, -y, z))
    return left, right


def _similar(
    model: Humanoid, weight: float, centre: float, joints: tuple[str, ...]
) -> dict[str, Any]:
    """Drives, steps and stabilizer of another humanoid, scaled by weight and height.

    Dynamic similarity: with lengths in proportion to the height of the centre of mass and times to
    the period of a pendulum of that length, two robots of one shape have the same motion (Alexander
    and Jayes, as above).
    """
    length = centre / model.centre
    time, torque = length**0.5, weight * length
    scales = {
        "stiffness": torque, "damping": torque * time, "torque": torque,
        "armature": torque * length, "friction": torque, "viscous": torque * time,
    }  # fmt: skip
    along, across, turn = model.stride
    gains = model.gains
    return {
        "drives": Drivetrain(
            joints=joints,
            **{
                name: tuple(scale * value for value in getattr(model.drives, name))
                for name, scale in scales.items()
            },
        ),
        "stride": (along * length, across * length, turn),
        "pace": time,
        "gains": replace(
            gains,
            tilt=gains.tilt / (torque * time),
            height=gains.height * length / (weight * time),
        ),
        "payload": model.payload * weight,
        "force_noise": model.force_noise * weight,
        "size": length,
    }


def _moving(robot: Humanoid, upper: Mapping[str, Sequence[float]]) -> Humanoid:
    """The same humanoid with an upper body that moves: rest and reach of its joints, in [rad]."""
    drives = {
        name: (
            *getattr(robot.drives, name),
            *(share * getattr(robot.drives, name)[0],) * len(upper),
        )
        for name, share in UPPER.items()
    }
    rest, reach = zip(*upper.values(), strict=True)
    return replace(
        robot,
        drives=Drivetrain(joints=(*robot.drives.joints, *upper), **drives),
        rest=(*robot.rest, *rest),
        reach=reach,
        held={joint: angle for joint, angle in robot.held.items() if joint not in upper},
    )


_TABLE = tomllib.loads(Path(__file__).with_name("robots.toml").read_text(encoding="utf-8"))


def _read() -> Mapping[str, Simulated]:
    made = dict[str, Simulated]()
    families: dict[str, Any] = {"arm": _arm, "quadruped": _quadruped, "humanoid": _humanoid}
    for name, each in _TABLE.items():
        given = {**each, "name": name}
        made[name] = families[given.pop("family")](given, made)
    return MappingProxyType(made)


WIDE = _read()  # all robots of the wide domains, by name
ROBOTS: Mapping[str, Simulated] = MappingProxyType(
    {
        name: WIDE[name]
        for name in ("talos", "g1", "go2", "solo12", "anymal", "panda", "ur5", "ur10")
    }
)
"""The robots of the scenarios, by name."""
TARGETS = ("xarm7", "tiago_no_hand", "a1", "hyq", "talos")
"""Robots that nothing is learnt from, by choice or by licence (docs/robots.md)."""


@lru_cache(maxsize=8)
def limbs(name: str) -> Mapping[str, tuple[str, ...]]:
    """Driven joints from the base to each effector of a robot."""
    robot = ROBOTS[name]
    if len(robot.effectors) == 1:
        return {}
    model = Robot.load(name).model
    carriers = {
        effector.frame: model.frames[model.getFrameId(effector.frame)].parentJoint
        for effector in robot.effectors
    }
    return {
        frame: tuple(
            model.names[joint]
            for joint in model.supports[carrier]
            if model.names[joint] in robot.drives.joints
        )
        for frame, carrier in carriers.items()
    }
