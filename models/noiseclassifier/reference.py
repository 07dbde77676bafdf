"""The reference that features are relative to, beside the same features unchanged.

How loud fault-free motion is differs from robot to robot by orders of magnitude. Relative to a
reference, it differs far less: each feature less its location there, divided by its spread. The
reference is the signal itself so far; of a whole signal, also the rest of it. A failure that fills
a whole signal is invisible relative to the signal itself; therefore the unchanged features stay
beside.

Conventions: a spread is 1.48 times a median absolute deviation, the standard deviation of a normal
distribution (P. J. Huber and E. M. Ronchetti, *Robust Statistics*, 2009, Sec. 5.1).
"""

import numpy as np

from noiseclassifier.signals import Array, Index, Mask

LEAST = 0.15
"""Added to each spread, in [Np]: features of a robot that stands hardly vary at all."""
MOST = 15.0
"""Largest relative feature."""
NORMAL = 1.48
"""Standard deviation of a normal distribution, in median absolute deviations."""
MEMORY = 600
"""Frames that a running reference remembers at most, so that it follows slow changes: a minute."""
FIRST = 0.3
"""Spread before anything is known, in [Np]; it counts as ``FIRST_FRAMES`` frames."""
FIRST_FRAMES = 10
BOUND = 1.5
"""Spreads by which a frame moves a running location at most, times its share."""


class RunningReference:
    """The reference that a signal itself is, as far as it has come.

    Location and spread are recursive M-estimates: each frame moves them by a bounded step, which
    falls with the number of frames (P. J. Huber and E. M. Ronchetti, *Robust Statistics*, 2009,
    Sec. 3.2; H. Robbins and S. Monro, *A Stochastic Approximation Method*, 1951). They know nothing
    of frames to come, so that a whole signal has the features of a stream.
    """

    def __init__(self) -> None:
        self._frames = 0
        self._location = self._spread = np.empty(0)

    def relative(self, features: Array) -> Array:
        """Features of the next frames relative to those so far, shape (frames, features)."""
        found = np.empty_like(features)
        for row, frame in enumerate(features):
            self._take(frame)
            found[row] = _relative(frame, self._location, self._spread)
        return found

    def _take(self, frame: Array) -> None:
        if not self._frames:
            self._location, self._spread = frame.copy(), np.full_like(frame, FIRST)
            self._frames = 1
            return
        self._frames = min(self._frames + 1, MEMORY)
        bound = BOUND * self._spread
        step = np.maximum(np.minimum(frame - self._location, bound), -bound)
        self._location += step / self._frames
        # E |x| of a normal distribution is 0.8 of its standard deviation.
        apart = np.minimum(np.abs(frame - self._location), 3.0 * self._spread) / 0.8
        self._spread += (apart - self._spread) / (self._frames + FIRST_FRAMES)


KEPT = 6000
"""Frames that are kept of a whole signal at most, beside those that may be failures: 10 minutes."""
FEWEST = 10
"""Frames of the rest of a signal that make a reference."""


class Rest:
    """Features of a whole signal by which its findings are compared with the rest of it.

    Kept are those of all frames that may be failures, and of others evenly spread, so that memory
    does not grow with the signal.
    """

    def __init__(self) -> None:
        self._step, self._count = 1, 0
        self._place, self._failure = np.empty(0, np.intp), np.empty(0, bool)
        self._features: Array | None = None

    def add(self, features: Array, failure: Mask) -> None:
        """Take the features of the next frames, shape (frames, features)."""
        place = self._count + np.arange(len(features))
        self._count += len(features)
        held = features[:0] if self._features is None else self._features
        self._place = np.concatenate((self._place, place))
        self._failure = np.concatenate((self._failure, failure))
        self._features = np.concatenate((held, features))
        if np.count_nonzero(~self._failure) > 2 * KEPT:
            self._step *= 2
        kept = self._failure | (self._place % self._step == 0)
        if not kept.all():
            self._place, self._failure = self._place[kept], self._failure[kept]
            self._features = self._features[kept]

    def relative(self, flagged: Mask) -> tuple[Index, Array] | None:
        """Features of flagged frames relative to all others.

        Args:
            flagged: Whether a frame belongs to a finding, shape (frames,), only such that may be
                failures.

        Returns:
            Places of the flagged frames, and their features unchanged and relative to the median
            of the others; None if one of both is missing.
        """
        own = flagged[self._place]
        if self._features is None or not own.any() or np.count_nonzero(~own) < FEWEST:
            return None
        others, features = self._features[~own], self._features[own]
        location = np.median(others, axis=0)
        spread = NORMAL * np.median(np.abs(others - location), axis=0)
        both = np.concatenate((features, _relative(features, location, spread)), axis=1)
        return self._place[own], both


def _relative(features: Array, location: Array, spread: Array) -> Array:
    found = (features - location) / (spread + LEAST)
    return np.maximum(np.minimum(found, MOST, out=found), -MOST, out=found)
