"""Processes that work on many runs, some of which die."""

import os
import signal
import sys
import threading
import time
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pytest
import threadpoolctl
from joblib.externals import loky

from noisemodel import parallel
from noisemodel.parallel import as_done, in_order, polled


@pytest.fixture(params=[True, False], ids=["forked", "fresh"])
def start(request, monkeypatch):
    """Both ways to start a process."""
    monkeypatch.setattr(parallel, "_forks", lambda: request.param)


def square_or_die(number):
    if number in (3, 11):
        os._exit(1)
    return number, number**2, os.getpid()


def dead(number):
    return number, "died", 0


def test_a_process_that_dies_costs_only_its_own_item(start):
    found = list(in_order(square_or_die, range(12), jobs=2, died=dead))
    assert [number for number, *_ in found] == list(range(12))
    assert [number for number, result, _ in found if result == "died"] == [3, 11]
    assert all(result == number**2 for number, result, _ in found if result != "died")
    assert os.getpid() not in {process for *_, process in found}


def slow_first(number):
    time.sleep(1.0 if number == 0 else 0.0)
    return number


def test_results_come_as_they_are_ready_and_in_order_if_requested(start):
    assert next(as_done(slow_first, range(4), jobs=2, died=dead))[0] != 0
    assert list(in_order(slow_first, range(4), jobs=2, died=dead)) == [0, 1, 2, 3]


@pytest.mark.parametrize(("forks", "work"), [(False, 0.5), (True, 0.05)])
def test_little_work_starts_no_processes(monkeypatch, forks, work):
    monkeypatch.setattr(parallel, "_forks", lambda: forks)
    found = list(in_order(square_or_die, [1, 2], jobs=2, died=dead, work=work))
    assert {process for *_, process in found} == {os.getpid()}


def test_errors_of_the_function_are_raised(start):
    with pytest.raises(ZeroDivisionError, match="division by zero"):
        list(in_order(invert, [1, 0, 2], jobs=2, died=dead))


def invert(number):
    return 1 / number


class Pools:
    """Pools whose processes are simulated: what is submitted is done at once."""

    def __init__(self, monkeypatch, *, breaks=(), refuses=(), waits=()):
        self.breaks, self.refuses, self.waits = breaks, [*refuses], [*waits]
        self.jobs, self.submitted, self.futures, self.ended = [], [], [], []
        monkeypatch.setattr(parallel, "_pool", self.pool)

    def pool(self, function, jobs):
        self.jobs.append(jobs)
        self.submitted.append([])
        self.function = function
        return self

    def submit(self, call, item):
        assert call is parallel._call
        if item in self.refuses:
            self.refuses.remove(item)
            raise BrokenProcessPool
        self.submitted[-1].append(item)
        future = Future()
        self.futures.append(future)
        if item in self.breaks:
            future.set_exception(BrokenProcessPool())
        elif item not in self.waits:
            future.set_result(self.function(item))
        return future

    def shutdown(self, *, wait):
        self.ended.append(wait)


def double(number):
    return 2 * number


def test_a_pool_has_at_most_two_items_for_each_process_and_is_ended(monkeypatch):
    pools = Pools(monkeypatch, waits=range(20))
    monkeypatch.setattr(parallel, "POLL", 0.001)
    found = polled(double, range(20), jobs=3, died=dead)
    assert next(found) is None
    assert (pools.jobs, pools.submitted) == ([3], [[0, 1, 2, 3, 4, 5]])
    pools.futures[2].set_result("third")
    assert next(found) == (2, "third")
    assert next(found) is None
    assert pools.submitted == [[0, 1, 2, 3, 4, 5, 6]]
    found.close()
    assert [future.cancelled() for future in pools.futures] == [n != 2 for n in range(7)]
    assert pools.ended == [True]


def test_there_are_no_more_processes_than_items(monkeypatch):
    pools = Pools(monkeypatch)
    assert dict(as_done(double, [5, 6, 7], jobs=8, died=dead)) == {0: 10, 1: 12, 2: 14}
    assert pools.jobs == [3]


