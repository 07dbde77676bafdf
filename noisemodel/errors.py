"""What can be wrong with a run or a robot: one base error, subclasses that keep their facts."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from pathlib import Path


class NoiseModelError(ValueError):
    """The base of every error that `noisemodel` expects."""


class RunError(NoiseModelError):
    """A run whose arrays do not fit together."""


class RunFileError(RunError):
    """A file that is not a run, or that holds one that is wrong.

    Args:
        path: The file that was read.
        problem: What is wrong with it, in one line.
    """

    def __init__(self, path: Path, problem: str) -> None:
        self.path, self.problem = path, problem
        super().__init__(f"{path}: {problem}")


class OutputError(NoiseModelError):
    """An output that exists already or cannot be written."""


class RobotError(NoiseModelError):
    """A robot that cannot be found or read, or that moves in a way that is not supported."""


class UnknownRobotError(RobotError):
    """A name that is no listed robot, and no URDF file either.

    Args:
        name: The name that was asked for.
        known: The names that are listed.
    """

    def __init__(self, name: str, known: Iterable[str]) -> None:
        self.name, self.known = name, tuple(known)
        super().__init__(
            f"no robot {name!r}: neither a URDF file nor a listed name{hint(name, self.known)};"
            " `inspector robots` lists the names"
        )


class UnknownJointError(RobotError):
    """A run names a joint that the robot does not have.

    Args:
        joint: The joint that was asked for.
        robot: The name of the robot.
        known: The joints that the robot has.
    """

    def __init__(self, joint: str, robot: str, known: Sequence[str]) -> None:
        self.joint, self.robot, self.known = joint, robot, tuple(known)
        super().__init__(f"no joint {joint!r} in robot {robot!r}; it has {', '.join(known)}")


def hint(name: str, known: Iterable[str]) -> str:
    """Say which known name was probably meant, or nothing."""
    close = get_close_matches(name, list(known), n=1, cutoff=0.7)
    return f" (did you mean {close[0]!r}?)" if close else ""
