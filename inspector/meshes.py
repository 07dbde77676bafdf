"""A robot's URDF made safe to draw: visuals only, every mesh found and of a kind that is drawn."""

import hashlib
import re
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

import noisemodel
from inspector.errors import InspectorError
from noisemodel import meshfile, meshpath

DRAWN = {".stl", ".dae", ".obj", ".glb", ".gltf"}
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


class MeshError(InspectorError):
    """A mesh that is missing, lies outside of the robot's folders, or cannot be read."""

    def __init__(self, mesh: str, problem: str) -> None:
        self.mesh, self.problem = mesh, problem
        super().__init__(f"mesh {mesh}: {problem}; `--no-robot` shows the run without the robot")


def drawable(urdf: Path, roots: Sequence[Path], folder: Path) -> str:
    """Rewrite a URDF for drawing.

    Collision shapes, textures and simulator extensions are left out, addresses of meshes become
    absolute: rerun refuses empty textures and needs an environment variable for ``package://``.

    Args:
        urdf: A URDF that has been checked.
        roots: Folders in which ``package://`` addresses are looked up and meshes may lie.
        folder: Takes the meshes that rerun cannot read, written anew as STL.

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
        mesh.set("filename", f"file://{_checked(mesh.get('filename', ''), urdf, roots, folder)}")
    return ET.tostring(tree, encoding="unicode")


def _checked(address: str, urdf: Path, roots: Sequence[Path], folder: Path) -> Path:
    try:
        path = meshpath.find(address, urdf, roots)
        if path.suffix.lower() not in DRAWN:
            known = ", ".join(sorted(DRAWN))
            raise MeshError(address, f"of kind {path.suffix!r}, expected {known}")
        meshfile.check_whole(path)  # the viewer would draw nothing, and say nothing
        if path.suffix.lower() == ".dae" and not _read_by_rerun(path):
            return _as_stl(path, folder)
    except noisemodel.MeshError as error:
        raise MeshError(address or "''", error.problem) from error
    return path


def _read_by_rerun(path: Path) -> bool:
    """Whether rerun's reader of COLLADA draws a file; of others it draws nothing, silently.

    Seen with 0.41 on the robots of example-robot-data: it takes triangles of version 1.4.1 only,
    and turns what is not Z_UP, which URDFs do not mean.
    """
    text = path.read_text(encoding="utf-8", errors="replace")
    others = re.search(r"<(polylist|polygons|tristrips|trifans)\b", text)
    return not others and 'version="1.4.1"' in text and "<up_axis>Z_UP<" in text


def _as_stl(path: Path, folder: Path) -> Path:
    """Write the triangles of a mesh, as the noise model reads them, as a binary STL file."""
    copy = folder / f"{hashlib.sha256(bytes(path)).hexdigest()[:16]}.stl"
    if not copy.exists():
        triangles = meshfile.read(path)
        facets = np.zeros(len(triangles), FACET)
        facets["corners"] = triangles
        edges = np.diff(triangles, axis=1)
        across = np.cross(edges[:, 0], edges[:, 1])
        length = np.linalg.norm(across, axis=1, keepdims=True)
        facets["normal"] = across / np.where(length > 0.0, length, 1.0)
        copy.write_bytes(bytes(80) + len(facets).to_bytes(4, "little") + facets.tobytes())
    return copy
