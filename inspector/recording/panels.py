"""The panels of a recording: classes, noise, level, spectrogram, joints, links, details.

One run, two, many and a stream draw the same panels; each only chooses which.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import NamedTuple, TypeAlias

import numpy as np
import rerun as rr
from rerun.components import MarkerShapeLike

from inspector import colors, levels
from inspector.analysis import SHOWN, Analysis, Moment, chosen, gaps
from inspector.levels import WINDOW, Scale, Spectrogram, extremes, in_bands
from inspector.recording import views
from inspector.recording.robot import Drawn
from inspector.recording.views import Label, Panel, Part, Timed
from inspector.reference.judging import Comparison
from inspector.reference.levels import HOP
from inspector.report import classes_of, spoken
from noiseclassifier import Labels
from noisemodel import Robot, Run
from noisemodel.noise import REFERENCE_POWER, LinkNoise, decibel, vibrating
from noisemodel.types import Array, Mask, Real

HATCHES = 6  # strokes of a gap


def log_gaps(
    recording: rr.RecordingStream, path: str, run: Run, between: tuple[float, float]
) -> None:
    """Hatch the gaps of a run in a plot, by a line that goes up and down."""
    found = gaps(run)
    if found:
        times = [np.append(np.linspace(*gap, HATCHES + 1), gap[1]) for gap in found]
        stroke = np.append(np.resize(between, HATCHES + 1), np.nan)
        values, lines = np.tile(stroke, len(found)), {"gap: no samples": colors.CLASSES["unknown"]}
        views.log_lines(recording, f"{path}/gap", np.concatenate(times), values[:, None], lines)


MAX_JOINTS = 10  # joints that one plot can hold
JOINTS_PER_PLOT = 8  # joints in each plot if there are more than that


def limbs(names: Sequence[str], robot: Robot | None) -> dict[str, tuple[str, ...]]:
    """Divide joints into limbs."""
    if not names:
        return {}
    groups = [tuple(names)] if robot is None else _chains(names, robot)
    parts = []
    for group in groups:
        size = len(group) if len(group) <= MAX_JOINTS else JOINTS_PER_PLOT
        parts += [group[first : first + size] for first in range(0, len(group), size)]
    titles = [_limb_title(part) for part in parts] if len(parts) > 1 else ["joints"]
    count = Counter(titles)
    return {
        title if count[title] == 1 else f"{part[0]} … {part[-1]}": part
        for title, part in zip(titles, parts, strict=True)
    }


def _chains(names: Sequence[str], robot: Robot) -> list[tuple[str, ...]]:
    """Follow the robot outwards: a limb begins where it branches, and has two joints or more."""
    nearest = [""]  # of each joint, itself if it is among the names, or else the next above
    carrier: dict[str, str] = {}  # the next of the named joints towards the root, if there is one
    for joint in robot.joints:  # parents come first
        above = nearest[joint.parent]
        if joint.name in names:
            carrier[joint.name] = above
        nearest.append(joint.name if joint.name in names else above)
    branches = Counter(carrier.values())
    limb: dict[str, str] = {}  # the joint that the limb of a joint begins with
    for name, before in carrier.items():
        if before and not (branches[name] and branches[before] > 1):  # such as a finger
            limb[name] = limb[before]
        else:
            limb[name] = name if branches[name] else ""  # wheels belong together
    firsts = dict.fromkeys(limb[name] for name in names)
    return [tuple(name for name in names if limb[name] == first) for first in firsts]


def _limb_title(joints: Sequence[str]) -> str:
    """Name a limb by what its first two joints' names share."""
    pairs = zip(*joints[:2], strict=False)
    same = "".join(pair[0] for pair in takewhile(lambda pair: len(set(pair)) == 1, pairs))
    shared = same.rstrip("_-0123456789") if len(joints) > 1 else ""
    return shared if len(shared) > 1 else f"{joints[0]} … {joints[-1]}"


ROW = 20.0  # height of a class, in points
# From where to where in its row each is drawn, from above.
FOUND, ANNOTATED = (0.10, 0.62), (0.68, 0.88)
# Of the classes, so that a finding shorter than a pixel is seen.
MARKERS: tuple[MarkerShapeLike, ...] = (
    "Diamond",
    "Square",
    "Up",
    "Circle",
    "Cross",
    "Plus",
    "Down",
    "Asterisk",
)


