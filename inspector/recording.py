"""A run as a rerun recording."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr

from inspector import colors, scene, series
from inspector.blueprint import Contents, layout
from inspector.inspection import Inspection
from inspector.report import report
from inspector.spectrogram import Spectrogram, spectrogram
from inspector.thinning import extremes
from models import Labels
from noisemodel.atomic import replacing
from noisemodel.run import Run
from noisemodel.types import Real

APPLICATION = "inspector"
NOISE_POINTS = 100_000
JOINT_POINTS = 4000
JOINTS_PER_PLOT = 8


def write(
    inspection: Inspection, path: Path, *, robot: bool = True, overwrite: bool = False
) -> None:
    """Write the recording of an inspected run, whole or not at all.

    Args:
        inspection: A run with its noise and labels.
        path: The file to write, by convention ``*.rrd``.
        robot: Whether to draw the robot, if the run names one that is known.
        overwrite: Whether a file that exists may be replaced.

    Raises:
        OutputError: If the file exists or cannot be written.
        RobotError: If the run's URDF cannot be read, or lacks one of the run's joints.
        MeshError: If one of the robot's meshes cannot be read.
    """
    tree = None
    if robot and inspection.has_robot:
        assert inspection.run.robot is not None
        tree = scene.load(inspection.run.robot)
        scene.check_joints(tree, inspection.run)
    plots = list(_joint_plots(inspection.run))
    root = None if tree is None else tree.root_link().name
    contents = Contents(
        joints=[(plot.title, [line.path for line in plot.lines]) for plot in plots],
        root=scene.WORLD if inspection.run.base_pose is not None and root else root,
        scores=inspection.labels is not None,
        lanes=inspection.labels is not None or bool(inspection.run.blocks),
        rate=inspection.run.rate,
    )
    with replacing(path, overwrite=overwrite) as temporary:
        recording = rr.RecordingStream(APPLICATION, recording_id=inspection.sha256[:32])
        recording.save(temporary, default_blueprint=layout(contents))
        if tree is not None:
            scene.log(recording, tree, inspection.run)
        _log_classes(recording, inspection)
        _log_noise(recording, inspection)
        for plot in plots:
            for line in plot.lines:
                _log_line(recording, inspection.run, line)
        _log_text(recording, inspection)
        recording.flush()
        recording.disconnect()


@dataclass(frozen=True)
class Line:
    """Some joints' signal, drawn as lines of one entity."""

    path: str
    values: Real
    names: tuple[str, ...]
    dim: bool


@dataclass(frozen=True)
class Plot:
    """Lines that share a plot."""

    title: str
    lines: tuple[Line, ...]


def _joint_plots(run: Run) -> Iterator[Plot]:
    """Go through the run's joint signals, a few joints per plot, desired beside measured."""
    signals = [
        ("velocity", "rad/s", run.velocity, run.velocity_desired),
        ("position", "rad", run.position, run.position_desired),
        ("effort", "N m", run.effort, None),
        *((f"stage {name}", "rad/s", stage, None) for name, stage in run.stages.items()),
    ]
    for kind, unit, measured, desired in signals:
        if measured is None:
            continue
        for first in range(0, len(run.joint_names), JOINTS_PER_PLOT):
            names = run.joint_names[first : first + JOINTS_PER_PLOT]
            path = f"/joints/{kind.replace(' ', '_')}/{first // JOINTS_PER_PLOT}"
            part = measured[:, first : first + len(names)]
            lines = [Line(path, part, names, dim=False)]
            wanted = [name for name in names if name in run.desired_joint_names]
            if desired is not None and wanted:
                columns = [run.desired_joint_names.index(name) for name in wanted]
                labels = tuple(f"{name} desired" for name in wanted)
                lines.insert(0, Line(f"{path}_desired", desired[:, columns], labels, dim=True))
            span = names[0] if len(names) == 1 else f"{names[0]} … {names[-1]}"
            title = f"{kind} [{unit}]"
            if len(run.joint_names) > JOINTS_PER_PLOT:
                title = f"{kind} {span} [{unit}]"
            yield Plot(title, tuple(lines))


