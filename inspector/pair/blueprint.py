"""How a comparison is laid out: as one run is, with both runs in each view."""

from collections.abc import Sequence
from dataclasses import dataclass

from rerun.blueprint import Blueprint

from inspector.pair.colors import RANGE_DB
from inspector.recording import unstable
from inspector.recording.blueprint import limbs
from inspector.recording.joints import Plot
from inspector.recording.series import TIMELINE
from inspector.recording.spectrogram import TOP_HZ
from inspector.recording.unstable import Part


@dataclass(frozen=True)
class Contents:
    """What a recording of two runs holds, that the layout depends on.

    Attributes:
        joints: Plots of joint signals.
        links: Links whose power before and after is shown.
        root: Frame that the view follows; None without a robot.
        lanes: How many lanes of classes there are.
        events: Whether any change is listed.
        sounds: Names of the sounds.
        rate: Samples per second, in [Hz].
        loop: Stretch of time that playing repeats, in [s].
    """

    joints: Sequence[Plot]
    links: Sequence[str]
    root: str | None
    lanes: int
    events: bool
    sounds: Sequence[str]
    rate: float
    loop: tuple[float, float] | None


def layout(contents: Contents) -> Blueprint:
    """Lay a comparison out.

    Args:
        contents: What there is to show.

    Returns:
        The blueprint; all time axes are linked.
    """
    over_time: list[tuple[Part, float]] = []
    if contents.lanes:
        over_time.append((unstable.lanes("Classes", "/class"), 1.1 + 0.8 * contents.lanes))
    over_time += [(_noise(contents), 2.6), (_spectrogram(contents), 3.2)]
    if contents.links:
        over_time.append((_links(contents), 2.8))
    over_time.append((unstable.tabs(*limbs(contents.joints)), 2.8))
    left = unstable.text("Report", "/report")
    if contents.events:
        left = unstable.tabs(left, unstable.events("Events", "/events"))
    if contents.root is not None:
        title = "Robot after: orange is louder than before, blue quieter"
        robot = unstable.robot(title, "/robot", contents.root)
        left = unstable.above((robot, 2.4), (left, 2.6))
    whole = unstable.beside((left, 2.0), (unstable.above(*over_time), 3.0))
    return unstable.blueprint(whole, TIMELINE, contents.loop)


def _noise(contents: Contents) -> Part:
    parts = [
        unstable.plot("Noise, simplified estimate [rad/s]", "/noise", legend=True),
        unstable.plot("Level above 10 Hz [dB re 1 rad/s]", "/level", legend=True),
        unstable.plot("Change of it [dB]", "/change/noise"),
    ]
    if contents.root is not None:
        parts.append(unstable.plot("Sound power [dB re 1 pW]", "/power", legend=True))
    parts += [unstable.audio(f"Listen {name}", f"/sound/{name}") for name in contents.sounds]
    return unstable.tabs(*parts)


def _spectrogram(contents: Contents) -> Part:
    top = min(TOP_HZ, contents.rate / 2)
    titles = {
        "change": f"Spectrogram, change, 0-{top:.0f} Hz, {-RANGE_DB:.0f} to {RANGE_DB:+.0f} dB",
        "before": "before",
        "after": "after",
    }
    parts = (
        unstable.plot(title, f"/spectrogram/{name}", between=(0.0, top), fixed=True)
        for name, title in titles.items()
    )
    return unstable.tabs(*parts)


def _links(contents: Contents) -> Part:
    change = unstable.plot("Change of links above 10 Hz [dB]", "/change/links", legend=True)
    both = (
        unstable.plot(f"{name} [dB re 1 pW]", f"/links/{name}", legend=True)
        for name in contents.links
    )
    return unstable.tabs(change, *both)
