"""Rerun's viewer below a notebook's cell; all that it takes is sent from this machine."""

import os
from contextlib import redirect_stdout
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import Any

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


def show(recording: Path, size: tuple[int | str, int]) -> None:
    """Show a recording below the cell that runs.

    Args:
        recording: A ``*.rrd`` file.
        size: Width, or ``"auto"`` for that of the cell, and height, in pixels.
    """
    width, height = size
    widget = viewer()(width=width, height=height)
    import_module("IPython.display").display(widget)
    widget.send_rrd(recording.read_bytes())


def viewer() -> Any:
    """Make the class of the widget.

    Returns:
        ``rerun_notebook.Viewer``, or what does as it does, if the viewer's code is sent along.
    """
    # Otherwise the widget fetches its code from app.rerun.io.
    os.environ.setdefault("RERUN_NOTEBOOK_ASSET", "inline")
    with redirect_stdout(StringIO()):  # it prints that it does so
        rerun = import_module("rerun_notebook")
    code = str(rerun.ESM_MOD)
    if code.startswith(("http://", "https://")):
        return rerun.Viewer
    sent = import_module("traitlets").Unicode(code).tag(sync=True)
    return type("Viewer", (rerun.Viewer,), {"_esm": LOADER, "_code": sent})
