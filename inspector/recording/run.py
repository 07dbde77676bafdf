"""A run as a rerun recording: findings, robot and details at the left, time at the right."""

import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from math import ceil
from pathlib import Path
from typing import Any

import rerun as rr

from inspector import levels
from inspector.analysis import LOUDEST, Analysis, worst, worst_joint, worst_signal
from inspector.levels import spectrogram
from inspector.recording import panels, robot, views
from inspector.recording.robot import Drawn
from inspector.recording.views import Part
from inspector.reference.judging import Comparison
from inspector.report import brief, finding_of, missed, report, spoken
from noiseclassifier import Event
from noisemodel import Block
from noisemodel.files import replacing

APPLICATION = "inspector"
PATIENCE = 3.0  # how long a file may stay as it is while it is written, in [s]


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
            views.abandon(recording)
        if not views.has_end(temporary):  # rerun tells its log why, nobody else
            with temporary.open("ab") as file:
                file.write(bytes(1 << 16))  # fails as rerun did
            raise OSError("the recording is incomplete")


def _flushed(recording: rr.RecordingStream, path: Path) -> bool:
    """Write what waits, as long as the file grows: of a full disk rerun waits without end."""
    size = -1
    while path.stat().st_size != size:
        size = path.stat().st_size
        with suppress(RuntimeError):  # not done within `PATIENCE`, or it cannot be written
            recording.flush(timeout_sec=PATIENCE)
            return True
    return False


def log_report(
    recording: rr.RecordingStream, name: str, markdown: str, properties: dict[str, Any]
) -> None:
    """Log what a recording is called, its report and its properties."""
    recording.log("/report", rr.TextDocument(markdown, media_type="text/markdown"), static=True)
    recording.send_recording_name(name)
    recording.send_property("inspector", rr.AnyValues(**properties))


ASPECT = 1.3  # least width of the robot's view by its height
# Heights in a text, in points: from the top to the middle of its title, to the first line of the
# next paragraph, to the next line, and from the last one to the end.
HEAD, PARAGRAPH, LINE, FOOT = 36.0, 31.0, 15.5, 28.0
COLUMNS = 72  # characters of a line at the left of a window of 1440 x 900, at least
TALLEST = 264.0  # most height of the text at the left, in points
# Heights of the whole window's parts, of the list of events without and for each, of the samples of
# a moment, and of a row of tabs, in points.
WHOLE, EVENTS, EVENT, DETAILS, TITLES = 836.0, 84.0, 23.0, 190.0, 28.0


def write(
    analysis: Analysis,
    path: Path,
    *,
    overwrite: bool = False,
    beside: Comparison | None = None,
) -> None:
    """Write the recording of an inspected run, whole or not at all.

    The same input makes a recording of the same id: opened again, it replaces itself.

    Args:
        beside: The run beside its reference; None without one.
    """
    run, moments = analysis.run, worst(analysis)
    beside = None if beside is None or beside.empty else beside
    with writing(path, analysis.sha256, overwrite=overwrite) as recording:
        views.log_span(recording, float(run.time[0]), float(run.time[-1]))
        drawn, left = None, _log_findings(recording, analysis)
        if analysis.links is not None:
            ((drawn, seen),) = robot.log_robots(recording, {"": run}, aspect=ASPECT)
            rest = WHOLE - DETAILS - sum(size for _, size in left)
            shown = views.robot("Robot, links coloured by level above 10 Hz", "/robot", seen)
            key = views.drawing(f"/axis/{panels.KEY.name}/right")
            left.append((views.beside((shown, 88.0), (key, 12.0)), rest))
        details = views.tabs(*panels.log_details(recording, analysis, moments))
        over_time = [
            *panels.log_classes(recording, analysis),
            *panels.log_curves(recording, analysis, beside),
            (_log_spectra(recording, analysis), panels.HEIGHT + TITLES),
            _log_strips(recording, analysis, drawn, beside),
        ]
        left.append((details, DETAILS))
        whole = views.beside((views.above(*left), 36.0), (views.above(*over_time), 64.0))
        failures = ((each.start, each.stop) for each in moments if each.label != LOUDEST)
        loop = next(failures, None)
        recording.send_blueprint(views.blueprint(whole, loop))  # instead of an older run's


