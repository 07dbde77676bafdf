"""The sinks of a live recording: a file, a viewer that runs, or one that is opened for it."""

import os
import re
import socket
import time
import uuid
from collections.abc import Callable
from contextlib import ExitStack, suppress
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from threading import Event, Thread
from typing import Any, cast

import rerun as rr

from inspector.live.samples import SinkError
from inspector.recording import unstable, viewer
from inspector.recording.run import writing
from inspector.recording.viewer import HOST, free_port

APPLICATION = "inspector-live"
"""Another than recordings of whole runs have: the viewer keeps a layout for each application."""
PORT = int(viewer.PORT)
ADDRESS = re.compile(r"(?:rerun\+http://)?(?:(?P<host>[^:/]+):)?(?P<port>\d{1,5})(?:/proxy)?")
START_TIMEOUT = 20.0
"""How long a viewer may take to start, in [s]."""
CONNECT_TIMEOUT = 2.0
"""Time within which a viewer has to respond, in [s]."""
SERVICE = "/rerun.sdk_comms.v1alpha1.MessageProxyService/Knock"
CHECK_INTERVAL = 1.0
"""Time between checks that the viewer is still there, in [s]."""
LATE = 10.0
"""How far behind the stream a viewer may be before it is sent no more, in [s]."""
FLUSH_TIMEOUT = 5.0
"""How long the last messages may take, in [s]."""
MEMORY = "2GB"
"""What a viewer that is opened here may keep; then it drops the oldest."""


class Sink:
    """A recording with its sinks: a file, which is whole once it is closed, a viewer, or both."""

    def __init__(
        self, save: Path | None = None, connect: str | None = None, *, overwrite: bool = False
    ) -> None:
        self.saved, self.gone = save is not None, False  # gone: there was a viewer
        self.late = 0.0  # how far it was behind at the last check, if more than `LATE`, in [s]
        self._address = (HOST, PORT)
        self._checked = time.monotonic()
        self._asked: float | None = None  # since when the viewer lacks what had been sent by then
        self._ended = Event()
        # Of one identity, but two: a viewer that is late or hangs would hold the file up.
        self._file = self._viewer = None
        identity = uuid.uuid4().hex
        places = []
        with ExitStack() as stack:
            if save is not None:
                file = writing(save, identity, application=APPLICATION, overwrite=overwrite)
                self._file = stack.enter_context(file)
                places.append(f"written to {save}")
            if connect is not None or save is None:
                host, port = self._address = _viewer(connect)
                self._viewer = rr.RecordingStream(APPLICATION, recording_id=identity)
                self._viewer.set_sinks(rr.GrpcSink(f"rerun+http://{host}:{port}/proxy"))
                places.append(f"shown by the viewer at {host}:{port}")
                Thread(target=self._follow, args=(self._viewer,), daemon=True).start()
            self._stack = stack.pop_all()
        self.where = " and ".join(places)
        self.recording: rr.RecordingStream = cast(Any, _Tee(self))

    @property
    def open(self) -> list[rr.RecordingStream]:
        """The sinks that take what is logged: a file does when its viewer is gone or late."""
        viewer = None if self.gone or self.late else self._viewer
        return [each for each in (self._file, viewer) if each is not None]

    @property
    def watched(self) -> bool:
        """Whether there is, or was, a viewer."""
        return self._viewer is not None

    @property
    def behind(self) -> float:
        """Since when the viewer has not taken all that it had been sent by then, in [s]."""
        asked = self._asked
        return 0.0 if asked is None else time.monotonic() - asked

    def check_viewer(self) -> bool:
        """Check once in a second that the viewer is there and keeps up."""
        if self._viewer is None or self.gone or time.monotonic() - self._checked < CHECK_INTERVAL:
            return False
        self._checked, behind = time.monotonic(), self.behind
        self.gone = not _listens(*self._address)
        self.late = behind if behind > LATE else 0.0
        return not (self.gone or self.late)

    def _follow(self, viewer: rr.RecordingStream) -> None:
        """Note since when the viewer is behind, until the recording ends."""
        while not self._ended.wait(CHECK_INTERVAL):
            self._asked = self._asked or time.monotonic()
            with suppress(RuntimeError):  # it takes longer, or is gone
                viewer.flush(timeout_sec=CHECK_INTERVAL)
                self._asked = None

    def discard(self) -> None:
        """End a recording in which there is nothing, and leave no file."""
        self._leave()
        with suppress(_Discarded), self._stack:
            raise _Discarded

    def close(self) -> bool:
        """Send what waits, and put the file in its place if it is whole."""
        taken = not (self.gone or self.late)
        if taken and self._viewer is not None:
            try:
                self._viewer.flush(timeout_sec=FLUSH_TIMEOUT)
            except RuntimeError:
                taken = False
        self._leave()
        self._stack.close()
        return taken

    def _leave(self) -> None:
        """Leave the viewer; of one that hangs or is late rerun waits without end."""
        self._ended.set()
        if self._viewer is not None:
            ending = Thread(target=self._viewer.disconnect, daemon=True)
            ending.start()
            ending.join(FLUSH_TIMEOUT)
            if ending.is_alive():
                unstable.abandon(self._viewer)


