"""Faults that are added to the measured velocities of a good log: tones, bands of noise and blows.

Simulated faults reach joints through drives and bodies, and are faint above some hundred hertz.
Added ones have any frequency and any level, so that what is learnt does not end there. They keep a
label where they can be seen (`noiseclassifier.scenarios.domains.logs.visible`).
"""

from dataclasses import replace
from typing import Any

import numpy as np

from noiseclassifier.scenarios.domains.logs import visible
from noisemodel import Block, Run
from noisemodel.types import Array

KINDS = {"tone": "oscillations", "noise": "oscillations", "blow": "impact"}
"""Class of each kind of fault."""
LOWEST = 15.0
"""Lowest frequency, in [Hz]; the highest is 0.45 of the sample rate."""
LEVELS = 0.03, 10.0
"""Least and most root mean square while it lasts, in [rad/s]: from what can be felt on."""
LASTS = 0.4, 1.2
"""Shortest and longest tone or noise, in [s]."""
BLOW = 0.1
"""Duration of a blow, in [s]."""
APART = 2.5
"""From the start of a fault to that of the next, in [s]."""
MARGIN = 0.05
"""Time around a fault that has no label, in [s]."""
ALL = 0.3
"""Share of the faults that all joints have."""


def with_faults(run: Run, *, seed: int) -> Run:
    """A good log with faults added to its measured velocities."""
    rng = np.random.default_rng(seed)
    velocity = run.velocity.astype(np.float64)
    end, blocks, events = len(velocity) / run.rate, list[Block](), list[dict[str, Any]]()
    starts = np.arange(1.0, end - LASTS[1], APART) + rng.uniform(0.0, 0.3)
    edge = 0.0
    for start in starts.tolist():
        kind = str(rng.choice(list(KINDS)))
        stop = start + (BLOW if kind == "blow" else rng.uniform(*LASTS))
        part = slice(round(start * run.rate), round(stop * run.rate))
        frequency = LOWEST * (0.45 * run.rate / LOWEST) ** rng.uniform()
        level = LEVELS[0] * (LEVELS[1] / LEVELS[0]) ** rng.uniform()
        joints = np.arange(velocity.shape[1])
        if rng.uniform() > ALL:
            joints = rng.choice(joints, 1)
        signal = fault(kind, part.stop - part.start, frequency, run.rate, rng)
        added = np.zeros_like(velocity)
        added[part, joints] = level * signal[:, None]
        around = slice(max(0, part.start - round(run.rate / 2)), part.stop + round(run.rate / 2))
        seen = visible(added[around], run.velocity[around], rate=run.rate).any()
        velocity += added
        label = KINDS[kind]
        labelled = stop - start if seen else 0.0
        events.append({"label": label, "start": start, "stop": stop, "labelled": labelled})
        blocks.append(Block(edge, start - MARGIN, "ok"))
        blocks += [Block(start, stop, label)] if seen else []
        edge = stop + MARGIN
    blocks.append(Block(edge, end, "ok"))
    meta = {**run.meta, "scenario": "added", "events": events}
    return replace(run, velocity=velocity.astype(np.float32), blocks=tuple(blocks), meta=meta)


def fault(
    kind: str, samples: int, frequency: float, rate: float, rng: np.random.Generator
) -> Array:
    """A fault of level 1.

    Args:
        frequency: Of a tone, of the middle of an octave of noise, of what rings after a blow, in
            [Hz].
        rate: Sample rate, in [Hz].

    Returns:
        Shape (samples,), of root mean square 1.
    """
    time = np.arange(samples) / rate
    if kind == "noise":
        white = np.fft.rfft(rng.standard_normal(samples))
        place = np.fft.rfftfreq(samples, 1 / rate)
        white[(place < frequency / np.sqrt(2)) | (place > frequency * np.sqrt(2))] = 0.0
        signal = np.fft.irfft(white, samples)
    else:
        signal = np.sin(2 * np.pi * (frequency * time + rng.uniform()))
        if kind == "blow":
            signal *= np.exp(-time * frequency / 3.0)
    return np.asarray(signal / max(np.sqrt(np.mean(signal**2)), 1e-9))
