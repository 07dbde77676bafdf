"""Every API of rerun that is marked unstable: views, their arrangement, panels, bands.

As of 0.41, these change between versions: ``rerun.blueprint`` and the defaults of its views, all
explicit here; ``ViewCoordinates``; ``Measurements``, whose band shades findings;
``rerun.experimental``; the end of a recording's file, and what rerun waits for if it cannot be
written. When rerun moves on, this module follows and no other.
"""

import ctypes
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from inspector import colors
from noisemodel.types import Array

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient


Part: TypeAlias = rrb.View | rrb.Container  # a view, or views that are arranged
TIMELINE = "time"
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
    fixed: bool = False,
    during: tuple[float, float] | None = None,
    last: float | None = None,
    titled: bool = True,
) -> Part:
    """Plot scalars over time.

    Args:
        between: Range of values that is shown; by default the range of the lines.
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
        axis_y=None if between is None else rrb.ScalarAxis(range=between, zoom_lock=fixed),
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


def text(name: str, origin: str, *, titled: bool = True) -> Part:
    """Show a document."""
    return rrb.TextDocumentView(origin=origin, name=name, titlebar=None if titled else False)


def events(name: str, origin: str) -> Part:
    """List log lines; a click on the time of one goes there."""
    columns = rrb.TextLogColumns(text_log_columns=["Body"])
    return rrb.TextLogView(origin=origin, name=name, columns=columns)


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
    playing: Literal["following", "paused"] = "following" if following else "paused"
    selected = None if loop is None else rrb.components.AbsoluteTimeRange(*map(_nanoseconds, loop))
    time = rrb.TimePanel(
        state="collapsed",
        timeline=TIMELINE,
        play_state=playing,
        loop_mode=None if loop is None else "selection",
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
    *,
    between: tuple[float, float],
    name: str,
    color: tuple[int, int, int],
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
    apart: list[tuple[int, int]] = []
    for start, stop in sorted(
        (_nanoseconds(start), _nanoseconds(stop)) for start, stop in stretches
    ):
        if apart and start <= apart[-1][1] + 1:
            start, stop = apart[-1][0], max(stop, apart.pop()[1])
        apart.append((start, stop))
    # A value that is none ends a band.
    times = np.array([(start, stop, stop + 1) for start, stop in apart], dtype=np.int64).ravel()
    values = np.tile([middle, middle, np.nan], len(apart))[:, None].repeat(copies, axis=1)
    style_bands(recording, path, [name], [color], copies)
    index = rr.TimeColumn(TIMELINE, duration=times.astype("timedelta64[ns]"))
    recording.send_columns(path, indexes=[index], columns=band_columns(values, half))


def style_bands(
    recording: rr.RecordingStream,
    path: str,
    names: Sequence[str],
    shades: Sequence[tuple[int, int, int]],
    copies: int,
) -> None:
    """Log names and colours of bands that `band_columns` draws, each so many times."""
    style = rr.Measurements.from_fields(
        names=[name for name in names for _ in range(copies)],
        colors=[shade for shade in shades for _ in range(copies)],
        widths=[0.0] * len(names) * copies,
    )
    recording.log(path, style, static=True)


def band_columns(middles: Array, half: float) -> Iterable[Any]:
    """Columns of bands along a plot, shape (points, bands); NaN draws nothing."""
    return rr.Measurements.columns(values=middles, variances=np.full_like(middles, half**2))


def log_up(recording: rr.RecordingStream) -> None:
    """Log that z points upwards, in right-handed axes."""
    recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)


def client(address: str) -> "ViewerClient":
    """Client of a viewer that runs, for its state and for pictures; may raise any exception."""
    from rerun.experimental import ViewerClient

    return ViewerClient.connect(address)


def _nanoseconds(seconds: float) -> int:
    return round(seconds * 1e9)


def abandon(recording: rr.RecordingStream) -> None:
    """Leave a recording as it is until the process ends: nothing takes what it holds.

    Rerun 0.41 may wait for a file or a viewer without end: to disconnect, to delete the recording,
    and when the process ends.
    """
    for each in (recording, recording.inner):
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(each))
    rr.unregister_shutdown()
