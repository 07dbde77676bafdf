"""How a live recording is laid out: as that of a whole run, but it follows."""

from collections.abc import Sequence
from dataclasses import dataclass

from rerun.blueprint import Blueprint

from inspector.live.spectrogram import FLOOR_DB
from inspector.recording import unstable
from inspector.recording.camera import Camera
from inspector.recording.series import TIMELINE
from inspector.recording.spectrogram import TOP_HZ
from inspector.recording.unstable import Part

SHOWN = 10.0
"""Time that plots reach back, in [s]."""


@dataclass(frozen=True)
class Contents:
    """What there is to show.

    Attributes:
        joints: Title and entity paths of each plot of joint signals.
        camera: From where the robot is seen; None without one.
        classes: Whether there are classes.
        rate: Samples per second, in [Hz].
    """

    joints: Sequence[tuple[str, Sequence[str]]]
    camera: Camera | None
    classes: bool
    rate: float


def layout(contents: Contents) -> Blueprint:
    """Lay a live recording out; every plot shows the last ten seconds.

    Args:
        contents: What there is to show.
    """
    top = min(TOP_HZ, contents.rate / 2)
    title = f"Spectrogram of the noise, 0-{top:.0f} Hz, {FLOOR_DB:.0f}-0 dB re 1 rad/s"
    right = [
        (_plot("/noise", "Noise, simplified estimate [rad/s]"), 2.2),
        (_plot("/spectrogram", title, between=(0.0, top)), 2.8),
        (_signals(contents), 4.2),
    ]
    if contents.classes:
        right.insert(0, (unstable.lanes("Classes", "/class", last=SHOWN), 1.6))
    left = unstable.events("Events", "/events")
    if contents.camera is not None:
        left = unstable.above((unstable.robot("Robot", "/robot", contents.camera), 3), (left, 2))
    content = unstable.beside((left, 2), (unstable.above(*right), 3))
    return unstable.blueprint(content, TIMELINE, following=True)


def _plot(
    origin: str,
    name: str,
    paths: Sequence[str] = ("$origin/**",),
    *,
    legend: bool = False,
    between: tuple[float, float] | None = None,
) -> Part:
    return unstable.plot(
        name, origin, paths, legend=legend, between=between, fixed=True, last=SHOWN
    )


def _signals(contents: Contents) -> Part:
    plots = [_plot("/joints", title, paths, legend=True) for title, paths in contents.joints]
    if contents.classes:
        plots.append(_plot("/score", "Scores", legend=True))
    return unstable.tabs(*plots)
