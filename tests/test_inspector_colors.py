"""Colours stay apart for the red- and green-blind."""

import numpy as np
import pytest

from inspector import colors

# Machado, Oliveira and Fernandes 2009, Table 1, severity 1.0, on linear RGB.
EYES = {
    "all cones": np.eye(3),
    "no red cones": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "no green cones": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
}
XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
WHITE = np.array([0.95047, 1.0, 1.08883])


def lab(rgb, eyes):
    """CIE L*a*b* of colours as some eyes see them, shape (colours, 3)."""
    share = np.asarray(rgb, dtype=float) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    seen = np.clip(linear @ np.transpose(EYES[eyes]), 0.0, 1.0) @ XYZ.T / WHITE
    f = np.where(seen > 0.008856, np.cbrt(seen), 7.787 * seen + 16 / 116)
    x, y, z = f.T
    return np.stack((116 * y - 16, 500 * (x - y), 200 * (y - z)), axis=1)


def difference(one, other):
    """CIEDE2000 of colours in L*a*b*, shape (..., 3) (Sharma, Wu and Dalal 2005)."""
    (l1, a1, b1), (l2, a2, b2) = np.moveaxis(one, -1, 0), np.moveaxis(other, -1, 0)
    chroma = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2
    grey = 0.5 * (1 - np.sqrt(chroma**7 / (chroma**7 + 25.0**7)))
    a1, a2 = (1 + grey) * a1, (1 + grey) * a2
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = np.degrees(np.arctan2(b1, a1)) % 360, np.degrees(np.arctan2(b2, a2)) % 360
    turn = np.where(c1 * c2 == 0, 0, (h2 - h1 + 180) % 360 - 180)
    hue = np.where(c1 * c2 == 0, h1 + h2, h1 + turn / 2) % 360
    light, chroma = (l1 + l2) / 2, (c1 + c2) / 2
    delta = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(turn) / 2)
    t = (
        1
        - 0.17 * np.cos(np.radians(hue - 30))
        + 0.24 * np.cos(np.radians(2 * hue))
        + 0.32 * np.cos(np.radians(3 * hue + 6))
        - 0.20 * np.cos(np.radians(4 * hue - 63))
    )
    blue = 60 * np.exp(-(((hue - 275) / 25) ** 2))
    turned = -2 * np.sqrt(chroma**7 / (chroma**7 + 25.0**7)) * np.sin(np.radians(blue))
    lightness = (l2 - l1) / (1 + 0.015 * (light - 50) ** 2 / np.sqrt(20 + (light - 50) ** 2))
    saturation = (c2 - c1) / (1 + 0.045 * chroma)
    hues = delta / (1 + 0.015 * chroma * t)
    return np.sqrt(lightness**2 + saturation**2 + hues**2 + turned * saturation * hues)


def nearest(rgb, eyes):
    """CIEDE2000 of the two colours that are nearest to each other."""
    places = lab(rgb, eyes)
    first, second = np.triu_indices(len(places), 1)
    return difference(places[first], places[second]).min()


def luminance(rgb):
    """Relative luminance of colours, between 0 and 1."""
    share = np.asarray(rgb, dtype=float) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return linear @ XYZ[1]


def contrast(one, other):
    """Contrast of two colours by WCAG 2.2, from 1 to 21."""
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("eyes", EYES)
def test_colours_stay_apart_and_heat_only_ever_gets_lighter(eyes):
    classes = list(colors.CLASSES.values())
    assert nearest([*classes, colors.OTHERS[0]], eyes) > 15
    assert nearest([*classes, *colors.OTHERS], eyes) > 12
    assert nearest(list(colors.SERIES), eyes) > 10
    heat = colors.heat(np.linspace(0, 1, 50))[:, :3]
    assert (np.diff(lab(heat, eyes)[:, 0]) > 0).all()


@pytest.mark.parametrize("background", colors.BACKGROUNDS)
def test_classes_stand_out_from_every_background(background):
    shown = [*colors.CLASSES.values(), *colors.OTHERS]
    assert min(contrast(shade, background) for shade in shown) >= 3


def test_unknown_classes_take_colours_of_their_own():
    found = colors.of_classes(("ok", "rattle", "squeak"))
    assert len(set(found.values())) == 3
    assert found["ok"] == colors.CLASSES["ok"]
