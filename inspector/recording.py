"""A run as a rerun recording: what goes into it, in order."""

from pathlib import Path

import numpy as np
import rerun as rr

from inspector import classlanes, colors, jointplots, linkplots, scene, series
from inspector.blueprint import Contents, layout
from inspector.inspection import Inspection
from inspector.report import report
from inspector.spectrogram import spectrogram
from inspector.thinning import extremes
from noisemodel.atomic import replacing

APPLICATION = "inspector"
NOISE_POINTS = 100_000


def write(inspection: Inspection, path: Path, *, overwrite: bool = False) -> None:
    """Write the recording of an inspected run, whole or not at all.

    Args:
        inspection: A run with its noise and labels.
        path: The file to write, by convention ``*.rrd``.
        overwrite: Whether a file that exists may be replaced.

    Raises:
        OutputError: If the file exists or cannot be written.
        RobotError: If the run's URDF cannot be read, or lacks one of the run's joints.
        MeshError: If one of the robot's meshes cannot be read.
    """
    run, links = inspection.run, inspection.links
    tree = None
    if inspection.has_robot:
        assert run.robot is not None
        tree = scene.load(run.robot)
        scene.check_joints(tree, run)
    plots = list(jointplots.plots(run))
    root = None if tree is None else scene.root(tree, run)
    contents = Contents(
        joints=[(plot.title, [line.path for line in plot.lines]) for plot in plots],
        root=root,
        links=links is not None,
        terms=links is not None and bool(links.terms),
        scores=inspection.labels is not None,
        lanes=inspection.labels is not None or bool(run.blocks),
        rate=run.rate,
    )
    with replacing(path, overwrite=overwrite) as temporary:
        recording = rr.RecordingStream(APPLICATION, recording_id=inspection.sha256[:32])
        recording.save(temporary, default_blueprint=layout(contents))
        if tree is not None:
            scene.log(recording, tree, run, coloured=links is not None)
        if tree is not None and links is not None:
            linkplots.log(recording, tree, links)
        classlanes.log(recording, inspection)
        _log_noise(recording, inspection)
        for plot in plots:
            jointplots.log(recording, run, plot)
        _log_text(recording, inspection)
        recording.flush()
        recording.disconnect()


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
    upright = np.ascontiguousarray(spectrum.level[::-1], dtype=np.float32)  # row 0 is drawn on top
    tensor = rr.Tensor(upright, dim_names=["frequency, high to low", "time"])
    recording.log("/spectrogram/levels", tensor, static=True)


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
