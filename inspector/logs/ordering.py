"""Stamps that stand still or run backwards, left out and counted."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from inspector.logs.log import Stamps, Track
from noisemodel.types import Mask

DISORDER = 0.1
"""Share of samples above which a log is refused: it is several logs, or no time at all."""


@dataclass(frozen=True)
class Disorder:
    """What was wrong with the stamps of a track.

    Attributes:
        duplicates: Samples with the stamp of one before.
        backward: Samples with a stamp before that of one before.
        first: When the first of them comes, in [s] since the first stamp.
    """

    duplicates: int
    backward: int
    first: float

    def __str__(self) -> str:
        return (
            f"{self.duplicates} duplicate and {self.backward} backward stamps left out, the first"
            f" {self.first:.6g} s into the log"
        )


def ordered(path: Path, tracks: Sequence[Track]) -> tuple[tuple[Track, ...], tuple[Disorder, ...]]:
    """Leave out the samples whose stamps do not rise above all before.

    Args:
        path: The log, for errors.
        tracks: Its tracks; what shares stamps goes on sharing them.

    Returns:
        The tracks, and what was wrong with each set of stamps that had something wrong.

    Raises:
        LogError: If a tenth of the samples or more is out of order.
    """
    rising = {id(track.stamps): _rising(track.stamps) for track in tracks}
    disorders, kept = [], {}
    for track in {id(track.stamps): track for track in tracks}.values():
        keep = rising[id(track.stamps)]
        kept[id(track.stamps)] = track.stamps
        if not keep.all():
            disorders.append(_disorder(path, track, keep))
            kept[id(track.stamps)] = _only(track.stamps, keep)
    return tuple(_ordered(tracks, rising, kept)), tuple(disorders)


def _ordered(
    tracks: Sequence[Track], rising: dict[int, Mask], kept: dict[int, Stamps]
) -> Iterator[Track]:
    for track in tracks:
        keep = rising[id(track.stamps)]
        if keep.all():
            yield track
        else:
            yield replace(track, stamps=kept[id(track.stamps)], values=track.values[keep])


def _rising(stamps: Stamps) -> Mask:
    latest = np.maximum.accumulate(stamps.time)
    return np.concatenate(([True], stamps.time[1:] > latest[:-1]))


def _only(stamps: Stamps, keep: Mask) -> Stamps:
    rows = None if stamps.rows is None else np.asarray(stamps.rows)[keep].tolist()
    return replace(stamps, time=stamps.time[keep], rows=rows)


def _disorder(path: Path, track: Track, keep: Mask) -> Disorder:
    time = track.stamps.time
    wrong = np.flatnonzero(~keep)
    latest = np.maximum.accumulate(time)
    duplicates = int(np.sum(time[wrong] == latest[wrong - 1]))
    if len(wrong) >= DISORDER * len(time):
        after, before = (
            track.stamps.start + Decimal(str(since))
            for since in (time[wrong[0]], latest[wrong[0] - 1])
        )
        how = "stands still" if after == before else "runs backwards"
        raise track.fault(path, f"time {how}: {after} comes after {before}", int(wrong[0]))
    return Disorder(duplicates, len(wrong) - duplicates, float(latest[wrong[0] - 1]))
