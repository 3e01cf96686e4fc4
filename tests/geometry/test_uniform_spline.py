"""A B-spline span by span, against SciPy's."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import BSpline

from pfsc_drake.geometry.paths.uniform_spline import UniformSpline

DEGREES = [3, 4, 5, 6]


def whole(degree, points):
    """Return SciPy's spline whose span i begins at theta = i."""
    knots = np.arange(len(points) + degree + 1) - degree
    return BSpline(knots.astype(float), points, degree)


@pytest.fixture(name="points")
def fixture_points():
    random = np.random.default_rng(4)
    way = np.linspace(0.0, 1.0, 14)
    line = np.stack([way, 0.1 * np.sin(6.0 * way), 0.3 * way**2], axis=1)
    return line + 2e-3 * random.standard_normal(line.shape)


@pytest.mark.parametrize("degree", DEGREES)
def test_derivatives_are_those_of_the_whole_spline(degree, points):
    spline, own = whole(degree, points), UniformSpline(degree)
    function = own.point_function(3, degree)
    for span in range(len(points) - degree):
        for u in (0.0, 0.3, 0.99):
            part = points[span : span + degree + 1].ravel()
            found = np.array(function(part, u)).reshape(degree + 1, 3)
            expected = [spline(span + u, nu=k) for k in range(degree + 1)]
            np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("degree", DEGREES)
def test_length_is_the_integral_of_the_slope(degree, points):
    spline, own = whole(degree, points), UniformSpline(degree)
    for u in (0.4, 1.0):
        expected, _ = quad(
            lambda theta: np.linalg.norm(spline(theta, nu=1)), 2.0, 2.0 + u, epsabs=1e-14
        )
        found = float(own.length(points[2 : 3 + degree].ravel(), u))
        assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("degree", DEGREES)
def test_sharpened_control_points_pass_near_the_waypoints(degree):
    """Beside a circle of radius R the error is of the fourth order of the distance over R."""
    own, radius = UniformSpline(degree), 0.1

    def miss(distance, sharp):
        angles = distance / radius * np.arange(-9, 10)
        way = radius * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
        control = way.copy()
        if sharp:
            control[1:-1] -= own.sharpening * (way[:-2] - 2.0 * way[1:-1] + way[2:])
        return np.linalg.norm(whole(degree, control[1:-1])(own.site(8)) - way[9])

    assert miss(0.02, True) < 0.06 * miss(0.02, False)
    assert miss(0.02, True) / miss(0.01, True) == pytest.approx(16.0, rel=0.1)


@pytest.mark.parametrize("degree", DEGREES)
def test_shape_of_a_circle(degree):
    own, step = UniformSpline(degree), 0.1
    angles = step * np.arange(degree + 1)
    points = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    curvature, jerk = np.array(own.shape(points.ravel())).ravel()
    assert curvature == pytest.approx(1.0, rel=0.01)
    assert jerk == pytest.approx(1.0, rel=0.02)
