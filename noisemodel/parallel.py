"""One call per item: here, in several processes, or on the workers of a Dask scheduler.

A process that dies is replaced, and its item named; the others get their results.

Processes are forked where that is safe: then they start at once, with all modules and models in
place, and several are faster from a few items on. It is not safe with other threads in this
process, of Python or of a library, nor on macOS, and does not exist on Windows. There joblib's loky
starts fresh interpreters, which takes about `FRESH` seconds.
"""

import gc
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

Jobs: TypeAlias = int | str
"""How many items to work on at once in this machine, or the address of a Dask scheduler."""

FRESH, FORKED = 3.0, 0.1
"""Work in [s] below which two fresh interpreters, or two forks, are not faster than this one
alone."""
POLL = 0.5
"""Time without a result after which `polled` yields None, in [s]."""
DIED = "the worker died, of lack of memory or a crash"
"""What there is to say of an item with which a worker died."""


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
    """Results of a function as they are ready, from several processes if requested.

    If a process dies, those of its items that may be the cause are tried again one by one, each
    alone; the item with which a process dies then gets the result of ``died``.

    Args:
        function: What to call; where processes cannot be forked it must be importable.
        items: Its arguments.
        jobs: Number of processes; 1 is this one, which nothing survives. Or the address of a Dask
            scheduler, ``tcp://HOST:PORT``.
        died: The result of an item with which a process died; it may raise.
        work: About how long all items take one after the other, in [s].

    Yields:
        The index of an item, and its result.

    Raises:
        ClusterError: If the Dask scheduler cannot be reached, or is lost.
    """
    for found in polled(function, items, jobs=jobs, died=died, work=work):
        if found is not None:
            yield found


def polled(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    *,
    jobs: Jobs,
    died: Callable[[Item], Result],
    work: float = float("inf"),
) -> Iterator[tuple[int, Result] | None]:
    """Results as `as_done` yields them, and None when there was none for `POLL` seconds."""
    if isinstance(jobs, str):
        from noisemodel.cluster import on_cluster

        yield from on_cluster(function, items, address=jobs, died=died, poll=POLL)
        return
    if min(jobs, len(items)) < 2 or work < (FORKED if _forks() else FRESH):
        yield from enumerate(map(function, items))
        return
    jobs = min(jobs, len(items))
    waiting = list(range(len(items)))[::-1]
    suspects: list[int] = []
    while waiting or suspects:
        alone = bool(suspects)
        todo, width = (suspects, 1) if alone else (waiting, 2 * jobs)
        pool = _pool(function, 1 if alone else jobs)
        running: dict[Future[Any], int] = {}
        broken = False
        try:
            while (todo or running) and not broken:
                try:
                    while todo and len(running) < width:
                        future = pool.submit(_call, items[todo[-1]])
                        running[future] = todo.pop()
                except BrokenProcessPool:
                    broken = True
                done, _ = wait(running, timeout=POLL, return_when=FIRST_COMPLETED)
                if not done:
                    yield None
                for future in done:
                    try:
                        result = future.result()
                    except BrokenProcessPool:
                        broken = True
                    else:
                        yield running.pop(future), result
        finally:
            for future in running:
                future.cancel()
            pool.shutdown(wait=True)
        if alone and broken:
            for index in running.values():
                yield index, died(items[index])
        else:
            suspects += sorted(running.values(), reverse=True)


def _forks() -> bool:
    """Whether a fork is safe: of a process with other threads one may hold a lock for ever."""
    return sys.platform == "linux" and len([*Path("/proc/self/task").iterdir()]) == 1


def _pool(function: Callable[..., Any], jobs: int) -> Executor:
    threads = max(1, (os.cpu_count() or 1) // jobs)
    if _forks():
        return ProcessPoolExecutor(
            jobs, multiprocessing.get_context("fork"), _begin, (function, threads, os.getpid())
        )
    from joblib.externals.loky import ProcessPoolExecutor as Fresh

    given = (function, threads, os.getpid())
    pool: Executor = Fresh(jobs, timeout=60, initializer=_begin, initargs=given)
    return pool


_function: Callable[[Any], Any]


def _begin(function: Callable[[Any], Any], threads: int, parent: int) -> None:
    """Prepare a worker: it has the function, and as many threads as there are cores for it.

    It ends with its parent, which may be killed at any moment.
    """
    from threadpoolctl import threadpool_limits

    global _function
    _function = function
    gc.freeze()  # a collection that visits what was forked would copy its pages
    threadpool_limits(threads)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent stops its workers
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    """End this process when its parent is another one."""
    while os.getppid() == parent:
        time.sleep(POLL)
    os._exit(1)


def _call(item: Any) -> Any:
    return _function(item)