@pytest.mark.parametrize(
    ("forks", "jobs", "items", "more", "started"),
    [
        (True, 2, 2, 0.0, 2),
        (False, 2, 2, 0.0, 2),
        (True, 2, 2, -1e-6, 0),
        (False, 2, 2, -1e-6, 0),
        (True, 1, 2, 9.0, 0),
        (True, 2, 1, 9.0, 0),
        (True, 2, 0, 9.0, 0),
        (False, 4, 3, 9.0, 3),
    ],
)
def test_processes_are_started_for_two_items_and_work_that_takes_longer_than_to_start_them(
    monkeypatch, forks, jobs, items, more, started
):
    pools = Pools(monkeypatch)
    monkeypatch.setattr(parallel, "_forks", lambda: forks)
    work = (parallel.FORKED if forks else parallel.FRESH) + more
    found = list(in_order(double, range(items), jobs=jobs, died=dead, work=work))
    assert found == [*range(0, 2 * items, 2)]
    assert pools.jobs == [started] * (started > 0)


def test_items_of_a_pool_that_breaks_are_tried_again_one_by_one_in_order(monkeypatch):
    pools = Pools(monkeypatch, breaks=(1, 3))
    found = list(as_done(double, range(6), jobs=2, died=dead))
    assert dict(found) == {0: 0, 1: dead(1), 2: 4, 3: dead(3), 4: 8, 5: 10}
    assert len(found) == 6
    assert pools.submitted == [[0, 1, 2, 3], [1], [3], [4, 5]]
    assert pools.jobs == [2, 1, 1, 2]
    assert pools.ended == [True] * 4
    assert list(in_order(double, range(6), jobs=2, died=dead)) == [0, dead(1), 4, dead(3), 8, 10]


def test_items_that_a_broken_pool_does_not_take_wait_for_the_next(monkeypatch):
    pools = Pools(monkeypatch, refuses=[2], waits=[1])
    found = as_done(double, range(4), jobs=2, died=dead)
    assert next(found) == (0, 0)
    pools.waits.clear()
    assert sorted(found) == [(1, 2), (2, 4), (3, 6)]
    assert pools.submitted == [[0, 1], [1], [2, 3]]


@pytest.mark.parametrize(
    ("platform", "threads", "safe"),
    [("linux", 1, True), ("linux", 2, False), ("darwin", 1, False), ("win32", 1, False)],
)
def test_a_fork_is_safe_on_linux_without_other_threads(monkeypatch, platform, threads, safe):
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(Path, "iterdir", lambda path: iter([path / "1"] * threads))
    assert parallel._forks() == safe


@pytest.mark.parametrize(
    ("cores", "jobs", "threads"),
    [(8, 3, 2), (8, 8, 1), (8, 16, 1), (9, 2, 4), (None, 2, 1), (None, 1, 1)],
)
def test_processes_share_the_cores_and_end_with_their_parent(
    monkeypatch, start, cores, jobs, threads
):
    made = []

    def forked(jobs, context, begin, given):
        made.append((jobs, context.get_start_method(), begin, given))

    def fresh(jobs, *, timeout, initializer, initargs):
        made.append((jobs, "fresh", initializer, initargs))

    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    monkeypatch.setattr(parallel, "ProcessPoolExecutor", forked)
    monkeypatch.setattr(loky, "ProcessPoolExecutor", fresh)
    how = "fork" if parallel._forks() else "fresh"
    parallel._pool(double, jobs)
    assert made == [(jobs, how, parallel._begin, (double, threads, os.getpid()))]


def test_a_process_has_its_function_its_threads_and_leaves_interrupts_to_its_parent(monkeypatch):
    told, watching = [], []

    class Watch:
        def __init__(self, *, target, args, daemon):
            watching.append((target, args, daemon))

        def start(self):
            watching.append("started")

    monkeypatch.setattr(parallel, "_function", None, raising=False)
    monkeypatch.setattr(parallel.gc, "freeze", lambda: None)
    monkeypatch.setattr(threadpoolctl, "threadpool_limits", told.append)
    monkeypatch.setattr(signal, "signal", lambda *given: told.append(given))
    monkeypatch.setattr(threading, "Thread", Watch)
    parallel._begin(double, 3, 77)
    assert parallel._call(4) == 8
    assert told == [3, (signal.SIGINT, signal.SIG_IGN)]
    assert watching == [(parallel._end_with, (77,), True), "started"]


def test_a_process_whose_parent_is_gone_ends_as_failed(monkeypatch):
    parents, slept = [77, 77, 1], []
    monkeypatch.setattr(os, "getppid", lambda: parents.pop(0))
    monkeypatch.setattr(os, "_exit", sys.exit)
    monkeypatch.setattr(time, "sleep", slept.append)
    with pytest.raises(SystemExit) as ended:
        parallel._end_with(77)
    assert ended.value.code == 1
    assert slept == [parallel.POLL] * 2
