"""Sonification of runs: their noise as sound files, all at one stated gain."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from string import ascii_lowercase

import numpy as np

import noisemodel as nm
from inspector.errors import InspectorError, OptionError
from inspector.sound.components import components
from inspector.sound.mixing import LOWEST_AUDIBLE, mix
from inspector.sound.sound import SILENCE, Sound, scale
from inspector.text import plain
from noisemodel.atomic import refuse_existing, replacing

HEADROOM_DB = 1.0
OSCILLATIONS = 1000.0
"""Highest frequency of the paper's oscillations, in [Hz]."""


@dataclass(frozen=True)
class Settings:
    """What is made audible.

    Attributes:
        kind: "simplified", "normal" or "rms"; empty takes "normal" with a link, else "simplified".
        joint: One joint, of the simplified noise; all if empty.
        link: One link, of the extended noise; all if empty.
        speed: Factor of the playing speed, and of all frequencies.
    """

    kind: str = ""
    joint: str = ""
    link: str = ""
    speed: float = 1.0


def sonify(run: nm.Run, settings: Settings | None = None) -> Sound:
    """Noise of a run as a sound, with remarks on what is inaudible.

    Args:
        run: The run; its gaps are silent.
        settings: What is made audible.

    Returns:
        The sound.

    Raises:
        InspectorError: If the settings do not fit the run, or nothing is audible.
        NoiseModelError: If the extended noise cannot be computed.
    """
    settings = settings or Settings()
    return replace(sound_of(run, settings), remarks=tuple(_remarks(run, settings.speed)))


def sound_of(run: nm.Run, settings: Settings) -> Sound:
    """Noise of a run as a sound, without remarks.

    Args:
        run: The run; its gaps are silent.
        settings: What is made audible.

    Returns:
        The sound.

    Raises:
        InspectorError: If the settings do not fit the run, or nothing is audible.
        NoiseModelError: If the extended noise cannot be computed.
    """
    if not 0.01 <= settings.speed <= 1000.0:
        raise OptionError(f"a speed of {settings.speed:g}, expected 0.01 to 1000")
    kind = settings.kind or ("normal" if settings.link else "simplified")
    parts = components(run, kind=kind, joint=settings.joint, link=settings.link)
    signal = mix(
        parts.signals,
        valid=run.mask,
        rate=run.rate,
        lowest=LOWEST_AUDIBLE / settings.speed,
    )
    return Sound(
        what=parts.what,
        signal=signal,
        rate=run.rate,
        start=float(run.time[0]),
        speed=settings.speed,
        unit=parts.unit,
    )


def common_gain(sounds: Sequence[Sound]) -> float:
    """Gain at which the loudest of several sounds does not clip.

    Args:
        sounds: All that are to be compared.

    Returns:
        In [dB], rounded down to tenths, with 1 dB of headroom; 0 if all are silent.
    """
    peak = max(sound.peak for sound in sounds)
    if peak < SILENCE:
        return 0.0
    return float(np.floor(10.0 * (-20.0 * np.log10(peak) - HEADROOM_DB)) / 10.0)


def output_paths(path: Path, count: int, *, overwrite: bool = False) -> tuple[Path, ...]:
    """Paths of the files of one or more sounds, checked before the sounds are computed.

    Args:
        path: The specified file.
        count: Number of sounds; the names of several get a letter each.
        overwrite: Whether files that exist may be replaced.

    Raises:
        OutputError: If a file exists and may not be replaced, or cannot be written.
        InspectorError: If there are more sounds than letters.
    """
    if count > len(ascii_lowercase):
        raise InspectorError(f"{count} runs at once, expected {len(ascii_lowercase)} at most")
    letters = [f".{letter}" for letter in ascii_lowercase[:count]] if count > 1 else [""]
    paths = tuple(path.with_name(f"{path.stem}{letter}{path.suffix}") for letter in letters)
    for each in paths:
        refuse_existing(each, overwrite=overwrite)
    return paths


def save(sounds: Mapping[Path, Sound], gain: float, *, overwrite: bool = False) -> None:
    """Write sounds as WAV files, all at the same gain.

    Args:
        sounds: The sounds by file.
        gain: At 0 dB, full scale is 1 of the unit, in [dB].
        overwrite: Whether files that exist may be replaced.

    Raises:
        OutputError: If a file exists or cannot be written.
        InspectorError: If the sounds are not in one unit.
    """
    units = {sound.unit for sound in sounds.values()}
    if len(units) > 1:
        raise InspectorError(f"sounds in {' and '.join(sorted(units))} have no gain in common")
    for path, sound in sounds.items():
        with replacing(path, overwrite=overwrite) as temporary:
            temporary.write_bytes(sound.file(gain))


def description(sound: Sound, gain: float) -> str:
    """Duration and gain of a sound, and whether it is silent or clipped.

    Args:
        sound: The sound.
        gain: In [dB].
    """
    seconds = len(sound.signal) / sound.rate / sound.speed
    text = f"{seconds:.2f} s, {scale(gain, sound.unit)}"
    if sound.silent:
        return f"{text}; silent: nothing reaches {SILENCE:g} {sound.unit}"
    if clipped := sound.clipped(gain):
        over = 20.0 * np.log10(sound.peak) + gain
        return f"{text}; clipped: {clipped:.2%} of it exceeds full scale, by {over:.1f} dB at most"
    return text


def _remarks(run: nm.Run, speed: float) -> list[str]:
    from inspector.audit.bandwidth import bandwidth

    reach = bandwidth(run)
    span = f"{plain(LOWEST_AUDIBLE / speed)} Hz to {plain(reach.usable, 4)} Hz"
    remarks = [f"Audible: {span} of the motion ({reach.limit})."]
    if speed != 1.0:
        remarks.append(f"Played {speed:g} times as fast: frequencies are {speed:g} times as high.")
    if reach.usable < OSCILLATIONS / 2:
        remarks.append(
            f"The log has no content above {plain(reach.usable, 4)} Hz: silence there does not mean"
            " that there is no noise."
        )
    if run.velocity_desired is None:
        remarks.append(
            "The run has no desired velocities: the sound is of the measured motion only."
        )
    if not run.mask.all():
        remarks.append("Gaps are silent.")
    return remarks
