"""The demo run and the models that ship."""

from collections.abc import Sequence
from pathlib import Path

from inspector.errors import InspectorError
from noisemodel.files import also_reading

HERE = Path(__file__).parent
FOLDERS = (HERE / "assets", HERE.parent / "assets", HERE.parent)
"""In an installed wheel, and in a checkout."""


def folder(kind: str) -> Path:
    """Find a folder of shipped files.

    Args:
        kind: "runs" or "models".
    """
    for place in FOLDERS:
        if any((place / kind).glob("*.npz")):
            return place / kind
    raise InspectorError(f"this installation lacks its {kind}; install noise-inspector again")


def demo_run() -> Path:
    """Name the run file that ships: a simulated Panda that touches a table unexpectedly."""
    return folder("runs") / "demo.npz"


def model_files(chosen: Sequence[Path] | None = None) -> tuple[Path, ...]:
    """Name model files: those that were chosen, or all that ship.

    Args:
        chosen: Model files, or names of models that ship; None or empty for all of these.
    """
    shipped = {path.stem: path for path in sorted(folder("models").glob("*.npz"))}
    found = []
    for path in chosen or shipped.values():
        known = shipped.get(str(path))
        if known is None and not path.exists():
            raise InspectorError(
                f"{path}: no such model; name a file, or one that ships: {', '.join(shipped)}"
            )
        found.append(path if path.exists() else shipped[str(path)])
    also_reading(found)
    return tuple(found)
