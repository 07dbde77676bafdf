"""One colour scheme everywhere; the classes stay apart for the colour-blind (Okabe and Ito)."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from models import ANOMALY, UNKNOWN

Color: TypeAlias = tuple[int, int, int]

CLASSES: dict[str, Color] = {
    "ok": (0, 158, 115),
    "impact": (213, 94, 0),
    "highaccelerations": (240, 228, 66),
    "oscillations": (86, 180, 233),
    ANOMALY: (115, 45, 165),
    UNKNOWN: (60, 60, 60),
}
OTHERS: tuple[Color, ...] = ((204, 121, 167), (230, 159, 0), (0, 114, 178), (190, 190, 190))
NOISE: Color = (160, 196, 255)
SERIES: tuple[Color, ...] = (
    (86, 180, 233),
    (230, 159, 0),
    (0, 158, 115),
    (240, 228, 66),
    (204, 121, 167),
    (213, 94, 0),
    (0, 114, 178),
    (220, 220, 220),
)


def of_classes(classes: tuple[str, ...]) -> dict[str, Color]:
    """The colour of each class; classes that are not NoisyTest's own take further ones."""
    others = [name for name in classes if name not in CLASSES]
    extra = {name: OTHERS[i % len(OTHERS)] for i, name in enumerate(others)}
    return {name: CLASSES.get(name) or extra[name] for name in classes}


def of_series(count: int, *, dim: bool = False) -> list[Color]:
    """The colours of several lines, paler ones if dim."""
    shade = 0.55 if dim else 1.0
    colors = [SERIES[i % len(SERIES)] for i in range(count)]
    return [(int(r * shade), int(g * shade), int(b * shade)) for r, g, b in colors]


LEVELS: dict[str, Color] = {
    "quiet": (84, 94, 114),
    "elevated": (205, 92, 72),
    "high": (250, 170, 40),
    "critical": (255, 248, 180),
}
"""States of a link's level. The louder, the lighter: the order is visible to the colour-blind."""

HEAT = np.array(
    [[13, 8, 45], [66, 10, 104], [147, 38, 103], [221, 81, 58], [252, 165, 10], [252, 255, 164]],
    dtype=np.float64,
)
"""Dark to bright through purple and orange, of evenly rising lightness."""


def heat(level: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Colour levels from 0 to 1.

    Args:
        level: Any shape.

    Returns:
        Red, green, blue and opacity, shape (…, 4).
    """
    place = np.clip(level, 0.0, 1.0) * (len(HEAT) - 1)
    steps = np.arange(len(HEAT))
    channels = [np.interp(place, steps, HEAT[:, channel]) for channel in range(3)]
    return np.stack([*channels, np.full(place.shape, 255.0)], axis=-1).astype(np.uint8)
