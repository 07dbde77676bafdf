import json
from pathlib import Path

import numpy as np
import pytest
from chains import BAR, chain

from noisemodel import GeometryError, Robot, Surface, linksurface, shapes, surface_speed
from noisemodel.geometry import triangles
from noisemodel.linksurface import LinkSurface

GOLDEN = Path(__file__).parents[2] / "shared" / "golden" / "surface"
CASES = {
    "panda_visual": ("panda", "visual"),
    "solo12_visual": ("solo12", "visual"),
    "double_pendulum_simple_visual": ("double_pendulum_simple", "visual"),
    "panda_collision_mimic": ("panda", "collision"),
}


def test_lever_of_a_bar_is_its_mean_distance_from_the_axis():
    """A thin bar from 0 to 1 m along x: half a metre about z, next to nothing about itself."""
    bar = shapes.box(1.0, 1e-4, 1e-4) + np.array([0.5, 0, 0])
    assert LinkSurface.of(bar, np.array([0.0, 0, 1])).lever == pytest.approx(0.5, rel=1e-3)
    assert LinkSurface.of(bar, np.array([1.0, 0, 0])).lever < 1e-4
    assert LinkSurface.of(bar, np.zeros(3)).lever == 0.0
    assert np.isnan(LinkSurface.of(bar, None).lever)


def test_links_are_those_that_move(tmp_path):
    robot = chain(tmp_path, "revolute", "fixed", "prismatic", floating_base=True)
    surface = Surface.of(robot)
    assert surface.names == ("link0", "link1", "link3")
    assert surface.joint.tolist() == [1, 2, 3]
    assert surface.without_geometry == ("link0",)
    one = 2 * (0.2 * 0.1 + 0.1 * 0.6 + 0.6 * 0.2)
    assert np.allclose(surface.area, [0, 2 * one, one], rtol=1e-14)
    assert surface.lever[2] == 0.0


def test_a_link_without_geometry_is_named_and_silent(tmp_path):
    robot = chain(tmp_path, "revolute", "revolute", shapes=[BAR, ""])
    surface = Surface.of(robot)
    assert surface.without_geometry == ("link2",)
    for kind in ("paper", "mean", "rms", "normal"):
        speed = surface_speed(robot, surface, np.zeros((3, 2)), np.ones((3, 2)), kind)
        assert speed[:, 0].all()
        assert not speed[:, 1].any()


def test_a_mesh_in_two_parts_is_the_same_mesh(tmp_path):
    """Two boxes that touch have the surface of both; one after the other or as one geometry."""
    halves = [
        f'<visual><origin xyz="0 0 {z}"/><geometry><box size="0.2 0.1 0.3"/></geometry></visual>'
        for z in (0.15, 0.45)
    ]
    apart = chain(tmp_path, "revolute", "fixed", shapes=["".join(halves), ""])
    drawn = triangles(apart)
    together = LinkSurface.of(drawn.triangles[0], np.array([0.0, 0, 1]))
    swapped = LinkSurface.of(drawn.triangles[0][::-1].copy(), np.array([0.0, 0, 1]))
    assert together.area == pytest.approx(2 * 0.22, rel=1e-14)
    assert together.lever == pytest.approx(swapped.lever, rel=1e-6)
    assert np.allclose(together.mean_square, swapped.mean_square, rtol=1e-13, atol=1e-16)


def test_geometry_can_be_chosen(tmp_path):
    collision = BAR.replace("visual", "collision").replace("0.6", "1.2")
    robot = chain(tmp_path, "revolute", "revolute", shapes=[BAR + collision, collision])
    assert Surface.of(robot).without_geometry == ("link2",)
    assert Surface.of(robot, "auto").without_geometry == ()
    assert Surface.of(robot, "collision").area[0] > Surface.of(robot, "visual").area[0]
    with pytest.raises(GeometryError, match="'drawing' is not known, expected one of visual"):
        Surface.of(robot, "drawing")


def test_what_was_computed_once_is_not_computed_again(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    robot = chain(tmp_path, "revolute", "revolute")
    first = Surface.of(robot)
    monkeypatch.setattr(linksurface, "fine", None)
    again = Surface.of(robot)
    assert np.array_equal(first.lever, again.lever)
    assert np.array_equal(first.mean_square_normal, again.mean_square_normal)
    assert np.array_equal(first.links[1].points.points, again.links[1].points.points)


def test_a_surface_prints_its_links(tmp_path):
    text = str(Surface.of(chain(tmp_path, "revolute")))
    assert "link1" in text
    assert "area [m²]" in text
    assert "0.4000" in text.splitlines()[-1]


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
    assert np.allclose(surface.centroid[links], golden["rbar"], rtol=0, atol=1e-10)
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
