"""Two runs as one rerun recording: both over each other, and what differs below."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import rerun as rr
from rerun.urdf import UrdfTree

from inspector import colors
from inspector.analysis import Analysis, worst_joint
from inspector.compare.changes import (
    NEW,
    Change,
    by_link,
    changes,
    largest_change,
    link_steps,
    report,
    spectra,
    steps,
    verdict,
    whole,
)
from inspector.compare.pair import Pair
from inspector.errors import InspectorError
from inspector.export.sound import SMALL_RATE, common_gain, sound_of
from inspector.levels import LINKS, SPECTRUM, extremes, link_levels
from inspector.recording import axes, robot, unstable
from inspector.recording.axes import Label, Panel, Timed
from inspector.recording.camera import log_cameras
from inspector.recording.panels import (
    AFTER,
    BEFORE,
    CHANGE,
    HIGH_DB,
    LOW_DB,
    SHADES,
    Signal,
    found_stretches,
    in_levels,
    limb_tabs,
    limbs,
    log_class,
    log_heat,
    log_level_axis,
    log_power,
    log_robot_levels,
    log_signal,
    scaled,
    signal_plot,
    signals,
)
from inspector.recording.run import log_report, writing
from inspector.recording.unstable import Part
from inspector.report.findings import classes_of, spoken
from noisemodel.run import part

SIDE_COLORS = {"before": BEFORE, "after": AFTER}

NOISE_POINTS = 60_000
"""Of each run's noise."""
DETAILS = 184.0
"""Height of the panels that lie behind each other."""
LEVEL, CHANGED, NOISE_PANEL = Panel("level", 118.0), Panel("change", 84.0), Panel("noise", DETAILS)
SPAN_DB = 24.0
"""Change of level at the upper end of its axis, in [dB], or a multiple where it is larger."""


def log_levels(recording: rr.RecordingStream, pair: Pair, found: Sequence[Change]) -> list[Timed]:
    """Log both levels every 50 ms, and their change, with what changed shaded."""
    time, level = steps(pair)
    log_shades(recording, "/level/change", found, (LOW_DB, HIGH_DB))
    for place, (name, _) in enumerate(pair.sides):
        axes.log_line(recording, f"/level/{name}", time, level[:, place], SIDE_COLORS[name])
    title = Label(0.62, "above 10 Hz\n[dB re\n1 rad/s]", -22.0)
    log_level_axis(recording, LEVEL, title)
    axes.log_right(recording, LEVEL, _sides())
    change = level[:, 1] - level[:, 0]
    peak = float(change[np.abs(change).argmax()])
    reach = SPAN_DB * max(float(np.ceil(abs(peak) / SPAN_DB)), 1.0)
    axes.log_line(recording, "/change/noise", time, change, axes.INK)
    nothing = colors.CLASSES["unknown"]
    axes.log_line(recording, "/change/none", time[[0, -1]], np.zeros(2), nothing)
    log_shades(recording, "/change/finding", found, (-reach, reach))
    marks = [
        Label(0.5 + mark / reach / 2, axes.written(mark), 44.0)
        for mark in (-reach / 2, 0.0, reach / 2)
    ]
    axes.log_left(recording, CHANGED, [Label(0.6, "change\n[dB]", -22.0), *marks])
    signed = f"{peak:+.0f}".replace("-", "\u2212").replace("+0", "0")
    axes.log_right(recording, CHANGED, [Label(0.5, f"largest\n{signed}")])
    return [
        axes.timed(LEVEL, title="Level", between=(LOW_DB, HIGH_DB)),
        axes.timed(CHANGED, title="Change", between=(-reach, reach), paths=CHANGE_PATHS),
    ]


def log_spectra(recording: rr.RecordingStream, pair: Pair, joint: str) -> list[Part]:
    """Log the spectrograms of a joint's velocity in both runs, and their difference."""
    both = spectra(pair, joint)
    if not len(both[0].time):
        return []
    edges, level = in_levels(both[0])[0], [in_levels(each)[1] for each in both]
    scale = SPECTRUM.following(np.stack(level))
    level = [np.maximum(each, scale.low) for each in level]
    shown = {
        "change": (level[1] - level[0], CHANGE),
        "before": (level[0], scale),
        "after": (level[1], scale),
    }
    parts = []
    for what, (values, own) in shown.items():
        panel = Panel(f"spectrum_{what}", DETAILS)
        path, title = f"/spectrogram/{what}", f"{joint or 'noise'}\n{what}"
        shades = SHADES if own is CHANGE else axes.SHADES
        log_heat(recording, panel, path, both[0].time, edges, values, own, title, shades=shades)
        name = f"Spectrum{', ' if what == 'change' else ' '}{what}"
        parts.append(axes.timed(panel, path, name=name)[0])
    return parts


