from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from inspector.meshes import MeshError, drawable

TRIANGLE = b"\0" * 80 + (1).to_bytes(4, "little") + b"\0" * 50


def robot(folder: Path, mesh: str) -> Path:
    path = folder / "urdf" / "robot.urdf"
    path.parent.mkdir(exist_ok=True)
    path.write_text(
        f"""<robot name="r"><link name="base"><visual><geometry><mesh filename="{mesh}"/></geometry>
        <material name="m"><texture/></material></visual>
        <collision><geometry><box size="1 1 1"/></geometry></collision></link></robot>"""
    )
    return path


def test_meshes_get_absolute_addresses_and_what_is_not_drawn_goes(tmp_path):
    (tmp_path / "pkg").mkdir()
    (tmp_path / "pkg" / "part.stl").write_bytes(TRIANGLE)
    path = robot(tmp_path, "package://pkg/part.stl")
    tree = ET.fromstring(drawable(path, (tmp_path,)))
    assert tree.find(".//mesh").get("filename") == f"file://{tmp_path}/pkg/part.stl"
    assert tree.find(".//collision") is None
    assert tree.find(".//texture") is None


def test_three_slashes_after_package_are_taken_as_two(tmp_path):
    (tmp_path / "part.stl").write_bytes(TRIANGLE)
    assert "part.stl" in drawable(robot(tmp_path, "package:///part.stl"), (tmp_path,))


def test_a_path_is_relative_to_the_urdf(tmp_path):
    (tmp_path / "part.stl").write_bytes(TRIANGLE)
    assert "part.stl" in drawable(robot(tmp_path, "../part.stl"), (tmp_path,))


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("empty.stl", b"", "is empty"),
        ("cut.stl", TRIANGLE[:-1], "is cut off, 1 triangles do not fit 133 bytes"),
        ("cut.dae", b"<COLLADA><library>", "</COLLADA> is missing"),
        ("part.step", b"x", "of kind '.step'"),
        ("part.obj", b"\0\0v 1 2 3", "not text"),
    ],
)
def test_a_mesh_that_cannot_be_read_is_named(tmp_path, name, content, problem):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MeshError, match=f"mesh package://{name}: .*{problem}.*--no-robot"):
        drawable(robot(tmp_path, f"package://{name}"), (tmp_path,))


def test_a_missing_mesh_is_named_with_the_places_that_were_looked_at(tmp_path):
    with pytest.raises(MeshError, match=f"gone.stl: not found in {tmp_path}"):
        drawable(robot(tmp_path, "package://gone.stl"), (tmp_path,))


@pytest.mark.parametrize("address", ["package://../../secret.stl", "file:///{outside}/secret.stl"])
def test_no_mesh_is_read_outside_of_the_robots_folders(tmp_path, address):
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    (tmp_path / "secret.stl").write_bytes(TRIANGLE)
    path = robot(inner, address.format(outside=tmp_path))
    with pytest.raises(MeshError, match="lies outside of"):
        drawable(path, (inner,))
