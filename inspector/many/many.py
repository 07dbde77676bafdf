"""Several runs that are laid side by side, from their starts or by their clocks."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from inspector.analysis.analyse import Analysis, analyse
from inspector.levels import FLOOR_DB, velocity_levels
from inspector.library import Library
from inspector.logs.opening import Opened
from noisemodel import Block, Run
from noisemodel.types import Array


@dataclass(frozen=True, eq=False)
class Several:
    """Runs that are laid side by side.

    Attributes:
        names: What each is called; no two are alike.
        sides: Each with what was found in it, in the order in which they were given.
    """

    names: tuple[str, ...]
    sides: tuple[Analysis, ...]

    @cached_property
    def levels(self) -> tuple[tuple[Array, Array], ...]:
        """Of each run, starts of steps of 50 ms in [s], and levels above 10 Hz there.

        In [dB re 1 rad/s], each of shape (steps,); NaN in gaps.
        """
        found = []
        for side in self.sides:
            run, noise = side.run, side.noise[:, None]
            time, level = velocity_levels(noise, run.mask, run.rate, start=float(run.time[0]))
            found.append((time, level[:, 0]))
        return tuple(found)

    @cached_property
    def peaks(self) -> tuple[float, ...]:
        """Highest level of each run, in [dB re 1 rad/s]."""
        return tuple(float(np.nanmax(level, initial=FLOOR_DB)) for _, level in self.levels)

    @cached_property
    def order(self) -> tuple[int, ...]:
        """Indices of the runs, the worst first.

        The worst has findings for the longest time; among runs alike in that, the loudest counts.
        """
        return tuple(sorted(range(len(self.sides)), key=lambda i: (-self.found(i), -self.peaks[i])))

    def found(self, index: int) -> float:
        """How long a run has findings, in [s]."""
        return sum(event.stop - event.start for event in self.sides[index].findings)

    @property
    def worst(self) -> int | None:
        """Index of the run that is worst; None if none has a finding."""
        return self.order[0] if self.found(self.order[0]) > 0.0 else None


def lay(runs: Sequence[Opened], library: Library, *, from_start: bool = True) -> Several:
    """Lay runs side by side, and analyse each.

    Args:
        runs: The runs.
        library: Models to choose from by rate.
        from_start: Whether each starts at 0 s; or else its clock is taken as it is.

    Returns:
        The runs in their order.
    """
    shown = [opened.source.shown for opened in runs]
    unique = len({path.stem for path in shown}) == len(shown)
    names = [path.stem if unique else str(path) for path in shown]
    seen: dict[str, int] = {}
    for place, name in enumerate(names):
        seen[name] = seen.get(name, 0) + 1
        names[place] = name if seen[name] == 1 else f"{name} ({seen[name]})"
    sides = []
    for opened, name in zip(runs, names, strict=True):
        run = _from_start(opened.run) if from_start else opened.run
        found = analyse(run, library, name=name, sha256=opened.sha256)
        sides.append(replace(found, assumed=opened.assumed))
    return Several(tuple(names), tuple(sides))


def _from_start(run: Run) -> Run:
    start = float(run.time[0])
    blocks = tuple(Block(b.start - start, b.stop - start, b.label) for b in run.blocks)
    return replace(run, time=run.time - start, blocks=blocks)
