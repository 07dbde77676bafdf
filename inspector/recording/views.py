"""What rerun draws: views, their arrangement, and lines, rows and labels over time.

Rerun 0.41 labels a plot's axis with plain numbers, and makes room for the widest of them, so that
plots of other numbers have other edges. It has no colour bar, no names of rows and no heat map over
time. Here, every panel has an axis on which rerun writes one digit if anything: rows lie between 0
and `TOP`, and curves are scaled by powers of ten. A line whose colour changes is a row of a heat
map. Everything else is drawn in a narrow view at either side.

All of rerun's API that is marked unstable is here and in `viewer`: ``rerun.blueprint`` and the
defaults of its views, all explicit here; ``ViewCoordinates``; ``Measurements``, whose band shades
findings; the end of a recording's file, and what rerun waits for if it cannot be written.
"""

import ctypes
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from inspector import colors
from inspector.colors import Color
from inspector.errors import InspectorError
from inspector.levels import Scale
from noiseclassifier.matching import union
from noisemodel.types import Array, Real

Part: TypeAlias = rrb.View | rrb.Container  # a view, or views that are arranged
TIMELINE = "time"
TOP = 9.99  # upper end of the axis of rows
ROWS = 0.0, TOP
PLOTS = colors.BACKGROUNDS[0]
# Behind a robot, lighter than a quiet one, and the lines of its floor.
ROBOT, GRID = (80, 84, 94), (112, 116, 126, 130)


def has_end(recording: Path) -> bool:
    """Whether a file ends as a recording does that was written whole."""
    with recording.open("rb") as file:
        file.seek(max(0, recording.stat().st_size - 12))
        return file.read().startswith(b"RRF2FOOT")


def plot(
    name: str,
    origin: str,
    paths: Sequence[str] = ("$origin/**",),
    *,
    legend: bool = False,
    between: tuple[float, float] | None = None,
    during: tuple[float, float] | None = None,
    last: float | None = None,
    titled: bool = True,
) -> Part:
    """Plot scalars over time.

    Args:
        between: Range of values that is shown, fixed for rows; by default the range of the lines.
        during: Stretch of time that is shown, in [s]; by default as in all other views.
        last: Time up to the cursor that is shown in place of that, in [s].
    """
    time, corner = rrb.TimeAxis(link="LinkToGlobal"), rrb.Corner2D.RightTop
    if during is not None:
        start, stop = (rrb.TimeRangeBoundary.absolute(seconds=each) for each in during)
        alone = rrb.TimeRange(start=start, end=stop)
        time = rrb.TimeAxis(link="Independent", view_range=alone)
    if last is not None:
        start = rrb.TimeRangeBoundary.cursor_relative(seconds=-last)
        ending = rrb.TimeRange(start=start, end=rrb.TimeRangeBoundary.cursor_relative())
        time, corner = rrb.TimeAxis(view_range=ending), rrb.Corner2D.LeftTop  # the newest is right
    return rrb.TimeSeriesView(
        origin=origin,
        contents=list(paths),
        name=name,
        plot_legend=rrb.PlotLegend(corner, visible=legend),
        axis_x=time,
        background=rrb.archetypes.PlotBackground(color=PLOTS),  # in light themes, too
        axis_y=between and rrb.ScalarAxis(range=between, zoom_lock=between == ROWS),
        titlebar=None if titled else False,
    )


def drawing(origin: str) -> Part:
    """Draw points and lines beside a plot: 0 is at its top and 1 at its bottom."""
    return rrb.Spatial2DView(
        origin=origin,
        visual_bounds=rrb.VisualBounds2D(x_range=(-0.001, 0.001), y_range=(0.0, 1.0)),
        background=rrb.Background(color=PLOTS),
        titlebar=False,
    )


@dataclass(frozen=True, eq=False)
class Camera:
    """Where a view of a robot is seen from, and what at, shape (3,), in [m]."""

    eye: Array
    target: Array
    floor: float  # height of the floor, in [m]
    spacing: float  # distance of the lines on the floor, in [m]
    frame: str = ""  # frame of transforms that the view is drawn in, and all this
    # Whether that frame moves with a base, over a floor that is drawn by itself.
    moves: bool = False


