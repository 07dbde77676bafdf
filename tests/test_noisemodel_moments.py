import numpy as np
import pytest

from noisemodel import shapes
from noisemodel.moments import moments
from noisemodel.quadrature import fine, point_speeds, reduced
from noisemodel.turning import rounding, tabulate, turning_speed

SHAPES = {
    "box": shapes.box(0.3, 0.2, 0.5),
    "sphere": shapes.sphere(0.2),
    "rod": shapes.cylinder(0.01, 1.0) + np.array([0.0, 0.0, 0.5]),
    "sheet": shapes.box(1.0, 1.0, 1e-9),
    "two parts": np.concatenate((shapes.sphere(0.1), shapes.box(0.1, 0.1, 0.4) + np.eye(3)[0])),
}


def square(form, twist):
    return float(twist @ form @ twist)


def twists(surface, count=200):
    """Twists under which the surface moves with a root-mean-square speed of 1."""
    random = np.random.default_rng(2)
    form = moments(surface).mean_square
    drawn = np.linalg.solve(np.linalg.cholesky(form).T, random.standard_normal((6, count)))
    return drawn / np.sqrt(np.einsum("is,ij,js->s", drawn, form, drawn))


def test_surface_of_a_box():
    exact = moments(shapes.box(1.0, 2.0, 3.0) + np.array([5.0, 6.0, 7.0]))
    assert exact.area == pytest.approx(22.0, rel=1e-15)
    assert np.allclose(exact.centroid, [5.0, 6.0, 7.0], rtol=1e-15)


def test_all_of_a_sliding_surface_has_one_speed():
    form = moments(SHAPES["two parts"]).mean_square
    assert square(form, np.array([1.0, 2.0, -2.0, 0.0, 0.0, 0.0])) == pytest.approx(9.0, rel=1e-14)


def test_a_sphere_that_spins_has_no_normal_speed():
    """The mean-square speed is w² a² 2/3, none of it outwards."""
    exact = moments(SHAPES["sphere"])
    spin = np.array([0.0, 0.0, 0.0, 1.0, 2.0, 2.0])
    assert square(exact.mean_square, spin) == pytest.approx(9 * 0.2**2 * 2 / 3, rel=2e-3)
    assert square(exact.mean_square_normal, spin) < 3e-4 * square(exact.mean_square, spin)


def test_a_sphere_that_slides_moves_a_third_of_its_square_outwards():
    form = moments(SHAPES["sphere"]).mean_square_normal
    slide = np.array([1.0, 2.0, -2.0, 0.0, 0.0, 0.0])
    assert square(form, slide) == pytest.approx(9 / 3, rel=1e-12)


def test_a_plate_moves_outwards_only_across_itself():
    form = moments(np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])).mean_square_normal
    assert square(form, np.array([1.0, 1, 0, 0, 0, 1])) == 0.0
    assert square(form, np.array([0.0, 0, 3, 0, 0, 0])) == pytest.approx(9.0, rel=1e-15)
    # about the x axis the triangle's <y²> is 1/6
    assert square(form, np.array([0.0, 0, 0, 1, 0, 0])) == pytest.approx(1 / 6, rel=1e-15)


def test_parts_add_up():
    surface = SHAPES["two parts"]
    whole, left, right = moments(surface), moments(surface[:3000]), moments(surface[3000:])
    assert whole.area == pytest.approx(left.area + right.area, rel=1e-14)
    for name in ("centroid", "mean_square", "mean_square_normal"):
        together = left.area * getattr(left, name) + right.area * getattr(right, name)
        assert np.allclose(whole.area * getattr(whole, name), together, rtol=1e-13, atol=1e-15)


def test_cutting_triangles_changes_nothing():
    surface = SHAPES["box"]
    middles = (surface + np.roll(surface, -1, axis=1)) / 2
    corners = np.stack((surface, middles, np.roll(middles, 1, axis=1)), axis=2)
    cut = np.concatenate((corners.reshape(-1, 3, 3), middles))
    for name in ("area", "centroid", "mean_square", "mean_square_normal"):
        assert np.allclose(
            getattr(moments(cut), name), getattr(moments(surface), name), rtol=1e-13, atol=1e-16
        )


def test_triangles_without_area_count_for_nothing():
    surface = SHAPES["box"]
    flat = np.concatenate((surface, np.ones((5, 3, 3)), np.zeros((2, 3, 3))))
    assert np.array_equal(moments(flat).mean_square, moments(surface).mean_square)


def test_no_triangles_have_no_moments():
    nothing = moments(np.empty((0, 3, 3)))
    assert nothing.area == 0.0
    assert not nothing.mean_square.any()
    assert not nothing.mean_square_normal.any()


