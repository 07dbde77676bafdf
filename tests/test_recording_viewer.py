import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import browser
import numpy as np
import pytest
from commandline import ran

from inspector.analysis import analyse_file
from inspector.recording import viewer
from inspector.recording.run import write
from inspector.recording.viewer import ViewerError
from noisemodel import Run

ROOT = Path(__file__).parents[1]


@pytest.fixture
def recording(tmp_path):
    time_ = np.arange(4000) / 1000
    run = Run(time=time_, velocity=np.sin(300 * time_)[:, None], joint_names=("elbow",))
    run.save(tmp_path / "run.npz")
    write(analyse_file(tmp_path / "run.npz", {}), tmp_path / "run.rrd")
    return tmp_path / "run.rrd"


def fake_viewer(monkeypatch, script):
    """Let a shell script take the place of the viewer; its arguments are the viewer's."""
    monkeypatch.setattr(
        viewer, "command", lambda *arguments: ["/bin/sh", "-c", script, "rerun", *arguments]
    )


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # it runs on
def test_a_window_that_opens_is_not_waited_for(monkeypatch):
    monkeypatch.setattr(viewer, "SETTLE", 0.1)
    fake_viewer(monkeypatch, "sleep 0.5")
    assert viewer.open_window(Path("run.rrd")) == ""


@pytest.mark.parametrize(
    ("script", "ports", "problem"),
    [
        ("", [viewer.PORT], ""),  # a viewer that runs already takes the recording over
        ('; [ "$2" = auto ]', [viewer.PORT, "auto"], ""),  # another program listens
        (
            "; printf 'INFO fine\\n\\033[31mError: no \\033[0mdisplay\\n' >&2; exit 101",
            [viewer.PORT, "auto"],
            "the viewer ended with status 101 (no display)",
        ),
    ],
)
def test_a_viewer_that_ends_took_the_recording_over_or_is_tried_at_a_free_port_or_told(
    monkeypatch, tmp_path, script, ports, problem
):
    fake_viewer(monkeypatch, f"echo $2 >> {tmp_path}/ports{script}")  # `--port 9876`
    assert viewer.open_window(Path("run.rrd")) == problem
    assert (tmp_path / "ports").read_text().split() == ports


def test_a_missing_viewer_is_an_error(monkeypatch):
    monkeypatch.setattr(viewer, "find_spec", lambda _: None)
    with pytest.raises(ViewerError, match="viewer is missing; `pip install rerun-sdk`"):
        viewer.open_window(Path("run.rrd"))


@pytest.mark.parametrize("env", [None, {"PATH": os.environ["PATH"]}])
def test_every_viewer_is_told_to_send_no_usage_data(monkeypatch, tmp_path, env):
    monkeypatch.delenv("CI", raising=False)
    fake_viewer(monkeypatch, f"echo $CI > {tmp_path}/told")
    with viewer.started(env=env) as started:
        started.process.wait()
    assert (tmp_path / "told").read_text() == "true\n"


def test_nothing_but_the_viewer_s_own_starter_starts_one():
    starts = [
        path.relative_to(ROOT).as_posix()
        for package in ("inspector", "models", "noisemodel")
        for path in (ROOT / package).rglob("*.py")
        if re.search(r"\bviewer\.command\(|\brr\.spawn\(|\bPopen\(|spawn=True", path.read_text())
    ]
    assert starts == ["inspector/recording/viewer.py"]


@pytest.mark.parametrize(("forced", "collects"), [("", False), ("1", True)])
def test_a_viewer_collects_usage_data_only_if_it_is_forced_to(
    monkeypatch, recording, tmp_path, forced, collects
):
    monkeypatch.delenv("CI", raising=False)
    monkeypatch.setenv("HTTPS_PROXY", "http://127.0.0.1:9")  # nothing leaves this machine
    for name in ("HOME", "XDG_DATA_HOME", "XDG_CONFIG_HOME"):
        monkeypatch.setenv(name, str(tmp_path))
    monkeypatch.setenv("FORCE_RERUN_ANALYTICS", forced)
    with viewer.serving(recording):
        pass
    assert bool(list(tmp_path.glob("**/rerun/analytics"))) == collects


def listening_on(pid):
    """Local addresses that the children of a process listen on."""
    children = ran("pgrep", "-P", pid).stdout.split()
    sockets = [line.split() for line in ran("ss", "-ltnpH").stdout.splitlines()]
    return [s[3] for s in sockets if any(f"pid={child}," in s[-1] for child in children)]


