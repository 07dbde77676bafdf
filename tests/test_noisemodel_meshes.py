import struct

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from noisemodel import MeshError, meshes, urdf
from noisemodel.robot import listed_folders

TRIANGLE = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], dtype=float)
BRICK = urdf.box(1, 2, 3)
NIL, X, Y = np.zeros(3), np.eye(3)[0], np.eye(3)[1]


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "noise-inspector" / "geometry"


def area(triangles):
    a, b, c = np.moveaxis(triangles, 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def stl(triangles, header=b""):
    facets = b"".join(struct.pack("<12fH", 0, 0, 0, *triangle.ravel(), 0) for triangle in triangles)
    return header.ljust(80, b"\0") + struct.pack("<I", len(triangles)) + facets


def ascii_stl(triangles, name="part"):
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {:.9g} {:.9g} {:.9g}\n".format(*corner) for corner in triangle)
        + "endloop\nendfacet\n"
        for triangle in triangles
    )
    return f"solid {name}\n{facets}endsolid {name}\n".encode()


def obj(triangles):
    points = "".join("v {} {} {}\n".format(*point) for point in triangles.reshape(-1, 3))
    faces = "".join(f"f {3 * i + 1} {3 * i + 2} {3 * i + 3}\n" for i in range(len(triangles)))
    return (points + faces).encode()


def numbers(array):
    return " ".join(map(str, np.ravel(array)))


def geometry(triangles, name="g", part=None):
    part = part or (
        f'<triangles><input semantic="VERTEX" source="#{name}-v" offset="0"/>'
        f"<p>{numbers(range(3 * len(triangles)))}</p></triangles>"
    )
    return f"""<geometry id="{name}"><mesh>
      <source id="{name}-s"><float_array id="{name}-f">{numbers(triangles)}</float_array>
        <technique_common><accessor source="#{name}-f" count="{triangles.size // 3}" stride="3"/>
        </technique_common></source>
      <vertices id="{name}-v"><input semantic="POSITION" source="#{name}-s"/></vertices>
      {part}</mesh></geometry>"""


def dae(geometries, nodes, asset="", extra=""):
    return f"""<?xml version="1.0"?>
    <COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
    <asset>{asset}</asset><library_geometries>{geometries}</library_geometries>{extra}
    <library_visual_scenes><visual_scene id="scene">{nodes}</visual_scene></library_visual_scenes>
    <scene><instance_visual_scene url="#scene"/></scene></COLLADA>""".encode()


def read(folder, name, content):
    (folder / name).write_bytes(content)
    return meshes.read(folder / name)


NODE = '<node id="n"><instance_geometry url="#g"/></node>'
NODE_H = NODE.replace("#g", "#h")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("brick.stl", stl(BRICK)),
        ("brick.STL", stl(BRICK)),
        ("solid.stl", stl(BRICK, header=b"solid but binary")),
        ("more.stl", stl(BRICK) + b"trailing bytes"),
        ("ascii.stl", ascii_stl(BRICK)),
        ("brick.obj", obj(BRICK)),
        ("brick.dae", dae(geometry(BRICK), NODE)),
        (
            "mm.dae",
            dae(geometry(1e3 * BRICK), NODE, '<unit meter="0.001"/><up_axis>Y_UP</up_axis>'),
        ),
        ("latin.stl", ascii_stl(BRICK).replace(b"part", b"\xe4")),
        ("shouted.stl", b"\r\n " + ascii_stl(BRICK).upper()),
        ("two.stl", ascii_stl(BRICK[:5], "a") + ascii_stl(BRICK[5:], "b")),
        ("two.dae", dae(geometry(BRICK[:5]) + geometry(BRICK[5:], "h"), NODE + NODE_H)),
        ("two.obj", obj(BRICK).replace(b"f 7", b"o second\nusemtl paint\nf 7")),
    ],
)
def test_one_brick_is_the_same_in_every_kind_of_file(tmp_path, name, content):
    triangles = read(tmp_path, name, content)
    assert triangles.dtype == np.float64
    assert np.array_equal(triangles, BRICK)
    assert area(triangles) == 22.0
    assert np.array_equal(meshes.read(tmp_path / name), BRICK)  # now from the cache


