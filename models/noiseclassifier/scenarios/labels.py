"""The labelling rule: from a simulator's events to annotated blocks.

A run is compared with its *twin*: the same seed without the defect, equal sample by sample until
the defect acts. The high-passed difference of the measured joint velocities (above `Rule.lowest`)
is the *deviation*; its *level* is the root mean square of its norm over `Rule.smoothing`. The
deviation is *significant* while its level exceeds `Rule.felt` (gaps up to `Rule.gap` are bridged).

After a disturbance, a walking robot does not return to the steps of its twin: two good walks
deviate from each other at every touchdown. Therefore an event is compared with the *background*,
the highest level of the `Rule.before` seconds before it, earlier events left out: its level must
reach `Rule.contrast` times the background, and an oscillation counts only while it exceeds the
background. An oscillation commanded in a band is detected in that band only.

An event becomes blocks of its class: the significant stretches between its start and `Rule.tail`
after its stop, but not beyond the next event, each on the condition of its class:

- `impact`: the level reaches `Rule.blow`;
- `highaccelerations`: the deviation of a joint changes faster than `Rule.acceleration`;
- `oscillations`: the joint that deviates most has `Rule.periods` periods or more.

A fault that is there from the first sample to the last has nothing before it: it counts where the
run is louder, in a third of an octave of a joint, than its twin within half a second, so that steps
which come a little later than those of the twin are none.

An event that starts while the cause of another one acts belongs to that one, as when a shaking tool
knocks on the table.

All time that is neither significant nor part of an event, `Rule.margin` away from both, is `ok`
(stretches shorter than `Rule.shortest` are left out). The rest, such as a commanded oscillation
without an effect or an arm that lags behind its twin after an impact, has no label.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from noiseclassifier.scenarios.motions import STEP, Contact, Event
from noisemodel import Block
from noisemodel.types import Array, Mask, Real

Span = tuple[int, int]  # first sample and the one after the last
CONTRAST = 10 ** (3 / 10)  # least ratio of the power of a fault to the twin's log in a band: 3 dB
# Frames in which both are compared, as the classifier's (paper, Sec. III-A), in [s].
FRAME, HOP = 0.4, 0.1
LOWEST = 10.0  # lowest frequency of the bands, in [Hz]; each is a third of an octave wide
AROUND = 5  # frames of a twin on either side of which the loudest counts, for faults of whole runs


@dataclass(frozen=True, kw_only=True)
class Rule:
    """Thresholds of the labelling rule; the metadata of runs has them by these names."""

    lowest: float = 10.0  # cut-off frequency of the high-pass of the deviation, in [Hz]
    smoothing: float = 0.02  # window of the root mean square, in [s]
    felt: float = 0.03  # level above which a deviation is significant, in [rad/s]
    contrast: float = 1.5
    before: float = 0.4  # duration of the background before an event, in [s]
    gap: float = 0.1  # longest gap that is bridged, in [s]
    tail: float = 0.15  # time after the cause that still belongs to an event, in [s]
    blow: float = 0.1  # least level of an impact, in [rad/s]
    acceleration: float = 20.0  # least value of a high acceleration, in [rad/s²]
    periods: int = 5
    margin: float = 0.05  # unlabelled time around all that is not ok, in [s]
    shortest: float = 0.2  # shortest ok block, in [s]


RULE = Rule()  # the rule that all simulated runs are labelled by


def deviation(
    velocity: Array, twin: Array, *, rate: float, band: tuple[float, float] | None = None
) -> Array:
    """Difference of a run from its twin after a causal high-pass, or band-pass, of first order."""
    from scipy.signal import butter, sosfilt

    if band:
        sections = butter(1, band, "bandpass", fs=rate, output="sos")
    else:
        sections = butter(1, RULE.lowest, "highpass", fs=rate, output="sos")
    return np.asarray(sosfilt(sections, velocity - twin, axis=0), dtype=np.float64)


def annotate(
    velocity: Array, twin: Array, events: Sequence[Event], *, rate: float
) -> tuple[tuple[Block, ...], list[dict[str, Any]]]:
    """Labels of a run by its velocities and those of its twin, and the events with their effects.

    An effect is the time with the event's label, in [s], the highest levels of the event and of its
    background, in [rad/s], and the fastest change of a joint's deviation, in [rad/s²].
    """
    events = _independent(events)
    fast = deviation(velocity, twin, rate=rate)
    broadband = _level(fast, rate)
    samples, blocks, records = len(fast), [], []
    busy, acting = np.zeros((2, samples), dtype=bool)
    for first, end in _spans(broadband > RULE.felt, round(RULE.gap * rate)):
        busy[first:end] = True
    starts = [round(event.start * rate) for event in events] + [samples]
    for event, first, following in zip(events, starts, starts[1:], strict=False):
        end = min(round((event.stop + RULE.tail) * rate), following, samples)
        filtered, level = fast, broadband
        if "band" in event.facts:
            filtered = deviation(velocity, twin, rate=rate, band=event.facts["band"])
            level = _level(filtered, rate)
        until = max(0, first - round(RULE.smoothing * rate))  # the average is not causal
        earlier = slice(max(0, until - round(RULE.before * rate)), until)
        background = float(level[earlier][~acting[earlier]].max(initial=0.0))
        loud = level > max(RULE.felt, background if event.label == "oscillations" else 0.0)
        if event.facts.get("throughout"):  # nothing came before it: what counts is what it adds
            loud &= _louder(velocity, twin, rate)
        change = np.abs(np.diff(filtered[first:end], axis=0, prepend=filtered[first : first + 1]))
        change = change.max(axis=1, initial=0.0) * rate
        own = [
            (a, b)
            for a, b in _spans(loud, round(RULE.gap * rate), first, end)
            if level[a:b].max() > RULE.contrast * background
            and _confirms(event.label, filtered[a:b], level[a:b], change[a - first : b - first])
        ]
        blocks += [Block(a / rate, b / rate, event.label) for a, b in own]
        for a, b in [*own, (first, round(event.stop * rate))]:
            busy[a:b] = True
        acting[until:end] = True
        effect = {
            "labelled": round(sum(b - a for a, b in own) / rate, 6),
            "peak": round(float(level[first:end].max(initial=0.0)), 6),
            "acceleration": round(float(change.max(initial=0.0)), 3),
            "background": round(background, 6),
        }
        records.append(asdict(event) | effect)
    margin = 2 * round(RULE.margin * rate) + 1
    near = uniform_filter1d(busy.astype(float), margin, mode="constant") > 0.5 / margin
    blocks += [
        Block(a / rate, b / rate, "ok")
        for a, b in _spans(~near, 0)
        if b - a >= RULE.shortest * rate
    ]
    return tuple(sorted(blocks)), records


def _louder(velocity: Array, twin: Array, rate: float) -> Mask:
    """Samples in frames that are louder than the twin's frames around them."""
    found = np.zeros(len(velocity), dtype=bool)
    for number in np.flatnonzero(visible(velocity, twin, rate=rate, near=AROUND)).tolist():
        first = round(number * HOP * rate)
        found[first : first + round(FRAME * rate)] = True
    return found


