"""Rerun's viewer: a recording in a window, a browser or a picture."""

import hashlib
import os
import re
import shlex
import shutil
import signal
import socket
import socketserver
import subprocess
import sys
import tempfile
import time
import webbrowser
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from ctypes.util import find_library
from dataclasses import dataclass
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler
from importlib.util import find_spec
from pathlib import Path
from threading import Thread
from typing import IO, TYPE_CHECKING, TypeVar
from urllib.parse import quote

import noisemodel as nm
from inspector.errors import InspectorError
from noisemodel.files import replacing

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient


SETTLE = 2.0  # time within which a viewer that listens and cannot open its window ends, in [s]
START_TIMEOUT = 20.0  # time within which a viewer listens, in [s]
CONNECT_TIMEOUT = 2.0  # time within which a program that listens has to respond, in [s]
PORT = "9876"  # where rerun's viewer listens; one that does already takes the recording over
HOST = "127.0.0.1"
# Rerun's viewer sends no usage data if ``CI`` is set, unless ``FORCE_RERUN_ANALYTICS=1`` is. It has
# no option for it; ``rerun analytics disable`` would change the user's own settings.
NO_ANALYTICS = {"CI": "true"}
MAX_SCRATCH_FILES = 20  # recordings without a name that are kept, the newest
T = TypeVar("T")


class ViewerError(InspectorError):
    """A viewer that is missing, cannot start, or does not respond."""


class DisplayError(ViewerError):
    """A display on which no window can be opened."""


def has_display() -> bool:
    """Whether a window can be opened here."""
    if sys.platform.startswith(("darwin", "win")):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def listens(host: str, port: int) -> bool:
    """Whether a program listens on a port."""
    try:
        socket.create_connection((host, port), CONNECT_TIMEOUT).close()
    except OSError:
        return False
    return True


def until(holds: Callable[[], T], seconds: float, step: float = 0.1) -> T:
    """Ask every so often until something holds or time is over, both in [s]; the last answer."""
    end = time.monotonic() + seconds
    while not (found := holds()) and time.monotonic() < end:
        time.sleep(step)
    return found


def scratch_path(run: Path) -> Path:
    """The file for a recording without a name: the same run replaces its own."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = cache / "noise-inspector" / "recordings"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        why = f"{folder}: cannot be made a folder ({error.strerror})"
        raise nm.OutputError(f"{why}; name the recording with -o FILE.rrd") from error
    found = {}
    for path in folder.glob("*.rrd"):
        with suppress(OSError):  # another process may have been quicker
            found[path] = path.stat().st_mtime
    newest = sorted(found, key=lambda path: found[path], reverse=True)
    for path in newest[MAX_SCRATCH_FILES - 1 :]:  # there is one to come
        with suppress(OSError):
            path.unlink()
    key = hashlib.sha256(os.fsencode(run.resolve())).hexdigest()[:8]
    return folder / f"{run.stem}-{key}.rrd"


def command(*arguments: str) -> list[str]:
    """The command line of rerun's viewer; it listens on loopback only."""
    if find_spec("rerun_cli") is None:
        raise ViewerError("rerun's viewer is missing; `pip install rerun-sdk` brings it")
    return [sys.executable, "-m", "rerun", "--bind", HOST, *arguments]


@dataclass(frozen=True)
class Process:
    """A viewer that was started, in a session of its own."""

    process: "subprocess.Popen[bytes]"
    stderr: IO[bytes]

    def ended(self) -> str:
        """How it ended, in a line; nothing while it runs."""
        code = self.process.poll()
        if code is None:
            return ""
        self.stderr.seek(0)
        text = re.sub(r"\x1b\[[0-9;]*m", "", self.stderr.read().decode(errors="replace"))
        errors = [line for line in text.splitlines() if re.search(r"\b(Error|ERROR|WARN)\b", line)]
        reason = re.sub(r"^.*?(Error|ERROR|WARN)[: ]+", "", errors[-1]).strip() if errors else ""
        if re.search(r"winit|X server|wayland", reason, re.IGNORECASE):
            reason = f"no window can be opened on this display: {reason.rpartition(': ')[2]}"
        return f"the viewer ended with status {code}{reason and f' ({reason})'}"

    def listens(self, port: int, seconds: float) -> bool:
        """Wait until a program listens on a port, unless this one ends or it takes too long."""
        until(lambda: self.process.poll() is not None or listens(HOST, port), seconds, 0.05)
        return listens(HOST, port)

    def wait(self) -> None:
        """Wait until it ends, which a server does not do by itself."""
        self.process.wait()
        raise ViewerError(self.ended())

    def kill(self) -> None:
        """End it with all its children."""
        # `rerun` is a script that starts the viewer: ending it alone leaves that, and its port.
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        # The viewer itself is no child of ours to wait for; its ports are free once it is gone.
        with suppress(ProcessLookupError):
            until(lambda: os.killpg(self.process.pid, 0), SETTLE, 0.02)


