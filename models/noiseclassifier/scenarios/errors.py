"""Errors of a simulation."""

from collections.abc import Iterable
from difflib import get_close_matches


class ScenarioError(ValueError):
    """The base of every error that `scenarios` expects."""


class DatasetError(ScenarioError):
    """A data set that cannot be made, or a file of one that cannot be read."""


class DivergedError(ScenarioError):
    """A simulation that diverged, or in which the robot fell, at a time in [s]."""

    def __init__(self, time: float, problem: str) -> None:
        self.time, self.problem = time, problem
        super().__init__(f"{problem} at {time:.3f} s")


class SimulationError(ScenarioError):
    """A run that diverged, or in which the robot fell, at a time in [s]."""

    def __init__(self, robot: str, scenario: str, seed: int, time: float, problem: str) -> None:
        self.robot, self.scenario, self.seed = robot, scenario, seed
        self.time, self.problem = time, problem
        super().__init__(
            f"{robot} in scenario {scenario!r} with seed {seed} went out of control at {time:.3f} s"
            f" ({problem}); such a run is not used, take another seed"
        )


def unknown(what: str, name: str, known: Iterable[str]) -> ScenarioError:
    """The error for a name that is not known, with the closest one as a hint."""
    known = list(known)
    close = get_close_matches(name, known, n=1)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    return ScenarioError(f"{what}{hint}; there are {', '.join(known)}")
