"""Ground truth of a simulation: events that may lead to failures."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Event:
    """An event that may lead to a failure.

    Attributes:
        start: When it began, in [s].
        stop: When its cause ended, in [s].
    """

    label: str
    cause: str
    start: float
    stop: float
    facts: Mapping[str, Any] = field(default_factory=dict)
