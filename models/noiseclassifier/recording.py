"""A recording: noise signals with their annotated blocks."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import combinations
from math import inf, isfinite
from typing import NamedTuple

import numpy as np

from noiseclassifier.errors import RecordingError
from noiseclassifier.signals import NOISE, Signals, by_joint, named
from noiseclassifier.types import Array, Mask


class Block(NamedTuple):
    """An annotated stretch of a recording."""

    start: float
    """When it starts, in [s]."""
    stop: float
    """When it stops, in [s]; infinity if it lasts to the end."""
    label: str
    """Its class."""


class Fault(NamedTuple):
    """A fault that was injected into a recording, whether its effect is felt or not."""

    start: float
    """When its cause begins, in [s]."""
    stop: float
    """When its cause ends, in [s]."""
    label: str
    """The class of the failure that it leads to."""
    felt: bool = True
    """Whether it has an annotated block."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Annotated noise, checked when it is made.

    Attributes:
        name: Name of the recording in messages and models.
        signal: The noise estimate, shape (samples,), or signals by name, each of that shape, or
            joint by joint of shape (joints, samples).
        rate: Sample rate, in [Hz].
        blocks: Annotations; what overlaps must agree.
        start: Time of the first sample, in [s].
        valid: False in gaps, shape (samples,); None if there are none.
        sha256: Hash of where the recording comes from; by default, that of its samples.
        events: All faults that were injected, felt or not; empty if that is not known, or none
            was.
        facts: What else is known, by ``robot``, ``scenario`` and ``domain``.

    Raises:
        RecordingError: If shapes do not fit, a value is not finite, or a block is reversed, lies
            outside of the recording, or contradicts another.
    """

    name: str
    signal: Signals
    rate: float
    blocks: tuple[Block, ...] = ()
    start: float = 0.0
    valid: Mask | None = None
    sha256: str = ""
    events: tuple[Fault, ...] = ()
    facts: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check everything once, and hash what came without a hash."""
        _check_signal(self)
        plain = tuple(Block(float(each[0]), float(each[1]), str(each[2])) for each in self.blocks)
        object.__setattr__(self, "blocks", plain)
        _check_blocks(self)
        if not self.sha256:
            hashed = hashlib.sha256()
            for signal in named(self.signal).values():
                hashed.update(np.ascontiguousarray(signal, dtype="<f8").tobytes())
            object.__setattr__(self, "sha256", hashed.hexdigest())

    @property
    def samples(self) -> int:
        """Number of samples."""
        count: int = next(iter(named(self.signal).values())).shape[-1]
        return count

    @property
    def time(self) -> Array:
        """Time of each sample, shape (samples,), in [s]."""
        time: Array = self.start + np.arange(self.samples) / self.rate
        return time


def _check_signal(recording: Recording) -> None:
    for name, signal in named(recording.signal).items():
        many = by_joint(name)
        if signal.ndim != 1 + many or signal.shape[-1:] != (recording.samples,) or not signal.size:
            expected = "(joints, samples)" if many else "(samples,)"
            raise RecordingError(
                recording.name,
                f"a signal of shape {signal.shape}, expected {expected}, one or more",
            )
        if not np.isfinite(signal).all():
            place = tuple(np.argwhere(~np.isfinite(signal))[0].tolist())
            what = f"sample {place[-1]}" if name == NOISE else f"sample {place[-1]} of {name}"
            raise RecordingError(recording.name, f"{what} is not finite ({signal[place]})")
    valid = recording.valid
    if valid is not None and valid.shape != (recording.samples,):
        raise RecordingError(
            recording.name,
            f"valid has shape {valid.shape}, the signal {(recording.samples,)}",
        )
    if not (isfinite(recording.rate) and recording.rate > 0 and isfinite(recording.start)):
        raise RecordingError(
            recording.name,
            f"rate {recording.rate} Hz and start {recording.start} s, expected finite numbers,"
            " the rate above 0",
        )


def _check_blocks(recording: Recording) -> None:
    step = 1.0 / recording.rate
    # Annotations are written with few digits: one sample more or less is no contradiction.
    begin = recording.start - step
    end = recording.start + (recording.samples + 1) * step
    for block in recording.blocks:
        if not block.start < block.stop:
            raise RecordingError(
                recording.name, f"{_words(block)} stops before it starts, or lasts no time"
            )
        if block.start < begin or block.start >= end or end < block.stop < inf:
            raise RecordingError(
                recording.name,
                f"{_words(block)} is outside of the recording, which lasts from"
                f" {recording.start:g} s to {end - step:g} s",
            )
    for early, late in combinations(sorted(recording.blocks), 2):
        if late.start < early.stop - step and late.label != early.label:
            raise RecordingError(
                recording.name, f"{_words(early)} and {_words(late)} overlap and contradict"
            )


def _words(block: Block) -> str:
    return f"block {block.label!r} from {block.start:g} s to {block.stop:g} s"
