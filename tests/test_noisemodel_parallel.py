"""Processes, and workers of a Dask scheduler, that work on many items, some of which die."""

import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest
from commandline import call

from noisemodel import NoiseModelError, parallel
from noisemodel.parallel import as_done, in_order

ROOT = Path(__file__).parents[1]
PATH = os.pathsep.join([str(ROOT), str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")])


def square_or_die(number):
    if number in (3, 11):
        os._exit(1)
    return number, number**2, os.getpid()


def dead(number):
    return number, "died", 0


def test_a_process_that_dies_costs_only_its_own_item():
    found = list(in_order(square_or_die, range(12), jobs=2, died=dead))
    assert [number for number, *_ in found] == list(range(12))
    assert [number for number, result, _ in found if result == "died"] == [3, 11]
    assert all(result == number**2 for number, result, _ in found if result != "died")
    assert os.getpid() not in {process for *_, process in found}


def first_waits(number, done):
    while number == 0 and not done.exists():
        time.sleep(0.01)
    if number == 0:
        time.sleep(0.3)  # another has told that it is done, and its result is on the way
    done.touch()
    return number


def test_results_come_as_they_are_ready_and_in_order_if_requested(tmp_path):
    work = partial(first_waits, done=tmp_path / "done")
    assert next(as_done(work, range(4), jobs=2, died=dead))[0] != 0
    (tmp_path / "done").unlink()
    assert list(in_order(work, range(4), jobs=2, died=dead)) == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("jobs", "items", "work"), [(2, 2, parallel.FRESH - 1e-6), (1, 2, 9.0), (2, 1, 9.0)]
)
def test_little_work_starts_no_processes(jobs, items, work):
    found = list(in_order(square_or_die, range(items), jobs=jobs, died=dead, work=work))
    assert {process for *_, process in found} == {os.getpid()}


def invert(number):
    return 1 / number


def test_errors_of_the_function_are_raised():
    with pytest.raises(ZeroDivisionError, match="division by zero"):
        list(in_order(invert, [1, 0, 2], jobs=2, died=dead))


def test_an_item_that_dies_may_end_all():
    def stop(number):
        raise RuntimeError(f"{number}: {parallel.DIED}")

    with pytest.raises(RuntimeError, match="3: the worker died"):
        list(in_order(square_or_die, range(5), jobs=2, died=stop))


def test_a_process_leaves_interrupts_to_its_parent_and_ends_with_it(monkeypatch):
    parents, slept = [77, 77, 1], []
    monkeypatch.setattr(os, "getppid", lambda: parents.pop(0))
    monkeypatch.setattr(os, "_exit", sys.exit)
    monkeypatch.setattr(time, "sleep", slept.append)
    with pytest.raises(SystemExit) as ended:
        parallel._end_with(77)
    assert ended.value.code == 1
    assert slept == [parallel.POLL] * 2
    found = set(in_order(handler, range(4), jobs=2, died=dead))
    assert found == {signal.SIG_IGN}


def handler(_):
    return signal.getsignal(signal.SIGINT)


@pytest.mark.parametrize("address", ["localhost", "tcp://localhost", "tcp://:8786", "8786"])
def test_an_address_has_a_protocol_a_host_and_a_port_and_needs_the_extra(address, monkeypatch):
    pytest.importorskip("distributed")
    with pytest.raises(NoiseModelError, match="no address of a Dask scheduler, tcp://HOST:PORT"):
        list(in_order(invert, [1], jobs=address, died=dead))
    assert list(in_order(invert, [], jobs=address, died=dead)) == []  # none is asked
    monkeypatch.setattr(parallel, "find_spec", lambda name: None)
    with pytest.raises(NoiseModelError, match=r"run `pip install 'noise-inspector\[cluster\]'`$"):
        list(in_order(invert, [1], jobs=address, died=dead))


def test_a_scheduler_that_does_not_answer_is_one_line(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(parallel, "REACHED", 0.5)
    with pytest.raises(NoiseModelError, match="no Dask scheduler answers there; start one with"):
        list(in_order(invert, [1], jobs="tcp://127.0.0.1:1", died=dead))


def test_workers_with_other_software_are_named():
    class Client:
        def run(self, function, *, on_error):
            return {"tcp://same": function(), "tcp://worker": function() | {"numpy": "0.0.1"}}

    with pytest.raises(NoiseModelError, match=r"tcp://worker has .*'numpy': '0.0.1'.*, here"):
        parallel._check_software(Client(), "tcp://x:1")


def test_a_worker_without_the_clients_folder_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there").mkdir()
    variables = {"NOISE_LIMIT_JOINTS": "7"}
    monkeypatch.setenv("NOISE_LIMIT_JOINTS", "")
    found = parallel._there(lambda item: (item, Path.cwd()), str(tmp_path / "there"), variables, 3)
    assert found == (3, tmp_path / "there")
    assert os.environ["NOISE_LIMIT_JOINTS"] == "7"
    with pytest.raises(NoiseModelError, match="must see the same files, by the same paths"):
        parallel._there(print, str(tmp_path / "gone"), {}, 3)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """The address of a scheduler with one worker, which does one thing at a time."""
    pytest.importorskip("distributed")
    folder = tmp_path_factory.mktemp("cluster")
    file = folder / "scheduler.json"
    processes = []

    def start(what, *arguments):
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", "--host", "127.0.0.1"]
        with (folder / f"{len(processes)}.log").open("w") as log:
            process = subprocess.Popen(
                [*command, "--no-dashboard", *map(str, arguments)],
                cwd=folder,
                env=os.environ | {"PYTHONPATH": PATH},
                stdout=log,
                stderr=log,
            )
        processes.append(process)

    start("scheduler", "--port", "0", "--scheduler-file", file)
    try:
        until = time.monotonic() + 300
        while not (file.exists() and file.read_text()):
            assert time.monotonic() < until
            time.sleep(0.1)
        address = json.loads(file.read_text())["address"]
        start("worker", address, "--nthreads", "1")
        yield address
    finally:
        for process in reversed(processes):
            process.terminate()
            process.wait()


@pytest.mark.slow
def test_items_are_done_on_a_cluster_and_errors_are_raised_here(cluster):
    found = list(in_order(square_or_die, range(3), jobs=cluster, died=dead))
    assert [each[:2] for each in found] == [(0, 0), (1, 1), (2, 4)]
    assert os.getpid() not in {process for *_, process in found}
    with pytest.raises(ZeroDivisionError):
        list(in_order(invert, [1, 0, 2], jobs=cluster, died=dead))


@pytest.mark.slow
def test_an_item_with_which_workers_of_a_cluster_die_costs_only_itself(cluster):
    found = list(in_order(square_or_die, range(5), jobs=cluster, died=dead))
    assert [number for number, *_ in found] == list(range(5))
    assert [number for number, result, _ in found if result == "died"] == [3]


@pytest.mark.slow
def test_files_are_classified_on_a_cluster_as_here(cluster, tmp_path, monkeypatch):
    from inspector.library import demo_run

    monkeypatch.chdir(tmp_path)
    for number in range(3):
        (tmp_path / f"{number}.npz").write_bytes(demo_run().read_bytes())
    alone = call("classify", ".")
    assert call("classify", ".", "--dask", cluster)[:2] == alone[:2]