def log_noise(recording: rr.RecordingStream, pair: Pair) -> list[Part]:
    """Log both noises, and the sound powers of all links."""
    loudest = np.concatenate([side.noise[side.run.mask] for _, side in pair.sides])
    scale, unit = scaled(loudest)
    for name, side in pair.sides:
        mask = side.run.mask
        time, values = extremes(
            pair.time[mask], side.noise[mask, None] / scale, points=NOISE_POINTS
        )
        axes.log_line(recording, f"/noise/{name}", time, values[:, 0], SIDE_COLORS[name])
        if side.links is not None:
            log_power(recording, f"/power/{name}", side.links, side.links.total, SIDE_COLORS[name])
    axes.log_left(recording, NOISE_PANEL, [Label(0.5, f"noise p\u0302\n[{unit}]")])
    axes.log_right(recording, NOISE_PANEL, _sides())
    between = (0.0, 1.08 * max(float(loudest.max(initial=0.0)) / scale, 0.01))
    return [axes.timed(NOISE_PANEL, title="Noise", name="Noise", between=between)[0]]


def _sides() -> list[Label]:
    return [
        Label(place, name, color=SIDE_COLORS[name])
        for place, name in ((0.75, "before"), (0.4, "after"))
    ]


ROW, LEAST = 26.0, 50.0
"""Height of a class, and of all of them at least, in points."""
FOUND = {"before": (0.06, 0.34), "after": (0.52, 0.80)}
ANNOTATED = {"before": (0.37, 0.45), "after": (0.83, 0.91)}
"""From where to where in its row each side is drawn, from above."""


def log_changes(recording: rr.RecordingStream, pair: Pair, found: Sequence[Change]) -> Timed:
    """Log found and annotated classes, and the changes."""
    names = [name for name in dict.fromkeys(_every(pair)) if name != "ok"]
    panel = Panel("class", max(ROW * len(names), LEAST) + axes.AXIS)
    for row, name in enumerate(names):
        for side, analysis in pair.sides:
            color, place = SIDE_COLORS[side], (row, len(names))
            stretches = found_stretches(analysis, name)
            log_class(recording, f"{side}/found", name, stretches, color, place, FOUND[side])
            blocks = [(b.start, b.stop) for b in analysis.run.blocks if b.label == name]
            log_class(recording, f"{side}/annotated", name, blocks, color, place, ANNOTATED[side])
    titles = [Label(label.place, spoken(label.text)) for label in axes.row_labels(names)]
    axes.log_left(recording, panel, titles or [Label(0.5, "no failure\nin either run")])
    told = [
        Label(0.8, "before", color=SIDE_COLORS["before"]),
        Label(0.45, "after", color=SIDE_COLORS["after"]),
    ]
    if any(side.run.blocks for _, side in pair.sides):
        told.append(Label(0.1, "thin: annotated"))
    axes.log_right(recording, panel, told)
    if found:
        axes.log_events(
            recording,
            [change.start for change in found],
            [str(change) for change in found],
            [_shade(change) for change in found],
            warnings=[change.kind == NEW for change in found],
        )
    return axes.timed(panel)


def log_shades(
    recording: rr.RecordingStream,
    path: str,
    found: Sequence[Change],
    between: tuple[float, float],
) -> None:
    """Shade the changes in a plot, in the colour of the run that has them."""
    for kind in dict.fromkeys(change.kind for change in found):
        own = [change for change in found if change.kind == kind]
        unstable.log_stretches(
            recording,
            f"{path}/{kind}",
            [(change.start, change.stop) for change in own],
            between=between,
            name=kind,
            color=_shade(own[0]),
        )


def _shade(change: Change) -> colors.Color:
    shades = {"new": "after", "louder": "after", "resolved": "before", "quieter": "before"}
    return SIDE_COLORS[shades[change.kind]] if change.kind in shades else axes.INK


def _every(pair: Pair) -> list[str]:
    known = [name for _, side in pair.sides for name in classes_of(side)]
    return [name for name in known if any(_occurs(side, name) for _, side in pair.sides)]


