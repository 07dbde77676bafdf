"""A robot's URDF made safe to draw: visuals only, every mesh found inside the robot's folders."""

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

import noisemodel
from inspector.errors import InspectorError
from noisemodel import meshfile, meshpath

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
    try:
        path = meshpath.find(address, urdf, roots)
        if path.suffix.lower() not in DRAWN:
            known = ", ".join(sorted(DRAWN))
            raise MeshError(address, f"of kind {path.suffix!r}, expected {known}")
        meshfile.check_whole(path)  # the viewer would draw nothing, and say nothing
    except noisemodel.MeshError as error:
        raise MeshError(address or "''", error.problem) from error
    return path
