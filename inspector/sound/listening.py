"""Listen to runs: their noise as sound files, all at one gain that is said."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from string import ascii_lowercase

import numpy as np

import noisemodel as nm
from inspector.errors import InspectorError
from inspector.sound.mixing import LOWEST, mix
from inspector.sound.parts import parts
from inspector.sound.sound import SILENCE, Sound, scale
from noisemodel.atomic import refuse_existing, replacing

HEADROOM_DB = 1.0
OSCILLATIONS = 1000.0
"""Up to which the paper's oscillations reach, in [Hz]."""


@dataclass(frozen=True)
class Settings:
    """What is listened to.

    Attributes:
        kind: "simplified", "normal" or "rms"; empty takes "normal" with a link, else "simplified".
        joint: The only joint, of the simplified noise; all if empty.
        link: The only link, of the extended noise; all if empty.
        speed: How much faster than it was it is played; frequencies rise by as much.
    """

    kind: str = ""
    joint: str = ""
    link: str = ""
    speed: float = 1.0


def listen(run: nm.Run, settings: Settings | None = None) -> Sound:
    """Make the noise of a run audible.

    Args:
        run: The run; its gaps are silent.
        settings: What is listened to.

    Returns:
        The sound.

    Raises:
        InspectorError: If there is no such thing to listen to, or nothing of it can be heard.
        NoiseModelError: If the extended noise cannot be had.
    """
    chosen = settings or Settings()
    return replace(sound_of(run, chosen), remarks=tuple(_remarks(run, chosen.speed)))


def sound_of(run: nm.Run, chosen: Settings) -> Sound:
    """Make the noise of a run audible, without looking for what is missing in it.

    Args:
        run: The run; its gaps are silent.
        chosen: What is listened to.

    Returns:
        The sound, without remarks.

    Raises:
        InspectorError: If there is no such thing to listen to, or nothing of it can be heard.
        NoiseModelError: If the extended noise cannot be had.
    """
    if not 0.01 <= chosen.speed <= 1000.0:
        raise InspectorError(f"a speed of {chosen.speed:g}, expected 0.01 to 1000")
    kind = chosen.kind or ("normal" if chosen.link else "simplified")
    made_of = parts(run, kind=kind, joint=chosen.joint, link=chosen.link)
    signal = mix(made_of.signals, valid=run.mask, rate=run.rate, lowest=LOWEST / chosen.speed)
    return Sound(
        what=made_of.what,
        signal=signal,
        rate=run.rate,
        start=float(run.time[0]),
        speed=chosen.speed,
        unit=made_of.unit,
    )


def common_gain(sounds: Sequence[Sound]) -> float:
    """Choose the gain at which the loudest of several sounds just fits.

    Args:
        sounds: All that will be heard side by side.

    Returns:
        A tenth of a decibel or less below 1 dB of headroom, in [dB]; 0 if all are silent.
    """
    peak = max(sound.peak for sound in sounds)
    if peak < SILENCE:
        return 0.0
    return float(np.floor(10.0 * (-20.0 * np.log10(peak) - HEADROOM_DB)) / 10.0)


def outputs(path: Path, count: int, *, overwrite: bool = False) -> tuple[Path, ...]:
    """Name the files for one sound or several, and refuse what exists before long work is done.

    Args:
        path: The file that was asked for.
        count: How many sounds there will be; several are told apart by a letter.
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


def said(sound: Sound, gain: float) -> str:
    """Say how a sound came out at a gain, and whether anything was lost.

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
        return (
            f"{text}; clipped: {clipped:.2%} of it is beyond full scale, by {over:.1f} dB at most"
        )
    return text


def _remarks(run: nm.Run, speed: float) -> list[str]:
    from inspector.audit.bandwidth import bandwidth

    reach = bandwidth(run)
    span = f"{LOWEST / speed:.3g} Hz to {reach.usable:.4g} Hz"
    remarks = [f"To be heard: {span} of the motion ({reach.limit})."]
    if speed != 1.0:
        remarks.append(f"Played {speed:g} times as fast: frequencies are {speed:g} times as high.")
    if reach.usable < OSCILLATIONS / 2:
        remarks.append(
            f"What is faster than {reach.usable:.4g} Hz is not in the log: that it is quiet there"
            " says nothing."
        )
    if run.velocity_desired is None:
        remarks.append("The run has no desired velocities: the measured motion is heard alone.")
    if not run.mask.all():
        remarks.append("Gaps are silent.")
    return remarks
