"""A run as a rerun recording: what goes into it, in order, whole or not at all."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import rerun as rr
from rerun.urdf import UrdfTree

from inspector import levels
from inspector.analysis import Analysis, worst, worst_joint, worst_signal
from inspector.recording import axes, framing, panels, robot, unstable
from inspector.recording.layout import Contents, layout
from inspector.reference.judging import Comparison
from inspector.report.markdown import report, spoken
from inspector.spectrogram import spectrogram
from noisemodel.files import replacing

APPLICATION = "inspector"
PATIENCE = 3.0
"""How long a file may stay as it is while it is written, in [s]."""


@contextmanager
def writing(
    path: Path, identity: str, *, application: str = APPLICATION, overwrite: bool = False
) -> Iterator[rr.RecordingStream]:
    """Write a recording for as long as the block lasts."""
    with replacing(path, overwrite=overwrite) as temporary:
        recording = rr.RecordingStream(application, recording_id=identity[:32])
        recording.save(temporary)
        yield recording
        if _flushed(recording, temporary):
            recording.disconnect()
        else:
            unstable.abandon(recording)
        require_whole(temporary)


def _flushed(recording: rr.RecordingStream, path: Path) -> bool:
    """Write what waits, as long as the file grows: of a full disk rerun waits without end."""
    size = -1
    while path.stat().st_size != size:
        size = path.stat().st_size
        with suppress(RuntimeError):  # not done within `PATIENCE`, or it cannot be written
            recording.flush(timeout_sec=PATIENCE)
            return True
    return False


def require_whole(recording: Path) -> None:
    """Refuse a recording that rerun could not write to its end; it tells that to its log only."""
    if unstable.has_end(recording):
        return
    with recording.open("ab") as file:
        file.write(bytes(1 << 16))  # fails as rerun did
    raise OSError("the recording is incomplete")


def log_report(
    recording: rr.RecordingStream, name: str, markdown: str, properties: dict[str, Any]
) -> None:
    """Log what a recording is called, its report and its properties."""
    recording.log("/report", rr.TextDocument(markdown, media_type="text/markdown"), static=True)
    recording.send_recording_name(name)
    recording.send_property("inspector", rr.AnyValues(**properties))


ASPECT = 1.3
"""Least width of the robot's view by its height."""


def write(
    analysis: Analysis,
    path: Path,
    *,
    overwrite: bool = False,
    sound: bytes = b"",
    floor: float | None = None,
    beside: Comparison | None = None,
) -> None:
    """Write the recording of an inspected run, whole or not at all.

    The same input makes a recording of the same id: opened again, it replaces itself.

    Args:
        sound: The run made audible, a WAV file that starts with the run; none if empty.
        beside: The run beside its reference; None without one.
        floor: Level of the darkest colour of spectrograms, in [dB re 1 rad/s]; by the run if None.
    """
    identity = analysis.sha256
    with TemporaryDirectory() as folder, writing(path, identity, overwrite=overwrite) as recording:
        tree = robot.of_run(analysis.run, Path(folder)) if analysis.links is not None else None
        contents = _log(recording, analysis, tree, Path(folder), sound, floor, beside)
        recording.send_blueprint(layout(contents))  # takes the place of an older run's layout


def _log(
    recording: rr.RecordingStream,
    analysis: Analysis,
    tree: UrdfTree | None,
    folder: Path,
    sound: bytes,
    floor: float | None,
    beside: Comparison | None,
) -> Contents:
    run, links, moments, seen = analysis.run, analysis.links, worst(analysis), None
    axes.log_span(recording, float(run.time[0]), float(run.time[-1]))
    strips = []
    beside = None if beside is None or beside.empty else beside
    if beside is not None:
        strips.append(("Over the reference", panels.log_over(recording, beside)))
    if (panel := panels.log_joint_levels(recording, analysis)) is not None:
        strips.append(("Joints above 10 Hz", panel))
    if tree is not None and links is not None:
        assert run.robot is not None
        robot.log(recording, tree, run, coloured=True)
        urdf = robot.drawn_file(run.robot, folder)
        (seen,) = framing.log_cameras(recording, [(tree, run)], urdf, aspect=ASPECT)
        strips.append(("Links above 10 Hz", panels.log_links(recording, tree, analysis, links)))
    shown_classes = panels.log_classes(recording, analysis)
    curves = panels.log_curves(recording, analysis, beside)
    joint = worst_joint(analysis)
    fast = worst_signal(analysis, joint)
    spectrum = spectrogram(fast, run.rate, start=float(run.time[0]), valid=run.mask)
    scale = levels.SPECTRUM.following(spectrum.decibel).down_to(floor)
    panels.log_bars(recording, "/spectrum/now", spectrum)
    axes.log_verdict(recording, analysis.status, verdict_of(analysis))
    if sound:
        unstable.log_audio(recording, "/sound", sound, axes.TIMELINE, start=float(run.time[0]))
    limb_plots = panels.log_joints(recording, run, panels.limbs(run.joint_names, tree))
    shown = panels.log_details(recording, analysis, moments)
    text = report(analysis)
    _log_text(recording, analysis, text, {} if tree is None else robot.entities(tree))
    failures = [moment for moment in moments if moment.failure]
    return Contents(
        text=text,
        classes=shown_classes,
        curves=curves,
        joint="the noise" if joint is None else run.joint_names[joint],
        spectrogram=panels.log_spectrogram(recording, analysis, spectrum, scale),
        orders=panels.log_orders(recording, analysis, scale),
        strips=strips,
        joints=limb_plots,
        details=shown,
        camera=seen,
        links=links is not None,
        terms=links is not None and bool(links.terms),
        events=len(panels.listed_events(analysis)),
        scores=analysis.labels is not None,
        sound=bool(sound),
        rate=run.rate,
        loop=(failures[0].start, failures[0].stop) if failures else None,
    )


def verdict_of(analysis: Analysis) -> str:
    """Whether a run passes, in a line, and what was found."""
    kinds = spoken(analysis.headline).partition(": ")[2]
    words = {"findings": "FAIL", "ok": "PASS", "cannot-tell": "CANNOT TELL"}
    found = "" if analysis.status == "cannot-tell" else kinds or "no finding"
    return f"{words[analysis.status]}   {found}".rstrip()


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
    """Let the names of links that stand before a share point to their entities."""

    def address(found: re.Match[str]) -> str:
        entity = entities.get(found[1], "").lstrip("/")
        return f"[{found[1]}](recording://{entity}) {found[2]}" if entity else found[0]

    return re.sub(r"(?<=[ |])([^\s|,]+) (\d+%)", address, markdown)
