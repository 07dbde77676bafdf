"""The limbs of a robot: joints that follow each other, to be shown in one plot."""

from collections import Counter
from collections.abc import Sequence
from itertools import takewhile

from rerun.urdf import UrdfTree

MAX_JOINTS = 10
"""Joints that one plot can hold."""
JOINTS_PER_PLOT = 8
"""Joints in each plot if there are more than that."""


def limbs(names: Sequence[str], tree: UrdfTree | None) -> dict[str, tuple[str, ...]]:
    """Divide joints into limbs.

    Args:
        names: The joints that a run names.
        tree: Their robot; without one, eight neighbours in the list make a limb.

    Returns:
        The joints of each limb, by its name.
    """
    if not names:
        return {}
    groups = [tuple(names)] if tree is None else _chains(names, tree)
    parts = []
    for group in groups:
        size = len(group) if len(group) <= MAX_JOINTS else JOINTS_PER_PLOT
        parts += [group[first : first + size] for first in range(0, len(group), size)]
    titles = [_title(part) for part in parts] if len(parts) > 1 else ["joints"]
    count = Counter(titles)
    return {
        title if count[title] == 1 else f"{part[0]} … {part[-1]}": part
        for title, part in zip(titles, parts, strict=True)
    }


def _chains(names: Sequence[str], tree: UrdfTree) -> list[tuple[str, ...]]:
    """Follow the robot outwards: a limb begins where it branches, and has two joints or more."""
    carrier = _carriers(names, tree)
    branches = Counter(carrier.values())
    limb: dict[str, str] = {}
    waiting = list(names)
    while waiting:
        name = next(name for name in waiting if carrier[name] not in waiting)
        above = carrier[name]
        alone = not branches[name]  # a finger, a wheel
        goes_on = above in limb and (alone or branches[above] == 1)
        limb[name] = limb[above] if goes_on else "" if alone and not above else name
        waiting.remove(name)
    return [
        tuple(name for name in names if limb[name] == first)
        for first in dict.fromkeys(limb[name] for name in names)
    ]


def _carriers(names: Sequence[str], tree: UrdfTree) -> dict[str, str]:
    """Name, for each joint, the next of them towards the root; nothing if there is none."""
    moved_by = {joint.child_link: joint for joint in tree.joints()}
    carrier = {}
    for joint in tree.joints():
        link, found = joint.parent_link, ""
        while not found and link in moved_by:
            above = moved_by[link]
            found = above.name if above.name in names else ""
            link = above.parent_link
        carrier[joint.name] = found
    return {name: carrier[name] for name in names}


def _title(joints: Sequence[str]) -> str:
    """Name a limb by what its first two joints' names share."""
    pairs = zip(*joints[:2], strict=False)
    same = "".join(pair[0] for pair in takewhile(lambda pair: len(set(pair)) == 1, pairs))
    shared = same.rstrip("_-0123456789") if len(joints) > 1 else ""
    return shared if len(shared) > 1 else f"{joints[0]} … {joints[-1]}"
