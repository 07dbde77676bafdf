"""Logs of a simulated run: what sensors and a logger make of it, with labels decided anew.

This needs no simulation. Ripple of the gears, sensing and sampling are applied to a run and to its
twin, the run of the same robot and seed without a fault. A fault keeps its label where it still can
be seen: where the difference that it makes exceeds the twin's log (its motion, ripple and noise)
by ``CONTRAST`` in at least one band of one joint, in the measured velocities, in their error, or in
the efforts, if the log has any. Bands of efforts begin at ``SLOWEST``, those of velocities at
``LOWEST``: a push is slow. Of efforts, the mean of a frame is left out, since a window would spread
weights into the lowest bands; so a force that does not change cannot be seen. A push of a hand
has a label while it can be seen in the efforts, even if velocities do not show it.
"""

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from noiseclassifier.scenarios.domains import Logger
from noiseclassifier.scenarios.labels import AROUND, FRAME, HOP, visible
from noiseclassifier.scenarios.motions import PUSH
from noisemodel import Block, Run
from noisemodel.types import Array, Mask, Real

SLOWEST = 1.0  # of efforts, in [Hz]: a frame's first line, at 2.5 Hz, has what is slower, too
HARMONICS = (1, 2, 4)  # orders of the ripple, as multiples of the gear ratio
SHARPNESS, GAIN = 8.0, 3.0  # quality and gain of the resonances that ripple excites


def logged(run: Run, twin: Run, logger: Logger, *, seed: int) -> Run:
    """The log of a run, with the labels of failures that can still be seen in it."""
    found, reference = _log(run, logger, seed), _log(twin, logger, seed)
    blocks, events = run.blocks, run.meta.get("events", ())
    if run is not twin:
        desired = None
        if found.velocity_desired is not None and reference.velocity_desired is not None:
            desired = found.velocity_desired - reference.velocity_desired
        seen = _seen(_clean(run, logger) - _clean(twin, logger), desired, reference, logger.rate)
        if any(event.get("facts", {}).get("throughout") for event in events):
            # Where two walks part, steps that come later make a difference, but no noise.
            own = found.velocity, found.velocity_desired
            seen &= _seen(*own, reference, found.rate, near=AROUND)
        pushed: tuple[Block, ...] = ()
        if found.effort is not None and reference.effort is not None:
            difference = found.effort - reference.effort  # their noise is equal
            felt = visible(
                difference, reference.effort, rate=logger.rate, lowest=SLOWEST, centred=True
            )
            hands = (event for event in events if event.get("cause") == PUSH)
            pushes = tuple(Block(hand["start"], hand["stop"], hand["label"]) for hand in hands)
            seen, pushed = seen | felt, kept(pushes, felt)
        blocks = _joined((*kept(run.blocks, seen), *pushed))
    end = len(found.velocity) / logger.rate
    blocks = tuple(replace(b, stop=min(b.stop, end)) for b in blocks if b.start < end)
    events = [{**event, "labelled": overlap(event, blocks)} for event in events]
    return replace(
        found, blocks=blocks, meta={**run.meta, "events": events, "logger": asdict(logger)}
    )


def _seen(velocity: Real, desired: Real | None, twin: Run, rate: float, near: int = 0) -> Mask:
    """Frames in which velocities or their error exceed those of the twin's log around them."""
    seen = visible(velocity, twin.velocity, rate=rate, near=near)
    if desired is not None and twin.velocity_desired is not None:
        floor = twin.velocity_desired - twin.velocity
        seen |= visible(desired - velocity, floor, rate=rate, near=near)
    return seen


