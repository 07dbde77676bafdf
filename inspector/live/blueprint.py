"""How a live recording is laid out: as that of a whole run, but it follows."""

from collections.abc import Sequence
from dataclasses import dataclass

from rerun.blueprint import Blueprint

from inspector.live.drawing import NOISE_PANEL, SIGNALS_PANEL, SPECTROGRAM_PANEL
from inspector.live.robot import KEY
from inspector.recording import axes, unstable
from inspector.recording.axes import Panel
from inspector.recording.camera import Camera
from inspector.recording.series import TIMELINE
from inspector.recording.unstable import Part

SHOWN = 10.0
"""Time that plots reach back, in [s]."""


@dataclass(frozen=True)
class Contents:
    """What there is to show.

    Attributes:
        joints: Title and entity paths of each plot of joint signals.
        camera: From where the robot is seen; None without one.
        classes: Where the classes are drawn; None without any.
        links: Whether the links are coloured.
        rate: Samples per second, in [Hz].
        start: Time of the first sample, in [s].
        full: Whether the last ten seconds are all after that.
    """

    joints: Sequence[tuple[str, Sequence[str]]]
    camera: Camera | None
    classes: Panel | None
    links: bool
    rate: float
    start: float
    full: bool


def layout(contents: Contents) -> Blueprint:
    """Lay a live recording out; every plot shows ten seconds: the first, and then the last.

    Args:
        contents: What there is to show.
    """
    noise = _plot(contents, "/noise", "Noise", titled=False)
    bands = _plot(contents, "/spectrogram", "Spectrum", between=(0.0, axes.TOP), titled=False)
    over_time = [
        (axes.part(NOISE_PANEL, noise), NOISE_PANEL.height),
        (axes.part(SPECTROGRAM_PANEL, bands), SPECTROGRAM_PANEL.height),
        (_signals(contents), SIGNALS_PANEL.height),
    ]
    if contents.classes is not None:
        rows = _plot(contents, "/class", "Classes", between=(0.0, axes.TOP), titled=False)
        over_time.insert(0, (axes.part(contents.classes, rows), contents.classes.height))
    findings = unstable.text("Findings", "/report", titled=False)
    left = [(findings, 2.0), (unstable.events("Events", "/events"), 1.4)]
    if contents.camera is not None:
        title = "Robot, links coloured by level above 10 Hz" if contents.links else "Robot"
        robot = unstable.robot(title, "/robot", contents.camera)
        if contents.links:
            key = unstable.drawing(f"/axis/{KEY.name}/right")
            robot = unstable.beside((robot, 88.0), (key, 12.0))
        left.insert(1, (robot, 3.4))
    whole = unstable.beside((unstable.above(*left), 36.0), (unstable.above(*over_time), 64.0))
    return unstable.blueprint(whole, TIMELINE, following=True)


def _shown(contents: Contents) -> tuple[tuple[float, float] | None, float | None]:
    """What plots show: a stretch of time at first, so that it begins with the samples, or a last.

    Before ten seconds are over, the last ten begin before the first sample.
    """
    if contents.full:
        return None, SHOWN
    return (contents.start, contents.start + SHOWN), None


def _plot(
    contents: Contents,
    origin: str,
    name: str,
    paths: Sequence[str] = ("$origin/**",),
    *,
    legend: bool = False,
    between: tuple[float, float] | None = None,
    titled: bool = True,
) -> Part:
    during, last = _shown(contents)
    return unstable.plot(
        name,
        origin,
        paths,
        legend=legend,
        between=between,
        fixed=True,
        during=during,
        last=last,
        titled=titled,
    )


def _signals(contents: Contents) -> Part:
    plots = {
        title: _plot(contents, "/joints", title, paths, legend=True, titled=False)
        for title, paths in contents.joints
    }
    if contents.classes is not None:
        plots["Scores"] = _plot(contents, "/score", "Scores", legend=True, titled=False)
    return unstable.tabs(
        *(axes.part(SIGNALS_PANEL, plot, name=name) for name, plot in plots.items())
    )
