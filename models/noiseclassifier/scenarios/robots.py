"""The robots that can be simulated: what robots.toml has of them, and what follows from it."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import pi, sqrt
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Self

from noiseclassifier.scenarios.motions import Effector, Sole, Tip, Units, multiplied

LEGS = 12  # how many of a humanoid's drives, the first ones, are in its legs
# Drives of an upper body, relative to the legs' drives.
UPPER = {
    "stiffness": 0.2, "damping": 0.2, "torque": 0.25,
    "armature": 0.2, "friction": 0.2, "viscous": 0.2,
}  # fmt: skip


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
class Simulated:
    """What robots of all families have."""

    family: ClassVar[str]
    lengths: ClassVar[tuple[str, ...]]  # settings that are lengths
    name: str  # as `noisemodel.ROBOTS` lists it
    drives: Drivetrain
    effectors: tuple[Effector, ...]
    rest: tuple[float, ...]  # joint positions at rest, or near it, in [rad]
    payload: float  # largest mass that the controller has no model of, in [kg]
    force_noise: float  # largest standard deviation of the force sensors' noise, in [N]
    held: dict[str, float] = field(default_factory=dict)  # locked joints that are not at 0
    length_scale: float = 1.0  # of all lengths of the URDF

    def scaled(self, factor: float) -> Self:
        """The same robot with all lengths times a factor; masses and gains stay."""
        grown = (*self.lengths, "length_scale")
        sizes = {name: multiplied(getattr(self, name), factor) for name in grown}
        effectors = tuple(
            replace(
                each, **{n: multiplied(v, factor) for n, v in vars(each).items() if n != "frame"}
            )
            for each in self.effectors
        )
        return replace(self, effectors=effectors, **sizes)


@dataclass(frozen=True, kw_only=True)
class Arm(Simulated):
    """An arm that picks from a table or moves in the air; its tool points down if it picks."""

    family = "arm"
    lengths = ("table", "reach")
    effectors: tuple[Tip]
    payload: float = 0.3
    force_noise: float = 0.4
    table: float = 0.0  # height of the table, in [m]
    reach: tuple[tuple[float, float], ...] | None = None  # of x and y on the table, in [m]
    contact: float = 0.015  # time constant of the tool's rubber tip, in [s]
    force_gain: float = 1e-3  # speed of the tool per error of the contact force, in [m/(s N)]
    force_filter: float = 0.005  # time constant of the low-pass on the contact force, in [s]
    units: Units = field(default_factory=Units)

    @property
    def tool(self) -> Tip:
        """Its only effector."""
        return self.effectors[0]


@dataclass(frozen=True, kw_only=True)
class Quadruped(Simulated):
    """A robot on four legs with round feet."""

    family = "quadruped"
    lengths = ("height",)
    effectors: tuple[Tip, ...]
    period: float  # nominal time of a cycle, in which each foot steps once, in [s]
    height: float  # nominal height of a swing, in [m]
    speed: float  # highest speed ahead, in [m/s]
    turning: float = 0.5  # highest speed of turning, in [rad/s]
    attitude_gain: float = 0.6
    attitude_filter: float = 0.01  # time constant of the low-pass on the attitude, in [s]
    force_gain: float  # speed of a foot per error of its contact force, in [m/(s N)]
    force_filter: float = 0.01  # time constant of the low-pass on the contact forces, in [s]

    def scaled(self, factor: float) -> Self:
        """A quadruped of another size, at equal Froude numbers; masses and gains stay."""
        time = sqrt(factor)
        return replace(
            super().scaled(factor),
            period=time * self.period,
            speed=time * self.speed,
            turning=self.turning / time,
        )


@dataclass(frozen=True, kw_only=True)
class Gains:
    """Gains of a stabilizer."""

    capture: float = 2.0
    integral: float = 1.0  # its rate per error, in [1/s]
    tilt: float  # rate of a sole's tilt per error of its torque, in [rad/(s N m)]
    level: float = 0.5  # rate at which soles return to level, in [1/s]
    height: float  # rate of the feet's difference in height per that of forces, in [m/(s N)]
    even: float = 1.0  # rate at which that difference decays, in [1/s]
    filter: float = 0.02  # time constant of the low-pass on forces and torques, in [s]


@dataclass(frozen=True, kw_only=True)
class Humanoid(Simulated):
    """A humanoid that walks on two soles."""

    family = "humanoid"
    lengths = ("centre", "apart", "stride")
    effectors: tuple[Sole, Sole]
    centre: float  # height of the centre of mass over the soles, in [m]
    apart: float  # half of the distance between the feet, in [m]
    stride: tuple[float, float]  # longest step forwards and sideways, in [m]
    turn: float = 0.15  # most that a step turns, in [rad]
    pace: float = 1.0
    gains: Gains
    carrier: str
    size: float = 1.0
    reach: tuple[float, ...] = ()  # most that joints of the upper body leave their rest, in [rad]


def _repeated(values: float | tuple[float, ...], count: int) -> tuple[float, ...]:
    values = values if isinstance(values, tuple) else (values,)
    return values * (count // len(values))


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

    Gains give each joint alone, with all others at rest, a natural frequency of 8 Hz and half the
    critical damping.
    """
    rate, torque = 2 * pi * 8.0, _repeated(given["torque"], len(joints))
    armature = multiplied(torque, 0.005)
    moved = tuple(link + drive for link, drive in zip(given["inertia"], armature, strict=True))
    return Drivetrain(
        joints=joints,
        stiffness=multiplied(moved, rate**2),
        damping=multiplied(moved, rate),
        torque=torque,
        armature=armature,
        friction=multiplied(torque, 0.01),
        viscous=multiplied(torque, 0.006),
    )