def kept(blocks: Sequence[Block], seen: Mask) -> tuple[Block, ...]:
    """Blocks without the parts of failures that lie in no frame in which they can be seen."""
    found: list[Block] = []
    for block in blocks:
        if block.label == "ok":
            found.append(block)
            continue
        starts = HOP * np.arange(len(seen))
        frames = starts[seen & (starts < block.stop) & (starts + FRAME > block.start)]
        if block.stop - block.start <= FRAME:  # one frame holds all of it
            middle = (block.start + block.stop) / 2
            if np.any(np.abs(frames + FRAME / 2 - middle) <= FRAME / 2):
                found.append(block)
            continue
        pieces: list[Block] = []
        for start in frames.tolist():
            first, last = max(block.start, start), min(block.stop, start + FRAME)
            if pieces and start <= pieces[-1].stop:
                pieces[-1] = replace(pieces[-1], stop=last)
            elif last > first:
                pieces.append(replace(block, start=first, stop=last))
        found += pieces
    return tuple(found)


def _joined(blocks: Sequence[Block]) -> tuple[Block, ...]:
    """Blocks in order; blocks of one label that overlap become one."""
    joined: list[Block] = []
    for block in sorted(blocks):
        last = joined[-1] if joined else None
        if last and last.label == block.label and block.start < last.stop:
            joined[-1] = replace(last, stop=max(last.stop, block.stop))
        else:
            joined.append(block)
    return tuple(joined)


def overlap(event: dict[str, Any], blocks: Sequence[Block]) -> float:
    """Time that the label of an event has, in [s]."""
    mine = (b for b in blocks if b.label == event["label"] and b.stop > event["start"])
    later = event["stop"] + 0.5
    return float(round(sum(max(0.0, min(b.stop, later) - b.start) for b in mine), 6))


def _clean(run: Run, logger: Logger) -> Array:
    """Velocities as the logger has them, without noise, ripple and quantisation."""
    velocity = run.velocity.astype(np.float64)
    if logger.velocity != "measured":
        velocity = _low_pass(velocity, logger.cutoff, run.rate)
    return _held(_sampled(velocity, run.rate, _stamps(run, logger)), logger.hold)


def _log(run: Run, logger: Logger, seed: int) -> Run:
    rng = np.random.default_rng(seed)
    joints = run.velocity.shape[1]
    phases = rng.uniform(0, 2 * np.pi, (len(HARMONICS), joints))
    weights = rng.uniform(0.2, 1, (len(HARMONICS), joints))
    count = len(_stamps(run, logger))
    jitter = rng.standard_normal(count) * logger.jitter / logger.rate
    noise = logger.noise * rng.standard_normal((count, joints))
    lost, repeated = rng.uniform(size=(2, count))
    rough = logger.roughness * rng.standard_normal((count, joints))
    stamps = np.maximum.accumulate(_stamps(run, logger) + jitter)
    assert run.position is not None
    position, velocity = (s.astype(np.float64) for s in (run.position, run.velocity))
    if logger.ripple:
        error, ripple = _ripple(position, velocity, run.rate, logger, phases, weights)
        position, velocity = position + error, velocity + ripple
    if logger.velocity == "differentiated":
        counts = 2 * np.pi / 2**logger.bits
        angle = np.rint(_sampled(position, run.rate, stamps) / counts) * counts
        velocity = np.diff(angle, axis=0, prepend=angle[:1]) * logger.rate
        velocity = _low_pass(velocity, logger.cutoff, logger.rate, order=1)
    else:
        if logger.velocity == "filtered":
            velocity = _low_pass(velocity, logger.cutoff, run.rate)
        velocity = _sampled(velocity, run.rate, stamps)
        velocity += noise + rough * velocity
    effort = _effort(run, logger, stamps, seed)
    for signal in (velocity, effort):
        if signal is not None:
            _transmit(signal, repeated < logger.repeated, lost < logger.lost)
    return Run(
        time=np.arange(count) / logger.rate,
        joint_names=run.joint_names,
        velocity=_held(velocity, logger.hold).astype(np.float32),
        velocity_desired=_desired(run, logger),
        effort=None if effort is None else _held(effort, logger.hold).astype(np.float32),
        robot=run.robot,
        meta=run.meta,
    )


