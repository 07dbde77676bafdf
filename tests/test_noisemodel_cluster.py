"""Runs on the workers of a Dask scheduler: a real one, on this machine."""

import json
import logging
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import time
import warnings
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import pytest
import threadpoolctl  # which sets an environment variable
from commandline import call
from test_inspector_tune import OPTIONS, write_log

from inspector.assets import demo_run
from noisemodel import ClusterError, cluster
from noisemodel.parallel import DIED, in_order

ROOT = Path(__file__).parents[1]
PATH = os.pathsep.join([str(ROOT), str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")])
COUNT = 24
SLOW = 600.0
"""Most time that a process of the cluster may take to start, or an answer to arrive, in [s]."""


def until(condition):
    deadline = time.monotonic() + SLOW
    while not (found := condition()):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    return found


class Cluster:
    """A scheduler and its workers, each in a folder of its own and with a nanny."""

    def __init__(self, folder):
        self.folder, self.file, self.processes = folder, folder / "scheduler.json", []
        self.scheduler = self.start("scheduler", "--port", "0", "--scheduler-file", self.file)
        self.address = until(self._address)

    def start(self, what, *arguments, path=PATH):
        place = self.folder / str(len(self.processes))
        place.mkdir()
        allowed = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}
        with (place / "log").open("w") as log:
            module = f"distributed.cli.dask_{what}"
            common = ("--host", "127.0.0.1", "--no-dashboard")
            process = subprocess.Popen(
                [sys.executable, "-m", module, *common, *map(str, arguments)],
                cwd=place,
                env=os.environ | {"PYTHONPATH": path} | allowed,
                stdout=log,
                stderr=log,
            )
        self.processes.append(process)
        return process

    def add_worker(self, **settings):
        return self.start("worker", self.address, "--nthreads", "1", **settings)

    def _address(self):
        return self.file.exists() and json.loads(self.file.read_text() or "{}").get("address")

    def workers(self):
        """Process of each worker, by its address."""
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            return client.run(os.getpid)

    def stop(self):
        for process in reversed(self.processes):
            process.terminate()
            process.wait()


@contextmanager
def running(folder, workers):
    pytest.importorskip("distributed")
    cluster = Cluster(folder)
    try:
        for _ in range(workers):
            cluster.add_worker()
        until(lambda: len(cluster.workers()) == workers)
        yield cluster
    finally:
        cluster.stop()


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """A cluster of two workers."""
    with running(tmp_path_factory.mktemp("two"), 2) as cluster:
        yield cluster


@pytest.fixture
def runs(tmp_path):
    folder = tmp_path / "runs"
    folder.mkdir()
    for number in range(COUNT):
        shutil.copy(demo_run(), folder / f"{number:02d}.npz")
    return folder


def rows(state):
    return [json.loads(line) for line in state.read_bytes().split(b"\n")[1:-1]]


def start(folder, *arguments):
    return subprocess.Popen(
        [sys.executable, "-m", "inspector", *map(str, arguments)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": PATH},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.slow
def test_of_two_workers_one_is_killed_and_nothing_is_lost_or_done_twice(two, runs, monkeypatch):
    monkeypatch.chdir(runs.parent)
    alone = call("classify", "runs")
    state = runs.parent / "state.jsonl"
    process = start(runs.parent, "classify", "runs", "--dask", two.address, "--resume", state)
    until(lambda: state.exists() and len(rows(state)) > 2)
    os.kill(next(iter(two.workers().values())), signal.SIGKILL)
    out, err = process.communicate(timeout=SLOW)
    assert (process.returncode, out) == alone[:2], err
    assert sorted(row["run"] for row in rows(state)) == [f"runs/{n:02d}.npz" for n in range(COUNT)]
    until(lambda: len(two.workers()) == 2)


def square_or_die(number):
    if number in (3, 7):
        os._exit(1)
    return number**2


@pytest.mark.slow
def test_an_item_that_kills_every_worker_is_named_and_the_others_are_not(two):
    found = list(in_order(square_or_die, range(8), jobs=two.address, died=lambda item: DIED))
    assert found == [DIED if number in (3, 7) else number**2 for number in range(8)]
    until(lambda: len(two.workers()) == 2)


class Fragile:
    """A function that kills the first worker that gets it."""

    def __init__(self, mark):
        self.mark = mark

    def __setstate__(self, state):
        self.__dict__.update(state)
        if multiprocessing.parent_process() and not self.mark.exists():  # no scheduler
            self.mark.touch()
            os._exit(1)

    def __call__(self, number):
        return number**2


@pytest.mark.slow
def test_items_whose_function_is_lost_with_a_worker_get_it_again(two, tmp_path):
    mark = tmp_path / "mark"
    found = in_order(Fragile(mark), range(4), jobs=two.address, died=lambda item: DIED)
    assert list(found) == [0, 1, 4, 9]
    assert mark.exists()
    until(lambda: len(two.workers()) == 2)


def invert(number):
    return 1 / number


@pytest.mark.slow
def test_an_error_on_a_worker_is_raised_here(two):
    with pytest.raises(ZeroDivisionError, match="division by zero"):
        list(in_order(invert, [1, 0, 2], jobs=two.address, died=invert))


@pytest.mark.slow
def test_a_worker_without_the_files_is_named(two, monkeypatch):
    monkeypatch.setattr(Path, "cwd", lambda: Path("/elsewhere"))
    with pytest.raises(ClusterError, match="no folder /elsewhere; it must see the same files"):
        list(in_order(invert, [1], jobs=two.address, died=invert))


@pytest.mark.slow
def test_diff_and_tune_print_and_write_the_same_on_a_cluster(two, runs, monkeypatch):
    monkeypatch.chdir(runs.parent)
    for number in range(2):
        write_log(runs.parent / "logs", number)
    for number in range(2, 20):
        (runs / f"{number:02d}.npz").unlink()
    shutil.copytree(runs, "after")
    tune = ("tune", "logs", *OPTIONS, "--folds", 2, "--grid", "C=1,10", "--grid", "stride=25,50")
    for command in (
        ("diff", "runs", "after", "--format", "json", "--no-robot"),
        (*tune, "-o", "{}.jsonl"),
    ):
        here, there = (
            call(*(str(each).format(place) for each in command), *more)[:2]
            for place, more in (("here", ()), ("there", ("--dask", two.address)))
        )
        assert there == here
    assert Path("there.jsonl").read_bytes() == Path("here.jsonl").read_bytes()


@pytest.mark.slow
def test_a_data_set_is_the_same_from_a_cluster(two, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data = ("simulate", "dataset", "--robots", "panda", "--scenarios", "2,3", "--seeds", 1)
    for place, more in (("here", ()), ("there", ("--dask", two.address))):
        status, _, err = call(*data, "--duration", 3, "-o", place, *more)
        assert status == 0, err
    here, there = (
        {path.name: path.read_bytes() for path in Path(place).rglob("*.npz")}
        for place in ("here", "there")
    )
    assert len(here) == 2
    assert there == here


@pytest.mark.slow
def test_a_cluster_without_workers_with_others_and_one_that_vanishes(tmp_path, runs, monkeypatch):
    monkeypatch.setattr(cluster, "STAFFED", 1.0)
    (tmp_path / "cluster").mkdir()
    with running(tmp_path / "cluster", 0) as small:
        status, out, err = call("classify", runs, "--dask", small.address)
        assert (status, out) == (3, "")
        assert err.startswith(f"inspector: {small.address}: the Dask scheduler has no worker after")
        assert err.count("\n") == 1
        old = tmp_path / "old" / "noise_inspector-0.0.1.dist-info"
        old.mkdir(parents=True)
        (old / "METADATA").write_text("Name: noise-inspector\nVersion: 0.0.1\n")
        worker = small.add_worker(path=os.pathsep.join([str(old.parent), PATH]))
        until(small.workers)
        status, out, err = call("classify", runs, "--dask", small.address)
        assert (status, out) == (3, "")
        assert " has noise-inspector 0.0.1, here is " in err
        assert err.endswith("; install the same on all\n")
        assert err.count("\n") == 1
        worker.terminate()
        worker.wait()
        small.add_worker()
        until(small.workers)
        state = tmp_path / "state.jsonl"
        process = start(tmp_path, "classify", runs, "--dask", small.address, "--resume", state)
        until(lambda: state.exists() and len(rows(state)) > 2)
        small.scheduler.kill()
        out, err = process.communicate(timeout=SLOW)
        assert (process.returncode, out) == (3, "")
        said = [line for line in err.splitlines() if not line.startswith("classify: ")]
        assert said == [f"inspector: {small.address}: the connection to the Dask scheduler is lost"]
        assert 2 < len(rows(state)) < COUNT


def test_a_scheduler_that_does_not_answer_is_one_line(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(cluster, "REACHED", 0.2)
    status, out, err = call("classify", demo_run(), "--dask", "tcp://127.0.0.1:1")
    assert (status, out) == (3, "")
    assert err == (
        "inspector: tcp://127.0.0.1:1: no Dask scheduler answers there; start one with"
        " `dask scheduler`, and name the address that it prints\n"
    )


@pytest.mark.parametrize(
    "command",
    [
        ("classify", demo_run()),
        ("diff", demo_run(), demo_run()),
        ("simulate", "dataset", "--robots", "panda", "--seeds", "1", "-o", "data"),
    ],
    ids=["classify", "diff", "simulate"],
)
def test_without_the_extra_and_with_no_address_it_is_one_line(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cluster, "find_spec", lambda name: None)
    status, out, err = call(*command, "--dask", "tcp://127.0.0.1:1")
    assert (status, out) == (3, "")
    assert err == (
        "inspector: a Dask cluster needs distributed, which is not installed;"
        " run `pip install 'noise-inspector[cluster]'`\n"
    )
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    status, out, err = call(*command, "--dask", "somewhere")
    assert (status, out) == (3, "")
    assert err in (
        "inspector: 'somewhere' is no address of a Dask scheduler, tcp://HOST:PORT\n",
        "inspector: a Dask cluster needs distributed, which is not installed;"
        " run `pip install 'noise-inspector[cluster]'`\n",
    )


def test_processes_here_and_a_cluster_exclude_each_other():
    status, _, err = call("classify", demo_run(), "-j", 2, "--dask", "tcp://127.0.0.1:1")
    assert status == 2
    assert "--jobs and --dask exclude each other" in err


class Fake:
    """A client of a scheduler with such workers."""

    def __init__(self, *, status="running", workers=("one",), versions=None):
        self.status, self._workers, self._versions = status, workers, versions or {}

    def nthreads(self):
        return dict.fromkeys(self._workers, 1)

    def run(self, function, name, on_error):
        assert on_error == "return"
        here = cluster._software()[name]
        return {worker: self._versions.get((worker, name), here) for worker in self._workers}


def test_workers_with_other_software_are_named():
    cluster._check_software(Fake(workers=("one", "two")), "tcp://here:1")
    for there, said in (("0.0.1", "numpy 0.0.1, here is"), (ImportError(), "numpy none, here is")):
        client = Fake(workers=("one", "two"), versions={("two", "numpy"): there})
        with pytest.raises(ClusterError, match=rf"^tcp://here:1: worker two has {said}"):
            cluster._check_software(client, "tcp://here:1")


def test_a_scheduler_may_be_without_workers_for_a_minute(monkeypatch):
    monkeypatch.setattr(cluster, "monotonic", lambda: 100.0)
    assert cluster._check_alive(Fake(), "a", 30.0) == 100.0
    assert cluster._check_alive(Fake(workers=()), "a", 40.0) == 40.0
    with pytest.raises(ClusterError, match="a: the Dask scheduler has lost all its workers"):
        cluster._check_alive(Fake(workers=()), "a", 39.9)
    for status in ("closed", "connecting", "stopped"):
        with pytest.raises(ClusterError, match="a: the connection to the Dask scheduler is lost"):
            cluster._check_alive(Fake(status=status), "a", 100.0)


def test_a_worker_calls_a_function_where_and_as_its_client_would(tmp_path, monkeypatch):
    monkeypatch.setenv("OTHER", "here")
    own = cluster._Client(str(tmp_path), {"NOISE_X": "1"}, cluster._software())
    before, folder = dict(os.environ), Path.cwd()

    def seen(item):
        return item, Path.cwd(), os.environ["NOISE_X"], os.environ["OTHER"]

    assert cluster._called(seen, 7, own) == (7, tmp_path, "1", "here")
    with pytest.raises(ZeroDivisionError):
        cluster._called(lambda item: item / 0, 7, own)
    assert (dict(os.environ), Path.cwd()) == (before, folder)
    late = cluster._Client(str(tmp_path), {}, {**cluster._software(), "numpy": "0.0.1"})
    with pytest.raises(ClusterError, match="this worker came later, and has other software"):
        cluster._called(seen, 7, late)
    gone = cluster._Client(str(tmp_path / "gone"), {}, cluster._software())
    with pytest.raises(ClusterError, match=rf"a worker has no folder {tmp_path}/gone; it must see"):
        cluster._called(seen, 7, gone)
    assert (dict(os.environ), Path.cwd()) == (before, folder)


class CancelledError(Exception):
    pass


class KilledWorker(Exception):  # noqa: N818 - Dask's name
    def __init__(self, task):
        self.task = task


class Task:
    """A future of a scheduler."""

    def __init__(self, key, function, arguments):
        self.key, self._function, self._arguments = key, function, arguments
        self.killed = None

    def result(self):
        if self.killed:
            raise KilledWorker(self.killed)
        own = [each.result() if isinstance(each, Task) else each for each in self._arguments]
        return self._function(*own)

    def add_done_callback(self, ready):
        ready(self)


class Scheduler(Fake):
    """Stands in for `distributed` and its client: tasks are done here, where they are read."""

    def __init__(self, monkeypatch, *, connects=None, staffed=None, kind="item", **options):
        super().__init__(**options)
        self.connects, self.staffed, self.kind = connects, staffed, kind
        self.tasks, self.closed = [], False
        module = ModuleType("distributed")
        module.Client = self.connect
        module.CancelledError, module.KilledWorker = CancelledError, KilledWorker
        monkeypatch.setitem(sys.modules, "distributed", module)
        monkeypatch.setattr(cluster, "find_spec", lambda name: name)
        self.levels = None

    def connect(self, address, *, timeout, set_as_default):
        self.levels = [logging.getLogger(f"distributed{name}").level for name in ("", ".client")]
        assert (address, timeout, set_as_default) == ("tcp://here:1", cluster.REACHED, False)
        if self.connects:
            raise self.connects
        return self

    def wait_for_workers(self, count, timeout):
        assert (count, timeout) == (1, cluster.STAFFED)
        if self.staffed:
            raise self.staffed

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.closed = True

    def submit(self, function, *arguments, pure):
        assert not pure  # else one call of two alike would do for both
        if function is cluster._itself:
            warnings.warn("Sending large graph of size 20 MiB", stacklevel=1)
        kind = "m" if function is cluster._itself else self.kind
        task = Task(f"{kind}{len(self.tasks)}", function, arguments)
        self.tasks.append(task)
        return task

    def of(self, item):
        """The tasks of an item, in the order in which they were submitted."""
        return [t for t in self.tasks if t._function is cluster._called and t._arguments[1] == item]

    def kills(self, item, *, times, of_function=False):
        """Let an item, or the function that it waits for, kill its workers so many times."""
        submit = self.submit

        def killing(function, *arguments, pure):
            task = submit(function, *arguments, pure=pure)
            if task in self.of(item)[:times]:
                task.killed = arguments[0].key if of_function else task.key
            return task

        self.submit = killing


def square(number):
    return number**2


def named(number):
    return f"{number} died"


def found_by(scheduler, items, function=square):
    """What a cluster finds, by item; each item once."""
    found = list(cluster.on_cluster(function, items, address="tcp://here:1", died=named, poll=0.01))
    assert sorted(index for index, _ in found) == list(range(len(items)))
    assert scheduler.closed
    return {items[index]: result for index, result in found}


def test_items_are_done_on_a_cluster_with_the_settings_of_the_client(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NOISE_LIMIT_JOINTS", "7")
    monkeypatch.setenv("OTHER", "here")
    limits = []

    @contextmanager
    def limited(threads):
        limits.append(threads)
        yield

    monkeypatch.setattr(threadpoolctl, "threadpool_limits", limited)
    scheduler = Scheduler(monkeypatch)
    assert found_by(scheduler, [3, 5, 7]) == {3: 9, 5: 25, 7: 49}
    client = scheduler.of(5)[0]._arguments[2]
    assert client.folder == str(tmp_path)
    assert client.variables["NOISE_LIMIT_JOINTS"] == "7"
    assert "OTHER" not in client.variables
    assert client.software == cluster._software()
    assert limits == [1, 1, 1]
    assert len(scheduler.tasks) == 4  # the function is sent once
    assert list(in_order(square, [4, 2], jobs="tcp://here:1", died=named)) == [16, 4]


def test_without_items_no_scheduler_is_asked(monkeypatch):
    assert list(cluster.on_cluster(square, [], address="", died=named, poll=0.01)) == []


@pytest.mark.parametrize("kind", ["a", "z"])
@pytest.mark.parametrize(("times", "result"), [(0, 25), (1, 25), (2, "5 died")])
def test_an_item_that_kills_its_workers_is_tried_once_more_alone(monkeypatch, times, result, kind):
    scheduler = Scheduler(monkeypatch, kind=kind)
    scheduler.kills(5, times=times)
    assert found_by(scheduler, [3, 5, 7, 9]) == {3: 9, 5: result, 7: 49, 9: 81}
    assert len(scheduler.of(5)) == 1 + (times > 0)
    assert len(scheduler.of(3)) == len(scheduler.of(9)) == 1


@pytest.mark.parametrize("times", [1, 2])
def test_items_whose_function_kills_workers_wait_for_it_again_and_are_suspected_last(
    monkeypatch, times
):
    """Where it is lost for all that wait, they are tried one by one, and then named."""
    scheduler = Scheduler(monkeypatch)
    for item in (5, 9):
        scheduler.kills(item, times=times, of_function=True)
    assert found_by(scheduler, [3, 5, 7, 9]) == {3: 9, 5: 25, 7: 49, 9: 81}
    assert [len(scheduler.of(item)) for item in (3, 5, 7, 9)] == [1, 1 + times, 1, 1 + times]
    lost = Scheduler(monkeypatch)
    lost.kills(5, times=3, of_function=True)
    assert found_by(lost, [3, 5, 7]) == {3: 9, 5: "5 died", 7: 49}
    assert len(lost.of(5)) == 3


def test_while_no_result_comes_none_is_found_and_the_scheduler_is_asked(monkeypatch):
    """A scheduler may be without workers for a minute, counted from when it last had one."""
    scheduler, now, callbacks = Scheduler(monkeypatch), [1000.0], []
    monkeypatch.setattr(cluster, "monotonic", lambda: now[0])
    monkeypatch.setattr(Task, "add_done_callback", lambda task, ready: callbacks.append(ready))
    found = cluster.on_cluster(square, [3, 5], address="tcp://here:1", died=named, poll=0.001)
    assert next(found) is None
    callbacks[1](scheduler.of(5)[0])
    assert next(found) == (1, 25)
    now[0] += 100.0
    assert next(found) is None
    scheduler._workers = ()
    now[0] += 60.0
    assert next(found) is None
    now[0] += 0.1
    with pytest.raises(ClusterError, match=r"^tcp://here:1: the Dask scheduler has lost all its w"):
        next(found)
    assert scheduler.closed


def test_an_error_of_an_item_is_raised_unless_its_worker_has_other_software(monkeypatch):
    scheduler = Scheduler(monkeypatch)
    with pytest.raises(ZeroDivisionError, match="division by zero"):
        found_by(scheduler, [1, 0], invert)
    other = Scheduler(monkeypatch)

    def late(number):
        other._versions = {("one", "numpy"): "0.0.1"}
        return 1 / number

    with pytest.raises(
        ClusterError, match=r"worker one has numpy 0\.0\.1, here is .* same on all$"
    ):
        found_by(other, [0], late)

    def closing(number):
        late(1)
        other.status = "closed"
        return 1 / number

    other._versions = {}
    with pytest.raises(ZeroDivisionError, match="division by zero"):
        found_by(other, [0], closing)

    def cancelled(number):
        raise CancelledError

    other._versions = {}
    with pytest.raises(ClusterError, match="the connection to the Dask scheduler is lost"):
        found_by(other, [0], cancelled)


def test_messages_of_dask_are_left_out_while_there_is_a_client_and_no_longer(monkeypatch):
    loggers = [logging.getLogger(f"distributed{name}") for name in ("", ".client")]
    for logger, level in zip(loggers, (logging.INFO, logging.ERROR), strict=True):
        monkeypatch.setattr(logger, "level", level)
    none = "tcp://here:1: the Dask scheduler has no worker after 60 s; start some with"
    for options, said in (
        ({}, ""),
        ({"connects": OSError("refused")}, "tcp://here:1: no Dask scheduler answers there; start"),
        ({"connects": ValueError("wrong")}, "tcp://here:1: no Dask scheduler answers there; start"),
        ({"staffed": TimeoutError()}, f"{none} `dask worker tcp://here:1 --nthreads 1`"),
    ):
        scheduler = Scheduler(monkeypatch, **options)
        if said:
            with pytest.raises(ClusterError, match=f"^{said}"):
                found_by(scheduler, [3])
        else:
            found_by(scheduler, [3])
        assert min(scheduler.levels) > logging.CRITICAL
        assert [logger.level for logger in loggers] == [logging.INFO, logging.ERROR]


@pytest.mark.parametrize("address", ["here:1", "tcp://here", "tcp://here:", "tcp://:1", "://h:1"])
def test_an_address_has_a_protocol_a_host_and_a_port(monkeypatch, address):
    Scheduler(monkeypatch)
    with pytest.raises(ClusterError, match=rf"^'{address}' is no address of a Dask scheduler, tcp"):
        list(cluster.on_cluster(square, [3], address=address, died=named, poll=0.01))


def test_software_that_is_run_from_its_folder_has_no_version(monkeypatch):
    def version(name):
        if name == "noise-inspector":
            raise cluster.PackageNotFoundError(name)
        return "9.9"

    monkeypatch.setattr(cluster, "version", version)
    assert cluster._software.__wrapped__() == {"noise-inspector": "none", "numpy": "9.9"}
