"""How a live recording is laid out: as that of a whole run, but it follows."""

from collections.abc import Sequence
from dataclasses import dataclass

import rerun.blueprint as rrb

from inspector.live.strip import QUIETEST_DB, TOP_HZ
from inspector.series import TIMELINE

SHOWN = 10.0
"""Time that plots reach back, in [s]."""


@dataclass(frozen=True)
class Contents:
    """What there is to show.

    Attributes:
        joints: Title and entity paths of each plot of joint signals.
        root: Frame that the robot is seen from; None without a robot.
        classes: Whether there are classes.
        rate: Samples per second, in [Hz].
    """

    joints: Sequence[tuple[str, Sequence[str]]]
    root: str | None
    classes: bool
    rate: float


def layout(contents: Contents) -> rrb.Blueprint:
    """Lay a live recording out; every plot shows the last ten seconds.

    Args:
        contents: What there is to show.
    """
    top = min(TOP_HZ, contents.rate / 2)
    parts: list[tuple[rrb.View | rrb.Container, float]] = [
        (_plot("/noise", "Noise, simplified estimate [rad/s]"), 2.2),
        (
            _plot(
                "/spectrogram",
                f"Spectrogram of the noise, 0-{top:.0f} Hz, {QUIETEST_DB:.0f}-0 dB re 1 rad/s",
                between=(0.0, top),
            ),
            2.8,
        ),
        (_details(contents), 4.2),
    ]
    if contents.classes:
        lanes = rrb.StateTimelineView(origin="/class", name="Classes", time_view=_last())
        parts.insert(0, (lanes, 1.6))
    right = rrb.Vertical(*(part for part, _ in parts), row_shares=[share for _, share in parts])
    left: rrb.View | rrb.Container = rrb.TextLogView(origin="/events", name="Events")
    if contents.root is not None:
        left = rrb.Vertical(_robot(contents.root), left, row_shares=[3, 2])
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[2, 3]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following"),
        auto_views=False,
        auto_layout=False,
    )


def _last() -> rrb.TimeAxis:
    return rrb.TimeAxis(
        view_range=rrb.TimeRange(
            start=rrb.TimeRangeBoundary.cursor_relative(seconds=-SHOWN),
            end=rrb.TimeRangeBoundary.cursor_relative(),
        )
    )


def _plot(
    origin: str,
    name: str,
    paths: Sequence[str] = ("$origin/**",),
    *,
    legend: bool = False,
    between: tuple[float, float] | None = None,
) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=origin,
        contents=list(paths),
        name=name,
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop, visible=legend),
        axis_x=_last(),
        axis_y=None if between is None else rrb.ScalarAxis(range=between, zoom_lock=True),
    )


def _details(contents: Contents) -> rrb.Tabs:
    plots = [_plot("/joints", title, paths, legend=True) for title, paths in contents.joints]
    if contents.classes:
        plots.append(_plot("/score", "Scores", legend=True))
    return rrb.Tabs(*plots, active_tab=0)


def _robot(root: str) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin="/",
        contents=["/robot/**"],
        name="Robot",
        spatial_information=rrb.SpatialInformation(target_frame=root),
        background=rrb.Background(color=(24, 26, 30)),
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.5, color=(70, 74, 82, 130)),
    )
