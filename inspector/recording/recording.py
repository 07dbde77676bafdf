"""A run as a rerun recording: what goes into it, in order."""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import rerun as rr
from rerun.urdf import UrdfTree

from inspector import levels
from inspector.analysis.analyse import Analysis
from inspector.analysis.moments import worst
from inspector.recording import classes, details, framing, joints, noise, robot, series, unstable
from inspector.recording import links as strip_rows
from inspector.recording import spectrogram as spectrograms
from inspector.recording.blueprint import Contents, layout
from inspector.recording.limbs import limbs
from inspector.recording.spectrogram import log_bars
from inspector.recording.stream import log_report, writing
from inspector.report.markdown import report
from inspector.spectrogram import spectrogram
from noisemodel.links import vibrating

ASPECT = 1.3
"""Least width of the robot's view by its height."""


def write(
    analysis: Analysis,
    path: Path,
    *,
    overwrite: bool = False,
    sound: bytes = b"",
    floor: float | None = None,
) -> None:
    """Write the recording of an inspected run, whole or not at all.

    The same input makes a recording of the same id: opened again, it replaces itself.

    Args:
        analysis: A run with its noise and labels.
        path: The file to write, by convention ``*.rrd``.
        overwrite: Whether a file that exists may be replaced.
        sound: The run made audible, a WAV file that starts with the run; none if empty.
        floor: Level of the darkest colour of spectrograms, in [dB re 1 rad/s]; -70 unless given.

    Raises:
        OutputError: If the file exists or cannot be written.
        RobotError: If the run's URDF cannot be read, or lacks one of the run's joints.
        MeshError: If one of the robot's meshes cannot be read.
    """
    identity = analysis.sha256
    with TemporaryDirectory() as folder, writing(path, identity, overwrite=overwrite) as recording:
        tree = robot.of_run(analysis.run, Path(folder)) if analysis.links is not None else None
        contents = _log(recording, analysis, tree, Path(folder), sound, floor)
        recording.send_blueprint(layout(contents))  # takes the place of an older run's layout


def _log(
    recording: rr.RecordingStream,
    analysis: Analysis,
    tree: UrdfTree | None,
    folder: Path,
    sound: bytes,
    floor: float | None,
) -> Contents:
    run, links, moments, seen = analysis.run, analysis.links, worst(analysis), None
    noise.log_span(recording, run)
    strips = []
    if (panel := strip_rows.log_joints(recording, analysis)) is not None:
        strips.append(("Joints above 10 Hz", panel))
    if tree is not None and links is not None:
        assert run.robot is not None
        robot.log(recording, tree, run, coloured=True)
        urdf = robot.drawn_file(run.robot, folder)
        (seen,) = framing.log(recording, [(tree, run)], urdf, aspect=ASPECT)
        strips.append(("Links above 10 Hz", strip_rows.log(recording, tree, analysis, links)))
    shown_classes = classes.log(recording, analysis)
    curves = noise.log(recording, analysis)
    scale = levels.SPECTRUM if floor is None else replace(levels.SPECTRUM, low=floor)
    fast = vibrating(analysis.noise[:, None], run.mask, run.rate)[:, 0]
    spectrum = spectrogram(fast, run.rate, start=float(run.time[0]), valid=run.mask)
    log_bars(recording, "/spectrum/now", spectrum)
    if sound:
        unstable.log_audio(recording, "/sound", sound, series.TIMELINE, start=float(run.time[0]))
    limb_plots = joints.log(recording, run, limbs(run.joint_names, tree))
    shown = details.log(recording, analysis, moments)
    text = report(analysis)
    _log_text(recording, analysis, text, {} if tree is None else robot.entities(tree))
    failures = [moment for moment in moments if moment.failure]
    return Contents(
        text=text,
        classes=shown_classes,
        curves=curves,
        spectrogram=spectrograms.log(recording, analysis, spectrum, scale),
        orders=spectrograms.log_orders(recording, analysis, scale),
        strips=strips,
        joints=limb_plots,
        details=shown,
        camera=seen,
        links=links is not None,
        terms=links is not None and bool(links.terms),
        events=len(classes.events(analysis)),
        scores=analysis.labels is not None,
        sound=bool(sound),
        rate=run.rate,
        loop=(failures[0].start, failures[0].stop) if failures else None,
    )


def _log_text(
    recording: rr.RecordingStream, analysis: Analysis, text: str, entities: Mapping[str, str]
) -> None:
    run, links = analysis.run, analysis.links
    properties = {
        "input_sha256": analysis.sha256,
        "robot": run.robot or "",
        "rate_hz": run.rate,
        "duration_s": run.duration,
        "joints": len(run.joint_names),
        "samples_in_gaps": int((~run.mask).sum()),
        "model": analysis.model,
        "link_noise": "" if links is None else links.kind,
        "findings": len(analysis.findings),
    }
    log_report(recording, analysis.name, linked(text, entities), properties)


def linked(markdown: str, entities: Mapping[str, str]) -> str:
    """Let the names of links that stand before a share point to their entities.

    Args:
        markdown: A report.
        entities: Entity path by name of the link.

    Returns:
        The report with its names as Markdown links.
    """

    def address(found: re.Match[str]) -> str:
        entity = entities.get(found[1], "").lstrip("/")
        return f"[{found[1]}](recording://{entity}) {found[2]}" if entity else found[0]

    return re.sub(r"(?<=[ |])([^\s|,]+) (\d+%)", address, markdown)
