"""The windows of a stream: each transform is computed once, for all frames that it is of."""

from bisect import bisect_right

import numpy as np

from models.features import levels
from models.profile import Profile
from models.resolution import Resolution
from models.types import Array, Index


class Windows:
    """Levels of a stream's windows at one resolution.

    Frames start every hop, and their windows at the same phases of each hop. Windows are numbered
    in order of time. Samples are counted from the start of the first frame.

    Args:
        samples: Where the stream keeps its latest samples, shape (..., samples).
        profile: What to compute.
        resolution: One of the profile's.
    """

    def __init__(self, samples: Array, profile: Profile, resolution: Resolution) -> None:
        self._profile, self._resolution = profile, resolution
        steps = resolution.stride * np.arange(resolution.transforms(profile.length))
        hops, phase = np.divmod(steps, profile.hop)
        phases, rank = np.unique(phase, return_inverse=True)
        self._of_frame = hops * len(phases) + rank  # those of the first frame
        self._in_frame = steps
        self._phases: list[int] = phases.tolist()
        window = resolution.window
        view = np.lib.stride_tricks.sliding_window_view(samples, window, axis=-1)
        self._windows = np.moveaxis(view, -2, 0)
        self._rows = len(phases) * (2 * profile.length // profile.hop + 2)
        # Of window i in row i modulo rows; rows are beside the bands.
        *signals, bands = levels(self._windows[0], profile, resolution).shape
        self._levels = np.zeros((*signals, self._rows, bands))
        self._done = 0  # windows that are transformed

    @property
    def due(self) -> int:
        """Count of samples with which the next window is complete."""
        return self._start(self._done) + self._resolution.window

    def begin(self) -> None:
        """Forget all windows: another signal begins."""
        self._done = 0

    def jump(self, hops: int) -> None:
        """Pass over so many hops of a gap."""
        self._done += hops * len(self._phases)

    def advance(self, count: int, base: int) -> None:
        """Transform the windows that are complete.

        Args:
            count: Samples that came.
            base: Which of them is the first that is kept.
        """
        hops, phase = divmod(count - self._resolution.window, self._profile.hop)
        complete = hops * len(self._phases) + bisect_right(self._phases, phase)
        fresh = range(self._done, complete)
        if not fresh:
            return
        stretches = self._windows[[self._start(window) - base for window in fresh]]
        # Side by side, windows of all signals are one product of matrices.
        flat = stretches.reshape(-1, self._resolution.window)
        found = levels(flat, self._profile, self._resolution)
        for window, each in zip(fresh, found.reshape(*stretches.shape[:-1], -1), strict=True):
            self._levels[..., window % self._rows, :] = each
        self._done = complete

    def of_frames(self, frames: Index) -> Array:
        """Give the levels of frames whose windows are done.

        Args:
            frames: Their numbers, by hops, shape (frames,).

        Returns:
            Shape (frames, time, bands) or (frames, signals, time, bands).
        """
        first = (frames * len(self._phases)).tolist()
        rows = [(number + self._of_frame) % self._rows for number in first]
        return np.array([self._levels.take(each, axis=-2) for each in rows])

    def of_place(self, place: int) -> Array:
        """Compute the levels of the frame that starts at a place among the samples kept.

        Returns:
            As `of_frames`, for one frame.
        """
        stretches = self._windows[place + self._in_frame]
        found = levels(stretches, self._profile, self._resolution)
        return np.ascontiguousarray(np.moveaxis(found, 0, -2))[None]

    def _start(self, window: int) -> int:
        """Say at which sample a window starts, by its number."""
        hops, phase = divmod(window, len(self._phases))
        return hops * self._profile.hop + self._phases[phase]
