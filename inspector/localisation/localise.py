"""Localisation of failures: stage of the control flow, joints, frequency band, links."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from inspector.localisation.stage import (
    Localisation,
    first_stage,
    quiet_statistics,
    quiet_stretches,
)
from noiseclassifier import Event
from noisemodel import Block, Run
from noisemodel.noise import FAST, LinkNoise
from noisemodel.types import Array, Real

ANNOTATED = 0.1
"""How long after the start of an annotation its failure may set in, in [s]."""


def localise(
    run: Run, found: Sequence[Event], *, frame: float = 0.0
) -> dict[Event | Block, Localisation]:
    """Localise each failure of a run.

    Args:
        frame: Duration of the frames that they consist of, in [s]: a finding may set in at any
            time of its first.
    """
    annotated = [block for block in run.blocks if block.label != "ok"]
    failures: list[Event | Block] = [*found, *annotated]
    if not failures:
        return {}
    quiet = quiet_statistics(run, failures) if has_stages(run) else None
    reach = max(ANNOTATED, frame)

    def one(failure: Event | Block) -> Localisation:
        latest = reach if failure in found else ANNOTATED
        stage = Localisation() if quiet is None else first_stage(run, quiet, failure, reach=latest)
        return replace(stage, band=band(run, failure, failures))

    return {failure: one(failure) for failure in failures}


def has_stages(run: Run) -> bool:
    """Whether a run has a stage to compare the measured motion with."""
    return bool(run.stages) or run.velocity_desired is not None


SHORTEST, LONGEST = 0.1, 0.4
"""Windows of the spectrum, in [s]: as long as the failure, between these."""
MOST = 16
"""Most windows of a failure."""
PERCENTILE = 90.0
"""Percentile of the quiet stretches' spectra that is subtracted: vibration of a robot that walks
comes and goes."""
SHARE = 0.7
"""Share of the excess power that lies in the band."""


def band(
    run: Run, failure: Event | Block, failures: Sequence[Event | Block]
) -> tuple[float, float] | None:
    """Frequency band in which the joints vibrate more than in quiet stretches.

    The excess is the power spectrum of the measured velocities above 10 Hz, mean over the failure,
    less the 90th percentile of the quiet stretches' spectra. The band is the narrowest that holds
    70 % of it.

    Args:
        failures: All failures of the run, found and annotated.

    Returns:
        Lowest and highest frequency, in [Hz]; None without excess. The resolution is the inverse
        of the failure's duration, and 2.5 Hz at best.
    """
    length = min(max(failure.stop - failure.start, SHORTEST), LONGEST, run.duration)
    size = max(2, round(length * run.rate))
    first, last = np.searchsorted(run.time, (failure.start, failure.stop))
    # The window of a shorter failure extends beyond it.
    first = max(0, min(int(first), len(run.time) - size))
    starts = np.arange(first, max(first + 1, int(last) - size + 1), max(1, size // 2))
    if len(starts) > MOST:
        starts = starts[np.linspace(0, len(starts) - 1, MOST).astype(int)]
    during = [slice(start, start + size) for start in starts.tolist()]
    during = [part for part in during if run.mask[part].all()]
    if not during:
        return None
    reference = [
        _spectrum(run.velocity[part]) for part in quiet_stretches(run, failures, length=length)
    ]
    excess = np.mean([_spectrum(run.velocity[part]) for part in during], axis=0)
    if reference:
        excess = excess - np.percentile(reference, PERCENTILE, axis=0)
    frequency = np.arange(len(excess)) * run.rate / size
    excess = np.where(frequency >= FAST, np.maximum(excess, 0.0), 0.0)
    if not excess.sum() > 0.0:
        return None
    low, high = _narrowest(excess)
    return float(frequency[low]), float(frequency[high])


def _spectrum(velocity: Real) -> Array:
    """Power of all joints together, shape (frequency,)."""
    # A trend would leak into all frequencies.
    line = np.linspace(velocity[0], velocity[-1], len(velocity), dtype=np.float64)
    waves = np.fft.rfft((velocity - line).T * np.hanning(len(velocity)), axis=1)
    return np.asarray(np.square(np.abs(waves)).sum(axis=0))


def _narrowest(excess: Array) -> tuple[int, int]:
    """First and last bin of the narrowest band that holds `SHARE` of the whole."""
    below = np.concatenate(([0.0], np.cumsum(excess)))
    wanted = below[:-1] + SHARE * below[-1]
    ends = np.searchsorted(below, wanted, side="left")
    starts = np.flatnonzero(ends < len(below))
    best = starts[np.argmin(ends[starts] - starts)]
    return int(best), int(ends[best]) - 1


Failure: TypeAlias = Event | Block
"""A finding, or an annotated block."""

NAMED = 3
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
    of the named ones, the link of the largest excess that it moves; and then the links of the
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
    largest_first = sorted(named[:NAMED], key=ranked.index)
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