def robot(name: str, origin: str, camera: Camera) -> Part:
    """Draw what moves, on its floor, from where a camera stands."""
    return rrb.Spatial3DView(
        origin="/",
        contents=[f"{origin}/**"],
        name=name,
        spatial_information=rrb.SpatialInformation(target_frame=camera.frame),
        background=rrb.Background(color=ROBOT),
        line_grid=rrb.LineGrid3D(
            visible=not camera.moves,
            spacing=camera.spacing,
            plane=rr.components.Plane3D.XY.with_distance(camera.floor),
            color=GRID,
        ),
        eye_controls=rrb.EyeControls3D(
            position=camera.eye,
            look_target=camera.target,
            eye_up=(0.0, 0.0, 1.0),
        ),
    )


def text(name: str, *, titled: bool = True) -> Part:
    """Show the report."""
    return rrb.TextDocumentView(origin="/report", name=name, titlebar=None if titled else False)


def events(name: str) -> Part:
    """List the events; a click on the time of one goes there."""
    columns = rrb.TextLogColumns(text_log_columns=["Body"])
    return rrb.TextLogView(origin="/events", name=name, columns=columns)


def tabs(*parts: Part, name: str | None = None) -> Part:
    """Put parts behind each other as tabs; the first is shown."""
    return rrb.Tabs(*parts, active_tab=0, name=name)


def above(*parts: tuple[Part, float]) -> Part:
    """Put parts above each other, each with its share of the height."""
    shares = [share for _, share in parts]
    return rrb.Vertical(*(part for part, _ in parts), row_shares=shares)


def beside(*parts: tuple[Part, float], name: str | None = None) -> Part:
    """Put parts beside each other, each with its share of the width."""
    shares = [share for _, share in parts]
    return rrb.Horizontal(*(part for part, _ in parts), column_shares=shares, name=name)


def blueprint(
    content: Part, loop: tuple[float, float] | None = None, *, following: bool = False
) -> rrb.Blueprint:
    """Fill the window with a part; playing repeats a stretch of time, if there is one, in [s]."""
    selected = loop and rrb.components.AbsoluteTimeRange(*(round(1e9 * each) for each in loop))
    time = rrb.TimePanel(
        state="collapsed",
        timeline=TIMELINE,
        play_state="following" if following else "paused",
        loop_mode="selection" if loop else None,
        time_selection=selected,
    )
    return rrb.Blueprint(
        content,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        time,
        auto_views=False,
        auto_layout=False,
    )


COPIES = 12  # bands upon each other that are all but opaque


def log_stretches(
    recording: rr.RecordingStream,
    path: str,
    stretches: Sequence[tuple[float, float]],
    between: tuple[float, float],
    name: str,
    color: Color,
    *,
    opaque: bool = False,
) -> None:
    """Shade stretches of time, in [s], in a plot, if there are any; rerun cannot annotate them.

    The band of a measurement, one standard deviation to either side, is filled to its exact edges;
    a thick line has round ends. It is translucent, and several of them are opaque.
    """
    if not stretches:
        return
    copies = COPIES if opaque else 1
    middle, half = (between[0] + between[1]) / 2, (between[1] - between[0]) / 2
    whole = np.round(1e9 * np.array(stretches)).astype(np.int64)
    start, after = union(whole + np.array([0, 1])).T
    apart = np.stack((start, after - 1, after), axis=1)  # a value that is none ends a band
    values = np.tile([middle, middle, np.nan], len(apart))[:, None].repeat(copies, axis=1)
    style_bands(recording, path, {name: color}, copies)
    index = rr.TimeColumn(TIMELINE, duration=apart.ravel().astype("timedelta64[ns]"))
    recording.send_columns(path, indexes=[index], columns=band_columns(values, half))


def style_bands(
    recording: rr.RecordingStream, path: str, bands: Mapping[str, Color], copies: int
) -> None:
    """Log names and colours of bands that `band_columns` draws, each so many times."""
    style = rr.Measurements.from_fields(
        names=[name for name in bands for _ in range(copies)],
        colors=[shade for shade in bands.values() for _ in range(copies)],
        widths=[0.0] * len(bands) * copies,
    )
    recording.log(path, style, static=True)


