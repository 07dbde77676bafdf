"""Output that cannot be written: full disks, readers that are gone, processes that are killed."""

import os
import resource
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest
from commandline import call, ran, refused

from inspector.library import demo_run

ROOT = Path(__file__).parents[1]
TOO_LARGE = "cannot be written (File too large)"
# Short, and with work; all others are tried within this process, in test_exit_statuses.
COMMANDS = (["--help"], ["classify", demo_run()])
ROWS = "time,elbow.velocity\n" + "".join(f"{k / 1000},{k % 70 / 70}\n" for k in range(4000))


def command(*arguments):
    return [sys.executable, "-m", "inspector", *map(str, arguments)]


def run(*arguments, limit):
    """Run the command line, with files no larger than `limit` in [byte]."""
    # Bytecode would be cut off, too.
    env = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}
    limited = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (limit, limit))
    return ran(*command(*arguments), cwd=ROOT, env=env, preexec_fn=limited)


@pytest.mark.parametrize("arguments", COMMANDS, ids=lambda each: each[0])
@pytest.mark.parametrize(
    ("output", "reason"),
    [
        (">/dev/full", "No space left on device"),
        (">&-", "Bad file descriptor"),
        ("", "Broken pipe"),
    ],
)
def test_every_command_ends_with_5_if_standard_output_takes_nothing(arguments, output, reason):
    if output == ">/dev/full" and not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    reader, writer = os.pipe()
    os.close(reader)
    shell = ["sh", "-c", f'exec "$@" {output}', "sh", *command(*arguments)]
    done = subprocess.run(
        shell, cwd=ROOT, check=False, text=True, stdout=writer, stderr=subprocess.PIPE
    )
    os.close(writer)
    assert done.returncode == 5
    said = f"inspector: output lost: standard output: cannot be written ({reason})"
    assert said in done.stderr.splitlines()
    assert "Traceback" not in done.stderr


def test_a_recording_that_is_lost_keeps_the_one_that_it_would_replace(tmp_path):
    target = tmp_path / "out.rrd"
    target.write_text("before")
    done = run("view", demo_run(), "-o", target, "--overwrite", limit=300_000)
    assert (done.returncode, target.read_text()) == (5, "before")
    assert done.stderr == f"inspector: {target}: {TOO_LARGE}\n"


def test_run_files_that_cannot_be_written_are_lost_output_and_not_bad_logs(tmp_path):
    logs, imported = tmp_path / "logs", tmp_path / "imported"
    logs.mkdir()
    for name in ("a.csv", "b.csv"):
        (logs / name).write_text(ROWS)
    done = run("import", logs, "-o", imported, limit=8000)
    lines = [f"inspector: {imported / name}: {TOO_LARGE}" for name in ("a.npz", "b.npz")]
    assert done.stderr.splitlines() == lines
    assert done.returncode == 5
    assert os.listdir(imported) == []


def children(pid):
    return [int(each) for each in ran("pgrep", "-P", pid).stdout.split()]


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


SLOW = """
import sys, time
from noisemodel import parallel
def wait(seconds):
    open(f"{sys.argv[1]}/{seconds}", "w").close()
    time.sleep(seconds)
list(parallel.in_order(wait, [50, 51, 52], jobs=2, died=None))
"""


@pytest.mark.skipif(not Path("/proc").exists(), reason="needs /proc")
@pytest.mark.parametrize("stop", [signal.SIGKILL, signal.SIGTERM])
def test_workers_end_with_the_process_that_waits_for_them(tmp_path, stop):
    script = tmp_path / "slow.py"
    script.write_text(SLOW.replace("sys.argv[1]", repr(str(tmp_path))))
    with subprocess.Popen(
        [sys.executable, script], env=os.environ | {"PYTHONPATH": str(ROOT)}
    ) as p:
        until = time.monotonic() + 300
        while len(list(tmp_path.glob("5?"))) < 2 and time.monotonic() < until:
            time.sleep(0.1)
        workers = children(p.pid)
        p.send_signal(stop)
    assert len(workers) >= 2
    until = time.monotonic() + 300
    while any(alive(each) for each in workers) and time.monotonic() < until:
        time.sleep(0.1)
    assert not [each for each in workers if alive(each)]


LONG = "a" * 300


@pytest.mark.parametrize(
    "arguments",
    [
        ("classify", LONG),
        ("classify", demo_run(), "--resume", LONG),
        ("classify", demo_run(), "--write", f"json={LONG}"),
        ("classify", demo_run(), "--report", LONG),
        ("view", demo_run(), "-o", f"{LONG}.html"),
        ("merge", LONG),
        ("history", LONG),
        ("import", LONG, "-o", "a.npz"),
    ],
)
def test_a_name_that_is_too_long_is_one_line(tmp_path, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    status, _, err = call(*arguments)
    assert status in (3, 5)
    assert err.count("\n") == 1
    assert err.startswith("inspector: ")
    assert LONG in err


def test_a_home_that_cannot_be_written_is_one_line(monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", "/proc/nothing")
    assert refused("view", demo_run(), status=5).endswith("; name the recording with -o FILE.rrd\n")


def test_a_backend_of_matplotlib_that_does_not_exist_does_not_matter(tmp_path):
    env = os.environ | {"MPLBACKEND": "x", "PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'models'}"}
    done = ran(*command("view", demo_run(), "-o", tmp_path / "a.html"), env=env)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (EOFError, 70, "RuntimeError: a file ends too early"),
        (KeyboardInterrupt, 130, "interrupted"),
    ],
)
def test_an_end_that_is_no_finding_has_not_its_exit_status(monkeypatch, error, status, said):
    def ends(*_, **__):
        raise error

    monkeypatch.setattr("inspector.commands.check.load_library", ends)
    found, _, err = call("classify", demo_run())
    assert (found, said in err, "Aborted" in err) == (status, True, False)
