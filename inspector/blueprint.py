"""How a recording is laid out: robot and report at the left, everything over time at the right."""

from collections.abc import Sequence
from dataclasses import dataclass

import rerun.blueprint as rrb

from inspector.series import TIMELINE, TOP_HZ


@dataclass(frozen=True)
class Contents:
    """What a recording holds, as far as the layout goes.

    Attributes:
        joints: Title and entity paths of each plot of joint signals.
        root: Frame that the robot is seen from; None without a robot.
        links: Whether there is noise of links.
        terms: Whether there are the paper's terms A, B and C.
        scores: Whether there are scores.
        lanes: Whether there are found or annotated classes.
        rate: Samples per second, in [Hz].
    """

    joints: Sequence[tuple[str, Sequence[str]]]
    root: str | None
    links: bool
    terms: bool
    scores: bool
    lanes: bool
    rate: float


def layout(contents: Contents) -> rrb.Blueprint:
    """Lay out a recording.

    Args:
        contents: What there is to show.

    Returns:
        The blueprint; all time axes are linked.
    """
    over_time: list[tuple[rrb.View | rrb.Container, float]] = []
    if contents.lanes:
        over_time.append((_lanes(), 2.6))
    over_time.append((_noise(), 2.2))
    if contents.links:
        over_time.append((_power(contents), 2.2))
    over_time += [(_spectrogram(contents), 2.8), (_details(contents), 4.2)]
    right = rrb.Vertical(
        *(part for part, _ in over_time), row_shares=[share for _, share in over_time]
    )
    text = rrb.Tabs(
        rrb.TextDocumentView(origin="/report", name="Report"),
        rrb.TextLogView(origin="/events", name="Events"),
    )
    left: rrb.Container = text
    if contents.root is not None:
        left = rrb.Vertical(_robot(contents.root, coloured=contents.links), text, row_shares=[3, 2])
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[2, 3]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="paused"),
        auto_views=False,
        auto_layout=False,
    )


def _time_axis() -> rrb.TimeAxis:
    return rrb.TimeAxis(link="LinkToGlobal")


def _robot(root: str, *, coloured: bool) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin="/",
        contents=["/robot/**"],
        name="Robot, coloured by vibration" if coloured else "Robot",
        spatial_information=rrb.SpatialInformation(target_frame=root),
        background=rrb.Background(color=(24, 26, 30)),
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.5, color=(70, 74, 82, 130)),
    )


def _lanes() -> rrb.StateTimelineView:
    return rrb.StateTimelineView(origin="/class", name="Classes", time_view=_time_axis())


def _noise() -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin="/noise",
        name="Noise, simplified estimate [rad/s]",
        plot_legend=rrb.PlotLegend(visible=False),
        axis_x=_time_axis(),
    )


def _power(contents: Contents) -> rrb.Tabs:
    def plot(name: str, *paths: str) -> rrb.TimeSeriesView:
        return rrb.TimeSeriesView(
            origin="/power",
            contents=list(paths),
            name=name,
            plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
            axis_x=_time_axis(),
        )

    plots = [
        plot("Sound power, extended estimate [dB re 1 pW]", "/power/total"),
        plot("loudest links", "/power/links/**"),
    ]
    if contents.terms:
        plots.append(plot("terms A, B, C", "/power/terms/**", "/power/total"))
    return rrb.Tabs(*plots, active_tab=0)


def _levels() -> rrb.StateTimelineView:
    return rrb.StateTimelineView(
        origin="/level", name="Loudest links, above 10 Hz", time_view=_time_axis()
    )


def _spectrogram(contents: Contents) -> rrb.Tabs:
    top = min(TOP_HZ, contents.rate / 2)
    return rrb.Tabs(
        rrb.TimeSeriesView(
            origin="/spectrogram/bands",
            name=f"Spectrogram of the noise, 0-{top:.0f} Hz",
            plot_legend=rrb.PlotLegend(visible=False),
            axis_x=_time_axis(),
            axis_y=rrb.ScalarAxis(range=(0.0, top), zoom_lock=True),
        ),
        rrb.TensorView(
            origin="/spectrogram/levels",
            name=f"to {contents.rate / 2:.0f} Hz [dB]",
            scalar_mapping=rrb.TensorScalarMapping(colormap="inferno", mag_filter="Linear"),
            view_fit="fill",
        ),
        active_tab=0,
    )


def _details(contents: Contents) -> rrb.Tabs:
    plots: list[rrb.View] = [_levels()] if contents.links else []
    plots += [
        rrb.TimeSeriesView(
            origin="/joints",
            contents=list(paths),
            name=title,
            plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
            axis_x=_time_axis(),
        )
        for title, paths in contents.joints
    ]
    if contents.scores:
        plots.append(
            rrb.TimeSeriesView(
                origin="/score",
                name="Scores",
                plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
                axis_x=_time_axis(),
            )
        )
    return rrb.Tabs(*plots, active_tab=0)
