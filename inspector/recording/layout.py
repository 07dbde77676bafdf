"""How a recording is laid out: findings, robot and details at the left, time at the right."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

from rerun.blueprint import Blueprint

from inspector.recording import axes, unstable
from inspector.recording.axes import TIMELINE, Panel
from inspector.recording.camera import Camera
from inspector.recording.panels import TOP_HZ, Curve, Detail, Plot
from inspector.recording.unstable import Part

HEAD, PARAGRAPH, LINE, FOOT = 36.0, 31.0, 15.5, 28.0
"""Heights in a text, in points: from the top to the middle of its title, to the first line of the
next paragraph, to the next line, and from the last one to the end."""
COLUMNS = 72
"""Characters of a line at the left of a window of 1440 x 900, at least."""
TALLEST = 264.0
"""Most height of the text at the left, in points."""
WHOLE, EVENTS, EVENT, DETAILS, TITLES = 836.0, 84.0, 23.0, 190.0, 28.0
"""Heights of the whole window's parts, of the list of events without and for each, of the samples
of a moment, and of a row of tabs, in points."""


@dataclass(frozen=True)
class Contents:
    """What a recording holds that the layout depends on.

    Attributes:
        text: Findings and what is known of the run, in Markdown.
        joint: The joint of the spectrogram.
        classes: Panel of classes; None if nothing was found or annotated.
        curves: Noise, level and probability.
        spectrogram: Panel of the spectrogram.
        orders: Joint and panel of the order spectrogram; None without.
        strips: Title and panel of the levels of joints and links, those that there are.
        joints: Plots of joint signals.
        details: Moments that were logged sample by sample.
        camera: From where the robot is seen; None without one.
        links: Whether there is noise of links.
        terms: Whether there are the paper's terms A, B and C.
        events: How many failures are listed.
        scores: Whether there are scores.
        sound: Whether there is a sound.
        rate: Samples per second, in [Hz].
        loop: Stretch of time that playing repeats, in [s].
    """

    text: str
    joint: str
    classes: Panel | None
    curves: Sequence[Curve]
    spectrogram: Panel
    orders: tuple[str, Panel] | None
    strips: Sequence[tuple[str, Panel]]
    joints: Sequence[Plot]
    details: Sequence[Detail]
    camera: Camera | None
    links: bool
    terms: bool
    events: int
    scores: bool
    sound: bool
    rate: float
    loop: tuple[float, float] | None


def layout(contents: Contents) -> Blueprint:
    """Lay out a recording."""
    over_time: list[tuple[Part, float]] = []
    if contents.classes is not None:
        over_time.append((_rows(contents.classes, "/class"), contents.classes.height))
    over_time += [(_curve(curve), curve.panel.height) for curve in contents.curves]
    over_time.append((_spectrogram(contents), contents.spectrogram.height + TITLES))
    lowest = max((panel.height for _, panel in contents.strips), default=160.0)
    over_time.append((_strips(contents), lowest + TITLES))
    whole = unstable.beside((_left(contents), 36.0), (unstable.above(*over_time), 64.0))
    return unstable.blueprint(whole, TIMELINE, contents.loop)


def _left(contents: Contents) -> Part:
    """Findings above, the robot with its scale, and samples of the worst moments below."""
    text = unstable.text("Findings", "/report", titled=False)
    parts: list[tuple[Part, float]] = [
        (unstable.drawing("/verdict"), axes.VERDICT),
        (text, height(contents.text)),
    ]
    if contents.events:
        events = unstable.events("Click a time to go there", "/events")
        parts.append((events, EVENTS + EVENT * min(contents.events, 4)))
    if contents.camera is not None:
        title = "Robot, links coloured by level above 10 Hz" if contents.links else "Robot"
        robot = unstable.robot(title, "/robot", contents.camera)
        if contents.links:
            key = unstable.drawing("/axis/key/right")
            robot = unstable.beside((robot, 88.0), (key, 12.0))
        parts.append((robot, WHOLE - DETAILS - sum(size for _, size in parts)))
    details = unstable.tabs(*(each for one in contents.details for each in _detail(one)))
    return unstable.above(*parts, (details, DETAILS))


def height(markdown: str) -> float:
    """Height of a text as far as its parts fit, in points: none is cut through by the edge."""
    found = HEAD - PARAGRAPH
    for part in re.split(r"\n\n(?!- )", markdown.strip()):
        below = found
        for paragraph in part.split("\n\n"):
            rows = paragraph.replace("**", "").split("\n")
            below += PARAGRAPH + LINE * (sum(ceil(len(row) / COLUMNS) for row in rows) - 1)
        if below + FOOT > TALLEST:
            break
        found = below
    return max(found, HEAD) + FOOT


def _rows(panel: Panel, path: str, *, name: str | None = None) -> Part:
    """A panel of rows."""
    return axes.part(panel, axes.row_plot(path), name=name)


def _curve(curve: Curve) -> Part:
    panel, paths = curve.panel, axes.ALL
    plot = unstable.plot(panel.name, curve.path, paths, between=curve.between, titled=False)
    return axes.part(panel, plot)


def _spectrogram(contents: Contents) -> Part:
    parts = [_rows(contents.spectrogram, "/spectrogram", name=f"Spectrogram of {contents.joint}")]
    if contents.orders is not None:
        joint, panel = contents.orders
        parts.append(_rows(panel, "/orders", name=f"Orders of {joint}"))
    top = min(TOP_HZ, contents.rate / 2)
    parts.append(unstable.bars(f"At the cursor, 0-{top:.0f} Hz [dB]", "/spectrum/now"))
    if contents.links:
        paths = ["/power/total", axes.SPAN]
        parts.append(unstable.plot("Sound power [dB re 1 pW]", "/power", paths))
    if contents.terms:
        terms = ["/power/terms/**", "/power/total", axes.SPAN]
        parts.append(unstable.plot("Terms A, B, C", "/power", terms, legend=True))
    if contents.sound:
        parts.append(unstable.audio("Listen", "/sound"))
    return unstable.tabs(*parts)


def _strips(contents: Contents) -> Part:
    """Levels of joints and links, then scores, then each limb's signals."""
    parts = [_rows(panel, f"/strips/{panel.name}", name=name) for name, panel in contents.strips]
    if contents.scores:
        parts.append(unstable.plot("Scores", "/score", axes.ALL, legend=True))
    if contents.links:
        paths = axes.ALL
        parts.append(
            unstable.plot("Power of links [dB re 1 pW]", "/power/links", paths, legend=True)
        )
    parts += limb_tabs(contents.joints)
    return unstable.tabs(*parts)


def limb_tabs(plots: Sequence[Plot]) -> list[Part]:
    """A part for each limb, with its plots behind each other."""
    return [
        unstable.tabs(
            *(
                unstable.plot(plot.title, "/joints", (*plot.paths, axes.SPAN), legend=True)
                for plot in plots
                if plot.limb == limb
            ),
            name=limb,
        )
        for limb in dict.fromkeys(plot.limb for plot in plots)
    ]


def _detail(detail: Detail) -> tuple[Part, Part]:
    """Samples of joints, and of the noise."""
    title = f"Velocities [rad/s], {detail.title}"
    velocity = unstable.plot(title, f"{detail.path}/velocity", legend=True, during=detail.during)
    noise = unstable.plot("Noise [rad/s]", f"{detail.path}/noise", during=detail.during)
    return velocity, noise
