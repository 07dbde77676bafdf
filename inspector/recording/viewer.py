"""Rerun's viewer: start it, open a recording in it, or explain how to."""

import hashlib
import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import IO

from inspector.errors import InspectorError

SETTLE = 2.0
"""Time within which a viewer that cannot start ends, in [s]."""
PORT = "9876"
"""Where rerun's viewer listens; one that does already takes the recording over."""
HOST = "127.0.0.1"
NO_ANALYTICS = {"CI": "true"}
"""Rerun's viewer sends no usage data if ``CI`` is set, unless ``FORCE_RERUN_ANALYTICS=1`` is.

It has no option for it; ``rerun analytics disable`` would change the user's own settings.
"""
MAX_SCRATCH_FILES = 20
"""Recordings without a name that are kept, the newest."""
MAX_SCRATCH_BYTES = 1_000_000_000
"""What they may take together."""


class ViewerError(InspectorError):
    """A viewer that is missing, cannot start, or does not respond."""


def has_display() -> bool:
    """Whether a window can be opened here."""
    if sys.platform.startswith(("darwin", "win")):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def scratch_path(run: Path) -> Path:
    """The file for a recording without a name: the same run replaces its own.

    The oldest of such files are deleted where there are too many.

    Args:
        run: The run file that is viewed.
    """
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = cache / "noise-inspector" / "recordings"
    folder.mkdir(parents=True, exist_ok=True)
    _make_room(folder)
    key = hashlib.sha256(str(run.resolve()).encode()).hexdigest()[:8]
    return folder / f"{run.stem}-{key}.rrd"


def _make_room(folder: Path) -> None:
    """Delete recordings beyond the newest, leaving a place for one more."""
    found = {}
    for path in folder.glob("*.rrd"):
        with suppress(OSError):  # another process may have been quicker
            found[path] = path.stat()
    newest = sorted(found, key=lambda path: found[path].st_mtime, reverse=True)
    taken = 0
    for place, path in enumerate(newest, start=1):
        taken += found[path].st_size
        if place >= MAX_SCRATCH_FILES or taken > MAX_SCRATCH_BYTES:
            with suppress(OSError):
                path.unlink()


def command(*arguments: str) -> list[str]:
    """The command line of rerun's viewer; it listens on loopback only.

    Args:
        arguments: Options beyond that.

    Raises:
        ViewerError: If the viewer is not installed.
    """
    if find_spec("rerun_cli") is None:
        raise ViewerError("rerun's viewer is missing; `pip install rerun-sdk` brings it")
    return [sys.executable, "-m", "rerun", "--bind", HOST, *arguments]


@dataclass(frozen=True)
class Process:
    """A viewer that was started.

    Attributes:
        process: In a session of its own.
        stderr: What it writes there.
    """

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
        return f"the viewer ended with status {code}{reason and f' ({reason})'}"

    def kill(self) -> None:
        """End it with all its children."""
        # `rerun` is a script that starts the viewer: ending it alone leaves that, and its port.
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        # The viewer itself is no child of ours to wait for; its ports are free once it is gone.
        until = time.monotonic() + SETTLE
        with suppress(ProcessLookupError):
            while time.monotonic() < until:
                os.killpg(self.process.pid, 0)
                time.sleep(0.02)


@contextmanager
def started(*arguments: str, env: Mapping[str, str] | None = None) -> Iterator[Process]:
    """Start a viewer, whose stderr can be read for as long as the block lasts.

    It does not end with the block, nor by Ctrl-C, and it sends no usage data.

    Args:
        arguments: Options.
        env: Environment; by default that of this process.

    Yields:
        The viewer.

    Raises:
        ViewerError: If the viewer is not installed.
    """
    with tempfile.TemporaryFile() as stderr:
        process = subprocess.Popen(
            command(*arguments),
            env=NO_ANALYTICS | dict(os.environ if env is None else env),
            start_new_session=True,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=stderr,
        )
        yield Process(process, stderr)


def open_window(recording: Path, seconds: float | None = None) -> str:
    """Show a recording in the viewer that runs, or start one and do not wait for it to end.

    Args:
        recording: A ``*.rrd`` file.
        seconds: Where the time cursor is put, in [s], if nothing else takes the viewer's port; a
            layout cannot say that.

    Returns:
        The error, empty if there is none.

    Raises:
        ViewerError: If the viewer is not installed.
    """
    if not _started(recording, PORT):
        if seconds is not None:
            _put_cursor(f"rerun+http://{HOST}:{PORT}/proxy", seconds)
        return ""
    return _started(recording, "auto")  # another program listens where viewers do


def _put_cursor(address: str, seconds: float) -> None:
    """Put the time cursor of a viewer somewhere, once it has a recording; else leave it."""
    from inspector.recording import unstable

    until = time.monotonic() + SETTLE
    while time.monotonic() < until:
        with suppress(Exception):  # the client raises what it likes until the viewer is up
            client = unstable.client(address)
            state = client.get_state()
            if state.recordings and not state.loading:
                client.set_time("time", duration=seconds)
                return
        time.sleep(0.1)


def _started(recording: Path, port: str) -> str:
    with started("--port", port, "--hide-welcome-screen", str(recording)) as viewer:
        try:
            code = viewer.process.wait(timeout=SETTLE)
        except subprocess.TimeoutExpired:
            return ""
        return "" if code == 0 else viewer.ended()


def how_to_open(recording: Path) -> str:
    """How a recording is opened, in the viewer and in a browser."""
    path = shlex.quote(str(recording))
    rerun = shlex.quote(str(Path(sys.executable).with_name("rerun")))
    return (
        f"open it in the viewer:  {rerun} {path}\n"
        f"or in a browser:        {rerun} --serve-web --bind {HOST} {path}"
    )
