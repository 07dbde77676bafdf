"""Tracks with increasing stamps: duplicate and backward ones are left out and counted."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from inspector.logs.log import Stamps, Track
from noisemodel.types import Mask

MOST_UNORDERED = 0.1
"""Share of such samples above which a log is refused: it is several logs, or has no stamps."""


@dataclass(frozen=True)
class UnorderedStamps:
    """Stamps of a track that were left out.

    Attributes:
        duplicates: Number of samples with the latest stamp before them.
        backward: Number of samples with an earlier stamp.
        first: Time of the first of them, in [s] since the first stamp.
    """

    duplicates: int
    backward: int
    first: float

    def __str__(self) -> str:
        return (
            f"{self.duplicates} duplicate and {self.backward} backward stamps left out, the first"
            f" {self.first:.6g} s into the log"
        )


def ordered(
    path: Path, tracks: Sequence[Track]
) -> tuple[tuple[Track, ...], tuple[UnorderedStamps, ...]]:
    """Tracks without the samples whose stamps are not later than all before.

    Args:
        path: The log, for errors.
        tracks: Its tracks; those that share stamps still do afterwards.

    Returns:
        The tracks, and what was left out of each set of stamps that was not in order.

    Raises:
        LogError: If a tenth of the samples or more is out of order.
    """
    increasing = {id(track.stamps): _is_increasing(track.stamps) for track in tracks}
    unordered, kept = [], {}
    for track in {id(track.stamps): track for track in tracks}.values():
        keep = increasing[id(track.stamps)]
        kept[id(track.stamps)] = track.stamps
        if not keep.all():
            unordered.append(_unordered(path, track, keep))
            kept[id(track.stamps)] = _only(track.stamps, keep)
    return tuple(_ordered(tracks, increasing, kept)), tuple(unordered)


def _ordered(
    tracks: Sequence[Track], increasing: dict[int, Mask], kept: dict[int, Stamps]
) -> Iterator[Track]:
    for track in tracks:
        keep = increasing[id(track.stamps)]
        if keep.all():
            yield track
        else:
            missing = None if track.missing is None else track.missing[keep]
            stamps = kept[id(track.stamps)]
            yield replace(track, stamps=stamps, values=track.values[keep], missing=missing)


def _is_increasing(stamps: Stamps) -> Mask:
    latest = np.maximum.accumulate(stamps.time)
    return np.concatenate(([True], stamps.time[1:] > latest[:-1]))


def _only(stamps: Stamps, keep: Mask) -> Stamps:
    rows = None if stamps.rows is None else np.asarray(stamps.rows)[keep].tolist()
    return replace(stamps, time=stamps.time[keep], rows=rows)


def _unordered(path: Path, track: Track, keep: Mask) -> UnorderedStamps:
    time = track.stamps.time
    wrong = np.flatnonzero(~keep)
    latest = np.maximum.accumulate(time)
    duplicates = int(np.sum(time[wrong] == latest[wrong - 1]))
    if len(wrong) >= MOST_UNORDERED * len(time):
        after, before = (
            track.stamps.start + Decimal(str(since))
            for since in (time[wrong[0]], latest[wrong[0] - 1])
        )
        how = "stands still" if after == before else "runs backwards"
        raise track.fault(path, f"time {how}: {after} comes after {before}", int(wrong[0]))
    return UnorderedStamps(duplicates, len(wrong) - duplicates, float(latest[wrong[0] - 1]))
