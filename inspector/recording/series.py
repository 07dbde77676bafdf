"""Columns of a rerun recording: lines, lanes, heat strips. Never row by row."""

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from inspector import colors
from inspector.colors import Color
from inspector.recording import unstable
from inspector.spectrogram import RANGE_DB, Spectrogram
from noisemodel.types import Array, Real

TIMELINE = "time"
BANDS = 48
BARS = 60
TOP_HZ = 2000.0
LINE_WIDTH = 5.0


def at(time: Array) -> rr.TimeColumn:
    """Index columns by seconds from the start of the run."""
    return rr.TimeColumn(TIMELINE, duration=np.round(time * 1e9).astype("timedelta64[ns]"))


def scalars(values: Real) -> list[rr.ComponentColumn]:
    """Make columns as ``rr.Scalars.columns`` does, at a third of its cost.

    Args:
        values: Shape (samples,) or (samples, series).
    """
    width = values[:1].size
    batch = rr.components.ScalarBatch(np.ascontiguousarray(values).ravel())
    edges = np.arange(len(values) + 1, dtype=np.int32) * np.int32(width)
    return [rr.ComponentColumn(rr.Scalars.descriptor_scalars(), batch, offsets=edges)]


def log_lines(
    recording: rr.RecordingStream,
    path: str,
    time: Array,
    values: Real,
    *,
    names: Sequence[str],
    colours: Sequence[Color],
) -> None:
    """Log one line or several that share their times.

    Args:
        recording: Where to.
        path: Entity path.
        time: Shape (samples,), in [s].
        values: Shape (samples, series).
        names: One per series, with its unit.
        colours: One per series.
    """
    # Rerun's default aggregation draws the mean of a pixel's extremes, which hides vibration.
    style = rr.SeriesLines(
        names=list(names),
        colors=list(colours),
        widths=[1.0] * len(names),
        aggregation_policy="MinMax",
    )
    recording.log(path, style, static=True)
    recording.send_columns(path, indexes=[at(time)], columns=scalars(values))


def log_lane(
    recording: rr.RecordingStream,
    path: str,
    stretches: Sequence[tuple[float, float, str]],
    colours: dict[str, Color],
) -> None:
    """Log a lane of states.

    Args:
        recording: Where to.
        path: Entity path; it is the lane's caption.
        stretches: Start and stop in [s] and state, in order, not overlapping.
        colours: One per state.
    """
    states = rr.StateConfiguration(
        values=list(colours), labels=list(colours), colors=list(colours.values())
    )
    recording.log(path, states, static=True)
    changes: list[tuple[float, str]] = []
    for start, stop, state in stretches:
        if changes and changes[-1][0] == start:
            changes.pop()  # the stretch before ends where this one starts
        if not changes or changes[-1][1] != state:
            changes.append((start, state))
        changes.append((stop, ""))
    merged = _without_repeats(changes)
    if merged:
        recording.send_columns(
            path,
            indexes=[at(np.array([time for time, _ in merged]))],
            columns=rr.StateChange.columns(state=[state for _, state in merged]),
        )


def _without_repeats(changes: list[tuple[float, str]]) -> list[tuple[float, str]]:
    previous: str | None = None
    kept = []
    for time, state in changes:
        if state != previous:
            kept.append((time, state))
        previous = state
    return kept


def log_heat_strip(recording: rr.RecordingStream, path: str, spectrum: Spectrogram) -> None:
    """Log a spectrogram as coloured lines, one per band, on the time axis of the other plots.

    Rerun has no spectrogram view whose time axis can be linked to plots; coloured lines have.

    Args:
        recording: Where to.
        path: Entity path below which each of 48 bands has its own; of a slow run, which has fewer
            frequencies, some show the same one.
        spectrum: What to show, up to 2 kHz.
    """
    shown = spectrum.frequency <= max(TOP_HZ, spectrum.frequency[0])
    edges = np.linspace(0, int(shown.sum()), BANDS + 1)
    firsts, lasts = np.floor(edges[:-1]).astype(int), np.ceil(edges[1:]).astype(int)
    levels = np.stack(
        [spectrum.level[first:last].max(axis=0) for first, last in zip(firsts, lasts, strict=True)]
    )
    low, high = np.percentile(levels, [5, 99.8])
    rgba = colors.heat((levels - low) / max(high - low, 1e-9))
    step = spectrum.frequency[0]  # the bins lie at whole multiples of the first
    centres = step * ((edges[:-1] + edges[1:]) / 2 + 0.5)
    for band, centre in enumerate(centres.tolist()):
        _log_band(recording, f"{path}/{band:02d}", spectrum.time, centre, rgba[band])


def _log_band(
    recording: rr.RecordingStream, path: str, time: Array, hertz: float, rgba: NDArray[np.uint8]
) -> None:
    style = rr.SeriesLines(
        names=f"{hertz:.0f} Hz",
        widths=LINE_WIDTH,
        aggregation_policy="Off",
        interpolation_mode="StepAfter",
    )
    recording.log(path, style, static=True)
    # A segment takes the colour of its end: both ends of an even stretch are kept.
    changes = (rgba[1:] != rgba[:-1]).any(axis=1)
    kept = np.concatenate(([True], changes)) | np.concatenate((changes, [True]))
    recording.send_columns(
        path,
        indexes=[at(time[kept])],
        columns=[
            *scalars(np.full(int(kept.sum()), hertz)),
            *rr.SeriesLines.columns(colors=rgba[kept]),
        ],
    )


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
