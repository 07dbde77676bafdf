import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import closing, contextmanager

import numpy as np
import pytest

import inspector
from inspector.live import SinkError
from inspector.live import drawing as module
from inspector.live.drawing import Sink
from inspector.recording import viewer
from inspector.recording.views import has_end


def free_port():
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextmanager
def receiver(home):
    """What receives recordings as a viewer does, without a window."""
    port = free_port()
    env = os.environ | {"HOME": str(home)}
    with viewer.started("--serve-grpc", "--port", str(port), env=env) as process:
        try:
            while not process.ended() and not viewer.listens("127.0.0.1", port):
                time.sleep(0.1)
            yield port, process
        finally:
            process.kill()


def second(first):
    return {"velocity": np.ones((1000, 2)), "time": first + np.arange(1000) / 1000}


@pytest.mark.parametrize("saved", [False, True])
def test_a_viewer_that_ends_is_warned_of_once_and_the_rest_goes_on(tmp_path, monkeypatch, saved):
    monkeypatch.setattr(module, "CHECK_INTERVAL", 0.0)
    monkeypatch.setattr(viewer, "CONNECT_TIMEOUT", 60.0)
    path, warned = tmp_path / "live.rrd" if saved else None, []
    with receiver(tmp_path) as (port, process):
        session = inspector.LiveSession(
            1000.0, connect=f"127.0.0.1:{port}", save=path, on_warning=warned.append
        )
        session.push(**second(0.0))
        assert warned == []
        process.kill()
        for first in range(1, 4):
            session.push(**second(first))
        summary = session.close()
    (line,) = warned
    assert line.startswith("the viewer is gone or hangs, noticed at 1.")
    rest = "the file goes on" if saved else "samples are only labelled and counted"
    assert line.endswith(f"s: {rest}")
    assert summary.warnings == {"samples that the viewer may not have shown": 3000}
    assert sum(summary.labels.values()) == 37
    assert f"shown by the viewer at 127.0.0.1:{port}" in str(summary)
    if saved:
        assert path.stat().st_size > 10_000


def test_a_viewer_that_hangs_is_told_of_once_and_the_file_is_whole(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "CHECK_INTERVAL", 0.05)
    monkeypatch.setattr(viewer, "CONNECT_TIMEOUT", 60.0)
    monkeypatch.setattr(module, "FLUSH_TIMEOUT", 0.2)
    monkeypatch.setattr(module, "LATE", 0.5)
    path, warned = tmp_path / "live.rrd", []
    with receiver(tmp_path) as (port, process):
        session = inspector.LiveSession(
            1000.0, connect=str(port), save=path, on_warning=warned.append
        )
        session.push(**second(0.0))
        os.killpg(process.process.pid, signal.SIGSTOP)
        seconds = 1
        while not warned and seconds < 500:
            session.push(**second(seconds))
            time.sleep(0.02)
            seconds += 1
        os.killpg(process.process.pid, signal.SIGCONT)
        summary = session.close()
    (line,) = warned
    assert line.startswith("the viewer is gone or hangs, noticed at ")
    assert 0 < summary.warnings["samples that the viewer may not have shown"] <= 1000 * seconds
    assert summary.samples == 1000 * seconds
    assert has_end(path)


def test_a_viewer_that_never_catches_up_holds_neither_the_file_nor_the_end_up(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(viewer, "CONNECT_TIMEOUT", 60.0)
    monkeypatch.setattr(module, "FLUSH_TIMEOUT", 0.2)
    path = tmp_path / "live.rrd"
    with receiver(tmp_path) as (port, process):
        code = f"""
import os, signal, numpy as np, inspector
from inspector.live import drawing
drawing.FLUSH_TIMEOUT = 0.2
session = inspector.LiveSession(1000.0, connect="{port}", save="{path}", on_warning=print)
os.killpg({process.process.pid}, signal.SIGSTOP)
for first in range(100):
    session.push(velocity=np.ones((1000, 2)), time=first + np.arange(1000) / 1000)
print(session.close().samples)
"""
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, check=True, text=True, timeout=300
        )
    assert done.stdout.splitlines()[-1] == "100000"
    assert has_end(path)


def test_sessions_at_one_viewer_are_recordings_of_their_own(tmp_path, monkeypatch):
    monkeypatch.setattr(viewer, "CONNECT_TIMEOUT", 60.0)
    with receiver(tmp_path) as (port, _):
        sinks = [Sink(connect=str(port)) for _ in range(2)]
        identities = {each.open[0].get_recording_id() for each in sinks}
        assert len(identities) == 2
        for each in sinks:
            each.close()


def test_a_missing_viewer_is_an_error_with_a_remedy(tmp_path, monkeypatch):
    port = free_port()
    with pytest.raises(SinkError, match=f"no viewer at 127.0.0.1:{port}, nothing listens there"):
        Sink(tmp_path / "live.rrd", str(port))
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setattr(module, "PORT", port)
    monkeypatch.setattr(viewer, "has_display", lambda: False)
    with pytest.raises(SinkError, match="no display to open one on; use --connect .* or --save"):
        Sink()
    monkeypatch.setattr(viewer, "has_display", lambda: True)
    told = 'import sys; sys.exit("Error: no luck" + str(sys.argv))'
    monkeypatch.setattr(viewer, "command", lambda *options: [sys.executable, "-c", told, *options])
    with pytest.raises(SinkError, match=rf"status 1 \(no luck.*{port}.*--memory-limit.*use --conn"):
        Sink()


def test_what_is_no_address_of_a_viewer_is_refused():
    none = "is no address of a viewer; expected PORT, HOST:PORT or"
    for address in ("here", "1.2.3.4:", "99999", "0", "http://a:1/x"):
        with pytest.raises(SinkError, match=none):
            Sink(connect=address)