def _independent(events: Sequence[Event]) -> list[Event]:
    """Events in order, without those that start while the cause of another one acts."""
    kept: list[Event] = []
    for event in sorted(events, key=lambda event: event.start):
        if not kept or event.start >= kept[-1].stop:
            kept.append(event)
    return kept


def _level(fast: Array, rate: float) -> Array:
    """Moving root mean square of the norm of the deviation, shape (samples,)."""
    power = uniform_filter1d(np.square(fast).sum(axis=1), round(RULE.smoothing * rate))
    return np.asarray(np.sqrt(np.maximum(power, 0)), dtype=np.float64)


def _confirms(label: str, fast: Array, level: Array, change: Array) -> bool:
    """Whether a significant stretch meets the condition of its class."""
    if label == "impact":
        return bool(level.max() >= RULE.blow)
    if label == "highaccelerations":
        return bool(change.max() >= RULE.acceleration)
    joint = fast[:, np.argmax(np.square(fast).sum(axis=0))]  # the one that deviates most
    sign = np.sign(joint[np.abs(joint) > 0.3 * np.sqrt(np.mean(joint**2))])
    return int(np.count_nonzero(np.diff(sign))) >= 2 * RULE.periods


def _spans(mask: Mask, bridge: int, start: int = 0, stop: int | None = None) -> list[Span]:
    """Spans in which a mask is true, gaps of up to ``bridge`` samples closed, within a range."""
    edges = np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0))
    spans: list[Span] = []
    for first, end in edges.reshape(-1, 2).tolist():
        if spans and first - spans[-1][1] <= bridge:
            spans[-1] = (spans[-1][0], end)
        else:
            spans.append((first, end))
    stop = len(mask) if stop is None else stop
    return [(max(a, start), min(b, stop)) for a, b in spans if a < stop and b > start]


