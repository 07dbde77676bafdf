"""Faults put into good motion: tones, band noise and blows of a known level on one joint."""

import numpy as np

from noiseclassifier.signals import NOISE

KINDS = ("tone", "noise", "blow")
LONG, SHORT = 1.0, 0.1  # how long tones and noise, and blows, last, in [s]


def fault(time, kind, frequency, seed, *, start):
    """A signal of level 1 from its start on while it lasts, at uniform times, shape (samples,).

    It is a tone of a frequency or noise of the octave around it for ``LONG``, or a blow, a decaying
    tone of level 1 in its first ``SHORT``.
    """
    since = time - start
    if kind == "blow":
        since = np.maximum(since, 0.0)
        blow = np.exp(-since * frequency / 3.0) * np.sin(2 * np.pi * frequency * since)
        return blow / _level(blow[(time >= start) & (time < start + SHORT)])
    during = (since >= 0.0) & (since < LONG)
    if kind == "tone":
        return np.sqrt(2.0) * np.sin(2 * np.pi * frequency * since) * during
    white = np.fft.rfft(np.random.default_rng(seed).normal(size=len(time)))
    place = np.fft.rfftfreq(len(time), float(time[1] - time[0]))
    white[(place < frequency / np.sqrt(2.0)) | (place > frequency * np.sqrt(2.0))] = 0.0
    noise = np.fft.irfft(white, len(time))
    return noise / _level(noise) * during


def with_fault(signals, joint, added):
    """Signals of a motion, by name, with something added to the measured velocity of a joint."""
    found = dict(signals)
    for name, sign, norms in (("measured", 1.0, ("measured", NOISE)), ("error", -1.0, ("error",))):
        if (before := signals.get(f"{name}_joints")) is None:
            continue
        after = np.array(before, dtype=np.float64)
        after[joint] += sign * added
        more = after[joint] ** 2 - before[joint] ** 2
        found[f"{name}_joints"] = after
        for norm in (each for each in norms if each in signals):
            found[norm] = np.sqrt(np.maximum(signals[norm] ** 2 + more, 0.0))
    return found


def _level(signal):
    return float(np.sqrt(np.mean(signal**2)))
