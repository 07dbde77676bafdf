"""The runs of a data set of wide domains, and which of them are learnt from."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args
from zlib import crc32

import numpy as np

from noiseclassifier.scenarios.domains.distribution import DISTRIBUTION, Distribution
from noiseclassifier.scenarios.domains.domain import Domain, Logger
from noiseclassifier.scenarios.domains.logs import logged
from noiseclassifier.scenarios.domains.simulation import FIRST, GOOD, faults_of
from noiseclassifier.scenarios.errors import DatasetError, UnsimulatedRobotError
from noiseclassifier.scenarios.folder import Folder
from noiseclassifier.scenarios.robots import TARGETS, WIDE
from noiseclassifier.scenarios.tasks import Task
from noisemodel import Run

FAULTS = 2
"""Faulty runs of each robot and seed."""

Side: TypeAlias = Literal["all", "source", "target", "logger"]
"""All logs; those that are learnt from; those of robots and domains that never are; and of robots
and domains that are, those of loggers that never are."""


def tasks(
    robots: Sequence[str] = (),
    *,
    first: int = FIRST,
    seeds: int = 8,
    faults: int = FAULTS,
    always: Sequence[str] = (),
) -> list[Task]:
    """The runs of a data set, seed by seed."""
    for robot in robots:
        if robot not in WIDE:
            raise UnsimulatedRobotError(robot, WIDE)
    if first < FIRST:
        raise DatasetError(f"the first seed is {first}, expected {FIRST} or more")
    if seeds < 1 or faults < 0:
        raise DatasetError(
            f"{seeds} seeds with {faults} faults each, expected 1 or more, 0 or more"
        )
    for name in always:
        if not any(name in faults_of(robot) for robot in robots or WIDE):
            raise DatasetError(f"no fault {name!r} of {', '.join(robots or ('any robot',))}")
    return [
        Task(robot, name, seed)
        for seed in range(first, first + seeds)
        for robot in robots or WIDE
        for name in (GOOD, *_faults(robot, seed, faults, always))
    ]


def _faults(robot: str, seed: int, count: int, always: Sequence[str]) -> list[str]:
    suited = faults_of(robot, seed)
    names = [name for name in suited if name not in always]
    rng = np.random.default_rng((seed, crc32(robot.encode()), 2))
    chosen = rng.choice(len(names), min(count, len(names)), replace=False)
    drawn = [names[index] for index in sorted(chosen.tolist())]
    return drawn + [name for name in always if name in suited]


def logs(
    folder: Folder,
    *,
    copies: int = 1,
    rate: float | None = None,
    side: Side = "all",
    distribution: Distribution = DISTRIBUTION,
) -> Iterator[tuple[str, Run]]:
    """Logs of the runs of a data set, each with its name: ``<robot>/<fault>[.copy]-<seed>``.

    Args:
        rate: Of all logs, in [Hz]; drawn by default. Runs kept at a lower rate have no log then.
    """
    if side not in get_args(Side):
        raise DatasetError(f"no side {side!r}; there are {', '.join(get_args(Side))}")
    twin: tuple[Task | None, Run | None] = (None, None)
    kept = set(folder.kept())
    if not kept:
        raise DatasetError(f"{folder.path}: holds no run; `inspector simulate domains` makes them")
    for task in sorted(kept, key=lambda task: (task.robot, task.seed, task.scenario)):
        good = Task(task.robot, GOOD, task.seed)
        if good not in kept:  # its twin fell
            continue
        if twin[0] != good:
            twin = good, Run.load(folder.file(good))
        reference = twin[1]
        assert reference is not None
        run = reference if task == good else Run.load(folder.file(task))
        domain = _domain(run)
        if run.rate < (rate or 0.0) * (1 - 1e-6):
            continue
        for copy in range(copies):
            draw = np.random.default_rng((task.seed, crc32(task.name.encode()), copy))
            logger = distribution.logger(draw, domain, most=run.rate, rate=rate)
            if side not in ("all", side_of(task.robot, domain, logger)):
                continue
            noise = int(np.random.default_rng((task.seed, copy, 3)).integers(2**32))
            name = f"{task.scenario}.{copy}" if copy else task.scenario
            found = logged(run, reference, logger, seed=noise)
            if found.blocks or found.meta["events"]:  # else nothing of it can be measured
                yield f"{task.robot}/{name}-{task.seed:03d}", found


def side_of(robot: str, domain: Domain, logger: Logger) -> Side:
    """What a log is for: to learn from, or to measure on only, by what of it is a target."""
    if robot in TARGETS or domain.target:
        return "target"
    return "logger" if logger.target else "source"


def write(logs: Iterator[tuple[str, Run]], output: Path) -> Iterator[tuple[str, Run]]:
    """Write logs as run files in a folder."""
    for name, run in logs:
        path = output / f"{name}.npz"
        path.parent.mkdir(parents=True, exist_ok=True)
        run.save(path, overwrite=True)
        yield name, run


def _domain(run: Run) -> Domain:
    facts: dict[str, Any] = dict(run.meta["domain"])
    del facts["name"]
    return Domain(**facts)
