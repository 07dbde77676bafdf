"""The labelling rule: from a simulator's events to annotated blocks.

A run is compared with its *twin*: the same seed without the defect, sample by sample the same
until the defect acts. The difference of the measured joint velocities, less what is slower than
`Rule.lowest`, is the *deviation*; its *loudness* is the root mean square of its norm over
`Rule.smoothing`, and the motion is *felt* to deviate while that exceeds `Rule.felt` (gaps up to
`Rule.gap` are bridged).

A walking robot that was disturbed once never meets its twin's steps again: two good walks deviate
from each other at every touchdown. Therefore an event is held against the loudest of the
`Rule.before` seconds in front of it, those of earlier events left out: it has to become
`Rule.contrast` times as loud, and an oscillation counts only while it is louder at all. An
oscillation that was commanded in a band is looked for in that band alone.

An event becomes blocks of its class: the stretches in which it is felt between its start and
`Rule.tail` after its stop, but not beyond the next event, each on the condition of its class:

- `impact`: the loudness reaches `Rule.blow`;
- `highaccelerations`: a joint's deviation changes faster than `Rule.acceleration`;
- `oscillations`: the joint that deviates most swings through `Rule.periods` periods or more.

What begins while the cause of an event still acts belongs to that event and is none of its own,
as when a tool that shakes knocks on the table.

All time that is neither felt nor part of an event, `Rule.margin` away from both, is `ok` (pieces
shorter than `Rule.shortest` are left out). The rest, such as a commanded oscillation that left no
trace or an arm that lags behind its twin after an impact, carries no label.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from noisemodel import Block
from noisemodel.types import Array, Mask
from scenarios.events import Event

Span = tuple[int, int]
"""First sample and the one after the last."""


@dataclass(frozen=True, kw_only=True)
class Rule:
    """Thresholds of the labelling rule.

    Attributes:
        lowest: Slower deviations are a matter of place, not of noise, in [Hz].
        smoothing: Time over which the root mean square is taken, in [s].
        felt: Loudness from which a deviation counts, in [rad/s].
        contrast: How much louder than before it an event has to be.
        before: The time before an event that it is held against, in [s].
        gap: Quiet time that is bridged, in [s].
        tail: How long an event lasts on after its cause has gone, in [s].
        blow: Loudness that an impact has to reach, in [rad/s].
        acceleration: What a high acceleration has to reach, in [rad/s²].
        periods: How many periods make an oscillation.
        margin: Unlabelled time around what is no ok, in [s].
        shortest: Shortest ok block, in [s].
    """

    lowest: float = 10.0
    smoothing: float = 0.02
    felt: float = 0.03
    contrast: float = 1.5
    before: float = 0.4
    gap: float = 0.1
    tail: float = 0.15
    blow: float = 0.1
    acceleration: float = 20.0
    periods: int = 5
    margin: float = 0.05
    shortest: float = 0.2


RULE = Rule()
"""The rule that all simulated runs are labelled by."""


@dataclass(frozen=True)
class Trace:
    """What an event left in the motion.

    Attributes:
        event: The event.
        labelled: Time that carries its label, in [s].
        peak: Its largest loudness, in [rad/s].
        acceleration: Fastest change of a joint's deviation, in [rad/s²].
        background: Loudest of the time that it was held against, in [rad/s].
    """

    event: Event
    labelled: float
    peak: float
    acceleration: float
    background: float

    def record(self) -> dict[str, Any]:
        """Give the trace as plain data."""
        event = asdict(self.event)
        return event | {
            "labelled": round(self.labelled, 6),
            "peak": round(self.peak, 6),
            "acceleration": round(self.acceleration, 3),
            "background": round(self.background, 6),
        }


def deviation(
    velocity: Array,
    twin: Array,
    *,
    rate: float,
    band: tuple[float, float] | None = None,
    rule: Rule = RULE,
) -> Array:
    """Fast part of the difference between a run and its twin.

    Args:
        velocity: Measured joint velocities, shape (samples, joints), in [rad/s].
        twin: Those of the twin, shape (samples, joints), in [rad/s].
        rate: Sample rate, in [Hz].
        band: Frequencies to look at alone, in [Hz].
        rule: The labelling rule.

    Returns:
        The difference after a causal filter of first order (a high-pass, or the band's), which
        moves nothing ahead of its cause, shape (samples, joints), in [rad/s].
    """
    from scipy.signal import butter, sosfilt

    if band:
        sections = butter(1, band, "bandpass", fs=rate, output="sos")
    else:
        sections = butter(1, rule.lowest, "highpass", fs=rate, output="sos")
    return np.asarray(sosfilt(sections, velocity - twin, axis=0), dtype=np.float64)


def annotate(
    velocity: Array, twin: Array, events: Sequence[Event], *, rate: float, rule: Rule = RULE
) -> tuple[tuple[Block, ...], tuple[Trace, ...]]:
    """Label a run by the rule that this module states.

    Args:
        velocity: Measured joint velocities, shape (samples, joints), in [rad/s].
        twin: Those of the twin, shape (samples, joints), in [rad/s].
        events: What the simulator knows to have gone wrong.
        rate: Sample rate, in [Hz].
        rule: The labelling rule.

    Returns:
        The blocks, in order, and what each event left.
    """
    events = _independent(events)
    fast = deviation(velocity, twin, rate=rate, rule=rule)
    loudness = _loudness(fast, rate, rule)
    samples, blocks, traces = len(fast), [], []
    busy = np.zeros(samples, dtype=bool)
    for first, end in _spans(loudness > rule.felt, round(rule.gap * rate)):
        busy[first:end] = True
    acting = np.zeros(samples, dtype=bool)
    starts = [round(event.start * rate) for event in events] + [samples]
    for event, first, following in zip(events, starts, starts[1:], strict=False):
        end = min(round((event.stop + rule.tail) * rate), following, samples)
        heard, level = fast, loudness
        if "band" in event.facts:
            heard = deviation(velocity, twin, rate=rate, band=event.facts["band"], rule=rule)
            level = _loudness(heard, rate, rule)
        until = max(0, first - round(rule.smoothing * rate))  # the average looks ahead
        earlier = slice(max(0, until - round(rule.before * rate)), until)
        background = float(level[earlier][~acting[earlier]].max(initial=0.0))
        least = max(rule.felt, background if event.label == "oscillations" else 0.0)
        felt = _spans(level > least, round(rule.gap * rate))
        change = np.abs(np.diff(heard[first:end], axis=0, prepend=heard[first : first + 1]))
        change = change.max(axis=1, initial=0.0) * rate
        own = [
            (a, b)
            for a, b in _clipped(felt, first, end)
            if level[a:b].max() > rule.contrast * background
            and _bears_out(event.label, heard[a:b], level[a:b], change[a - first : b - first], rule)
        ]
        blocks += [Block(a / rate, b / rate, event.label) for a, b in own]
        for a, b in [*own, (first, round(event.stop * rate))]:
            busy[a:b] = True
        acting[until:end] = True
        traces.append(
            Trace(
                event,
                labelled=sum(b - a for a, b in own) / rate,
                peak=float(level[first:end].max(initial=0.0)),
                acceleration=float(change.max(initial=0.0)),
                background=background,
            )
        )
    margin = 2 * round(rule.margin * rate) + 1
    near = uniform_filter1d(busy.astype(float), margin, mode="constant") > 0.5 / margin
    blocks += [
        Block(a / rate, b / rate, "ok")
        for a, b in _spans(~near, 0)
        if b - a >= rule.shortest * rate
    ]
    return tuple(sorted(blocks)), tuple(traces)


def _independent(events: Sequence[Event]) -> list[Event]:
    """Sort events, and leave out those that begin while the cause of another one acts."""
    kept: list[Event] = []
    for event in sorted(events, key=lambda event: event.start):
        if not kept or event.start >= kept[-1].stop:
            kept.append(event)
    return kept


def _loudness(fast: Array, rate: float, rule: Rule) -> Array:
    """Root mean square over a moving window of the deviation's norm, shape (samples,)."""
    power = uniform_filter1d(np.square(fast).sum(axis=1), round(rule.smoothing * rate))
    return np.asarray(np.sqrt(np.maximum(power, 0)), dtype=np.float64)


def _bears_out(label: str, fast: Array, loudness: Array, change: Array, rule: Rule) -> bool:
    """Tell whether a felt stretch is what its event promised."""
    if label == "impact":
        return bool(loudness.max() >= rule.blow)
    if label == "highaccelerations":
        return bool(change.max() >= rule.acceleration)
    return _swings(fast) >= 2 * rule.periods


def _swings(fast: Array) -> int:
    """Count how often the joint that deviates most changes sides, ripples near zero left out."""
    joint = fast[:, np.argmax(np.square(fast).sum(axis=0))]
    side = np.sign(joint[np.abs(joint) > 0.3 * np.sqrt(np.mean(joint**2))])
    return int(np.count_nonzero(np.diff(side)))


def _spans(mask: Mask, bridge: int) -> list[Span]:
    """List where a mask is true, gaps of up to ``bridge`` samples closed."""
    edges = np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0))
    spans: list[Span] = []
    for first, end in edges.reshape(-1, 2).tolist():
        if spans and first - spans[-1][1] <= bridge:
            spans[-1] = (spans[-1][0], end)
        else:
            spans.append((first, end))
    return spans


def _clipped(spans: Sequence[Span], first: int, end: int) -> list[Span]:
    """Cut spans to those parts that lie in a range."""
    return [(max(a, first), min(b, end)) for a, b in spans if a < end and b > first]
