"""Projection against closed forms and another minimizer; borders, centres, bad input."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    FourierCurve,
    GlobalProjector,
    SurfaceProjector,
    Turned,
    cylinder,
    extruded_surface,
    paraboloid,
    plane,
    rotation_from_axes,
    sphere,
    torus,
    zyx_to_matrix,
)

ORIGIN = np.array([0.3, -0.2, 0.7])
R = zyx_to_matrix([0.4, -0.7, 1.1])
TURNED = Turned(ORIGIN, R)


def _place(x, y, z):
    return ORIGIN + R @ [x, y, z]


def _near(a, b):
    """Whether angles agree, but for whole turns."""
    return math.remainder(a - b, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-11)


def _random(count):
    rng = np.random.default_rng(11)
    return [(rng.uniform(-3, 3), rng.uniform(-1, 1), rng.uniform(-0.6, 0.6)) for _ in range(count)]


@pytest.fixture(name="projectors", scope="module")
def fixture_projectors():
    """Return what projects onto a surface of each kind."""
    surfaces = {
        "cylinder": cylinder(0.09, (-0.1, 0.1), TURNED),
        "sphere": sphere(0.2, (-1.35, 1.35), TURNED),
        "torus": torus(0.5, 0.1, TURNED),
    }
    return {name: GlobalProjector(surface) for name, surface in surfaces.items()}


@pytest.mark.parametrize(("u", "v", "xi"), _random(12))
def test_on_a_cylinder(projectors, u, v, xi):
    """From outside and inside: alpha = -xi / r."""
    radius = 0.09 * (1.0 + xi)
    point = _place(radius * math.cos(u), radius * math.sin(u), 0.1 * v)
    closest_point = projectors["cylinder"].project(point)
    assert closest_point.converged
    assert not closest_point.at_border
    assert _near(closest_point.theta[0], u)
    assert closest_point.theta[1] == pytest.approx(0.1 * v, abs=1e-13)
    assert closest_point.distance == pytest.approx(0.09 * abs(xi), abs=1e-14)
    assert closest_point.alpha == pytest.approx(max(-xi, 0.0), abs=1e-12)


def test_start_of_the_experiment_on_a_cylinder():
    """Section 4.8.1: the initial parameters, as printed."""
    rotation = rotation_from_axes((0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    turned = Turned((0.0, 0.0, 0.505), rotation, inward=True)
    closest_point = GlobalProjector(cylinder(0.09, (-0.1, 0.2), turned)).project(
        [0.0899, -0.0628, 0.5092]
    )
    assert closest_point.theta == pytest.approx((0.0467, -0.0628), abs=5e-5)


@pytest.mark.parametrize(("u", "v", "xi"), _random(12))
def test_on_a_sphere(projectors, u, v, xi):
    radius = 0.2 * (1.0 + xi)
    latitude = 1.3 * v
    flat = radius * math.cos(latitude)
    point = _place(flat * math.cos(u), flat * math.sin(u), radius * math.sin(latitude))
    closest_point = projectors["sphere"].project(point)
    assert closest_point.converged
    assert _near(closest_point.theta[0], u)
    assert closest_point.theta[1] == pytest.approx(latitude, abs=1e-11)
    assert closest_point.alpha == pytest.approx(-xi, abs=1e-9)


@pytest.mark.parametrize(("u", "v", "xi"), _random(12))
def test_on_a_torus(projectors, u, v, xi):
    angle = 3.0 * v
    tube = 0.1 * (1.0 + xi)
    flat = 0.5 + tube * math.cos(angle)
    point = _place(flat * math.cos(u), flat * math.sin(u), tube * math.sin(angle))
    closest_point = projectors["torus"].project(point)
    assert closest_point.converged
    assert _near(closest_point.theta[0], u)
    assert _near(closest_point.theta[1], angle)
    ring = 0.5 + 0.1 * math.cos(angle)
    expected = max(-xi, -0.1 * xi * math.cos(angle) / ring)
    assert closest_point.alpha == pytest.approx(expected, abs=1e-11)


@pytest.mark.slow
def test_on_random_paraboloids():
    """Against a minimizer with bounds that uses differences of the distance alone."""
    rng = np.random.default_rng(17)
    borders = 0
    for _ in range(15):
        c = rng.uniform(0.2, 3.0)
        size = ((-rng.uniform(0.1, 0.5), rng.uniform(0.1, 0.5)), (-0.3, 0.3))
        surface = paraboloid(size, c, ORIGIN, R)
        u, v = rng.uniform(-0.6, 0.6, size=2)
        point = _place(u, v, c * (u**2 + v**2) + rng.uniform(-0.2, 0.2) / c)
        local = R.T @ (point - ORIGIN)

        def squared(theta, c=c, local=local):
            return (
                (theta[0] - local[0]) ** 2
                + (theta[1] - local[1]) ** 2
                + (c * (theta[0] ** 2 + theta[1] ** 2) - local[2]) ** 2
            )

        starts = [(a, b) for a in np.linspace(*size[0], 3) for b in np.linspace(*size[1], 3)]
        best = min(
            (minimize(squared, start, bounds=size, tol=1e-14) for start in starts),
            key=lambda result: result.fun,
        )
        closest_point = GlobalProjector(surface).closest_points(point)[0]
        borders += closest_point.at_border
        assert closest_point.converged
        assert closest_point.distance <= math.sqrt(best.fun) + 1e-12
        assert closest_point.distance == pytest.approx(math.sqrt(best.fun), rel=1e-6)
    assert borders > 3


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [
        (0.5, 2.7, (0.5, 2.0)),
        (-0.3, 0.7, (0.0, 0.7)),
        (1.4, -0.2, (1.0, 0.0)),
        (-2.0, 5.0, (0.0, 2.0)),
    ],
    ids=["side", "other side", "corner", "far corner"],
)
def test_beyond_borders_of_a_plane(x, y, expected):
    surface = plane((1.0, 2.0), ORIGIN, R)
    for guess in [(0.5, 1.0), (0.0, 0.0), (1.0, 2.0), (0.0, 2.0), (5.0, -5.0)]:
        closest_point = SurfaceProjector(surface).project(_place(x, y, 0.2), guess)
        assert closest_point.converged
        assert closest_point.at_border
        assert closest_point.theta == pytest.approx(expected, abs=1e-13)
        assert closest_point.distance == pytest.approx(
            math.dist((x, y, 0.2), (*expected, 0.0)), abs=1e-13
        )


def test_along_a_slanted_border_the_other_parameter_is_optimal():
    """Of a graph whose tangents are not orthogonal there: one parameter held, the other free."""
    surface = paraboloid(((-0.2, 0.2), (-0.3, 0.3)), 2.0)
    point = [0.5, 0.2, 0.1]
    closest_point = SurfaceProjector(surface).project(point, (0.0, -0.2))
    assert closest_point.theta[0] == 0.2
    position, _, second = surface.partials(closest_point.theta, 1)
    assert abs((point - position) @ second) < 1e-12
    along = np.linspace(-0.3, 0.3, 20001)
    line = surface.partials(np.column_stack([np.full_like(along, 0.2), along]), 0)[:, 0]
    assert closest_point.distance <= np.linalg.norm(line - point, axis=1).min() + 1e-12


def test_on_a_border_is_not_beyond_it():
    surface = cylinder(0.09, (-0.1, 0.1), TURNED)
    for height, beyond in [(0.1, False), (0.1 + 1e-6, True), (0.1 - 1e-6, False)]:
        closest_point = SurfaceProjector(surface).project(_place(0.1, 0.0, height), (0.3, 0.05))
        assert closest_point.converged
        assert closest_point.at_border == beyond


def test_at_the_centre_of_curvature():
    """H is singular on the axis of a cylinder, where alpha is one; beyond it, larger."""
    project = SurfaceProjector(cylinder(0.09, (-0.1, 0.1))).project
    closest_point = project([0.0, 0.0, 0.03], (1.0, 0.03))
    assert closest_point.alpha == pytest.approx(1.0, abs=1e-14)
    side = -0.02 * np.array([math.cos(1.0), math.sin(1.0), 0.0])
    closest_point = project(side, (1.0, 0.0))
    assert closest_point.alpha == pytest.approx(11.0 / 9.0, abs=1e-12) or closest_point.alpha < 1.0
    closest_point = SurfaceProjector(paraboloid((0.3, 0.3), 2.0)).project(
        [0.0, 0.0, 0.25], (0.0, 0.0)
    )
    assert closest_point.alpha == pytest.approx(1.0, abs=1e-14)


def test_from_the_far_side_it_finds_the_near_one():
    """Where H is not definite the way goes downhill."""
    surface = sphere(0.2, (-1.35, 1.35))
    closest_point = SurfaceProjector(surface).project([0.25, 0.02, 0.01], (3.0, 0.4))
    assert closest_point.converged
    assert closest_point.distance == pytest.approx(math.dist((0.25, 0.02, 0.01), (0, 0, 0)) - 0.2)


def test_it_stays_on_its_sheet():
    """Started from the last place, through a crossing of the surface with itself."""
    eight = FourierCurve([0, 0, 0], [[0.2, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0.1, 0]])
    surface = extruded_surface(eight, (0.0, 0.0, 1.0), 0.3)
    project = SurfaceProjector(surface).project
    theta = (1.2, 0.1)
    for angle in np.linspace(1.2, 2.0, 200):
        closest_point = project(surface.partials([angle, 0.1], 0)[0], theta)
        theta = closest_point.theta
        assert theta == pytest.approx((angle, 0.1), abs=1e-10)


@pytest.fixture(name="project", scope="module")
def fixture_project():
    return SurfaceProjector(cylinder(0.09, (-0.1, 0.1))).project


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("where", range(5))
def test_input_that_is_not_finite(project, bad, where):
    values = [0.1, 0.0, 0.0, 0.2, 0.0]
    values[where] = bad
    closest_point = project(values[:3], (values[3], values[4]))
    assert not closest_point.converged
    assert math.isnan(closest_point.alpha)


def test_global_start_refuses_what_is_not_clear():
    start = GlobalProjector(cylinder(0.09, (-0.1, 0.1)))
    with pytest.raises(InputError, match=r"no closest point .* as far as its centre of curvature"):
        start.project([0.0, 0.0, 0.02])
    with pytest.raises(InputError, match="3 finite numbers"):
        start.project([0.0, math.nan, 0.02])
    eight = FourierCurve([0, 0, 0], [[0.2, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0.1, 0]])
    crossing = GlobalProjector(extruded_surface(eight, (0.0, 0.0, 1.0), 0.3))
    with pytest.raises(InputError, match=r"from the surface at theta = \[.*\] and .*nearer to one"):
        crossing.project([0.0, 0.03, 0.1])
    closest_point = crossing.project([0.03, 0.017, 0.1])
    assert closest_point.converged


def test_closest_points_are_sorted_and_distinct():
    start = GlobalProjector(torus(0.5, 0.1))
    closest_points = start.closest_points([0.3, 0.0, 0.0])
    strict = [closest_point for closest_point in closest_points if closest_point.converged]
    assert strict[0].distance == pytest.approx(0.1)
    assert [closest_point.distance for closest_point in strict] == sorted(
        closest_point.distance for closest_point in strict
    )
