"""Both runs made audible at one gain, as they lie in a recording."""

import numpy as np

from inspector.errors import InspectorError
from inspector.pair.pair import Pair
from inspector.sound.sonification import Settings, common_gain, sound_of
from inspector.sound.sound import SMALL_RATE
from noisemodel.run import part

MOST = 8_000_000
"""Velocities of a run that are mixed: a second of work."""


def sounds(pair: Pair, around: float) -> dict[str, bytes]:
    """Make the simplified noise of both runs audible.

    Args:
        pair: The runs.
        around: What is heard where they are too long for all of them, in [s].

    Returns:
        A WAV file each, that starts with the runs and is silent before what is heard; nothing
        where nothing can be heard.
    """
    widest = max(2 * side.run.motion.shape[1] for _, side in pair.sides)
    count = min(max(2, MOST // widest), len(pair.time))
    middle = int(np.searchsorted(pair.time, around))
    first = min(max(middle - count // 2, 0), len(pair.time) - count)
    try:
        heard = {
            name: sound_of(part(side.run, first, first + count), Settings())
            for name, side in pair.sides
        }
    except InspectorError:
        return {}
    gain = common_gain(list(heard.values()))
    lead = first / pair.rate
    return {name: s.file(gain, rate=SMALL_RATE, lead=lead) for name, s in heard.items()}
