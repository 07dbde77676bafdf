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


def nearest(rgb, eyes):
    """Distance of the two colours that are nearest to each other (CIE 1976)."""
    places = lab(rgb, eyes)
    first, second = np.triu_indices(len(places), 1)
    return np.linalg.norm(places[first] - places[second], axis=1).min()


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
    assert nearest([*classes, colors.OTHERS[0]], eyes) > 17.5
    assert nearest([*classes, *colors.OTHERS], eyes) > 12.5
    assert nearest(list(colors.SERIES), eyes) > 16
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
