"""Open a recording in rerun's viewer, or say how to."""

import hashlib
import os
import shlex
import subprocess
import sys
from pathlib import Path

SETTLE = 2.0
"""How long a viewer that cannot start takes to say so, in [s]."""


def has_display() -> bool:
    """Whether a window can be opened here."""
    if sys.platform.startswith(("darwin", "win")):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def scratch_path(run: Path) -> Path:
    """Name the file for a recording that nobody named: the same run replaces its own.

    Args:
        run: The run file that is viewed.
    """
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = cache / "noise-inspector" / "recordings"
    folder.mkdir(parents=True, exist_ok=True)
    key = hashlib.sha256(str(run.resolve()).encode()).hexdigest()[:8]
    return folder / f"{run.stem}-{key}.rrd"


def open_window(recording: Path) -> str:
    """Start rerun's viewer on a recording, without waiting for it to end.

    Args:
        recording: A ``*.rrd`` file.

    Returns:
        What went wrong, or nothing.
    """
    command = [sys.executable, "-m", "rerun", "--bind", "127.0.0.1", "--port", "auto"]
    command += ["--hide-welcome-screen", str(recording)]
    viewer = subprocess.Popen(
        command,
        start_new_session=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        code = viewer.wait(timeout=SETTLE)
    except subprocess.TimeoutExpired:
        return ""
    return "" if code == 0 else f"the viewer ended with status {code}"


def how_to_open(recording: Path) -> str:
    """Say how a recording is opened, in the viewer and in a browser."""
    path = shlex.quote(str(recording))
    rerun = shlex.quote(str(Path(sys.executable).with_name("rerun")))
    return (
        f"open it in the viewer:  {rerun} {path}\n"
        f"or in a browser:        {rerun} --serve-web --bind 127.0.0.1 {path}"
    )