def _effort(run: Run, logger: Logger, stamps: Array, seed: int) -> Array | None:
    """Efforts at stamps, shape (samples, joints), in [N m] or [A]; or None."""
    if run.effort is None or logger.effort == "missing":
        return None
    effort, most = run.effort.astype(np.float64), np.array(run.meta["effort_limit"])
    if logger.effort == "current":
        effort, most = effort * (logger.current / most), np.full_like(most, logger.current)
    if logger.velocity != "measured":
        effort = _low_pass(effort, logger.cutoff, run.rate)
    effort = _sampled(effort, run.rate, stamps)
    rng = np.random.default_rng((seed, 1))  # not that of velocities, which stay what they are
    effort += logger.effort_noise * most * rng.standard_normal(effort.shape)
    counts = 2 * most / 2**logger.effort_bits
    return np.asarray(np.rint(effort / counts) * counts)


def _transmit(signal: Array, repeated: Mask, lost: Mask) -> None:
    """Repeat samples of a signal, shape (samples, joints), and interpolate lost ones, in place."""
    again = np.flatnonzero(repeated[1:])
    signal[again + 1] = signal[again]
    if lost.any() and not lost.all():
        known = np.flatnonzero(~lost)
        for joint in range(signal.shape[1]):
            signal[lost, joint] = np.interp(np.flatnonzero(lost), known, signal[known, joint])


def _desired(run: Run, logger: Logger) -> Any:
    """What the log has as desired velocities, shape (samples, joints), in [rad/s]; or None."""
    wanted = {"commanded": run.velocity_desired, "planned": run.stages["planned"]}
    if logger.desired == "missing":
        return None
    if logger.desired == "zero":
        return np.zeros((len(_stamps(run, logger)), run.velocity.shape[1]), dtype=np.float32)
    signal = wanted[logger.desired]
    if signal is None or not signal.any():  # a policy has no desired velocities
        signal = run.stages["planned"]
    return _sampled(signal.astype(np.float64), run.rate, _stamps(run, logger)).astype(np.float32)


def _ripple(
    position: Array, velocity: Array, rate: float, logger: Logger, phases: Array, weights: Array
) -> tuple[Array, Array]:
    """Ripple locked to the joints' angles, of positions, in [rad], and velocities, in [rad/s]."""
    from scipy.signal import iirpeak, lfilter

    error, ripple = np.zeros_like(position), np.zeros_like(velocity)
    for harmonic, phase, weight in zip(HARMONICS, phases, weights, strict=True):
        order = harmonic * logger.gear
        size = logger.ripple * weight / harmonic
        # Above a quarter of the sample rate it would alias: a real one is sampled in the log only.
        fades = np.clip(2 - 4 * order * np.abs(velocity) / (2 * np.pi) / (rate / 4), 0, 1)
        error += fades * size / order * np.sin(order * position + phase)
        ripple += fades * size * velocity * np.cos(order * position + phase)
    excited = ripple.copy()
    for frequency in logger.resonances:
        b, a = iirpeak(frequency, SHARPNESS, fs=rate)
        excited += GAIN * lfilter(b, a, ripple, axis=0)
    return error, excited


def _stamps(run: Run, logger: Logger) -> Array:
    """Nominal times of the samples, shape (samples,), in [s]."""
    return np.arange(int(len(run.time) * logger.rate / run.rate * (1 + 1e-9))) / logger.rate


def _sampled(signal: Array, rate: float, stamps: Array) -> Array:
    """Linear interpolation of a signal, shape (samples, joints), at stamps, in [s]."""
    place = np.clip(stamps * rate, 0, len(signal) - 1)
    first = np.minimum(place.astype(int), len(signal) - 2)
    share = (place - first)[:, None]
    return np.asarray((1 - share) * signal[first] + share * signal[first + 1])


def _low_pass(signal: Array, cutoff: float, rate: float, *, order: int = 2) -> Array:
    from scipy.signal import butter, sosfilt, sosfilt_zi

    sections = butter(order, min(cutoff, 0.45 * rate), fs=rate, output="sos")
    state = sosfilt_zi(sections)[:, :, None] * signal[:1]
    return np.asarray(sosfilt(sections, signal, axis=0, zi=state)[0])


def _held(signal: Array, samples: int) -> Array:
    return signal if samples == 1 else signal[np.arange(len(signal)) // samples * samples]
