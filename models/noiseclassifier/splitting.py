"""Splits of recordings into training and test sets.

Conventions: frames of one recording overlap, so that it stands on one side as a whole. Samples of
simulated runs are called ``robot/scenario-seed``; those of one robot and seed share their motion
bit for bit until their defects act, so that they are one *group* and stand on one side, too. Any
other recording is a group of its own. No split depends on chance or on the order of files.
"""

import hashlib
import re
from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np

from noiseclassifier.errors import DatasetError, SeenError
from noiseclassifier.types import Index

_SAMPLE = re.compile(r"([^/]+)/.+-(\d+)")

SHARE = 0.25
"""Of all groups, those that are held out for the last measurement."""


@cache
def group_of(name: str) -> str:
    """Group of recordings that share their motion.

    Args:
        name: Of a recording: ``talos/obstacle-toe-007``.

    Returns:
        Robot and seed of a sample, ``talos-007``; any other name as it is.
    """
    sample = _SAMPLE.fullmatch(name)
    return f"{sample[1]}-{sample[2]}" if sample else name


def robot_of(name: str) -> str:
    """Robot of a sample; empty where a name does not contain it.

    Args:
        name: Of a recording: ``talos/obstacle-toe-007``.
    """
    sample = _SAMPLE.fullmatch(name)
    return sample[1] if sample else ""


def held_out(group: str, share: float = SHARE) -> bool:
    """Whether a group belongs to the fixed test set, whatever other groups there are.

    The first 8 bytes of the SHA-256 of the group's name (UTF-8), read as a fraction of 2^64, lie
    below the share. A group that is held out at one share is held out at all larger ones.

    Args:
        group: What `group_of` gives.
        share: Of very many groups, those that are held out.
    """
    return int.from_bytes(_digest(group)[:8], "big") / 2.0**64 < share


def folds(groups: Sequence[str], count: int) -> list[tuple[Index, Index]]:
    """Split into folds by groups: of even sizes, and with each robot in each fold if it can be.

    The largest groups are dealt first, each to the fold that has least of its robot, and of those
    to the one that has least of all.

    Args:
        groups: Group of each recording or frame, shape (items,).
        count: How many folds, two or more.

    Returns:
        For each fold, indices of the training items, and of the test items; each item is
        measured once.

    Raises:
        DatasetError: If there are fewer groups than folds, or fewer than two folds.
    """
    found, member, sizes = np.unique(
        np.asarray(groups, dtype=str), return_inverse=True, return_counts=True
    )
    names = [str(name) for name in found]
    if not 2 <= count <= len(names):
        raise DatasetError(
            f"{count} folds of {len(names)} groups, expected two folds or more and a group for"
            " each; recordings that share their motion are one group"
        )
    robots = [name.rpartition("-")[0] for name in names]
    load = {robot: np.zeros(count, dtype=np.intp) for robot in robots}
    total, fold = np.zeros(count, dtype=np.intp), np.zeros(len(names), dtype=np.intp)
    order = sorted(range(len(names)), key=lambda item: (-sizes[item], _digest(names[item])))
    for item in order:
        mine = load[robots[item]]
        fold[item] = np.lexsort((total, mine))[0]
        mine[fold[item]] += sizes[item]
        total[fold[item]] += sizes[item]
    of_item = fold[member]
    return [
        (np.flatnonzero(of_item != number), np.flatnonzero(of_item == number))
        for number in range(count)
    ]


def leave_one_out(robots: Sequence[str]) -> list[tuple[str, Index, Index]]:
    """Split by robot, to measure a model on robots without training runs.

    Args:
        robots: Robot of each recording or frame, shape (items,).

    Returns:
        For each robot, in the order of the alphabet, its name, the indices of all other items, and
        those of its own.

    Raises:
        DatasetError: If there are fewer than two robots.
    """
    each = np.asarray(robots, dtype=str)
    names = np.unique(each).tolist()
    if len(names) < 2:
        raise DatasetError(
            f"one robot cannot be left out of {len(names)} ({', '.join(names) or 'none'});"
            " expected two or more"
        )
    return [(name, np.flatnonzero(each != name), np.flatnonzero(each == name)) for name in names]


def seen(train: Mapping[str, str], test: Mapping[str, str]) -> dict[str, str]:
    """Test recordings that a model was trained on, or that share their motion with such.

    Args:
        train: SHA-256 of each training recording, by name.
        test: SHA-256 of each test recording, by name.

    Returns:
        What of them, by name of the recording. Other names than those of samples define nothing
        where there are hashes: `run.npz` of one folder is not that of another.
    """
    hashes = {digest: name for name, digest in train.items() if digest}
    groups = {group_of(name): name for name in train}
    found = {}
    for name, digest in test.items():
        if digest in hashes:
            found[name] = f"the same recording as {hashes[digest]!r}"
        elif group_of(name) != name and group_of(name) in groups:
            found[name] = f"{groups[group_of(name)]!r}, which shares its motion"
        elif name in train and not (digest and train[name]):
            found[name] = "a recording of this name"
    return found


def check_apart(train: Mapping[str, str], test: Mapping[str, str]) -> None:
    """Refuse to test a model on its training set: a check against overlapping frames.

    Args:
        train: SHA-256 of each training recording, by name.
        test: SHA-256 of each test recording, by name.

    Raises:
        SeenError: If a recording, its content, or its group is on both sides.
    """
    if found := seen(train, test):
        raise SeenError(found, len(test))


def _digest(name: str) -> bytes:
    return hashlib.sha256(name.encode()).digest()
