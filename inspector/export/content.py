"""What is exported of a run: its noise, its labels, and the scores of each frame."""

from dataclasses import dataclass

import models
import noisemodel as nm
from inspector.analysis.inspection import robot_known
from inspector.analysis.level import estimate
from inspector.library import CannotTellError, Library, label_run
from noisemodel.types import Array


@dataclass(frozen=True, eq=False)
class Content:
    """The noise of a run, and what is heard in it; gaps are left out.

    Attributes:
        run: The run.
        time: Of each sample, shape (samples,), in [s].
        simplified: Simplified noise, shape (samples,), in [rad/s].
        extended: Sound power of all links, shape (samples,), in [W]; None without a robot.
        kind: How the extended noise was taken.
        labels: One for each frame; None where no model fits.
        model: Name of the model, empty without.
        remarks: What is missing and why, a sentence each.
    """

    run: nm.Run
    time: Array
    simplified: Array
    extended: Array | None
    kind: str
    labels: models.Labels | None
    model: str
    remarks: tuple[str, ...]

    @property
    def events(self) -> tuple[models.Event, ...]:
        """Findings: stretches that are not `ok`."""
        return self.labels.events() if self.labels else ()

    def __str__(self) -> str:
        """Say it in a line."""
        parts = [
            f"{len(self.time)} samples of noise{'' if self.extended is None else ' of two kinds'}",
            f"{len(self.labels) if self.labels else 0} frames",
            f"{len(self.events)} findings",
            f"{len(self.run.blocks)} annotated blocks",
        ]
        return ", ".join(parts)


def collect(run: nm.Run, library: Library, *, kind: str = "normal") -> Content:
    """Compute the noise of a run and label it.

    Args:
        run: The run.
        library: Models to choose from by rate.
        kind: Kind of the extended noise, see ``noisemodel.extended``.

    Returns:
        What there is; remarks say what is not.

    Raises:
        UnknownKindError: If there is no such kind.
        RobotError: If the run's robot cannot be read, or lacks one of its joints.
    """
    if kind not in nm.KINDS:
        raise nm.UnknownKindError(kind, tuple(nm.KINDS))
    remarks, labels, model = [], None, ""
    try:
        labelled = label_run(run, library)
    except (CannotTellError, models.SignalError, nm.RunError) as error:
        remarks.append(f"No labels: {error}.")
    else:
        labels, model = labelled.labels, labelled.model
        remarks += [labelled.remark] if labelled.remark else []
    extended = None
    if not robot_known(run) or run.position is None:
        remarks.append("No extended noise: that takes a robot and positions.")
    else:
        try:
            extended = estimate(run, kind).power.sum(axis=1)[run.mask]
        except nm.GeometryError as error:
            remarks.append(f"No extended noise: {error}.")
    return Content(
        run=run,
        time=run.time[run.mask],
        simplified=nm.simplified(run.motion, run.velocity_desired)[run.mask],
        extended=extended,
        kind=kind,
        labels=labels,
        model=model,
        remarks=tuple(remarks),
    )