def band_columns(middles: Array, half: float) -> Iterable[Any]:
    """Columns of bands along a plot, shape (points, bands); NaN draws nothing."""
    return rr.Measurements.columns(values=middles, variances=np.full_like(middles, half**2))


def abandon(recording: rr.RecordingStream) -> None:
    """Leave a recording as it is until the process ends: nothing takes what it holds.

    Rerun 0.41 may wait for a file or a viewer without end: to disconnect, to delete the recording,
    and when the process ends.
    """
    for each in (recording, recording.inner):
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(each))
    rr.unregister_shutdown()


SPAN = "/span"  # lies in every plot over time, so that it reaches from the start to the end
FARTHEST = 9e9  # rerun counts nanoseconds in 64 bits: 292 years, in [s]


def at(time: Array) -> rr.TimeColumn:
    """Index columns by seconds from the start of the run."""
    return rr.TimeColumn(TIMELINE, duration=np.round(time * 1e9).astype("timedelta64[ns]"))


def log_span(recording: rr.RecordingStream, begin: float, end: float) -> None:
    """Log that plots reach from one time to another, in [s], whatever they show."""
    if not max(abs(begin), abs(end)) < FARTHEST:
        most = f"a recording holds times within {FARTHEST:g} s; let the log begin at 0"
        raise InspectorError(f"times from {begin:g} s to {end:g} s: {most}")
    log_lines(recording, SPAN, np.array([begin, end]), np.full((2, 1), np.nan), {"": INK})


def scalars(values: Real) -> list[rr.ComponentColumn]:
    """Make columns as ``rr.Scalars.columns`` does, at a third of its cost."""
    width = values[:1].size
    batch = rr.components.ScalarBatch(np.ascontiguousarray(values).ravel())
    edges = np.arange(len(values) + 1, dtype=np.int32) * np.int32(width)
    return [rr.ComponentColumn(rr.Scalars.descriptor_scalars(), batch, offsets=edges)]


def log_lines(
    recording: rr.RecordingStream, path: str, time: Array, values: Real, lines: Mapping[str, Color]
) -> None:
    """Log lines, shape (samples, lines), at times in [s]: each has its name and its colour."""
    style_lines(recording, path, names=lines, colours=lines.values())
    recording.send_columns(path, indexes=[at(time)], columns=scalars(values))


def style_lines(
    recording: rr.RecordingStream, path: str, *, names: Collection[str], colours: Iterable[Color]
) -> None:
    """Log how the lines of one entity are drawn; see `log_lines`."""
    # Rerun's default aggregation draws the mean of a pixel's extremes, which hides vibration.
    style = rr.SeriesLines(
        names=list(names),
        colors=list(colours),
        widths=[1.0] * len(names),
        aggregation_policy="MinMax",
    )
    recording.log(path, style, static=True)


def log_events(
    recording: rr.RecordingStream,
    events: Iterable[tuple[float, str, Color]],
    warnings: Sequence[bool] | None = None,
) -> None:
    """List events: time in [s], line of text and colour of each."""
    time, text, colours = zip(*events, strict=True)
    level = None if warnings is None else ["WARN" if each else "INFO" for each in warnings]
    rgba = np.array([(*color, 255) for color in colours], np.uint8)
    columns = rr.TextLog.columns(text=text, level=level, color=rgba)
    recording.send_columns("/events", indexes=[at(np.array(time))], columns=columns)


INK, WHITE = (205, 208, 214), (255, 255, 255)
VERDICT = 38.0  # height of a verdict, in points
AXIS = 18.0  # height of a panel's time axis, in points
TEXT = 13.0  # rerun writes a label below its point: from there to the label's middle, in points
HALF = 10.0  # half of the height of a label, in points: none is cut by the upper edge
LINE = 16.0  # height of a further line of a label, in points
LEFT, MIDDLE, RIGHT = 14.0, 78.0, 8.0  # shares of the width: names and ticks, the panel, its scale
STEPS = 24  # colours of a scale
# Factor from the height of a panel in a window of 1440 x 900 to its height between that and one of
# 1920 x 1080: labels stand as well in either.
GROWN = 1.15
APART = 17.0  # least distance of two ticks, in points