def _log_line(recording: rr.RecordingStream, run: Run, line: Line) -> None:
    time, values = extremes(run.time[run.mask], line.values[run.mask], points=JOINT_POINTS)
    colours = colors.of_series(len(line.names), dim=line.dim)
    series.log_lines(recording, line.path, time, values, names=line.names, colours=colours)


def _log_noise(recording: rr.RecordingStream, inspection: Inspection) -> None:
    run, noise = inspection.run, inspection.noise
    time, values = extremes(run.time[run.mask], noise[run.mask, None], points=NOISE_POINTS)
    series.log_lines(
        recording,
        "/noise/simplified",
        time,
        values,
        names=["simplified [rad/s]"],
        colours=[colors.NOISE],
    )
    spectrum = spectrogram(noise, run.rate, start=float(run.time[0]), valid=run.mask)
    series.log_heat_strip(recording, "/spectrogram/bands", spectrum)
    _log_levels(recording, spectrum)


def _log_levels(recording: rr.RecordingStream, spectrum: Spectrogram) -> None:
    upright = np.ascontiguousarray(spectrum.level[::-1], dtype=np.float32)  # row 0 is drawn on top
    tensor = rr.Tensor(upright, dim_names=["frequency, high to low", "time"])
    recording.log("/spectrogram/levels", tensor, static=True)


def _log_classes(recording: rr.RecordingStream, inspection: Inspection) -> None:
    run, labels = inspection.run, inspection.labels
    annotated = {block.label for block in run.blocks}
    known = () if labels is None else labels.classes
    colours = colors.of_classes((*known, *sorted(annotated - set(known))))
    if labels is not None:
        found = list(_stretches(labels))
        series.log_lane(recording, "/class/found", found, {name: colours[name] for name in known})
        for index, name in enumerate(known):
            series.log_lines(
                recording,
                f"/score/{name}",
                (labels.start + labels.stop) / 2,
                labels.scores[:, index : index + 1],
                names=[name],
                colours=[colours[name]],
            )
        _log_events(recording, inspection, colours)
    if run.blocks:
        lane = [(block.start, block.stop, block.label) for block in run.blocks]
        series.log_lane(recording, "/class/annotated", lane, colours)


def _stretches(labels: Labels) -> Iterator[tuple[float, float, str]]:
    """Give each frame the time around its centre, up to halfway to its neighbours."""
    centres = (labels.start + labels.stop) / 2
    hop = float(np.median(np.diff(centres))) if len(centres) > 1 else float(np.ptp(labels.stop))
    halfway = (centres[1:] + centres[:-1]) / 2
    apart = np.diff(centres) > 1.5 * hop
    begins = np.concatenate(
        (centres[:1] - hop / 2, np.where(apart, centres[1:] - hop / 2, halfway))
    )
    ends = np.concatenate(
        (np.where(apart, centres[:-1] + hop / 2, halfway), centres[-1:] + hop / 2)
    )
    yield from zip(begins.tolist(), ends.tolist(), map(str, labels.label), strict=True)


def _log_events(
    recording: rr.RecordingStream, inspection: Inspection, colours: dict[str, colors.Color]
) -> None:
    events = inspection.events
    if not events:
        return
    recording.send_columns(
        "/events",
        indexes=[series.at(np.array([event.start for event in events]))],
        columns=rr.TextLog.columns(
            text=[f"{e.label}, {e.start:.2f} s to {e.stop:.2f} s" for e in events],
            level=["WARN"] * len(events),
            color=np.array([(*colours[event.label], 255) for event in events], dtype=np.uint8),
        ),
    )


def _log_text(recording: rr.RecordingStream, inspection: Inspection) -> None:
    run = inspection.run
    document = rr.TextDocument(report(inspection), media_type="text/markdown")
    recording.log("/report", document, static=True)
    recording.send_recording_name(inspection.name)
    recording.send_property(
        "inspector",
        rr.AnyValues(
            robot=run.robot or "",
            rate_hz=run.rate,
            duration_s=run.duration,
            joints=len(run.joint_names),
            model=inspection.model,
            input_sha256=inspection.sha256,
        ),
    )
