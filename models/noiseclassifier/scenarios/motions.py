"""What plans are made of: clocks, paths, shapes, contacts, loads, motions as data; and errors."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from typing import Any, Self, TypeAlias

import numpy as np

from noisemodel.types import Array

TICK = 1e-3  # time between two ticks of control, in [s]
STEPS = 10  # samples per tick
STEP = TICK / STEPS  # time between two samples, in [s]
RATE = round(1 / STEP)  # samples per second, in [Hz]
Rng: TypeAlias = np.random.Generator
Signal: TypeAlias = Callable[[Array], Array]  # from times, in [s], to values, shape (times, ...)


class ScenarioError(ValueError):
    """The base of every error that `scenarios` expects."""


class DatasetError(ScenarioError):
    """A data set that cannot be made, or a file of one that cannot be read."""


class SimulationError(ScenarioError):
    """A run that diverged, or in which the robot fell, at a time in [s]."""

    def __init__(self, time: float, problem: str, run: str = "the robot") -> None:
        self.time, self.problem = time, problem
        super().__init__(
            f"{run} went out of control at {time:.3f} s ({problem});"
            " such a run is not used, take another seed"
        )


def unknown(what: str, name: str, known: Iterable[str]) -> ScenarioError:
    """The error for a name that is not known, with the closest one as a hint."""
    known = list(known)
    close = get_close_matches(name, known, n=1)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    return ScenarioError(f"{what}{hint}; there are {', '.join(known)}")


def times(count: int, step: float) -> Array:
    """Equidistant times from 0 on, shape (count,), in [s]."""
    return np.arange(count, dtype=np.float64) * step


def minimum_jerk(share: Array) -> Array:
    """Minimum-jerk path from rest to rest, over time from 0 to 1.

    Flash and Hogan, The coordination of arm movements, J. Neuroscience 1985.
    """
    return share**3 * (10 - 15 * share + 6 * share**2)


def multiplied(value: Any, factor: float) -> Any:
    """A value, or nested tuples of values, times a factor; None stays."""
    if isinstance(value, tuple):
        return tuple(multiplied(each, factor) for each in value)
    return value if value is None else factor * value


@dataclass(frozen=True)
class Box:
    """A box that stands in the world."""

    centre: tuple[float, float, float]  # x, y, z of its centre, in [m]
    half: tuple[float, float, float]  # half of its edge lengths, in [m]
    yaw: float = 0.0  # how far it is turned about the vertical, in [rad]
    since: float = 0.0  # when it appears, in [s]: a box where a foot stands would intersect it
    until: float = float("inf")  # when it vanishes, in [s]

    @property
    def top(self) -> float:
        """Height of its upper face, in [m]."""
        return self.centre[2] + self.half[2]


@dataclass(frozen=True)
class Tip:
    """A rod with round ends on the z axis of a frame, from its origin on; a ball if length is 0."""

    frame: str
    radius: float  # in [m]
    length: float = 0.0  # from the origin to the outermost point, in [m]

    @property
    def point(self) -> tuple[float, float, float]:
        """The point that the robot moves, in the frame's axes, in [m]."""
        return (0.0, 0.0, self.length)

    @property
    def patch(self) -> tuple[float, float]:
        """Half of the extent of the contact area, in [m]."""
        return (self.radius, self.radius)


@dataclass(frozen=True)
class Sole:
    """A flat sole whose lower face has its middle at a point of a robot's frame."""

    frame: str
    patch: tuple[float, float]  # half of its length and of its width, in [m]
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)  # that middle, in the frame's axes, in [m]
    thickness: float = 0.02  # in [m]


Effector: TypeAlias = Tip | Sole  # a part of a robot that may touch the environment


@dataclass(frozen=True)
class Contact:
    """A planned contact."""

    start: float  # when the effector may first touch, in [s]
    lift: float  # when it is to lift off, in [s]
    stop: float  # when it must have lifted off, in [s]
    place: tuple[float, float, float]  # x, y, z of the surface there, in [m]
    effector: int = 0
    yaw: float = 0.0  # direction of the effector there, in [rad]
    approach: float = 0.0  # when it starts to descend to the place, in [s]; 0 for the first contact

    def later(self, delay: float) -> "Contact":
        """The contact with all times later by a delay, in [s]."""
        times = ("start", "lift", "stop", "approach")
        return replace(self, **{name: getattr(self, name) + delay for name in times})


@dataclass(frozen=True)
class Event:
    """An event that may lead to a failure."""

    label: str
    cause: str
    start: float  #: when it began, in [s]
    stop: float  #: when its cause ended, in [s]
    facts: Mapping[str, Any] = field(default_factory=dict)


PUSH = "push of a hand"  # cause of the events of pushes, which velocities may not show


@dataclass(frozen=True, kw_only=True)
class Payload:
    """A mass that an effector holds for some time: its weight, its inertia left out."""

    frame: str
    start: float  # when it is picked up, in [s]
    stop: float  # when it is put down, in [s]
    mass: float  # in [kg]
    rise: float = 0.08  # time in which its weight appears and vanishes, in [s]


@dataclass(frozen=True, kw_only=True)
class Collision:
    """An obstacle in the air that gives way at its limit of force, and fades."""

    frame: str
    start: float  # when the effector meets it; if it is slow then, as soon as it is fast, in [s]
    hold: float  # time in which its resistance fades, in [s]
    stiffness: float  # in [N/m]
    limit: float  # force at which it breaks loose, in [N]


@dataclass(frozen=True, kw_only=True)
class JointStop:
    """A mechanical end stop of a joint."""

    joint: int
    angle: float  # where it is, in [rad]
    side: int
    stiffness: float  # in [N m/rad]


