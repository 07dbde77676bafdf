"""Content of an export: a run's analysis, with its noise sample by sample."""

from dataclasses import dataclass

import noisemodel as nm
from inspector.analysis.analyse import Analysis, analyse, robot_known
from inspector.analysis.level import estimate
from inspector.audit import summary
from inspector.library import Library
from inspector.text import counted
from noisemodel.types import Array


@dataclass(frozen=True, eq=False)
class Content:
    """The noise and the analysis of a run; gaps are left out.

    Attributes:
        analysis: The run with what was found in it.
        time: Of each sample, shape (samples,), in [s].
        simplified: Simplified noise, shape (samples,), in [rad/s].
        extended: Sound power of all links, shape (samples,), in [W]; None without a robot.
        kind: Kind of the extended noise.
        remarks: What is missing and why, a sentence each.
    """

    analysis: Analysis
    time: Array
    simplified: Array
    extended: Array | None
    kind: str
    remarks: tuple[str, ...]

    def __str__(self) -> str:
        """The content in a line."""
        labels = self.analysis.labels
        parts = [
            f"{len(self.time)} samples of noise{'' if self.extended is None else ' of two kinds'}",
            counted(0 if labels is None else len(labels), "frame"),
            counted(len(self.analysis.findings), "finding"),
            counted(len(self.analysis.run.blocks), "annotated block"),
        ]
        return ", ".join(parts)


def collect(run: nm.Run, library: Library, *, kind: str = "normal") -> Content:
    """Analyse a run and compute its noise.

    Args:
        run: The run.
        library: Models to choose from by rate.
        kind: Kind of the extended noise, see ``noisemodel.extended``.

    Returns:
        What there is; remarks name what is not.

    Raises:
        UnknownKindError: If there is no such kind.
        RobotError: If the run's robot cannot be read, or lacks one of its joints.
    """
    if kind not in nm.KINDS:
        raise nm.UnknownKindError(kind, tuple(nm.KINDS))
    analysis = analyse(run, library)
    run, missing, extended = analysis.run, list(analysis.notes), None
    if analysis.audit is not None:
        missing += summary(analysis.audit, classes=False)
    if analysis.labels is None:
        missing.append(f"No labels: {analysis.reason}.")
    if not robot_known(run) or run.position is None:
        missing.append("No extended noise: that takes a robot and positions.")
    else:
        try:
            extended = estimate(run, kind).power.sum(axis=1)[run.mask]
        except nm.GeometryError as error:
            missing.append(f"No extended noise: {error}.")
    return Content(
        analysis=analysis,
        time=run.time[run.mask],
        simplified=analysis.noise[run.mask],
        extended=extended,
        kind=kind,
        remarks=tuple(missing),
    )
