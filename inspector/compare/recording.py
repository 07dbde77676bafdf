"""Two runs as one rerun recording: both over each other, and what differs below."""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import rerun as rr
from rerun.urdf import UrdfTree

from inspector import colors
from inspector.analysis import Analysis, worst_joint
from inspector.compare.pair import (
    LOUDER,
    NEW,
    QUIETER,
    RESOLVED,
    UNCHANGED,
    Change,
    Pair,
    changes,
    largest_change,
    report,
    spectra,
    steps,
    verdict,
    whole,
)
from inspector.levels import LINKS, SPECTRUM, link_levels
from inspector.recording import axes, panels, robot, unstable
from inspector.recording.axes import Label, Panel, Timed
from inspector.recording.panels import CHANGE, HIGH_DB, LOW_DB, Drawn, found_stretches
from inspector.recording.run import log_report, writing
from inspector.recording.unstable import Part
from inspector.report.findings import classes_of, spoken

SIDE_COLORS = {"before": panels.BEFORE, "after": panels.AFTER}
# Of changes: the colour of the run that has them.
SHADES = {
    NEW: panels.AFTER,
    LOUDER: panels.AFTER,
    RESOLVED: panels.BEFORE,
    QUIETER: panels.BEFORE,
    UNCHANGED: axes.INK,
}
NOISE_POINTS = 60_000  # of each run's noise
DETAILS = 184.0  # height of the panels that lie behind each other
LEVEL, CHANGED, NOISE_PANEL = Panel("level", 118.0), Panel("change", 84.0), Panel("noise", DETAILS)
# Change of level at the upper end of its axis, in [dB], or a multiple where it is larger.
SPAN_DB = 24.0


def log_levels(recording: rr.RecordingStream, pair: Pair, found: Sequence[Change]) -> list[Timed]:
    """Log both levels every 50 ms, and their change, with what changed shaded."""
    time, level = steps(pair)
    changed = [(change.kind, change.start, change.stop) for change in found]
    styles = {kind: (kind, shade) for kind, shade in SHADES.items()}
    panels.log_shades(recording, "/level/change", changed, styles, (LOW_DB, HIGH_DB))
    for place, (name, _) in enumerate(pair.sides):
        axes.log_line(recording, f"/level/{name}", time, level[:, place], SIDE_COLORS[name])
    axes.log_beside(recording, LEVEL, panels.level_axis(), _sides())
    change = level[:, 1] - level[:, 0]
    peak = float(change[np.abs(change).argmax()])
    reach = SPAN_DB * max(float(np.ceil(abs(peak) / SPAN_DB)), 1.0)
    axes.log_line(recording, "/change/noise", time, change, axes.INK)
    nothing = colors.CLASSES["unknown"]
    axes.log_line(recording, "/change/none", time[[0, -1]], np.zeros(2), nothing)
    panels.log_shades(recording, "/change/finding", changed, styles, (-reach, reach))
    marks = [
        Label(0.5 + mark / reach / 2, axes.written(mark), 44.0)
        for mark in (-reach / 2, 0.0, reach / 2)
    ]
    signed = f"{peak:+.0f}".replace("-", "\u2212").replace("+0", "0")
    left, right = [Label(0.6, "change\n[dB]", -22.0), *marks], [Label(0.5, f"largest\n{signed}")]
    axes.log_beside(recording, CHANGED, left, right)
    return [
        axes.timed(LEVEL, title="Level", between=(LOW_DB, HIGH_DB)),
        axes.timed(CHANGED, title="Change", between=(-reach, reach)),
    ]


