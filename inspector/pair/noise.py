"""Both runs' noise in a recording, its levels and spectra, and by how much they differ."""

import numpy as np
import rerun as rr

from inspector import colors
from inspector.pair import colors as sides
from inspector.pair.levels import Spectra, spectra, steps
from inspector.pair.pair import Pair
from inspector.recording import series
from inspector.recording.spectrogram import bands, log_coloured, stretched
from inspector.thinning import extremes
from noisemodel.noise import REFERENCE_POWER, decibel
from noisemodel.types import Array

POINTS = 60_000
"""Of each run's noise."""
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
    if not len(found.time):
        return
    centres, level = bands(found.frequency, found.level)
    heat = colors.heat(stretched(level))
    shown = {"before": heat[0], "after": heat[1], "change": sides.diverging(level[1] - level[0])}
    for name, rgba in shown.items():
        log_coloured(recording, f"/spectrogram/{name}", found.time, centres, rgba)
