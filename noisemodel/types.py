"""Types that all modules share: of arrays, and errors that keep their facts."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Real: TypeAlias = NDArray[np.floating[Any]]
Mask: TypeAlias = NDArray[np.bool_]
Indices: TypeAlias = NDArray[np.int64]


class NoiseModelError(ValueError):
    """The base of every error that `noisemodel` expects."""


class RunError(NoiseModelError):
    """A run whose arrays do not fit together."""


class RunFileError(RunError):
    """A file that is not a run, or that holds one that is wrong."""

    def __init__(self, path: Path, problem: str) -> None:
        self.path, self.problem = path, problem
        super().__init__(f"{path}: {problem}")


class OutputError(NoiseModelError):
    """An output that exists already or cannot be written."""


class RobotError(NoiseModelError):
    """A robot that cannot be found or read, or that moves in a way that is not supported."""


class UnknownKindError(NoiseModelError):
    """A kind of noise estimate that does not exist."""

    def __init__(self, kind: str, known: Sequence[str]) -> None:
        self.kind, self.known = kind, tuple(known)
        super().__init__(f"no kind {kind!r} of noise; there are {', '.join(known)}")


class GeometryError(NoiseModelError):
    """A robot whose surface is unknown or cannot be read."""


class MeshError(GeometryError):
    """A mesh that cannot be read, or that has no surface."""

    def __init__(self, mesh: str | Path, problem: str) -> None:
        self.mesh, self.problem = str(mesh), problem
        super().__init__(f"mesh {mesh}: {problem}")


class UnknownRobotError(RobotError):
    """A name that is no listed robot, and no file of one either."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        self.name, self.known = name, tuple(known)
        super().__init__(
            f"no robot {name!r}: neither a URDF or MJCF file nor a listed name"
            f"{hint(name, self.known)}; `inspector robots` lists the names"
        )


class UnknownJointError(RobotError):
    """A run names a joint that the robot does not have."""

    def __init__(self, joint: str, robot: str, known: Sequence[str]) -> None:
        self.joint, self.robot, self.known = joint, robot, tuple(known)
        has = ", ".join(known) or "no joints"
        super().__init__(f"no joint {joint!r} in robot {robot!r}; it has {has}")


def hint(name: str, known: Iterable[str]) -> str:
    """The known name that is closest, as a question; empty if none is close."""
    close = get_close_matches(name, list(known), n=1, cutoff=0.7)
    return f" (did you mean {close[0]!r}?)" if close else ""
