"""Joint positions and velocities converted to radians from degrees or normalised units."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from inspector.errors import LogError
from inspector.logs.log import Track
from noisemodel import Robot

LARGEST = {"position": 4 * np.pi, "velocity": 100.0}
"""Values above which an angle is taken for degrees, in [rad] and [rad/s]."""

TURN = 2 * np.pi
"""Positions beyond a turn, of half of the joints that move, are in degrees, in [rad]."""

FARTHEST = 720.0
"""Largest position of an arm's joint, in [deg]; wheels turn farther."""

NORMALISED = 100.0
"""Largest position that may be normalised as well."""

STRAIGHT = 0.9
"""Largest share of a joint's way that it is away from its start: wheels go on in one direction."""

MATCHES = {1.0: ("position", "velocity"), np.pi / 180: ("position",), 180 / np.pi: ("velocity",)}
"""What is in degrees, by the ratio of logged velocities to the slope of positions."""

NEAR = 0.1
"""Largest relative deviation from such a ratio."""

STRETCHES = 50
"""Stretches of a log whose ways are compared."""

TURNING = ("revolute", "continuous")

HINT = (
    "if it is in degrees, say --degrees; if in -100 to 100 of each joint's range, --units"
    " normalised; if the joint is prismatic or continuous, name the robot (--robot)"
)


def in_radians(
    path: Path,
    tracks: Sequence[Track],
    robot: Robot | None,
    units: str,
    *,
    normalised_grippers: bool = False,
) -> tuple[Track, ...]:
    """Tracks with angles in radians.

    Args:
        path: The log, for errors.
        tracks: Its tracks.
        robot: The robot, if known: it has the types and the ranges of the joints.
        units: "radians", "degrees", "normalised", or empty if not specified.
        normalised_grippers: Whether grippers are normalised even if the other joints are in
            degrees. They are left out if no robot gives their range.

    Raises:
        LogError: If no unit is specified and a value is too large for radians, or if the unit is
            normalised and the range of a joint is not known.
    """
    if units == "degrees":
        return tuple(
            _to_radians(each, robot) if is_angle else _from_normalised(path, each, robot)
            for track in tracks
            for each, is_angle in _by_kind(track, normalised_grippers=normalised_grippers)
            if is_angle or robot
        )
    if units == "normalised":
        return tuple(_from_normalised(path, track, robot) for track in tracks)
    if not units:
        for track in tracks:
            _refuse_degrees(path, track, robot)
    return tuple(tracks)


def from_degrees(
    tracks: Sequence[Track], robot: Robot | None
) -> tuple[tuple[Track, ...], tuple[str, ...]]:
    """Tracks in radians, where positions and velocities tell that they are in degrees.

    Positions are if half of the joints that move reach beyond a turn, to and fro; velocities if
    they match them. Without velocities, positions have to reach beyond ``NORMALISED``.

    Args:
        tracks: Tracks of a log whose unit is not specified.
        robot: The robot, if known: continuous joints may turn.

    Returns:
        The tracks, and "position" and "velocity" if these were in degrees.
    """
    found = _in_degrees(tracks, robot)
    return (
        tuple(
            _to_radians(track, robot) if track.signal.removesuffix("_desired") in found else track
            for track in tracks
        ),
        found,
    )


def _in_degrees(tracks: Sequence[Track], robot: Robot | None) -> tuple[str, ...]:
    by_signal = {track.signal: track for track in reversed(tracks)}
    for suffix in ("", "_desired"):
        position, velocity = (by_signal.get(f"{each}{suffix}") for each in ("position", "velocity"))
        if position is None:
            continue
        reach = _reach_to_and_fro(position, robot)
        if velocity is None:
            return ("position", "velocity") if reach > NORMALISED else ()
        ratio = _ratio(position, velocity)
        for known, quantities in MATCHES.items():
            if abs(ratio / known - 1) <= NEAR and (reach or "position" not in quantities):
                return quantities
        return ()
    return ()


