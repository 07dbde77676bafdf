import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from chains import chain, surface_speed
from test_noisemodel_meshes import area, obj

from noisemodel import ROBOTS, GeometryError, MeshError, Robot, Surface, urdf
from noisemodel.surface import (
    fine,
    link_names,
    moments,
    point_speeds,
    reduced,
    rounding,
    tabulate,
    triangles,
    turning_speed,
)

GOLDEN = Path(__file__).parents[2] / "shared" / "golden" / "surface"
BOX = '<geometry><box size="1 2 3"/></geometry>'
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
EXPECTED = "expected one of box, capsule, cylinder, sphere, mesh$"
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
    (folder / name).write_bytes(obj(surface))
    return name


def areas(links):
    return [area(surface) for surface in links]


def corners(surface):
    return {tuple(point) for point in np.round(surface.reshape(-1, 3), 9) + 0.0}


def test_what_is_fixed_to_a_link_belongs_to_it_and_links_without_geometry_have_no_triangles(
    tmp_path,
):
    piece = visual(BOX, '<origin xyz="0 0.5 0"/>')
    built = robot(tmp_path, arm=visual(BOX), tool=piece)
    links = triangles(built)
    assert link_names(built) == ("arm", "slide")
    assert links[1].shape == (0, 3, 3)
    # The tool's axes are turned about z by a quarter and lie at z = 5.
    tool = {(-0.5 + y, x, 5 + z) for x in (-0.5, 0.5) for y in (-1, 1) for z in (-1.5, 1.5)}
    assert corners(links[0]) == tool | corners(urdf.box(1, 2, 3))


@pytest.mark.parametrize(
    ("scale", "expected"),
    [
        ("0.001 -0.001 0.001", 22e-6),
        ("2 1 1", 2 * (2 * 2 + 2 * 3 + 2 * 3)),
        ("1 1 -3", 2 * (1 * 2 + 1 * 9 + 2 * 9)),
    ],
)
def test_scales_stretch_and_mirror_a_mesh(tmp_path, scale, expected):
    name = mesh_of(urdf.box(1, 2, 3), tmp_path)
    links = triangles(robot(tmp_path, arm=visual(MESH.format(name, f'scale="{scale}"'))))
    assert np.isclose(area(links[0]), expected, rtol=1e-14)


def test_visual_collision_and_auto_take_their_own_geometry(tmp_path):
    open_box = mesh_of(urdf.box(1, 2, 3)[:10], tmp_path)  # without its upper side
    built = robot(
        tmp_path,
        fixed=visual(BOX),
        arm=visual(MESH.format(open_box, "")) + collision(BOX.replace("1 2 3", "1 1 1")),
        slide=collision('<geometry><sphere radius="1"/></geometry>'),
    )
    ball = area(urdf.sphere(1))
    for geometry, expected in (
        ("visual", [20.0, 0.0]),
        ("collision", [6.0, ball]),
        ("auto", [20.0, ball]),
    ):
        links = triangles(built, geometry)
        assert np.allclose(areas(links), expected, rtol=1e-12), geometry
    with_world = triangles(built, "auto", world=True)  # what is fixed to it comes first
    assert np.allclose(areas(with_world), [22.0, 20.0, ball], rtol=1e-12)


@pytest.mark.parametrize(
    ("drawn", "half", "count", "total"),
    [
        (urdf.box(1, 2, 3), (0.5, 1, 1.5), 12, 22.0),
        (urdf.cylinder(1, 2), (1, 1, 1), 4 * 64, 2 * np.pi * (2 * 0.9996 + 0.9984)),
        (urdf.capsule(1, 2), (1, 1, 2), 64 * 64, 2 * np.pi * (2 * 0.9996 + 2 * 0.9980)),
        (urdf.sphere(1), (1, 1, 1), 5120, 4 * np.pi * 0.9988),
    ],
    ids=["box", "cylinder", "capsule", "sphere"],
)
def test_shapes_are_closed_and_too_small_by_the_documented_error(drawn, half, count, total):
    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(drawn))
    mesh.merge_vertices()
    assert mesh.is_watertight
    assert len(mesh.faces) == count
    assert (mesh.area_faces > 0).all()
    assert mesh.area == pytest.approx(total, rel=5e-5)
    np.testing.assert_allclose(mesh.bounds, [np.negative(half), half], rtol=1e-12)


