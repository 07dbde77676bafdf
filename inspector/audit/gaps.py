"""Missing stretches of a run."""

from dataclasses import dataclass

import numpy as np

from noisemodel import Run


@dataclass(frozen=True)
class Gaps:
    """What is missing of a run.

    Attributes:
        count: Gaps.
        total: All of their time, in [s].
        longest: That of the longest, in [s].
    """

    count: int = 0
    total: float = 0.0
    longest: float = 0.0

    def __str__(self) -> str:
        """Say it in a clause."""
        if not self.count:
            return "no gaps"
        plural = "" if self.count == 1 else "s"
        return (
            f"{self.count} gap{plural}, {self.total:.3g} s in all, {self.longest:.3g} s the longest"
        )


def gaps_of(run: Run) -> Gaps:
    """Count the stretches that a run marks as not valid.

    Args:
        run: The run.
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([True], run.mask, [True]))))
    lengths = np.diff(edges)[::2] / run.rate
    if not len(lengths):
        return Gaps()
    return Gaps(len(lengths), float(lengths.sum()), float(lengths.max()))
