"""Where the camera of a robot's view stands: as near as it sees every point, the floor below."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from noisemodel.types import Array

FIELD_OF_VIEW = np.deg2rad(55.0)
"""Of the viewer's camera, from the lower to the upper edge, in [rad]."""
AZIMUTH, ELEVATION = np.deg2rad(-55.0), np.deg2rad(18.0)
"""From where a robot that looks along x is seen: from its front, right and above, in [rad]."""
MARGIN = 0.08
"""Share of the picture that stays free at each edge."""
SMALLEST = 0.05
"""A robot that is smaller, such as one without any shape, is framed as if it were so large, [m]."""


@dataclass(frozen=True, eq=False)
class Camera:
    """Where a view of a robot is seen from.

    Attributes:
        eye: Where the camera stands, shape (3,), in [m].
        target: What it looks at, shape (3,), in [m].
        floor: Height of the floor, in [m].
        spacing: Distance of the lines on the floor, in [m].
        frame: Frame of transforms that the view is drawn in, and all this.
        moves: Whether that frame moves with a base, over a floor that is drawn by itself.
    """

    eye: Array
    target: Array
    floor: float
    spacing: float
    frame: str = ""
    moves: bool = False


def fitted(parts: Iterable[Array], *, aspect: float = 1.0, room: float = 1.0) -> Camera:
    """Place a camera as near as it sees all points.

    Args:
        parts: Points, each of shape (points, 3), in [m].
    """
    axes = sight()
    slopes = (1.0 - 2.0 * MARGIN) * np.tan(FIELD_OF_VIEW / 2) * np.array([aspect, 1.0])
    # The edges of the picture are planes through the eye: a point is between the left and the right
    # one if |right - right of eye| <= slope (ahead - ahead of eye). The point that is farthest
    # beyond a plane is the same wherever the eye is, and it alone decides.
    right, up, ahead = axes
    planes = [
        across + sign * slope * ahead
        for across, slope in zip((right, up), slopes, strict=True)
        for sign in (1, -1)
    ]
    measured = np.stack([*planes, ahead, *np.eye(3)])
    reaches = [part @ measured.T for part in parts]
    least = np.min([reach.min(axis=0) for reach in reaches], axis=0)
    most = np.max([reach.max(axis=0) for reach in reaches], axis=0)
    floor = float(least[-1])
    extent = (most - least)[-3:]
    slack = np.abs(measured) @ np.maximum(SMALLEST - extent, (room - 1.0) * extent) / 2
    least, most = least - slack, most + slack
    nearest = min((least[0] - most[1]) / (2 * slopes[0]), (least[2] - most[3]) / (2 * slopes[1]))
    across, height = (least[0] + most[1]) / 2, (least[2] + most[3]) / 2
    middle = (least[4] + most[4]) / 2
    size = float((most - least)[-3:].max())
    return Camera(
        eye=np.array([across, height, nearest]) @ axes,
        target=np.array([across, height, middle]) @ axes,
        floor=floor,
        spacing=float(10.0 ** np.floor(np.log10(size))) / 2,
    )


def sight() -> Array:
    """Directions to the right, upwards and ahead in the picture, one a row, shape (3, 3)."""
    level = np.array([np.cos(AZIMUTH), np.sin(AZIMUTH), np.tan(ELEVATION)])
    ahead = -level / np.linalg.norm(level)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return np.stack((right, np.cross(right, ahead), ahead))
