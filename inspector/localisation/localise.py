"""Where a failure comes from: stage of the control flow, band of frequencies, links."""

from collections.abc import Sequence
from dataclasses import dataclass

from inspector.localisation.band import band
from inspector.localisation.innovation import Usual, usual
from inspector.localisation.stage import First, first_stage
from models import Event
from noisemodel import Block, Run

ANNOTATED = 0.1
"""How long after the start of an annotation its failure may set in, in [s]."""
LEAST = 0.05
"""Joints with a smaller share are not told."""
SHARP = 10.0
"""A lag is told to a tenth of a millisecond up to this, in [ms]."""


@dataclass(frozen=True)
class Origin:
    """Where a failure comes from.

    Attributes:
        first: The stage of the control flow in which it shows first; None if no stage shows it,
            or if the run has the measured one alone.
        band: Lowest and highest frequency of its vibration, in [Hz]; None if nothing exceeds what
            is usual.
    """

    first: First | None
    band: tuple[float, float] | None

    @property
    def stage(self) -> str:
        """The stage and its lead, in words; empty if it is not known."""
        if self.first is None:
            return ""
        lag_ms = 1e3 * self.first.lag
        ahead = f"{lag_ms:.1f} ms" if 0.0 < lag_ms < SHARP else f"{lag_ms:.0f} ms"
        later = f", {ahead} before `{self.first.following}`" if lag_ms > 0.0 else ""
        return f"`{self.first.stage}`{later}"

    @property
    def joints(self) -> str:
        """The joints in which it is new at that stage, and their shares; empty if not known."""
        known = () if self.first is None else self.first.joints
        return ", ".join(f"{joint} {share:.0%}" for joint, share in known if share >= LEAST)

    @property
    def frequencies(self) -> str:
        """The band in words; empty if there is none."""
        if self.band is None:
            return ""
        low, high = (f"{frequency:.0f}" for frequency in self.band)
        return f"{low} Hz" if low == high else f"{low}-{high} Hz"


def origins(run: Run, found: Sequence[Event], *, frame: float = 0.0) -> dict[Event | Block, Origin]:
    """Tell where each failure of a run comes from.

    Args:
        run: The run.
        found: Its findings.
        frame: Duration of the frames that they consist of, in [s]: a finding may set in at any
            time of its first.

    Returns:
        The origin of each finding, and of each block that is annotated as a failure.
    """
    annotated = [block for block in run.blocks if block.label != "ok"]
    failures: list[Event | Block] = [*found, *annotated]
    if not failures:
        return {}
    known = usual(run, failures) if flows(run) else None
    reach = max(ANNOTATED, frame)
    return {
        failure: _origin(run, known, failure, failures, reach if failure in found else ANNOTATED)
        for failure in failures
    }


def flows(run: Run) -> bool:
    """Whether a run has a stage to compare the measured motion with."""
    return bool(run.stages) or run.velocity_desired is not None


def _origin(
    run: Run,
    known: Usual | None,
    failure: Event | Block,
    failures: Sequence[Event | Block],
    reach: float,
) -> Origin:
    first = None if known is None else first_stage(run, known, failure, reach=reach)
    return Origin(first, band(run, failure, failures))
