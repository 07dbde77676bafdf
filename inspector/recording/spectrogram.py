"""Spectrograms in a recording: bands as coloured lines, bars at the time cursor, a tensor."""

from collections.abc import Callable, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from inspector import colors
from inspector.analysis.analyse import Analysis
from inspector.levels import Scale
from inspector.orders import orders
from inspector.recording import axes, rows, unstable
from inspector.recording.axes import Label, Panel
from inspector.recording.gaps import log_gaps
from inspector.recording.series import at, scalars
from inspector.spectrogram import RANGE_DB, WINDOW, Spectrogram, in_bands
from noisemodel.noise import decibel
from noisemodel.types import Array

TOP_HZ = 2000.0
"""Highest frequency that is shown, in [Hz]."""
BANDS = 48
BARS = 60
LINE_WIDTH = 5.0
HEIGHT = 160.0
"""Of a spectrogram, in points."""


def log(
    recording: rr.RecordingStream, analysis: Analysis, spectrum: Spectrogram, scale: Scale
) -> Panel:
    """Log a spectrogram on a logarithmic axis, as rows of colours.

    Args:
        recording: Where to.
        analysis: The run.
        spectrum: Of its noise.
        scale: Of its levels.

    Returns:
        Its panel.
    """
    panel = Panel("spectrogram", HEIGHT)
    log_panel(recording, panel, spectrum, scale, "noise\nspectrum")
    log_gaps(recording, "/spectrogram", analysis.run, (0.0, axes.TOP))
    return panel


def log_panel(
    recording: rr.RecordingStream, panel: Panel, spectrum: Spectrogram, scale: Scale, title: str
) -> None:
    """Log a spectrogram with its axis in Hz and its scale.

    Args:
        recording: Where to; the rows lie below ``/<panel>/bands``.
        panel: Its panel.
        spectrum: What to show.
        scale: Of its levels.
        title: What it is of.
    """
    low, high = float(spectrum.frequency[0]), float(spectrum.frequency[-1])
    log_axis(recording, panel, low, high, Label(0.5, title, -22.0), axes.hertz)
    _log_rows(recording, panel, spectrum, (low, high), scale, "Hz")


def log_orders(
    recording: rr.RecordingStream, analysis: Analysis, scale: Scale
) -> tuple[str, Panel] | None:
    """Log an order spectrogram: what goes with the speed of a joint is level in it.

    Args:
        recording: Where to.
        analysis: The run.
        scale: Of its levels.

    Returns:
        The joint and the panel; None where no joint moves for long enough.
    """
    found = orders(analysis)
    if found is None:
        return None
    joint, spectrum = found
    panel = Panel("orders", HEIGHT)
    low, high = float(spectrum.frequency[0]), float(spectrum.frequency[-1])
    title = Label(0.5, "periods\nper turn", -22.0)
    log_axis(recording, panel, low, high, title, "{:g}".format)
    _log_rows(recording, panel, spectrum, (low, high), scale, "periods per turn")
    log_gaps(recording, "/orders", analysis.run, (0.0, axes.TOP))
    return joint, panel


def log_axis(
    recording: rr.RecordingStream,
    panel: Panel,
    low: float,
    high: float,
    title: Label,
    written: Callable[[float], str],
) -> None:
    """Log a title and ticks at the left of a panel whose axis is logarithmic.

    Args:
        recording: Where to.
        panel: The panel.
        low: Lower end of its axis.
        high: Upper end.
        title: Beside the ticks.
        written: How a value is written.
    """
    span = np.log(max(high / low, 1.01))
    marks = [
        Label(float(np.log(tick / low) / span), written(tick), 40.0)
        for tick in axes.ticks(low, max(high, 1.01 * low), panel)
    ]
    axes.log_left(recording, panel, [title, *marks])


def _log_rows(
    recording: rr.RecordingStream,
    panel: Panel,
    spectrum: Spectrogram,
    ends: tuple[float, float],
    scale: Scale,
    unit: str,
) -> None:
    edges = np.geomspace(ends[0], max(ends[1], 1.01 * ends[0]), BANDS + 1)
    level = 2 * decibel(in_bands(spectrum.frequency, spectrum.amplitude, edges))[::-1]
    rgba = rows.blank(scale.colours(level, shades=rows.SHADES), spectrum.valid)
    half = np.diff(spectrum.time).min(initial=WINDOW) / 2
    times = np.append(spectrum.time - half, spectrum.time[-1] + half)
    names = [f"{centre:.0f} {unit}" for centre in np.sqrt(edges[:-1] * edges[1:])[::-1]]
    path = f"/{panel.name}/bands"
    rows.log(recording, path, times, rgba, names=names, width=LINE_WIDTH)
    axes.log_scale(recording, panel, scale)


