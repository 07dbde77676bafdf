"""Errors of a simulation: one base error, subclasses with their facts as attributes."""

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path


class ScenarioError(ValueError):
    """The base of every error that `scenarios` expects."""


class UnknownScenarioError(ScenarioError):
    """A scenario that is not in the table."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        self.name, self.known = name, tuple(known)
        super().__init__(
            f"no scenario {name!r}{_hint(name, self.known)}; there are {', '.join(self.known)}"
        )


class UnknownGaitError(ScenarioError):
    """A motion names a gait that quadrupeds do not have."""

    def __init__(self, gait: str, known: Iterable[str]) -> None:
        self.gait, self.known = gait, tuple(known)
        super().__init__(f"no gait {gait!r}; there are {', '.join(self.known)}")


class UnsimulatedRobotError(ScenarioError):
    """A robot that cannot be simulated."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        self.name, self.known = name, tuple(known)
        super().__init__(
            f"robot {name!r} cannot be simulated{_hint(name, self.known)};"
            f" there are {', '.join(self.known)}"
        )


class UnsuitedScenarioError(ScenarioError):
    """A scenario that does not exist for a robot."""

    def __init__(self, scenario: str, robot: str, known: Iterable[str]) -> None:
        self.scenario, self.robot, self.known = scenario, robot, tuple(known)
        super().__init__(
            f"scenario {scenario!r} does not exist for {robot!r}; it has {', '.join(self.known)}"
        )


class MissingSimulatorError(ScenarioError):
    """MuJoCo, which only simulation needs, is not installed."""

    def __init__(self) -> None:
        super().__init__(
            "simulation needs MuJoCo, which is not installed;"
            " run `pip install 'noise-inspector[sim]'`"
        )


class UnsupportedModelError(ScenarioError):
    """A robot whose joints cannot be simulated."""


class DivergedError(ScenarioError):
    """A simulation that diverged.

    Args:
        time: When, in [s].
    """

    def __init__(self, time: float, problem: str) -> None:
        self.time, self.problem = time, problem
        super().__init__(f"{problem} at {time:.3f} s")


class FallenError(DivergedError):
    """A robot fell.

    Args:
        time: When, in [s].
    """

    def __init__(self, time: float) -> None:
        super().__init__(time, "it fell")


class SimulationError(ScenarioError):
    """A run that diverged, or in which the robot fell.

    Args:
        time: Time of the failure, in [s].
    """

    def __init__(self, robot: str, scenario: str, seed: int, time: float, problem: str) -> None:
        self.robot, self.scenario, self.seed = robot, scenario, seed
        self.time, self.problem = time, problem
        super().__init__(
            f"{robot} in scenario {scenario!r} with seed {seed} went out of control at {time:.3f} s"
            f" ({problem}); such a run is not used, take another seed"
        )


class SampleError(ScenarioError):
    """A file that is not a sample, or is damaged."""

    def __init__(self, path: Path, problem: str) -> None:
        self.path, self.problem = path, problem
        super().__init__(f"{path}: {problem}")


class ChangedRunError(ScenarioError):
    """A run that cannot be reproduced with the present software."""

    def __init__(self, name: str, made: str, here: str) -> None:
        self.name, self.made, self.here = name, made, here
        super().__init__(
            f"{name} cannot be reproduced: it was made with {made}, here is {here};"
            " install the versions that it was made with"
        )


class DatasetError(ScenarioError):
    """A data set that cannot be made with these settings."""


def _hint(name: str, known: Iterable[str]) -> str:
    """The closest known name as a hint, or nothing."""
    close = get_close_matches(name, list(known), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""