@dataclass(frozen=True)
class Panel:
    """A panel over time; what is beside it lies at its name below ``/axis``."""

    name: str
    # With its time axis, in points, in a window of 1440 x 900; it grows with the window.
    height: float

    def y(self, place: float) -> float:
        """Where a label is put in the view beside the panel, so that it stands at a place in it."""
        height = GROWN * self.height
        middle = max((1.0 - place) * (height - AXIS), HALF)
        return (middle - TEXT) / height


@dataclass(frozen=True)
class Label:
    """A text beside a panel."""

    place: float  # its height in the panel, from 0 at the bottom to 1 at the top
    text: str
    shift: float = 0.0  # from the middle of the view beside the panel to the right, in points
    color: Color = INK


def log_beside(
    recording: rr.RecordingStream,
    panel: Panel,
    left: Sequence[Label],
    right: Sequence[Label] | Scale,
) -> None:
    """Log what stands beside a panel: its title, names of rows, ticks, and labels or a scale."""
    log_labels(recording, panel, "left", left)
    if isinstance(right, Scale):
        log_scale(recording, panel, right)
    else:
        log_labels(recording, panel, "right", right)


def log_scale(recording: rr.RecordingStream, panel: Panel, scale: Scale, title: str = "dB") -> None:
    """Log a scale of colours at the right of a panel, with its ticks in decibels."""
    shift = -22.0 / panel.height
    below = 2.0 * HALF + LINE * title.count("\n") + HALF  # the title ends, the highest tick begins
    top = 1.0 - below / (GROWN * panel.height - AXIS)
    low = 0.04
    highest, lowest = (panel.y(place) + TEXT / (GROWN * panel.height) for place in (top, low))
    edges = np.linspace(lowest, highest, STEPS + 1)
    shades = scale.colours(np.linspace(scale.low, scale.high, STEPS))
    strips = [[[shift, low], [shift, high]] for low, high in pairwise(edges.tolist())]
    bar = rr.LineStrips2D(strips, colors=shades, radii=rr.Radius.ui_points(6.0))
    recording.log(f"/axis/{panel.name}/right/scale", bar, static=True)
    room = max(1.0, (top - low) * (GROWN * panel.height - AXIS) / LINE)  # of labels
    every = int(np.ceil(len(scale.ticks) / room))
    ticks = [
        Label(low + (top - low) * float(scale.place(np.array(tick))), written(tick), 8.0)
        for tick in scale.ticks[::-every][::-1]
    ]
    log_labels(recording, panel, "right", [*ticks, Label(1.0, title)])


def log_labels(
    recording: rr.RecordingStream, panel: Panel, side: str, labels: Sequence[Label]
) -> None:
    """Log labels at one side of a panel."""
    places = [(label.shift / panel.height, panel.y(label.place)) for label in labels]
    drawn = texts(places, [label.text for label in labels], [label.color for label in labels])
    recording.log(f"/axis/{panel.name}/{side}", drawn, static=True)


def texts(
    places: Sequence[tuple[float, float]], words: Sequence[str], colours: Sequence[Color]
) -> rr.Points2D:
    """Texts in a plane, each below its place."""
    return rr.Points2D(
        places, labels=words, colors=colours, radii=rr.Radius.ui_points(0.0), show_labels=True
    )


# What a plot shows: all that lies below its path, from the start to the end.
ALL = ("$origin/**", SPAN)


Timed: TypeAlias = tuple[Part, float]  # a panel over time with its height, in points


def timed(
    panel: Panel,
    path: str = "",
    *,
    title: str | None = None,
    name: str | None = None,
    between: tuple[float, float] | None = ROWS,
    paths: Sequence[str] = ALL,
    legend: bool = False,
    last: float | None = None,
) -> Timed:
    """A panel of what lies below a path, its own unless given, with what stands beside it.

    Args:
        name: What its tab is called.
        between: Ends of its axis, those of rows by default; that of its lines if None.
        last: See `plot`.
    """
    path = path or f"/{panel.name}"
    lines = plot(
        path.rpartition("/")[2] if title is None else title,
        path,
        paths,
        between=between,
        titled=False,
        legend=legend,
        last=last,
    )
    left, right = (drawing(f"/axis/{panel.name}/{side}") for side in ("left", "right"))
    parts = (left, LEFT), (lines, MIDDLE), (right, RIGHT)
    return beside(*parts, name=name), panel.height