def log_bands(recording: rr.RecordingStream, path: str, spectrum: Spectrogram) -> None:
    """Log a spectrogram as coloured lines, one per band, on the time axis of the other plots.

    Rerun has no spectrogram view whose time axis can be linked to plots; coloured lines have.

    Args:
        recording: Where to.
        path: Entity path below which each of 48 bands has its own.
        spectrum: What to show, up to 2 kHz.
    """
    centres, level = bands(spectrum.frequency, spectrum.level)
    log_coloured(recording, path, spectrum.time, centres, colors.heat(stretched(level)))


def bands(frequency: Array, level: Array) -> tuple[Array, Array]:
    """Centres and levels of 48 bands up to 2 kHz.

    Args:
        frequency: Whole multiples of the first, shape (bins,), in [Hz]. Of a slow run, which has
            fewer than 48, some bands hold the same one.
        level: Shape (..., bins, columns), in [dB].

    Returns:
        Centres, shape (48,), in [Hz], and the highest level in each band, shape
        (..., 48, columns), in [dB].
    """
    shown = frequency <= max(TOP_HZ, float(frequency[0]))
    edges = np.linspace(0, int(shown.sum()), BANDS + 1)
    firsts, lasts = np.floor(edges[:-1]).astype(int), np.ceil(edges[1:]).astype(int)
    highest = [
        level[..., first:last, :].max(axis=-2) for first, last in zip(firsts, lasts, strict=True)
    ]
    centres = frequency[0] * ((edges[:-1] + edges[1:]) / 2 + 0.5)
    return centres, np.stack(highest, axis=-2)


def stretched(level: Array) -> Array:
    """Levels mapped so that their 5th percentile is 0 and their 99.8th is 1, of the same shape."""
    low, high = np.percentile(level, [5, 99.8])
    return np.asarray((level - low) / max(high - low, 1e-9))


def log_coloured(
    recording: rr.RecordingStream, path: str, time: Array, centres: Array, rgba: NDArray[np.uint8]
) -> None:
    """Log bands as lines whose colour changes over time.

    Args:
        recording: Where to.
        path: Entity path below which each band has its own.
        time: Shape (columns,), in [s].
        centres: Shape (bands,), in [Hz].
        rgba: Shape (bands, columns, 4).
    """
    for band, centre in enumerate(centres.tolist()):
        entity, colours = f"{path}/{band:02d}", rgba[band]
        style_bands(recording, entity, [centre])
        # A segment takes the colour of its end: both ends of an even stretch are kept.
        changes = (colours[1:] != colours[:-1]).any(axis=1)
        kept = np.concatenate(([True], changes)) | np.concatenate((changes, [True]))
        recording.send_columns(
            entity,
            indexes=[at(time[kept])],
            columns=[
                *scalars(np.full(int(kept.sum()), centre)),
                *rr.SeriesLines.columns(colors=colours[kept]),
            ],
        )


def style_bands(recording: rr.RecordingStream, path: str, centres: Sequence[float]) -> None:
    """Log how the bands of one entity are drawn.

    Args:
        recording: Where to.
        path: Entity path.
        centres: Of its bands, in [Hz].
    """
    style = rr.SeriesLines(
        names=[f"{centre:.0f} Hz" for centre in centres],
        widths=[LINE_WIDTH] * len(centres),
        aggregation_policy="Off",
        interpolation_mode="StepAfter",
    )
    recording.log(path, style, static=True)


def log_bars(recording: rr.RecordingStream, path: str, spectrum: Spectrogram) -> None:
    """Log the spectrum of each moment as bars.

    Args:
        recording: Where to.
        path: Entity path.
        spectrum: What to show, up to 2 kHz; every other of many columns.
    """
    shown = spectrum.frequency <= max(TOP_HZ, spectrum.frequency[0])
    step = -(-len(spectrum.time) // BARS)
    bars = spectrum.level[shown, ::step].T + RANGE_DB  # bars grow from the floor
    unstable.log_bars(
        recording,
        path,
        at(spectrum.time[::step]),
        bars.astype(np.float32),
        places=spectrum.frequency[shown],
        color=colors.NOISE,
    )


def log_tensor(recording: rr.RecordingStream, path: str, spectrum: Spectrogram) -> None:
    """Log all levels of a spectrogram as one tensor."""
    upright = np.ascontiguousarray(spectrum.level[::-1], dtype=np.float32)  # row 0 is drawn on top
    unstable.log_tensor(recording, path, upright, ["frequency, high to low", "time"])
