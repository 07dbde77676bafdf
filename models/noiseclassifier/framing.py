"""Framing: the stretches of a signal that are classified.

Conventions: frame ``i`` holds the samples from ``i * hop`` up to ``i * hop + length``; a stretch at
the end that is shorter than a hop belongs to no frame (paper, Sec. III-A, Framing).
"""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from noiseclassifier.errors import SignalError
from noiseclassifier.types import Real

Scalar = TypeVar("Scalar", bound=np.generic)


def frame(signal: NDArray[Scalar], *, length: int = 4000, hop: int = 1000) -> NDArray[Scalar]:
    """Overlapping frames of a signal.

    Args:
        signal: The noise signal, shape (samples,), or several, shape (signals, samples).
        length: Samples of a frame.
        hop: Samples from the start of one frame to the start of the next.

    Returns:
        A read-only view, shape (frames, length), or (frames, signals, length) of several.

    Raises:
        SignalError: If the signal has another shape or is shorter than one frame.
    """
    if signal.ndim not in (1, 2):
        raise SignalError(f"a signal of shape {signal.shape}, expected (samples,)")
    if signal.shape[-1] < length:
        raise SignalError(
            f"a signal of {signal.shape[-1]} samples is too short: one frame takes {length}"
        )
    windows = np.lib.stride_tricks.sliding_window_view(signal, length, axis=-1)
    return np.moveaxis(windows[..., ::hop, :], -2, 0)


def pad_end(signal: Real, *, length: int) -> Real:
    """A signal lengthened at its end, continuous in value and slope.

    Args:
        signal: The signal, shape (..., samples), at least one sample.

    Returns:
        The signal reflected at its last sample in time and in amplitude (paper, Sec. III-A),
        shape (..., length), or the signal itself if it is that long already.
    """
    missing = max(length - signal.shape[-1], 0)
    widths = [(0, 0)] * (signal.ndim - 1) + [(0, missing)]
    return np.pad(signal, widths, mode="reflect", reflect_type="odd")
