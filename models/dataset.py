"""The data set: labelled frames of many recordings."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Self

import numpy as np

from models.cutting import cut
from models.errors import DatasetError, NoFrameError, RateError, UnknownLabelError
from models.framing import frame
from models.noisytest import read_folder
from models.profile import TOLERANCE, Profile
from models.recording import Recording
from models.types import Real, Words


@dataclass(frozen=True, eq=False)
class Dataset:
    """Labelled frames; recordings and their blocks keep their order.

    Attributes:
        frames: Stretches of noise signal, shape (frames, length), or (frames, signals, length)
            if the profile listens to several.
        labels: What each frame is, shape (frames,).
        runs: Name of the recording that each frame is from, shape (frames,).
        hashes: SHA-256 of each recording, by name.
    """

    frames: Real
    labels: Words
    runs: Words
    hashes: Mapping[str, str]

    @classmethod
    def of(
        cls, recordings: Iterable[Recording], profile: Profile, *, training: bool = True
    ) -> Self:
        """Frame the annotated blocks of recordings.

        Args:
            recordings: Annotated signals at the profile's rate, each of another name.
            profile: How blocks are cut and framed, and which labels there are.
            training: Whether the frames are to learn from; `cut` says what that changes.

        Returns:
            All frames without an invalid sample.

        Raises:
            RateError: If a recording has another rate than the profile.
            UnknownLabelError: If a label is no class of the profile.
            RecordingError: If a block cannot be cut.
            NoFrameError: If there is no frame at all.
            DatasetError: If a name repeats.
        """
        frames, labels, runs = [], [], []
        hashes: dict[str, str] = {}
        for recording in recordings:
            _check(recording, profile, hashes)
            hashes[recording.name] = recording.sha256
            for block in recording.blocks:
                signal, valid = cut(recording, block, profile, training=training)
                whole = frame(valid, length=profile.length, hop=profile.hop).all(axis=1)
                frames.append(frame(signal, length=profile.length, hop=profile.hop)[whole])
                labels += [block.label] * len(frames[-1])
                runs += [recording.name] * len(frames[-1])
        if not labels:
            raise NoFrameError(len(hashes), profile.classes)
        return cls(
            np.concatenate(frames),
            np.array(labels),
            np.array(runs),
            MappingProxyType(hashes),
        )

    @classmethod
    def read(cls, folder: str | Path, profile: Profile, *, training: bool = True) -> Self:
        """Read and frame a folder of NoisyTest's ``.log`` and ``.toml`` files, in sorted order.

        Args:
            folder: Folder that holds a ``.toml`` beside each ``.log``.
            profile: How blocks are cut and framed, and which labels there are.
            training: Whether the frames are to learn from; `cut` says what that changes.

        Returns:
            All annotated frames.

        Raises:
            DataFileError: If a file is missing or cannot be understood.
            ModelsError: As `of` does.
        """
        return cls.of(read_folder(folder, rate=profile.rate), profile, training=training)

    def __len__(self) -> int:
        return len(self.labels)


def _check(recording: Recording, profile: Profile, hashes: Mapping[str, str]) -> None:
    if abs(recording.rate / profile.rate - 1.0) > TOLERANCE:
        raise RateError(
            recording.rate,
            [profile.rate],
            f"recording {recording.name!r} does not fit; lower its rate, or take another profile",
        )
    for block in recording.blocks:
        if block.label not in profile.classes:
            raise UnknownLabelError(recording.name, block.label, profile.classes)
    if recording.name in hashes:
        raise DatasetError(f"two recordings are called {recording.name!r}; name them apart")
