"""Links of a fault: of the largest excess power, and moved by the joints that fail."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from inspector.localisation.stage import Localisation
from noiseclassifier import Event
from noisemodel import Block
from noisemodel.extended import LinkNoise
from noisemodel.types import Array

Failure: TypeAlias = Event | Block
"""A finding, or an annotated block."""

MOST = 3
"""Most links that are named."""
BEGINNING = 0.05
"""Time after the onset of a blow or jump in which its excess power is measured, in [s]."""


def fault_links(
    links: LinkNoise,
    failure: Failure,
    others: Sequence[Failure],
    *,
    known: Localisation | None = None,
) -> tuple[tuple[str, float], ...]:
    """Name the links at which a failure is localised.

    A link's excess is its power above 10 Hz, less its median outside of all failures. A blow or
    jump spreads over the whole robot within a step, so that only its beginning counts. Even then
    a light foot is louder than the limb that was hit, hence a second criterion: the joints of the
    largest innovation. Named is the link of the largest excess; of each such joint that moves none
    of those that are named, the link of the largest excess that it moves; and then those of the
    largest excess.

    Args:
        others: All failures of the run, found and annotated.
        known: Its localisation, if there is one: onset and joints are used.
    """
    excess = _excess(links, failure, others, None if known is None else known.onset)
    ranked = [index for index in np.argsort(-excess, kind="stable").tolist() if excess[index] > 0.0]
    named = ranked[:1]
    for joint, _ in () if known is None else known.joints:
        moved = [index for index in ranked if joint in links.movers[index]]
        if not set(moved) & set(named):
            named += moved[:1]
    named += [index for index in ranked if index not in named]
    largest_first = sorted(named[:MOST], key=ranked.index)
    return tuple((links.links[i], float(excess[i] / excess.sum())) for i in largest_first)


def _excess(
    links: LinkNoise, failure: Failure, others: Sequence[Failure], onset: float | None
) -> Array:
    """Excess of each link, shape (links,), in [W]; 0 where nothing was measured."""
    time, vibration = links.time, links.vibration
    start, stop = failure.start, failure.stop
    if onset is not None:
        half = (time[1] - time[0]) / 2.0
        start, stop = (
            onset - half,
            onset + BEGINNING + half,
        )  # bins that it covers in part count too
    inside = (time >= start) & (time < stop)
    busy = np.any([(time >= each.start) & (time < each.stop) for each in others], axis=0)
    if not inside.any():
        return np.zeros(len(links.links))
    quiet = np.median(vibration[~busy], axis=0) if not busy.all() else 0.0
    excess: Array = np.maximum(vibration[inside].mean(axis=0) - quiet, 0.0)
    return excess
