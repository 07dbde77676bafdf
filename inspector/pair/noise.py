"""Both runs' noise in a recording, its levels and spectra, and by how much they differ."""

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from inspector import colors
from inspector.pair import colors as sides
from inspector.pair.levels import steps
from inspector.pair.pair import Pair
from inspector.pair.spectra import Spectra, spectra
from inspector.recording import series
from inspector.thinning import extremes
from noisemodel.noise import REFERENCE_POWER, decibel
from noisemodel.types import Array

POINTS = 60_000
"""Of each run's noise."""
BANDS = 48
LOWEST_POWER_DB = -20.0
"""Sound power below this is drawn at it, in [dB re 1 pW]."""
COLOURS = {"before": sides.BEFORE, "after": sides.AFTER}


def log(recording: rr.RecordingStream, pair: Pair) -> None:
    """Log noises, their levels every 50 ms, and their spectra.

    Args:
        recording: Where to.
        pair: The two runs.
    """
    for name, side in pair.sides:
        mask = side.run.mask
        time, values = extremes(pair.time[mask], side.noise[mask, None], points=POINTS)
        _log(recording, f"/noise/{name}", time, values[:, 0], COLOURS[name])
        if side.links is not None:
            level = np.maximum(decibel(side.links.total / REFERENCE_POWER), LOWEST_POWER_DB)
            _log(recording, f"/power/{name}", side.links.time, level, COLOURS[name])
    time, level = steps(pair)
    for place, (name, _) in enumerate(pair.sides):
        _log(recording, f"/level/{name}", time, level[:, place], COLOURS[name])
    _log(recording, "/change/noise", time, level[:, 1] - level[:, 0], colors.NOISE)
    _log_spectra(recording, spectra(pair))


def _log(
    recording: rr.RecordingStream, path: str, time: Array, values: Array, color: colors.Color
) -> None:
    name = path.rpartition("/")[2]
    series.log_lines(recording, path, time, values[:, None], names=[name], colours=[color])


def _log_spectra(recording: rr.RecordingStream, found: Spectra) -> None:
    """Log both spectrograms in one scale of colours, and by how much the second is louder."""
    shown = found.frequency <= max(series.TOP_HZ, float(found.frequency[0]))
    edges = np.linspace(0, int(shown.sum()), BANDS + 1)
    firsts, lasts = np.floor(edges[:-1]).astype(int), np.ceil(edges[1:]).astype(int)
    level = found.level
    bands = np.stack(
        [level[:, i:j].max(axis=1) for i, j in zip(firsts, lasts, strict=True)], axis=1
    )
    if not len(found.time):
        return
    low, high = np.percentile(bands, [5, 99.8])
    strips = {
        "before": colors.heat((bands[0] - low) / max(high - low, 1e-9)),
        "after": colors.heat((bands[1] - low) / max(high - low, 1e-9)),
        "change": sides.diverging(bands[1] - bands[0]),
    }
    # The bins lie at whole multiples of the first.
    centres = found.frequency[0] * ((edges[:-1] + edges[1:]) / 2 + 0.5)
    for name, rgba in strips.items():
        for band, centre in enumerate(centres.tolist()):
            path = f"/spectrogram/{name}/{band:02d}"
            _log_band(recording, path, found.time, centre, rgba[band])


def _log_band(
    recording: rr.RecordingStream, path: str, time: Array, hertz: float, rgba: NDArray[np.uint8]
) -> None:
    style = rr.SeriesLines(
        names=f"{hertz:.0f} Hz",
        widths=series.LINE_WIDTH,
        aggregation_policy="Off",
        interpolation_mode="StepAfter",
    )
    recording.log(path, style, static=True)
    # A segment takes the colour of its end: both ends of an even stretch are kept.
    changed = (rgba[1:] != rgba[:-1]).any(axis=1)
    kept = np.concatenate(([True], changed)) | np.concatenate((changed, [True]))
    recording.send_columns(
        path,
        indexes=[series.at(time[kept])],
        columns=[
            *rr.Scalars.columns(scalars=np.full(int(kept.sum()), hertz)),
            *rr.SeriesLines.columns(colors=rgba[kept]),
        ],
    )