def _occurs(side: Analysis, name: str) -> bool:
    return bool(found_stretches(side, name)) or any(
        block.label == name for block in side.run.blocks
    )


JOINT_POINTS = 2000
"""Points of a line: there are three for each signal of a joint."""


def log_joints(
    recording: rr.RecordingStream, pair: Pair, limbs: Mapping[str, tuple[str, ...]]
) -> list[Part]:
    """Log the joints' signals of both runs, paler before, and after less before: tabs of limbs."""
    before, after = (
        {_signal_name(signal): signal for signal in signals(side.run)} for _, side in pair.sides
    )
    plots: dict[str, list[Part]] = {}
    for name in dict.fromkeys([*after, *before]):
        shown = {"before": before.get(name), "after": after.get(name)}
        shown["change"] = _difference(shown["before"], shown["after"])
        masks = (pair.before.run.mask, pair.after.run.mask, pair.valid)
        paths = {
            what: log_signal(
                recording,
                f"/joints/{name.replace(' ', '_')}/{what}",
                replace(signal, values=signal.values[mask]),
                pair.time[mask],
                limbs,
                suffix="" if what == "change" else f" {what}",
                dim=what == "before",
                points=JOINT_POINTS,
            )
            for (what, signal), mask in zip(shown.items(), masks, strict=True)
            if signal is not None and mask.any()
        }
        unit = next(signal.unit for signal in shown.values() if signal is not None)
        for limb in limbs:
            both = [paths[what].get(limb) for what in ("before", "after") if what in paths]
            change = paths.get("change", {}).get(limb)
            own = plots.setdefault(limb, [])
            if over := [path for path in both if path]:
                own.append(signal_plot(f"{name} [{unit}]", over))
            if change:
                own.append(signal_plot(f"change of {name} [{unit}]", [change]))
    return limb_tabs(plots)


def _signal_name(signal: Signal) -> str:
    return f"desired {signal.kind}" if signal.desired else signal.kind


def _difference(before: Signal | None, after: Signal | None) -> Signal | None:
    """A signal after less before, of the joints that are in both."""
    if before is None or after is None:
        return None
    joints = tuple(name for name in after.joints if name in before.joints)
    was, now = (
        np.asarray(each.values[:, [each.joints.index(name) for name in joints]], dtype=np.float64)
        for each in (before, after)
    )
    return replace(after, values=now - was, joints=joints)


SHOWN_LINKS = 8
"""Links that have a row, those that changed most."""
LINK_LINES = 3
"""Lines of a row, since thick ones have round ends."""
BOTH = 4
"""Links whose power before and after is shown."""
KEY = Panel("key", 260.0)
"""The scale beside the robots."""
ROBOT_SHADES = 16


def log_links(
    recording: rr.RecordingStream, trees: Mapping[str, UrdfTree], pair: Pair
) -> tuple[Part, list[Part]]:
    """Log the noise of links: colour both robots by it, and rows by how it changed.

    Returns:
        The changes; sound powers, and levels of the links that changed most.
    """
    assert pair.links is not None
    scale = LINKS.following(np.concatenate([link_levels(noise)[1] for noise in pair.links]))
    for tree, noise in zip(trees.values(), pair.links, strict=True):
        log_robot_levels(recording, tree, noise, scale)
    axes.log_scale(recording, KEY, scale, "dB re\n1 pW")
    names = [level.name for level in by_link(pair)]
    for (side, _), noise in zip(pair.sides, pair.links, strict=True):
        for name in names[:BOTH]:
            power = noise.vibration[:, noise.links.index(name)]
            log_power(recording, f"/links/{name}/{side}", noise, power, SIDE_COLORS[side])
    own = names[:SHOWN_LINKS]
    time, change = link_steps(pair, own)
    panel = Panel("links", DETAILS)
    if own:
        end = float(pair.time[-1]) + 1.0 / pair.rate
        rgba = CHANGE.colours(change.T, shades=SHADES)
        called = [f"{name}, change [dB]" for name in own]
        width = (DETAILS - axes.AXIS) / len(own) / (LINK_LINES + 1) + 2.0
        edges = np.append(time, max(end, float(time[-1])))
        axes.log_rows(
            recording, "/change/links", edges, rgba, names=called, width=width, lines=LINK_LINES
        )
    axes.log_left(recording, panel, axes.row_labels(own) or [Label(0.5, "no links")])
    axes.log_scale(recording, panel, CHANGE)
    parts = [unstable.plot("Sound power [dB re 1 pW]", "/power", axes.ALL, legend=True)]
    if names:
        both = [
            unstable.plot(f"{name} [dB re 1 pW]", f"/links/{name}", axes.ALL, legend=True)
            for name in names[:BOTH]
        ]
        parts.append(unstable.tabs(*both, name="Links, before and after"))
    return axes.timed(panel, "/change/links", name="Links, change")[0], parts


