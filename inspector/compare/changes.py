"""What changed between two runs: failures that are new or resolved, levels, in words."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inspector.analysis import Analysis, worst_signal
from inspector.compare.pair import Pair
from inspector.levels import Spectrogram, spectrogram
from inspector.report.findings import spoken
from noiseclassifier import Event
from noisemodel import Block
from noisemodel.noise import REFERENCE_POWER, decibel
from noisemodel.types import Array

STEP = 0.05
"""Time over which a level is taken, in [s]."""
FLOOR_DB = -100.0
"""Least level of the noise, below any encoder's, in [dB re 1 rad/s]; lower levels are raised."""
LINK_RANGE_DB = 40.0
"""Links that are quieter than the loudest peak by more than this have no difference."""
LOWEST_BAND = 16.0
"""Centre of the lowest octave, in [Hz]."""


@dataclass(frozen=True)
class Level:
    """How loud something is before and after, in [dB]."""

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


def spectra(pair: Pair, joint: str = "") -> tuple[Spectrogram, Spectrogram]:
    """Compute spectrograms of both runs in the same windows, those without a gap.

    Args:
        joint: Whose velocity above 10 Hz; the noise of all if empty.
    """
    found = []
    for _, side in pair.sides:
        own = worst_signal(side, side.run.joint_names.index(joint)) if joint else side.noise
        each = spectrogram(own, pair.rate, start=float(pair.time[0]), valid=pair.valid)
        kept = each.valid
        time, amplitude = each.time[kept], each.amplitude[:, kept]
        found.append(replace(each, time=time, amplitude=amplitude, valid=kept[kept]))
    return found[0], found[1]


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
    both, found, centre = spectra(pair), [], LOWEST_BAND
    frequency, measured = both[0].frequency, len(both[0].time) > 0
    while centre < pair.rate / 2:
        inside = (frequency >= centre / np.sqrt(2)) & (frequency < centre * np.sqrt(2))
        if inside.any() and measured:
            power = [np.mean(np.sum(each.amplitude[inside] ** 2, axis=0)) / 2 for each in both]
            before, after = (_noise_level(float(each)) for each in power)
            found.append(Level(f"{centre:.4g} Hz", before, after))
        centre *= 2
    return tuple(found)


