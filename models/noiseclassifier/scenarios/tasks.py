"""The runs of a data set, and their order."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import TypeAlias

from noiseclassifier.scenarios.errors import DatasetError, UnsuitedScenarioError
from noiseclassifier.scenarios.motions import Motion
from noiseclassifier.scenarios.robots import ROBOTS
from noiseclassifier.scenarios.simulation import look_up
from noiseclassifier.scenarios.table import SCENARIOS

Choice: TypeAlias = Mapping[str, tuple[str, ...]]
"""Names of the scenarios of each robot."""

LEAST_RUNS = 20
"""Number of runs from which too many falls are an error."""


@dataclass(frozen=True, order=True)
class Task:
    """A run of a data set."""

    robot: str
    scenario: str
    seed: int

    @property
    def name(self) -> str:
        """Robot, scenario and seed: the name of its sample."""
        return f"{self.robot}/{self.scenario}-{self.seed:03d}"


def choose(
    robots: Sequence[str], scenarios: Sequence[str] = (), *, healthy: bool = False
) -> dict[str, tuple[str, ...]]:
    """Scenarios of each robot."""
    if not robots:
        raise DatasetError(f"no robot is named; there are {', '.join(ROBOTS)}")
    chosen = {robot: _suited(robot, scenarios or tuple(SCENARIOS)) for robot in robots}
    for robot, names in chosen.items():
        chosen[robot] = tuple(name for name in names if SCENARIOS[name].healthy or not healthy)
        if not chosen[robot]:
            of_list = f"of {', '.join(scenarios)} " if scenarios else ""
            ok = " without a failure" if healthy else ""
            everything = ", ".join(_suited(robot, tuple(SCENARIOS)))
            raise DatasetError(
                f"no scenario {of_list}is left for {robot!r}{ok}; it has {everything}"
            )
    return chosen


@dataclass(frozen=True, kw_only=True)
class DatasetSpec:
    """The size of a data set: a number of seeds, or of hours.

    Attributes:
        hours: Total duration of all runs, in [h].
    """

    choice: Choice
    first: int = 0
    seeds: int | None = None
    hours: float | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.seeds is not None and self.hours is not None:
            raise DatasetError(
                f"{self.seeds} seeds and {self.hours:g} hours; expected one of the two"
            )
        if self.first < 0:
            raise DatasetError(f"the first seed is {self.first}, expected 0 or more")
        if self.seeds is not None and self.seeds < 1:
            raise DatasetError(f"{self.seeds} seeds, expected 1 or more")
        if self.hours is not None and not 0 < self.hours < float("inf"):
            raise DatasetError(f"{self.hours:g} hours, expected more than 0")

    def tasks(self, *, duration: float | None = None, fallen: Collection[Task] = ()) -> list[Task]:
        """The runs, seed by seed.

        Args:
            duration: Duration of each run, in [s]; by default that of its motion.
        """
        if self.hours is None:
            last = self.first + (8 if self.seeds is None else self.seeds)
            seeds = range(self.first, last)
            return [
                task for seed in seeds for robot in self.choice for task in self._seed(robot, seed)
            ]
        share = 3600 * self.hours / len(self.choice)
        filling = [self._fill(robot, share, duration, set(fallen)) for robot in self.choice]
        return sorted((task for tasks in filling for task in tasks), key=lambda task: task.seed)

    def _seed(self, robot: str, seed: int) -> list[Task]:
        return [Task(robot, scenario, seed) for scenario in self.choice[robot]]

    def _fill(
        self, robot: str, seconds: float, duration: float | None, fallen: set[Task]
    ) -> list[Task]:
        """The runs of as many seeds as a duration takes."""
        tasks: list[Task] = []
        filled, lost = 0.0, 0
        for seed in count(self.first):
            if filled >= seconds:
                break
            if lost > len(tasks) / 2 and len(tasks) >= LEAST_RUNS:
                raise DatasetError(
                    f"{robot} fell in {lost} of {len(tasks)} runs, so that {seconds:.0f} s cannot"
                    " be reached; take other scenarios"
                )
            for task in self._seed(robot, seed):
                tasks.append(task)
                if task in fallen:
                    lost += 1
                else:
                    filled += duration or motion_of(task).duration
        return tasks


def grouped_by_twin(
    tasks: Iterable[Task], motion: Callable[[Task], object]
) -> list[tuple[Task, ...]]:
    """Runs in groups that share their twin: one robot, one seed, one motion."""
    groups: dict[object, list[Task]] = {}
    for task in tasks:
        groups.setdefault((task.robot, task.seed, motion(task)), []).append(task)
    return [tuple(group) for group in groups.values()]


def motion_of(task: Task) -> Motion:
    """Motion of a run of the scenarios."""
    return SCENARIOS[task.scenario].cases[ROBOTS[task.robot].family].motion


def _suited(robot: str, scenarios: Sequence[str]) -> tuple[str, ...]:
    """Names of those scenarios that a robot has, in the order of the table."""
    names = set()
    for scenario in scenarios:
        try:
            names.add(look_up(robot, scenario)[0].name)
        except UnsuitedScenarioError:
            continue
    return tuple(name for name in SCENARIOS if name in names)