ABOVE = 240.0
"""Least height of the report and the robots."""
CHANGE_PATHS = ("/change/noise", "/change/none", "/change/finding/**", axes.SPAN)
TITLES = 28.0
"""Height of a row of tabs."""


ASPECT = 1.35
"""Least width of a robot's view by its height."""
MAX_VALUES = 8_000_000
"""Velocities of a run that are mixed into a sound: a second of work."""


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
        details = _log_details(recording, pair, trees, loop[0])
        head = unstable.beside((_log_text(recording, pair, found), 34.0), *robots)
        whole = unstable.above((head, ABOVE), *over_time, (details, DETAILS + TITLES))
        recording.send_blueprint(unstable.blueprint(whole, loop))  # instead of an older layout


def _log_robots(
    recording: rr.RecordingStream, pair: Pair, folder: Path
) -> tuple[dict[str, UrdfTree], list[Timed]]:
    """Log the robot before and after, as two robots, and the scale of their colours."""
    if pair.links is None:
        return {}, []
    assert pair.after.run.robot is not None
    trees = {side: robot.of_run(each.run, folder, side=side) for side, each in pair.sides}
    pairs = [(trees[side], each.run) for side, each in pair.sides]
    for tree, own in pairs:
        robot.log(recording, tree, own)
    urdf = robot.drawn_file(pair.after.run.robot, folder)
    cameras = log_cameras(recording, pairs, urdf, aspect=ASPECT)
    views = [
        (unstable.robot(f"Robot {side}", f"/robot_{side}", camera), 29.0)
        for side, camera in zip(trees, cameras, strict=True)
    ]
    return trees, [*views, (unstable.drawing(f"/axis/{KEY.name}/right"), 8.0)]


def _log_details(
    recording: rr.RecordingStream, pair: Pair, trees: Mapping[str, UrdfTree], around: float
) -> Part:
    """Log what lies behind each other: links, spectra, noise, sounds, signals of joints."""
    parts, of_links = list[Part](), list[Part]()
    if trees:
        changed, of_links = log_links(recording, trees, pair)
        parts.append(changed)
    parts += log_spectra(recording, pair, _joint(pair))
    parts += [*log_noise(recording, pair), *of_links]
    for name, sound in _sounds(pair, around).items():
        unstable.log_audio(recording, f"/sound/{name}", sound, float(pair.time[0]))
        parts.append(unstable.audio(f"Listen {name}", f"/sound/{name}"))
    names = dict.fromkeys((*pair.after.run.joint_names, *pair.before.run.joint_names))
    parts += log_joints(recording, pair, limbs(tuple(names), trees.get("after")))
    return unstable.tabs(*parts)


def _joint(pair: Pair) -> str:
    """The joint whose spectra are shown: the worst one after, if both runs have it."""
    joint = worst_joint(pair.after)
    name = "" if joint is None else pair.after.run.joint_names[joint]
    return name if name in pair.before.run.joint_names else ""


def _sounds(pair: Pair, around: float) -> dict[str, bytes]:
    """A WAV file of the simplified noise of each run, both at one gain; none if all is silent.

    Of runs that are too long, only a part around a time in [s] is audible.
    """
    widest = max(2 * side.run.motion.shape[1] for _, side in pair.sides)
    count = min(max(2, MAX_VALUES // widest), len(pair.time))
    middle = int(np.searchsorted(pair.time, around))
    first = min(max(middle - count // 2, 0), len(pair.time) - count)
    try:
        made = {
            name: sound_of(part(side.run, first, first + count), playing=SMALL_RATE)
            for name, side in pair.sides
        }
    except InspectorError:
        return {}
    gain = common_gain(list(made.values()))
    lead = first / pair.rate
    return {name: s.file(gain, lead=lead) for name, s in made.items()}


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
