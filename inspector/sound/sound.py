"""A playable noise, written as a WAV file that states its gain."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy import fft

from noisemodel.types import Array

RATE = 48_000
"""Sampling rate of a sound file, in [Hz]."""
SMALL_RATE = 16_000
"""Sampling rate of an embedded sound, in [Hz]: enough for a log of 10 kHz."""
SILENCE = 1e-6
"""Peak below which a sound is silent, in [rad/s] or [√W]: quantisation noise is larger."""
SOFTWARE = "noise-inspector"
FULL_SCALE = 32767
"""Full scale of 16 bits."""


@dataclass(frozen=True, eq=False)
class Sound:
    """A signed noise signal that can be played.

    Attributes:
        what: Short description.
        signal: Shape (samples,), in [unit].
        rate: Sampling rate of the signal, in [Hz].
        start: Time of its first sample in the run, in [s].
        speed: Factor of the playing speed.
        unit: "rad/s" or "√W".
        remarks: What is inaudible and why, a sentence each.
        playing: Sampling rate of the file, in [Hz].
    """

    what: str
    signal: Array
    rate: float
    start: float
    speed: float
    unit: str
    remarks: tuple[str, ...] = ()
    playing: int = RATE

    @property
    def peak(self) -> float:
        """Largest value, in [unit]."""
        return float(np.abs(self.played).max(initial=0.0))

    @property
    def rms(self) -> float:
        """Root mean square, in [unit]."""
        return float(np.sqrt(np.mean(np.square(self.signal))))

    @property
    def silent(self) -> bool:
        """Whether its peak is below ``SILENCE``."""
        return self.peak < SILENCE

    @cached_property
    def played(self) -> Array:
        """The signal at playing speed and rate, in [unit]."""
        return self.at(self.playing)

    def at(self, rate: int) -> Array:
        """The signal at playing speed, band-limited and resampled, in [unit].

        Args:
            rate: Sampling rate, in [Hz].
        """
        size = max(1, round(len(self.signal) * rate / (self.rate * self.speed)))
        shared = min(size, len(self.signal)) // 2 + 1  # bins of both; the others are 0
        spectrum = np.zeros(size // 2 + 1, dtype=np.complex128)
        spectrum[:shared] = fft.rfft(self.signal)[:shared]
        resampled: Array = fft.irfft(spectrum, size) * (size / len(self.signal))
        return resampled

    def file(self, gain: float, *, rate: int | None = None, lead: float = 0.0) -> bytes:
        """WAV file whose metadata state the gain.

        Args:
            gain: At 0 dB, full scale is 1 of the unit, in [dB].
            rate: Sampling rate, in [Hz]; ``playing`` unless given.
            lead: Duration of silence before it, in [s].
        """
        comment = f"{self.what}, {scale(gain, self.unit)}"
        if self.speed != 1.0:
            comment += f", played {self.speed:g} times as fast"
        notes = {"INAM": self.what, "ISFT": SOFTWARE, "ICMT": comment}
        rate = rate or self.playing
        silence = np.zeros(round(lead * rate))
        played = self.played if rate == self.playing else self.at(rate)
        return wav(np.concatenate((silence, played * _factor(gain))), rate, notes)

    def clipped(self, gain: float) -> float:
        """Share of the samples that exceed full scale at a gain in [dB]."""
        return float(np.mean(np.abs(self.played) * _factor(gain) > 1.0))

    def __str__(self) -> str:
        level = (
            "silent"
            if self.silent
            else f"peak {self.peak:.3g} {self.unit}, rms {self.rms:.3g} {self.unit}"
        )
        return "\n".join([f"{self.what}: {level}", *(f"  {remark}" for remark in self.remarks)])


def scale(gain: float, unit: str) -> str:
    """Gain as text, with the value of full scale.

    Args:
        gain: In [dB].
        unit: Of the sound.
    """
    return f"gain {gain:+.1f} dB: full scale is {1.0 / _factor(gain):.3g} {unit}"


def _factor(gain: float) -> float:
    return float(10.0 ** (gain / 20.0))


def wav(signal: Array, rate: int, notes: Mapping[str, str]) -> bytes:
    """One channel of 16 bits as RIFF WAVE (IBM and Microsoft, 1991).

    Args:
        signal: Shape (samples,); 1 is full scale, above which it is clipped.
        rate: Sampling rate, in [Hz].
        notes: Texts by their RIFF names: INAM a title, ISFT the software, ICMT a comment.

    Returns:
        The file.
    """
    samples = np.round(np.clip(signal, -1.0, 1.0) * FULL_SCALE).astype("<i2").tobytes()
    form = struct.pack("<HHIIHH", 1, 1, rate, 2 * rate, 2, 16)  # PCM, one channel, 2 bytes each
    info = b"INFO" + b"".join(
        _chunk(name.encode("ascii"), text.encode("utf-8") + b"\0") for name, text in notes.items()
    )
    body = b"WAVE" + _chunk(b"fmt ", form) + _chunk(b"LIST", info) + _chunk(b"data", samples)
    return _chunk(b"RIFF", body)


def _chunk(name: bytes, content: bytes) -> bytes:
    return name + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2)
