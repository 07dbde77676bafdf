"""Features of the frames of a signal, whole or in chunks: each transform is computed once."""

from collections.abc import Iterable, Iterator
from typing import TypeAlias

import numpy as np

from noiseclassifier.errors import SignalError
from noiseclassifier.features import feature_count, rounded, temporal_pooling
from noiseclassifier.profile import Profile
from noiseclassifier.reference import RunningReference
from noiseclassifier.signals import Signals, check, stacked
from noiseclassifier.types import Array, Index, Mask, Real
from noiseclassifier.windows import Windows

AT_ONCE = 2
"""Frames' lengths of samples that are taken at once: more do not fit into the cache."""

Frames: TypeAlias = tuple[Index, Array]
"""First sample of each frame, shape (frames,), and its features, not yet standardised, shape
(frames, features)."""


def frame_features(signal: Signals, profile: Profile, valid: Mask | None = None) -> Frames:
    """Features of all frames of a whole signal.

    Args:
        signal: The noise estimate, shape (samples,), or signals by name.
        profile: How it is framed, and what to compute.
        valid: False in gaps, shape (samples,); frames that touch a gap are left out.
    """
    return _joined([*frames_of([(signal, valid)], profile)])


def frames_of(pieces: Iterable[tuple[Signals, Mask | None]], profile: Profile) -> Iterator[Frames]:
    """Features of all frames of a signal that comes in pieces, the same as of the whole one.

    Args:
        pieces: The noise estimate, shape (samples,), or signals by name, and False in gaps, shape
            (samples,); one piece or more.
        profile: How it is framed, and what to compute.
    """
    frames = None
    for signal, valid in pieces:
        samples = stacked(signal, profile.signals)
        if frames is None:
            frames = FrameFeatures(profile, len(samples) if samples.ndim > 1 else 1)
        yield frames.push(samples, None if valid is None else np.asarray(valid, bool))
    assert frames is not None
    least = profile.drop_first_sample + profile.length
    if frames.count < least:
        raise SignalError(f"a signal of {frames.count} samples is too short: a frame takes {least}")
    yield frames.finish()


class FrameFeatures:
    """Features of the frames of a signal that comes in chunks of any size.

    The features of a frame come with its last sample, and do not depend on the chunks, bit for
    bit. Each Fourier transform is computed once, for all frames that share it: many at a time,
    since they take little longer than one, and all but the last few before the chunk that
    completes a frame. Memory does not grow.

    Args:
        profile: How the signal is framed, and what to compute.
        rows: Number of norms, and of joints of all signals that go joint by joint.
    """

    def __init__(self, profile: Profile, rows: int) -> None:
        self._profile = profile
        # Room for a frame, and for as much as is taken at once.
        self._at_once = AT_ONCE * profile.length
        self._samples = np.zeros((rows, profile.length + self._at_once))
        self._valid = np.zeros(self._samples.shape[1], dtype=bool)
        self._windows = [Windows(self._samples, profile, each) for each in profile.resolutions]
        self._nothing = np.empty(0, dtype=np.intp), np.empty((0, feature_count(profile)))
        # Longest latency of a window: its samples have to be in the buffer still.
        self._latency = profile.length - max(each.window for each in profile.resolutions)
        self._lead = min(profile.hop // 2, *(each.stride for each in profile.resolutions))
        self._begin()

    @property
    def count(self) -> int:
        """Samples so far."""
        return self._count

    def push(self, samples: Real, valid: Mask | None = None) -> Frames:
        """Features of the frames that samples complete.

        Args:
            samples: Any number of them, also none, shape (samples,) or (rows, samples).
            valid: False in gaps, shape (samples,); frames that touch a gap are left out.
        """
        if samples.ndim > 1 and len(samples) != len(self._samples):
            raise SignalError(
                f"{len(samples)} rows of norms and joints, expected {len(self._samples)}"
            )
        check(samples, valid, first=self._count)
        return self._take(rounded(samples, self._profile), valid)

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

    def finish(self) -> Frames:
        """End the signal; what is pushed next begins another one."""
        profile, found = self._profile, self._nothing
        last = self._count - profile.length
        flush = profile.flush_end and last > self._first
        if flush and (last - self._first) % profile.hop and self._is_whole(last):
            place = last - self._base
            energies = [windows.of_place(place) for windows in self._windows]
            found = np.array([last]), self._features(energies)
        self._begin()
        return found

    def _begin(self) -> None:
        self._count = 0  # samples so far
        self._held = 0  # samples in the buffer
        self._first = int(self._profile.drop_first_sample)
        self._frame = self._first  # start of the next frame
        self._relative = RunningReference()
        for windows in self._windows:
            windows.begin()
        self._due = self._next_due(0)  # count with which there is work to do

    def _take(self, exact: Array, valid: Mask | None) -> Frames:
        found: list[Frames] = []
        for first in range(0, exact.shape[-1], self._at_once):
            piece = slice(first, first + self._at_once)
            self._keep(exact[..., piece], True if valid is None else valid[piece])
            if self._count >= self._due:
                found += self._advance(exact.shape[-1])
        return _joined(found) if found else self._nothing

    def _lose(self, samples: int) -> None:
        self._take(np.zeros((len(self._samples), samples)), np.zeros(samples, dtype=bool))

    def _keep(self, samples: Array, valid: Mask | bool) -> None:
        """Append samples to the buffer, at most as many as are taken at once."""
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

    def _advance(self, chunk: int) -> list[Frames]:
        """Transform the windows that are complete, and pool those of the frames that are.

        Args:
            chunk: Samples of the last chunk; the next one is expected to have as many.
        """
        profile = self._profile
        for windows in self._windows:
            windows.advance(self._count - self._first, self._base - self._first)
        frames = range(self._frame, self._count - profile.length + 1, profile.hop)
        self._frame += len(frames) * profile.hop
        self._due = self._next_due(chunk)
        whole = np.array([frame for frame in frames if self._is_whole(frame)], dtype=np.intp)
        if not len(whole):
            return []
        numbers = (whole - self._first) // profile.hop
        energies = [windows.of_frames(numbers) for windows in self._windows]
        return [(whole, self._features(energies))]

    def _features(self, energies: list[Array]) -> Array:
        """Features of frames, in order, as they are, and relative to those so far."""
        features = temporal_pooling(energies, self._profile)
        if not self._profile.reference:
            return features
        return np.concatenate((features, self._relative.relative(features)), axis=1)

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


def _joined(parts: list[Frames]) -> Frames:
    if len(parts) == 1:
        return parts[0]
    starts, features = zip(*parts, strict=True)
    return np.concatenate(starts), np.concatenate(features)
