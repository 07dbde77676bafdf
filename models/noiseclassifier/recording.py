"""Recordings: noise signals with annotated blocks, and their split into training and test sets.

Conventions: frames of one recording overlap, so that it stands on one side as a whole. Samples of
simulated runs are called ``robot/scenario-seed``; those of one robot and seed share their motion
bit for bit until their defects act, so that they are one *group* and stand on one side, too. Any
other recording is a group of its own. No split depends on chance or on the order of files.
"""

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import combinations
from math import inf, isfinite
from typing import NamedTuple

import numpy as np

from noiseclassifier.errors import DatasetError, RecordingError
from noiseclassifier.signals import BY_JOINT, NOISE, Array, Index, Mask, Signals, named


class Block(NamedTuple):
    """An annotated stretch of a recording."""

    start: float  #: in [s]
    stop: float  #: in [s]; infinity if it lasts to the end
    label: str


class Fault(NamedTuple):
    """A fault that was injected into a recording, whether it is detectable or not."""

    start: float  #: of its cause, in [s]
    stop: float
    label: str  #: class of the failure that it leads to
    felt: bool = True  #: whether it has an annotated block


@dataclass(frozen=True, eq=False)
class Recording:
    """Annotated noise, checked when it is made.

    Raises:
        RecordingError: If shapes do not fit, a value is not finite, or a block is reversed, lies
            outside of the recording, or contradicts another.
    """

    name: str
    signal: Signals  #: the noise estimate, shape (samples,), or signals by name
    rate: float  #: in [Hz]
    blocks: tuple[Block, ...] = ()  #: annotations; what overlaps must agree
    start: float = 0.0  #: time of the first sample, in [s]
    valid: Mask | None = None  #: False in gaps, shape (samples,); None if there are none
    sha256: str = ""  #: of where the recording comes from; by default, of its samples
    events: tuple[Fault, ...] = ()  #: all injected faults; empty if none was, or that is not known
    facts: Mapping[str, str] = field(default_factory=dict)  #: robot, scenario and domain, if known

    def __post_init__(self) -> None:
        """Check everything once, and hash what came without a hash."""
        plain = tuple(Block(float(each[0]), float(each[1]), str(each[2])) for each in self.blocks)
        object.__setattr__(self, "blocks", plain)
        for problem in _problems(self):
            raise RecordingError(self.name, problem)
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


def _problems(recording: Recording) -> Iterator[str]:
    """What is wrong with the samples and the blocks of a recording."""
    count, valid, start, rate = recording.samples, recording.valid, recording.start, recording.rate
    for kind, signal in named(recording.signal).items():
        many = kind in BY_JOINT
        if signal.ndim != 1 + many or signal.shape[-1:] != (count,) or not signal.size:
            expected = "(joints, samples)" if many else "(samples,)"
            yield f"a signal of shape {signal.shape}, expected {expected}, one or more"
        if not np.isfinite(signal).all():
            place = tuple(np.argwhere(~np.isfinite(signal))[0].tolist())
            what = f"sample {place[-1]}" + f" of {kind}" * (kind != NOISE)
            yield f"{what} is not finite ({signal[place]})"
    if valid is not None and valid.shape != (count,):
        yield f"valid has shape {valid.shape}, the signal {(count,)}"
    if not (isfinite(rate) and rate > 0 and isfinite(start)):
        yield f"rate {rate} Hz and start {start} s, expected finite numbers, the rate above 0"
    # Annotations are written with few digits: one sample more or less is no contradiction.
    step = 1.0 / rate
    begin, end = start - step, start + (count + 1) * step
    for block in recording.blocks:
        if not block.start < block.stop:
            yield f"{_words(block)} stops before it starts, or lasts no time"
        if block.start < begin or block.start >= end or end < block.stop < inf:
            lasts = f"which lasts from {start:g} s to {end - step:g} s"
            yield f"{_words(block)} is outside of the recording, {lasts}"
    for early, late in combinations(sorted(recording.blocks), 2):
        if late.start < early.stop - step and late.label != early.label:
            yield f"{_words(early)} and {_words(late)} overlap and contradict"


