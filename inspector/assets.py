"""The demo run and the models that ship."""

from pathlib import Path

from inspector.errors import InspectorError

HERE = Path(__file__).parent
FOLDERS = (HERE / "assets", HERE.parent / "assets")
"""In an installed wheel, and in a checkout."""


def folder(kind: str) -> Path:
    """Find a folder of shipped files.

    Args:
        kind: "runs" or "models".

    Raises:
        InspectorError: If the installation lacks it.
    """
    for place in FOLDERS:
        if (place / kind).is_dir():
            return place / kind
    raise InspectorError(f"this installation lacks its {kind}; install noise-inspector again")


def demo_run() -> Path:
    """Name the run file that ships: a simulated Panda that touches a table unexpectedly."""
    return folder("runs") / "demo.npz"


def model_files() -> tuple[Path, ...]:
    """Name the model files that ship."""
    return tuple(sorted(folder("models").glob("*.npz")))
