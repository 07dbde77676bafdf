"""Examples: features and labels to train an estimator with."""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import Self

import numpy as np

from noiseclassifier.dataset import Dataset
from noiseclassifier.errors import DatasetError, NoFrameError
from noiseclassifier.features import features
from noiseclassifier.profile import Profile
from noiseclassifier.recording import Recording
from noiseclassifier.splitting import group_of
from noiseclassifier.types import Array, Words

CHUNK = 64
"""Frames per evaluation, which bounds the memory that they take."""


@dataclass(frozen=True, eq=False)
class Examples:
    """Features of labelled frames; a tenth of the memory that the frames themselves take.

    Attributes:
        features: Not yet standardised, shape (frames, features).
        labels: Class of each frame, shape (frames,).
        runs: Name of the recording that each frame is from, shape (frames,).
        hashes: SHA-256 of each recording, by name.
    """

    features: Array
    labels: Words
    runs: Words
    hashes: Mapping[str, str]

    @classmethod
    def of(cls, dataset: Dataset, profile: Profile) -> Self:
        """Features of all frames of a data set.

        Args:
            dataset: Annotated frames, cut by the same profile.
            profile: What to compute.

        Raises:
            SignalError: If the frames do not fit the profile.
        """
        chunks = range(0, len(dataset), CHUNK)
        found = [features(dataset.frames[first : first + CHUNK], profile) for first in chunks]
        return cls(np.concatenate(found), dataset.labels, dataset.runs, dataset.hashes)

    @classmethod
    def read(cls, recordings: Iterable[Recording], profile: Profile) -> Self:
        """Features of recordings, read one after the other; only the features are kept.

        Args:
            recordings: Annotated signals at the profile's rate, each of another name; those
                without a frame are skipped.
            profile: How blocks are cut and framed, and what to compute.

        Raises:
            NoFrameError: If there is no frame at all.
            DatasetError: If a name repeats.
            ModelsError: As `Dataset.of` does.
        """
        found: list[Self] = []
        hashes: dict[str, str] = {}
        for recording in recordings:
            if recording.name in hashes:
                raise DatasetError(f"two recordings are called {recording.name!r}; name them apart")
            hashes[recording.name] = recording.sha256
            with suppress(NoFrameError):
                found.append(cls.of(Dataset.of([recording], profile), profile))
        if not found:
            raise NoFrameError(len(hashes), profile.classes)
        return cls(
            np.concatenate([each.features for each in found]),
            np.concatenate([each.labels for each in found]),
            np.concatenate([each.runs for each in found]),
            MappingProxyType(hashes),
        )

    @property
    def groups(self) -> Words:
        """Group of each frame, shape (frames,); see `splitting.group_of`."""
        return np.array([group_of(name) for name in self.runs.tolist()])

    def __len__(self) -> int:
        return len(self.labels)