def by_link(pair: Pair) -> tuple[Level, ...]:
    """The power of each link's vibration, the largest change first.

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


NEW, LOUDER, UNCHANGED, QUIETER, RESOLVED = "new", "louder", "unchanged", "quieter", "resolved"
KINDS = (NEW, LOUDER, RESOLVED, QUIETER, UNCHANGED)
"""In the order in which they matter."""
LOUDER_DB = 3.0
"""A failure in both runs whose level changed by as much is louder or quieter."""


@dataclass(frozen=True)
class Change:
    """A failure in either run, or in both at the same time.

    Attributes:
        kind: One of ``KINDS``.
        label: Its class.
        start: In [s], of whichever run has it first.
        stop: In [s], of whichever has it last.
        level: How loud both runs are there, above 10 Hz, in [dB re 1 rad/s].
    """

    kind: str
    label: str
    start: float
    stop: float
    level: Level

    def __str__(self) -> str:
        return (
            f"{self.kind}: {spoken(self.label)}, {self.start:.2f} s to {self.stop:.2f} s,"
            f" {self.level.change:+.1f} dB"
        )


def changes(pair: Pair) -> tuple[Change, ...]:
    """Match the failures of two runs.

    Findings of one class that overlap in time, whichever run they are of, are one failure. If both
    runs have a part in it, it is louder or quieter by 3 dB or more, or else unchanged; otherwise it
    is new or resolved.
    """
    found = [
        Change(_kind(kind, level := within(pair, start, stop)), label, start, stop, level)
        for kind, label, start, stop in _matched(*(failures(pair, s) for _, s in pair.sides))
    ]
    return tuple(sorted(found, key=lambda change: (change.start, change.stop, change.label)))


def largest_change(pair: Pair, found: Sequence[Change]) -> tuple[float, float]:
    """Start and stop of what is to be shown first, in [s].

    The failure in which the level changed most, new before louder before resolved before quieter
    ones; of runs without such, the largest change of level.
    """
    time, level = steps(pair)
    change = np.abs(level[:, 1] - level[:, 0])

    def most(each: Change) -> float:
        inside = (time > each.start - STEP) & (time < each.stop + STEP)
        return float(change[inside].max(initial=0.0))

    changed = [each for each in found if each.kind != UNCHANGED]
    if changed:
        worst = min(changed, key=lambda each: (KINDS.index(each.kind), -most(each)))
        return max(worst.start, float(pair.time[0])), min(worst.stop, float(pair.time[-1]))
    place = float(time[change.argmax()])
    return place - STEP, place + STEP


def failures(pair: Pair, side: Analysis) -> Sequence[Event | Block]:
    """The failures of a run that are matched: its findings, or its annotated blocks."""
    if labelled(pair):
        return side.findings
    return [block for block in side.run.blocks if block.label != "ok"]


def labelled(pair: Pair) -> bool:
    """Whether both runs could be labelled, so that findings are what is matched."""
    return pair.before.labels is not None and pair.after.labels is not None


def _kind(kind: str, level: Level) -> str:
    if kind != UNCHANGED or abs(level.change) < LOUDER_DB:
        return kind
    return LOUDER if level.change > 0.0 else QUIETER


def _matched(
    before: Sequence[Event | Block], after: Sequence[Event | Block]
) -> Iterator[tuple[str, str, float, float]]:
    """Merge failures of a class that overlap: kind, class, start and stop."""
    kinds = {frozenset({True}): NEW, frozenset({False}): RESOLVED}
    every = [(f.label, f.start, f.stop, False) for f in before]
    every += [(f.label, f.start, f.stop, True) for f in after]
    for label in sorted({each[0] for each in every}):
        own = sorted(each[1:] for each in every if each[0] == label)
        groups: list[list[tuple[float, float, bool]]] = []
        for each in own:
            if groups and each[0] < max(stop for _, stop, _ in groups[-1]):
                groups[-1].append(each)
            else:
                groups.append([each])
        for group in groups:
            kind = kinds.get(frozenset(later for *_, later in group), UNCHANGED)
            yield kind, label, group[0][0], max(stop for _, stop, _ in group)


SHOWN_LINKS = 10


def report(pair: Pair) -> str:
    """Write the report of two runs."""
    return "\n\n".join(_parts(pair)) + "\n"


def verdict(pair: Pair) -> tuple[str, str]:
    """A key of ``colors.VERDICTS``, and whether the run after is worse, in a line."""
    found = changes(pair)
    kinds = {change.kind for change in found}
    worse, better = kinds & {NEW, LOUDER}, kinds & {RESOLVED, QUIETER}
    word = "WORSE" if worse else "BETTER" if better else "SAME"
    return "findings" if worse else "ok", f"{word}   {_counts(found)}".strip()


def summary(pair: Pair) -> str:
    """The status of both runs and what changed, in a line."""
    found = changes(pair)
    what = "findings" if labelled(pair) else "annotated failures"
    events = f"{what}: {_counts(found)}" if found else "nothing found in either"
    statuses = f"{pair.before.status} → {pair.after.status}"
    return f"{statuses}; {events}; vibration {whole(pair).change:+.1f} dB"


def _counts(found: Sequence[Change]) -> str:
    count = Counter(change.kind for change in found)
    return ", ".join(f"{count[kind]} {kind}" for kind in KINDS if count[kind])


def _parts(pair: Pair) -> Iterator[str]:
    yield f"### {pair.before.name} → {pair.after.name}"
    yield f"**{summary(pair)}**"
    found = sorted(changes(pair), key=lambda change: (KINDS.index(change.kind), change.start))
    if found:
        events = [
            (
                f"**{c.kind}**",
                spoken(c.label),
                f"{c.start:.2f} to {c.stop:.2f}",
                *_numbers(c.level),
            )
            for c in found
        ]
        title = "finding" if labelled(pair) else "annotated"
        yield _table(("", title, "time [s]", "before [dB]", "after [dB]", "change"), events)
    yield _largest(pair)
    yield f"Aligned {pair.alignment}. Changes in dB; positive is louder after."
    if classes := by_class(pair):
        yield "#### Classes"
        rows = [
            (
                spoken(each.level.name),
                *(f"{seconds:.1f}" for seconds in each.seconds),
                *_numbers(each.level),
            )
            for each in classes
            if any(each.seconds)
        ]
        head = ("class", "before [s]", "after [s]", "before", "after", "change")
        yield _table(head, rows)
    yield "#### Bands"
    yield _levels("octave", by_band(pair))
    yield "Levels of the noise in dB re 1 rad/s; of events and classes, above 10 Hz."
    if links := by_link(pair):
        yield "#### Links"
        yield _levels("link", links[:SHOWN_LINKS])
        yield "Sound power of the vibration above 10 Hz, in dB re 1 pW; the largest changes first."
    yield "#### Runs"
    yield _table(("", "before", "after"), list(_facts(pair)))
    if pair.remarks:
        yield "#### Remarks"
        yield "\n".join(f"- {remark}" for remark in pair.remarks)


def _largest(pair: Pair) -> str:
    """Where the level changed most, in a sentence."""
    time, level = steps(pair)
    change = level[:, 1] - level[:, 0]
    place = int(np.abs(change).argmax())
    if change[place] == 0.0:
        return "The level is the same at all times."
    links = ""
    if pair.links is not None:
        names = shared_links(pair)
        starts, changed = link_steps(pair, names)
        column = max(int(np.searchsorted(starts, time[place], side="right")) - 1, 0)
        by_name = dict(zip(names, changed[column].tolist(), strict=True))
        most = max(by_name, key=lambda name: abs(by_name[name]), default="")
        if most and by_name[most] != 0.0:
            links = f"; {most} {by_name[most]:+.0f} dB"
    return f"Largest change of level: **{change[place]:+.0f} dB at {time[place]:.2f} s**{links}."


def _facts(pair: Pair) -> Iterator[tuple[str, str, str]]:
    before, after = pair.before, pair.after
    yield "run", before.name, after.name
    yield "robot", before.run.robot or "not named", after.run.robot or "not named"
    yield "model", before.model or "none", after.model or "none"
    yield "joints", str(len(before.run.joint_names)), str(len(after.run.joint_names))
    for key in ("scenario", "seed"):
        if key in before.run.meta or key in after.run.meta:
            yield key, str(before.run.meta.get(key, "")), str(after.run.meta.get(key, ""))
    shared = f"{before.run.duration:.2f} s at {pair.rate:g} Hz"
    yield "compared", shared, shared


def _levels(head: str, rows: Sequence[Level]) -> str:
    return _table((head, "before", "after", "change"), [(r.name, *_numbers(r)) for r in rows])


def _numbers(level: Level) -> tuple[str, str, str]:
    change = f"{level.change:+.1f}" if np.isfinite(level.change) else ""
    return _number(level.before), _number(level.after), change


def _number(value: float) -> str:
    if np.isnan(value):
        return ""
    return f"{value:.1f}" if np.isfinite(value) else "silent"


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