def test_digits_beyond_single_precision_are_kept(tmp_path):
    fine = BRICK * 0.1234567890123
    for name, content in (("a.obj", obj(fine)), ("a.dae", dae(geometry(fine), NODE))):
        assert np.array_equal(read(tmp_path, name, content), fine)
        assert np.array_equal(meshes.read(tmp_path / name), fine)


def test_what_is_cached_belongs_to_the_content_not_to_the_name(tmp_path, cache):
    assert area(read(tmp_path, "a.obj", obj(BRICK))) == 22.0
    assert area(read(tmp_path, "b.obj", obj(BRICK))) == 22.0
    assert len(list(cache.iterdir())) == 1
    assert area(read(tmp_path, "a.obj", obj(2 * BRICK))) == 88.0


RIGHT = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"


@pytest.mark.parametrize(
    ("content", "corners"),
    [
        # faces before their points, broken into lines
        (b"f 1 2 \\\n 3 # a\nv 0 0 0 1 # weight\nv 1 0 0 .5 .5 .5\nv 0 1 0\n", [NIL, X, Y]),
        # counting backwards from their own line
        (RIGHT + b"f -3 -2 -1\nv 1 0 0\nv 0 1 0\nf -3/1 -2/1 -1//2\n", [NIL, X, Y, Y, X, Y]),
        (b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n", [NIL, X, X + Y, NIL, X + Y, Y]),
        # what names nothing is passed over, and no other file is read
        (b"f\n\nvn 1 0 0\n" + RIGHT + b"f 1 2 3\nf 1 2\nf 1\n#\n", [NIL, X, Y]),
        (b"# Gr\xf6\xdfe\nmtllib /etc/hostname\nusemtl x\n" + RIGHT + b"f 1 2 3\n", [NIL, X, Y]),
    ],
)
def test_faces_of_an_obj_name_points_in_many_ways(tmp_path, content, corners):
    assert np.array_equal(read(tmp_path, "a.obj", content), np.reshape(corners, (-1, 3, 3)))


def test_a_node_of_a_dae_may_stand_in_several_places(tmp_path):
    library = f"<library_nodes>{NODE}</library_nodes>"
    nodes = """<node><instance_node url="#n"/></node>
      <node><translate>0 0 9</translate><instance_node url="#n"/></node>"""
    triangles = read(tmp_path, "a.dae", dae(geometry(TRIANGLE), nodes, extra=library))
    assert np.array_equal(triangles, np.concatenate((TRIANGLE, TRIANGLE + np.array([0, 0, 9]))))


PENTAGON = np.array([[0, 0, 0], [2, 0, 0], [3, 1, 0], [2, 2, 0], [0, 2, 0]], dtype=float)
INPUTS = """<input semantic="NORMAL" source="#none" offset="0"/>
  <input semantic="VERTEX" source="#g-v" offset="1"/>"""


@pytest.mark.parametrize(
    "part",
    [
        f"<polylist>{INPUTS}<vcount>5</vcount><p>9 0 9 1 9 2 9 3 9 4</p></polylist>",
        f"<polylist>{INPUTS}<vcount>3 2 4</vcount>"
        "<p>9 0 9 1 9 2 9 0 9 1 9 0 9 2 9 3 9 4</p></polylist>",
        f"<polygons>{INPUTS}<p>9 0 9 1 9 2</p><p>9 0 9 2 9 3 9 4</p></polygons>",
        f"<trifans>{INPUTS}<p>9 0 9 1 9 2 9 3 9 4</p></trifans>",
        f"<tristrips>{INPUTS}<p>9 1 9 2 9 0 9 3 9 4</p></tristrips>",
        f"<tristrips>{INPUTS}<p>9 1 9 2 9 0 9 3</p><p>9 4 9 0 9 3</p></tristrips>",
        f"<lines>{INPUTS}<p>9 0 9 1</p></lines>"
        f"<triangles>{INPUTS}<p>9 0 9 1 9 2 9 0 9 2 9 3 9 0 9 3 9 4</p></triangles>",
    ],
)
def test_a_pentagon_has_the_same_area_however_it_is_cut(tmp_path, part):
    triangles = read(tmp_path, "a.dae", dae(geometry(PENTAGON, part=part), NODE))
    assert len(triangles) == 3
    assert area(triangles) == 5.0


ASCII, WHOLE = ascii_stl(BRICK), dae(geometry(BRICK), NODE)
FOUR = "<vcount>4</vcount>"
MINUS = "<vcount>4 -1</vcount><p>9 0 9 1 9 2</p>"
BAD_NODE = '<node id="n"><instance_node url="#n"/></node>'


def of(part):
    return dae(geometry(BRICK, part=part), NODE)


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("a.stl", b"", "is empty"),
        ("a.stl", stl(BRICK)[:-1], "is cut off, 12 triangles do not fit 683 bytes"),
        ("a.stl", ASCII[:-30], "is cut off"),
        ("a.stl", b"hello", "is cut off"),
        ("a.stl", stl(BRICK[:0]), "has no triangles"),
        ("a.stl", b"solid\nendsolid\n", "has no triangles"),
        ("a.stl", stl(BRICK * np.nan), r"has corners that are not finite \(NaN or infinity\)"),
        ("a.stl", ASCII.replace(b"vertex 0.5", b"vertex half", 1), "cannot be read"),
        ("a.stl", ASCII.replace(b"vertex 0.5 1 1.5\n", b"", 1), "cannot be read"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "has no triangles"),
        ("a.obj", b"\0\x01\xff" * 9, "is not text, as an OBJ is"),
        ("a.obj", obj(BRICK).replace(b"0.5", b"half"), "cannot be read"),
        ("a.obj", obj(TRIANGLE) + b"f 1 2 9\n", "a face names point 9 of 3"),
        ("a.obj", obj(TRIANGLE) + b"f -1 -2 -4\n", "'f -1 -2 -4' names a point"),
        ("a.dae", b"<COLLADA>", "is cut off, </COLLADA> is missing"),
        ("a.dae", b"<COLLADA><a></COLLADA>", "cannot be read .not XML .mismatched tag"),
        ("a.dae", b"<!DOCTYPE a><COLLADA></COLLADA>", "no document type or entities"),
        ("a.dae", b"<COLLADA></COLLADA>", "<COLLADA> has no <instance_visual_scene>"),
        ("a.dae", dae("", ""), "has no triangles"),
        ("a.dae", dae("", NODE), "<instance_geometry> refers to '#g', which is not there"),
        ("a.dae", dae("", BAD_NODE), "cannot be read .*recursion"),
        ("a.dae", dae(geometry(BRICK * np.nan), NODE), "not finite"),
        ("a.dae", WHOLE.replace(b"0.5", b"half"), "cannot be read"),
        ("a.dae", WHOLE.replace(b"34 35<", b"34 36<"), "names a point"),
        ("a.dae", WHOLE.replace(b"34 35<", b"34 -1<"), "names a point"),
        ("a.dae", WHOLE.replace(b" 35<", b"<"), "cannot be read"),
        ("a.dae", WHOLE.replace(b'"3"', b'"9' + b"0" * 30 + b'"'), "cannot be"),
        ("a.obj", obj(TRIANGLE) + b"f 1 2 9" + b"0" * 30, "a face names point 90"),
        ("a.dae", WHOLE.replace(b'"VERTEX"', b'"V"'), "no input VERTEX"),
        ("a.dae", WHOLE.replace(b'"POSITION"', b'"P"'), "no input POSITION"),
        ("a.dae", dae("", "<node><skew>0 0 0 0 0 0 0</skew></node>"), "it has a <skew>"),
        ("a.dae", dae("", "<node><instance_controller/></node>"), "it has a skin"),
        ("a.dae", of(f"<polygons>{INPUTS}<ph/></polygons>"), "holes"),
        ("a.dae", of(f"<patch>{INPUTS}</patch>"), "it has <patch>"),
        ("a.dae", of(f"<polylist>{INPUTS}{FOUR}</polylist>"), "a <polylist> of 4 corners has 0"),
        ("a.obj", b"v 1 " + b"0" * 80, f"'v 1 {'0' * 56}' is no point"),
        ("a.obj", b"f 0 " + b"1" * 80, f"'f 0 {'1' * 56}' names a point that is"),
        ("a.stl", ASCII.replace(b"endfacet", b"vertex 1 2 3\nendfacet", 1), "not three"),
        ("a.dae", dae("", "<node><lookat>1 2 3</lookat></node>"), "it has a <lookat>"),
        ("a.dae", of(f"<polylist>{INPUTS}{MINUS}</polylist>"), "a <polylist> of 3 corners has 3"),
        ("a.step", b"x", "of kind '.step', expected .dae, .obj, .stl"),
    ],
)
def test_a_file_that_is_no_mesh_is_named_in_one_line(tmp_path, cache, name, content, problem):
    with pytest.raises(MeshError, match=f"mesh {tmp_path}/{name}: .*{problem}") as caught:
        read(tmp_path, name, content)
    assert "\n" not in str(caught.value)
    assert not list(cache.glob("*"))