@contextmanager
def started(*arguments: str, env: Mapping[str, str] | None = None) -> Iterator[Process]:
    """Start a viewer, whose stderr can be read for as long as the block lasts.

    It does not end with the block, nor by Ctrl-C, and it sends no usage data.
    """
    given = NO_ANALYTICS | dict(os.environ if env is None else env)
    with tempfile.TemporaryFile() as stderr:
        process = subprocess.Popen(
            command(*arguments),
            env=given,
            start_new_session=True,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=stderr,
        )
        yield Process(process, stderr)


def open_window(recording: Path) -> str:
    """Show a recording in the viewer that runs, or a new one; why no window opened, if none did."""
    # If a program listens where viewers do that is none, another port is taken.
    return launch(PORT, str(recording)) and launch("auto", str(recording))


def launch(port: str, *arguments: str) -> str:
    """Start a viewer that opens a window, if none listens on the port; why it ended, if it did."""
    taken = port.isdigit() and listens(HOST, int(port))
    with started("--port", port, "--hide-welcome-screen", *arguments) as viewer:
        # It listens before it opens its window; if another one does already, it only passes on.
        if port.isdigit() and not taken:
            viewer.listens(int(port), START_TIMEOUT)
        try:
            code = viewer.process.wait(timeout=SETTLE + START_TIMEOUT * taken)
        except subprocess.TimeoutExpired:
            return ""
        return "" if code == 0 else viewer.ended()


def how_to_open(recording: Path) -> str:
    """How a recording is opened, in the viewer and in a browser."""
    path = shlex.quote(str(recording))
    rerun = shlex.quote(str(Path(sys.executable).with_name("rerun")))
    browser = "or in a browser:        inspector view RUN --web"
    return f"open it in the viewer:  {rerun} {path}\n{browser}"


SERVE_TIMEOUT = 30.0  # time within which a server has to respond, in [s]


def serve(recording: Path, announce: Callable[[str], None], *, port: int = 0) -> None:
    """Serve a recording on loopback, and open it, until the program is stopped."""
    for stop in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(stop, signal.default_int_handler)  # else the server would outlive us
    with suppress(KeyboardInterrupt), serving(recording, port=port) as (url, server):
        announce(url)
        if has_display():
            webbrowser.open(url)
        server.wait()


@contextmanager
def serving(recording: Path, *, port: int = 0) -> Iterator[tuple[str, Process]]:
    """Serve a recording on loopback for as long as the block lasts; its address, and the server.

    Rerun's own server answers whatever host a browser asks for. A page from elsewhere whose name is
    made to point to this machine (DNS rebinding) could read a recording from it. So rerun serves
    the empty viewer only, and the recording comes from here, to those who ask for this host.
    """
    with _Server((HOST, free_port(port)), _Relay) as server, ExitStack() as ending:
        taken = server.server_address[1]
        page, other = (free_port(other=taken) for _ in range(2))
        ports = ("--web-viewer-port", str(page), "--port", str(other))
        viewer = ending.enter_context(started("--serve-web", *ports))
        ending.callback(viewer.kill)
        if not viewer.listens(page, SERVE_TIMEOUT):
            silent = f"the viewer does not respond on port {page}"
            raise ViewerError(viewer.ended() or f"{silent}, {SERVE_TIMEOUT:g} s after its start")
        server.recording, server.page = recording, page
        server.hosts = {f"{name}:{taken}" for name in (HOST, "localhost")}
        Thread(target=server.serve_forever, daemon=True).start()
        ending.callback(server.shutdown)
        address = f"http://{HOST}:{taken}"
        yield f"{address}/?url={quote(address + RECORDING, safe='')}", viewer


RECORDING = "/recording.rrd"


class _Server(socketserver.ThreadingTCPServer):
    allow_reuse_address = daemon_threads = True
    recording: Path
    page: int  # port of the viewer's page
    hosts: Collection[str]  # that are answered


