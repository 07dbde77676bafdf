"""One run, looked at: its noise, its labels, and what could not be said."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import models
import noisemodel as nm
from inspector.audit import audit, summary
from inspector.errors import InspectorError
from inspector.library import CannotTellError, Library, label_run
from inspector.localisation.localise import Origin, origins
from noisemodel.links import LinkNoise, link_noise
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
        links: Noise link by link; None without a robot.
        remarks: What is missing and why, a sentence each.
    """

    name: str
    sha256: str
    run: nm.Run
    noise: Array
    labels: models.Labels | None
    model: str
    events: tuple[models.Event, ...]
    links: LinkNoise | None
    remarks: tuple[str, ...]

    @property
    def has_robot(self) -> bool:
        """Whether there is a robot to draw, and motion to move it by."""
        return self.links is not None

    @cached_property
    def origins(self) -> dict[models.Event | nm.Block, Origin]:
        """Where each failure comes from, found or annotated."""
        labels = self.labels
        frame = 0.0 if labels is None else float(labels.stop[0] - labels.start[0])
        return origins(self.run, self.events, frame=frame)


def inspect(
    path: Path,
    library: Library,
    *,
    robot: bool = True,
    kind: str = "normal",
    terms: bool = False,
) -> Inspection:
    """Read a run file, compute its noise and label it.

    Args:
        path: A run file.
        library: Models to choose from by rate.
        robot: Whether to look at the robot, if the run names one that is known.
        kind: Kind of the extended noise, see ``noisemodel.extended``.
        terms: Whether to look at the paper's terms A, B and C one by one.

    Returns:
        The run with its labels, or with a remark why there are none.

    Raises:
        RunFileError: If the file is no run file.
        RobotError: If its robot cannot be read, or lacks one of its joints.
        InspectorError: If the robot's shape cannot be had.
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
    remarks += summary(audit(run, library))
    links = None
    if robot and robot_known(run) and run.position is not None:
        try:
            links = link_noise(run, kind, terms=terms)
        except nm.GeometryError as error:
            raise InspectorError(
                f"{error}; `--no-robot` shows the run without the robot"
            ) from error
        remarks += links.remarks
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256")
    return Inspection(
        name=path.stem,
        sha256=digest.hexdigest(),
        run=run,
        noise=nm.simplified(run.motion, run.velocity_desired),
        labels=labels,
        model=model,
        events=() if labels is None else labels.events(),
        links=links,
        remarks=tuple(remarks),
    )


def robot_known(run: nm.Run) -> bool:
    """Whether a run names a listed robot, or a URDF."""
    return run.robot is not None and (run.robot in nm.ROBOTS or run.robot.endswith(".urdf"))


def _remarks(run: nm.Run) -> Iterator[str]:
    """Say what a run does not hold."""
    if run.robot is None:
        yield "No 3D robot: the run names none."
    elif not robot_known(run):
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
