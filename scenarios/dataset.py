"""Simulation of the missing runs of a data set, several at once."""

import os
import time
from collections.abc import Iterator, Sequence
from importlib.util import find_spec

from noisemodel import NoiseModelError
from scenarios.errors import (
    DatasetError,
    MissingSimulatorError,
    ScenarioError,
    SimulationError,
)
from scenarios.folder import Folder
from scenarios.tasks import Task, grouped_by_twin

POLL = 0.5
"""Time between two checks for runs of other processes, in [s]."""


def make(folder: Folder, tasks: Sequence[Task], *, jobs: int = 1) -> Iterator[Task]:
    """Simulate the missing runs of a data set.

    Each run is written at once, so that a killed process loses only the runs in work.

    Args:
        folder: The folder of the data set.
        tasks: The runs of the data set.
        jobs: Number of parallel processes.

    Yields:
        The runs in the order of completion, including those that fell.

    Raises:
        MissingSimulatorError: If MuJoCo is not installed.
        DatasetError: If a run cannot be simulated or written.
    """
    groups = grouped_by_twin(folder.missing(tasks), folder.format.motion)
    if groups and find_spec("mujoco") is None:
        raise MissingSimulatorError
    if jobs == 1 or len(groups) < 2:
        for group in groups:
            yield from _make(folder, group)
    else:
        yield from _make_at_once(folder, groups, jobs)


def _make_at_once(folder: Folder, groups: Sequence[tuple[Task, ...]], jobs: int) -> Iterator[Task]:
    """Simulate each group in one process, so that its twin is simulated once."""
    from concurrent.futures import wait

    from joblib.externals.loky import get_reusable_executor

    executor = get_reusable_executor(max_workers=jobs)
    pending = {task for group in groups for task in group}
    try:
        running = {executor.submit(_make_all, folder, group, os.getpid()) for group in groups}
        while running:
            done, running = wait(running, timeout=POLL)
            for job in done:
                job.result()
            made = pending - set(folder.missing(pending))
            pending -= made
            yield from sorted(made)
    finally:
        executor.shutdown(kill_workers=True)


def _make_all(folder: Folder, group: tuple[Task, ...], caller: int) -> None:
    runs = _make(folder, group)
    # If the caller was killed, stop: another process may have resumed the data set.
    while os.getppid() == caller and next(runs, None):
        pass


def _make(folder: Folder, group: tuple[Task, ...]) -> Iterator[Task]:
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