def _words(block: Block) -> str:
    return f"block {block.label!r} from {block.start:g} s to {block.stop:g} s"


_SAMPLE = re.compile(r"([^/]+)/.+-(\d+)")

SHARE = 0.25  # of all groups, those that are held out for the last measurement


@cache
def group_of(name: str) -> str:
    """Group of recordings that share their motion."""
    sample = _SAMPLE.fullmatch(name)
    return f"{sample[1]}-{sample[2]}" if sample else name


def robot_of(name: str) -> str:
    """Robot of a sample; empty where a name does not contain it."""
    sample = _SAMPLE.fullmatch(name)
    return sample[1] if sample else ""


def held_out(group: str) -> bool:
    """Whether a group belongs to the fixed test set, whatever other groups there are.

    The first 8 bytes of the SHA-256 of its name (UTF-8), as a fraction of 2^64, lie below `SHARE`.
    """
    return int.from_bytes(_digest(group)[:8], "big") / 2.0**64 < SHARE


def folds(groups: Sequence[str], count: int) -> list[tuple[Index, Index]]:
    """Split into folds by groups: of even sizes, and with each robot in each fold if it can be.

    The largest groups are dealt first, each to the fold that has least of its robot, and of those
    to the one that has least of all.

    Args:
        groups: Group of each recording or frame.

    Returns:
        For each fold, indices of the training items, and of the test items.

    Raises:
        DatasetError: If there are fewer groups than folds, or fewer than two folds.
    """
    found, member, sizes = np.unique(
        np.asarray(groups, dtype=str), return_inverse=True, return_counts=True
    )
    names = [str(name) for name in found]
    if not 2 <= count <= len(names):
        raise DatasetError(
            f"{count} folds of {len(names)} groups, expected two folds or more and a group for"
            " each; recordings that share their motion are one group"
        )
    robots = [name.rpartition("-")[0] for name in names]
    load = {robot: np.zeros(count, dtype=np.intp) for robot in robots}
    total, fold = np.zeros(count, dtype=np.intp), np.zeros(len(names), dtype=np.intp)
    order = sorted(range(len(names)), key=lambda item: (-sizes[item], _digest(names[item])))
    for item in order:
        mine = load[robots[item]]
        fold[item] = np.lexsort((total, mine))[0]
        mine[fold[item]] += sizes[item]
        total[fold[item]] += sizes[item]
    of_item = fold[member]
    return [
        (np.flatnonzero(of_item != number), np.flatnonzero(of_item == number))
        for number in range(count)
    ]


def seen(train: Mapping[str, str], test: Mapping[str, str]) -> dict[str, str]:
    """Test recordings that a model was trained on, or that share their motion with such."""
    hashes = {digest: name for name, digest in train.items() if digest}
    groups = {group_of(name): name for name in train}
    found = {}
    for name, digest in test.items():
        if digest in hashes:
            found[name] = f"the same recording as {hashes[digest]!r}"
        elif group_of(name) != name and group_of(name) in groups:
            found[name] = f"{groups[group_of(name)]!r}, which shares its motion"
        elif name in train and not (digest and train[name]):
            found[name] = "a recording of this name"
    return found


def check_apart(
    train: Mapping[str, str], test: Mapping[str, str], advice: str = "measure it on other runs"
) -> None:
    """Refuse to test a model on its training set, both given as SHA-256 of recordings by name.

    Raises:
        DatasetError: If a recording, its content, or its group is on both sides.
    """
    if found := seen(train, test):
        name, what = next(iter(found.items()))
        others = f" (and {len(found) - 1} more of {len(test)})" if len(found) > 1 else ""
        raise DatasetError(f"{name}: the model was trained on {what}{others}; {advice}")


def _digest(name: str) -> bytes:
    return hashlib.sha256(name.encode()).digest()
