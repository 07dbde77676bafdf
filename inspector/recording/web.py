"""Serve a recording to browsers on this machine."""

import signal
import socket
import time
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from inspector.recording import viewer
from inspector.recording.viewer import HOST, ViewerError

START_TIMEOUT = 30.0
"""Time within which a server has to respond, in [s]."""


@dataclass(frozen=True)
class Served:
    """A recording that browsers on this machine can open.

    Attributes:
        url: Its address.
        server: The viewer that serves it.
    """

    url: str
    server: viewer.Process

    def wait(self) -> None:
        """Wait until the server ends, which it does not do by itself.

        Raises:
            ViewerError: If it ended all the same.
        """
        self.server.process.wait()
        raise ViewerError(self.server.ended())


def serve(recording: Path, announce: Callable[[str], None], *, port: int = 0) -> None:
    """Serve a recording on loopback, and open it, until the program is stopped.

    Args:
        recording: A ``*.rrd`` file.
        announce: Called with the address once it can be opened.
        port: Where browsers find it; 0 takes a free port.

    Raises:
        ViewerError: If the viewer is not installed, the port is taken, or the server ends.
    """
    for stop in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(stop, signal.default_int_handler)  # else the server would outlive us
    with suppress(KeyboardInterrupt), serving(recording, port=port) as served:
        announce(served.url)
        if viewer.has_display():
            webbrowser.open(served.url)
        served.wait()


@contextmanager
def serving(recording: Path, *, port: int = 0) -> Iterator[Served]:
    """Serve a recording on loopback, for as long as the block lasts.

    Args:
        recording: A ``*.rrd`` file.
        port: Where browsers find it; 0 takes a free port.

    Yields:
        The address.

    Raises:
        ViewerError: If the viewer is not installed, the port is taken, or the server ends.
    """
    data_port = free_port()
    page_port = free_port(port, other=data_port)
    ports = ("--port", str(data_port), "--web-viewer-port", str(page_port))
    with viewer.started("--serve-web", *ports, str(recording)) as server:
        try:
            for needed in (data_port, page_port):
                _wait_for(needed, server)
            data = quote(f"rerun+http://{HOST}:{data_port}/proxy", safe="")
            yield Served(f"http://{HOST}:{page_port}/?url={data}", server)
        finally:
            server.kill()


def free_port(wanted: int = 0, *, other: int = 0) -> int:
    """A port of loopback that no program listens on.

    Args:
        wanted: The port to take; any if 0.
        other: A port that is not to be returned.

    Raises:
        ViewerError: If ``wanted`` cannot be had.
    """
    with socket.socket() as probe:
        # What a server that has ended leaves behind for a minute does not count.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, wanted))
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise ViewerError(
                f"port {wanted} cannot be had ({reason}); name another, or none to take a free one"
            ) from error
        found: int = probe.getsockname()[1]
    return free_port(other=other) if found == other and not wanted else found


def _wait_for(port: int, server: viewer.Process) -> None:
    until = time.monotonic() + START_TIMEOUT
    while time.monotonic() < until:
        if problem := server.ended():
            raise ViewerError(problem)
        try:
            socket.create_connection((HOST, port), 0.2).close()
        except OSError:
            time.sleep(0.05)
        else:
            return
    raise ViewerError(
        f"the viewer does not respond on port {port}, {START_TIMEOUT:g} s after its start"
    )