def test_collision_geometry_is_not_read_if_every_link_has_a_visual(tmp_path):
    broken = collision("<geometry><cone/></geometry>")
    built = robot(tmp_path, arm=visual(BOX) + broken, slide=visual(BOX))
    assert [len(each) for each in triangles(built, "auto")] == [12, 12]
    with pytest.raises(GeometryError, match="collision of link 'arm': <cone> is not known"):
        triangles(built, "collision")
    with pytest.raises(GeometryError, match="<cone> is not known"):
        triangles(robot(tmp_path, arm=visual(BOX) + broken), "auto")


@pytest.mark.slow
def test_every_listed_robot_can_be_drawn_but_one_without_published_meshes():
    bare, refused = [], []
    for name in sorted(ROBOTS.keys() - {"ur3_empty"}):
        try:
            bare += [] if any(areas(triangles(Robot.load(name)))) else [name]
        except MeshError:
            refused.append(name)
    assert refused == ["romeo_laas_small"]
    assert bare == ["simple_humanoid", "simple_humanoid_classical"]


def test_an_unknown_geometry_is_named(tmp_path):
    message = "geometry 'visuals' is not known, expected one of visual, collision, auto"
    with pytest.raises(GeometryError, match=message):
        triangles(robot(tmp_path), "visuals")


@pytest.mark.parametrize(
    ("geometry", "message"),
    [
        ('<sphere radius="1 2"/>', "radius of <sphere> is '1 2', expected 1 finite number$"),
        ('<capsule radius="1"/>', "and length of <capsule> is '1 ', expected 2 finite numbers$"),
        ('<box size="a b c"/>', "size of <box> is 'a b c', expected 3 finite numbers$"),
        ("<cone/>", f"<cone> is not known, {EXPECTED}"),
        ("", f"has no geometry, {EXPECTED}"),
        ('<sphere radius="0"/>', r"visual of link 'arm': <sphere> of size \[0.0\] m, expected"),
        ('<box size="1 1 -1"/>', r"<box> of size \[1.0, 1.0, -1.0\] m, expected more than 0"),
        ('<cylinder radius="inf" length="1"/>', "radius and length of <cylinder> is 'inf 1'"),
        ('<mesh filename="package://a.stl" scale="1 0 1"/>', "scale '1 0 1' flattens the mesh"),
        ('<mesh filename="package://a.stl" scale="nan 1 1"/>', "scale of <mesh> is 'nan 1 1'"),
        ('<mesh filename="https://r/a.stl"/>', "mesh https://r/a.stl: expected a path, file://,"),
        ('<mesh filename="$(find r)/a.stl"/>', r"expected a path, .* xacro replaces \$\(…\)"),
    ],
)
def test_a_shape_of_impossible_size_is_named_with_its_link(tmp_path, geometry, message):
    with pytest.raises(GeometryError, match=message) as caught:
        triangles(robot(tmp_path, arm=visual(f"<geometry>{geometry}</geometry>")))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "scale", "message"),
    [
        (None, "1 1 1", r"mesh package://a.obj: not found in .*names a folder of meshes elsewhere"),
        (TRIANGLE.replace("0 1 0", "2 0 0"), "1 1 1", "a.obj: has an area of 0 m² with its scale"),
        (TRIANGLE, "1e-170 1e-170 1", "a.obj: has an area of 0 m²"),
        (TRIANGLE, "1e200 1e200 1", "a.obj: has an area of inf m²"),
        (TRIANGLE.replace("v", "v 1e7"), "1 1 1", r"lies 1e\+07 m from its joint, .* 1e\+06 m at"),
    ],
)
def test_a_mesh_without_a_surface_is_named(tmp_path, content, scale, message):
    if content is not None:
        (tmp_path / "a.obj").write_text(content)
    built = robot(tmp_path, arm=visual(MESH.format("a.obj", f'scale="{scale}"')))
    with pytest.raises(MeshError, match=message):
        triangles(built)