def test_a_file_that_cannot_be_opened_is_named(tmp_path):
    with pytest.raises(MeshError, match=r"gone.stl: cannot be read \(No such file or directory\)"):
        meshes.read(tmp_path / "gone.stl")


def test_a_dae_is_turned_as_scipy_turns_it(tmp_path):
    node = """<node><translate>1 2 3</translate><rotate>1 2 3 50</rotate><scale>2 3 -4</scale>
      <matrix>1 2 0 4  0 1 3 5  5 0 1 6  0 0 0 1</matrix><instance_geometry url="#g"/></node>"""
    turn = Rotation.from_rotvec(np.radians(50) * np.array([1, 2, 3]) / np.sqrt(14)).as_matrix()
    matrix = np.array([[1, 2, 0], [0, 1, 3], [5, 0, 1]])
    points = BRICK @ matrix.T + [4, 5, 6]
    expected = (points * [2, 3, -4]) @ turn.T + [1, 2, 3]
    found = read(tmp_path, "a.dae", dae(geometry(BRICK), node))
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_the_points_of_a_dae_may_stand_anywhere_in_its_numbers(tmp_path):
    rows = np.column_stack((TRIANGLE[0], [7, 8, 9]))
    plain = dae(geometry(TRIANGLE), NODE).decode()
    moved = plain.replace(f">{numbers(TRIANGLE)}<", f">5 6 {numbers(rows)} 1 2<")
    moved = moved.replace('count="3" stride="3"', 'offset="2" count="3" stride="4"')
    assert np.array_equal(read(tmp_path, "a.dae", moved.encode()), TRIANGLE)
    none = plain.replace(' count="3"', "")
    with pytest.raises(MeshError, match="a <triangles> names a point that is not there"):
        read(tmp_path, "b.dae", none.encode())


