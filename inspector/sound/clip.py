"""Short sound of a run at 16 kHz, to be embedded in a recording or a page."""

from dataclasses import dataclass, replace

import numpy as np

from inspector.analysis.analyse import Analysis
from inspector.analysis.moments import worst
from inspector.errors import InspectorError
from inspector.sound.sonification import Settings, common_gain, description, sound_of
from inspector.sound.sound import SMALL_RATE
from noisemodel import Run
from noisemodel.run import part

MOST_VELOCITIES = 4_000_000
"""Largest number of velocities that are mixed: 6 s of 32 joints at 10 kHz, within 0.25 s."""


@dataclass(frozen=True)
class Clip:
    """A sound to be embedded.

    Attributes:
        data: WAV file of 16 kHz.
        start: Start in the run, in [s].
        stop: End in the run, in [s].
        description: What it is, at which gain.
    """

    data: bytes
    start: float
    stop: float
    description: str


def of_recording(analysis: Analysis) -> bytes:
    """Sound for a recording, that starts with the run and contains its worst moment.

    Args:
        analysis: A run with its findings.

    Returns:
        A WAV file; empty if nothing is audible.
    """
    found = clip(analysis.run, around=worst_time(analysis), lead=True)
    return b"" if found is None else found.data


def worst_time(analysis: Analysis) -> float:
    """Time of the worst moment of a run, in [s]; 0 if the run has no valid samples."""
    moments = worst(analysis)
    return moments[0].peak if moments else 0.0


def clip(run: Run, *, around: float = 0.0, lead: bool = False) -> Clip | None:
    """Sound of a run's simplified noise.

    Args:
        run: The run.
        around: Middle of the part that is used if the run is too long, in [s].
        lead: Whether silence replaces what is left out before.

    Returns:
        The sound; None if nothing in the run is audible.
    """
    first, last = _kept(run, around)
    try:
        sound = replace(sound_of(part(run, first, last), Settings()), playing=SMALL_RATE)
    except InspectorError:
        return None
    gain = common_gain([sound])
    return Clip(
        data=sound.file(gain, lead=first / run.rate if lead else 0.0),
        start=sound.start,
        stop=sound.start + len(sound.signal) / sound.rate,
        description=f"{sound.what}, {description(sound, gain)}",
    )


def _kept(run: Run, around: float) -> tuple[int, int]:
    """First sample and end of the part that is used."""
    width = run.motion.shape[1]
    width += 0 if run.velocity_desired is None else run.velocity_desired.shape[1]
    count = min(max(2, MOST_VELOCITIES // width), len(run.time))
    middle = int(np.searchsorted(run.time, around))
    first = min(max(middle - count // 2, 0), len(run.time) - count)
    return first, first + count
