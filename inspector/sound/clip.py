"""The sound of a run, small and quick enough to lie within a recording or a page."""

from dataclasses import dataclass, replace

import numpy as np

from inspector.analysis.analyse import Analysis
from inspector.analysis.moments import worst
from inspector.errors import InspectorError
from inspector.sound.listening import Settings, common_gain, said, sound_of
from inspector.sound.sound import SMALL_RATE
from noisemodel import Run

MOST = 4_000_000
"""Velocities that are mixed: a quarter of a second of work; 6 s of 32 joints at 10 kHz."""


@dataclass(frozen=True)
class Clip:
    """A sound as it lies within something else.

    Attributes:
        data: A whole WAV file of 16 kHz.
        start: When what is heard starts in the run, in [s].
        stop: When it ends there, in [s].
        said: What it is, at which gain.
    """

    data: bytes
    start: float
    stop: float
    said: str


def of_recording(analysis: Analysis) -> bytes:
    """Make the sound that lies in a recording: it starts with the run, and has its worst moment.

    Args:
        analysis: A run with what was found in it.

    Returns:
        A WAV file; nothing where nothing can be heard.
    """
    found = clip(analysis.run, around=first_look(analysis), lead=True)
    return b"" if found is None else found.data


def first_look(analysis: Analysis) -> float:
    """Say when the worst moment of a run is, in [s]; 0 in a run that is all gap."""
    moments = worst(analysis)
    return moments[0].peak if moments else 0.0


def clip(run: Run, *, around: float = 0.0, lead: bool = False) -> Clip | None:
    """Make the sound of a run's simplified noise.

    Args:
        run: The run.
        around: What is heard where the run is too long for all of it, in [s].
        lead: Whether silence takes the place of what is left out before.

    Returns:
        The sound, or nothing where hearing begins above all that the run holds.
    """
    first, last = _kept(run, around)
    try:
        sound = replace(sound_of(_part(run, first, last), Settings()), playing=SMALL_RATE)
    except InspectorError:
        return None
    gain = common_gain([sound])
    return Clip(
        data=sound.file(gain, lead=first / run.rate if lead else 0.0),
        start=sound.start,
        stop=sound.start + len(sound.signal) / sound.rate,
        said=f"{sound.what}, {said(sound, gain)}",
    )


def _kept(run: Run, around: float) -> tuple[int, int]:
    """First and last sample that are heard."""
    width = run.motion.shape[1]
    width += 0 if run.velocity_desired is None else run.velocity_desired.shape[1]
    count = min(max(2, MOST // width), len(run.time))
    middle = int(np.searchsorted(run.time, around))
    first = min(max(middle - count // 2, 0), len(run.time) - count)
    return first, first + count


def _part(run: Run, first: int, last: int) -> Run:
    """Cut a stretch of velocities out."""
    part = slice(first, last)
    return replace(
        run,
        time=run.time[part],
        velocity=run.velocity[part],
        velocity_desired=None if run.velocity_desired is None else run.velocity_desired[part],
        base_velocity=None if run.base_velocity is None else run.base_velocity[part],
        valid=run.mask[part],
        position=None,
        position_desired=None,
        base_pose=None,
        effort=None,
        stages={},
        blocks=(),
    )