def _log_findings(recording: rr.RecordingStream, analysis: Analysis) -> list[tuple[Part, float]]:
    """Log verdict, report, and events; the parts that show them with their heights.

    Events are findings, and annotated failures that were not found.
    """
    run, links, markdown = analysis.run, analysis.links, report(analysis)
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
    log_report(recording, analysis.name, markdown, properties)
    kinds = spoken(analysis.headline).partition(": ")[2] or "no finding"
    told = {"findings": f"FAIL   {kinds}", "ok": f"PASS   {kinds}", "cannot-tell": "CANNOT TELL"}
    parts = [views.log_verdict(recording, analysis.status, told[analysis.status])]
    parts.append((views.text("Findings", titled=False), height(markdown)))
    rows: list[tuple[str, Event | Block]] = [("found", event) for event in analysis.findings]
    rows += [
        ("annotated" if analysis.labels is None else missed(analysis, block), block)
        for block in run.blocks
        if block.label != "ok" and finding_of(analysis, block) is None
    ]
    if rows:
        rows.sort(key=lambda row: row[1].start)
        colours = panels.colours_of(analysis)  # legible in light themes, too
        listed = [
            (event.start, f"{how}: {brief(analysis, event)}", colours[event.label])
            for how, event in rows
        ]
        views.log_events(recording, listed, [how == "found" for how, _ in rows])
        parts.append((views.events("Click a time to go there"), EVENTS + EVENT * min(len(rows), 4)))
    return parts


def _log_spectra(recording: rr.RecordingStream, analysis: Analysis) -> Part:
    """Log the spectrogram of the worst joint; it, and the sound power."""
    run, links, joint = analysis.run, analysis.links, worst_joint(analysis)
    fast = worst_signal(analysis, joint)
    spectrum = spectrogram(fast, run.rate, start=float(run.time[0]), valid=run.mask)
    scale = levels.SPECTRUM.following(spectrum.decibel)
    name = "the noise" if joint is None else run.joint_names[joint]
    panel, bands = views.Panel("spectrogram", panels.HEIGHT), panels.in_levels(spectrum)
    panels.log_gaps(recording, "/spectrogram", run, (0.0, views.TOP))
    panels.log_heat(recording, "/spectrogram/bands", panel, bands, scale, "velocity\nspectrum")
    parts = [views.timed(panel, name=f"Spectrogram of {name}")[0]]
    if links is not None:
        parts.append(views.plot("Sound power [dB re 1 pW]", "/power", views.ALL))
    return views.tabs(*parts)


def _log_strips(
    recording: rr.RecordingStream,
    analysis: Analysis,
    drawn: Drawn | None,
    beside: Comparison | None,
) -> views.Timed:
    """Log levels of joints and links; they, scores, and each limb's signals."""
    run, links = analysis.run, analysis.links
    strips = [] if beside is None else [panels.log_over(recording, beside)]
    strips += panels.log_joint_levels(recording, analysis)
    if drawn is not None and links is not None:
        strips.append(panels.log_links(recording, drawn, analysis, links))
    parts = [part for part, _ in strips]
    if (labels := analysis.labels) is not None:
        centres, colours = (labels.start + labels.stop) / 2, panels.colours_of(analysis)
        for name, score in zip(labels.classes, labels.scores.T, strict=True):
            line = {spoken(name): colours[name]}
            views.log_lines(recording, f"/score/{name}", centres, score[:, None], line)
        parts.append(views.plot("Scores", "/score", views.ALL, legend=True))
    limbs = panels.limbs(run.joint_names, drawn.robot if drawn else None)
    parts += panels.log_joints(recording, run, limbs)
    lowest = max((size for _, size in strips), default=160.0)
    return views.tabs(*parts), lowest + TITLES


def height(markdown: str) -> float:
    """Height of a text as far as its parts fit, in points: none is cut through by the edge."""
    found = HEAD - PARAGRAPH
    for part in re.split(r"\n\n(?!- )", markdown.strip()):
        below = found
        for paragraph in part.split("\n\n"):
            rows = paragraph.replace("**", "").split("\n")
            below += PARAGRAPH + LINE * (sum(ceil(len(row) / COLUMNS) for row in rows) - 1)
        if below + FOOT > TALLEST:
            break
        found = below
    return max(found, HEAD) + FOOT
