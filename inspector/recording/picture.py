"""Take a picture of a recording without a display: rerun's headless viewer on software Vulkan."""

import os
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes.util import find_library
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inspector.errors import InspectorError, OptionError
from inspector.recording import viewer
from inspector.recording.viewer import HOST, ViewerError, free_port
from noisemodel.files import refuse_existing, replacing

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient


DRIVER_FOLDERS = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))
SIZE = (1440, 900)
"""Of the picture, in points; beyond, a software driver takes minutes."""
MAGIC = b"RRF2"
"""What rerun's recordings begin with."""
TIMEOUT = 120.0
"""How long the viewer may take to draw everything, in [s]."""
REPORTS_TIMEOUT = 20.0
"""Time after which a view's report is not due to data that is still arriving, in [s]."""


def missing_packages() -> tuple[str, ...]:
    """The system packages that pictures need and that are missing, by their names in Debian."""
    if not sys.platform.startswith("linux"):
        return ()  # others draw without Vulkan
    packages = [] if find_library("vulkan") else ["libvulkan1"]
    return (*packages, *([] if _drivers("*.json") else ["mesa-vulkan-drivers"]))


def require() -> None:
    """Refuse a picture before long work is done for it."""
    missing = missing_packages()
    if missing:
        raise ViewerError(
            "a picture takes a Vulkan driver;"
            f" `apt-get install {' '.join(missing)}` brings one (Fedora: mesa-vulkan-drivers)"
        )


def shoot(
    recording: Path,
    output: Path,
    seconds: float,
    *,
    size: tuple[int, int] = SIZE,
    overwrite: bool = False,
) -> tuple[str, ...]:
    """Take a picture of a recording.

    Args:
        seconds: Where the time cursor stands, in [s].
    """
    require()
    check_recording(recording)
    refuse_existing(output, overwrite=overwrite)
    with headless_viewer(size) as client:
        png = picture(client, recording, seconds)
        state = final_state(client)
    with replacing(output, overwrite=overwrite) as temporary:
        temporary.write_bytes(png)
    return tuple(str(report) for view in state.views for report in view.reports)


def check_recording(path: Path) -> None:
    """Refuse a file that is no recording: the viewer would draw a picture of its welcome."""
    try:
        with path.open("rb") as file:
            head = file.read(len(MAGIC))
    except OSError as error:
        raise InspectorError(f"{path}: cannot be read ({error.strerror})") from error
    if head != MAGIC:
        raise InspectorError(f"{path}: not a recording; name an .rrd file, or a run file (.npz)")


def parse_size(text: str) -> tuple[int, int]:
    """Read the size of a picture."""
    numbers = re.fullmatch(r"(\d{3,4})x(\d{3,4})", text)
    if numbers is None:
        raise OptionError(f"a size of {text!r}, expected width and height such as 1440x900")
    return int(numbers[1]), int(numbers[2])


@contextmanager
def headless_viewer(size: tuple[int, int] = SIZE) -> "Iterator[ViewerClient]":
    """Run rerun's viewer without a window, on loopback, and end it with all its children."""
    from inspector.recording import unstable

    port = free_port()
    start = ("--headless", "--port", str(port), "--hide-welcome-screen")
    window = ("--window-size", f"{size[0]}x{size[1]}")
    with (
        tempfile.TemporaryDirectory() as folder,
        viewer.started(*start, *window, env=_environment(folder)) as process,
    ):
        try:
            until = time.monotonic() + TIMEOUT
            while True:
                if problem := process.ended():
                    raise ViewerError(problem)
                try:
                    client = unstable.client(f"rerun+http://{HOST}:{port}/proxy")
                    client.get_state()
                    break
                except Exception as error:  # the client raises what it likes until the viewer is up
                    if time.monotonic() > until:
                        raise ViewerError(f"the viewer does not respond ({error})") from error
                    time.sleep(0.1)
            yield client
        finally:
            process.kill()


def picture(client: "ViewerClient", recording: Path, seconds: float) -> bytes:
    """Open a recording at a time and wait until nothing moves any more.

    Args:
        seconds: Where the time cursor stands, in [s].
    """
    client.open(str(recording.resolve()))
    until = time.monotonic() + TIMEOUT
    while client.get_state().loading and time.monotonic() < until:
        time.sleep(0.1)
    client.set_time("time", duration=seconds)
    frames: list[bytes] = []
    problem = ""
    # The first frames lack what is still arriving: a picture is done when it stays the same.
    while time.monotonic() < until and not (len(frames) > 2 and frames[-1] == frames[-3]):
        time.sleep(0.3)
        try:
            frames.append(client.take_screenshot())
        except Exception as error:  # a viewer under load misses its own deadlines: try again
            problem = str(error).partition("\n")[0]
    if not frames:
        raise ViewerError(f"the viewer draws nothing within {TIMEOUT:g} s ({problem})")
    return frames[-1]


def final_state(client: "ViewerClient") -> Any:
    """The viewer's state once its views report nothing, or after 20 s what they report then."""
    until = time.monotonic() + REPORTS_TIMEOUT
    while True:
        state = client.get_state()
        if time.monotonic() > until or not any(view.reports for view in state.views):
            return state
        time.sleep(0.5)


def _environment(folder: str) -> dict[str, str]:
    """Environment for the viewer: no settings of the user, software rendering if possible."""
    software = _drivers("lvp_icd*.json")
    driver = {"VK_DRIVER_FILES": str(software[0])} if software else {}
    return os.environ | {"HOME": folder, "XDG_RUNTIME_DIR": folder, "RUST_LOG": "error"} | driver


def _drivers(pattern: str) -> list[Path]:
    return sorted(path for folder in DRIVER_FOLDERS for path in folder.glob(pattern))
