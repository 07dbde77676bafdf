"""A data set is made: what is missing of it, several runs at once."""

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
from scenarios.simulation import simulate
from scenarios.tasks import Task, together

POLL = 0.5
"""Time between two looks at what other processes have made, in [s]."""


def make(folder: Folder, tasks: Sequence[Task], *, jobs: int = 1) -> Iterator[Task]:
    """Make those runs of a data set that are missing; the rest is left alone.

    Each run is written as soon as it is made, so that stopping costs no more than the runs that
    are being made.

    Args:
        folder: Where to keep them.
        tasks: The runs that it is to have.
        jobs: How many to make at once.

    Yields:
        The runs as they are made, those that fell included.

    Raises:
        MissingSimulatorError: If MuJoCo is not installed.
        DatasetError: If a run cannot be made or written.
    """
    groups = together(folder.missing(tasks))
    if groups and find_spec("mujoco") is None:
        raise MissingSimulatorError
    if jobs == 1 or len(groups) < 2:
        for group in groups:
            yield from _make(folder, group)
    else:
        yield from _make_at_once(folder, groups, jobs)


def _make_at_once(folder: Folder, groups: Sequence[tuple[Task, ...]], jobs: int) -> Iterator[Task]:
    """Give each group to one process, which then simulates its twin once."""
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
    # If the caller was killed, nobody waits for the rest, and somebody may begin anew.
    while os.getppid() == caller and next(runs, None):
        pass


def _make(folder: Folder, group: tuple[Task, ...]) -> Iterator[Task]:
    for task in group:
        start = time.process_time()
        try:
            try:
                run = simulate(task.robot, task.scenario, task.seed, duration=folder.duration)
            except SimulationError as fall:
                folder.keep_fall(task, fall)
            else:
                folder.keep(task, run)
            folder.keep_time(task, time.process_time() - start)
        except (ScenarioError, NoiseModelError) as error:
            # One text, since errors with facts of their own do not pass between processes.
            raise DatasetError(f"{error}; started again, it goes on from there") from error
        yield task
