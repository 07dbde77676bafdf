from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from inspector.errors import InspectorError
from inspector.recording.robot import FACET, drawable
from noisemodel import meshes

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
    tree = ET.fromstring(drawable(path, (tmp_path,), tmp_path))
    assert tree.find(".//mesh").get("filename") == f"file://{tmp_path}/pkg/part.stl"
    assert tree.find(".//collision") is None
    assert tree.find(".//texture") is None


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
    with pytest.raises(InspectorError, match=f"mesh package://{name}: .*{problem}.*--robot none"):
        drawable(robot(tmp_path, f"package://{name}"), (tmp_path,), tmp_path)


@pytest.mark.parametrize("address", ["package://../../secret.stl", "file:///{outside}/secret.stl"])
def test_no_mesh_is_read_outside_of_the_robots_folders(tmp_path, address):
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    (tmp_path / "secret.stl").write_bytes(TRIANGLE)
    path = robot(inner, address.format(outside=tmp_path))
    with pytest.raises(InspectorError, match="lies outside of"):
        drawable(path, (inner,), tmp_path)


COLLADA = """<COLLADA version="{version}"><asset><up_axis>{up}</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="12">0 0 0 1 0 0 1 1 0 0 1 0</float_array>
<technique_common><accessor source="#a" count="4" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
{faces}</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
TRIANGLES = """<triangles count="2"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 1 2 0 2 3</p></triangles>"""
POLYGON = """<polylist count="1"><input semantic="VERTEX" source="#v" offset="0"/>
<vcount>4</vcount><p>0 1 2 3</p></polylist>"""


@pytest.mark.parametrize(
    ("version", "up", "faces", "kept"),
    [
        ("1.4.1", "Z_UP", TRIANGLES, True),
        ("1.4.1", "Z_UP", POLYGON, False),
        ("1.4.1", "Y_UP", TRIANGLES, False),
        ("1.4.0", "Z_UP", TRIANGLES, False),
    ],
)
def test_collada_that_rerun_cannot_draw_is_drawn_by_our_own_triangles(
    tmp_path, version, up, faces, kept
):
    part = tmp_path / "part.dae"
    part.write_text(COLLADA.format(version=version, up=up, faces=faces))
    written = tmp_path / "written"
    written.mkdir()
    tree = ET.fromstring(drawable(robot(tmp_path, "package://part.dae"), (tmp_path,), written))
    drawn = Path(tree.find(".//mesh").get("filename").removeprefix("file://"))
    assert (drawn == part) is kept
    np.testing.assert_allclose(meshes.read(drawn), meshes.read(part))
    if not kept:
        facets = np.frombuffer(drawn.read_bytes()[84:], FACET)
        np.testing.assert_allclose(facets["normal"], [[0, 0, 1], [0, 0, 1]])