def log_classes(recording: rr.RecordingStream, analysis: Analysis) -> list[Timed]:
    """Log the classes that a model found, and those that are annotated; nothing without any."""
    run, labels, names = analysis.run, analysis.labels, classes_of(analysis)
    if not names:
        return []
    lost, colours = gaps(run), colours_of(analysis)
    count = len(names) + bool(lost)
    panel = Panel("class", ROW * count + views.AXIS)
    for row, name in enumerate(names):
        shades, place = (colours[name], views.INK), (row, count)
        log_class(recording, analysis, name, place, shades, (FOUND, ANNOTATED))
        middle = views.TOP * (1.0 - (row + sum(FOUND) / 2) / count)
        if marks := [(each.start, middle) for each in analysis.findings if each.label == name]:
            log_marks(recording, name, row, colours[name], marks)
    if lost:
        log_gaps(recording, "/class", run, (0.1 * views.TOP / count, 0.9 * views.TOP / count))
    titles = [*map(spoken, names), "gap: no samples"][:count]
    inks = [*(readable(colours[name]) for name in names), views.INK][:count]
    told = [Label(0.5, "annotated" if labels is None else "found")]
    if labels is not None and run.blocks:
        told = [Label(0.8, "thick:\nfound"), Label(0.3, "thin:\nannotated")]
    views.log_beside(recording, panel, views.row_labels(titles, inks), told)
    return [views.timed(panel)]


def colours_of(*sides: Analysis) -> dict[str, colors.Color]:
    """The colours of all classes of runs, found or annotated, the models' classes first."""
    known = dict.fromkeys(name for side in sides if side.labels for name in side.labels.classes)
    others = {name for side in sides for name in classes_of(side)}
    return colors.of_classes((*known, *sorted(others - set(known))))


def readable(color: colors.Color) -> colors.Color:
    """A colour that text is legible in on a dark background: half as far from white."""
    red, green, blue = (round((channel + 255) / 2) for channel in color)
    return red, green, blue


def log_shades(
    recording: rr.RecordingStream,
    path: str,
    found: Sequence[tuple[str, float, float]],
    shades: Mapping[str, colors.Color],
    between: tuple[float, float],
    what: str = "",
) -> None:
    """Shade stretches in a plot, by kind, start and stop in [s], in the colour of each kind."""
    for kind in dict.fromkeys(kind for kind, *_ in found):
        own = [(start, stop) for each, start, stop in found if each == kind]
        name = f"{what}{spoken(kind)}"
        views.log_stretches(recording, f"{path}/{kind}", own, between, name, shades[kind])


def log_class(
    recording: rr.RecordingStream,
    analysis: Analysis,
    name: str,
    place: tuple[int, int],
    shades: tuple[colors.Color, colors.Color],
    between: tuple[tuple[float, float], tuple[float, float]],
    side: str = "",
) -> None:
    """Log when a class was found, and when it was annotated, in its row.

    Args:
        place: The number of the row, and of all rows.
        between: From where to where in the row, from above, what was found and annotated is drawn.
        side: Which of two runs this is.
    """
    row, count = place
    stretches = {
        "found": found_stretches(analysis, name),
        "annotated": [(b.start, b.stop) for b in analysis.run.blocks if b.label == name],
    }
    for (how, own), color, ends in zip(stretches.items(), shades, between, strict=True):
        called = f"{side}, {how}: {spoken(name)}" if side else f"{how}: {spoken(name)}"
        path = f"/class/{side}/{how}/".replace("//", "/") + rr.escape_entity_path_part(name)
        low, high = (views.TOP * (1.0 - (row + share) / count) for share in reversed(ends))
        views.log_stretches(recording, path, own, (low, high), called, color, opaque=True)


def found_stretches(analysis: Analysis, name: str) -> list[tuple[float, float]]:
    """When a class was found: findings as they are reported, and what else frames cover."""
    found = [(event.start, event.stop) for event in analysis.findings if event.label == name]
    return found + [(start, stop) for start, stop, label in analysis.lane if label == name]


def log_marks(
    recording: rr.RecordingStream,
    name: str,
    number: int,
    color: colors.Color,
    marks: Sequence[tuple[float, float]],
) -> None:
    """Log markers of a class, one for each finding, at its start in [s] and place in the panel."""
    shape, path = MARKERS[number % len(MARKERS)], f"/class/mark/{name}"
    points = rr.SeriesPoints(
        names=[spoken(name)], colors=[color], markers=[shape], marker_sizes=[4.0]
    )
    recording.log(path, points, static=True)
    time, place = np.array(marks).T
    recording.send_columns(path, indexes=[views.at(time)], columns=views.scalars(place))


