"""The motions of the scenarios, as data.

Each family plans its own: ``scenarios.arm``, ``scenarios.humanoid``, ``scenarios.quadruped``. A
motion that is equal makes an equal plan of an equal seed, so that runs with different defects
share their twin.
"""

from dataclasses import dataclass
from typing import TypeAlias

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
