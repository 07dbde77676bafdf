"""One call per item on the workers of a Dask scheduler.

Each item is a task of its own. (joblib's backend for Dask fails as a whole if one item kills its
workers, and does not say which.) Dask gives a task that loses its worker to another one, and gives
up after several; such an item is tried once more, while no other runs, before it is named.

A worker does one item at a time, whatever its number of threads: in the folder of the client and
with the client's settings, so that the results are those of the client's own machine.
"""

import logging
import os
import re
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import chdir, contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Any, TypeVar

from noisemodel.errors import ClusterError

Item = TypeVar("Item")
Result = TypeVar("Result")

REACHED = 10.0
"""Time in which a scheduler has to answer, in [s]."""
STAFFED = 60.0
"""Time that a scheduler may be without any worker, in [s]."""
SOFTWARE = ("noise-inspector", "numpy")
"""Packages whose versions have to be the client's, so that results are the same."""


@dataclass(frozen=True)
class _Client:
    """What a worker takes over from the client.

    Attributes:
        folder: Its working directory.
        variables: Its environment variables that are settings of ours.
        software: Its versions of `SOFTWARE`.
    """

    folder: str
    variables: Mapping[str, str]
    software: Mapping[str, str]


@dataclass(frozen=True)
class _Died:
    """A task has lost as many workers as Dask allows.

    Attributes:
        task: Its key: that of an item, or of the function that items wait for.
    """

    task: str


def on_cluster(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    *,
    address: str,
    died: Callable[[Item], Result],
    poll: float,
) -> Iterator[tuple[int, Result] | None]:
    """Results of a function as they are ready, see `noisemodel.parallel.polled`.

    Args:
        function: What to call; importable on the workers.
        items: Its arguments.
        address: Address of the scheduler, ``tcp://HOST:PORT``.
        died: The result of an item that kills its workers; it may raise.
        poll: Time without a result after which None is yielded, in [s].

    Raises:
        ClusterError: If the extra ``cluster`` is not installed, the scheduler cannot be reached, is
            lost or stays without workers, or a worker has other software or lacks the client's
            folder.
    """
    if not items:
        return
    with _connected(address) as client:
        _check_software(client, address)
        here = _Client(str(Path.cwd()), _variables(), _software())

        def sent() -> Any:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", "Sending large graph")  # once, and it has to
                return client.submit(_itself, function, pure=False)

        def gathered(indices: Iterable[int], shared: Any) -> Iterator[tuple[int, Any] | None]:
            ready: SimpleQueue[Any] = SimpleQueue()
            running = {}
            for index in indices:
                future = client.submit(_called, shared, items[index], here, pure=False)
                running[future.key] = index
                future.add_done_callback(ready.put)
            staffed = monotonic()
            while running:
                try:
                    future = ready.get(timeout=poll)
                except Empty:
                    staffed = _check_alive(client, address, staffed)
                    yield None
                else:
                    yield running.pop(future.key), _outcome(future, client, address)

        suspects: list[int] = []
        waiting = list(range(len(items)))
        while waiting:
            shared, unsent = sent(), []
            for found in gathered(waiting, shared):
                if found is None or not isinstance(found[1], _Died):
                    yield found
                elif found[1].task == shared.key:  # the function was lost, before the item began
                    unsent.append(found[0])
                else:
                    suspects.append(found[0])
            if len(unsent) == len(waiting):
                suspects += unsent
                unsent = []
            waiting = unsent
        for suspect in suspects:
            for found in gathered([suspect], sent()):
                if found is not None and isinstance(found[1], _Died):
                    yield suspect, died(items[suspect])
                else:
                    yield found


@contextmanager
def _connected(address: str) -> Iterator[Any]:
    """A client of a scheduler that has a worker; Dask's own messages are left out."""
    if find_spec("distributed") is None:
        raise ClusterError(
            "a Dask cluster needs distributed, which is not installed;"
            " run `pip install 'noise-inspector[cluster]'`"
        )
    if not re.fullmatch(r"\w+://.+:\d+", address):
        raise ClusterError(f"{address!r} is no address of a Dask scheduler, tcp://HOST:PORT")
    from distributed import Client

    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        try:
            client = Client(address, timeout=REACHED, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ClusterError(
                f"{address}: no Dask scheduler answers there; start one with `dask scheduler`,"
                " and name the address that it prints"
            ) from error
        with client:
            try:
                client.wait_for_workers(1, timeout=STAFFED)
            except TimeoutError as error:
                raise ClusterError(
                    f"{address}: the Dask scheduler has no worker after {STAFFED:.0f} s; start some"
                    f" with `dask worker {address} --nthreads 1`"
                ) from error
            yield client
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def _check_software(client: Any, address: str) -> None:
    """Refuse workers that have not the same software, or none."""
    for name, here in _software().items():
        for worker, found in client.run(version, name, on_error="return").items():
            there = "none" if isinstance(found, Exception) else found
            if there != here:
                raise ClusterError(
                    f"{address}: worker {worker} has {name} {there}, here is {here};"
                    " install the same on all"
                )


def _check_alive(client: Any, address: str, staffed: float) -> float:
    """When the scheduler last had a worker; refuse one that is gone, or had none for long."""
    if client.status != "running":
        raise _lost(address)
    if client.nthreads():
        return monotonic()
    if monotonic() - staffed > STAFFED:
        raise ClusterError(f"{address}: the Dask scheduler has lost all its workers")
    return staffed


def _outcome(future: Any, client: Any, address: str) -> Any:
    """The result of a task that is done."""
    from distributed import CancelledError, KilledWorker

    try:
        return future.result()
    except KilledWorker as error:
        return _Died(str(error.task))
    except CancelledError as error:
        raise _lost(address) from error
    except Exception:
        if client.status == "running":
            _check_software(client, address)  # what else happens there is no wonder
        raise


def _lost(address: str) -> ClusterError:
    return ClusterError(f"{address}: the connection to the Dask scheduler is lost")


@cache
def _software() -> dict[str, str]:
    found = {}
    for name in SOFTWARE:
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # run from its folder
            found[name] = "none"
    return found


def _variables() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name.startswith("NOISE_")}


def _itself(function: Any) -> Any:
    """Keep a function on the cluster; it is made anew there with a worker that has it."""
    return function


_one_at_a_time = threading.Lock()


def _called(function: Callable[[Any], Any], item: Any, client: _Client) -> Any:
    """Call a function on a worker as the client would."""
    from threadpoolctl import threadpool_limits

    if _software() != client.software:
        raise ClusterError("this worker came later, and has other software")
    with _one_at_a_time, _as(client), threadpool_limits(1):
        return function(item)


@contextmanager
def _as(client: _Client) -> Iterator[None]:
    before = dict(os.environ)
    os.environ.update(client.variables)
    try:
        if not Path(client.folder).is_dir():
            raise ClusterError(
                f"a worker has no folder {client.folder}; it must see the same files, by the same"
                " paths"
            )
        with chdir(client.folder):
            yield
    finally:
        os.environ.clear()
        os.environ.update(before)