@pytest.mark.parametrize("name", SHAPES)
def test_few_points_keep_the_moments_and_have_positive_weights(name):
    exact = moments(SHAPES[name])
    cloud = reduced(fine(SHAPES[name]), halvings=8)
    assert len(cloud.points) <= 1024
    assert (cloud.weights > 0).all()
    assert cloud.weights.sum() == pytest.approx(1.0, rel=1e-13)
    for twist in twists(SHAPES[name], count=20).T:
        squares = cloud.weights @ point_speeds(cloud.points, twist[:, None]) ** 2
        assert squares[0] == pytest.approx(square(exact.mean_square, twist), rel=1e-10)


@pytest.mark.parametrize("name", SHAPES)
def test_few_points_give_the_mean_speed_of_any_motion(name, monkeypatch):
    moving = twists(SHAPES[name])
    cloud = reduced(fine(SHAPES[name]), halvings=8)
    monkeypatch.setattr("noisemodel.quadrature.FINENESS", 4.0)
    dense = fine(SHAPES[name])
    exact = dense.weights @ point_speeds(dense.points, moving)
    assert np.allclose(cloud.weights @ point_speeds(cloud.points, moving), exact, rtol=1e-3)


@pytest.mark.parametrize("name", SHAPES)
def test_the_table_gives_the_mean_speed_about_any_axis(name):
    form = moments(SHAPES[name]).mean_square[3:, 3:]
    dense = fine(SHAPES[name])
    turns = np.random.default_rng(3).standard_normal((3, 300))
    turns = np.hstack((turns, np.linalg.solve(np.linalg.cholesky(form).T, turns), np.eye(3)))
    exact = dense.weights @ point_speeds(dense.points, np.vstack((0 * turns, turns)))
    rounded = rounding(form)
    table = tabulate(reduced(dense, halvings=8), rounded)
    assert np.allclose(turning_speed(table, rounded, turns), exact, rtol=1.5e-3)
    back = turning_speed(table, rounded, -turns)
    assert np.allclose(turning_speed(table, rounded, turns), back, rtol=1e-9)


@pytest.mark.parametrize("size", [(0.3, 0.2, 0.5), (1.0, 4e-3, 2e-3), (1.0, 1.0, 1e-9)])
def test_points_grow_with_the_surface(size):
    surface = shapes.box(*size) + np.array([0.1, 0.2, 0.3])
    once = fine(surface)
    for factor in (64.0, 2.0**-10):
        larger = fine(factor * surface)
        near = {"rtol": 1e-9, "atol": 1e-12 * factor}
        np.testing.assert_allclose(larger.points, factor * once.points, **near)
        np.testing.assert_allclose(larger.weights, once.weights, rtol=1e-9)


def test_no_more_points_are_placed_than_the_most(monkeypatch):
    box, sheet = shapes.box(0.3, 0.2, 0.5), shapes.box(1.0, 0.3, 1e-3)
    for most in range(200, 3000, 50):
        monkeypatch.setattr("noisemodel.quadrature.MOST", most)
        assert len(fine(box).points) <= most
        assert len(fine(sheet).points) <= most


def test_mean_distances_of_a_square_sheet_are_the_known_ones():
    """From its centre (sqrt 2 + asinh 1) / 6 sides, from its corner twice that."""
    sheet = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float)
    known = (np.sqrt(2) + np.arcsinh(1)) / 6
    spin = np.array([[0.0, 0, 0, 0, 0, 3]]).T
    for shift, distance in ((-0.5, known), (0.0, 2 * known)):
        cloud = fine(sheet + np.array([shift, shift, 0]))
        assert cloud.weights @ point_speeds(cloud.points, spin) == pytest.approx(
            3 * distance, rel=1e-4
        )
        assert 1000 < len(cloud.points) < 10_000


def test_mean_distance_of_a_sphere_from_its_axis():
    """The mean of a sin(theta) over the sphere is pi a / 4."""
    dense = fine(SHAPES["sphere"])
    spin = np.array([[0.0, 0, 0, 0, 0, 1]]).T
    assert dense.weights @ point_speeds(dense.points, spin) == pytest.approx(
        np.pi * 0.2 / 4, rel=1e-3
    )


def test_a_point_on_the_axis_of_a_motion_rests():
    random = np.random.default_rng(7)
    points, turns = random.standard_normal((2, 100, 3))
    moving = np.concatenate((-np.cross(turns, points), turns), axis=1).T
    speeds = point_speeds(points, moving)
    assert 0.0 <= np.diag(speeds).max() < 1e-6
    expected = np.linalg.norm(moving[:3].T + np.cross(turns, points[3]), axis=1)
    np.testing.assert_allclose(speeds[3], expected, atol=1e-6)


def test_no_rotation_has_no_speed():
    form = moments(SHAPES["box"]).mean_square[3:, 3:]
    rounded = rounding(form)
    table = tabulate(fine(SHAPES["box"]), rounded)
    assert not turning_speed(table, rounded, np.zeros((3, 2))).any()