NOISE_POINTS = 100_000
NOISE, LEVEL = Panel("noise", 128.0), Panel("level", 120.0)
PROBABILITY = Panel("probability", 92.0)
LOW_DB, HIGH_DB = -80.0, 30.0  # ends of the level's axis, in [dB re 1 rad/s]


def log_curves(
    recording: rr.RecordingStream, analysis: Analysis, beside: Comparison | None = None
) -> list[Timed]:
    """Log the noise, its level and the repetitions' level, and the probability of a failure."""
    ends = log_noise(recording, NOISE, {"simplified": analysis}, [colors.NOISE])
    curves = [_curve(recording, analysis, NOISE, ends), _log_level(recording, analysis, beside)]
    if analysis.labels is not None and analysis.alarm is not None:
        curves.append(_log_probability(recording, analysis, analysis.labels, analysis.alarm))
    return curves


def _curve(
    recording: rr.RecordingStream, analysis: Analysis, panel: Panel, between: tuple[float, float]
) -> Timed:
    """Shade findings and hatch gaps behind a curve, whose axis has these ends."""
    path, found = f"/{panel.name}", [(e.label, e.start, e.stop) for e in analysis.findings]
    colours = colours_of(analysis)
    log_shades(recording, f"{path}/finding", found, colours, between, "found: ")
    log_gaps(recording, path, analysis.run, between)
    return views.timed(panel, between=between)


def scaled(values: Array) -> tuple[float, str]:
    """A power of ten by which the largest of values in [rad/s] has one digit, and the unit then."""
    largest = float(np.nanmax(values, initial=0.0))
    power = int(np.floor(np.log10(largest))) if largest > 0.0 else 0
    return 10.0**power, "rad/s" if power == 0 else f"{10.0**power:g} rad/s"


def log_noise(
    recording: rr.RecordingStream,
    panel: Panel,
    sides: Mapping[str, Analysis],
    shades: Sequence[colors.Color],
    right: Sequence[Label] = (),
    points: int = NOISE_POINTS,
) -> tuple[float, float]:
    """Log the noise of one run or two on one axis, and what stands beside it; the axis' ends."""
    known = [side.noise[side.run.mask] for side in sides.values()]
    scale, unit = scaled(np.concatenate(known))
    peak = 0.0
    for (which, side), noise, shade in zip(sides.items(), known, shades, strict=True):
        name = which if len(sides) > 1 else f"noise p\u0302 [{unit}]"
        time, values = extremes(side.run.time[side.run.mask], noise[:, None] / scale, points=points)
        views.log_lines(recording, f"/noise/{which}", time, values, {name: shade})
        peak = float(values.max(initial=peak))
    top = 1.08 * max(peak, 0.01)
    right = right or [Label(min(peak / top, 0.9), f"max\n{peak * scale:.3g}")]
    views.log_beside(recording, panel, [Label(0.5, f"noise p\u0302\n[{unit}]")], right)
    return 0.0, top


def _log_level(
    recording: rr.RecordingStream, analysis: Analysis, beside: Comparison | None
) -> Timed:
    (time, level), lowest = analysis.vibration_level, 10.0
    if beside is not None:
        time, level, lowest = beside.time, beside.noise[:, None], beside.octaves[0][0]
        names = [f"{each} repetition [dB re 1 rad/s]" for each in ("quietest", "loudest")]
        band = dict.fromkeys(names, colors.BAND)
        views.log_lines(recording, "/level/repetitions", time, beside.band, band)
    name = f"noise above {lowest:g} Hz [dB re 1 rad/s]"
    views.log_lines(recording, "/level/noise", time, level, {name: colors.LEVEL})
    peak = float(np.nanmax(level, initial=LOW_DB))
    place = min(max((peak - LOW_DB) / (HIGH_DB - LOW_DB), 0.05), 0.85)
    left = level_axis(f"level above\n{lowest:g} Hz [dB re\n1 rad/s]", -20.0)
    views.log_beside(recording, LEVEL, left, [Label(place, f"max\n{views.written(peak)}")])
    return _curve(recording, analysis, LEVEL, (LOW_DB, HIGH_DB))


