"""One log on its way to a run: its tracks, in order and in SI, and what was decided about them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from inspector.errors import LogError
from inspector.logs.angles import grippers, in_radians
from inspector.logs.columns import listed
from inspector.logs.log import Log, Track
from inspector.logs.ordering import Disorder, ordered
from inspector.logs.reading import Reading
from inspector.logs.understanding import understood
from noisemodel import Robot

NO_ANGLE = "in 0 to 100 of its range, no angle, left out without a robot"


@dataclass(frozen=True, eq=False)
class Side:
    """The measured or the desired motion.

    Attributes:
        path: The log.
        tracks: Its signals, in SI units, their stamps rising.
        names: What the log has, by name: what a mapping may speak of.
        left: What is not read.
        disorders: Stamps that did not rise.
        remarks: What was decided, a sentence each.
        urdf: Text of the URDF that came with the log, may be empty.
        meta: What the log says of itself.
    """

    path: Path
    tracks: tuple[Track, ...]
    names: tuple[str, ...]
    left: tuple[str, ...]
    disorders: tuple[Disorder, ...]
    remarks: tuple[str, ...]
    urdf: str = ""
    meta: Mapping[str, Any] = field(default_factory=dict)


def side_of(log: Log, reading: Reading, robot: Robot | None) -> Side:
    """Find out what a log holds, and check it.

    Raises:
        LogError: If it holds no motion, a value that is not finite, an angle in units that nobody
            named, or time that does not run forwards.
        RobotError: If the robot lacks the joints that the log names.
    """
    if log.units and not reading.units:
        raise LogError(log.path, log.units)
    found = understood(log, reading, robot)
    tracks, brief = _lasting(log.path, found.tracks)
    tracks, unlogged = _logged(log.path, tracks)
    if log.units and reading.units == "degrees" and not robot:
        gone = dict.fromkeys(joint for track in tracks for joint in grippers(track))
        unlogged += (f"{NO_ANGLE}: {listed(list(gone))}",) if gone else ()
    tracks = in_radians(log.path, tracks, robot, reading.units, grips=bool(log.units))
    tracks, disorders = ordered(log.path, tracks)
    return Side(
        path=log.path,
        tracks=tracks,
        names=(*(each.name for each in log.fields), *log.left),
        left=found.left,
        disorders=disorders,
        remarks=(*log.remarks, *found.remarks, *brief, *unlogged),
        urdf=log.urdf,
        meta={**log.meta, **({"units": reading.units} if reading.units else {})},
    )


def check_mapped(sides: Sequence[Side], reading: Reading) -> None:
    """Refuse a mapping of what none of the logs has."""
    names = {name for side in sides for name in side.names}
    for entry in reading.entries:
        known = entry.source in names or entry.part()[0] in names
        if not known and entry.signal != "time":
            raise LogError(
                sides[0].path,
                f"there is no column {entry.source!r} to map; it has {listed(sides[0].names)}",
            )


def paired(measured: Side, desired: Side) -> list[Side]:
    """Take the desired motion from the second log alone."""
    own = [track for track in measured.tracks if not track.is_desired]
    others = [track for track in desired.tracks if track.is_desired] or [
        replace(track, signal=f"{track.signal}_desired")
        for track in desired.tracks
        if track.signal in ("position", "velocity")
    ]
    return [_keeping(measured, own), _keeping(desired, others)]


def _keeping(side: Side, tracks: Sequence[Track]) -> Side:
    kept = {id(track.values) for track in tracks}
    dropped = [
        label for track in side.tracks if id(track.values) not in kept for label in track.labels
    ]
    return replace(side, tracks=tuple(tracks), left=(*side.left, *dropped))


def _lasting(path: Path, tracks: Sequence[Track]) -> tuple[tuple[Track, ...], tuple[str, ...]]:
    """Leave out what was logged once only; time needs two samples."""
    lasting = tuple(track for track in tracks if len(track.values) > 1)
    if not any(track.joints for track in lasting):
        raise LogError(path, "1 sample; a run needs at least 2")
    single = [label for track in tracks if len(track.values) < 2 for label in track.labels]
    return lasting, (f"logged once only, left out: {listed(single)}",) if single else ()


def _logged(path: Path, tracks: Sequence[Track]) -> tuple[tuple[Track, ...], tuple[str, ...]]:
    """Refuse values that are not finite, but leave out columns that never were."""
    remarks: list[str] = []
    return tuple(_finite(path, tracks, remarks)), tuple(remarks)


def _finite(path: Path, tracks: Sequence[Track], remarks: list[str]) -> Iterator[Track]:
    for track in tracks:
        finite = np.isfinite(track.values)
        if finite.all():
            yield track
            continue
        empty = np.atleast_1d(np.isnan(track.values).all(axis=0))
        wrong = np.argwhere(~finite & ~empty)
        if len(wrong):
            sample, column = map(int, wrong[0])
            value = track.values[sample, column]
            raise track.fault(path, f"column {track.labels[column]!r} holds {value}", sample)
        names = [label for label, nothing in zip(track.labels, empty, strict=True) if nothing]
        remarks.append(f"nothing but nan, left out: {listed(names)}")
        kept = np.flatnonzero(~empty)
        if len(kept) and track.joints:
            yield replace(
                track,
                joints=tuple(track.joints[place] for place in kept),
                labels=tuple(track.labels[place] for place in kept),
                values=track.values[:, kept],
            )
