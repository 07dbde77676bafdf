"""Show a run from Python: in a notebook's cell, else in a window."""

import os
import sys
import tempfile
from contextlib import redirect_stdout
from importlib import import_module
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from typing import Any

import noisemodel as nm
from inspector.recording.viewer import DisplayError, ViewerError

SIZE = ("auto", 760)
"""Width and height of a notebook's viewer, in pixels; it is as wide as its cell."""
LOADER = """
export default {
  async render({ model, el }) {
    const code = new Blob([model.get("_code")], { type: "text/javascript" });
    const url = URL.createObjectURL(code);
    const { default: viewer } = await import(url);
    URL.revokeObjectURL(url);
    return viewer.render({ model, el });
  },
};
"""
"""Begins the viewer's code, which is 23 MB long. If that were the widget's own code, and took more
than two seconds to begin, anywidget (0.11) would forget what is sent to the widget: size, data.
"""


def show(
    run: nm.Run | str | Path,
    *,
    robot: bool = True,
    kind: str = "normal",
    size: tuple[int | str, int] = SIZE,
) -> None:
    """Show a run in rerun's viewer: joints, noise, spectrogram, classes, the moving robot.

    In a notebook the viewer appears below the cell, after some seconds: all of it, 23 MB, is sent
    by the kernel's machine, unless ``RERUN_NOTEBOOK_ASSET`` is set, which is rerun's. From plain
    Python a window opens, which stays when the program ends.

    Args:
        run: A run, or a run file.
        robot: Whether to draw the robot.
        kind: Kind of the extended noise.
        size: Width and height of a notebook's viewer, in pixels; ``"auto"`` is as wide as the cell.

    Raises:
        ViewerError: If there is neither a notebook nor a display, or the viewer is not installed.
        InspectorError: If the robot's shape cannot be had.
        NoiseModelError: If the run cannot be read, or its robot.
    """
    from inspector.recording import viewer

    inside = in_notebook()
    if inside and find_spec("rerun_notebook") is None:
        raise ViewerError(
            'a notebook takes rerun\'s widget; `pip install "rerun-sdk[notebook]"` brings it'
        )
    if inside:
        with tempfile.TemporaryDirectory() as folder:
            show_recording(_recorded(run, Path(folder) / "run.rrd", robot=robot, kind=kind), size)
        return
    recording = viewer.scratch_path(Path("shown.npz") if isinstance(run, nm.Run) else Path(run))
    _recorded(run, recording, robot=robot, kind=kind)
    if not viewer.has_display():
        raise ViewerError(
            f"there is no display; the recording is in {recording},"
            f" `inspector view --web` shows a run file in a browser"
        )
    problem = viewer.open_window(recording)
    if problem:
        raise DisplayError(f"{problem}; the recording is in {recording}")


def in_notebook() -> bool:
    """Whether this runs in a kernel that shows widgets, as Jupyter's does."""
    loaded = sys.modules.get("IPython")
    return loaded is not None and hasattr(loaded.get_ipython(), "kernel")


def show_recording(recording: Path, size: tuple[int | str, int]) -> None:
    """Show a recording below the cell that runs."""
    width, height = size
    widget = widget_class()(width=width, height=height)
    import_module("IPython.display").display(widget)
    widget.send_rrd(recording.read_bytes())


def widget_class() -> Any:
    """The class of a widget whose data all come from this machine."""
    # Otherwise the widget fetches its code from app.rerun.io.
    os.environ.setdefault("RERUN_NOTEBOOK_ASSET", "inline")
    with redirect_stdout(StringIO()):  # it prints that it does so
        rerun = import_module("rerun_notebook")
    code = str(rerun.ESM_MOD)
    if code.startswith(("http://", "https://")):
        return rerun.Viewer
    sent = import_module("traitlets").Unicode(code).tag(sync=True)
    return type("Viewer", (rerun.Viewer,), {"_esm": LOADER, "_code": sent})


def _recorded(run: nm.Run | str | Path, recording: Path, *, robot: bool, kind: str) -> Path:
    from inspector.analysis import analyse_file
    from inspector.export.sound import of_recording
    from inspector.library import load_library
    from inspector.recording.run import write

    library = load_library()
    with tempfile.TemporaryDirectory() as folder:
        path = run if not isinstance(run, nm.Run) else Path(folder) / "run.npz"
        if isinstance(run, nm.Run):
            run.save(path)
        found = analyse_file(Path(path), library, links=robot, kind=kind)
        write(found, recording, overwrite=True, sound=of_recording(found))
    return recording
