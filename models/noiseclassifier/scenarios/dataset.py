"""Simulation of the missing runs of a data set, several at once."""

import time
from collections.abc import Iterator, Sequence
from functools import partial
from importlib.util import find_spec

from noiseclassifier.scenarios.errors import (
    DatasetError,
    MissingSimulatorError,
    ScenarioError,
    SimulationError,
)
from noiseclassifier.scenarios.folder import Folder
from noiseclassifier.scenarios.tasks import Task, grouped_by_twin
from noisemodel import NoiseModelError
from noisemodel.parallel import DIED, Jobs, polled


def make(folder: Folder, tasks: Sequence[Task], *, jobs: Jobs = 1) -> Iterator[Task]:
    """Simulate the missing runs of a data set.

    Each run is written at once, so that a killed process loses only the runs in work.
    """
    groups = grouped_by_twin(folder.missing(tasks), folder.format.motion)
    if groups and find_spec("mujoco") is None:
        raise MissingSimulatorError
    if jobs == 1:
        for group in groups:
            yield from _make(folder, group)
    else:
        yield from _make_at_once(folder, groups, jobs)


def _make_at_once(folder: Folder, groups: Sequence[tuple[Task, ...]], jobs: Jobs) -> Iterator[Task]:
    """Simulate each group in one process, so that its twin is simulated once."""
    pending = {task for group in groups for task in group}
    dead: list[Task] = []
    while groups:
        rest = []
        for found in polled(partial(_make_all, folder), groups, jobs=jobs, died=_died):
            made = pending - set(folder.missing(pending))
            pending -= made
            yield from sorted(made)
            if found is not None and not found[1]:
                first, *others = folder.missing(groups[found[0]])
                dead.append(first)
                rest.append(tuple(others))
        groups = [group for group in rest if group]
    if dead:
        names = ", ".join(task.name for task in dead)
        raise DatasetError(f"{names}: {DIED}; the same command tries again")


def _make_all(folder: Folder, group: Sequence[Task]) -> bool:
    """Simulate a group, but for what was made of it by a worker that died."""
    for _ in _make(folder, folder.missing(group)):
        pass
    return True


def _died(_: Sequence[Task]) -> bool:
    return False


def _make(folder: Folder, group: Sequence[Task]) -> Iterator[Task]:
    for task in group:
        start = time.process_time()
        try:
            try:
                run = folder.format.simulate(task, folder.duration)
            except SimulationError as fall:
                folder.save_fall(task, fall)
            else:
                folder.save(task, run)
            folder.save_time(task, time.process_time() - start)
        except (ScenarioError, NoiseModelError) as error:
            # Only a text, since errors with attributes of their own do not pass between processes.
            raise DatasetError(f"{error}; the same command resumes there") from error
        yield task
