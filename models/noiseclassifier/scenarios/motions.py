"""What plans are made of: clocks, smooth paths, shapes, contacts, loads; and motions as data."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeAlias

import numpy as np

from noisemodel.types import Array

TICK = 1e-3
"""Time between two ticks of control, in [s]."""
STEPS = 10
"""Samples per tick."""
STEP = TICK / STEPS
"""Time between two samples, in [s]."""
RATE = round(1 / STEP)
"""Samples per second, in [Hz]."""


def times(count: int, step: float) -> Array:
    """Equidistant times from 0 on, shape (count,), in [s]."""
    return np.arange(count, dtype=np.float64) * step


def minimum_jerk(share: Array) -> Array:
    """Minimum-jerk path from rest to rest, over time from 0 to 1.

    Flash and Hogan, The coordination of arm movements, J. Neuroscience 1985.
    """
    return share**3 * (10 - 15 * share + 6 * share**2)


def bump(share: Array) -> Array:
    """Path away and back over time from 0 to 1, 1 in the middle, at rest at both ends."""
    return np.asarray(16 * share**2 * (1 - share) ** 2)


@dataclass(frozen=True)
class Box:
    """A box that stands in the world.

    Attributes:
        centre: x, y, z of its centre, in [m].
        half: Half of its edge lengths, in [m].
        yaw: How far it is turned about the vertical, in [rad].
        since: When it appears, in [s]: a box where a foot stands would intersect the foot.
        until: When it vanishes, in [s].
    """

    centre: tuple[float, float, float]
    half: tuple[float, float, float]
    yaw: float = 0.0
    since: float = 0.0
    until: float = float("inf")

    @property
    def top(self) -> float:
        """Height of its upper face, in [m]."""
        return self.centre[2] + self.half[2]


@dataclass(frozen=True)
class Rod:
    """A rod with round ends on the z axis of a robot's frame, from the frame's origin outwards.

    Attributes:
        length: From the origin to the outermost point, in [m].
        radius: Radius of the rod and of its ends, in [m].
    """

    frame: str
    length: float
    radius: float

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
    """A flat sole whose lower face has its middle at a point of a robot's frame.

    Attributes:
        patch: Half of its length and of its width, in [m].
        point: Middle of the lower face, in the frame's axes, in [m].
        thickness: In [m].
    """

    frame: str
    patch: tuple[float, float]
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    thickness: float = 0.02


@dataclass(frozen=True)
class Ball:
    """A ball around the origin of a robot's frame.

    Attributes:
        radius: In [m].
    """

    frame: str
    radius: float

    @property
    def point(self) -> tuple[float, float, float]:
        """The point that the robot moves, in the frame's axes, in [m]."""
        return (0.0, 0.0, 0.0)

    @property
    def patch(self) -> tuple[float, float]:
        """Half of the extent of the contact area, in [m]."""
        return (self.radius, self.radius)


Effector: TypeAlias = Rod | Sole | Ball
"""A part of a robot that may be in contact with the environment."""


@dataclass(frozen=True)
class Contact:
    """A planned contact.

    Attributes:
        start: When the effector may first touch, in [s].
        lift: When it is to lift off, in [s].
        stop: When it must have lifted off, in [s].
        place: x, y, z of the surface there, in [m].
        yaw: Direction of the effector there, in [rad].
        approach: When it starts to descend to the place, in [s]; 0 for the first contact.
    """

    start: float
    lift: float
    stop: float
    place: tuple[float, float, float]
    effector: int = 0
    yaw: float = 0.0
    approach: float = 0.0

    def later(self, delay: float) -> "Contact":
        """The contact with all times later by a delay, in [s]."""
        return Contact(
            self.start + delay,
            self.lift + delay,
            self.stop + delay,
            self.place,
            self.effector,
            self.yaw,
            self.approach + delay,
        )


@dataclass(frozen=True)
class Event:
    """An event that may lead to a failure.

    Attributes:
        start: When it began, in [s].
        stop: When its cause ended, in [s].
    """

    label: str
    cause: str
    start: float
    stop: float
    facts: Mapping[str, Any] = field(default_factory=dict)


PUSH = "push of a hand"
"""Cause of the events of pushes, which velocities may not show."""


@dataclass(frozen=True, kw_only=True)
class Payload:
    """A mass that an effector holds for some time: its weight, its inertia left out.

    Attributes:
        start: When it is picked up, in [s].
        stop: When it is put down, in [s].
        mass: In [kg].
        rise: Time in which its weight appears and vanishes, in [s].
    """

    frame: str
    start: float
    stop: float
    mass: float
    rise: float = 0.08


@dataclass(frozen=True, kw_only=True)
class Collision:
    """An obstacle in the air, where an effector is at that time, that it pushes away.

    It breaks loose at its limit of force, then resists with less, and at last not at all.

    Attributes:
        start: When the effector meets it; if it is slow then, as soon as it is fast, in [s].
        hold: Time in which its resistance fades, in [s].
        stiffness: In [N/m].
        limit: Force at which it breaks loose, in [N].
    """

    frame: str
    start: float
    hold: float
    stiffness: float
    limit: float


@dataclass(frozen=True, kw_only=True)
class JointStop:
    """A mechanical end stop of a joint.

    Attributes:
        angle: Where it is, in [rad].
        stiffness: In [N m/rad].
    """

    joint: int
    angle: float
    side: int
    stiffness: float


