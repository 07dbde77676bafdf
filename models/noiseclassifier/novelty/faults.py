"""Faults put into good motion: tones, band noise and blows of a known level on one joint."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from noiseclassifier.classifier import Classifier
from noiseclassifier.novelty.frames import GoodMotion, good_samples
from noiseclassifier.recording import Recording
from noiseclassifier.signals import NOISE, named
from noiseclassifier.types import Array, Real

KINDS = ("tone", "noise", "blow")
LEVELS = (0.1, 0.3, 1.0)
"""Root mean squares of the faults while they last, in [rad/s]."""
CASES = 36
"""Faults of each level: three kinds on twelve joints in turn."""
SLOWEST, FASTEST = 20.0, 0.45
"""Frequencies are drawn from the first, in [Hz], to this share of the sample rate."""
LONG, SHORT = 1.0, 0.1
"""How long tones and noise, and blows, last, in [s]."""
AROUND = 3.0
"""Motion before a fault starts, and after that, that is classified with it, in [s]."""


@dataclass(frozen=True)
class Recall:
    """Faults of several levels that models found in good motion.

    Attributes:
        cases: Faults of each level.
        found: How many of them each model found, by its name: without any fault at these places,
            which are false alarms, and then of each of ``LEVELS``.
    """

    cases: int
    found: Mapping[str, tuple[int, ...]]

    def __str__(self) -> str:
        head = f"found of {self.cases} faults put into this motion"
        rows = [(head, "no fault", *(f"{level:g} rad/s" for level in LEVELS))]
        rows += [(f"  {name}", *map(str, counts)) for name, counts in self.found.items()]
        width = max(len(row[0]) for row in rows)
        return "\n".join(
            f"{name:{width}}{''.join(f'{each:>12}' for each in counts)}" for name, *counts in rows
        )


def fault(time: Array, kind: str, frequency: float, seed: int, *, start: float) -> Array:
    """A signal of level 1 while it lasts, 0 before.

    Args:
        time: Of each sample, uniform, shape (samples,), in [s].
        kind: One of ``KINDS``: a tone or noise an octave wide for ``LONG``, or a blow, a decaying
            tone of level 1 in its first ``SHORT``.
        frequency: Of the tone, or the middle of the octave, in [Hz].
        seed: Random seed of the noise.
        start: When it starts, in [s].

    Returns:
        Shape (samples,).
    """
    since = time - start
    if kind == "blow":
        since = np.maximum(since, 0.0)
        blow: Array = np.exp(-since * frequency / 3.0) * np.sin(2 * np.pi * frequency * since)
        return blow / _level(blow[(time >= start) & (time < start + SHORT)])
    during = (since >= 0.0) & (since < LONG)
    if kind == "tone":
        tone: Array = np.sqrt(2.0) * np.sin(2 * np.pi * frequency * since) * during
        return tone
    white = np.fft.rfft(np.random.default_rng(seed).normal(size=len(time)))
    place = np.fft.rfftfreq(len(time), float(time[1] - time[0]))
    white[(place < frequency / np.sqrt(2.0)) | (place > frequency * np.sqrt(2.0))] = 0.0
    noise: Array = np.fft.irfft(white, len(time))
    return noise / _level(noise) * during


def with_fault(signals: Mapping[str, Real], joint: int, added: Array) -> dict[str, Real]:
    """Signals of a motion with something added to the measured velocity of a joint.

    Args:
        signals: By name, those that go joint by joint among them.
        joint: Its number among the joints.
        added: Shape (samples,), in [rad/s].

    Returns:
        The same signals: measured velocities and errors, joint by joint, and their norms differ.
    """
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


def recall(
    classifiers: Mapping[str, Classifier],
    recordings: Iterable[Recording],
    good: GoodMotion,
    *,
    seed: int = 0,
) -> Recall | None:
    """Count which of the faults that are put into good motion models find.

    Faults are spread evenly over the good motion, on joints and of kinds in turn, at frequencies
    that are drawn. One is found if a finding overlaps it.

    Args:
        classifiers: By name, all of the nominal rate of the recordings.
        recordings: Those that the good motion is of, read one after the other.
        good: Where their motion is good.
        seed: Random seed.

    Returns:
        How many each classifier found, and at how many of the same places it has a finding without
        a fault; None if the recordings have no joints.
    """
    places = np.linspace(0, len(good), CASES, endpoint=False).astype(np.intp)
    counts = {name: np.zeros(1 + len(LEVELS), dtype=np.intp) for name in classifiers}
    for recording in recordings:
        if "measured_joints" not in named(recording.signal):
            return None
        for number in np.flatnonzero(good.runs[places] == recording.name).tolist():
            start = float(good.start[places[number]])
            part = _part(recording, start)
            signals = named(part.signal)
            kind, rest = KINDS[number % len(KINDS)], number // len(KINDS)
            octaves = np.random.default_rng((seed, number)).uniform()
            frequency = SLOWEST * (FASTEST * part.rate / SLOWEST) ** octaves
            shape = fault(part.time, kind, frequency, number, start=start)
            stop = start + (SHORT if kind == "blow" else LONG)
            joint = rest % len(signals["measured_joints"])
            faulty = [with_fault(signals, joint, level * shape) for level in (0.0, *LEVELS)]
            for name, model in classifiers.items():
                for row, each in enumerate(faulty):
                    labels = model.classify(each, part.rate, start=part.start, valid=part.valid)
                    counts[name][row] += any(
                        event.start < stop and event.stop > start for event in labels.events()
                    )
    return Recall(CASES, {name: tuple(each.tolist()) for name, each in counts.items()})


def _part(recording: Recording, middle: float) -> Recording:
    """The good motion of a recording around a time."""
    time = recording.time
    first, last = np.searchsorted(time, (middle - AROUND, middle + AROUND)).tolist()
    own = slice(first, last)
    return replace(
        recording,
        signal={name: each[..., own] for name, each in named(recording.signal).items()},
        blocks=(),
        start=float(time[first]),
        valid=good_samples(recording)[own],
    )


def _level(signal: Array) -> float:
    return float(np.sqrt(np.mean(signal**2)))