def log_spectra(recording: rr.RecordingStream, pair: Pair, joint: str) -> list[Part]:
    """Log the spectrograms of a joint's velocity in both runs, and their difference."""
    both = spectra(pair, joint)
    if not len(both[0].time):
        return []
    time, edges, _ = panels.in_levels(both[0])
    level = [panels.in_levels(each)[2] for each in both]
    scale = SPECTRUM.following(np.stack(level))
    before, after = (np.maximum(each, scale.low) for each in level)
    shown = {"change": (after - before, CHANGE), "before": (before, scale), "after": (after, scale)}
    parts = []
    for what, (values, own) in shown.items():
        panel, axis = Panel(f"spectrum_{what}", DETAILS), f"{joint or 'noise'}\n{what}"
        path, title = f"/spectrogram/{what}", f"Spectrum{', ' if what == 'change' else ' '}{what}"
        bands = time, edges, values
        part, _ = panels.log_heat(recording, panel, bands, own, axis, title, path=path, below="")
        parts.append(part)
    return parts


def log_noise(recording: rr.RecordingStream, pair: Pair) -> Part:
    """Log both noises."""
    sides, shades = dict(pair.sides), list(SIDE_COLORS.values())
    ends = panels.log_noise(recording, NOISE_PANEL, sides, shades, _sides(), NOISE_POINTS)
    return axes.timed(NOISE_PANEL, title="Noise", name="Noise", between=ends)[0]


def _sides(*places: float) -> list[Label]:
    return [
        Label(place, name, color=color)
        for place, (name, color) in zip(places or (0.75, 0.4), SIDE_COLORS.items(), strict=True)
    ]


ROW, LEAST = 26.0, 50.0  # height of a class, and of all of them at least, in points
# From where to where in its row what was found and annotated is drawn, from above.
BETWEEN = {"before": ((0.06, 0.34), (0.37, 0.45)), "after": ((0.52, 0.80), (0.83, 0.91))}


def log_changes(recording: rr.RecordingStream, pair: Pair, found: Sequence[Change]) -> Timed:
    """Log found and annotated classes, and the changes."""
    occur = {
        name: None
        for _, one in pair.sides
        for name in classes_of(one)
        if name != "ok" and any(_occurs(side, name) for _, side in pair.sides)
    }
    names = list(occur)
    panel = Panel("class", max(ROW * len(names), LEAST) + axes.AXIS)
    for row, name in enumerate(names):
        for side, analysis in pair.sides:
            shades, place = (SIDE_COLORS[side], SIDE_COLORS[side]), (row, len(names))
            panels.log_class(recording, analysis, name, place, shades, BETWEEN[side], side)
    titles = axes.row_labels(list(map(spoken, names)))
    told = _sides(0.8, 0.45)
    if any(side.run.blocks for _, side in pair.sides):
        told.append(Label(0.1, "thin: annotated"))
    axes.log_beside(recording, panel, titles or [Label(0.5, "no failure\nin either run")], told)
    if found:
        axes.log_events(
            recording,
            [change.start for change in found],
            [str(change) for change in found],
            [SHADES[change.kind] for change in found],
            warnings=[change.kind == NEW for change in found],
        )
    return axes.timed(panel)


def _occurs(side: Analysis, name: str) -> bool:
    return bool(found_stretches(side, name)) or any(
        block.label == name for block in side.run.blocks
    )


JOINT_POINTS = 2000  # points of a line: there are two for each signal of a joint


def log_joints(
    recording: rr.RecordingStream, pair: Pair, limbs: Mapping[str, tuple[str, ...]]
) -> list[Part]:
    """Log the joints' signals of both runs, paler before: tabs of limbs."""
    plots: dict[str, list[Drawn]] = {}
    for side, each in pair.sides:
        for signal in panels.signals(each.run):
            name = f"{'desired ' * signal.desired}{signal.kind}"
            path = f"/joints/{name.replace(' ', '_')}/{side}"
            drawn = (path, signal, each.run.mask, f" {side}", side == "before")
            plots.setdefault(f"{name} [{signal.unit}]", []).append(drawn)
    return panels.log_plots(recording, pair.time, plots, limbs, JOINT_POINTS)


KEY = Panel("key", 260.0)  # the scale beside the robots
ABOVE = 240.0  # least height of the report and the robots
TITLES = 28.0  # height of a row of tabs


