"""How a comparison is laid out: before at the left, after at the right, what differs below."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rerun.blueprint import Blueprint

from inspector.pair import links
from inspector.pair.noise import CHANGED, DETAILS, LEVEL, NOISE, Ends
from inspector.recording import axes, unstable
from inspector.recording.axes import Panel
from inspector.recording.blueprint import limbs
from inspector.recording.camera import Camera
from inspector.recording.joints import Plot
from inspector.recording.noise import HIGH_DB, LOW_DB
from inspector.recording.series import TIMELINE
from inspector.recording.unstable import Part

WHOLE = 832.0
"""Height of all parts, in points, in a window of 1440 x 900."""
ABOVE = 240.0
"""Least height of the report and the robots."""
SPAN = "/span"
"""What makes every plot reach from the start of the runs to their end."""
ALL = ("$origin/**", SPAN)
CHANGE_PATHS = ("/change/noise", "/change/none", "/change/finding/**", SPAN)
TITLES = 28.0
"""Height of a row of tabs."""


@dataclass(frozen=True)
class Contents:
    """What a recording of two runs holds, that the layout depends on.

    Attributes:
        joints: Plots of joint signals.
        classes: Panel of the classes.
        spectra: Panels of the spectrograms, by what they show.
        changes: Panel of the links' changes; None without links.
        links: Links whose power before and after is shown.
        cameras: From where each robot is seen; empty without one.
        events: Whether any change is listed.
        ends: Lower and upper ends of the axes of the noise and of the change.
        sounds: Names of the sounds.
        loop: Stretch of time that playing repeats, in [s].
    """

    joints: Sequence[Plot]
    classes: Panel
    spectra: Mapping[str, Panel]
    changes: Panel | None
    links: Sequence[str]
    cameras: Mapping[str, Camera]
    events: bool
    ends: Ends
    sounds: Sequence[str]
    loop: tuple[float, float] | None


def layout(contents: Contents) -> Blueprint:
    """Lay a comparison out.

    Args:
        contents: What there is to show.

    Returns:
        The blueprint; all time axes are linked.
    """
    report = unstable.text("Before \u2192 after", "/report")
    events = unstable.events("Changes", "/events")
    text = unstable.tabs(report, events) if contents.events else report
    head: list[tuple[Part, float]] = [(text, 34.0)]
    for side, camera in contents.cameras.items():
        head.append((unstable.robot(f"Robot {side}", f"/robot_{side}", camera), 29.0))
    if contents.cameras:
        head.append((unstable.drawing(f"/axis/{links.KEY.name}/right"), 8.0))
    over_time = [
        (
            contents.classes,
            _rows("/class"),
        ),
        (
            LEVEL,
            unstable.plot(
                "Level", "/level", ALL, between=(LOW_DB, HIGH_DB), fixed=True, titled=False
            ),
        ),
        (
            CHANGED,
            unstable.plot(
                "Change",
                "/change",
                CHANGE_PATHS,
                between=contents.ends.change,
                fixed=True,
                titled=False,
            ),
        ),
    ]
    parts = [(axes.part(panel, plot), panel.height) for panel, plot in over_time]
    whole = unstable.above(
        (unstable.beside(*head), ABOVE), *parts, (_details(contents), DETAILS + TITLES)
    )
    return unstable.blueprint(whole, TIMELINE, contents.loop)


def _details(contents: Contents) -> Part:
    parts: list[Part] = []
    if contents.changes is not None:
        plot = unstable.plot(
            "Links", "/change/links", between=(0.0, axes.TOP), fixed=True, titled=False
        )
        parts.append(axes.part(contents.changes, plot, name="Links, change"))
    for what, panel in contents.spectra.items():
        plot = _rows(f"/spectrogram/{what}")
        comma = ", " if what == "change" else " "
        parts.append(axes.part(panel, plot, name=f"Spectrum{comma}{what}"))
    plot = unstable.plot(
        "Noise", "/noise", ALL, between=contents.ends.noise, fixed=True, titled=False
    )
    parts.append(axes.part(NOISE, plot, name="Noise"))
    if contents.cameras:
        parts.append(unstable.plot("Sound power [dB re 1 pW]", "/power", ALL, legend=True))
    if contents.links:
        both = [
            unstable.plot(f"{name} [dB re 1 pW]", f"/links/{name}", ALL, legend=True)
            for name in contents.links
        ]
        parts.append(unstable.tabs(*both, name="Links, before and after"))
    parts += [unstable.audio(f"Listen {name}", f"/sound/{name}") for name in contents.sounds]
    return unstable.tabs(*parts, *limbs(contents.joints))


def _rows(path: str) -> Part:
    """A plot of rows."""
    return unstable.plot("", path, ALL, between=(0.0, axes.TOP), fixed=True, titled=False)