def test_a_link_with_geometry_that_pinocchio_names_otherwise_is_refused(tmp_path):
    path = tmp_path / "tab.urdf"
    path.write_text(robot(tmp_path, arm=visual(BOX)).path.read_text().replace('"arm"', '"a\tm"'))
    with pytest.raises(GeometryError, match=r"tab.urdf: Pinocchio names link 'a m' otherwise"):
        triangles(Robot.load(path))


def test_a_mesh_may_be_addressed_in_every_way_that_urdfs_do(tmp_path):
    name = mesh_of(urdf.box(1, 2, 3), tmp_path)
    (tmp_path / "package.xml").write_text("<package/>")
    schemes = ("package:///", "package://", "package://p/", "model://p/", "", f"file://{tmp_path}/")
    for address in (scheme + name for scheme in schemes):
        geometry = f'<geometry><mesh filename="{address}"/></geometry>'
        links = triangles(robot(tmp_path, arm=visual(geometry)))
        assert np.isclose(areas(links)[0], 22.0, rtol=1e-15)


SHAPES = {
    "box": urdf.box(0.3, 0.2, 0.5),
    "sphere": urdf.sphere(0.2),
    "rod": urdf.cylinder(0.01, 1.0) + np.array([0.0, 0.0, 0.5]),
    "sheet": urdf.box(1.0, 1.0, 1e-9),
    "two parts": np.concatenate((urdf.sphere(0.1), urdf.box(0.1, 0.1, 0.4) + np.eye(3)[0])),
}


def square(form, twist):
    return float(twist @ form @ twist)


def twists(surface, count=200):
    """Twists under which the surface moves with a root-mean-square speed of 1."""
    random = np.random.default_rng(2)
    form = moments(surface)["mean_square"]
    drawn = np.linalg.solve(np.linalg.cholesky(form).T, random.standard_normal((6, count)))
    return drawn / np.sqrt(np.einsum("is,ij,js->s", drawn, form, drawn))


def test_a_sphere_that_spins_has_no_normal_speed_and_one_that_slides_a_third():
    """The mean-square speed is w² a² 2/3, none of it outwards; or v² / 3 outwards."""
    exact = moments(SHAPES["sphere"])
    spin = np.array([0.0, 0.0, 0.0, 1.0, 2.0, 2.0])
    assert square(exact["mean_square"], spin) == pytest.approx(9 * 0.2**2 * 2 / 3, rel=2e-3)
    assert square(exact["mean_square_normal"], spin) < 3e-4 * square(exact["mean_square"], spin)
    slide = np.array([1.0, 2.0, -2.0, 0.0, 0.0, 0.0])
    assert square(exact["mean_square_normal"], slide) == pytest.approx(9 / 3, rel=1e-12)


def test_a_plate_moves_outwards_only_across_itself():
    form = moments(np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]]))["mean_square_normal"]
    assert square(form, np.array([1.0, 1, 0, 0, 0, 1])) == 0.0
    assert square(form, np.array([0.0, 0, 3, 0, 0, 0])) == pytest.approx(9.0, rel=1e-15)
    # about the x axis the triangle's <y²> is 1/6
    assert square(form, np.array([0.0, 0, 0, 1, 0, 0])) == pytest.approx(1 / 6, rel=1e-15)


