"""Wide distributions of quadrupeds: motions, faults, sizes, and the drives that bear them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import sqrt
from types import MappingProxyType
from typing import TYPE_CHECKING, cast

import numpy as np

from noiseclassifier.scenarios.defects import Decalibration, Defect, Obstacles, Plan, Range
from noiseclassifier.scenarios.faults import Faults
from noiseclassifier.scenarios.limits import Limits
from noiseclassifier.scenarios.motions import Trot
from noiseclassifier.scenarios.quadruped.cases import QUADRUPED
from noiseclassifier.scenarios.quadruped.robots import Quadruped
from noiseclassifier.scenarios.shapes import Ball

if TYPE_CHECKING:
    from noiseclassifier.scenarios.quadruped.trotting import Plan as Steps

GAITS: Mapping[str, float] = MappingProxyType(
    {"trot": 0.5, "walk": 0.25, "pace": 0.1, "stand": 0.15}
)
"""Probability of each gait; a bound is left out, long robots slip in it."""
WAYS = ("straight", "curve", "directions", "spot")
SPREAD: Mapping[str, tuple[Range, Range]] = MappingProxyType(
    {
        "period": ((0.9, 1.1), (0.72, 1.35)),
        "height": ((0.9, 1.1), (0.5, 1.5)),
        "speed": ((0.5, 1.0), (0.2, 1.4)),
        "jitter": ((0.0, 0.05), (0.0, 0.2)),
        "posing": ((0.0, 0.3), (0.2, 1.0)),
    }
)
"""Range of each setting of `noiseclassifier.scenarios.motions.Trot`, mild and wild."""
QUICK: Mapping[str, float] = MappingProxyType({"trot": 0.7, "walk": 0.8})
"""Longest period of each gait on soft drives, as `scenarios.motions.Trot` has it."""
ADVANCE = 0.3
"""Shortest way over which a step down may come, as a share of the height of the robot."""


def motion(
    rng: np.random.Generator,
    wildness: float,
    robot: Quadruped | None = None,
    *,
    soft: bool = False,
) -> Trot:
    """Random motion."""
    gait = str(rng.choice(list(GAITS), p=list(GAITS.values())))

    def draw(name: str) -> float:
        mild, wild = (np.array(span) for span in SPREAD[name])
        return float(rng.uniform(*(mild + wildness * (wild - mild))))

    period, height, posing = draw("period"), draw("height"), draw("posing")
    moves_body = gait == "stand" or float(rng.uniform()) < 0.4 * wildness
    pauses = int(rng.binomial(2, 0.4 * wildness)) if gait != "stand" else 0
    drawn = Trot(
        gait=gait,
        way=str(rng.choice(WAYS)),
        period=(period, period),
        height=(height, height),
        speed=draw("speed"),
        jitter=draw("jitter"),
        posing=(posing, posing) if moves_body else (0.0, 0.0),
        pauses=pauses,
        duration=5.0 + 1.5 * pauses,
    )
    return steady(drawn) if soft else drawn


def steady(motion: Trot) -> Trot:
    """The motion on soft drives: quick steps, which catch the body in time.

    A pace, in which feet rattle, becomes a trot; a stand stays.
    """
    gait = "trot" if motion.gait == "pace" else motion.gait
    if gait not in QUICK:
        return motion
    shortest, longest = (min(period, QUICK[gait]) for period in motion.period)
    return replace(motion, gait=gait, period=(shortest, longest))


LIMITS = Limits(
    stiffness=(0.1, 1.5), damping=(0.15, 1.5), delay=0.01, hold=0.02, feedforward=0.6,
    flexibility=40.0,
)  # fmt: skip
"""Common to all quadrupeds, with delays no longer than their gains bear."""


def suited(motion: Trot) -> tuple[str, ...]:
    """Names of the faults that can act in a motion."""
    steps = tuple(name for name, defect in DEFECTS.items() if isinstance(defect, Underfoot | Ahead))
    return tuple(name for name in DEFECTS if motion.gait != "stand" or name not in steps)


def scaled(robot: Quadruped, factor: float) -> Quadruped:
    """A quadruped of another size, at equal Froude numbers; masses and gains stay."""
    time = sqrt(factor)
    front_left, front_right, rear_left, rear_right = (
        Ball(foot.frame, factor * foot.radius) for foot in robot.feet
    )
    return replace(
        robot,
        feet=(front_left, front_right, rear_left, rear_right),
        period=time * robot.period,
        height=factor * robot.height,
        speed=time * robot.speed,
        turning=robot.turning / time,
        length_scale=factor * robot.length_scale,
    )


@dataclass(frozen=True)
class Underfoot:
    """Boxes under feet, lower than the feet are lifted."""

    feet: tuple[int, ...]
    rise: Range = (0.35, 0.65)
    half: float = 0.2
    share: float = 1.0
    most: int | None = 2

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Put boxes at some of the planned contacts; none if no foot is lifted."""
        lift = float(np.ptp(cast("Steps", plan).feet[..., 2]))
        if not lift:
            return Faults()
        low, high = self.rise
        half = self.half * plan.units.length
        return Obstacles(
            (low * lift, high * lift),
            (half, half),
            effectors=self.feet,
            share=self.share,
            most=self.most,
        ).draw(rng, plan)


@dataclass(frozen=True)
class Ahead:
    """A defect that acts only if the feet get ahead of where they stand at first."""

    defect: Defect

    def draw(self, rng: np.random.Generator, plan: Plan) -> Faults:
        """Draw the faults; none for a plan that does not advance."""
        ways = [contact.place[0] for contact in plan.contacts]
        first = max(contact.place[0] for contact in plan.contacts if contact.start <= 0)
        if max(ways) < first + ADVANCE * plan.units.length:
            return Faults()
        return self.defect.draw(rng, plan)


_REUSED = ("force-jump", "torque-jump", "limit-cycle", "faint-oscillation", "reference-jump")
_SINES = tuple(name for name in QUADRUPED if name.startswith("multisine"))

DEFECTS: Mapping[str, Defect] = MappingProxyType(
    {
        "obstacle-full": Underfoot((0, 1, 2, 3)),
        "obstacle-front": Underfoot((0, 1)),
        "obstacle-hind": Underfoot((2, 3)),
        "obstacle-left": Underfoot((0, 2)),
        "obstacle-right": Underfoot((1, 3)),
        "early": Underfoot((0, 2), rise=(0.3, 0.5), share=0.4, most=None),
        "platform": Ahead(QUADRUPED["platform"].defect),
        "decalibrated": Decalibration(tuple(range(12)), (0.03, 0.15), either=True),
        **{name: QUADRUPED[name].defect for name in (*_SINES, *_REUSED)},
    }
)
"""Faults of quadrupeds, by name; one that cannot act in a plan draws nothing."""
