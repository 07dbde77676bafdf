"""Localisation of the failures of a run: stage of the control flow, joints, frequency band."""

from collections.abc import Sequence
from dataclasses import replace

from inspector.localisation.band import band
from inspector.localisation.innovation import quiet_statistics
from inspector.localisation.stage import Localisation, first_stage
from noiseclassifier import Event
from noisemodel import Block, Run

__all__ = ["Localisation", "has_stages", "localise"]

ANNOTATED = 0.1
"""How long after the start of an annotation its failure may set in, in [s]."""


def localise(
    run: Run, found: Sequence[Event], *, frame: float = 0.0
) -> dict[Event | Block, Localisation]:
    """Localise each failure of a run.

    Args:
        frame: Duration of the frames that they consist of, in [s]: a finding may set in at any
            time of its first.
    """
    annotated = [block for block in run.blocks if block.label != "ok"]
    failures: list[Event | Block] = [*found, *annotated]
    if not failures:
        return {}
    quiet = quiet_statistics(run, failures) if has_stages(run) else None
    reach = max(ANNOTATED, frame)

    def one(failure: Event | Block) -> Localisation:
        latest = reach if failure in found else ANNOTATED
        stage = Localisation() if quiet is None else first_stage(run, quiet, failure, reach=latest)
        return replace(stage, band=band(run, failure, failures))

    return {failure: one(failure) for failure in failures}


def has_stages(run: Run) -> bool:
    """Whether a run has a stage to compare the measured motion with."""
    return bool(run.stages) or run.velocity_desired is not None
