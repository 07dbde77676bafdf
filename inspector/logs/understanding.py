"""The fields of a log become tracks: one signal each, of joints that have names."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from inspector.errors import LogError
from inspector.logs.claims import Claim, claims_of
from inspector.logs.columns import BASE_SIGNALS, JOINT_SIGNALS, listed
from inspector.logs.floatingbase import pose_of, unturned, velocity_of
from inspector.logs.log import Log, Track
from inspector.logs.reading import Reading
from noisemodel import Robot, UnknownJointError
from noisemodel.types import Real


@dataclass(frozen=True, eq=False)
class Understood:
    """What a log holds.

    Attributes:
        tracks: The signals.
        left: Names of what is not read.
        remarks: What was decided, a sentence each.
    """

    tracks: tuple[Track, ...]
    left: tuple[str, ...]
    remarks: tuple[str, ...]


def understood(log: Log, reading: Reading, robot: Robot | None) -> Understood:
    """Find out what each field holds; what a person said goes before what names say.

    Args:
        log: The log.
        reading: What a person said of it.
        robot: The robot, if it is known.

    Raises:
        LogError: If two columns hold the same, nothing is known to hold motion, or a mapping does
            not fit the arrays.
        UnknownJointError: If the robot has none of the joints, or not one that a person named.
    """
    claims, strangers = _of_robot(list(claims_of(log, reading, robot)), robot)
    kept = _settled(log, claims)
    if not any(claim.signal.startswith(("position", "velocity")) for claim in kept):
        raise LogError(
            log.path,
            "no position or velocity of a joint; name columns JOINT.velocity or JOINT.position, or"
            " say what they hold with --map velocity.JOINT=COLUMN or --map velocity=ARRAY; columns"
            f" are {listed([field.name for field in log.fields] + list(log.left))}",
        )
    read = {id(claim.field) for claim in kept}
    left = tuple(field.name for field in log.fields if id(field) not in read)
    remarks = (
        (f"left out, not joints of {robot.name!r}: {listed(strangers)}",)
        if (strangers and robot)
        else ()
    )
    return Understood(tuple(_tracks(log, kept)), (*log.left, *left), remarks)


def _of_robot(claims: list[Claim], robot: Robot | None) -> tuple[list[Claim], tuple[str, ...]]:
    """Leave out the joints that the robot does not have, if it has any of them."""
    if robot is None:
        return claims, ()
    strangers = [
        claim
        for claim in claims
        if claim.signal in JOINT_SIGNALS and claim.joint not in robot.joint_names
    ]
    others = [claim for claim in claims if claim not in strangers]
    if strangers and not any(claim.signal in JOINT_SIGNALS for claim in others):
        raise UnknownJointError(strangers[0].joint, robot.name, robot.joint_names)
    for claim in strangers:
        if claim.said:
            raise UnknownJointError(claim.joint, robot.name, robot.joint_names)
    return others, tuple(dict.fromkeys(claim.joint for claim in strangers))


def _settled(log: Log, claims: Sequence[Claim]) -> list[Claim]:
    """Keep one claim to each signal of each joint."""
    found: dict[tuple[str, str], Claim] = {}
    for claim in claims:
        twin = found.setdefault(claim.held, claim)
        if claim.weight < twin.weight:
            found[claim.held] = claim
        elif twin is not claim and claim.weight == twin.weight:
            what = f"{claim.signal} of " + (
                f"joint {claim.held[1]!r}" if claim.held[1] else "the base"
            )
            if claim.field.source != twin.field.source:
                raise LogError(
                    log.path,
                    f"{twin.field.source} and {claim.field.source} both hold {what};"
                    " choose with --topic",
                )
            if claim.field.joints != twin.field.joints:
                raise _changing(log, twin, claim)
            row = 1 if claim.field.stamps.rows is not None else None
            raise LogError(log.path, f"{twin.label!r} and {claim.label!r} both hold {what}", row)
    return [claim for claim in claims if found[claim.held] is claim]


def _changing(log: Log, before: Claim, after: Claim) -> LogError:
    old, new = before.field, after.field
    since = float(new.stamps.start - old.stamps.start)
    return LogError(
        log.path,
        f"{new.source}: the set of joints changes {since:.6g} s into the log, from"
        f" {listed(old.joints)} to {listed(new.joints)}; split the log there",
    )


def _tracks(log: Log, claims: Sequence[Claim]) -> Iterator[Track]:
    """Put columns of one signal that were taken together side by side."""
    yield from _base_tracks(log, {c.signal: c for c in claims if c.signal in BASE_SIGNALS})
    together: dict[tuple[str, int], list[Claim]] = {}
    for claim in claims:
        if claim.signal in JOINT_SIGNALS:
            together.setdefault((claim.signal, id(claim.field.stamps)), []).append(claim)
    for (signal, _), members in together.items():
        yield Track(
            signal,
            tuple(claim.joint for claim in members),
            tuple(claim.label for claim in members),
            members[0].field.stamps,
            _side_by_side(members),
        )


def _base_tracks(log: Log, claims: Mapping[str, Claim]) -> Iterator[Track]:
    pose = None
    if claim := claims.get("base_pose"):
        stamps = claim.field.stamps
        pose = pose_of(claim.field.values[:, claim.columns], claim.joint)
        track = Track("base_pose", (), (claim.field.name,) * 7, stamps, pose)
        if (wrong := unturned(pose)).any():
            raise track.fault(
                log.path,
                f"{claim.label}: a quaternion has another length than 1; expected x, y, z and the"
                " quaternion",
                int(np.argmax(wrong)),
            )
        yield track
    if claim := claims.get("base_velocity"):
        values = claim.field.values[:, claim.columns]
        if claim.joint in ("world", "mujoco"):
            if pose is None or claims["base_pose"].field.stamps is not claim.field.stamps:
                raise LogError(
                    log.path,
                    f"{claim.label}: a velocity in the world's axes is turned into the body's by a"
                    " base_pose of the same samples, and there is none (--map base_pose=ARRAY)",
                )
            values = velocity_of(values, claim.joint, pose)
        yield Track(
            "base_velocity", (), (claim.field.name,) * 6, claim.field.stamps, np.asarray(values)
        )


def _side_by_side(claims: Sequence[Claim]) -> Real:
    first = claims[0].field.values
    if all(claim.field.values is first for claim in claims):
        columns = [claim.columns.start for claim in claims]
        if columns == list(range(first.shape[1])):
            return first  # as it is: a long log is hundreds of megabytes
        return first[:, columns]
    return np.hstack([claim.field.values[:, claim.columns] for claim in claims])
