"""The colours of a comparison: blue is before and quieter, orange is after and louder.

Blue and orange differ to any eyes; what did not change is as grey as a quiet link.
"""

import numpy as np
from numpy.typing import NDArray

from inspector.colors import Color
from inspector.levels import Scale
from noisemodel.types import Array

BEFORE: Color = (86, 180, 233)
AFTER: Color = (240, 160, 30)
SAME: Color = (62, 68, 80)
SIDES = {"before": BEFORE, "after": AFTER}
SHADES = 25
"""An odd number, so that no change has a shade of its own."""


def diverging(place: Array) -> NDArray[np.uint8]:
    """Colour changes: blue at 0, grey at 0.5, orange at 1.

    Args:
        place: Any shape.

    Returns:
        Red, green, blue and opacity, shape (…, 4).
    """
    scale = np.array([BEFORE, SAME, AFTER], dtype=np.float64)
    channels = [np.interp(place, (0.0, 0.5, 1.0), scale[:, channel]) for channel in range(3)]
    return np.stack([*channels, np.full(np.shape(place), 255.0)], axis=-1).astype(np.uint8)


CHANGE = Scale(-12.0, 12.0, "dB", step=6.0, palette=diverging)
"""Of levels; what is beyond is as blue or as orange as can be."""