def similar_drives(model: Drivetrain, length: float, force: float) -> dict[str, Any]:
    """Drives of a dynamically similar robot, by the ratios of lengths and of forces.

    Times scale as a pendulum's of their length (Alexander and Jayes, J. Zoology 1983).
    """
    time, torque = sqrt(length), force * length
    scales = {
        "stiffness": torque, "damping": torque * time, "torque": torque,
        "armature": torque * length, "friction": torque, "viscous": torque * time,
    }  # fmt: skip
    return {name: multiplied(getattr(model, name), scale) for name, scale in scales.items()}


def _arm(given: dict[str, Any], known: Mapping[str, Any]) -> Arm:
    joints = _joints(given.pop("joints"))
    given["effectors"] = (Tip(**given.pop("tool")),)
    if "drives" in given:
        return Arm(**given | {"drives": _drives(joints, given["drives"])})
    drives = _nominal(joints, given.pop("nominal"))
    # Units of force and torque are 1 for Panda, which bears 47 N.
    torque = max(drives.torque) / max(known["panda"].drives.torque)
    units = Units(force=given.pop("capacity") / 47.0, torque=torque)
    given |= {"payload": 0.3 * units.force, "force_noise": 0.4 * units.force}
    return Arm(drives=drives, units=units, **given)


def _quadruped(given: dict[str, Any], known: Mapping[str, Any]) -> Quadruped:
    """A quadruped; one that is like Go2 is similar to it, by mass and leg."""
    joints = _joints(given.pop("joints"))
    given["rest"] = _repeated(given["rest"], len(joints))
    mass, leg, feet = given.pop("mass", 0.0), given.pop("leg", 0.0), given.pop("feet").split()
    if "like" not in given:
        radius, drives = given.pop("radius"), given.pop("drives")
    else:
        model, other = known[given.pop("like")], _TABLE["go2"]
        length, force = leg / other["leg"], mass / other["mass"]
        time, radius = sqrt(length), length * model.effectors[0].radius
        drives = similar_drives(model.drives, length, force)
        if "torque" in given:
            drives["torque"] = given.pop("torque")
        given |= {
            "period": time * model.period,
            "height": length * model.height,
            "speed": length / time * model.speed,
            "turning": model.turning / time,
            "force_gain": length / time / force * model.force_gain,
            "payload": force * model.payload,
            "force_noise": force * model.force_noise,
        }
    tips = tuple(Tip(foot, radius) for foot in feet)
    return Quadruped(drives=_drives(joints, drives), effectors=tips, **given)


