"""Good motion: the frames of runs without a failure."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Self

import numpy as np

from noiseclassifier.errors import DatasetError, MissingSignalError, RateError, RecordingError
from noiseclassifier.features import feature_count
from noiseclassifier.framefeatures import frame_features
from noiseclassifier.profile import NOMINAL, Profile
from noiseclassifier.recording import Recording
from noiseclassifier.splitting import folds, group_of
from noiseclassifier.types import Array, Index, Mask, Words

OK = "ok"
FOLDS = 10
"""Parts of the good motion that are left out in turn, at most."""
GUARD = 1.0
"""Time before and after a left-out part of a single run that is not for training, in [s]."""


@dataclass(frozen=True, eq=False)
class GoodMotion:
    """Features of the frames of good motion, run by run and in order of time.

    Attributes:
        features: Not yet standardised, shape (frames, features).
        runs: Name of the recording that each frame is from, shape (frames,).
        start: When each frame starts, shape (frames,), in [s].
        stop: When it stops, shape (frames,), in [s].
        hashes: SHA-256 of each recording, by name.
        annotated: Names of the recordings of which only what is annotated `ok` was taken.
    """

    features: Array
    runs: Words
    start: Array
    stop: Array
    hashes: Mapping[str, str]
    annotated: tuple[str, ...] = ()

    @classmethod
    def read(cls, recordings: Iterable[Recording], profile: Profile) -> Self:
        """Features of recordings, read one after the other; only the features are kept.

        Args:
            recordings: Signals at the profile's rate, each of another name: good as a whole, or
                where they are annotated as `ok`.
            profile: How they are framed, as for classification, and what to compute.

        Raises:
            DatasetError: If there is no good frame at all, or a name repeats.
            RateError: If a recording has another rate than the profile.
            RecordingError: If a recording lacks a signal of the profile.
        """
        parts: list[tuple[Array, Array, Array]] = []
        runs: list[str] = []
        hashes: dict[str, str] = {}
        annotated: list[str] = []
        for recording in recordings:
            if recording.name in hashes:
                raise DatasetError(f"two recordings are called {recording.name!r}; name them apart")
            hashes[recording.name] = recording.sha256
            if recording.blocks:
                annotated.append(recording.name)
            parts.append(_frames(recording, profile))
            runs += [recording.name] * len(parts[-1][0])
        if not runs:
            raise DatasetError(
                f"no good frame in {len(hashes)} recordings: a frame takes {profile.duration:g} s"
                " without a gap, annotated as ok where something is annotated"
            )
        columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
        return cls(
            columns[0],
            np.array(runs),
            columns[1],
            columns[2],
            MappingProxyType(hashes),
            tuple(annotated),
        )

    @property
    def groups(self) -> Words:
        """Group of each frame, shape (frames,); see `splitting.group_of`."""
        return np.array([group_of(name) for name in self.runs.tolist()])

    @property
    def seconds(self) -> float:
        """Time that the frames cover, in [s]."""
        before = np.append(-np.inf, self.stop[:-1])
        before[self.first_of_run] = -np.inf
        return float((self.stop - np.maximum(self.start, before)).sum())

    @property
    def first_of_run(self) -> Mask:
        """Whether a frame is the first of its recording, shape (frames,)."""
        return np.append(True, self.runs[1:] != self.runs[:-1])

    def __len__(self) -> int:
        return len(self.runs)


def parts(good: GoodMotion) -> list[tuple[Index, Index]]:
    """Split good motion into parts that are left out in turn.

    Returns:
        For each part, indices of the frames to train on, and of those of the part: by groups, or by
        the time of a single one.
    """
    groups = good.groups.tolist()
    if (count := len(set(groups))) > 1:
        return folds(groups, min(count, FOLDS))
    found = []
    for test in np.array_split(np.arange(len(good)), FOLDS):
        near = np.zeros(len(good), dtype=bool)
        for run in np.unique(good.runs[test]):
            own = test[good.runs[test] == run]
            begin, end = good.start[own].min() - GUARD, good.stop[own].max() + GUARD
            near |= (good.runs == run) & (good.stop > begin) & (good.start < end)
        found.append((np.flatnonzero(~near), test))
    return found


def _frames(recording: Recording, profile: Profile) -> tuple[Array, Array, Array]:
    """Features, start and stop of each good frame of a recording."""
    if abs(recording.rate / profile.rate - 1.0) > NOMINAL:
        raise RateError(
            recording.rate,
            [profile.rate],
            f"recording {recording.name!r} does not fit; lower its rate, or take another profile",
        )
    if recording.samples < profile.length:
        return np.empty((0, feature_count(profile))), np.empty(0), np.empty(0)
    try:
        starts, found = frame_features(recording.signal, profile, good_samples(recording))
    except MissingSignalError as error:
        raise RecordingError(recording.name, str(error)) from error
    time = recording.start + starts / recording.rate
    return found, time, time + profile.length / recording.rate


def good_samples(recording: Recording) -> Mask:
    """Whether samples are good: not in a gap, and `ok` where something is annotated."""
    good = np.ones(recording.samples, dtype=bool)
    if recording.blocks:
        slack = 0.5 / recording.rate
        time = recording.time
        inside = [
            (time >= block.start - slack) & (time < block.stop - slack)
            for block in recording.blocks
            if block.label == OK
        ]
        good = np.any([np.zeros_like(good), *inside], axis=0)
    return good if recording.valid is None else good & recording.valid