ASPECT = 1.35  # least width of a robot's view by its height


def write(pair: Pair, path: Path, *, overwrite: bool = False) -> None:
    """Write the recording of two runs, whole or not at all.

    The same input makes a recording of the same id: opened again, it replaces itself.
    """
    parts = (pair.before.sha256, pair.after.sha256, str(pair.alignment.lag))
    identity = hashlib.sha256(" ".join(parts).encode()).hexdigest()
    found, time = changes(pair), pair.time
    loop = largest_change(pair, found)
    with TemporaryDirectory() as folder, writing(path, identity, overwrite=overwrite) as recording:
        axes.log_span(recording, float(time[0]), float(time[-1]))
        trees, robots = _log_robots(recording, pair, Path(folder))
        over_time = [log_changes(recording, pair, found), *log_levels(recording, pair, found)]
        details = _log_details(recording, pair, trees)
        head = unstable.beside((_log_text(recording, pair, found), 34.0), *robots)
        whole = unstable.above((head, ABOVE), *over_time, (details, DETAILS + TITLES))
        recording.send_blueprint(unstable.blueprint(whole, loop))  # instead of an older layout


def _log_robots(
    recording: rr.RecordingStream, pair: Pair, folder: Path
) -> tuple[dict[str, UrdfTree], list[Timed]]:
    """Log the robot before and after, as two robots, coloured by the levels of their links."""
    if pair.links is None:
        return {}, []
    runs = {side: each.run for side, each in pair.sides}
    robots = dict(zip(runs, robot.log_robots(recording, runs, folder, aspect=ASPECT), strict=True))
    views = [
        (unstable.robot(f"Robot {side}", f"/robot_{side}", camera), 29.0)
        for side, (_, camera) in robots.items()
    ]
    trees = {side: tree for side, (tree, _) in robots.items()}
    scale = LINKS.following(np.concatenate([link_levels(noise)[1] for noise in pair.links]))
    for tree, noise in zip(trees.values(), pair.links, strict=True):
        panels.log_robot_levels(recording, tree, noise, scale)
    axes.log_scale(recording, KEY, scale, "dB re\n1 pW")
    return trees, [*views, (unstable.drawing(f"/axis/{KEY.name}/right"), 8.0)]


def _log_details(recording: rr.RecordingStream, pair: Pair, trees: Mapping[str, UrdfTree]) -> Part:
    """Log what lies behind each other: spectra, noise, signals of joints."""
    parts = [*log_spectra(recording, pair, _joint(pair)), log_noise(recording, pair)]
    names = dict.fromkeys((*pair.after.run.joint_names, *pair.before.run.joint_names))
    limbs = panels.limbs(tuple(names), trees.get("after"))
    parts += log_joints(recording, pair, limbs)
    return unstable.tabs(*parts)


def _joint(pair: Pair) -> str:
    """The joint whose spectra are shown: the worst one after, if both runs have it."""
    joint = worst_joint(pair.after)
    name = "" if joint is None else pair.after.run.joint_names[joint]
    return name if name in pair.before.run.joint_names else ""


def _log_text(recording: rr.RecordingStream, pair: Pair, found: Sequence[Change]) -> Part:
    """Log the verdict and the report; they, with the list of changes behind the report."""
    properties = {
        "before_sha256": pair.before.sha256,
        "after_sha256": pair.after.sha256,
        "aligned": str(pair.alignment.how),
        "lag_s": pair.alignment.seconds,
        "rate_hz": pair.rate,
        "duration_s": pair.before.run.duration,
        "vibration_change_db": whole(pair).change,
    }
    log_report(recording, f"{pair.before.name} → {pair.after.name}", report(pair), properties)
    axes.log_verdict(recording, *verdict(pair))
    text = unstable.text("Before \u2192 after", "/report")
    if found:
        text = unstable.tabs(text, unstable.events("Changes", "/events"))
    return unstable.above((unstable.drawing("/verdict"), axes.VERDICT), (text, ABOVE))