def _humanoid(given: dict[str, Any], known: Mapping[str, Any]) -> Humanoid:
    """A humanoid; one that is like another is similar to it, by mass and height."""
    upper = given.pop("upper", {})
    if "same" in given:
        return _moving(replace(known[given["same"]], name=given["name"]), upper)
    joints, mass = _joints(given.pop("joints")), given.pop("mass", 0.0)
    given |= {"rest": _repeated(given["rest"], len(joints)), "effectors": _soles(given["soles"])}
    del given["soles"]
    if "like" in given:
        model = known[given.pop("like")]
        given |= similar(model, mass / _TABLE[model.name]["mass"], given["centre"])
    else:
        given["gains"] = Gains(**given["gains"])
    given["drives"] = _drives(joints, given["drives"])
    return _moving(Humanoid(**given), upper) if upper else Humanoid(**given)


def _soles(given: dict[str, Any]) -> tuple[Sole, Sole]:
    frames, mirrored = given.pop("frames").split(), given.pop("mirrored", False)
    left, right = (Sole(frame, **given) for frame in frames)
    if mirrored:
        x, y, z = right.point
        right = replace(right, point=(x, -y, z))
    return left, right


def similar(model: Humanoid, weight: float, centre: float) -> dict[str, Any]:
    """Drives, steps and stabilizer of another humanoid, by the ratio of weights and its height."""
    length = centre / model.centre
    time, torque = sqrt(length), weight * length
    gains = {
        "tilt": model.gains.tilt / (torque * time),
        "height": model.gains.height * length / (weight * time),
    }
    return {
        "drives": similar_drives(model.drives, length, weight),
        "stride": multiplied(model.stride, length),
        "pace": time,
        "gains": replace(model.gains, **gains),
        "payload": model.payload * weight,
        "force_noise": model.force_noise * weight,
        "size": length,
    }


def _moving(robot: Humanoid, upper: Mapping[str, Sequence[float]]) -> Humanoid:
    """The same humanoid with an upper body that moves: rest and reach of its joints, in [rad]."""
    drives = {
        name: (*legs, *(share * legs[0],) * len(upper))
        for name, share in UPPER.items()
        for legs in (getattr(robot.drives, name),)
    }
    rest, reach = zip(*upper.values(), strict=True)
    return replace(
        robot,
        drives=Drivetrain(joints=(*robot.drives.joints, *upper), **drives),
        rest=(*robot.rest, *rest),
        reach=reach,
        held={joint: angle for joint, angle in robot.held.items() if joint not in upper},
    )


def settings(file: str) -> dict[str, Any]:
    """What a TOML file beside this module has, its lists as tuples."""

    def fixed(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: fixed(each) for name, each in value.items()}
        return tuple(map(fixed, value)) if isinstance(value, list) else value

    table: dict[str, Any] = fixed(tomllib.loads(Path(__file__).with_name(file).read_text("utf-8")))
    return table


_TABLE = settings("robots.toml")


def _read() -> Mapping[str, Simulated]:
    made = dict[str, Simulated]()
    families: dict[str, Any] = {"arm": _arm, "quadruped": _quadruped, "humanoid": _humanoid}
    for name, each in _TABLE.items():
        given = {**each, "name": name}
        made[name] = families[given.pop("family")](given, made)
    return MappingProxyType(made)


WIDE = _read()  # all robots of the wide domains, by name
# The robots of the scenarios, by name.
ROBOTS: Mapping[str, Simulated] = MappingProxyType(
    {
        name: WIDE[name]
        for name in ("talos", "g1", "go2", "solo12", "anymal", "panda", "ur5", "ur10")
    }
)
# Robots that are never trained on, by choice or by licence (docs/robots.md).
TARGETS = ("xarm7", "tiago_no_hand", "a1", "hyq", "talos")
