"""Checks of a URDF before Pinocchio reads it, which crashes on some and accepts wrong ones."""

import math
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

from noisemodel.errors import RobotError
from noisemodel.files import beyond, limit, parsed_xml

MAX_BYTES = 64 * 2**20
NUMBERS = {"xyz": 3, "rpy": 3, "ixx": 1, "iyy": 1, "izz": 1, "ixy": 1, "ixz": 1, "iyz": 1}

AXIAL = {"revolute", "continuous", "prismatic", "planar"}
"""Joint types whose axis matters; that of a fixed joint is often 0."""


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: its position is multiplier times the other's plus offset.

    Attributes:
        joint: The joint that is followed.
        multiplier: In [rad/rad], or as the two joints' units have it.
        offset: In [rad] or [m].
    """

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Urdf:
    """What is read from a URDF besides Pinocchio's model.

    Attributes:
        path: The file.
        name: The robot's own name.
        mimics: The joints that follow another one, by name.
    """

    path: Path
    name: str
    mimics: dict[str, Mimic]


def read(path: Path) -> Urdf:
    """Read and check a URDF.

    Args:
        path: The file.

    Returns:
        Its name and mimic joints.

    Raises:
        RobotError: If it cannot be read, is no URDF, is larger than the limits, or holds a
            number that is not finite or an axis of length 0.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise RobotError(f"{path}: larger than {MAX_BYTES} bytes, no URDF is")
        text = path.read_bytes()
    except OSError as error:
        raise RobotError(f"{path}: cannot be read ({error.strerror})") from error
    if not text.strip():
        raise RobotError(f"{path}: the URDF is empty")
    try:
        root = parsed_xml(text)
    except ValueError as error:
        raise RobotError(f"{path}: {error}") from error
    if root.tag != "robot":
        raise RobotError(f"{path}: not a URDF, its root is <{root.tag}>, expected <robot>")
    if not root.get("name"):
        raise RobotError(f"{path}: the URDF is empty or unexpanded, its <robot> has no name")
    joints = root.findall("joint")
    if len(joints) > limit("joints"):
        raise RobotError(f"{path}: {len(joints)} joints; {beyond('joints')}")
    if root.find("link") is None:
        raise RobotError(f"{path}: the URDF has no link")
    _check_numbers(path, root)
    _check_tree(path, root, joints)
    mimics = {name: m for j in joints for name, m in _mimic(path, j)}
    for name in mimics:
        leader = name
        for _ in mimics:
            leader = mimics[leader].joint if leader in mimics else ""
            if leader == name:
                raise RobotError(f"{path}: joint {name!r} mimics itself")
    return Urdf(path, root.get("name", ""), mimics)


def _check_numbers(path: Path, root: ET.Element) -> None:
    for element in root.iter():
        for name, count in NUMBERS.items():
            if name in element.attrib:
                values = _numbers(path, element, name)
                if len(values) != count:
                    raise RobotError(
                        f"{path}: <{element.tag} {name}={element.get(name)!r}> has"
                        f" {len(values)} numbers, expected {count}"
                    )
        if element.tag == "mass" and len(_numbers(path, element, "value")) != 1:
            raise RobotError(f"{path}: <mass value={element.get('value')!r}> is not one number")
    for joint in root.findall("joint"):
        axis = joint.find("axis")
        if axis is not None and joint.get("type") in AXIAL and not any(_numbers(path, axis, "xyz")):
            raise RobotError(f"{path}: the axis of joint {joint.get('name')!r} has length 0")


def _check_tree(path: Path, root: ET.Element, joints: list[ET.Element]) -> None:
    """Refuse joints that go round in a circle, which Pinocchio leaves out."""
    parents = {}
    for joint in joints:
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            parents[child.get("link")] = parent.get("link")
    done = set[str | None]()
    for link in parents:
        chain = set[str | None]()
        while link in parents and link not in done:
            if link in chain:
                raise RobotError(f"{path}: the joints of link {link!r} go round in a circle")
            chain.add(link)
            link = parents[link]
        done |= chain


def _numbers(path: Path, element: ET.Element, name: str) -> list[float]:
    text = element.get(name, "")
    try:
        values = [float(word) for word in text.split()]
    except ValueError as error:
        raise RobotError(f"{path}: <{element.tag} {name}={text!r}> is not a number") from error
    if not all(map(math.isfinite, values)):
        raise RobotError(f"{path}: <{element.tag} {name}={text!r}> is not finite")
    return values


def _mimic(path: Path, joint: ET.Element) -> list[tuple[str, Mimic]]:
    mimic = joint.find("mimic")
    if mimic is None:
        return []
    multiplier = _numbers(path, mimic, "multiplier") or [1.0]
    offset = _numbers(path, mimic, "offset") or [0.0]
    return [(joint.get("name", ""), Mimic(mimic.get("joint", ""), multiplier[0], offset[0]))]
