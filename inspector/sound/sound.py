"""A noise that can be played: what it is, at which gain, and what is lost on the way."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy import fft

from inspector.sound.wavfile import wav
from noisemodel.types import Array

RATE = 48_000
"""Samples per second of a sound file, in [Hz]."""
SMALL_RATE = 16_000
"""The same where a sound lies within something else: it holds what a log of 10 kHz does."""
SILENCE = 1e-6
"""What stays below is silent, in [rad/s] or [√W]: encoders and rounding are louder."""
SOFTWARE = "noise-inspector"


@dataclass(frozen=True, eq=False)
class Sound:
    """A noise with signs, that can be played.

    Attributes:
        what: What it is, in a few words.
        signal: Shape (samples,), in [unit].
        rate: Samples of it per second of the run, in [Hz].
        start: Time of its first sample in the run, in [s].
        speed: How much faster than it was it is played.
        unit: "rad/s" or "√W".
        remarks: What cannot be heard and why, a sentence each.
        playing: Samples per second of playing, in [Hz].
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
        """Whether there is nothing to hear."""
        return self.peak < SILENCE

    @cached_property
    def played(self) -> Array:
        """The signal as it is played, in [unit]."""
        return self.at(self.playing)

    def at(self, rate: int) -> Array:
        """Resample the signal as it is played, in [unit]; it is band-limited and ends in silence.

        Args:
            rate: Samples per second of playing, in [Hz].
        """
        size = max(1, round(len(self.signal) * rate / (self.rate * self.speed)))
        shared = min(size, len(self.signal)) // 2 + 1  # bins of both, those that are not are empty
        spectrum = np.zeros(size // 2 + 1, dtype=np.complex128)
        spectrum[:shared] = fft.rfft(self.signal)[:shared]
        resampled: Array = fft.irfft(spectrum, size) * (size / len(self.signal))
        return resampled

    def file(self, gain: float, *, rate: int | None = None, lead: float = 0.0) -> bytes:
        """Write the sound as a WAV file that says its gain.

        Args:
            gain: At 0 dB, full scale is 1 of the unit, in [dB].
            rate: Samples per second, in [Hz]; unless given, those of playing.
            lead: Silence before it, in [s].
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
        """Share of the sound that is beyond full scale at a gain in [dB]."""
        return float(np.mean(np.abs(self.played) * _factor(gain) > 1.0))

    def __str__(self) -> str:
        level = (
            "silent"
            if self.silent
            else f"peak {self.peak:.3g} {self.unit}, rms {self.rms:.3g} {self.unit}"
        )
        return "\n".join([f"{self.what}: {level}", *(f"  {remark}" for remark in self.remarks)])


def scale(gain: float, unit: str) -> str:
    """Say what a gain means.

    Args:
        gain: In [dB].
        unit: Of the sound.
    """
    return f"gain {gain:+.1f} dB: full scale is {1.0 / _factor(gain):.3g} {unit}"


def _factor(gain: float) -> float:
    return float(10.0 ** (gain / 20.0))
