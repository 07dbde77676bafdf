"""Commands, recordings and reports for people; ``read_log`` and ``show`` for programs."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from inspector.live import LiveSession
    from inspector.logs.importing import Imported
    from inspector.logs.library import read_log, read_logs
    from inspector.recording.notebook import show

__all__ = ["Imported", "LiveSession", "read_log", "read_logs", "show"]

_HOMES = {
    "Imported": "inspector.logs.importing",
    "LiveSession": "inspector.live",
    "read_log": "inspector.logs.library",
    "read_logs": "inspector.logs.library",
    "show": "inspector.recording.notebook",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for: `inspector --help` needs none of it, and it takes long."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)
