"""Motions, faults and sizes of arms in wide domains."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from noiseclassifier.scenarios.arm.reaching import KINDS
from noiseclassifier.scenarios.arm.robots import Arm
from noiseclassifier.scenarios.case import BANDS
from noiseclassifier.scenarios.defects import (
    Collisions,
    Defect,
    ForceGain,
    GivingWay,
    JointStops,
    Multisine,
    Obstacles,
    Pushes,
    ReferenceJumps,
    SensorJumps,
)
from noiseclassifier.scenarios.limits import Limits
from noiseclassifier.scenarios.motions import Picks, Range, Reach

PICKS = 0.35
"""Share of motions that are picks."""
SLOWEST = 0.05
"""Lowest peak speed of a joint in a movement, in [rad/s]."""
FASTEST = (0.5, 2.5)
"""Highest peak speed, mild and wild, in [rad/s]."""
STANDS = 0.3
"""Share of motions in the air that begin with standing for a while."""
STANDING = (1.5, 4.0)
"""How long they stand, in [s]."""


def motion(
    rng: np.random.Generator, wildness: float, arm: Arm | None = None, *, soft: bool = False
) -> Picks | Reach:
    """Motion of an arm."""
    picks, kind, way = rng.uniform(size=3).tolist()
    fast, hard, wide, stops, carries, pace, force = rng.uniform(size=7).tolist()
    stands, long = rng.uniform(size=2).tolist()
    if picks < PICKS and (arm is None or arm.reach is not None):
        ways = ("straight", "curve", "directions", "spot")
        low = 10.0 + 10.0 * force
        return Picks(
            way=ways[int(way * len(ways))],
            hover=(0.005, 0.01 + 0.02 * wildness),
            force=(low, low + 20.0),
        )
    fastest = SLOWEST * (_mixed(FASTEST, wildness) / SLOWEST) ** (0.45 + 0.55 * fast)
    return Reach(
        kind=tuple(KINDS)[int(kind * len(KINDS))],
        speed=(max(SLOWEST, fastest / 3), fastest),
        acceleration=4.0 + hard * (4.0 + 12.0 * wildness),
        spread=0.3 + wide * (0.3 + 0.7 * wildness),
        pause=(0.0, 0.1 + 0.5 * pace),
        stops=0.3 * wildness if stops < 0.5 * wildness else 0.0,
        payload=(0.1, 0.5 + 1.5 * wildness) if carries < 0.2 + 0.4 * wildness else (0.0, 0.0),
        stand=_mixed(STANDING, long) if stands < STANDS else 0.2,
    )


LIMITS = Limits(flexibility=12.0)
"""An arm does not fall."""


def _mixed(span: Range, share: float) -> float:
    return span[0] + share * (span[1] - span[0])


DEFECTS: Mapping[str, Defect] = {
    "collision-soft": Collisions(stiffness=(1e3, 1e4), limit=(10.0, 80.0)),
    "collision-hard": Collisions(stiffness=(1e4, 1e5), limit=(30.0, 150.0)),
    "joint-stop": JointStops(),
    "obstacle": Obstacles((0.004, 0.06), (0.05, 0.05), share=0.7),
    "giving-way": GivingWay((0.004, 0.015), (0.05, 0.05), (0.3, 0.5)),
    "force-gain": ForceGain((5.0, 9.0)),
    "force-jump": SensorJumps((80.0, 160.0)),
    "reference-jump": ReferenceJumps(distance=(0.0005, 0.006), speed=(0.05, 2.0)),
    "multisine": Multisine(BANDS, (0.00005, 0.002), fastest=1.0),
    "push": Pushes(),
}
"""Faults by name; `suited` has those that can act in a motion."""

_ON_CONTACT = ("obstacle", "giving-way", "force-gain", "force-jump")


def suited(motion: Picks | Reach) -> tuple[str, ...]:
    """Names of the faults that can act in a motion."""
    idle: tuple[str, ...] = _ON_CONTACT if isinstance(motion, Reach) else ("joint-stop",)
    if isinstance(motion, Picks) and motion.way == "directions":
        idle += _ON_CONTACT
    return tuple(name for name in DEFECTS if name not in idle)


def scaled(arm: Arm, factor: float) -> Arm:
    """An arm of another size."""
    tool = replace(arm.tool, length=arm.tool.length * factor, radius=arm.tool.radius * factor)
    reach = arm.reach
    if reach is not None:
        (x0, x1), (y0, y1) = reach
        reach = ((x0 * factor, x1 * factor), (y0 * factor, y1 * factor))
    return replace(
        arm,
        tool=tool,
        table=arm.table * factor,
        reach=reach,
        length_scale=arm.length_scale * factor,
    )
