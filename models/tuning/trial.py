"""A trial: recordings to learn from and recordings to check, and what is heard in them.

Frames are cut and listened to recording by recording, so that a trial takes hardly more memory than
its signals do.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from models.dataset import Dataset
from models.errors import NoFrameError
from models.examples import Examples
from models.profile import Profile
from models.recording import Recording
from models.types import Array, Index, Mask, Words


@dataclass(frozen=True, eq=False)
class Trial:
    """What points are trained on, and what they are measured by.

    Attributes:
        recordings: Annotated signals.
        splits: Indices of the recordings to learn from, and of those to check then; each is
            checked in one split at most.
    """

    recordings: Sequence[Recording]
    splits: Sequence[tuple[Index, Index]]

    @classmethod
    def against(cls, training: Sequence[Recording], validation: Sequence[Recording]) -> Self:
        """Learn from some recordings and check by others."""
        every = np.arange(len(training) + len(validation))
        return cls([*training, *validation], [(every[: len(training)], every[len(training) :])])


class Predictions(NamedTuple):
    """What is heard in recordings, frame by frame."""

    features: Array
    """Not yet standardised, shape (frames, features)."""
    labels: Words
    """What each frame is, shape (frames,)."""
    runs: Words
    """Name of the recording that it is from, shape (frames,)."""
    groups: Words
    """What it shares its motion with, shape (frames,)."""
    owner: Index
    """Index of the recording that it is from, shape (frames,)."""

    def of(self, recordings: Index) -> Mask:
        """Mark the frames of some recordings."""
        return np.isin(self.owner, recordings)


def predict_features(trial: Trial, profile: Profile, *, training: bool) -> Predictions:
    """Listen to the recordings of one side, one after the other.

    Args:
        trial: The recordings.
        profile: What to listen for.
        training: Whether to those to learn from, or to those to check.

    Returns:
        What is heard; recordings without a frame are passed over.

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
    return Predictions(
        np.concatenate([examples.features for examples in each]),
        np.concatenate([examples.labels for examples in each]),
        np.concatenate([examples.runs for examples in each]),
        np.concatenate([examples.groups for examples in each]),
        np.repeat([index for index, _ in found], [len(examples) for examples in each]),
    )
