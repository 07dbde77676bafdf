import json
from pathlib import Path

import numpy as np
import pinocchio
import pytest
import trimesh

from noisemodel import ROBOTS, GeometryError, MeshError, MissingMeshError, Robot, shapes
from noisemodel.geometry import pieces, triangles

GOLDEN = Path(__file__).parents[2] / "shared" / "golden" / "surface"
BOX = '<geometry><box size="1 2 3"/></geometry>'
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
MESH = '<geometry><mesh filename="package://{}" {}/></geometry>'

ROBOT = """<robot name="r">
  <link name="world">{fixed}</link><link name="arm">{arm}</link>
  <link name="tool">{tool}</link><link name="slide">{slide}</link>
  <joint name="shoulder" type="revolute"><parent link="world"/><child link="arm"/>
    <origin xyz="1 0 0" rpy="0.3 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="weld" type="fixed"><parent link="arm"/><child link="tool"/>
    <origin xyz="0 0 5" rpy="0 0 1.5707963267948966"/></joint>
  <joint name="rail" type="prismatic"><parent link="tool"/><child link="slide"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"""


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def robot(folder, **links):
    path = folder / "robot.urdf"
    pieces = dict.fromkeys(("fixed", "arm", "tool", "slide"), "") | links
    path.write_text(ROBOT.format(**pieces))
    return Robot.load(path)


def visual(geometry, origin=""):
    return f"<visual>{origin}{geometry}</visual>"


def collision(geometry):
    return f"<collision>{geometry}</collision>"


def mesh_of(surface, folder, name="part.obj"):
    points = "".join("v {} {} {}\n".format(*point) for point in surface.reshape(-1, 3))
    faces = "".join(f"f {3 * i + 1} {3 * i + 2} {3 * i + 3}\n" for i in range(len(surface)))
    (folder / name).write_text(points + faces)
    return name


