"""Where the mesh is that a URDF names: inside of the robot's own folders, or nowhere."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from noisemodel.errors import MeshError, MissingMeshError

HINT = "--package-root (`package_root=`) names a folder of meshes elsewhere"


def find(address: str, urdf: Path, roots: Sequence[Path]) -> Path:
    """Find the file of a mesh.

    Args:
        address: As the URDF has it: ``package://`` (two slashes or three), ``file://``, or a path
            relative to the URDF.
        urdf: The URDF.
        roots: Folders that ``package://`` addresses are searched in: packages, or folders of
            packages. Meshes lie in one of these.

    Returns:
        The file, with links resolved.

    Raises:
        MissingMeshError: If there is no such file.
        MeshError: If there is no address, or the file lies outside of the robot's folders or
            cannot be reached.
    """
    if not address:
        raise MeshError("''", f"{urdf.name} names a mesh without a file")
    try:
        found = [path.resolve() for path in _candidates(address, urdf, roots) if path.is_file()]
    except OSError as error:  # no permission, or a name too long for a file
        raise MeshError(address, f"cannot be looked up ({error.strerror})") from error
    if not found:
        raise MissingMeshError(address, f"not found in {_listed(roots)}; {HINT}")
    # Resolving takes longer than all else here, and most folders are no links.
    for path in found:
        if any(path.is_relative_to(root) for root in roots) or any(
            path.is_relative_to(root.resolve()) for root in roots
        ):
            return path
    raise MeshError(address, f"lies outside of {_listed(roots)}; {HINT}")


def _candidates(address: str, urdf: Path, roots: Sequence[Path]) -> Iterator[Path]:
    scheme, _, rest = address.rpartition("://")
    if scheme == "package":
        package, _, below = rest.lstrip("/").partition("/")
        for root in roots:
            yield root / rest.lstrip("/")
            if root.name == package or (root / "package.xml").is_file():
                yield root / below
    elif scheme in ("", "file"):
        yield urdf.parent / rest


def _listed(roots: Sequence[Path]) -> str:
    return ", ".join(map(str, roots)) or "any folder: a home has no meshes"