APART = 0.05  # contacts with a shorter pause are merged, in [s]
IMPACT = 0.02  # time over which the impulse of a contact is integrated, in [s]


def unplanned(force: Array, planned: Sequence[Contact]) -> tuple[Event, ...]:
    """Unplanned contacts, by the forces on the effectors, as events."""
    events = []
    for effector, measured in enumerate(force.T):
        own = [contact for contact in planned if contact.effector == effector]
        for first, end in _spans(measured > 0, round(APART / STEP) - 1):
            onset = first * STEP
            if any(contact.start <= onset < contact.stop for contact in own):
                continue
            onset_force = measured[first : first + round(IMPACT / STEP)]
            facts = {
                "effector": effector,
                "impulse": float(onset_force.sum() * STEP),
                "force": float(onset_force.max()),
            }
            # The impact is the cause; leaning on the obstacle afterwards is not.
            stop = max(min((end - 1) * STEP, onset + IMPACT), onset + STEP)
            events.append(Event("impact", "unplanned contact", onset, stop, facts))
    return tuple(events)


def visible(
    difference: Real,
    floor: Real,
    *,
    rate: float,
    lowest: float = LOWEST,
    centred: bool = False,
    near: int = 0,
) -> Mask:
    """Frames in which a difference exceeds a floor by ``CONTRAST`` in a band of a joint.

    ``centred`` leaves out the mean of a frame; of the floor, the loudest of so many frames on
    either side counts (``near``).
    """
    length, hop = round(FRAME * rate), round(HOP * rate)
    starts = np.arange(0, max(len(difference) - length, 0) + 1, hop)
    window = np.hanning(length)[:, None]
    frequencies = np.fft.rfftfreq(length, 1 / rate)
    edges = lowest * 2 ** (np.arange(0, 3 * np.log2(rate / 2 / lowest) + 1) / 3)
    edges = edges[np.r_[True, np.diff(np.searchsorted(frequencies, edges)) > 0]]
    first = np.searchsorted(frequencies, edges)
    first = first[first < len(frequencies)]
    powers: tuple[list[Array], list[Array]] = [], []
    for start in starts:
        frame = slice(start, start + length)
        for signal, power in zip((difference, floor), powers, strict=True):
            part = signal[frame] - signal[frame].mean(axis=0) if centred else signal[frame]
            lines = np.square(np.abs(np.fft.rfft(window[: len(part)] * part, axis=0)))
            power.append(np.add.reduceat(lines, first))
    ours, theirs = map(np.array, powers)
    if near:
        theirs = maximum_filter1d(theirs, 2 * near + 1, axis=0)
    return np.asarray(((ours > CONTRAST * theirs) & (ours > 0)).any(axis=(1, 2)))
