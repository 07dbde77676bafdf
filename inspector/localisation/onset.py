"""When something sharp sets in."""

import numpy as np

from noisemodel.types import Array

AHEAD, BACK = 0.01, 0.05
"""Times after and before a moment that are compared, in [s]."""
AROUND = (0.02, 0.03)
"""Times before and after the steepest rise in which stages may set in, in [s]."""
STEEP = 0.25
"""How steep a rise has to be, as a share of the steepest."""
SHOWS = 4.0
"""How much sharper than before a stage gets that shows a failure."""
CLEAR = 2.0
"""How much sharper than before it is where it sets in."""
SHARE = 0.2
"""How sharp it is there, as a share of its peak."""


def rise(sharp: Array, first: int, last: int, *, rate: float) -> int:
    """Find where sharpness rises first: 10 ms against the 50 ms before, both as mean squares.

    Args:
        sharp: Sharpness, shape (samples,), in [rad/s²].
        first: First sample that is looked at.
        last: The one after the last.
        rate: Samples per second, in [Hz].

    Returns:
        The top of the first rise that is a quarter as steep as the steepest, as a sample.
    """
    ahead, back = (max(1, round(time * rate)) for time in (AHEAD, BACK))
    energy = np.concatenate(([0.0], np.cumsum(np.square(sharp))))
    first = min(max(first, 1), len(sharp) - 1)
    at = np.arange(first, max(min(last, len(sharp) - ahead), first + 1))
    behind = np.maximum(0, at - back)
    after = (energy[np.minimum(at + ahead, len(sharp))] - energy[at]) / ahead
    before = (energy[at] - energy[behind]) / (at - behind)
    usual = before + np.median(sharp) ** 2 + np.finfo(float).tiny
    steep = (after - before) / np.sqrt(usual)
    enough = steep >= STEEP * steep.max()
    begin = int(np.argmax(enough))
    length = int(np.argmin(enough[begin:])) or len(enough) - begin
    return int(at[begin + np.argmax(steep[begin : begin + length])])


def window(moment: int, samples: int, *, rate: float) -> slice:
    """Give the samples around the steepest rise in which stages may set in."""
    early, late = (max(1, round(time * rate)) for time in AROUND)
    return slice(max(0, moment - early), min(samples, moment + late))


def onset(sharp: Array, moment: int, *, rate: float, least: float = 0.0) -> int | None:
    """Find where something sets in.

    Args:
        sharp: Sharpness, shape (samples,), in [rad/s²].
        moment: About when, as a sample.
        rate: Samples per second, in [Hz].
        least: Peak that has to be exceeded in any case, in [rad/s²].

    Returns:
        The sample; None if it is hardly sharper than before.
    """
    back, ahead = (round(time * rate) for time in (BACK, AHEAD))
    before = sharp[max(0, moment - back - ahead) : max(1, moment - ahead)]
    around = window(moment, len(sharp), rate=rate)
    usual = max(float(np.sqrt(np.mean(np.square(before)))), float(np.median(sharp)))
    peak = float(sharp[around].max(initial=0.0))
    if not peak > max(SHOWS * usual, least):
        return None
    first = int(around.start)
    return first + int(np.argmax(sharp[around] > max(SHARE * peak, CLEAR * usual)))
