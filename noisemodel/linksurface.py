"""The surface of one link: integrals that give its mean speed in any motion."""

import hashlib
from dataclasses import asdict, dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from noisemodel.cache import cached
from noisemodel.moments import moments
from noisemodel.quadrature import Cloud, fine, point_speeds, reduced
from noisemodel.turning import rounding, tabulate
from noisemodel.types import Array

VERSION = "link-3"
"""Changes with what is computed here, so that nothing older is taken from the cache."""

HALVINGS = 8
"""1024 points for each link: mean speeds are right to about 1e-3, whatever the motion."""


@dataclass(frozen=True, eq=False)
class LinkSurface:
    """The surface of a link, in its joint's axes; all is 0 where there is no geometry.

    Attributes:
        area: In [m²].
        centroid: Shape (3,), in [m].
        lever: Mean distance from the axis that the joint turns about (the paper's G), in [m]; 0
            for a joint that slides, nan for a floating base, which turns about any axis.
        mean_square: Under a twist nu the mean-square speed is nu' M nu, shape (6, 6).
        mean_square_normal: The same for the speed normal to the surface, shape (6, 6).
        rounding: Axes in which equal rotations have equal mean-square speed, shape (3, 3).
        turning: Ratio of mean to root-mean-square speed of rotations, by axis, as a table.
        points: Weighted points on the surface.
    """

    area: float
    centroid: Array
    lever: float
    mean_square: Array
    mean_square_normal: Array
    rounding: Array
    turning: Array
    points: Cloud

    @classmethod
    def of(cls, triangles: Array, axis: Array | None) -> Self:
        """Surface of a link by integrals over its triangles, which are cached.

        Args:
            triangles: Corners in the joint's axes, shape (triangles, 3, 3), in [m].
            axis: What the joint turns about, shape (3,); None if it turns about any axis.

        Returns:
            The surface.
        """
        content = hashlib.sha256(triangles.tobytes())
        content.update(b"any" if axis is None else axis.tobytes())
        kept = cached(f"{VERSION}-{content.hexdigest()}", lambda: _integrals(triangles, axis))
        points = Cloud(kept.pop("points"), kept.pop("weights"))
        area, lever = float(kept.pop("area")), float(kept.pop("lever"))
        return cls(area=area, lever=lever, points=points, **kept)


def _integrals(triangles: Array, axis: Array | None) -> dict[str, NDArray[Any]]:
    exact = asdict(moments(triangles))
    if exact["area"] == 0.0:
        none = {"lever": 0.0, "rounding": np.zeros((3, 3)), "turning": np.zeros((1, 1))}
        none |= {"points": np.zeros((0, 3)), "weights": np.zeros(0)}
        return {name: np.asarray(value) for name, value in (exact | none).items()}
    dense = fine(triangles)
    cloud = reduced(dense, halvings=HALVINGS)
    rounded = rounding(exact["mean_square"][3:, 3:])
    inexact = {
        "lever": _lever(dense, axis),
        "rounding": rounded,
        "turning": tabulate(cloud, rounded),
        **asdict(cloud),
    }
    return {name: np.asarray(value) for name, value in (exact | inexact).items()}


def _lever(cloud: Cloud, axis: Array | None) -> float:
    """Mean distance from an axis through the origin."""
    if axis is None:
        return float("nan")
    turning = np.concatenate((np.zeros(3), axis))[:, None]
    return float((cloud.weights @ point_speeds(cloud.points, turning))[0])
