"""The scenarios of quadrupeds that trot, with faults large enough to have an effect.

Lengths are shares of the height of the robot's centre of mass (Go2's: 0.3 m), forces shares of
its weight. A quadruped has round feet: obstacles under heel or toe of a humanoid are under
its hind or front feet.
"""

from collections.abc import Mapping

from noiseclassifier.scenarios.case import BANDS, Case, multisine
from noiseclassifier.scenarios.defects import (
    Decalibration,
    ForceGain,
    Multisine,
    Obstacles,
    Range,
    ReferenceJumps,
    Scaled,
    SensorJumps,
    StepDown,
)
from noiseclassifier.scenarios.motions import Trot

_TROT = Trot()
_ANY = (0, 1, 2, 3)
_FRONT, _HIND, _LEFT, _RIGHT = (0, 1), (2, 3), (0, 2), (1, 3)
_FRONT_LEFT_KNEE = 2


def _obstacles(feet: tuple[int, ...]) -> Scaled:
    boxes = Obstacles((0.08, 0.13), (0.2, 0.2), effectors=feet, most=2)
    return Scaled(boxes, {"height": "length", "half": "length"})


def _early() -> Scaled:
    boxes = Obstacles((0.08, 0.11), (0.2, 0.2), effectors=_LEFT, share=0.4)
    return Scaled(boxes, {"height": "length", "half": "length"})


def _sines(*bands: tuple[int, int], amplitude: Range = (0.0017, 0.0067)) -> Scaled:
    return Scaled(Multisine(bands, amplitude, fastest=1.0), {"amplitude": "length"})


QUADRUPED: Mapping[str, Case] = {
    "straight": Case(_TROT, description="Trots straight ahead."),
    "curve": Case(Trot(way="curve"), description="Trots in curves."),
    "directions": Case(Trot(way="directions"), description="Trots sideways and backward."),
    "spot": Case(Trot(way="spot"), description="Trots on the spot, with turns."),
    "obstacle-full": Case(_TROT, _obstacles(_ANY), "Boxes under any foot."),
    "obstacle-heel": Case(_TROT, _obstacles(_HIND), "Boxes under hind feet."),
    "obstacle-toe": Case(_TROT, _obstacles(_FRONT), "Boxes under front feet."),
    "obstacle-left": Case(_TROT, _obstacles(_LEFT), "Boxes under left feet."),
    "obstacle-right": Case(_TROT, _obstacles(_RIGHT), "Boxes under right feet."),
    "decalibrated": Case(
        _TROT,
        Decalibration((_FRONT_LEFT_KNEE,), (-0.15, -0.1)),
        "A knee encoder has an offset, so that the leg is longer than measured.",
    ),
    **{multisine(*band): Case(_TROT, _sines(band)) for band in BANDS},
    "early-height": Case(
        Trot(height=(0.8, 1.3)),
        _early(),
        "Boxes under many steps of the left feet; varied heights of the swings.",
    ),
    "early-duration": Case(
        Trot(period=(0.8, 1.3), jitter=0.0),
        _early(),
        "Boxes under many steps of the left feet; varied durations.",
    ),
    "platform": Case(
        _TROT, Scaled(StepDown((0.07, 0.13)), {"depth": "length"}), "A step down over an edge."
    ),
    "force-jump": Case(
        _TROT,
        Scaled(
            SensorJumps((2.0, 3.5), hold=(0.03, 0.08), after=((0.08, 0.2),), share=0.2),
            {"size": "force"},
        ),
    ),
    "torque-jump": Case(
        _TROT,
        SensorJumps(
            (0.03, 0.06),  # of the quaternion: half of the angle
            sensor="base.turn",
            axes=(False, True, True, False),
            hold=(0.03, 0.08),
            after=((0.08, 0.2),),
            share=0.1,
        ),
        "The measured attitude jumps by 0.06 to 0.12 rad.",
    ),
    "limit-cycle": Case(
        _TROT,
        ForceGain((25.0, 40.0), start=(0.2, 0.4), contacts=False),
        "The gain of the compliance of the feet is too high.",
    ),
    "faint-oscillation": Case(_TROT, _sines(*BANDS, amplitude=(0.00003, 0.0067))),
    "reference-jump": Case(
        _TROT,
        Scaled(
            ReferenceJumps(distance=(0.01, 0.03), speed=(0.3, 6.0)),
            {"distance": "length", "speed": "length"},
        ),
    ),
}
"""By the scenario's name."""