@dataclass(frozen=True, kw_only=True)
class Push:
    """A hand that pushes at the centre of mass of a link.

    Attributes:
        start: When its force begins to rise, in [s].
        stop: When it has vanished, in [s].
        rise: Time in which it rises, in [s].
        fall: Time in which it falls, in [s].
        force: Its largest value, in the world's axes, in [N].
    """

    along: float
    start: float
    stop: float
    rise: float
    fall: float
    force: tuple[float, float, float]


Load: TypeAlias = Payload | Collision | JointStop | Push
"""A force on a robot from outside."""
Range: TypeAlias = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Picks:
    """An arm comes down on a table, presses, and goes up again.

    Attributes:
        hover: Height over the table at which it slows down, in [m].
        force: Contact force, in [N].
        duration: Default duration of a run, in [s].
    """

    way: str = "straight"
    hover: Range = (0.01, 0.01)
    force: Range = (15.0, 30.0)
    duration: float = 6.0


REACHES = ("minimum-jerk", "trapezoid", "spline", "sines", "teleoperation")
"""Kinds of joint-space movements."""


@dataclass(frozen=True, kw_only=True)
class Reach:
    """An arm moves its joints in the air, from rest to rest.

    Attributes:
        speed: Highest speed of a movement's fastest joint, in [rad/s].
        acceleration: Largest acceleration of a joint, in [rad/s²].
        spread: Furthest distance of a joint from its position at rest, in [rad].
        pause: Time between two movements; some are longer, in [s].
        stand: Time that it stands before its first movement, in [s].
        stops: Emergency stops per second, in [1/s]; the arm goes on after each.
        payload: Mass that it picks up and puts down, times the robot's unit of force, in [kg];
            (0, 0) for none.
        duration: Default duration of a run, in [s].
    """

    kind: str = "minimum-jerk"
    speed: Range = (0.3, 1.0)
    acceleration: float = 10.0
    spread: float = 0.6
    pause: Range = (0.05, 0.4)
    stops: float = 0.0
    payload: Range = (0.0, 0.0)
    stand: float = 0.2
    duration: float = 6.0


@dataclass(frozen=True, kw_only=True)
class Walk:
    """A humanoid walks.

    Attributes:
        height: How high the feet are lifted, in [m].
        single: Time on one foot, in [s].
        double: Time on both, in [s].
        drop: Height of a platform that it walks down from, in [m]; 0 on flat ground.
        duration: Default duration of a run, in [s].
    """

    way: str = "straight"
    height: Range = (0.05, 0.05)
    single: Range = (0.6, 0.9)
    double: Range = (0.12, 0.25)
    jitter: float = 0.05
    drop: float = 0.0
    duration: float = 7.0


@dataclass(frozen=True, kw_only=True)
class Trot:
    """A quadruped trots, or goes in another gait.

    Attributes:
        duration: Default duration of a run, in [s].
        pause: How long it stands each time, in [s].
    """

    way: str = "straight"
    height: Range = (1.0, 1.0)
    period: Range = (0.8, 1.2)
    jitter: float = 0.1
    duration: float = 5.0
    gait: str = "trot"
    speed: float = 1.0
    pauses: int = 0
    pause: Range = (0.5, 1.0)
    posing: Range = (0.0, 0.0)


Motion: TypeAlias = Picks | Reach | Walk | Trot
"""A motion of any family."""


@dataclass(frozen=True, kw_only=True)
class Gesture:
    """Movement of the upper body's joints around their rest; nothing for a robot without.

    Attributes:
        period: Of a sine, or duration of a reach, in [s].
    """

    way: str = "still"
    size: Range = (0.0, 0.0)
    period: Range = (1.0, 2.0)


@dataclass(frozen=True, kw_only=True)
class Stroll:
    """A humanoid walks, stops on the way, and moves its upper body.

    Attributes:
        pause: How long, in [s].
        duration: Default duration of a run, in [s].
    """

    walk: Walk
    stops: int = 0
    pause: Range = (1.0, 2.0)
    upper: Gesture = field(default_factory=Gesture)
    duration: float = 7.0


@dataclass(frozen=True, kw_only=True)
class Stand:
    """A humanoid stands on both feet; its centre of mass and its upper body move.

    Attributes:
        period: Of sway and squat, in [s], for a robot as high as TALOS; others have the same share
            of their own period.
        duration: Default duration of a run, in [s].
    """

    sway: Range = (0.0, 0.0)
    squat: Range = (0.0, 0.0)
    period: Range = (2.0, 4.0)
    upper: Gesture = field(default_factory=Gesture)
    duration: float = 7.0


@dataclass(frozen=True)
class Units:
    """Units that scale defects to the size of a robot.

    Attributes:
        length: In [m]; speeds in lengths per second scale with it too.
        force: In [N].
        torque: In [N m].
    """

    length: float = 1.0
    force: float = 1.0
    torque: float = 1.0


class Plan(Protocol):
    """Plan of a motion, as far as defects depend on it."""

    @property
    def time(self) -> Array:
        """Time of each tick, shape (ticks,), in [s]."""
        ...

    @property
    def duration(self) -> float:
        """Duration, in [s]."""
        ...

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The planned contacts."""
        ...

    @property
    def effectors(self) -> tuple[Effector, ...]:
        """The effectors."""
        ...

    @property
    def ground(self) -> tuple[Box, ...]:
        """The ground."""
        ...

    @property
    def units(self) -> Units:
        """The units of the robot."""
        ...