def test_an_input_of_a_dae_without_an_offset_is_the_first(tmp_path):
    part = (
        '<triangles><input semantic="VERTEX" source="#g-v"/>'
        '<input semantic="NORMAL" source="#n" offset="2"/><p>0 9 9 1 9 9 2 9 9</p></triangles>'
    )
    found = read(tmp_path, "a.dae", dae(geometry(TRIANGLE, part=part), NODE))
    assert np.array_equal(found, TRIANGLE)
    alone = '<triangles><input semantic="VERTEX" source="#g-v"/><p>0 2 1</p></triangles>'
    found = read(tmp_path, "b.dae", dae(geometry(TRIANGLE, part=alone), NODE))
    assert np.array_equal(found, TRIANGLE[:, [0, 2, 1]])


def test_parts_of_a_dae_without_polygons_add_nothing(tmp_path):
    parts = "".join(
        f"<{kind}>{INPUTS}{'<vcount/>' if kind == 'polylist' else ''}<p/></{kind}>"
        for kind in ("polylist", "triangles", "polygons")
    )
    parts += f"<polylist>{INPUTS}<vcount>0 3</vcount><p>9 0 9 1 9 2</p></polylist>"
    assert np.array_equal(
        read(tmp_path, "a.dae", dae(geometry(TRIANGLE, part=parts), NODE)), TRIANGLE
    )