class _Tee:
    """Logs into every sink that is open, by the methods of a recording."""

    def __init__(self, sink: Sink) -> None:
        self._sink = sink

    def __getattr__(self, name: str) -> Callable[..., None]:
        def log(*args: Any, **options: Any) -> None:
            for each in self._sink.open:
                getattr(each, name)(*args, **options)

        return log


class _Discarded(Exception):  # noqa: N818
    """Leads out of the context in which a file is written."""


def _viewer(connect: str | None) -> tuple[str, int]:
    """Find a viewer, or open one."""
    host, port = (HOST, PORT) if connect is None else _parsed(connect)
    taken = _listens(host, port)
    if taken and _is_viewer(host, port):
        return host, port
    if connect is not None:
        state = "what listens there is no viewer of rerun" if taken else "nothing listens there"
        raise SinkError(
            f"no viewer at {host}:{port}, {state}; start one with"
            f" `rerun --bind {HOST} --port PORT`, or use --save FILE.rrd"
        )
    nowhere = "" if viewer.has_display() else "there is no display to open one on"
    if problem := nowhere or viewer.display_problem():
        raise SinkError(
            f"no viewer runs at {host}:{port}, and {problem};"
            " use --connect HOST:PORT or --save FILE.rrd"
        )
    return HOST, _opened(free_port() if taken else PORT)


def _parsed(address: str) -> tuple[str, int]:
    match = ADDRESS.fullmatch(address)
    if match is None or not 0 < int(match["port"]) < 65536:
        raise SinkError(
            f"{address!r} is no address of a viewer; expected PORT, HOST:PORT or"
            " rerun+http://HOST:PORT/proxy"
        )
    return match["host"] or HOST, int(match["port"])


def _listens(host: str, port: int) -> bool:
    try:
        socket.create_connection((host, port), timeout=CONNECT_TIMEOUT).close()
    except OSError:
        return False
    return True


def _is_viewer(host: str, port: int) -> bool:
    """Whether a gRPC server listens: one responds to an unknown service with a status.

    Rerun's client itself would wait forever for another server.
    """
    connection = HTTPConnection(host, port, timeout=CONNECT_TIMEOUT)
    try:
        connection.request("POST", SERVICE, headers={"content-type": "application/grpc-web+proto"})
        return connection.getresponse().getheader("grpc-status") is not None
    except (OSError, HTTPException):
        return False
    finally:
        connection.close()


def _opened(port: int) -> int:
    """Open a viewer on loopback."""
    start = ("--port", str(port), "--hide-welcome-screen", "--expect-data-soon")
    env = os.environ | {"RUST_LOG": "error"}
    with viewer.started(*start, "--memory-limit", MEMORY, env=env) as process:
        if process.listens(port, START_TIMEOUT):
            return port
        if problem := process.ended():
            raise SinkError(f"{problem}; use --save FILE.rrd")
        process.kill()
    raise SinkError(f"the viewer did not start within {START_TIMEOUT:g} s; use --save FILE.rrd")
