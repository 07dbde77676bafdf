"""The sinks of a live recording: a file, a viewer that runs, or one that is opened for it."""

import os
import re
import socket
import time
from contextlib import ExitStack, suppress
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from threading import Thread

import rerun as rr

from inspector.live.samples import SinkError
from inspector.recording import viewer
from inspector.recording.run import require_whole
from inspector.recording.viewer import HOST, free_port
from noisemodel.files import replacing

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
FLUSH_TIMEOUT = 5.0
"""How long the last messages may take, in [s]."""
MEMORY = "2GB"
"""What a viewer that is opened here may keep; then it drops the oldest."""


class Sink:
    """A recording with its sinks.

    Args:
        save: File to write, whole when it is closed; None writes none.

    Attributes:
        recording: What to log into.
        where: Its sinks, in words.
        gone: Whether there was a viewer that is there no more.
    """

    def __init__(
        self, save: Path | None = None, connect: str | None = None, *, overwrite: bool = False
    ) -> None:
        self._address: tuple[str, int] | None = None
        self.gone = False
        self._temporary: Path | None = None
        self._file, self._checked = save is not None, time.monotonic()
        sinks: list[rr.GrpcSink | rr.FileSink] = []
        places = []
        with ExitStack() as stack:
            if save is not None:
                self._temporary = stack.enter_context(replacing(save, overwrite=overwrite))
                sinks.append(rr.FileSink(self._temporary))
                places.append(f"written to {save}")
            if connect is not None or save is None:
                host, port = self._address = _viewer(connect)
                sinks.append(rr.GrpcSink(f"rerun+http://{host}:{port}/proxy"))
                places.append(f"shown by the viewer at {host}:{port}")
            self._stack = stack.pop_all()
        self.where = " and ".join(places)
        self.recording = rr.RecordingStream(APPLICATION)
        self.recording.set_sinks(*sinks)

    @property
    def alive(self) -> bool:
        """Whether any sink takes what is logged: a file does when its viewer is gone."""
        return self._file or not self.gone

    @property
    def watched(self) -> bool:
        """Whether there is, or was, a viewer."""
        return self._address is not None

    def check_viewer(self) -> bool:
        """Check once in a second that the viewer is there."""
        if self._address is None or self.gone or time.monotonic() - self._checked < CHECK_INTERVAL:
            return False
        self._checked = time.monotonic()
        self.gone = not _listens(*self._address)
        return not self.gone

    def discard(self) -> None:
        """End a recording in which there is nothing, and leave no file."""
        with suppress(_Discarded), self._stack:
            self.recording.disconnect()
            raise _Discarded

    def close(self) -> bool:
        """Send what waits, and put the file in its place if it is whole."""
        taken = not self.gone
        with self._stack:
            try:
                if self.alive:
                    self.recording.flush(timeout_sec=FLUSH_TIMEOUT)
            except RuntimeError:  # it is gone, or hangs, or the file cannot be written
                taken = self._address is None
            # Rerun waits for a viewer that hangs, for good; we do not.
            ending = Thread(target=self.recording.disconnect, daemon=True)
            ending.start()
            ending.join(FLUSH_TIMEOUT)
            if self._temporary is not None and not ending.is_alive():
                require_whole(self._temporary)
        return taken


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
    if not viewer.has_display():
        raise SinkError(
            f"no viewer runs at {host}:{port}, and there is no display to open one on;"
            " use --connect HOST:PORT or --save FILE.rrd"
        )
    if problem := viewer.display_problem():
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
        until = time.monotonic() + START_TIMEOUT
        while time.monotonic() < until:
            if problem := process.ended():
                raise SinkError(f"{problem}; use --save FILE.rrd")
            if _listens(HOST, port):
                return port
            time.sleep(0.1)
        process.kill()
    raise SinkError(f"the viewer did not start within {START_TIMEOUT:g} s; use --save FILE.rrd")