def row_labels(names: Sequence[str], colours: Sequence[Color] = ()) -> list[Label]:
    """Names of rows, the first at the top."""
    shades = colours or [INK] * len(names)
    return [
        Label(1.0 - (row + 0.5) / len(names), name, color=shade)
        for row, (name, shade) in enumerate(zip(names, shades, strict=True))
    ]


def middles(count: int) -> list[float]:
    """Where rows lie on their axis, the first at the top."""
    return [TOP * (1.0 - (row + 0.5) / count) for row in range(count)]


def written(level: float) -> str:
    """A level in a label, in [dB]."""
    return f"{level:z.0f}".replace("-", "\u2212")


def ticks(low: float, high: float, panel: Panel) -> list[float]:
    """Round values on a logarithmic axis, as close as their labels allow: 1, 2, 5, 10, ..."""
    decade = (panel.height - AXIS) / np.log10(high / low)
    powers = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    for factors in ((1, 2, 5), (1, 3), (1,)):
        gaps = np.log10(np.append(factors[1:], 10) / np.array(factors))
        if gaps.min() * decade >= APART:
            break
    values = np.outer(powers, factors).ravel()
    top = high / 10.0 ** (HALF / 2 / decade)  # so that it is not above its place
    return [float(value) for value in values if low * 0.999 <= value <= top]


def log_verdict(
    recording: rr.RecordingStream, verdict: str, text: str, time: float | None = None
) -> Timed:
    """Log a verdict, a key of ``colors.VERDICTS``, for all times or from one on, in [s]."""
    band = rr.LineStrips2D(
        [[(-99.0, 0.5), (99.0, 0.5)]],
        colors=[colors.VERDICTS[verdict]],
        radii=rr.Radius.ui_points(60.0),
    )
    words = texts([(0.0, 0.5 - TEXT / VERDICT)], [text], [WHITE])
    if time is not None:
        recording.set_time(TIMELINE, duration=time)
    for path, drawn in (("band", band), ("words", words)):
        recording.log(f"/verdict/{path}", drawn, static=time is None)
    recording.reset_time()
    return drawing("/verdict"), VERDICT


# Colour of a row where nothing is known: the viewer's background.
EMPTY = (*colors.BACKGROUNDS[0], 255)


def log_rows(
    recording: rr.RecordingStream,
    path: str,
    edges: Array,
    rgba: NDArray[np.uint8],
    *,
    names: Sequence[str],
    width: float,
    lines: int = 1,
) -> None:
    """Log rows of colours, shape (rows, columns, 4), the first at the top, between edges in [s]."""
    apart = (np.arange(lines) - (lines - 1) / 2) * TOP / len(names) / (lines + 1)
    for row, (name, place) in enumerate(zip(names, middles(len(names)), strict=True)):
        entity, own = f"{path}/{row:02d}", rgba[row]
        style = rr.SeriesLines(
            names=[name] * lines, widths=[width] * lines, aggregation_policy="Off"
        )
        recording.log(entity, style, static=True)
        # A segment takes the colour of its end.
        kept = np.concatenate(([True], (own[1:] != own[:-1]).any(axis=1), [True]))
        shown = np.concatenate((own[:1], own))[kept]
        columns = shaded(place + apart, shown[:, None].repeat(lines, axis=1))
        recording.send_columns(entity, indexes=[at(edges[kept])], columns=columns)


def shaded(places: Array, rgba: NDArray[np.uint8]) -> list[Any]:
    """Columns of lines at fixed places that change colour, shape (columns, lines, 4)."""
    count, width, _ = rgba.shape
    colours = rr.SeriesLines.columns(colors=rgba.reshape(-1, 4)).partition([width] * count)
    return [*scalars(np.tile(places, (count, 1))), *colours]


def shades(scale: Scale, level: Real) -> NDArray[np.uint8]:
    """Colours of levels in [dB] in rows, shape (rows, columns, 4); none where one is NaN."""
    unknown = np.isnan(level)
    rgba = scale.colours(np.asarray(np.where(unknown, scale.low, level)), shades=scale.shades)
    rgba[unknown] = EMPTY
    return rgba
