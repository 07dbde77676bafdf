"""How loud two runs are, and by how much that changed: over time, by class, by band, by link."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inspector.analysis.analyse import Analysis
from inspector.pair.pair import Pair
from inspector.spectrogram import RANGE_DB, spectrogram
from noisemodel.noise import REFERENCE_POWER, decibel
from noisemodel.types import Array

STEP = 0.05
"""Time over which a level is taken, in [s]."""
FLOOR_DB = -100.0
"""Least level of the noise, below that of any encoder, in [dB re 1 rad/s]; less is raised."""
LINK_RANGE_DB = 40.0
"""Links that are quieter than the loudest peak by more than this have no difference."""
LOWEST_BAND = 16.0
"""Centre of the lowest octave, in [Hz]."""


@dataclass(frozen=True)
class Level:
    """How loud something is before and after.

    Attributes:
        name: What it is.
        before: In [dB].
        after: In [dB].
    """

    name: str
    before: float
    after: float

    @property
    def change(self) -> float:
        """By how much it became louder, in [dB]; 0 where it is silent in both."""
        return 0.0 if self.before == self.after else self.after - self.before


@dataclass(frozen=True)
class ClassLevel:
    """How long, and how loud, a class is before and after.

    Attributes:
        seconds: How long it was predicted before and after, in [s].
        level: How loud it is then, in [dB re 1 rad/s]; NaN where it was not predicted.
    """

    seconds: tuple[float, float]
    level: Level


@dataclass(frozen=True, eq=False)
class Spectra:
    """Amplitudes of both noises in windows that touch no gap of either.

    Attributes:
        time: Centres of the windows, shape (columns,), in [s].
        frequency: Shape (bins,), in [Hz]; the mean is left out.
        amplitude: Before and after, shape (2, bins, columns), in [rad/s].
    """

    time: Array
    frequency: Array
    amplitude: Array

    @property
    def level(self) -> Array:
        """Before and after, shape (2, bins, columns), in [dB re 1 rad/s].

        At least that of the largest amplitude of both, less 70 dB.
        """
        largest = self.amplitude.max(initial=0.0) or 1.0
        floor = largest * 10 ** (-RANGE_DB / 20)
        return 2 * decibel(np.maximum(self.amplitude, floor))


def spectra(pair: Pair) -> Spectra:
    """Compute the spectrograms of both noises in the same windows.

    Args:
        pair: The two runs.

    Returns:
        At most 400 columns.
    """
    start = float(pair.time[0])
    before, after = (
        spectrogram(side.noise, pair.rate, start=start, valid=pair.valid) for _, side in pair.sides
    )
    return Spectra(
        time=before.time[before.valid],
        frequency=before.frequency,
        amplitude=np.stack([each.amplitude[:, each.valid] for each in (before, after)]),
    )


def steps(pair: Pair) -> tuple[Array, Array]:
    """The level of both noises, above 10 Hz, every 50 ms.

    Returns:
        Centres of the steps, shape (steps,), in [s], and levels, shape (steps, 2),
        in [dB re 1 rad/s]. Samples in gaps do not count; a step of nothing else is at the floor.
    """
    size = max(1, round(STEP * pair.rate))
    firsts = np.arange(0, len(pair.time), size)
    counts = np.maximum(np.add.reduceat(pair.valid.astype(np.float64), firsts), 1.0)
    lengths = np.diff(np.append(firsts, len(pair.time)))
    power = [np.add.reduceat(fast**2, firsts) / counts for fast in pair.vibration]
    level = np.maximum(decibel(np.stack(power, axis=1)), FLOOR_DB)
    return pair.time[firsts] + (lengths - 1) / 2 / pair.rate, level


def within(pair: Pair, start: float, stop: float, name: str = "") -> Level:
    """The level of both noises, above 10 Hz, in a stretch of time, in [dB re 1 rad/s]."""
    first, last = _samples(pair, np.array([start, stop])).tolist()
    inside = slice(first, last)
    count = max(int(pair.valid[inside].sum()), 1)
    before, after = (_noise_level(float(np.sum(f[inside] ** 2)) / count) for f in pair.vibration)
    return Level(name, before, after)


def whole(pair: Pair) -> Level:
    """The level of both noises, above 10 Hz, in all of the time that they share."""
    return within(pair, float(pair.time[0]), float(pair.time[-1]) + 1 / pair.rate, "whole")


def by_class(pair: Pair) -> tuple[ClassLevel, ...]:
    """How long and how loud each class is; nothing unless both runs were labelled."""
    if pair.before.labels is None or pair.after.labels is None:
        return ()
    found = []
    others = {name for _, side in pair.sides for *_, name in side.lane}
    names = pair.before.labels.classes
    for name in (*names, *sorted(others - set(names))):
        before, after = (
            _class_level(pair, side, fast, name)
            for (_, side), fast in zip(pair.sides, pair.vibration, strict=True)
        )
        level = Level(name, before[1], after[1])
        found.append(ClassLevel((before[0], after[0]), level))
    return tuple(found)


def by_band(pair: Pair) -> tuple[Level, ...]:
    """The level of both noises in octaves from 16 Hz, in [dB re 1 rad/s]."""
    both, found = spectra(pair), []
    centre = LOWEST_BAND
    while centre < pair.rate / 2:
        edges = centre / np.sqrt(2), centre * np.sqrt(2)
        inside = (both.frequency >= edges[0]) & (both.frequency < edges[1])
        if inside.any() and len(both.time):
            power = [np.mean(np.sum(a[inside] ** 2, axis=0)) / 2 for a in both.amplitude]
            before, after = (_noise_level(float(each)) for each in power)
            found.append(Level(f"{centre:.4g} Hz", before, after))
        centre *= 2
    return tuple(found)


def by_link(pair: Pair) -> tuple[Level, ...]:
    """The power of each link's vibration, that which changed most first.

    Returns:
        Levels in [dB re 1 pW]; nothing where links are not compared.
    """
    if pair.links is None:
        return ()
    names = shared_links(pair)
    before, after = (
        noise.vibration.mean(axis=0)[[noise.links.index(name) for name in names]]
        for noise in pair.links
    )
    order = np.argsort(-np.abs(after - before), kind="stable")
    levels = (decibel(power / REFERENCE_POWER) for power in (before, after))
    rows = np.stack(tuple(levels), axis=1)[order].tolist()
    return tuple(Level(names[i], *row) for i, row in zip(order.tolist(), rows, strict=True))


def link_steps(pair: Pair, names: Sequence[str]) -> tuple[Array, Array]:
    """Change of the level of links, every 50 ms.

    Args:
        pair: Two runs of one robot.
        names: Links.

    Returns:
        Starts of the steps, shape (steps,), in [s], and changes, shape (steps, links), in [dB].
    """
    assert pair.links is not None
    time = pair.links[0].time
    width = float(np.median(np.diff(time))) if len(time) > 1 else STEP
    firsts = np.arange(0, len(time), max(1, round(STEP / width)))
    counts = np.diff(np.append(firsts, len(time)))[:, None]
    means = [
        np.add.reduceat(noise.vibration, firsts, axis=0)[:, [noise.links.index(n) for n in names]]
        / counts
        for noise in pair.links
    ]
    peak = max(float(mean.max(initial=0.0)) for mean in means) or 1.0
    floor = peak * 10 ** (-LINK_RANGE_DB / 10)
    before, after = (decibel(np.maximum(mean, floor)) for mean in means)
    return time[firsts] - width / 2, after - before


def shared_links(pair: Pair) -> tuple[str, ...]:
    """The links that both have."""
    assert pair.links is not None
    return tuple(name for name in pair.links[0].links if name in pair.links[1].links)


def _class_level(pair: Pair, side: Analysis, fast: Array, name: str) -> tuple[float, float]:
    """Duration of a class in a run in [s], and its level in [dB re 1 rad/s]."""
    own = np.array([(start, stop) for start, stop, label in side.lane if label == name])
    if not len(own):
        return 0.0, float("nan")
    first, last = _samples(pair, own[:, 0]), _samples(pair, own[:, 1])
    energy = np.concatenate(([0.0], np.cumsum(fast**2)))
    power = np.sum(energy[last] - energy[first]) / max(int(np.sum(last - first)), 1)
    return float(np.sum(own[:, 1] - own[:, 0])), _noise_level(float(power))


def _samples(pair: Pair, time: Array) -> NDArray[np.intp]:
    """The samples nearest to times; the end is one too."""
    nearest = np.round((time - pair.time[0]) * pair.rate).astype(np.intp)
    clipped: NDArray[np.intp] = np.clip(nearest, 0, len(pair.time))
    return clipped


def _noise_level(power: float) -> float:
    return max(float(decibel(np.array(power))), FLOOR_DB)