class _Relay(BaseHTTPRequestHandler):
    """Hands out the recording, and the viewer's page."""

    server: _Server

    def do_GET(self) -> None:  # as the base class names it
        """Answer a request."""
        if self.headers.get("Host") not in self.server.hosts:
            self.send_error(403, "this host is not served")
            return
        if self.path.partition("?")[0] == RECORDING:
            with self.server.recording.open("rb") as file:
                size = os.fstat(file.fileno()).st_size
                kind = "application/octet-stream"
                self._head(200, {"Content-Type": kind, "Content-Length": size})
                shutil.copyfileobj(file, self.wfile)
            return
        connection = HTTPConnection(HOST, self.server.page, timeout=SERVE_TIMEOUT)
        with closing(connection) as upstream:
            accepted = {"Accept-Encoding": self.headers.get("Accept-Encoding", "identity")}
            upstream.request("GET", self.path, headers=accepted)
            answer = upstream.getresponse()
            kept = ("Content-Type", "Content-Encoding", "Content-Length")
            self._head(answer.status, {name: answer.getheader(name) for name in kept})
            shutil.copyfileobj(answer, self.wfile)

    def _head(self, status: int, headers: Mapping[str, object]) -> None:
        self.send_response(status)
        for name, value in headers.items():
            if value is not None:
                self.send_header(name, str(value))
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """Say nothing."""


def free_port(wanted: int = 0, *, other: int = 0) -> int:
    """A port of loopback that no program listens on."""
    with socket.socket() as probe:
        # What a server that has ended leaves behind for a minute does not count.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, wanted))
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            advice = "name another, or none to take a free one"
            raise ViewerError(f"port {wanted} cannot be had ({reason}); {advice}") from error
        found: int = probe.getsockname()[1]
    return free_port(other=other) if found == other and not wanted else found


DRIVER_FOLDERS = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))
WINDOW = (1440, 900)  # of the picture, in points; beyond, a software driver takes minutes
TIMEOUT = 120.0  # how long the viewer may take to draw everything, in [s]


def has_driver() -> bool:
    """Whether pictures can be drawn here: on Linux by Vulkan, elsewhere without."""
    return not sys.platform.startswith("linux") or bool(find_library("vulkan") and _drivers("*"))


def require_driver() -> None:
    """Refuse a picture before long work is done for it."""
    if not has_driver():
        command = "`apt-get install libvulkan1 mesa-vulkan-drivers`"
        brings = f"{command} brings one (Fedora: mesa-vulkan-drivers)"
        raise ViewerError(f"a picture takes a Vulkan driver; {brings}")


def shoot(recording: Path, output: Path, seconds: float, *, overwrite: bool = False) -> None:
    """Take a picture of a recording at a time, in [s]."""
    require_driver()
    with headless_viewer() as client:
        png = picture(client, recording, seconds)
    with replacing(output, overwrite=overwrite) as temporary:
        temporary.write_bytes(png)


@contextmanager
def headless_viewer() -> "Iterator[ViewerClient]":
    """Run rerun's viewer without a window, on loopback, and end it with all its children."""
    from rerun.experimental import ViewerClient

    port = free_port()
    start = ("--headless", "--port", str(port), "--hide-welcome-screen")
    window = ("--window-size", f"{WINDOW[0]}x{WINDOW[1]}")
    with tempfile.TemporaryDirectory() as folder, ExitStack() as ending:
        # Without settings of the user, and by a software driver if there is one.
        env = {"HOME": folder, "XDG_RUNTIME_DIR": folder, "RUST_LOG": "error"}
        if software := _drivers("lvp_icd*"):
            env["VK_DRIVER_FILES"] = str(software[0])
        process = ending.enter_context(started(*start, *window, env=os.environ | env))
        ending.callback(process.kill)

        def connected() -> "ViewerClient | None":
            if problem := process.ended():
                raise ViewerError(problem)
            with suppress(Exception):  # the client raises what it likes until the viewer is up
                client = ViewerClient.connect(f"rerun+http://{HOST}:{port}/proxy")
                client.get_state()
                return client
            return None

        client = until(connected, TIMEOUT)
        if client is None:
            raise ViewerError(f"the viewer does not respond within {TIMEOUT:g} s")
        yield client


def picture(client: "ViewerClient", recording: Path, seconds: float) -> bytes:
    """Open a recording at a time, in [s], and wait until nothing moves any more."""
    client.open(str(recording.resolve()))
    end = time.monotonic() + TIMEOUT
    until(lambda: not client.get_state().loading, TIMEOUT)
    client.set_time("time", duration=seconds)
    frames: list[bytes] = []

    def unchanged() -> bool:
        with suppress(Exception):  # a viewer under load misses its own deadlines: try again
            frames.append(client.take_screenshot())
        return len(frames) > 2 and frames[-1] == frames[-3]

    # The first frames lack what is still arriving: a picture is done when it stays the same.
    until(unchanged, end - time.monotonic(), 0.3)
    if not frames:
        raise ViewerError(f"the viewer draws nothing within {TIMEOUT:g} s")
    return frames[-1]


def _drivers(pattern: str) -> list[Path]:
    return sorted(path for folder in DRIVER_FOLDERS for path in folder.glob(f"{pattern}.json"))