def test_cutting_triangles_changes_nothing():
    surface = SHAPES["box"]
    middles = (surface + np.roll(surface, -1, axis=1)) / 2
    corners = np.stack((surface, middles, np.roll(middles, 1, axis=1)), axis=2)
    cut = np.concatenate((corners.reshape(-1, 3, 3), middles))
    for name in ("area", "centroid", "mean_square", "mean_square_normal"):
        assert np.allclose(moments(cut)[name], moments(surface)[name], rtol=1e-13, atol=1e-16)


def test_triangles_without_area_count_for_nothing():
    surface = SHAPES["box"]
    flat = np.concatenate((surface, np.ones((5, 3, 3)), np.zeros((2, 3, 3))))
    assert np.array_equal(moments(flat)["mean_square"], moments(surface)["mean_square"])


@pytest.mark.parametrize("name", SHAPES)
def test_few_points_keep_the_moments_and_give_the_mean_speed_of_any_motion(name, monkeypatch):
    moving = twists(SHAPES[name])
    cloud = reduced(fine(SHAPES[name]), halvings=8)
    assert len(cloud.points) <= 1024
    assert (cloud.weights > 0).all()
    assert cloud.weights.sum() == pytest.approx(1.0, rel=1e-13)
    squares = cloud.weights @ point_speeds(cloud.points, moving) ** 2
    np.testing.assert_allclose(squares, 1.0, rtol=1e-10)
    monkeypatch.setattr("noisemodel.surface.FINENESS", 4.0)
    dense = fine(SHAPES[name])
    exact = dense.weights @ point_speeds(dense.points, moving)
    assert np.allclose(cloud.weights @ point_speeds(cloud.points, moving), exact, rtol=1e-3)


@pytest.mark.parametrize("name", SHAPES)
def test_the_table_gives_the_mean_speed_about_any_axis(name):
    form = moments(SHAPES[name])["mean_square"][3:, 3:]
    dense = fine(SHAPES[name])
    turns = np.random.default_rng(3).standard_normal((3, 300))
    turns = np.hstack((turns, np.linalg.solve(np.linalg.cholesky(form).T, turns), np.eye(3)))
    exact = dense.weights @ point_speeds(dense.points, np.vstack((0 * turns, turns)))
    rounded = rounding(form)
    table = tabulate(reduced(dense, halvings=8), rounded)
    assert np.allclose(turning_speed(table, rounded, turns), exact, rtol=1.5e-3)
    back = turning_speed(table, rounded, -turns)
    assert np.allclose(turning_speed(table, rounded, turns), back, rtol=1e-9)
    assert not turning_speed(table, rounded, np.zeros((3, 2))).any()


@pytest.mark.parametrize("size", [(0.3, 0.2, 0.5), (1.0, 4e-3, 2e-3), (1.0, 1.0, 1e-9)])
def test_points_grow_with_the_surface(size):
    surface = urdf.box(*size) + np.array([0.1, 0.2, 0.3])
    once = fine(surface)
    for factor in (64.0, 2.0**-10):
        larger = fine(factor * surface)
        near = {"rtol": 1e-9, "atol": 1e-12 * factor}
        np.testing.assert_allclose(larger.points, factor * once.points, **near)
        np.testing.assert_allclose(larger.weights, once.weights, rtol=1e-9)


def test_no_more_points_are_placed_than_the_most(monkeypatch):
    box, sheet = urdf.box(0.3, 0.2, 0.5), urdf.box(1.0, 0.3, 1e-3)
    for most in range(200, 3000, 50):
        monkeypatch.setattr("noisemodel.surface.MOST", most)
        assert len(fine(box).points) <= most
        assert len(fine(sheet).points) <= most


def test_mean_distances_of_a_square_sheet_are_the_known_ones():
    """From its centre (sqrt 2 + asinh 1) / 6 sides, from its corner twice that."""
    sheet = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float)
    known = (np.sqrt(2) + np.arcsinh(1)) / 6
    spin = np.array([[0.0, 0, 0, 0, 0, 3]]).T
    for shift, distance in ((-0.5, known), (0.0, 2 * known)):
        cloud = fine(sheet + np.array([shift, shift, 0]))
        mean = cloud.weights @ point_speeds(cloud.points, spin)
        assert mean == pytest.approx(3 * distance, rel=1e-4)
        assert 1000 < len(cloud.points) < 10_000


