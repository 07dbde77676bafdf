"""Runs as sound: signed signals whose powers add up to the noise, mixed to one, as WAV files.

The noise itself cannot be played. It is a norm, p_hat = sqrt(sum of v²), and always positive: a
joint that oscillates about zero at 100 Hz would sound at 200 Hz, and one that oscillates about a
steady motion at 100 Hz. The signals under the root are played instead, with their signs: the
velocities of the joints, measured and desired, and of a floating base.

In a plain sum two joints that oscillate in antiphase would cancel, but not in the noise. So the
powers of the signals are added in every window and frequency bin, with the phase of the loudest
signal there. A single signal is not changed.
"""

import io
import wave
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from string import ascii_lowercase

import numpy as np
from numpy import fft

import noisemodel as nm
from inspector.analysis import Analysis, worst
from inspector.errors import InspectorError, OptionError
from inspector.text import plain
from noisemodel.files import refuse_existing
from noisemodel.run import part, stretches
from noisemodel.types import Array, Mask

# Sampling rates of a sound file and of an embedded sound, enough for a log of 10 kHz, in [Hz].
RATE, SMALL_RATE = 48_000, 16_000
# Peak below which a sound is silent, in [rad/s]: quantisation noise is larger.
SILENCE = 1e-6
FULL_SCALE = 32767  # full scale of 16 bits
HEADROOM_DB = 1.0
OSCILLATIONS = 1000.0  # highest frequency of the paper's oscillations, in [Hz]
LOWEST_AUDIBLE = 20.0  # lowest audible frequency, in [Hz]
WINDOW = 0.0256  # length of a window, in [s]: short enough to keep the time of an impact
FADE = 0.05  # fade at both ends of a stretch without gaps, in [s]: the motion beyond is unknown
ORDER = 4  # order of the high-pass filter
# Largest number of velocities in a clip: 6 s of 32 joints at 10 kHz, within 0.25 s.
MOST_VELOCITIES = 4_000_000


