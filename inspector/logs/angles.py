"""Degrees and normalised units, told from radians and turned into them."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from inspector.errors import LogError
from inspector.logs.log import Track
from noisemodel import Robot

LARGEST = {"position": 4 * np.pi, "velocity": 100.0}
"""What a joint that turns hardly exceeds, in [rad] and [rad/s]."""

TURNING = ("revolute", "continuous")

HINT = (
    "if it is in degrees, say --degrees, if in -100 to 100 of each joint's range, --units"
    " normalised; if the joint slides or turns without end, say which robot it is (--robot)"
)


def in_radians(
    path: Path, tracks: Sequence[Track], robot: Robot | None, units: str, *, grips: bool = False
) -> tuple[Track, ...]:
    """Bring the motion of joints into radians.

    Args:
        path: The log, for errors.
        tracks: Its tracks.
        robot: The robot, if it is known: it tells joints that slide, and their ranges.
        units: "radians", "degrees", "normalised", or empty if nobody said.
        grips: Whether grippers are normalised even where the rest is in degrees. They are left
            out if there is no robot that has their range.

    Raises:
        LogError: If nobody said a unit and a joint that turns goes further than any does in
            radians, or if it is normalised and the joint's range is not known.
    """
    if units == "degrees":
        return tuple(
            _to_radians(each, robot) if is_angle else _from_shares(path, each, robot)
            for track in tracks
            for each, is_angle in _apart(track, grips=grips)
            if is_angle or robot
        )
    if units == "normalised":
        return tuple(_from_shares(path, track, robot) for track in tracks)
    if not units:
        for track in tracks:
            _refuse_degrees(path, track, robot)
    return tuple(tracks)


def grippers(track: Track) -> tuple[str, ...]:
    """Name the joints that are grippers, going by their names."""
    return tuple(joint for joint in track.joints if _is_gripper(joint))


def turns(track: Track, robot: Robot | None) -> list[bool]:
    """Say of each column whether it is an angle or a rate of one, as far as is known."""
    kinds = _kinds(robot)
    moves = track.signal.startswith(("position", "velocity"))
    return [moves and kinds.get(joint, "revolute") in TURNING for joint in track.joints]


def _to_radians(track: Track, robot: Robot | None) -> Track:
    angular = turns(track, robot)
    if not any(angular):
        return track
    return replace(track, values=np.where(angular, np.deg2rad(track.values), track.values))


def _from_shares(path: Path, track: Track, robot: Robot | None) -> Track:
    """Take -100 to 100 for a joint's whole range; of grippers, 0 to 100."""
    if not track.signal.startswith(("position", "velocity")):
        return track
    if robot is None:
        raise LogError(
            path, "normalised units are shares of the joints' ranges; say which robot (--robot)"
        )
    joints = {joint.name: joint for joint in robot.joints}
    scales, zeros = [], []
    for name in track.joints:
        place = joints[name].first_q
        lower = float(robot.model.lowerPositionLimit[place])
        span = float(robot.model.upperPositionLimit[place]) - lower
        if joints[name].kind == "continuous" or not 0 < span < 1e3:
            raise LogError(path, f"normalised units: joint {name!r} of {robot.name!r} has no range")
        scales.append(span / (100 if _is_gripper(name) else 200))
        zeros.append(lower if _is_gripper(name) else lower + span / 2)
    moved = zeros if track.signal.startswith("position") else 0.0
    return replace(track, values=track.values * np.array(scales) + moved)


def _is_gripper(joint: str) -> bool:
    return "gripper" in joint or "finger" in joint


def _apart(track: Track, *, grips: bool) -> Iterator[tuple[Track, bool]]:
    """Take grippers from the other joints, if that is asked for."""
    for is_angle in (True, False):
        kept = [
            place
            for place, joint in enumerate(track.joints)
            if (grips and _is_gripper(joint)) is not is_angle
        ]
        if kept or (is_angle and not track.joints):
            yield _only(track, kept) if 0 < len(kept) < len(track.joints) else track, is_angle


def _only(track: Track, kept: Sequence[int]) -> Track:
    return replace(
        track,
        joints=tuple(track.joints[place] for place in kept),
        labels=tuple(track.labels[place] for place in kept),
        values=track.values[:, kept],
    )


def _refuse_degrees(path: Path, track: Track, robot: Robot | None) -> None:
    quantity = track.signal.removesuffix("_desired")
    if quantity not in LARGEST:
        return
    kinds = _kinds(robot)
    for place, angular in enumerate(turns(track, robot)):
        endless = kinds.get(track.joints[place]) == "continuous" and quantity == "position"
        if not angular or endless:
            continue
        beyond = np.abs(track.values[:, place]) > LARGEST[quantity]
        if beyond.any():
            sample = int(np.argmax(beyond))
            raise track.fault(
                path,
                f"column {track.labels[place]!r} holds {track.values[sample, place]:g}, too much"
                f" for radians; {HINT}",
                sample,
            )


def _kinds(robot: Robot | None) -> dict[str, str]:
    return {joint.name: joint.kind for joint in robot.joints} if robot else {}
