"""Data sets: features of the labelled frames of many recordings, to train an estimator with."""

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import inf
from typing import Self

import numpy as np

from noiseclassifier.errors import DatasetError, NoFrameError, RateError, RecordingError
from noiseclassifier.features import features, first_sample, frame
from noiseclassifier.profile import NOMINAL, Profile
from noiseclassifier.recording import Block, Recording, group_of
from noiseclassifier.signals import Mask, Real, Words, stacked

OPEN_END = 1000  # samples after the last one at which NoisyTest stops a block that lasts to the end


@dataclass(frozen=True, eq=False)
class Dataset:
    """Labelled frames by their features; recordings and their blocks keep their order."""

    features: Real  #: not yet standardised, shape (frames, features); NaN where one is missing
    labels: Words  #: class of each frame
    runs: Words  #: name of the recording that each frame is from
    hashes: Mapping[str, str]  #: SHA-256 of each recording, by name

    @classmethod
    def of(
        cls, recordings: Iterable[Recording], profile: Profile, *, training: bool = True
    ) -> Self:
        """Frames of the annotated blocks of recordings, which are read one after the other.

        Args:
            recordings: Annotated signals at the profile's rate, each of another name.
            training: Whether blocks that are shorter than a frame are padded, or else widened.

        Raises:
            RateError: If a recording has another rate than the profile.
            RecordingError: If a label is no class of the profile, or a block cannot be cut.
            NoFrameError: If there is no frame at all.
            DatasetError: If a name repeats.
        """
        found, labels, runs = [], [], []
        hashes: dict[str, str] = {}
        for recording in recordings:
            check(recording, profile, hashes)
            hashes[recording.name] = recording.sha256
            for label, frames in cut_frames(recording, profile, training=training):
                found.append(features(frames, profile))
                labels += [label] * len(frames)
                runs += [recording.name] * len(frames)
        if not labels:
            raise NoFrameError(len(hashes), profile.classes)
        return cls(np.concatenate(found), np.array(labels), np.array(runs), hashes)

    @classmethod
    def joined(cls, parts: Iterable[Self]) -> Self:
        """Frames of all parts, one or more."""
        every = list(parts)
        features, labels, runs = (
            np.concatenate([getattr(part, name) for part in every])
            for name in ("features", "labels", "runs")
        )
        hashes = {name: digest for part in every for name, digest in part.hashes.items()}
        return cls(features, labels, runs, hashes)

    @property
    def groups(self) -> Words:
        """Group of each frame, shape (frames,); see `recording.group_of`."""
        return np.array([group_of(name) for name in self.runs.tolist()])

    def __len__(self) -> int:
        return len(self.labels)


def cut_frames(
    recording: Recording, profile: Profile, *, training: bool
) -> Iterator[tuple[str, Real]]:
    """Label and frames of each annotated block, but for those that touch a gap."""
    for block in recording.blocks:
        signal, valid = cut(recording, block, profile, training=training)
        whole = frame(valid, length=profile.length, hop=profile.hop).all(axis=1)
        if whole.any():
            yield block.label, frame(signal, length=profile.length, hop=profile.hop)[whole]


def check(recording: Recording, profile: Profile, names: Collection[str] = ()) -> None:
    """Refuse a recording of another rate, with a label that is no class, or whose name is known."""
    name = recording.name
    if abs(recording.rate / profile.rate - 1.0) > NOMINAL:
        advice = f"recording {name!r} does not fit; lower its rate, or take another profile"
        raise RateError(recording.rate, [profile.rate], advice)
    if odd := [block.label for block in recording.blocks if block.label not in profile.classes]:
        known = ", ".join(profile.classes)
        raise RecordingError(name, f"label {odd[0]!r} is no class; there are {known}")
    if name in names:
        raise DatasetError(f"two recordings are called {name!r}; name them apart")


def cut(
    recording: Recording, block: Block, profile: Profile, *, training: bool
) -> tuple[Real, Mask]:
    """Samples of a block of a recording, one frame of them or more.

    A block shorter than a frame is padded in training, lest a frame mixes failures that follow
    each other, and widened to its surroundings otherwise (paper, Sec. III-A). With log bands it is
    always widened: padding would make a train of impacts of one, and frames to classify have none.
    """
    lost = first_sample(profile)
    precision = np.float32 if profile.bands == "comb" else np.float64
    time: Real = recording.time[lost:].astype(precision)
    log = profile.bands == "log"
    pad = training and not log
    spread = training and log and block.label != profile.classes[0]
    wanted = _spread(block, time, profile) if spread else block
    samples = _samples(time, *_bounds(time, wanted, profile, pad=pad), profile)
    whole = stacked(recording.signal, profile.signals)
    signal: Real = whole[..., lost:][..., samples].astype(precision)
    count = signal.shape[-1]
    if not count:
        raise RecordingError(
            recording.name,
            f"block {block.label!r} from {block.start:g} s to {block.stop:g} s holds no sample",
        )
    if count < profile.length and not (pad or profile.bands == "comb"):
        raise RecordingError(
            recording.name, f"{len(time)} samples are too short: one frame takes {profile.length}"
        )
    # Reflected at the last sample in time and in amplitude, which continues value and slope.
    padding = [(0, 0)] * (signal.ndim - 1) + [(0, max(profile.length - count, 0))]
    valid = np.ones(len(time), bool) if recording.valid is None else recording.valid[lost:]
    return (
        np.pad(signal, padding, mode="reflect", reflect_type="odd"),
        np.pad(valid[samples], padding[-1], constant_values=True),
    )


def _bounds(time: Real, block: Block, profile: Profile, *, pad: bool) -> tuple[float, float]:
    """Start and stop of the samples, in NoisyTest's order of operations, for equal rounding.

    Its validation sets are widened to a sample more than a frame, also past an end of the
    recording, where others are moved inside.
    """
    start, stop, noisytest = block.start, block.stop, profile.bands == "comb"
    if stop == inf and len(time):
        stop = time[-1] + (OPEN_END if noisytest else 1) / profile.rate
    if pad or stop - start >= profile.duration:
        return start, stop
    start -= (profile.duration - (stop - start)) / 2.0
    if not noisytest and len(time):
        start = max(min(start, time[-1] + 1.0 / profile.rate - profile.duration), time[0])
    return start, start + profile.duration + noisytest / profile.rate


def _spread(block: Block, time: Real, profile: Profile) -> Block:
    """A block widened to all frames that hold it whole, or that it fills by half or more.

    In a signal, a failure enters a frame at its end and leaves at its start; an estimator that was
    trained on failures in the middle alone confuses them there.
    """
    if not len(time):
        return block
    shared = min(block.stop - block.start, profile.duration / 2.0)
    start = max(block.start + shared - profile.duration, float(time[0]))
    stop = min(block.stop - shared + profile.duration, float(time[-1]) + 1.0 / profile.rate)
    return Block(start, stop, block.label)


def _samples(time: Real, start: float, stop: float, profile: Profile) -> slice:
    """Samples from a start to a stop, by their number; NoisyTest takes them by their times."""
    if profile.bands == "comb":
        inside = np.flatnonzero((time >= start) & (time <= stop))
        return slice(inside[0], inside[-1] + 1) if len(inside) else slice(0, 0)
    first = max(round((start - float(time[0])) * profile.rate), 0)
    return slice(first, first + round((stop - start) * profile.rate))