def level_axis(title: str = "above 10 Hz\n[dB re\n1 rad/s]", shift: float = -22.0) -> list[Label]:
    """The title and the ticks of the axis of levels."""
    ticks, span = (-60.0, -40.0, -20.0, 0.0), HIGH_DB - LOW_DB
    marks = [Label((tick - LOW_DB) / span, views.written(tick), 44.0) for tick in ticks]
    return [Label(0.62, title, shift), *marks]


def _log_probability(
    recording: rr.RecordingStream, analysis: Analysis, labels: Labels, alarm: float
) -> Timed:
    run, middles = analysis.run, (labels.start + labels.stop) / 2
    failure = 1.0 - labels.scores[:, 0]
    # Between frames that a gap parts there is no line.
    apart = np.flatnonzero(labels.start[1:] > labels.stop[:-1] + 1.0 / run.rate) + 1
    middles = np.insert(middles, apart, labels.start[apart])
    failure = np.insert(failure, apart, np.nan)
    line = {"probability of a failure": colors.LEVEL}
    views.log_lines(recording, "/probability/failure", middles, failure[:, None], line)
    ends, line = run.time[[0, -1]], {f"alarm threshold {alarm:g}": colors.THRESHOLD}
    views.log_lines(recording, "/probability/alarm", ends, np.full((2, 1), alarm), line)
    title, mark = Label(0.5, "probability\nof a failure"), Label(alarm, f"alarm {alarm:g}")
    views.log_beside(recording, PROBABILITY, [title], [mark])
    return _curve(recording, analysis, PROBABILITY, (0.0, 1.05))


JOINT_POINTS = 4000  # points of a line, so that a long run has no more than a short one
UNITS = {"velocity": "rad/s", "position": "rad", "effort": "N m"}


class Signal(NamedTuple):
    """A signal of joints."""

    kind: str  # such as "velocity" or "stage planned"
    unit: str  # stages are velocities
    desired: bool
    values: Real  # shape (samples, joints)
    joints: tuple[str, ...]


def signals(run: Run) -> list[Signal]:
    """The signals of a run's joints: velocity, position, effort, stages; desired after measured."""
    names, desired = run.joint_names, run.desired_joint_names
    every: list[tuple[str, bool, Real | None, tuple[str, ...]]] = [
        ("velocity", False, run.velocity, names),
        ("velocity", True, run.velocity_desired, desired),
        ("position", False, run.position, names),
        ("position", True, run.position_desired, desired),
        ("effort", False, run.effort, names),
        *((f"stage {name}", False, stage, names) for name, stage in run.stages.items()),
    ]
    return [
        Signal(kind, UNITS.get(kind, UNITS["velocity"]), wanted, values, joints)
        for kind, wanted, values, joints in every
        if values is not None
    ]


# Entity of a signal, the signal, the samples shown, what is added to names, whether it is dim.
Plotted: TypeAlias = tuple[str, Signal, Mask, str, bool]


def log_joints(
    recording: rr.RecordingStream, run: Run, limbs: Mapping[str, tuple[str, ...]]
) -> list[Part]:
    """Log the joints' signals, at most 4000 points each; tabs of a limb each."""
    plots: dict[str, list[Plotted]] = {}
    for signal in signals(run):
        path = f"/joints/{signal.kind.replace(' ', '_')}{'_desired' * signal.desired}"
        drawn = (path, signal, run.mask, " desired" * signal.desired, signal.desired)
        # The first is drawn below the other.
        plots.setdefault(f"{signal.kind} [{signal.unit}]", []).insert(0, drawn)
    return log_plots(recording, run.time, plots, limbs, JOINT_POINTS)


def log_plots(
    recording: rr.RecordingStream,
    time: Array,
    plots: Mapping[str, Sequence[Plotted]],
    limbs: Mapping[str, tuple[str, ...]],
    points: int,
) -> list[Part]:
    """Log signals, an entity for each limb; a tab for each limb, with its plots as tabs."""
    parts: dict[str, list[Part]] = {limb: [] for limb in limbs}
    for title, signals in plots.items():
        paths: dict[str, list[str]] = {limb: [] for limb in limbs}
        for path, signal, mask, suffix, dim in signals:
            drawn = (time, signal.values)  # a signal without gaps can stay in its file
            drawn = drawn if mask.all() else (time[mask], signal.values[mask])
            shown, values = extremes(*drawn, points=points)
            for number, (limb, joints) in enumerate(limbs.items()):
                colours = dict(zip(joints, colors.of_series(len(joints), dim=dim), strict=True))
                if own := [name for name in joints if name in signal.joints]:
                    columns = [signal.joints.index(name) for name in own]
                    paths[limb].append(f"{path}/{number}")
                    lines = {name + suffix: colours[name] for name in own}
                    views.log_lines(recording, paths[limb][-1], shown, values[:, columns], lines)
        for limb, own in paths.items():
            if own:
                plot = views.plot(title, "/joints", (*own, views.SPAN), legend=True)
                parts[limb].append(plot)
    return [views.tabs(*own, name=limb) for limb, own in parts.items()]


