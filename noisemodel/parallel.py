"""One call per item: here, in several processes by joblib, or on the workers of a Dask scheduler.

An item with which a process dies is named, and the others get their results: joblib loses all that
is not done with a process that dies, and Dask blames all that its worker had, so what was in work
then is tried again, item by item.
"""

import logging
import os
import re
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from noisemodel.types import NoiseModelError

Item = TypeVar("Item")
Result = TypeVar("Result")

# How many items to work on at once in this machine, or the address of a Dask scheduler.
Jobs: TypeAlias = int | str
FRESH = 3.0  # work in [s] below which two fresh interpreters are not faster than this one alone
POLL = 0.5  # time after which a worker looks whether its parent is still there, in [s]
REACHED, STAFFED = 10.0, 60.0  # in [s]: until a Dask scheduler answers, and until it has a worker
SOFTWARE = ("noise-inspector", "numpy")  # of the client's versions, so that results are the same
DIED = "the worker died, of lack of memory or a crash"  # what to say of an item that ended a worker
# What a process calls with each item. It comes once: a model that comes anew with each item has to
# be prepared anew, too.
_work: list[Callable[[Any], Any]] = []


def in_order(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    *,
    jobs: Jobs,
    died: Callable[[Item], Result],
    work: float = float("inf"),
) -> Iterator[Result]:
    """Results of a function, in the order of its arguments, see `as_done`."""
    early: dict[int, Result] = {}
    following = 0
    for index, result in as_done(function, items, jobs=jobs, died=died, work=work):
        early[index] = result
        while following in early:
            yield early.pop(following)
            following += 1


def as_done(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    *,
    jobs: Jobs,
    died: Callable[[Item], Result],
    work: float = float("inf"),
) -> Iterator[tuple[int, Result]]:
    """Results of a function as they are ready.

    ``jobs`` is the number of processes, of which 1 is this one, or the address of a Dask scheduler,
    ``tcp://HOST:PORT``. ``died`` makes the result of an item with which a process died, or raises.
    ``work`` is about how long all items take one after the other, in [s].
    """
    if isinstance(jobs, str):
        if items:
            with _cluster(jobs) as client:
                variables = {k: v for k, v in os.environ.items() if k.startswith("NOISE_")}
                there = partial(_there, function, str(Path.cwd()), variables)
                yield from _on_cluster(client, there, items, died)
        return
    jobs = min(jobs, len(items))
    if jobs < 2 or work < FRESH:
        yield from enumerate(map(function, items))
    else:
        yield from _in_processes(function, items, died, jobs)


def _on_cluster(
    client: Any,
    function: Callable[[Item], Result],
    items: Sequence[Item],
    died: Callable[[Item], Result],
) -> Iterator[tuple[int, Result]]:
    from distributed import KilledWorker, as_completed

    futures = client.map(function, items, pure=False)
    index = {future.key: place for place, future in enumerate(futures)}
    suspects = []
    for future in as_completed(futures, loop=client.loop):
        place = index[future.key]
        try:
            yield place, future.result()
        except KilledWorker:
            suspects.append(place)
        future.release()
    for place in suspects:  # a worker has more than one item at a time
        try:
            result = client.submit(function, items[place], pure=False).result()
        except KilledWorker:
            result = died(items[place])
        yield place, result


def _in_processes(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    died: Callable[[Item], Result],
    jobs: int,
) -> Iterator[tuple[int, Result]]:
    from joblib import Parallel, delayed, parallel_config
    from joblib.externals.loky.process_executor import BrokenProcessPool

    call = delayed(_called)
    waiting = list(range(len(items)))
    suspects: list[int] = []
    while waiting or suspects:
        alone = bool(suspects)
        todo = [suspects.pop(0)] if alone else waiting
        running: list[int] = []

        def calls(todo: list[int] = todo, running: list[int] = running) -> Iterator[Any]:
            for index in todo:
                running.append(index)
                yield call(items[index], index)

        begin = {"initializer": _begin, "initargs": (os.getpid(), function)}
        with parallel_config(backend="loky", n_jobs=jobs, **begin):
            parallel = Parallel(batch_size=1, return_as="generator_unordered")
        broken = False
        done = set()
        results = parallel(calls())
        try:
            for index, result in results:
                done.add(index)
                yield index, result
        except BrokenProcessPool:
            broken = True
        finally:
            with warnings.catch_warnings(action="ignore"):  # of what is cancelled
                results.close()
        left = [index for index in running if index not in done]
        if alone and broken:
            yield todo[0], died(items[todo[0]])
        elif not alone:
            suspects = left
            waiting = todo[len(running) :]


def _called(item: Any, index: int) -> tuple[int, Any]:
    return index, _work[-1](item)


def _begin(parent: int, function: Callable[[Any], Any]) -> None:
    """Prepare a process, which ends with its parent, and leaves interrupts to it."""
    _work.append(function)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(POLL)
    os._exit(1)


@contextmanager
def _cluster(address: str) -> Iterator[Any]:
    """A client of a scheduler that has a worker; Dask's own messages are left out."""
    if find_spec("distributed") is None:
        raise NoiseModelError(
            "a Dask cluster needs distributed, which is not installed;"
            " run `pip install 'noise-inspector[cluster]'`"
        )
    if not re.fullmatch(r"\w+://.+:\d+", address):
        raise NoiseModelError(f"{address!r} is no address of a Dask scheduler, tcp://HOST:PORT")
    from distributed import CancelledError, Client

    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        client = Client(address, timeout=REACHED, set_as_default=False)
    except (OSError, ValueError) as error:
        raise NoiseModelError(
            f"{address}: no Dask scheduler answers there; start one with `dask scheduler`,"
            " and name the address that it prints"
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=STAFFED)
        except TimeoutError as error:
            raise NoiseModelError(
                f"{address}: the Dask scheduler has no worker after {STAFFED:.0f} s; start some"
                f" with `dask worker {address} --nthreads 1`"
            ) from error
        _check_software(client, address)
        try:
            yield client
        except (OSError, CancelledError) as error:
            if isinstance(error, OSError) and client.status == "running":
                raise
            lost = f"{address}: the connection to the Dask scheduler is lost"
            raise NoiseModelError(lost) from error


def _check_software(client: Any, address: str) -> None:
    """Refuse workers that have not the same software, or none."""
    here = _software()
    for worker, there in client.run(_software, on_error="return").items():
        if there != here:
            raise NoiseModelError(
                f"{address}: worker {worker} has {there}, here is {here}; install the same on all"
            )


def _software() -> dict[str, str]:
    from importlib.metadata import PackageNotFoundError, version

    found = {}
    for name in SOFTWARE:
        with suppress(PackageNotFoundError):  # run from its folder
            found[name] = version(name)
    return found


def _there(
    function: Callable[[Item], Result], folder: str, variables: Mapping[str, str], item: Item
) -> Result:
    """Call a function on a Dask worker as the client would: in its folder, with its settings."""
    os.environ.update(variables)
    if not Path(folder).is_dir():
        raise NoiseModelError(
            f"a worker has no folder {folder}; it must see the same files, by the same paths"
        )
    os.chdir(folder)
    return function(item)