def _reach_to_and_fro(track: Track, robot: Robot | None) -> float:
    """Largest position, if half of the joints that move go beyond a turn, and back; else 0."""
    kinds = _kinds(robot)
    turns = [kinds.get(joint) == "continuous" for joint in track.joints]
    angular = np.array(is_angular(track, robot)) & ~np.array(turns)
    values = np.unwrap(track.values.astype(np.float64), axis=0, period=360.0)  # if in degrees
    reach = np.abs(track.values).max(axis=0)
    way = np.abs(np.diff(values, axis=0)).sum(axis=0)
    moving = angular & (way > 0)
    far = moving & (reach > TURN)
    back = np.ptp(values, axis=0) < STRAIGHT * way
    largest = float(reach.max(where=far, initial=0.0))
    enough = 2 * far.sum() >= moving.sum() and (far.sum() > 1 or largest > LARGEST["position"])
    return largest if enough and (far & back).any() and largest <= FARTHEST else 0.0


def _ratio(position: Track, velocity: Track) -> float:
    """Median over joints of velocities by the slope of positions; 0 if it is not known."""
    if position.stamps is not velocity.stamps:
        return 0.0
    shared = [joint for joint in position.joints if joint in velocity.joints]
    angle, speed = (
        track.values[:, [track.joints.index(joint) for joint in shared]].astype(np.float64)
        for track in (position, velocity)
    )
    steps = np.diff(position.stamps.time)[:, None]
    summed = np.vstack((np.zeros(len(shared)), np.cumsum((speed[1:] + speed[:-1]) / 2 * steps, 0)))
    places = np.unique(np.linspace(0, len(angle) - 1, STRETCHES + 1).astype(int))
    ways, expected = np.diff(angle[places], axis=0), np.diff(summed[places], axis=0)
    jumps = np.maximum.reduceat(np.abs(np.diff(angle, axis=0)), places[:-1], axis=0)
    ways[jumps > np.ptp(angle, axis=0) / 2] = 0.0  # a wrapped angle, of whatever unit
    square = np.square(ways).sum(axis=0)
    known = square > 0
    if not known.any():
        return 0.0
    return float(np.median((expected * ways).sum(axis=0)[known] / square[known]))


def grippers(track: Track) -> tuple[str, ...]:
    """Joints whose names are those of grippers."""
    return tuple(joint for joint in track.joints if _is_gripper(joint))


def is_angular(track: Track, robot: Robot | None) -> list[bool]:
    """Whether each column is an angle or an angular rate; True for joints of unknown type."""
    kinds = _kinds(robot)
    moves = track.signal.startswith(("position", "velocity"))
    return [moves and kinds.get(joint, "revolute") in TURNING for joint in track.joints]


def _to_radians(track: Track, robot: Robot | None) -> Track:
    angular = is_angular(track, robot)
    if not any(angular):
        return track
    return replace(track, values=np.where(angular, np.deg2rad(track.values), track.values))


def _from_normalised(path: Path, track: Track, robot: Robot | None) -> Track:
    """Track with -100 to 100 scaled to the range of each joint; of grippers, 0 to 100."""
    if not track.signal.startswith(("position", "velocity")):
        return track
    if robot is None:
        raise LogError(
            path, "normalised units are shares of the joints' ranges; name the robot (--robot)"
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


def _by_kind(track: Track, *, normalised_grippers: bool) -> Iterator[tuple[Track, bool]]:
    """Split a track into angles and, if these are normalised, grippers; whether it is angles."""
    for is_angle in (True, False):
        kept = [
            place
            for place, joint in enumerate(track.joints)
            if (normalised_grippers and _is_gripper(joint)) is not is_angle
        ]
        if kept or (is_angle and not track.joints):
            yield _columns(track, kept) if 0 < len(kept) < len(track.joints) else track, is_angle


def _columns(track: Track, kept: Sequence[int]) -> Track:
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
    for place, angular in enumerate(is_angular(track, robot)):
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