STRIP_ROW = 18.0  # height of a row, in points; what is drawn is lower, so that rows stand apart
STRIP_WIDTH, STROKES = 7.0, 3  # of the lines of a row, in points, and how many there are
ROBOT_SHADES = 16  # colours of the robot
POWER_FLOOR_DB = -20.0  # sound power below this is drawn at it, in [dB re 1 pW]
KEY = Panel("key", 285.0)  # the scale beside the robot


def log_joint_levels(recording: rr.RecordingStream, analysis: Analysis) -> list[Timed]:
    """Log the levels of the joints that vibrate most; nothing without joints."""
    run = analysis.run
    if not run.joint_names:
        return []
    time, level = analysis.joint_levels
    edges = np.append(time, float(run.time[-1]) + 1.0 / run.rate)
    scale, which = levels.JOINTS.following(level), chosen(analysis, time, level)
    title, names = "Joints above 10 Hz", run.joint_names
    return [log_strip(recording, "joints", title, edges, level, names, which, scale)]


# Of levels; what is beyond is as blue or as orange as can be. The number of colours is odd, so that
# no change has one of its own.
CHANGE = Scale(-12.0, 12.0, "dB", step=6.0, palette=colors.diverging, shades=25)


def log_over(recording: rr.RecordingStream, beside: Comparison) -> Timed:
    """Log by how much each joint is louder than its reference: the eight that are most."""
    edges = np.append(beside.time - HOP / 2, beside.time[-1] + HOP / 2)
    which, title, unit = beside.loudest(SHOWN), "Over the reference", ", over the reference [dB]"
    level, names = beside.by_joint, beside.joints
    return log_strip(recording, "over", title, edges, level, names, which, CHANGE, unit)


def log_links(
    recording: rr.RecordingStream, robot: Drawn, analysis: Analysis, noise: LinkNoise
) -> Timed:
    """Log the noise of a robot's links: levels of those that vibrate most, power, colours."""
    time, level = levels.link_levels(noise)
    power = np.maximum(decibel(noise.total / REFERENCE_POWER), POWER_FLOOR_DB)
    views.log_lines(recording, "/power/total", noise.time, power[:, None], {"total": colors.NOISE})
    scale = log_robot_levels(recording, [(robot, noise)], KEY)
    width = float(np.median(np.diff(noise.time))) if len(noise.time) > 1 else levels.STEP
    edges = np.append(time, noise.time[-1] + width / 2)
    title, which = "Links above 10 Hz", chosen(analysis, time, level)
    return log_strip(recording, "links", title, edges, level, noise.links, which, scale)


def log_robot_levels(
    recording: rr.RecordingStream, robots: Sequence[tuple[Drawn, LinkNoise]], key: Panel
) -> Scale:
    """Colour the links of robots by their levels on one scale, and log it as the key; the scale.

    What does not move is as quiet as can be.
    """
    found = [levels.link_levels(noise) for _, noise in robots]
    scale = levels.LINKS.following(np.concatenate([level for _, level in found]))
    rest = rr.Asset3D.from_fields(albedo_factor=scale.colours(np.array([-np.inf])))
    for (robot, noise), (time, level) in zip(robots, found, strict=True):
        rgba = scale.colours(level, shades=ROBOT_SHADES)
        for link in robot.links:
            if link not in noise.links:
                recording.log(robot.path(link), rest, static=True)
                continue
            own = rgba[:, noise.links.index(link)]
            changed = np.concatenate(([True], (own[1:] != own[:-1]).any(axis=1)))
            columns = rr.Asset3D.columns(albedo_factor=own[changed])
            recording.send_columns(robot.path(link), [views.at(time[changed])], columns)
    views.log_scale(recording, key, scale, "dB re\n1 pW")
    return scale


