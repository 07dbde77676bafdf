"""A trial: training and test recordings, and the features of their frames.

Features are computed recording by recording, so that a trial takes hardly more memory than its
signals do.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from noiseclassifier.dataset import Dataset, Examples
from noiseclassifier.errors import NoFrameError
from noiseclassifier.profile import Profile
from noiseclassifier.recording import Recording
from noiseclassifier.types import Array, Index, Mask, Words


@dataclass(frozen=True, eq=False)
class Trial:
    """Recordings to train points on, and to measure them by.

    Attributes:
        recordings: Annotated signals.
        splits: Indices of the training recordings, and of the test recordings; each is tested in
            one split at most.
    """

    recordings: Sequence[Recording]
    splits: Sequence[tuple[Index, Index]]

    @classmethod
    def against(cls, training: Sequence[Recording], validation: Sequence[Recording]) -> Self:
        """A single split: train on some recordings, test on others."""
        every = np.arange(len(training) + len(validation))
        return cls([*training, *validation], [(every[: len(training)], every[len(training) :])])


class FrameFeatures(NamedTuple):
    """Features of the frames of recordings."""

    features: Array
    """Not yet standardised, shape (frames, features)."""
    labels: Words
    """Class of each frame, shape (frames,)."""
    runs: Words
    """Name of the recording that it is from, shape (frames,)."""
    groups: Words
    """Group of it; runs of a group share their motion, shape (frames,)."""
    owner: Index
    """Index of the recording that it is from, shape (frames,)."""

    def of(self, recordings: Index) -> Mask:
        """Whether each frame is of some recordings, shape (frames,)."""
        return np.isin(self.owner, recordings)


def frame_features(trial: Trial, profile: Profile, *, training: bool) -> FrameFeatures:
    """Features of the training recordings, or of the test recordings.

    Args:
        trial: The recordings.
        profile: What to compute.
        training: Whether of the training recordings.

    Returns:
        Their features; recordings without a frame are skipped.

    Raises:
        NoFrameError: If there is no frame at all.
        ModelsError: If a recording does not fit the profile.
    """
    wanted = np.unique(np.concatenate([split[not training] for split in trial.splits]))
    found = []
    for index in wanted.tolist():
        with suppress(NoFrameError):
            dataset = Dataset.of([trial.recordings[index]], profile, training=training)
            found.append((index, Examples.of(dataset, profile)))
    if not found:
        raise NoFrameError(len(wanted), profile.classes)
    each = [examples for _, examples in found]
    return FrameFeatures(
        np.concatenate([examples.features for examples in each]),
        np.concatenate([examples.labels for examples in each]),
        np.concatenate([examples.runs for examples in each]),
        np.concatenate([examples.groups for examples in each]),
        np.repeat([index for index, _ in found], [len(examples) for examples in each]),
    )
