"""Take a picture of a recording without a display: python tests/picture.py run.rrd 2.0 out.png."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rerun.experimental import ViewerClient

DRIVERS = sorted(Path("/usr/share/vulkan/icd.d").glob("lvp_icd*.json"))
MISSING = "needs Debian's mesa-vulkan-drivers (rerun draws on software Vulkan)"
PATIENCE = 120.0


@contextmanager
def headless_viewer(size: str = "1440x900") -> Iterator[ViewerClient]:
    """Run rerun's viewer without a window, on loopback, and end it with all its children."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "rerun", "--headless", "--bind", "127.0.0.1"]
    command += ["--port", str(port), "--hide-welcome-screen", "--window-size", size]
    with tempfile.TemporaryDirectory() as home:
        environment = os.environ | {
            "HOME": home,
            "XDG_RUNTIME_DIR": home,
            "VK_DRIVER_FILES": str(DRIVERS[0]),
            "RUST_LOG": "error",
        }
        viewer = subprocess.Popen(
            command,
            env=environment,
            start_new_session=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            _wait_for(port, viewer)
            yield ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        finally:
            os.killpg(viewer.pid, signal.SIGKILL)
            viewer.wait()


def _wait_for(port: int, viewer: subprocess.Popen[bytes]) -> None:
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        if viewer.poll() is not None:
            raise RuntimeError(f"the viewer ended with status {viewer.returncode}")
        try:
            socket.create_connection(("127.0.0.1", port), 0.2).close()
        except OSError:
            time.sleep(0.1)
        else:
            return
    raise TimeoutError("the viewer does not answer")


def picture(client: ViewerClient, recording: Path, seconds: float) -> bytes:
    """Open a recording at a time and wait until nothing moves any more."""
    client.open(str(recording.resolve()))
    until = time.monotonic() + PATIENCE
    while client.get_state().loading and time.monotonic() < until:
        time.sleep(0.1)
    client.set_time("time", duration=seconds)
    frames: list[bytes] = []
    while time.monotonic() < until and not (len(frames) > 2 and frames[-1] == frames[-3]):
        time.sleep(0.3)
        try:
            frames.append(client.take_screenshot())
        except Exception as error:
            print("again:", error, file=sys.stderr)
    return frames[-1]


def settled(client: ViewerClient) -> Any:
    """Ask for the viewer's state; reports that go away while data arrives are no reports."""
    until = time.monotonic() + 20.0
    while True:
        state = client.get_state()
        if time.monotonic() > until or not any(view.reports for view in state.views):
            return state
        time.sleep(0.5)


def main() -> None:
    recording, seconds, output = sys.argv[1:4]
    if not DRIVERS:
        sys.exit(MISSING)
    with headless_viewer() as client:
        Path(output).write_bytes(picture(client, Path(recording), float(seconds)))


if __name__ == "__main__":
    main()
