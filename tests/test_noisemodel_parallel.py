"""Processes that work on many runs, some of which die."""

import os
import time

import pytest

from noisemodel import parallel
from noisemodel.parallel import as_done, in_order


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