@dataclass(frozen=True, eq=False)
class Sound:
    """A signed noise signal that can be played."""

    what: str
    signal: Array  # shape (samples,), in [rad/s]
    rate: float  # of the signal, in [Hz]
    start: float  # of its first sample in the run, in [s]
    speed: float  # factor of the playing speed, and of all frequencies
    playing: int = RATE  # sampling rate of the file, in [Hz]

    @cached_property
    def played(self) -> Array:
        """The signal at playing speed, band-limited and resampled to ``playing``, in [rad/s]."""
        size = max(1, round(len(self.signal) * self.playing / (self.rate * self.speed)))
        shared = min(size, len(self.signal)) // 2 + 1  # bins of both; the others are 0
        spectrum = np.zeros(size // 2 + 1, dtype=np.complex128)
        spectrum[:shared] = fft.rfft(self.signal)[:shared]
        return np.asarray(fft.irfft(spectrum, size) * (size / len(self.signal)))

    @property
    def stop(self) -> float:
        """End in the run, in [s]."""
        return self.start + len(self.signal) / self.rate

    @property
    def peak(self) -> float:
        """Largest value, in [rad/s]."""
        return float(np.abs(self.played).max(initial=0.0))

    @property
    def silent(self) -> bool:
        """Whether its peak is below ``SILENCE``."""
        return self.peak < SILENCE

    def description(self, gain: float) -> str:
        """Duration and gain in [dB] of the sound, and whether it is silent."""
        seconds = len(self.signal) / self.rate / self.speed
        scale = f"gain {gain:+.1f} dB: full scale is {10.0 ** (-gain / 20.0):.3g} rad/s"
        state = f"; silent: nothing reaches {SILENCE:g} rad/s" if self.silent else ""
        return f"{seconds:.2f} s, {scale}{state}"

    def file(self, gain: float) -> bytes:
        """WAV file of one channel of 16 bits; at a gain of 0 dB, full scale is 1 rad/s."""
        samples = np.round(self.played * 10.0 ** (gain / 20.0) * FULL_SCALE).astype("<i2")
        stream = io.BytesIO()
        with wave.open(stream, "wb") as file:
            file.setnchannels(1)
            file.setsampwidth(2)
            file.setframerate(self.playing)
            file.writeframes(samples.tobytes())
        return stream.getvalue()

    def __str__(self) -> str:
        rms = float(np.sqrt(np.mean(np.square(self.signal))))
        level = f"peak {self.peak:.3g} rad/s, rms {rms:.3g} rad/s"
        return f"{self.what}: {'silent' if self.silent else level}"


def sonify(run: nm.Run, *, joint: str = "", speed: float = 1.0, playing: int = RATE) -> Sound:
    """Noise of a run as a sound.

    Args:
        joint: The only joint that is played; all of them, and the base, if empty.
        speed: Factor of the playing speed, and of all frequencies.
        playing: Sampling rate of the file, in [Hz].
    """
    if not 0.01 <= speed <= 1000.0:
        raise OptionError(f"a speed of {speed:g}, expected 0.01 to 1000")
    lowest = LOWEST_AUDIBLE / speed
    signal = mix(_velocities(run, joint), valid=run.mask, rate=run.rate, lowest=lowest)
    what = f"simplified noise{f' of {joint}' if joint else ''} above {lowest:g} Hz"
    return Sound(what, signal, run.rate, float(run.time[0]), speed, playing)


def common_gain(sounds: Sequence[Sound]) -> float:
    """Gain at which the loudest of several sounds does not clip, in [dB]; 0 if all are silent."""
    peak = max(sound.peak for sound in sounds)
    if peak < SILENCE:
        return 0.0
    return float(np.floor(10.0 * (-20.0 * np.log10(peak) - HEADROOM_DB)) / 10.0)


def output_paths(path: Path, count: int, *, overwrite: bool = False) -> tuple[Path, ...]:
    """Paths of the files of sounds, checked before they are computed; several get a letter each."""
    if count > len(ascii_lowercase):
        raise InspectorError(f"{count} runs at once, expected {len(ascii_lowercase)} at most")
    letters = [f".{letter}" for letter in ascii_lowercase[:count]] if count > 1 else [""]
    paths = tuple(path.with_name(f"{path.stem}{letter}{path.suffix}") for letter in letters)
    for each in paths:
        refuse_existing(each, overwrite=overwrite)
    return paths


def worst_time(analysis: Analysis) -> float:
    """Time of the worst moment of a run, in [s]; 0 if the run has no valid samples."""
    return next((moment.peak for moment in worst(analysis)), 0.0)


def clip(run: nm.Run, *, around: float = 0.0) -> Sound | None:
    """Sound of 16 kHz of a run's simplified noise; None if nothing in the run is audible.

    Args:
        around: Middle of the part that is used if the run is too long, in [s].
    """
    width = run.motion.shape[1]
    width += 0 if run.velocity_desired is None else run.velocity_desired.shape[1]
    count = min(max(2, MOST_VELOCITIES // width), len(run.time))
    middle = int(np.searchsorted(run.time, around))
    first = min(max(middle - count // 2, 0), len(run.time) - count)
    try:
        return sonify(part(run, first, first + count), playing=SMALL_RATE)
    except InspectorError:
        return None


def mix(signals: Iterable[Array], *, valid: Mask, rate: float, lowest: float) -> Array:
    """Audible part of several signals, taken one by one, mixed to one so that their powers add.

    Args:
        valid: False in gaps, which are silent, shape (samples,).
        lowest: Cutoff of the high-pass filter, in [Hz].
    """
    if rate <= 2.5 * lowest:
        speed = int(np.ceil(8 * lowest / rate))  # two octaves of the log are audible
        content = f"a log of {rate:g} Hz has no content above {rate / 2:g} Hz"
        unheard = f"frequencies below {lowest:g} Hz are inaudible"
        raise InspectorError(f"{content}, and {unheard}; play it faster (`--speed {speed}`)")
    hop = max(4, round(WINDOW * rate / 2))
    length, samples = 2 * hop, len(valid)
    count = -(-samples // hop) + 1
    # The squares of half sines that overlap by half sum to 1: perfect reconstruction.
    weights = np.sin(np.pi * (np.arange(length) + 0.5) / length)
    power, largest = np.zeros((count, hop + 1)), np.zeros((count, hop + 1))
    loudest = np.zeros((count, hop + 1), dtype=np.complex128)
    for signal in signals:
        padded = np.zeros((count + 1) * hop)
        padded[hop : hop + samples] = _audible(signal, valid, rate, lowest)
        cut = np.lib.stride_tricks.sliding_window_view(padded, length)[::hop]
        spectra = fft.rfft(cut * weights, axis=1)
        each = np.square(spectra.real) + np.square(spectra.imag)
        power += each  # p_hat² = sum of v², Sygulla & Rixen, Sec. II-A, band by band
        np.copyto(loudest, spectra, where=each > largest)
        np.maximum(largest, each, out=largest)
    gain = np.sqrt(np.divide(power, largest, out=np.zeros_like(power), where=largest > 0.0))
    windows = fft.irfft(gain * loudest, length, axis=1) * weights
    whole = np.zeros((count + 1, hop))
    whole[:-1] += windows[:, :hop]
    whole[1:] += windows[:, hop:]
    return np.asarray(whole.ravel()[hop : hop + samples] * valid)


def _audible(signal: Array, valid: Mask, rate: float, lowest: float) -> Array:
    """Signal without inaudible frequencies, faded in and out in each stretch without gaps."""
    filtered = np.zeros(len(signal))
    for stretch in stretches(valid, len(signal)):
        piece = _high_passed(signal[stretch], rate, lowest)
        faded = min(round(FADE * rate), len(piece) // 2)
        rise = np.square(np.sin(0.5 * np.pi * np.arange(faded) / max(faded, 1)))
        piece[:faded] *= rise
        piece[len(piece) - faded :] *= rise[::-1]
        filtered[stretch] = piece
    return filtered


def _high_passed(signal: Array, rate: float, lowest: float) -> Array:
    """Signal after a Butterworth high-pass filter forwards and backwards, with zero phase.

    By its spectrum rather than `scipy.signal`, which takes a fifth of a second to import.
    """
    from scipy.fft import next_fast_len

    reach = min(round(3 * rate / lowest), len(signal) - 1)
    extended = np.pad(signal, reach, mode="reflect", reflect_type="odd")  # without a step
    extended -= np.linspace(extended[0], extended[-1], len(extended))
    size = next_fast_len(len(extended), real=True)
    frequency = fft.rfftfreq(size, 1 / rate)
    gain = 1 / (1 + (lowest / np.maximum(frequency, lowest / 100)) ** (2 * ORDER))
    high_passed: Array = fft.irfft(fft.rfft(extended, size) * gain, size)
    return high_passed[reach : reach + len(signal)]


def _velocities(run: nm.Run, joint: str) -> Iterator[Array]:
    """What is played: a signal for each joint and axis of the base, shape (samples,)."""
    sides = [(run.joint_names, run.velocity)]
    if run.velocity_desired is not None:
        sides.append((run.desired_joint_names, run.velocity_desired))
    named = [(name, signal[:, at]) for names, signal in sides for at, name in enumerate(names)]
    known = dict.fromkeys(name for name, _ in named)
    if joint and joint not in known:
        raise InspectorError(f"no joint {joint!r} in the run; it has {', '.join(known)}")
    base = () if joint or run.base_velocity is None else run.base_velocity.T
    chosen = [signal for name, signal in named if joint in ("", name)]
    return (np.asarray(signal, dtype=np.float64) for signal in (*chosen, *base))


def remarks(run: nm.Run, speed: float) -> Iterator[str]:
    """What of a run is inaudible and why, a sentence each."""
    from inspector.audit.signals import bandwidth

    reach = bandwidth(run)
    span = f"{plain(LOWEST_AUDIBLE / speed)} Hz to {plain(reach.usable, 4)} Hz"
    yield f"Audible: {span} of the motion ({reach.limit})."
    if speed != 1.0:
        yield f"Played {speed:g} times as fast: frequencies are {speed:g} times as high."
    if reach.usable < OSCILLATIONS / 2:
        yield (
            f"The log has no content above {plain(reach.usable, 4)} Hz: silence there does not mean"
            " that there is no noise."
        )
    if run.velocity_desired is None:
        yield "The run has no desired velocities: the sound is of the measured motion only."
    if not run.mask.all():
        yield "Gaps are silent."
