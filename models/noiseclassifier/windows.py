"""Buffered windows of a signal: each transform is computed once, for all frames that share it."""

from bisect import bisect_right

import numpy as np

from noiseclassifier.features import log_band_energies
from noiseclassifier.profile import Profile, Resolution
from noiseclassifier.types import Array, Index

AT_ONCE = 2**16
"""How many samples are transformed at once, of all rows: more leave the cache of the processor."""


class Windows:
    """Log-band energies of a signal's windows at one resolution.

    Frames start every hop, and their windows at the same phases of each hop. Windows are numbered
    in order of time. Samples are counted from the start of the first frame.

    Args:
        samples: Buffer of the signal, shape (rows, samples).
    """

    def __init__(self, samples: Array, profile: Profile, resolution: Resolution) -> None:
        self._profile, self._resolution = profile, resolution
        steps = resolution.stride * np.arange(resolution.transforms(profile.length))
        hops, phase = np.divmod(steps, profile.hop)
        phases, rank = np.unique(phase, return_inverse=True)
        self._of_frame = hops * len(phases) + rank  # those of the first frame
        self._in_frame = steps
        self._phases: list[int] = phases.tolist()
        self._windows = np.lib.stride_tricks.sliding_window_view(samples, resolution.window, -1)
        cycle = samples.shape[1] // profile.hop + 2
        self._rows, self._cycle = len(phases) * cycle, cycle * profile.hop
        # Window i is in row i modulo rows; two cycles, so that no slice ends at the last row.
        around = np.arange(2 * self._rows)
        self._row_of = around % self._rows
        self._start_of = around // len(phases) * profile.hop + phases[around % len(phases)]
        one = log_band_energies(self._windows[:, 0], profile, resolution)
        self._energies = np.zeros((self._rows, *one.shape))
        self._at_once = max(1, AT_ONCE // (samples.shape[0] * resolution.window))
        self._done = 0  # transformed windows

    def begin(self) -> None:
        """Discard all windows: another signal begins."""
        self._done = 0

    def jump(self, hops: int) -> None:
        """Skip so many hops of a gap."""
        self._done += hops * len(self._phases)

    def advance(self, count: int, base: int) -> None:
        """Transform the windows that are complete.

        Args:
            base: Index of the first one in the buffer.
        """
        hops, phase = divmod(count - self._resolution.window, self._profile.hop)
        complete = hops * len(self._phases) + bisect_right(self._phases, phase)
        if complete <= self._done:
            return
        cycles, first = divmod(self._done, self._rows)
        fresh = slice(first, first + complete - self._done)
        starts = self._start_of[fresh] + (cycles * self._cycle - base)
        rows = self._row_of[fresh]
        for few in range(0, len(starts), self._at_once):
            part = slice(few, few + self._at_once)
            one = len(starts[part]) == 1  # a slice copies nothing
            chosen = slice(starts[few], starts[few] + 1) if one else starts[part]
            self._energies[rows[part]] = log_band_energies(
                self._windows[:, chosen], self._profile, self._resolution
            )
        self._done = complete

    def of_frames(self, frames: Index) -> Array:
        """Log-band energies of frames whose windows are transformed.

        Args:
            frames: Their numbers, in hops, shape (frames,).
        """
        windows = (frames * len(self._phases))[:, None] + self._of_frame
        return self._energies.take(windows, axis=0, mode="wrap")

    def of_place(self, place: int) -> Array:
        """Log-band energies of the frame that starts at a place in the buffer."""
        windows = self._windows[:, place + self._in_frame]
        return log_band_energies(windows, self._profile, self._resolution)[None]