def test_a_point_on_the_axis_of_a_motion_rests():
    random = np.random.default_rng(7)
    points, turns = random.standard_normal((2, 100, 3))
    moving = np.concatenate((-np.cross(turns, points), turns), axis=1).T
    speeds = point_speeds(points, moving)
    assert 0.0 <= np.diag(speeds).max() < 1e-6
    expected = np.linalg.norm(moving[:3].T + np.cross(turns, points[3]), axis=1)
    np.testing.assert_allclose(speeds[3], expected, atol=1e-6)


CASES = {
    "panda_visual": ("panda", "visual"),
    "solo12_visual": ("solo12", "visual"),
    "double_pendulum_simple_visual": ("double_pendulum_simple", "visual"),
    "panda_collision_mimic": ("panda", "collision"),
}


def test_what_was_computed_once_is_not_computed_again(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    robot = chain(tmp_path, "revolute", "revolute")
    first = Surface.of(robot)
    monkeypatch.setattr("noisemodel.surface.fine", None)
    again = Surface.of(robot)
    assert np.array_equal(first.area, again.area)
    assert np.array_equal(first.mean_square_normal, again.mean_square_normal)
    assert np.array_equal(first.links[1].points.points, again.links[1].points.points)


@pytest.mark.skipif(not GOLDEN.is_dir(), reason="golden/surface is not beside this checkout")
@pytest.mark.parametrize("case", CASES)
def test_surfaces_and_speeds_are_the_golden_ones(case):
    facts = json.loads((GOLDEN / "index.json").read_text())[case]
    golden = np.load(GOLDEN / f"{case}.npz", allow_pickle=False)
    name, geometry = CASES[case]
    robot = Robot.load(name, mimic=facts["mimic"])
    assert robot.path.as_posix().endswith(facts["urdf"])
    surface = Surface.of(robot, geometry)
    links = [surface.joint.tolist().index(joint) for joint in golden["body_joint"]]
    assert np.allclose(surface.area[links], golden["S"], rtol=1e-10, atol=0)
    assert np.allclose(
        [surface.links[link].centroid for link in links], golden["rbar"], rtol=0, atol=1e-10
    )
    assert set(np.flatnonzero(surface.area)) == set(links)

    speeds = {
        kind: surface_speed(robot, surface, golden["q"], golden["v"], kind)[:, links]
        for kind in ("paper", "A", "B", "C", "mean", "rms", "normal")
    }
    exact = {"A": "A", "rms": "rms_exact", "normal": "rmsn_exact"}
    for kind, key in exact.items():
        assert np.allclose(speeds[kind], golden[key], rtol=1e-10, atol=1e-12), kind
    for kind in ("mean", "B", "C"):
        # An order better than asked for, so that other robots find room.
        assert np.allclose(speeds[kind], golden[f"{kind}_quad"], rtol=5e-4, atol=1e-9), kind
    impedance = float(golden["rho"] * golden["c"])
    for kind, key in (("paper", "P_abc_quad"), ("mean", "P_mean_quad"), ("normal", "P_rmsn_exact")):
        power = impedance * (surface.area[links] * speeds[kind] ** 2).sum(axis=1)
        assert np.allclose(power, golden[key], rtol=1e-4, atol=1e-12), kind


def test_a_listed_robot_has_the_same_surface_by_its_name_and_by_its_path():
    by_name = Robot.load("solo12")
    by_path = Robot.load(by_name.path, floating_base=True)
    assert by_path.package_roots == by_name.package_roots
    np.testing.assert_array_equal(Surface.of(by_path).area, Surface.of(by_name).area)
