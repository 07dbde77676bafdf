"""The scenarios of arms that pick from a table."""

from collections.abc import Mapping

from noiseclassifier.scenarios.case import BANDS, Case, multisine
from noiseclassifier.scenarios.defects import (
    Decalibration,
    ForceGain,
    GivingWay,
    Multisine,
    Obstacles,
    ReferenceJumps,
    SensorJumps,
)
from noiseclassifier.scenarios.motions import Picks

_PICKS = Picks()

ARM: Mapping[str, Case] = {
    "straight": Case(_PICKS, description="Picks from a table."),
    "curve": Case(Picks(way="curve"), description="Picks from a table, on curved paths."),
    "directions": Case(
        Picks(way="directions"), description="Moves over the table without contact."
    ),
    "spot": Case(Picks(way="spot"), description="Presses repeatedly on one spot."),
    "obstacle-full": Case(
        _PICKS,
        Obstacles((0.014, 0.025), (0.05, 0.05), share=0.7),
        "Plates on the table, higher than where the tool slows down.",
    ),
    "obstacle-heel": Case(
        _PICKS,
        Obstacles((0.004, 0.009), (0.05, 0.05), share=0.7),
        "Thin plates on the table, met at low speed.",
    ),
    "obstacle-toe": Case(
        _PICKS,
        Obstacles((0.03, 0.06), (0.05, 0.05), share=0.7),
        "Thick plates on the table, met at high speed.",
    ),
    "obstacle-left": Case(
        _PICKS,
        Obstacles((0.014, 0.025), (0.02, 0.02), (0.0, 2.3), share=0.7),
        "Plates whose edge meets the left side of the tool.",
    ),
    "obstacle-right": Case(
        _PICKS,
        Obstacles((0.014, 0.025), (0.02, 0.02), (0.0, -2.3), share=0.7),
        "Plates whose edge meets the right side of the tool.",
    ),
    "decalibrated": Case(
        _PICKS,
        Decalibration((1,), (-0.05, -0.03)),
        "A shoulder encoder has an offset, so that the tool hits the table too early.",
    ),
    **{
        multisine(*band): Case(_PICKS, Multisine((band,), (0.0005, 0.002), fastest=1.0))
        for band in BANDS
    },
    "early-height": Case(
        Picks(hover=(0.005, 0.03)),
        Obstacles((0.02, 0.02), (0.05, 0.05)),
        "A plate of 2 cm at every place; the tool slows down at varied heights.",
    ),
    "early-duration": Case(
        Picks(way="spot"),
        Obstacles((0.02, 0.02), (0.05, 0.05)),
        "A plate of 2 cm on the spot on which it presses repeatedly.",
    ),
    "platform": Case(
        Picks(force=(50.0, 70.0)),
        GivingWay((0.004, 0.015), (0.05, 0.05), (0.3, 0.5)),
        "The surface under the tool gives way.",
    ),
    "force-jump": Case(_PICKS, SensorJumps((80.0, 160.0))),
    "limit-cycle": Case(_PICKS, ForceGain((5.0, 9.0))),
    "faint-oscillation": Case(_PICKS, Multisine(BANDS, (0.00001, 0.002), fastest=1.0)),
    "reference-jump": Case(_PICKS, ReferenceJumps()),
}
"""By the scenario's name."""
