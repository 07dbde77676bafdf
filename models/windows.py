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
        rows = len(phases) * (2 * profile.length // profile.hop + 2)
        # Of window i in row i modulo rows.
        self._levels = np.zeros((rows, *levels(self._windows[0], profile, resolution).shape))
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
        if fresh:
            places = [self._start(window) - base for window in fresh]
            # Side by side, windows of all signals are one product of matrices.
            flat = self._windows[places].reshape(-1, self._resolution.window)
            found = levels(flat, self._profile, self._resolution)
            rows = np.arange(self._done, complete) % len(self._levels)
            self._levels[rows] = found.reshape(-1, *self._levels[0].shape)
            self._done = complete

    def of_frames(self, frames: Index) -> Array:
        """Give the levels of frames whose windows are done.

        Args:
            frames: Their numbers, by hops, shape (frames,).

        Returns:
            Shape (frames, time, bands) or (frames, signals, time, bands).
        """
        windows = (frames * len(self._phases))[:, None] + self._of_frame
        return _in_time(self._levels[windows % len(self._levels)])

    def of_place(self, place: int) -> Array:
        """Compute the levels of the frame that starts at a place among the samples kept.

        Returns:
            As `of_frames`, for one frame.
        """
        stretches = self._windows[place + self._in_frame]
        return _in_time(levels(stretches, self._profile, self._resolution)[None])

    def _start(self, window: int) -> int:
        """Say at which sample a window starts, by its number."""
        hops, phase = divmod(window, len(self._phases))
        return hops * self._profile.hop + self._phases[phase]


def _in_time(levels: Array) -> Array:
    """Bring time beside the bands, shape (frames, ..., time, bands)."""
    return np.ascontiguousarray(levels.swapaxes(1, -2))