@dataclass(frozen=True, kw_only=True)
class Push:
    """A hand that pushes at the centre of mass of a link."""

    along: float
    start: float  # when its force begins to rise, in [s]
    stop: float  # when it has vanished, in [s]
    rise: float  # time in which it rises, in [s]
    fall: float  # time in which it falls, in [s]
    force: tuple[float, float, float]  # its largest value, in the world's axes, in [N]


Load: TypeAlias = Payload | Collision | JointStop | Push  # A force on a robot from outside
Range: TypeAlias = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Picks:
    """An arm comes down on a table, presses, and goes up again."""

    way: str = "straight"
    hover: Range = (0.01, 0.01)  # height over the table at which it slows down, in [m]
    force: Range = (15.0, 30.0)  # contact force, in [N]
    duration: float = 6.0  # default duration of a run, in [s]


# Kinds of joint-space movements.
REACHES = ("minimum-jerk", "trapezoid", "spline", "sines", "teleoperation")


@dataclass(frozen=True, kw_only=True)
class Reach:
    """An arm moves its joints in the air, from rest to rest."""

    kind: str = "minimum-jerk"
    speed: Range = (0.3, 1.0)  # highest speed of a movement's fastest joint, in [rad/s]
    acceleration: float = 10.0  # largest acceleration of a joint, in [rad/s²]
    spread: float = 0.6  # furthest distance of a joint from its position at rest, in [rad]
    pause: Range = (0.05, 0.4)  # time between two movements; some are longer, in [s]
    stops: float = 0.0  # emergency stops per second, in [1/s]; the arm goes on after each
    payload: Range = (0.0, 0.0)  # mass that it carries, by the robot's unit of force, in [kg]
    stand: float = 0.2  # time that it stands before its first movement, in [s]
    duration: float = 6.0  # default duration of a run, in [s]


@dataclass(frozen=True, kw_only=True)
class Walk:
    """A humanoid walks."""

    way: str = "straight"
    height: Range = (0.05, 0.05)  # how high the feet are lifted, in [m]
    single: Range = (0.6, 0.9)  # time on one foot, in [s]
    double: Range = (0.12, 0.25)  # time on both, in [s]
    jitter: float = 0.05
    drop: float = 0.0  # height of a platform that it walks down from, in [m]; 0 on flat ground
    duration: float = 7.0  # default duration of a run, in [s]


@dataclass(frozen=True, kw_only=True)
class Trot:
    """A quadruped trots, or goes in another gait."""

    way: str = "straight"
    height: Range = (1.0, 1.0)
    period: Range = (0.8, 1.2)
    jitter: float = 0.1
    duration: float = 5.0  # default duration of a run, in [s]
    gait: str = "trot"
    speed: float = 1.0
    pauses: int = 0
    pause: Range = (0.5, 1.0)  # how long it stands each time, in [s]
    posing: Range = (0.0, 0.0)
    landing: float = 0.1  # speed at which feet land, in heights of a swing per time of descent
    blind: bool = False  # whether the control knows no contact forces


Motion: TypeAlias = Picks | Reach | Walk | Trot  # A motion of any family


@dataclass(frozen=True, kw_only=True)
class Gesture:
    """Movement of the upper body's joints around their rest; nothing for a robot without."""

    way: str = "still"
    size: Range = (0.0, 0.0)
    period: Range = (1.0, 2.0)  # of a sine, or duration of a reach, in [s]


@dataclass(frozen=True, kw_only=True)
class Stroll:
    """A humanoid walks, stops on the way, and moves its upper body."""

    walk: Walk
    stops: int = 0
    pause: Range = (1.0, 2.0)  # how long, in [s]
    upper: Gesture = field(default_factory=Gesture)
    duration: float = 7.0  # default duration of a run, in [s]


@dataclass(frozen=True, kw_only=True)
class Stand:
    """A humanoid stands on both feet; its centre of mass and its upper body move."""

    sway: Range = (0.0, 0.0)
    squat: Range = (0.0, 0.0)
    period: Range = (2.0, 4.0)  # of sway and squat of TALOS, in [s]; others' by their size
    upper: Gesture = field(default_factory=Gesture)
    duration: float = 7.0  # default duration of a run, in [s]


@dataclass(frozen=True)
class Units:
    """Units that scale defects to the size of a robot."""

    length: float = 1.0  # in [m]; speeds in lengths per second scale with it too
    force: float = 1.0  # in [N]
    torque: float = 1.0  # in [N m]


@dataclass(frozen=True, eq=False, kw_only=True)
class Plan:
    """Plan of a motion; its arrays have a row per tick."""

    places: Array  # of the effectors, shape (ticks, effectors, 3), in [m]
    effectors: tuple[Effector, ...]
    contacts: tuple[Contact, ...] = ()
    ground: tuple[Box, ...] = ()
    payloads: tuple[Payload, ...] = ()
    torques: tuple[float, ...] = ()  # limits of the drives, in [N m]
    units: Units = Units()

    @property
    def time(self) -> Array:
        """Time of each tick, shape (ticks,), in [s]."""
        return times(len(self.places), TICK)

    @property
    def duration(self) -> float:
        """Duration, in [s]."""
        return len(self.places) * TICK

    def after(self, ticks: int) -> Self:
        """The plan after some ticks of rest."""
        rested: dict[str, Any] = {
            name: np.concatenate((np.repeat(signal[:1], ticks, axis=0), signal))
            for name, signal in vars(self).items()
            if isinstance(signal, np.ndarray)
        }
        contacts = tuple(contact.later(ticks * TICK) for contact in self.contacts)
        return replace(self, contacts=contacts, **rested)

    def shifted(self, shift: Signal | None) -> Self:
        """The plan with something added to the places of its effectors."""
        return self if shift is None else replace(self, places=self.places + shift(self.time))
