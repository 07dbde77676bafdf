"""Limits on what files may ask for, far above what robots have; each can be raised by its name."""

import os
from types import MappingProxyType

from noisemodel.errors import NoiseModelError

LIMITS = MappingProxyType(
    {"joints": 1000, "columns": 10_000, "triangles": 2_000_000, "bodies": 20_000}
)
"""Joints of a robot or a run, columns of a CSV log, triangles of a mesh, bodies and geoms of an
MJCF."""

PREFIX = "NOISE_LIMIT_"
"""Of the environment variables with other limits: ``NOISE_LIMIT_JOINTS=2000``."""


def limit(name: str) -> int:
    """A limit of ``LIMITS``, or what the environment has instead.

    Raises:
        NoiseModelError: If the environment has no whole number.
    """
    stated = os.environ.get(f"{PREFIX}{name.upper()}", "")
    if stated and not (stated.isascii() and stated.isdecimal() and len(stated) < 16):
        raise NoiseModelError(f"{PREFIX}{name.upper()} is {stated!r}, expected a whole number")
    return int(stated) if stated else LIMITS[name]


def beyond(name: str) -> str:
    """Words for what exceeds a limit: the limit, and how it is raised."""
    return f"the limit is {limit(name)} (--limit {name}=N raises it)"
