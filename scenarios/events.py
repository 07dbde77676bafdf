"""What a simulator knows to have gone wrong."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Event:
    """Something that the simulator knows to have gone wrong.

    Attributes:
        label: The class of failure that it may lead to.
        cause: What happened, in a few words.
        start: When it began, in [s].
        stop: When its cause had gone, in [s].
        facts: What else is known of it, in SI units.
    """

    label: str
    cause: str
    start: float
    stop: float
    facts: Mapping[str, Any] = field(default_factory=dict)
