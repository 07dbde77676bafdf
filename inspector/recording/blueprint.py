"""How a recording is laid out: robot and report at the left, everything over time at the right."""

from collections.abc import Sequence
from dataclasses import dataclass

from rerun.blueprint import Blueprint

from inspector.recording import unstable
from inspector.recording.details import Detail
from inspector.recording.joints import Plot
from inspector.recording.series import TIMELINE
from inspector.recording.spectrogram import TOP_HZ
from inspector.recording.unstable import Part


@dataclass(frozen=True)
class Contents:
    """What a recording holds that the layout depends on.

    Attributes:
        joints: Plots of joint signals.
        details: Moments that were logged sample by sample.
        root: Frame that the view follows; None without a robot.
        links: Whether there is noise of links.
        terms: Whether there are the paper's terms A, B and C.
        lanes: How many lanes of classes there are, found and annotated.
        events: Whether any of them is listed.
        scores: Whether there are scores.
        sound: Whether there is a sound.
        rate: Samples per second, in [Hz].
        loop: Stretch of time that playing repeats, in [s].
    """

    joints: Sequence[Plot]
    details: Sequence[Detail]
    root: str | None
    links: bool
    terms: bool
    lanes: int
    events: bool
    scores: bool
    sound: bool
    rate: float
    loop: tuple[float, float] | None


def layout(contents: Contents) -> Blueprint:
    """Lay out a recording.

    Args:
        contents: What there is to show.

    Returns:
        The blueprint; all time axes are linked but those of the details.
    """
    over_time: list[tuple[Part, float]] = []
    if contents.lanes:
        over_time.append((unstable.lanes("Classes", "/class"), 0.8 + 0.8 * contents.lanes))
    over_time += [(_noise(contents), 2.4), (_spectrogram(contents), 2.8)]
    if contents.links:
        over_time.append((_links(), 4.4))
    over_time.append((_joints(contents), 2.8))
    left = text(events=contents.events)
    if contents.root is not None:
        title = "Robot, coloured by vibration" if contents.links else "Robot"
        robot = unstable.robot(title, "/robot", contents.root)
        left = unstable.above((robot, 3.0), (left, 2.0))
    whole = unstable.beside((left, 2.0), (unstable.above(*over_time), 3.0))
    return unstable.blueprint(whole, TIMELINE, contents.loop)


def text(*, events: bool) -> Part:
    """The report, and behind it the list of events if there are some."""
    report = unstable.text("Report", "/report")
    return unstable.tabs(report, unstable.events("Events", "/events")) if events else report


def _noise(contents: Contents) -> Part:
    parts = [unstable.plot("Noise, simplified estimate [rad/s]", "/noise")]
    if contents.links:
        parts.append(
            unstable.plot("Sound power, extended [dB re 1 pW]", "/power", ["/power/total"])
        )
    if contents.terms:
        terms = ["/power/terms/**", "/power/total"]
        parts.append(unstable.plot("terms A, B, C", "/power", terms, legend=True))
    if contents.sound:
        parts.append(unstable.audio("Listen", "/sound"))
    return unstable.tabs(*parts)


def _spectrogram(contents: Contents) -> Part:
    top = min(TOP_HZ, contents.rate / 2)
    bands = unstable.plot(
        f"Spectrogram of the noise, 0-{top:.0f} Hz",
        "/spectrogram/bands",
        between=(0.0, top),
        fixed=True,
    )
    whole = unstable.tensor(f"to {contents.rate / 2:.0f} Hz [dB]", "/spectrogram/levels")
    now = unstable.bars(f"Spectrum at the cursor, 0-{top:.0f} Hz [dB]", "/spectrogram/now")
    return unstable.tabs(bands, whole, now)


def _links() -> Part:
    levels = unstable.lanes("Loudest links, above 10 Hz", "/level")
    power = unstable.plot("Their sound power [dB re 1 pW]", "/power/links", legend=True)
    return unstable.tabs(levels, power)


def _joints(contents: Contents) -> Part:
    """Scores, then each limb's signals, then the details."""
    parts = [unstable.plot("Scores", "/score", legend=True)] if contents.scores else []
    parts += limbs(contents.joints)
    parts += [_detail(detail) for detail in contents.details]
    return unstable.tabs(*parts)


def limbs(plots: Sequence[Plot]) -> list[Part]:
    """A part for each limb, with its plots behind each other."""
    return [
        unstable.tabs(
            *(
                unstable.plot(plot.title, "/joints", plot.paths, legend=True)
                for plot in plots
                if plot.limb == limb
            ),
            name=limb,
        )
        for limb in dict.fromkeys(plot.limb for plot in plots)
    ]


def _detail(detail: Detail) -> Part:
    noise = unstable.plot("noise, raw [rad/s]", f"{detail.path}/noise", during=detail.during)
    velocity = unstable.plot(
        "velocity, raw [rad/s]", f"{detail.path}/velocity", legend=True, during=detail.during
    )
    return unstable.tabs(noise, velocity, name=detail.title)
