"""The scenarios of humanoids that walk, with the paper's parameters."""

from collections.abc import Mapping

from noiseclassifier.scenarios.case import BANDS, Case, multisine
from noiseclassifier.scenarios.defects import (
    Decalibration,
    ForceGain,
    Multisine,
    Obstacles,
    Overhang,
    ReferenceJumps,
    Scaled,
    SensorJumps,
)
from noiseclassifier.scenarios.motions import Walk

_WALK = Walk()
_LEFT = (0,)
_RIGHT_ANKLE = (10, 11)
_HEIGHT = (0.01, 0.02)
_FASTEST = 2.0
"""Speed of a foot that the drives can still shake without losing it, in [m/s]."""
_WIDE = (0.13, 0.08)
"""Larger than a sole in both directions, in [m]."""


def _obstacle(half: tuple[float, float], offset: tuple[float, float] = (0.0, 0.0)) -> Case:
    """Put one box under one of the steps."""
    return Case(_WALK, Scaled(Obstacles(_HEIGHT, half, offset, most=1), {"height": "length"}))


HUMANOID: Mapping[str, Case] = {
    "straight": Case(_WALK, description="Walks straight ahead."),
    "curve": Case(Walk(way="curve"), description="Walks in a curve."),
    "directions": Case(Walk(way="directions"), description="Walks backward or sideways."),
    "spot": Case(Walk(way="spot"), description="Walks on the spot."),
    "obstacle-full": _obstacle(_WIDE),
    "obstacle-heel": _obstacle((0.025, 0.08), (-0.76, 0.0)),
    "obstacle-toe": _obstacle((0.025, 0.08), (0.76, 0.0)),
    "obstacle-left": _obstacle((0.13, 0.015), (0.0, 0.76)),
    "obstacle-right": _obstacle((0.13, 0.015), (0.0, -0.76)),
    "decalibrated": Case(
        _WALK,
        Decalibration(_RIGHT_ANKLE, (0.05, 0.05), either=True),
        "An encoder of the right ankle has an offset of 0.05 rad.",
    ),
    **{
        multisine(*band): Case(_WALK, Multisine((band,), (0.002, 0.002), fastest=_FASTEST))
        for band in BANDS
    },
    "early-height": Case(
        Walk(height=(0.035, 0.065)),
        Scaled(Obstacles((0.02, 0.02), _WIDE, effectors=_LEFT), {"height": "length"}),
        "2 cm under the left foot at every step; steps of varied height.",
    ),
    "early-duration": Case(
        Walk(single=(0.5, 1.0), double=(0.12, 0.3), jitter=0.1),
        Scaled(Obstacles((0.02, 0.02), _WIDE, effectors=_LEFT), {"height": "length"}),
        "2 cm under the left foot at every step; steps of varied duration.",
    ),
    "platform": Case(
        Walk(drop=0.06, height=(0.07, 0.07), single=(0.75, 0.9)),
        Overhang((0.34, 0.42)),
        "The last contact on a platform of 6 cm is a partial one.",
    ),
    "force-jump": Case(
        _WALK,
        Scaled(
            SensorJumps((400.0, 400.0), "force", (False, False, True), (0.05, 0.3), ((0.08, 0.2),)),
            {"size": "force"},
        ),
        "The vertical force of a sole jumps by 400 N.",
    ),
    "torque-jump": Case(
        _WALK,
        Scaled(
            SensorJumps((30.0, 30.0), "torque", (True, True, False), (0.05, 0.3), ((0.08, 0.2),)),
            {"size": "torque"},
        ),
        "The horizontal torques of a sole jump by 30 N m.",
    ),
    "limit-cycle": Case(_WALK, ForceGain((4.0, 5.0), start=(0.15, 0.3), contacts=False)),
    "faint-oscillation": Case(_WALK, Multisine(BANDS, (0.00001, 0.002), fastest=_FASTEST)),
    "reference-jump": Case(_WALK, ReferenceJumps()),
}
"""By the scenario's name."""