def area(surface):
    a, b, c = np.moveaxis(surface, 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def areas(links):
    return [area(surface) for surface in links.triangles]


def corners(surface):
    return {tuple(point) for point in np.round(surface.reshape(-1, 3), 9) + 0.0}


def test_a_box_has_the_area_of_its_sides_and_sits_where_it_is_put(tmp_path):
    links = triangles(robot(tmp_path, arm=visual(BOX, '<origin xyz="10 0 0"/>')))
    assert np.isclose(area(links.triangles[0]), 22.0, rtol=1e-15)
    expected = {(10 + x, y, z) for x in (-0.5, 0.5) for y in (-1, 1) for z in (-1.5, 1.5)}
    assert corners(links.triangles[0]) == expected


def test_the_angles_of_an_origin_turn_about_x_then_y_then_z_of_the_link(tmp_path):
    quarter = np.pi / 2
    point = mesh_of(np.array([[[1, 0, 0], [0, 2, 0], [0, 0, 3]]]), tmp_path)
    origin = f'<origin rpy="{quarter} {quarter} 0"/>'
    links = triangles(robot(tmp_path, arm=visual(MESH.format(point, ""), origin)))
    # About x: y to z, z to -y. Then about y: z to x, x to -z.
    assert corners(links.triangles[0]) == {(0, 0, -1), (2, 0, 0), (0, -3, 0)}


def test_what_is_fixed_to_a_link_belongs_to_it(tmp_path):
    piece = visual(BOX, '<origin xyz="0 0.5 0"/>')
    links = triangles(robot(tmp_path, arm=visual(BOX), tool=piece))
    assert links.names == ("arm", "slide")
    assert np.array_equal(links.joint, [1, 2])
    assert np.allclose(areas(links), [44.0, 0.0], rtol=1e-15)
    # The tool's axes are turned about z by a quarter and lie at z = 5.
    tool = {(-0.5 + y, x, 5 + z) for x in (-0.5, 0.5) for y in (-1, 1) for z in (-1.5, 1.5)}
    assert corners(links.triangles[0]) == tool | corners(shapes.box(1, 2, 3))


def test_what_is_fixed_to_the_world_is_left_out_unless_the_base_floats(tmp_path):
    built = robot(tmp_path, fixed=visual(BOX), arm=visual(BOX))
    assert triangles(built).names == ("arm", "slide")
    floating = triangles(Robot.load(built.path, floating_base=True))
    assert floating.names == ("world", "arm", "slide")
    assert np.allclose(areas(floating), [22.0, 22.0, 0.0], rtol=1e-15)


def test_a_link_without_geometry_is_listed_and_has_no_triangles(tmp_path):
    links = triangles(robot(tmp_path, arm=visual(BOX)))
    assert links.without_geometry == ("slide",)
    assert links.kind == ("visual", "none")
    assert links.triangles[1].shape == (0, 3, 3)
    assert str(links) == "12 triangles on 2 links\nwithout geometry: slide"
    both = robot(tmp_path, arm=visual(BOX) + collision(BOX))
    assert triangles(both, "collision").without_geometry == ("slide",)
    assert triangles(both, "hull").without_geometry == ("slide",)


def test_a_mesh_is_drawn_as_it_is_and_not_as_its_hull(tmp_path):
    outer = np.array([[[0, 0, 0], [9, 0, 0], [0, 9, 0]], [[0, 0, 0], [9, 0, 0], [0, 0, 9]]])
    inner = np.array([[[1, 1, 1], [2, 1, 1], [1, 2, 1]]])
    mesh = mesh_of(np.concatenate((outer, inner)), tmp_path)
    built = robot(tmp_path, arm=visual(MESH.format(mesh, "")))
    ((_, _, drawn),) = pieces(built)
    assert {(1.0, 1.0, 1.0), (2.0, 1.0, 1.0), (1.0, 2.0, 1.0)} <= corners(drawn)
    hull = triangles(built, "hull").triangles[0]
    assert corners(hull) == corners(outer)


@pytest.mark.parametrize(
    ("scale", "expected"),
    [
        ("1 1 1", 22.0),
        ("-1 1 1", 22.0),
        ("1 -1 -1", 22.0),
        ("2 2 2", 88.0),
        ("0.001 -0.001 0.001", 22e-6),
        ("2 1 1", 2 * (2 * 2 + 2 * 3 + 2 * 3)),
        ("1 1 -3", 2 * (1 * 2 + 1 * 9 + 2 * 9)),
    ],
)
def test_scales_stretch_and_mirror_a_mesh(tmp_path, scale, expected):
    name = mesh_of(shapes.box(1, 2, 3), tmp_path)
    links = triangles(robot(tmp_path, arm=visual(MESH.format(name, f'scale="{scale}"'))))
    assert np.isclose(area(links.triangles[0]), expected, rtol=1e-14)


def test_a_scale_is_along_the_meshs_axes_not_the_links(tmp_path):
    name = mesh_of(np.array([[[1, 0, 0], [0, 1, 0], [0, 0, 1]]]), tmp_path)
    origin = '<origin rpy="0 0 1.5707963267948966" xyz="0 0 7"/>'
    links = triangles(
        robot(tmp_path, arm=visual(MESH.format(name, 'scale="5 1 1"'), origin)),
    )
    assert corners(links.triangles[0]) == {(0, 5, 7), (-1, 0, 7), (0, 0, 8)}


def test_a_mesh_in_parts_has_the_area_of_the_whole(tmp_path):
    ball = shapes.sphere(0.3)
    names = [mesh_of(part, tmp_path, f"{i}.obj") for i, part in enumerate(np.split(ball, 4))]
    pieces = "".join(visual(MESH.format(name, "")) for name in names)
    whole = visual(MESH.format(mesh_of(ball, tmp_path), ""))
    first, second = (triangles(robot(tmp_path, arm=arm)) for arm in (pieces, whole))
    assert np.isclose(areas(first)[0], areas(second)[0], rtol=1e-14)
    assert len(first.triangles[0]) == len(second.triangles[0]) == 5120


def test_visual_collision_hull_and_auto_take_their_own_geometry(tmp_path):
    open_box = mesh_of(shapes.box(1, 2, 3)[:10], tmp_path)  # without its upper side
    built = robot(
        tmp_path,
        arm=visual(MESH.format(open_box, "")) + collision(BOX.replace("1 2 3", "1 1 1")),
        slide=collision('<geometry><sphere radius="1"/></geometry>'),
    )
    ball = area(shapes.sphere(1))
    for geometry, expected, kind in (
        ("visual", [20.0, 0.0], ("visual", "none")),
        ("collision", [6.0, ball], ("collision", "collision")),
        ("hull", [22.0, 0.0], ("hull", "none")),
        ("auto", [20.0, ball], ("visual", "collision")),
    ):
        links = triangles(built, geometry)
        assert np.allclose(areas(links), expected, rtol=1e-12), geometry
        assert links.kind == kind


def test_every_simple_shape_can_be_drawn(tmp_path):
    pieces = "".join(
        visual(f"<geometry><{word}/></geometry>")
        for word in ('cylinder radius="1" length="2"', 'sphere radius="1"', 'box size="1 1 1"')
    )
    links = triangles(robot(tmp_path, arm=pieces))
    assert np.isclose(areas(links)[0], 6 * np.pi + 4 * np.pi + 6, rtol=1e-3)


def test_shapes_are_those_of_trimesh():
    for ours, theirs in (
        (shapes.box(1, 2, 3), trimesh.creation.box((1, 2, 3))),
        (shapes.cylinder(0.3, 0.7), trimesh.creation.cylinder(0.3, 0.7, sections=64)),
        (shapes.sphere(0.5), trimesh.creation.icosphere(subdivisions=4, radius=0.5)),
    ):
        assert np.isclose(area(ours), theirs.area, rtol=1e-12)
        assert np.allclose(ours.min(axis=(0, 1)), theirs.bounds[0], rtol=0, atol=1e-12)
        assert np.allclose(ours.max(axis=(0, 1)), theirs.bounds[1], rtol=0, atol=1e-12)


def test_shapes_lie_around_the_origin_with_the_documented_number_of_triangles():
    for drawn, half, count in (
        (shapes.box(1, 2, 3), (0.5, 1, 1.5), 12),
        (shapes.cylinder(0.3, 0.7), (0.3, 0.3, 0.35), 4 * 64),
        (shapes.capsule(0.3, 0.7), (0.3, 0.3, 0.65), 64 * 64),
        (shapes.sphere(0.3), (0.3, 0.3, 0.3), 5120),
    ):
        assert drawn.shape == (count, 3, 3)
        np.testing.assert_allclose(drawn.max(axis=(0, 1)), half, rtol=1e-12)
        np.testing.assert_allclose(drawn.min(axis=(0, 1)), np.negative(half), rtol=1e-12)
        assert (np.linalg.norm(np.cross(*np.diff(drawn, axis=1).swapaxes(0, 1)), axis=1) > 0).all()


def test_a_capsule_of_a_urdf_is_drawn(tmp_path):
    capsule = visual('<geometry><capsule radius="0.3" length="0.7"/></geometry>')
    drawn = triangles(robot(tmp_path, arm=capsule)).triangles[0]
    np.testing.assert_array_equal(drawn, shapes.capsule(0.3, 0.7))


@pytest.mark.parametrize(
    ("geometry", "message"),
    [
        ('<sphere radius="1 2"/>', "radius of <sphere> is '1 2', expected 1 finite number$"),
        ("<sphere/>", "radius of <sphere> is '', expected 1 finite number$"),
        ('<capsule radius="1"/>', "and length of <capsule> is '1 ', expected 2 finite numbers$"),
        ('<box size="a b c"/>', "size of <box> is 'a b c', expected 3 finite numbers$"),
        ('<mesh scale="1 1"/>', "scale of <mesh> is '1 1', expected 3 finite numbers$"),
        (
            "<cone/>",
            "<cone> is not known, expected one of box, capsule, cylinder, sphere, mesh$",
        ),
        ("", "has no geometry, expected one of box, capsule, cylinder, sphere, mesh$"),
    ],
)
def test_a_shape_that_is_not_one_says_what_was_expected(tmp_path, geometry, message):
    with pytest.raises(GeometryError, match=message):
        triangles(robot(tmp_path, arm=visual(f"<geometry>{geometry}</geometry>")))


def test_collision_geometry_is_not_read_if_every_link_has_a_visual(tmp_path):
    broken = collision("<geometry><cone/></geometry>")
    built = robot(tmp_path, arm=visual(BOX) + broken, slide=visual(BOX))
    assert triangles(built, "auto").kind == ("visual", "visual")
    with pytest.raises(GeometryError, match="collision of link 'arm': <cone> is not known"):
        triangles(built, "collision")
    with pytest.raises(GeometryError, match="<cone> is not known"):
        triangles(robot(tmp_path, arm=visual(BOX) + broken), "auto")


def test_angles_of_all_three_axes_turn_as_pinocchio_turns_them(tmp_path):
    point = mesh_of(np.array([[[1, 0, 0], [0, 2, 0], [0, 0, 3]]]), tmp_path)
    origin = '<origin rpy="0.4 -0.7 1.1" xyz="1 2 3"/>'
    links = triangles(robot(tmp_path, arm=visual(MESH.format(point, 'scale="2 3 -4"'), origin)))
    turn = pinocchio.rpy.rpyToMatrix(0.4, -0.7, 1.1)
    expected = np.diag([2.0, 6.0, -12.0]) @ turn.T + [1, 2, 3]
    np.testing.assert_allclose(links.triangles[0][0], expected, rtol=1e-12)


def test_what_is_fixed_to_the_world_is_a_piece_and_collision_fills_in(tmp_path):
    small = BOX.replace("1 2 3", "1 1 1")
    built = robot(
        tmp_path, fixed=visual(small), arm=visual(BOX) + collision(small), slide=collision(small)
    )
    assert [(joint, shape.link, area(drawn)) for joint, shape, drawn in pieces(built)] == [
        (0, "world", pytest.approx(6.0)),
        (1, "arm", pytest.approx(22.0)),
        (2, "slide", pytest.approx(6.0)),
    ]


def test_round_shapes_are_too_small_by_the_documented_error():
    side = area(shapes.cylinder(1, 2)) - area(shapes.cylinder(1, 1))
    ends = area(shapes.cylinder(1, 1)) - side
    ball = area(shapes.capsule(1, 1)) - side
    found = [side / (2 * np.pi), ends / (2 * np.pi), ball / (4 * np.pi)]
    found.append(area(shapes.sphere(1)) / (4 * np.pi))
    assert np.allclose(found, [0.9996, 0.9984, 0.9980, 0.9988], rtol=0, atol=5e-5)


@pytest.mark.parametrize("name", ["box", "cylinder", "capsule", "sphere"])
def test_shapes_are_closed(name):
    sizes = {"box": (1, 2, 3), "sphere": (1,)}.get(name, (1, 2))
    drawn = np.round(getattr(shapes, name)(*sizes), 9) + 0.0
    edges = [
        frozenset((tuple(triangle[i]), tuple(triangle[i - 1])))
        for triangle in drawn
        for i in range(3)
    ]
    assert all(len(edge) == 2 for edge in edges)
    counts = np.unique([hash(edge) for edge in edges], return_counts=True)[1]
    assert (counts == 2).all()  # every edge belongs to two triangles


@pytest.mark.parametrize(
    "case",
    ["panda_visual", "solo12_visual", "double_pendulum_simple_visual", "panda_collision_mimic"],
)
def test_areas_and_centroids_are_those_of_the_reference(case):
    if not GOLDEN.exists():
        pytest.skip("needs shared/golden/surface, an independent reference")
    facts = json.loads((GOLDEN / "index.json").read_text())[case]
    with np.load(GOLDEN / f"{case}.npz", allow_pickle=False) as golden:
        joints, reference, centroid = golden["body_joint"], golden["S"], golden["rbar"]
    name = next(name for name, listed in ROBOTS.items() if listed.urdf == facts["urdf"])
    built = Robot.load(name, mimic=facts["mimic"], floating_base=facts["free_flyer"])
    links = triangles(built, facts["geometry"])
    assert links.joint.tolist() == joints.tolist()
    assert np.allclose(areas(links), reference, rtol=1e-10, atol=0)
    for surface, expected in zip(links.triangles, centroid, strict=True):
        a, b, c = np.moveaxis(surface, 1, 0)
        weight = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        assert np.allclose(weight @ (a + b + c) / 3 / weight.sum(), expected, rtol=0, atol=1e-12)


def test_links_are_named_after_the_child_of_their_joint():
    import xml.etree.ElementTree as ET

    for name in ("talos", "tiago_pro", "iris_rotors", "icub"):
        built = Robot.load(name)
        root = ET.parse(built.path).getroot()
        child = {j.get("name"): j.find("child").get("link") for j in root.findall("joint")}
        links = triangles(built, missing="skip")
        for joint, link in zip(links.joint, links.names, strict=True):
            joint_name = built.model.names[int(joint)]
            assert child.get(joint_name, "root") == link or joint_name == "root_joint"


AREAS = {
    "talos": (8.115, 4.594, 4.620),
    "anymal": (4.571, 2.115, 2.733),
    "anymal_c": (3.746, 4.487, 3.235),
    "go2": (1.346, 0.869, 0.766),
    "icub": (2.119, 1.146, 1.223),
    "baxter": (8.765, 7.139, 7.211),
    "laikago": (1.210, 1.207, 0.997),
    "hextilt": (0.735, 1.374, 0.735),
    "hyq": (3.036, 3.580, 2.968),
    "kinova": (0.438, 0.472, 0.372),
    "romeo": (2.704, 1.979, 2.646),
    "iris": (0.955, 0.419, 1.076),
    "panda": (0.922, 0.847, 0.847),
    "ur5": (0.735, 0.648, 0.733),
    "ur10": (1.251, 1.064, 1.131),
    "pr2": (8.519, 7.814, 6.658),
    "simple_humanoid": (0.0, 0.0, 18.554),
    "human": (2.299, 2.238, 0.0),
}
"""Area of the visuals, their hulls and the collision shapes, base included, by another reader."""


@pytest.mark.slow
@pytest.mark.parametrize("name", AREAS)
def test_areas_of_known_robots(name):
    built = Robot.load(name, floating_base=True)
    found = [sum(areas(triangles(built, kind))) for kind in ("visual", "hull", "collision")]
    assert np.allclose(found, AREAS[name], rtol=0, atol=5.1e-4)


@pytest.mark.slow
def test_every_listed_robot_can_be_drawn_but_one_without_published_meshes():
    bare, refused = [], []
    for name in ROBOTS:
        if name == "ur3_empty":
            continue
        try:
            links = triangles(Robot.load(name))
        except MissingMeshError:
            refused.append(name)
            continue
        if len(links.without_geometry) == len(links.names):
            bare.append(name)
    assert refused == ["romeo_laas_small"]
    assert bare == ["simple_humanoid", "simple_humanoid_classical"]


def test_meshes_that_are_missing_can_be_skipped_and_are_named():
    built = Robot.load("romeo_laas_small")
    with pytest.raises(
        MissingMeshError, match=r"file:///usr/Romeo.*\.mesh: not found in"
    ) as caught:
        triangles(built)
    assert "\n" not in str(caught.value)
    links = triangles(built, missing="skip")
    assert links.without_geometry == links.names
    assert "file:///usr/Romeo" in links.missing[0]
    assert "not found: file:///usr/Romeo" in str(links)
    assert "collision" in triangles(built, "auto", missing="skip").kind


@pytest.mark.parametrize(
    ("geometry", "options", "message"),
    [
        ("visuals", {}, "geometry 'visuals' is not known, expected one of visual, collision, hull"),
        ("visual", {"missing": "ignore"}, "missing 'ignore' is not known, expected .* error, skip"),
    ],
)
def test_unknown_settings_are_named(tmp_path, geometry, options, message):
    with pytest.raises(GeometryError, match=message):
        triangles(robot(tmp_path), geometry, **options)


@pytest.mark.parametrize(
    ("geometry", "message"),
    [
        ('<sphere radius="0"/>', r"visual of link 'arm': <sphere> of size \[0.0\] m, expected"),
        ('<box size="1 1 -1"/>', r"<box> of size \[1.0, 1.0, -1.0\] m, expected more than 0"),
        ('<cylinder radius="inf" length="1"/>', "radius and length of <cylinder> is 'inf 1'"),
        ('<mesh filename="package://a.stl" scale="1 0 1"/>', "scale '1 0 1' flattens the mesh"),
        ('<mesh filename="package://a.stl" scale="nan 1 1"/>', "scale of <mesh> is 'nan 1 1'"),
    ],
)
def test_a_shape_of_impossible_size_is_named_with_its_link(tmp_path, geometry, message):
    with pytest.raises(GeometryError, match=message) as caught:
        triangles(robot(tmp_path, arm=visual(f"<geometry>{geometry}</geometry>")))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "scale", "message"),
    [
        (None, "1 1 1", r"mesh package://a.obj: not found in .*`missing='skip'` leaves it out"),
        ("", "1 1 1", r"mesh .*/a.obj: is empty"),
        ("v 0 0 0\n", "1 1 1", r"mesh .*/a.obj: has no triangles"),
        (TRIANGLE.replace("0 1 0", "0 1 nan"), "1 1 1", "a.obj: has corners that are not finite"),
        (TRIANGLE.replace("0 1 0", "2 0 0"), "1 1 1", "a.obj: has an area of 0 m² with its scale"),
        (TRIANGLE, "1e-170 1e-170 1", "a.obj: has an area of 0 m²"),
        (TRIANGLE, "1e200 1e200 1", "a.obj: has an area of inf m²"),
    ],
)
def test_a_mesh_without_a_surface_is_named(tmp_path, content, scale, message):
    if content is not None:
        (tmp_path / "a.obj").write_text(content)
    built = robot(tmp_path, arm=visual(MESH.format("a.obj", f'scale="{scale}"')))
    with pytest.raises(MeshError, match=message):
        triangles(built)


def test_no_mesh_is_read_outside_of_the_robots_folders(tmp_path):
    inner = tmp_path / "a" / "b" / "c"
    inner.mkdir(parents=True)
    mesh_of(shapes.box(1, 2, 3), tmp_path)
    for address in ("../../../part.obj", "part.obj/../../../../../part.obj"):
        built = robot(inner, arm=visual(MESH.format(address, "")))
        with pytest.raises(MeshError, match=r"(lies outside of|not found in)"):
            triangles(built)
    (inner / "link.obj").symlink_to(tmp_path / "part.obj")
    with pytest.raises(MeshError, match="link.obj: lies outside of"):
        triangles(robot(inner, arm=visual(MESH.format("link.obj", ""))))


def test_a_mesh_may_be_addressed_in_every_way_that_urdfs_do(tmp_path):
    name = mesh_of(shapes.box(1, 2, 3), tmp_path)
    for address in (f"package:///{name}", f"package://{name}", name, f"file://{tmp_path}/{name}"):
        geometry = f'<geometry><mesh filename="{address}"/></geometry>'
        links = triangles(robot(tmp_path, arm=visual(geometry)))
        assert np.isclose(areas(links)[0], 22.0, rtol=1e-15)
