"""The humanoids' motions of the wide domains, as data."""

from dataclasses import dataclass, field

from noiseclassifier.scenarios.motions import Range, Walk


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