def test_a_recording_is_served_on_loopback_to_those_who_ask_for_this_host_only(recording):
    """A page whose name was made to point here after it was loaded reads nothing."""
    with viewer.serving(recording) as (url, server):
        page, data = url.split("/?url=")
        port = int(page.removeprefix("http://127.0.0.1:"))
        assert data.startswith(f"http%3A%2F%2F127.0.0.1%3A{port}")

        def got(host, path="/recording.rrd", method="GET"):
            request = f"{method} {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"
            with socket.create_connection(("127.0.0.1", port)) as connection:
                connection.sendall(request.encode())
                head, _, body = connection.makefile("rb").read().partition(b"\r\n\r\n")
                return int(head.split()[1]), body

        assert got(f"127.0.0.1:{port}") == (200, recording.read_bytes())
        assert got(f"localhost:{port}")[0] == 200
        status, body = got(f"127.0.0.1:{port}", "/")
        assert (status, b"rerun" in body.lower()) == (200, True)
        for host in ("evil.example", f"evil.example:{port}", "127.0.0.1", ""):
            for path in ("/recording.rrd", "/"):
                status, body = got(host, path)
                assert status == 403
                assert b"RRF2" not in body
        assert got(f"127.0.0.1:{port}", method="POST")[0] == 501
        if shutil.which("ss") and shutil.which("pgrep"):
            # What rerun itself serves, on other ports, holds no recording.
            addresses = listening_on(server.process.pid)
            assert len(addresses) == 2
            assert all(address.startswith("127.0.0.1:") for address in addresses)
            assert f"127.0.0.1:{port}" not in addresses
    assert viewer.free_port(port) == port


def test_a_port_that_is_taken_is_one_line(recording):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with (
            pytest.raises(ViewerError, match=f"port {port} cannot be had .*name another, or none"),
            viewer.serving(recording, port=port),
        ):
            pass


@pytest.mark.parametrize("opened", [viewer.serving, lambda _: viewer.headless_viewer()])
def test_a_server_or_viewer_that_ends_at_once_is_an_error_with_the_reason(
    monkeypatch, recording, opened
):
    fake_viewer(monkeypatch, "echo Error: no memory >&2; exit 3")
    with pytest.raises(ViewerError, match=r"ended with status 3 \(no memory\)"), opened(recording):
        pass


def test_a_server_that_ends_later_is_an_error(recording):
    with viewer.serving(recording) as (_, server):
        os.killpg(server.process.pid, signal.SIGKILL)
        with pytest.raises(ViewerError, match="the viewer ended with status -9"):
            server.wait()


@pytest.mark.parametrize(
    "stop", [signal.SIGTERM, pytest.param(signal.SIGINT, marks=pytest.mark.slow)]
)
def test_serving_ends_with_the_program_and_leaves_no_server(recording, stop):
    command = [sys.executable, "-m", "inspector", "view", recording.with_suffix(".npz"), "--web"]
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"},
        # What a shell starts in the background is deaf to SIGINT, and so is what that starts.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    ) as program:
        url = next(line for line in program.stdout if line.startswith("open ")).split()[1]
        port = int(url.removeprefix("http://127.0.0.1:").partition("/")[0])
        program.send_signal(stop)
        try:
            assert program.wait(timeout=300) == 0
        finally:
            program.kill()
    assert viewer.free_port(port) == port


@pytest.mark.slow
def test_a_browser_draws_the_recording(recording, tmp_path):
    with browser.page() as page, viewer.serving(recording) as (url, _):
        page.goto(f"{url}&renderer=webgl")
        until = time.monotonic() + 240
        sizes = [0]
        # The page grows from a spinner to the views, and then stays as it is.
        while time.monotonic() < until and not (sizes[-1] > 40_000 and sizes[-1] == sizes[-2]):
            page.wait_for_timeout(3000)
            sizes.append(len(page.screenshot(path=tmp_path / "web.png", timeout=240_000)))
    assert sizes[-1] > 40_000


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return viewer.scratch_path(Path("first.npz")).parent


def test_only_the_newest_recordings_stay_and_what_is_none_is_left_alone(folder):
    paths = [folder / f"run{number}.rrd" for number in range(30)]
    for age, path in enumerate(reversed(paths)):
        path.write_bytes(b"x")
        os.utime(path, (1e9 - age, 1e9 - age))
    (folder / "notes.txt").write_text("mine")
    viewer.scratch_path(Path("next.npz"))
    newest = viewer.MAX_SCRATCH_FILES - 1  # and one to come
    assert sorted(folder.iterdir()) == sorted([folder / "notes.txt", *paths[-newest:]])
