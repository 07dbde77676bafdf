"""What can go wrong in a simulation: one base error, subclasses that keep their facts."""

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path


class ScenarioError(ValueError):
    """The base of every error that `scenarios` expects."""


class UnknownScenarioError(ScenarioError):
    """A scenario that is not in the table.

    Args:
        name: The scenario that was asked for.
        known: The scenarios that there are.
    """

    def __init__(self, name: str, known: Iterable[str]) -> None:
        self.name, self.known = name, tuple(known)
        super().__init__(
            f"no scenario {name!r}{_hint(name, self.known)}; there are {', '.join(self.known)}"
        )


class UnsimulatedRobotError(ScenarioError):
    """A robot that nobody has set up for simulation.

    Args:
        name: The robot that was asked for.
        known: The robots that can be simulated.
    """

    def __init__(self, name: str, known: Iterable[str]) -> None:
        self.name, self.known = name, tuple(known)
        super().__init__(
            f"robot {name!r} cannot be simulated{_hint(name, self.known)};"
            f" there are {', '.join(self.known)}"
        )


class UnsuitedScenarioError(ScenarioError):
    """A scenario that has no meaning on a robot.

    Args:
        scenario: The scenario that was asked for.
        robot: The robot that was asked for.
        known: The scenarios that the robot has.
    """

    def __init__(self, scenario: str, robot: str, known: Iterable[str]) -> None:
        self.scenario, self.robot, self.known = scenario, robot, tuple(known)
        super().__init__(
            f"scenario {scenario!r} has no meaning on {robot!r}; it has {', '.join(self.known)}"
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
    """A simulation left the realm of robots.

    Args:
        time: When, in [s].
        problem: What was seen.
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
    """A run that diverged, or in which the robot fell: it is no sample.

    Args:
        robot: The robot that moved.
        scenario: What happened to it.
        seed: The seed of the run.
        time: When that was, in [s].
        problem: What was seen.
    """

    def __init__(self, robot: str, scenario: str, seed: int, time: float, problem: str) -> None:
        self.robot, self.scenario, self.seed = robot, scenario, seed
        self.time, self.problem = time, problem
        super().__init__(
            f"{robot} in scenario {scenario!r} with seed {seed} went out of control at {time:.3f} s"
            f" ({problem}); such a run is no sample, take another seed"
        )


class SampleError(ScenarioError):
    """A file that is no sample, or a damaged one.

    Args:
        path: The file that was read.
        problem: What is wrong with it, in one line.
    """

    def __init__(self, path: Path, problem: str) -> None:
        self.path, self.problem = path, problem
        super().__init__(f"{path}: {problem}")


class ChangedRunError(ScenarioError):
    """A run that does not come out as it once did.

    Args:
        name: The sample that was made of it.
        made: What it was made with, in a few words.
        here: What there is now.
    """

    def __init__(self, name: str, made: str, here: str) -> None:
        self.name, self.made, self.here = name, made, here
        super().__init__(
            f"{name} comes out another way than before: it was made with {made}, here is {here};"
            " the versions that made it make it again"
        )


class DatasetError(ScenarioError):
    """A data set that cannot be made as it was asked for."""


def _hint(name: str, known: Iterable[str]) -> str:
    """Say which known name was probably meant, or nothing."""
    close = get_close_matches(name, list(known), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""