def test_the_limit_of_a_scene_counts_its_nodes(tmp_path, monkeypatch):
    monkeypatch.setattr(meshes, "MAX_NODES", 5)
    assert len(read(tmp_path, "a.dae", dae(geometry(TRIANGLE), NODE + "<node/>" * 3))) == 1
    with pytest.raises(MeshError, match="more than 5 nodes with their instances"):
        read(tmp_path, "b.dae", dae(geometry(TRIANGLE), NODE + "<node/>" * 4))


def test_the_limit_of_triangles_counts_points_and_instances(monkeypatch):
    part = '<triangles><input semantic="VERTEX" source="#g-v"/><p>0 1 2 0 1 2 0 1 2 0 1 2</p>'
    few = dae(geometry(TRIANGLE), NODE * 2)  # 6 points and 2 triangles
    lots = dae(geometry(TRIANGLE, part=f"{part}</triangles>"), NODE * 2)  # 6 and 8
    for content, count, most in ((few, 2, 6), (lots, 8, 8)):
        monkeypatch.setenv("NOISE_LIMIT_TRIANGLES", str(most))
        assert len(meshes.READERS[".dae"](content)[1]) == count
        monkeypatch.setenv("NOISE_LIMIT_TRIANGLES", str(most - 1))
        with pytest.raises(ValueError, match=f"triangles or points, the limit is {most - 1}"):
            meshes.READERS[".dae"](content)


@pytest.mark.slow
def test_every_stl_and_obj_of_the_listed_robots_is_as_trimesh_reads_it():
    files = [*listed_folders()[-1].rglob("*.*")]
    count = 0
    for file in files:
        if file.suffix.lower() in (".stl", ".obj"):
            mesh = trimesh.load_mesh(file, process=False)
            ours = meshes.read(file)
            assert len(ours) == len(mesh.faces), file
            assert np.isclose(area(ours), mesh.area, rtol=1e-12), file
            bounds = (ours.min(axis=(0, 1)), ours.max(axis=(0, 1)))
            assert np.allclose(bounds, mesh.bounds, rtol=0, atol=1e-12), file
            count += 1
    assert count == 491


@pytest.mark.slow
def test_every_small_dae_of_the_listed_robots_fills_the_box_that_pinocchio_finds():
    import coal  # its boxes are right, its triangles are not

    files = [f for f in listed_folders()[-1].rglob("*.*") if f.suffix.lower() == ".dae"]
    files = [f for f in files if f.stat().st_size < 1e6]
    for file in files:
        mesh = coal.MeshLoader().load(str(file), np.ones(3))
        mesh.computeLocalAABB()
        low, high = np.ravel(mesh.aabb_local.min_), np.ravel(mesh.aabb_local.max_)
        points = meshes.read(file).reshape(-1, 3)
        size = np.abs(high - low).max()
        assert np.abs(points.min(axis=0) - low).max() < 1e-6 * size, file
        assert np.abs(points.max(axis=0) - high).max() < 1e-6 * size, file
    assert len(files) == 211
