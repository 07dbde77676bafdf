"""The colours of a comparison: blue is before and quieter, orange is after and louder.

Blue and orange differ to any eyes; what did not change is as grey as a quiet link.
"""

import numpy as np
from numpy.typing import NDArray

from inspector import colors
from inspector.colors import Color
from noisemodel.types import Array

BEFORE: Color = colors.SERIES[0]
AFTER: Color = colors.SERIES[1]
SAME: Color = (62, 68, 80)
RANGE_DB = 12.0
"""Change that is as blue or as orange as can be, in [dB]."""
SHADES = 25
"""An odd number, so that no change has a shade of its own."""

KINDS: dict[str, Color] = {"new": AFTER, "resolved": BEFORE, "unchanged": (190, 190, 190)}


def diverging(change: Array) -> NDArray[np.uint8]:
    """Colour changes of level, in few shades: few changes of colour are logged.

    Args:
        change: Any shape, in [dB]; positive is louder.

    Returns:
        Red, green, blue and opacity, shape (…, 4).
    """
    half = SHADES // 2
    place = np.round(np.clip(change / RANGE_DB, -1.0, 1.0) * half) / half
    scale = np.array([BEFORE, SAME, AFTER], dtype=np.float64)
    channels = [np.interp(place, (-1.0, 0.0, 1.0), scale[:, channel]) for channel in range(3)]
    return np.stack([*channels, np.full(place.shape, 255.0)], axis=-1).astype(np.uint8)
