"""An annotated stretch of a run."""

from dataclasses import dataclass


@dataclass(frozen=True, order=True)
class Block:
    """A stretch of time with a label, which is opaque to the noise model.

    Attributes:
        start: Time of its first sample, in [s].
        stop: Time of its end, in [s].
        label: The class that an annotator or a simulator gave it.
    """

    start: float
    stop: float
    label: str