def log_strip(
    recording: rr.RecordingStream,
    name: str,
    title: str,
    edges: Array,
    level: Real,
    names: Sequence[str],
    which: Sequence[int],
    scale: Scale,
    unit: str = "",
) -> Timed:
    """Log levels, shape (columns, rows), of some rows; the panel is as high as these need."""
    own = [names[index] for index in which]
    panel, path = Panel(name, STRIP_ROW * len(own) + views.AXIS), f"/strips/{name}"
    named = [f"{each}{unit or f' [{scale.unit}]'}" for each in own]
    rgba = views.shades(scale, level[:, which].T)
    views.log_rows(recording, path, edges, rgba, names=named, width=STRIP_WIDTH, lines=STROKES)
    views.log_beside(recording, panel, views.row_labels(own), scale)
    return views.timed(panel, path, name=title)


BANDS = 48
LINE_WIDTH = 5.0
HEIGHT = 160.0  # height of a spectrogram, in points


def in_levels(spectrum: Spectrogram) -> tuple[Array, Array, Array]:
    """Middles of columns in [s], edges of bands, and levels in [dB], shape (bands, columns).

    Levels are NaN in gaps.
    """
    low, high = float(spectrum.frequency[0]), float(spectrum.frequency[-1])
    edges = np.geomspace(low, max(high, 1.01 * low), BANDS + 1)
    level = 2 * decibel(in_bands(spectrum.frequency, spectrum.amplitude, edges))
    return spectrum.time, edges, np.where(spectrum.valid, level, np.nan)


def log_heat(
    recording: rr.RecordingStream,
    path: str,
    panel: Panel,
    spectrum: tuple[Array, Array, Array],
    scale: Scale,
    title: str,
) -> None:
    """Log a spectrogram, as `in_levels` has it, and its axis and scale beside its panel."""
    time, edges, level = spectrum
    half = np.diff(time).min(initial=WINDOW) / 2
    ends, rgba = np.append(time - half, time[-1] + half), views.shades(scale, level[::-1])
    names = [f"{centre:.0f} Hz" for centre in np.sqrt(edges[:-1] * edges[1:])[::-1].tolist()]
    views.log_rows(recording, path, ends, rgba, names=names, width=LINE_WIDTH)
    views.log_beside(recording, panel, band_axis(panel, edges, title), scale)


def band_axis(panel: Panel, edges: Array, title: str) -> list[Label]:
    """Title and ticks at the left of a panel of bands, whose axis is logarithmic."""
    labels, (low, high) = [Label(0.5, title, -22.0)], edges[[0, -1]].tolist()
    for tick in views.ticks(low, high, panel):
        text = f"{tick:g} Hz" if tick < 1000 else f"{tick / 1000:g} kHz"
        labels.append(Label(float(np.log(tick / low) / np.log(high / low)), text, 40.0))
    return labels


DETAIL = 0.5  # duration of a detail, in [s]
DETAIL_JOINTS = 5
DETAIL_POINTS = 10_000  # samples of a line; a run at 20 kHz or less is shown whole


def log_details(
    recording: rr.RecordingStream, analysis: Analysis, moments: Sequence[Moment]
) -> list[Part]:
    """Log noise, and the velocities of the joints that vibrate most, sample by sample."""
    run, found = analysis.run, list[Part]()
    for number, moment in enumerate(moments):
        half = max(DETAIL / 2, 4.0 / run.rate)
        edges = (moment.peak - half, moment.peak + half)
        first, last = np.searchsorted(run.time, edges)
        part = slice(int(first), int(last))
        valid = run.mask[part]
        velocity = run.velocity[part].astype(np.float64)
        energy = (vibrating(velocity, valid, run.rate) ** 2).sum(axis=0)
        joints = np.sort(np.argsort(-energy, kind="stable")[:DETAIL_JOINTS])
        path, names = f"/detail/{number}", [run.joint_names[joint] for joint in joints]
        shades = dict(zip(names, colors.of_series(len(names)), strict=True))
        for kind, values, lines in (
            ("noise", analysis.noise[part, None], {"simplified": colors.NOISE}),
            ("velocity", velocity[:, joints], shades),
        ):
            thin = extremes(run.time[part][valid], values[valid], points=DETAIL_POINTS)
            views.log_lines(recording, f"{path}/{kind}", *thin, lines)
        title = f"Velocities [rad/s], {spoken(moment.label)} at {moment.peak:.2f} s"
        found += [
            views.plot(title, f"{path}/velocity", legend=True, during=edges),
            views.plot("Noise [rad/s]", f"{path}/noise", during=edges),
        ]
    return found
