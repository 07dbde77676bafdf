"""What the wide domains draw for humanoids: motions, faults, and how soft drives may be."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from noiseclassifier.scenarios.case import BANDS
from noiseclassifier.scenarios.defects import (
    Decalibration,
    Defect,
    ForceGain,
    Multisine,
    Obstacles,
    Overhang,
    ReferenceJumps,
    Scaled,
    SensorJumps,
)
from noiseclassifier.scenarios.humanoid.motions import Gesture, Stand, Stroll
from noiseclassifier.scenarios.humanoid.robots import LEGS, Humanoid, scaled
from noiseclassifier.scenarios.limits import Limits, Range
from noiseclassifier.scenarios.motions import Walk

__all__ = ["DEFECTS", "GAITS", "LIMITS", "motion", "scaled", "suited"]

GAITS: Mapping[str, Walk] = MappingProxyType(
    {
        "walk": Walk(),
        "slow": Walk(single=(0.7, 1.0), double=(0.5, 0.8)),
        "brisk": Walk(single=(0.45, 0.6), double=(0.085, 0.1)),
        "shuffle": Walk(height=(0.025, 0.035), single=(0.3, 0.4), double=(0.12, 0.18)),
        "march": Walk(way="spot", height=(0.06, 0.09), single=(0.4, 0.8), double=(0.1, 0.3)),
        "platform": Walk(drop=0.06, height=(0.07, 0.07), single=(0.75, 0.9)),
    }
)
"""Gaits, by long and short times on both feet, on one, and lifts of the feet."""
WAYS = ("straight", "curve", "directions", "spot")
MILD, WILD = ("walk", "slow", "march"), ("brisk", "shuffle", "platform")
"""Gaits for any wildness, and those that come with it."""
STANDING = 0.3
"""Share of the runs in which it only stands."""


def _obstacles(half: Range, offset: Range = (0.0, 0.0), **settings: Any) -> Defect:
    """Boxes under some of the steps."""
    return Scaled(Obstacles((0.005, 0.02), half, offset, **settings), {"height": "length"})


_WIDE = (0.15, 0.1)
"""Larger than a sole in both directions, in [m]."""

DEFECTS: Mapping[str, Defect] = MappingProxyType(
    {
        "obstacle": _obstacles(_WIDE, most=1),
        "obstacle-heel": _obstacles((0.025, 0.1), (-0.76, 0.0), most=1),
        "obstacle-toe": _obstacles((0.025, 0.1), (0.76, 0.0), most=1),
        "obstacle-left": _obstacles((0.15, 0.015), (0.0, 0.76), most=1),
        "obstacle-right": _obstacles((0.15, 0.015), (0.0, -0.76), most=1),
        "obstacles": _obstacles(_WIDE, share=0.5),
        "edge": Overhang((0.2, 0.42)),
        "decalibrated": Decalibration(tuple(range(LEGS)), (0.02, 0.05), either=True),
        "oscillation": Multisine(BANDS, (0.0001, 0.002), fastest=2.0),
        "reference-jump": ReferenceJumps(),
        "force-jump": Scaled(
            SensorJumps((200.0, 600.0), "force", (False, False, True), (0.05, 0.3), ((0.08, 0.2),)),
            {"size": "force"},
        ),
        "torque-jump": Scaled(
            SensorJumps((15.0, 40.0), "torque", (True, True, False), (0.05, 0.3), ((0.08, 0.2),)),
            {"size": "torque"},
        ),
        "limit-cycle": ForceGain((3.0, 5.0), start=(0.1, 0.6), contacts=False),
    }
)
"""The humanoids' own faults, by name; those of steps do nothing while a robot only stands."""


LIMITS = Limits(
    stiffness=(0.05, 1.0), damping=(0.2, 0.5), delay=0.004, hold=0.01, feedforward=0.9,
    flexibility=40.0,
)  # fmt: skip
"""Of 30 runs drawn within stiffness, damping, delay and hold, over all robots and motions, 29
stayed upright, with velocity errors below 0.2 rad/s rms."""


def suited(motion: Stroll | Stand) -> tuple[str, ...]:
    """Names of the faults that can act in a motion."""
    steps = tuple(name for name in DEFECTS if name.startswith("obstacle"))
    idle = (*steps, "edge") if isinstance(motion, Stand) else () if motion.walk.drop else ("edge",)
    return tuple(name for name in DEFECTS if name not in idle)


def motion(
    rng: np.random.Generator,
    wildness: float,
    robot: Humanoid | None = None,
    *,
    soft: bool = False,
) -> Stroll | Stand:
    """Draw a motion."""
    upper = Gesture(
        way=str(rng.choice(("still", "sines", "reaches"))),
        size=(0.0, 0.2 + 0.8 * wildness),
        period=(2.0 - 1.2 * wildness, 3.0 - 1.0 * wildness),
    )
    if rng.uniform() < STANDING:
        still = rng.uniform() < 1 / 3
        return Stand(
            sway=(0.0, 0.0) if still else (0.1, 0.3 + 0.3 * wildness),
            squat=(0.0, 0.0) if still else (0.01, 0.04 + 0.06 * wildness),
            period=(2.5 - 1.2 * wildness, 4.0),
            upper=upper,
        )
    gaits = MILD if rng.uniform() > wildness else MILD + WILD
    walk = GAITS[str(rng.choice(gaits))]
    way = walk.way if walk.way == "spot" or walk.drop else str(rng.choice(WAYS))
    walk = replace(walk, way=way, jitter=0.02 + 0.08 * wildness)
    return Stroll(walk=walk, stops=int(rng.integers(3)), pause=(0.8, 2.0), upper=upper)
