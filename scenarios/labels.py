"""The labelling rule: from a simulator's events to annotated blocks.

A run is compared with its *twin*: the same seed without the defect, sample by sample the same
until the defect acts. The difference of the measured joint velocities, less what is slower than
`Rule.lowest`, is the *deviation*; the motion is *felt* to deviate while the root mean square of
the deviation's norm over `Rule.smoothing` exceeds `Rule.felt` (gaps up to `Rule.gap` are bridged).

An event becomes blocks of its class: the felt stretches between its start and `Rule.tail` after
its stop, but not beyond the next event, each on the condition of its class:

- `impact`: the root mean square reaches `Rule.blow`;
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
        felt: Root mean square from which a deviation counts, in [rad/s].
        gap: Quiet time that is bridged, in [s].
        tail: How long an event lasts on after its cause has gone, in [s].
        blow: Root mean square that an impact has to reach, in [rad/s].
        acceleration: What a high acceleration has to reach, in [rad/s²].
        periods: How many periods make an oscillation.
        margin: Unlabelled time around what is no ok, in [s].
        shortest: Shortest ok block, in [s].
    """

    lowest: float = 10.0
    smoothing: float = 0.02
    felt: float = 0.03
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
        peak: Largest root mean square of the deviation, in [rad/s].
        acceleration: Fastest change of a joint's deviation, in [rad/s²].
    """

    event: Event
    labelled: float
    peak: float
    acceleration: float

    def record(self) -> dict[str, Any]:
        """Give the trace as plain data."""
        event = asdict(self.event)
        return event | {
            "labelled": round(self.labelled, 6),
            "peak": round(self.peak, 6),
            "acceleration": round(self.acceleration, 3),
        }


def deviation(velocity: Array, twin: Array, *, rate: float, rule: Rule = RULE) -> Array:
    """Fast part of the difference between a run and its twin.

    Args:
        velocity: Measured joint velocities, shape (samples, joints), in [rad/s].
        twin: Those of the twin, shape (samples, joints), in [rad/s].
        rate: Sample rate, in [Hz].
        rule: The labelling rule.

    Returns:
        The difference after a causal high-pass of first order, which moves nothing ahead of its
        cause, shape (samples, joints), in [rad/s].
    """
    from scipy.signal import butter, sosfilt

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
    change = np.abs(np.diff(fast, axis=0, prepend=fast[:1])).max(axis=1) * rate
    felt = _spans(loudness > rule.felt, round(rule.gap * rate))
    samples, blocks, traces = len(fast), [], []
    busy = np.zeros(samples, dtype=bool)
    for first, end in felt:
        busy[first:end] = True
    starts = [round(event.start * rate) for event in events] + [samples]
    for event, first, following in zip(events, starts, starts[1:], strict=False):
        end = min(round((event.stop + rule.tail) * rate), following, samples)
        own = [
            (a, b)
            for a, b in _clipped(felt, first, end)
            if _bears_out(event.label, fast[a:b], loudness[a:b], change[a:b], rule)
        ]
        blocks += [Block(a / rate, b / rate, event.label) for a, b in own]
        busy[first : round(event.stop * rate)] = True
        traces.append(
            Trace(
                event,
                labelled=sum(b - a for a, b in own) / rate,
                peak=float(loudness[first:end].max(initial=0.0)),
                acceleration=float(change[first:end].max(initial=0.0)),
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
