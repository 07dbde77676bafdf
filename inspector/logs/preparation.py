"""A log prepared for a run: its tracks in SI units, finite, with increasing stamps."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from inspector.errors import LogError
from inspector.logs.angles import from_degrees, grippers, in_radians
from inspector.logs.log import Log, Track
from inspector.logs.options import ReadOptions
from inspector.logs.ordering import UnorderedStamps, ordered
from inspector.logs.signals import listed
from inspector.logs.tracks import tracks_of
from noisemodel import Robot
from noisemodel.types import Mask

NO_RANGE = "normalised to 0 to 100 of its range, left out since no robot is specified"


@dataclass(frozen=True, eq=False)
class PreparedLog:
    """A log with the measured or the desired motion.

    Attributes:
        path: The log.
        tracks: Its signals, in SI units, with increasing stamps.
        names: Names of its columns and arrays, which a mapping may refer to.
        not_read: Names of what is not read.
        unordered: Stamps that were not increasing.
        remarks: What was decided, a sentence each.
        urdf: Text of the URDF in the log, may be empty.
        meta: Metadata of the log.
        in_degrees: "position" and "velocity" if these were found to be in degrees.
        time: Name of the column or array with the stamps, if it has one.
    """

    path: Path
    tracks: tuple[Track, ...]
    names: tuple[str, ...]
    not_read: tuple[str, ...]
    unordered: tuple[UnorderedStamps, ...]
    remarks: tuple[str, ...]
    urdf: str = ""
    meta: Mapping[str, Any] = field(default_factory=dict)
    in_degrees: tuple[str, ...] = ()
    time: str = ""


def prepared(log: Log, options: ReadOptions, robot: Robot | None) -> PreparedLog:
    """Tracks of a log, checked and converted.

    Raises:
        LogError: If it holds no motion, an infinite value, an angle in an unknown unit,
            or stamps that do not increase.
        RobotError: If the robot lacks the joints that the log names.
    """
    if log.units and not options.units:
        raise LogError(log.path, log.units)
    found = tracks_of(log, options, robot)
    tracks, too_short = _with_two_samples(log.path, found.tracks)
    tracks, all_nan = _finite_only(log.path, tracks)
    if log.units and options.units == "degrees" and not robot:
        left_out = dict.fromkeys(joint for track in tracks for joint in grippers(track))
        all_nan += (f"{NO_RANGE}: {listed(list(left_out))}",) if left_out else ()
    tracks, in_degrees = (tracks, ()) if options.units else from_degrees(tracks, robot)
    tracks = in_radians(log.path, tracks, robot, options.units, normalised_grippers=bool(log.units))
    tracks, unordered = ordered(log.path, tracks)
    return PreparedLog(
        path=log.path,
        tracks=tracks,
        names=(*(each.name for each in log.fields), *log.not_read),
        not_read=found.not_read,
        unordered=unordered,
        remarks=(*log.remarks, *found.remarks, *too_short, *all_nan, *_degrees(in_degrees)),
        urdf=log.urdf,
        time=log.time,
        meta={**log.meta, **({"units": options.units} if options.units else {})},
        in_degrees=in_degrees,
    )


def _degrees(quantities: Sequence[str]) -> Iterator[str]:
    """What was found to be in degrees, if anything, in a sentence."""
    plural = {"position": "positions", "velocity": "velocities"}
    if names := " and ".join(plural[each] for each in quantities):
        yield f"{names} look like degrees: converted to radians (if they are not, --units radians)"


def check_mapping(logs: Sequence[PreparedLog], options: ReadOptions) -> None:
    """Refuse a mapping of a column that none of the logs has."""
    names = {name for log in logs for name in log.names}
    for entry in options.entries:
        known = entry.source in names or entry.part()[0] in names
        if entry.signal == "time":
            known = any(entry.source == log.time for log in logs)
        if not known:
            raise LogError(
                logs[0].path,
                f"there is no column {entry.source!r} to map; it has {listed(logs[0].names)}",
            )


def with_desired(measured: PreparedLog, desired: PreparedLog) -> list[PreparedLog]:
    """Both logs, with desired motion only from the second."""
    own = [track for track in measured.tracks if not track.is_desired]
    others = [track for track in desired.tracks if track.is_desired] or [
        replace(track, signal=f"{track.signal}_desired")
        for track in desired.tracks
        if track.signal in ("position", "velocity")
    ]
    return [_with_tracks(measured, own), _with_tracks(desired, others)]


def _with_tracks(log: PreparedLog, tracks: Sequence[Track]) -> PreparedLog:
    kept = {id(track.values) for track in tracks}
    dropped = [
        label for track in log.tracks if id(track.values) not in kept for label in track.labels
    ]
    return replace(log, tracks=tuple(tracks), not_read=(*log.not_read, *dropped))


def _with_two_samples(
    path: Path, tracks: Sequence[Track]
) -> tuple[tuple[Track, ...], tuple[str, ...]]:
    """Tracks of at least two samples, and a remark on the others."""
    long_enough = tuple(track for track in tracks if len(track.values) > 1)
    if not any(track.joints for track in long_enough):
        raise LogError(path, "1 sample; a run needs at least 2")
    once = [label for track in tracks if len(track.values) < 2 for label in track.labels]
    return long_enough, (f"logged once only, left out: {listed(once)}",) if once else ()


def _finite_only(path: Path, tracks: Sequence[Track]) -> tuple[tuple[Track, ...], tuple[str, ...]]:
    """Tracks without columns that are nan throughout, and with gaps where others are nan."""
    remarks: list[str] = []
    return tuple(_finite(path, tracks, remarks)), tuple(remarks)


def _finite(path: Path, tracks: Sequence[Track], remarks: list[str]) -> Iterator[Track]:
    for track in tracks:
        if np.isfinite(track.values).all():
            yield track
            continue
        lacking = np.isnan(track.values)
        infinite = np.argwhere(np.isinf(track.values))
        if len(infinite):
            sample, column = map(int, infinite[0])
            value = track.values[sample, column]
            raise track.fault(path, f"column {track.labels[column]!r} holds {value}", sample)
        empty = np.atleast_1d(lacking.all(axis=0))
        if empty.any():
            names = [label for label, is_nan in zip(track.labels, empty, strict=True) if is_nan]
            remarks.append(f"all nan, left out: {listed(names)}")
            kept = np.flatnonzero(~empty)
            if not len(kept) or not track.joints:
                continue
            track = replace(
                track,
                joints=tuple(track.joints[place] for place in kept),
                labels=tuple(track.labels[place] for place in kept),
                values=track.values[:, kept],
            )
            lacking = lacking[:, kept]
        yield _with_gaps(track, lacking, remarks) if lacking.any() else track


def _with_gaps(track: Track, lacking: Mask, remarks: list[str]) -> Track:
    """Track whose samples with nan are missing, and interpolated lest they spoil others."""
    missing: Mask = np.asarray(lacking.any(axis=1))
    some = np.atleast_1d(lacking.any(axis=0)).tolist()
    labels = [label for label, any_ in zip(track.labels, some, strict=True) if any_]
    first = track.stamps.time[np.argmax(missing)] - track.stamps.time[0]
    remarks.append(
        f"{missing.sum()} sample{'' if missing.sum() == 1 else 's'} without a number, marked as"
        f" not valid: {listed(list(dict.fromkeys(labels)))}, the first at {first:.6g} s"
    )
    places, values = np.arange(len(missing)), np.array(track.values)
    for column, nan in zip(values.T, lacking.T, strict=True):
        column[nan] = np.interp(places[nan], places[~nan], column[~nan])
    return replace(track, values=values, missing=missing)
