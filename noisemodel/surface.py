"""The surface of a robot: that of every link that moves."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from noisemodel.errors import GeometryError
from noisemodel.geometry import LinkTriangles, Missing, triangles
from noisemodel.linksurface import LinkSurface
from noisemodel.robot import Robot
from noisemodel.subspace import turning_axis
from noisemodel.types import Array


@dataclass(frozen=True, eq=False)
class Surface:
    """The surface of every link that moves; what is fixed to the world has none.

    Attributes:
        names: The links: each is all geometry that moves with one joint, and is named after
            that joint's child link.
        joint: Index of each link's joint in Pinocchio, shape (links,).
        links: The surface of each link.
        missing: Addresses of the meshes that were not found and are left out.
    """

    names: tuple[str, ...]
    joint: NDArray[np.intp]
    links: tuple[LinkSurface, ...]
    missing: tuple[str, ...]

    @classmethod
    def of(cls, robot: Robot, geometry: str = "visual", *, missing: Missing = "error") -> Self:
        """Integrate over the links of a robot; what takes long is kept for the next time.

        Args:
            robot: The robot.
            geometry: "visual", "collision", "hull" or "auto".
            missing: What to do about a mesh that is not there: "error", or "skip" it.

        Returns:
            The surface.

        Raises:
            GeometryError: If a shape or a mesh cannot be read, or has no surface.
        """
        return cls.of_triangles(robot, triangles(robot, geometry, missing=missing))

    @classmethod
    def of_triangles(cls, robot: Robot, drawn: LinkTriangles) -> Self:
        """Integrate over triangles that have been read.

        Args:
            robot: The robot.
            drawn: The triangles of each of its links.

        Returns:
            The surface.
        """
        axes = [turning_axis(robot.joints[index - 1]) for index in drawn.joint]
        links = map(LinkSurface.of, drawn.triangles, axes)
        return cls(drawn.names, drawn.joint, tuple(links), drawn.missing)

    @property
    def area(self) -> Array:
        """Area of each link, shape (links,), in [m²]."""
        return self._each(lambda link: link.area)

    @property
    def centroid(self) -> Array:
        """Centroid of each link in its joint's axes, shape (links, 3), in [m]."""
        return self._each(lambda link: link.centroid)

    @property
    def lever(self) -> Array:
        """Mean lever arm G of each link about its joint's axis, shape (links,), in [m].

        It is 0 where the joint slides and nan for a floating base, which turns about any axis.
        """
        return self._each(lambda link: link.lever)

    @property
    def mean_square(self) -> Array:
        """Mean-square speed under a twist nu is nu' M nu, shape (links, 6, 6)."""
        return self._each(lambda link: link.mean_square)

    @property
    def mean_square_normal(self) -> Array:
        """Mean-square normal speed under a twist nu is nu' M nu, shape (links, 6, 6)."""
        return self._each(lambda link: link.mean_square_normal)

    @property
    def without_geometry(self) -> tuple[str, ...]:
        """Names of the links without geometry."""
        pairs = zip(self.names, self.links, strict=True)
        return tuple(name for name, link in pairs if link.area == 0.0)

    def __str__(self) -> str:
        lines = [f"{'link':28} {'area [m²]':>9} {'lever [m]':>9}"]
        for name, link in zip(self.names, self.links, strict=True):
            lines.append(f"{name:28} {link.area:9.4f} {link.lever:9.4f}")
        return "\n".join([*lines, f"{'all':28} {self.area.sum():9.4f}"])

    def _each(self, fact: Callable[[LinkSurface], Array | float]) -> Array:
        return np.array([fact(link) for link in self.links], dtype=np.float64)


def check_surface(surface: Surface, robot: Robot) -> None:
    """Refuse a robot that a surface does not belong to.

    Raises:
        GeometryError: If the robot has another number of links.
    """
    if len(surface.names) != len(robot.joints):
        raise GeometryError(
            f"a surface of {len(surface.names)} links for {robot.name!r}, which has"
            f" {len(robot.joints)}; expected Surface.of(robot)"
        )
