"""The windows of a stream: each transform is computed once, for all frames that it is of."""

from bisect import bisect_right

import numpy as np

from models.features import levels
from models.profile import Profile, Resolution
from models.types import Array, Index


class Windows:
    """Levels of a stream's windows at one resolution.

    Frames start every hop, and their windows at the same phases of each hop. Windows are numbered
    in order of time. Samples are counted from the start of the first frame.

    Args:
        samples: Where the stream keeps its latest samples, shape (signals, samples).
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
        view = np.lib.stride_tricks.sliding_window_view(samples, resolution.window, axis=-1)
        self._windows = np.swapaxes(view, 0, 1)
        cycle = 2 * profile.length // profile.hop + 2
        self._rows, self._cycle = len(phases) * cycle, cycle * profile.hop
        # Of window i in row i modulo rows; twice around, so that no slice ends at the last one.
        around = np.arange(2 * self._rows)
        self._row_of = around % self._rows
        self._start_of = around // len(phases) * profile.hop + phases[around % len(phases)]
        self._levels = np.zeros((self._rows, *levels(self._windows[0], profile, resolution).shape))
        self._done = 0  # windows that are transformed

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
        if complete <= self._done:
            return
        cycles, first = divmod(self._done, self._rows)
        fresh = slice(first, first + complete - self._done)
        stretches = self._windows[self._start_of[fresh] + (cycles * self._cycle - base)]
        found = levels(stretches, self._profile, self._resolution)
        self._levels[self._row_of[fresh]] = found
        self._done = complete

    def of_frames(self, frames: Index) -> Array:
        """Give the levels of frames whose windows are done.

        Args:
            frames: Their numbers, by hops, shape (frames,).

        Returns:
            Shape (frames, time, levels).
        """
        windows = (frames * len(self._phases))[:, None] + self._of_frame
        return self._levels.take(windows, axis=0, mode="wrap")

    def of_place(self, place: int) -> Array:
        """Compute the levels of the frame that starts at a place among the samples kept.

        Returns:
            As `of_frames`, for one frame.
        """
        return levels(self._windows[place + self._in_frame], self._profile, self._resolution)[None]
