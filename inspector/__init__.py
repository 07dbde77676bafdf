"""Commands, recordings and reports for people; `analyse` and `read_log` for programs."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from inspector.analysis import Analysis, analyse  # type: ignore[no-redef,unused-ignore] # of a cycle
    from inspector.errors import Status, Unknown
    from inspector.library import load_library
    from inspector.live import LiveSession
    from inspector.logs.motion import Imported
    from inspector.logs.read import read_log, read_logs
    from inspector.reference.store import Reference

__all__ = [
    "Analysis",
    "Imported",
    "LiveSession",
    "Reference",
    "Status",
    "Unknown",
    "analyse",
    "load_library",
    "read_log",
    "read_logs",
]

_MODULES = {
    "Analysis": "inspector.analysis",
    "Imported": "inspector.logs.motion",
    "LiveSession": "inspector.live",
    "Reference": "inspector.reference.store",
    "Status": "inspector.errors",
    "Unknown": "inspector.errors",
    "analyse": "inspector.analysis",
    "load_library": "inspector.library",
    "read_log": "inspector.logs.read",
    "read_logs": "inspector.logs.read",
}


def __getattr__(name: str) -> Any:
    """Import a name on first use: `inspector --help` needs none of them, and they take long."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    """List the public names."""
    return __all__
