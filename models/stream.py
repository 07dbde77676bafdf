"""Labels of a noise signal sample by sample, the same as those of the whole signal."""

from typing import TypeAlias

import numpy as np

from models.classifier import Classifier
from models.errors import RateError, SignalError
from models.features import rounded, temporal_pooling
from models.labels import Labels
from models.profile import TOLERANCE
from models.signals import Signals, check, stacked
from models.types import Array, Index, Mask
from models.windows import Windows

Decided: TypeAlias = tuple[Index, Array]
"""Start of frames, shape (frames,), and their decision values, shape (frames, decisions)."""


class Stream:
    """A classifier of samples one by one, or in chunks of any size.

    Its labels are those of `Classifier.classify` for the whole signal; the label of a frame comes
    with its last sample. Each Fourier transform is computed once, for all frames that share it:
    many at a time, since they take little longer than one, and all but the last few before the
    chunk that completes a frame. Memory does not grow.

    Args:
        classifier: The model.
        rate: Sample rate of the signal, in [Hz], which must be the model's; the model's unless
            given.
        start: Time of the first sample, in [s].
        joints: Number of joints, if the model takes signals joint by joint.

    Raises:
        RateError: If the model is of another rate. Motion can be decimated before it becomes
            noise; the noise itself cannot.
    """

    def __init__(
        self,
        classifier: Classifier,
        *,
        rate: float | None = None,
        start: float = 0.0,
        joints: int = 1,
    ) -> None:
        self.classifier = classifier
        self.rate = classifier.rate if rate is None else rate
        self.start = start
        if not abs(self.rate / classifier.rate - 1.0) <= TOLERANCE:
            raise RateError(
                self.rate, [classifier.rate], "lower the motion's rate, or take another model"
            )
        profile = self._profile = classifier.profile
        # Room for a frame, and for as much as is taken at once.
        rows = profile.norms + (len(profile.signals) - profile.norms) * joints
        self._samples = np.zeros((rows, 3 * profile.length))
        self._valid = np.zeros(3 * profile.length, dtype=bool)
        self._windows = [Windows(self._samples, profile, each) for each in profile.resolutions]
        nothing = np.empty(0, dtype=np.intp), np.empty((0, classifier.estimator.width))
        self._nothing = self._labels([nothing])
        # Longest latency of a window: its samples have to be in the buffer still.
        self._latency = profile.length - max(each.window for each in profile.resolutions)
        self._lead = min(profile.hop // 2, *(each.stride for each in profile.resolutions))
        self._begin()

    @property
    def count(self) -> int:
        """Samples so far."""
        return self._count

    def push(self, samples: Signals, valid: Mask | None = None) -> Labels:
        """Labels of the frames that samples complete.

        Args:
            samples: Any number of them, also none, shape (samples,), or of each signal by name,
                of that shape or, joint by joint, (joints, samples).
            valid: False in gaps, shape (samples,); frames that touch a gap are left out.

        Returns:
            Labels, most often none.

        Raises:
            SignalError: If the samples are not finite, not one-dimensional, or not all that the
                model needs; none is taken.
        """
        plain = stacked(samples, self._profile.signals)
        if plain.ndim > 1 and len(plain) != len(self._samples):
            raise SignalError(
                f"{len(plain)} rows of norms and joints, expected {len(self._samples)}"
            )
        check(plain, valid, first=self._count)
        found = self._take(rounded(plain, self._profile), valid)
        return self._labels(found) if found else self._nothing

    def _take(self, exact: Array, valid: Mask | None) -> list[Decided]:
        """Decision values of the frames that samples, shape (..., samples), complete."""
        found: list[Decided] = []
        for first in range(0, exact.shape[-1], self._profile.length):
            piece = slice(first, first + self._profile.length)
            self._keep(exact[..., piece], True if valid is None else valid[piece])
            if self._count >= self._due:
                found += self._advance(exact.shape[-1])
        return found

    def skip(self, samples: int) -> None:
        """Skip a gap: the same as pushing so many samples that are not valid.

        Args:
            samples: How many were lost; a gap of hours takes no longer than one of seconds.
        """
        length, hop = self._profile.length, self._profile.hop
        self._lose(min(samples, length))
        # Pending frames lie wholly in the gap now, and so would all that are skipped.
        jump = max(samples - length, 0) // hop * hop
        self._count += jump
        self._frame += jump
        self._due += jump
        for windows in self._windows:
            windows.jump(jump // hop)
        self._lose(samples - min(samples, length) - jump)

    def finish(self) -> Labels:
        """End the signal; what is pushed next begins another one.

        Returns:
            The label of the last frame, flush with the end, if the profile asks for one where no
            hop leads.
        """
        profile, found = self._profile, list[Decided]()
        last = self._count - profile.length
        flush = profile.flush_end and last > self._first
        if flush and (last - self._first) % profile.hop and self._is_whole(last):
            place = last - self._base
            found = self._decide([last], [windows.of_place(place) for windows in self._windows])
        self._begin()
        return self._labels(found) if found else self._nothing

    def _begin(self) -> None:
        self._count = 0  # samples so far
        self._held = 0  # samples in the buffer
        self._first = int(self._profile.drop_first_sample)
        self._frame = self._first  # start of the next frame
        for windows in self._windows:
            windows.begin()
        self._due = self._next_due(0)  # count with which there is work to do

    def _lose(self, samples: int) -> None:
        self._take(np.zeros((len(self._samples), samples)), np.zeros(samples, dtype=bool))

    def _keep(self, samples: Array, valid: Mask | bool) -> None:
        """Append at most a frame's length of samples to the buffer."""
        length = self._profile.length
        count = samples.shape[-1]
        if self._held + count > len(self._valid):
            for buffer in (self._samples, self._valid):
                buffer[..., :length] = buffer[..., self._held - length : self._held]
            self._held = length
        stop = self._held + count
        self._samples[..., self._held : stop], self._valid[self._held : stop] = samples, valid
        self._held = stop
        self._count += count

    def _advance(self, chunk: int) -> list[Decided]:
        """Transform the windows that are complete, and decide on the frames that are.

        Args:
            chunk: Samples of the last chunk; the next one is expected to have as many.
        """
        profile = self._profile
        for windows in self._windows:
            windows.advance(self._count - self._first, self._base - self._first)
        frames = range(self._frame, self._count - profile.length + 1, profile.hop)
        self._frame += len(frames) * profile.hop
        self._due = self._next_due(chunk)
        whole = [frame for frame in frames if self._is_whole(frame)]
        if not whole:
            return []
        numbers = (np.array(whole) - self._first) // profile.hop
        return self._decide(whole, [windows.of_frames(numbers) for windows in self._windows])

    def _next_due(self, chunk: int) -> int:
        """Count at which to go on: before the chunk that completes a frame, and after it."""
        complete = self._frame + self._profile.length
        early = complete - max(chunk, self._lead)
        return min(early if early > self._count else complete, self._count + self._latency)

    @property
    def _base(self) -> int:
        """Index of the first sample in the buffer."""
        return self._count - self._held

    def _is_whole(self, frame: int) -> bool:
        """Whether no gap touches the frame that starts at a sample."""
        place = frame - self._base
        return bool(self._valid[place : place + self._profile.length].all())

    def _decide(self, frames: list[int], energies: list[Array]) -> list[Decided]:
        """Decision values of frames, from the log-band energies of their windows."""
        features = temporal_pooling(energies, self._profile)
        return [(np.array(frames), self.classifier.decide(features))]

    def _labels(self, found: list[Decided]) -> Labels:
        starts, decisions = found[0]
        if len(found) > 1:
            starts, decisions = (np.concatenate(each) for each in zip(*found, strict=True))
        return self.classifier.labels(decisions, starts, self.rate, start=self.start)
