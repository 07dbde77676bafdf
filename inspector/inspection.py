"""One run, looked at: its noise, its labels, and what could not be said."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import models
import noisemodel as nm
from inspector.labelling import CannotTellError, Library, label_run
from noisemodel.types import Array


@dataclass(frozen=True)
class Inspection:
    """A run with what was found in it.

    Attributes:
        name: What the run is called.
        sha256: Hash of the file that it came from.
        run: The run.
        noise: Simplified noise, shape (samples,), in [rad/s].
        labels: One label per frame; None where no model fits.
        model: Name of the model that labelled, empty without.
        events: Findings: stretches that are not ``ok``.
        remarks: What is missing and why, a sentence each.
    """

    name: str
    sha256: str
    run: nm.Run
    noise: Array
    labels: models.Labels | None
    model: str
    events: tuple[models.Event, ...]
    remarks: tuple[str, ...]

    @property
    def has_robot(self) -> bool:
        """Whether there is a robot to draw, and motion to move it by."""
        return _robot_known(self.run) and self.run.position is not None


def inspect(path: Path, library: Library) -> Inspection:
    """Read a run file, compute its noise and label it.

    Args:
        path: A run file.
        library: Models to choose from by rate.

    Returns:
        The run with its labels, or with a remark why there are none.

    Raises:
        RunFileError: If the file is no run file.
    """
    run = nm.Run.load(path)
    remarks = list(_remarks(run))
    labels, model = None, ""
    try:
        labelled = label_run(run, library)
    except (CannotTellError, models.SignalError, nm.RunError) as error:
        remarks.append(f"No class lanes: {error}.")
    else:
        labels, model = labelled.labels, labelled.model
        remarks += [labelled.remark] if labelled.remark else []
    return Inspection(
        name=path.stem,
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        run=run,
        noise=nm.simplified(run.motion, run.velocity_desired),
        labels=labels,
        model=model,
        events=() if labels is None else labels.events(),
        remarks=tuple(remarks),
    )


def _robot_known(run: nm.Run) -> bool:
    return run.robot is not None and (run.robot in nm.ROBOTS or run.robot.endswith(".urdf"))


def _remarks(run: nm.Run) -> Iterator[str]:
    """Say what a run does not hold."""
    if run.robot is None:
        yield "No 3D robot: the run names none."
    elif not _robot_known(run):
        yield f"No 3D robot: {run.robot!r} is neither a listed robot nor a URDF file."
    elif run.position is None:
        yield "No 3D robot: the run has no positions."
    elif run.base_pose is None and run.robot in nm.ROBOTS and nm.ROBOTS[run.robot].floating_base:
        yield "The run has no base pose: the robot is drawn with its base at the origin."
    if run.velocity_desired is None:
        yield "The run has no desired velocities: the noise counts the measured motion alone."
    for signal, method in run.meta.get("differentiated", {}).items():
        yield f"The run had no {signal}: it was differentiated ({method})."
    lost = int((~run.mask).sum())
    if lost:
        yield f"{lost} samples lie in gaps; frames that touch one are not labelled."
