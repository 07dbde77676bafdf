"""A robot's URDF made safe to draw: visuals only, every mesh found inside the robot's folders."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from inspector.errors import InspectorError

DRAWN = {".stl", ".dae", ".obj", ".glb", ".gltf"}


class MeshError(InspectorError):
    """A mesh that is missing, lies outside of the robot's folders, or cannot be read."""

    def __init__(self, mesh: str, problem: str) -> None:
        self.mesh, self.problem = mesh, problem
        super().__init__(f"mesh {mesh}: {problem}; `--no-robot` shows the run without the robot")


def drawable(urdf: Path, roots: Sequence[Path]) -> str:
    """Rewrite a URDF for drawing.

    Collision shapes, textures and simulator extensions are left out, addresses of meshes become
    absolute: rerun refuses empty textures and needs an environment variable for ``package://``.

    Args:
        urdf: A URDF that has been checked.
        roots: Folders in which ``package://`` addresses are looked up and meshes may lie.

    Returns:
        The rewritten URDF.

    Raises:
        MeshError: If a mesh is missing, lies elsewhere, or is empty or cut off.
    """
    tree = ET.parse(urdf).getroot()  # noqa: S314
    for parent in list(tree.iter()):
        for child in list(parent):
            bare = child.tag == "texture" and not child.get("filename")
            if bare or child.tag in ("collision", "gazebo", "transmission", "sensor"):
                parent.remove(child)
    for mesh in tree.iter("mesh"):
        mesh.set("filename", f"file://{_checked(mesh.get('filename', ''), urdf, roots)}")
    return ET.tostring(tree, encoding="unicode")


def _checked(address: str, urdf: Path, roots: Sequence[Path]) -> Path:
    if not address:
        raise MeshError("''", f"{urdf.name} names a mesh without a file")
    allowed = [root.resolve() for root in (*roots, urdf.parent)]
    found = [path.resolve() for path in _candidates(address, urdf, roots) if path.is_file()]
    if not found:
        raise MeshError(address, f"not found in {', '.join(map(str, roots))}")
    path = found[0]
    if not any(path.is_relative_to(root) for root in allowed):
        raise MeshError(address, f"lies outside of {', '.join(map(str, roots))}")
    if path.suffix.lower() not in DRAWN:
        raise MeshError(address, f"of kind {path.suffix!r}, expected {', '.join(sorted(DRAWN))}")
    _check_whole(address, path)
    return path


def _candidates(address: str, urdf: Path, roots: Sequence[Path]) -> Iterator[Path]:
    scheme, _, rest = address.rpartition("://")
    if scheme == "package":
        yield from (root / rest.lstrip("/") for root in roots)
    elif scheme in ("", "file"):
        yield urdf.parent / rest


def _check_whole(address: str, path: Path) -> None:
    """See whether a file ends where it should; the viewer would draw nothing, and say nothing."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(84)
        stream.seek(max(0, size - 64))
        tail = stream.read()
    if not head.strip():
        raise MeshError(address, "is empty")
    kind = path.suffix.lower()
    if kind == ".obj" and b"\0" in head:
        raise MeshError(address, "is not text, as an OBJ is")
    if kind == ".dae" and b"</COLLADA>" not in tail:
        raise MeshError(address, "is cut off, </COLLADA> is missing")
    if kind == ".stl" and not (head.startswith(b"solid") and b"endsolid" in tail):
        triangles = int.from_bytes(head[80:84], "little")
        if size < 84 + 50 * triangles or len(head) < 84:
            raise MeshError(address, f"is cut off, {triangles} triangles do not fit {size} bytes")
