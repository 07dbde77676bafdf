"""One colour scheme everywhere; the classes stay apart for the colour-blind.

Each class has a contrast of at least 3:1 (WCAG 2.2, 1.4.11) against the backgrounds of the viewer
and against the white of reports. Any two of NoisyTest's own, `louder` and `unknown` differ by a
CIEDE2000 of at least 15 as deuteranopes and protanopes see them (Machado, Oliveira and Fernandes
2009); found by search under these conditions. No class is shown by its colour alone: each has a row
or a name.
"""

from itertools import cycle
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from noiseclassifier import UNKNOWN

Color: TypeAlias = tuple[int, int, int]

# Of the viewer's plots, and of reports.
BACKGROUNDS: tuple[Color, ...] = ((13, 13, 13), (255, 255, 255))
CLASSES: dict[str, Color] = {
    "ok": (48, 114, 96),
    "impact": (180, 63, 25),
    "highaccelerations": (221, 124, 11),
    "oscillations": (90, 144, 252),
    "louder": (132, 84, 150),
    UNKNOWN: (144, 144, 150),
}
OTHERS: tuple[Color, ...] = ((162, 144, 114), (24, 84, 252), (198, 30, 90), (138, 138, 180))
# Behind a verdict in white letters; the words say the same.
VERDICTS: dict[str, Color] = {
    "findings": (178, 34, 34),
    "ok": CLASSES["ok"],
    "cannot-tell": (96, 96, 102),
}
NOISE: Color = (160, 196, 255)
LEVEL: Color = (240, 228, 140)
BAND: Color = (150, 156, 168)
THRESHOLD: Color = (235, 235, 235)  # alarm threshold, ticks and gaps
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
    others = cycle(OTHERS)
    return {name: CLASSES.get(name) or next(others) for name in classes}


def of_series(count: int, *, dim: bool = False) -> list[Color]:
    """The colours of several lines, paler ones if dim."""
    shade = 0.55 if dim else 1.0
    colors = [SERIES[i % len(SERIES)] for i in range(count)]
    return [(int(r * shade), int(g * shade), int(b * shade)) for r, g, b in colors]


# Slate, which is quiet, through purple and orange to pale yellow, of rising lightness.
HEAT = np.array(
    [[50, 54, 68], [92, 56, 118], [164, 60, 112], [224, 92, 70], [250, 165, 40], [252, 250, 180]],
    dtype=np.float64,
)


# Blue is before and quieter, orange is after and louder; what did not change is grey.
BEFORE, SAME, AFTER = (86, 180, 233), (62, 68, 80), (240, 160, 30)


def heat(level: NDArray[np.floating], shades: NDArray[np.float64] = HEAT) -> NDArray[np.uint8]:
    """Colour levels from 0 to 1, by red, green, blue and opacity, shape (…, 4)."""
    place, steps = np.asarray(level) * (len(shades) - 1), np.arange(len(shades))
    channels = [np.interp(place, steps, shades[:, channel]) for channel in range(3)]
    return np.stack([*channels, np.full(place.shape, 255.0)], axis=-1).astype(np.uint8)


def diverging(level: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Colour changes: blue at 0, grey at 0.5, orange at 1."""
    return heat(level, np.array([BEFORE, SAME, AFTER], dtype=np.float64))
